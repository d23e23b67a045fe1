#!/usr/bin/python3
"""Tables (Markdown) and charts (SVG, PNG) of the figures that scripts/bench.py measured: bench_report.py BUILD/bench."""
import csv
import json
import os
import platform
import statistics
import subprocess
import sys

BASELINE = "OpenCV SGBM 3WAY"
COLOURS = ("#0072B2", "#D55E00", "#009E73")  # of groups; told apart with any colour vision, and on light and dark
SYMBOLS = (4, 12, 9, 5, 7)                    # gnuplot point types of methods: square, diamond, triangle, full square, disc


def cpu_name():
    with open("/proc/cpuinfo") as f:
        for line in f:
            if line.startswith("model name"):
                return " ".join(line.split(":", 1)[1].split())
    return platform.machine()


def read_rounds(path, *key):
    """Rows of a CSV file by key columns, in order of first appearance; numbers are numbers."""
    groups = {}
    with open(path) as f:
        for row in csv.DictReader(f):
            values = {k: v if k in ("pair", "method") else float(v) for k, v in row.items()}
            groups.setdefault(tuple(values[k] for k in key), []).append(values)
    return groups


def median(rows, column):
    return statistics.median(r[column] for r in rows)


def spread(rows):
    return f"{min(r['ms'] for r in rows):.1f}..{max(r['ms'] for r in rows):.1f}"


def ratio(rows, others):
    """Median over the rounds of this time over that of the same round."""
    return statistics.median(a["ms"] / b["ms"] for a, b in zip(rows, others))


def number(value, digits=2):
    return "-" if value is None else f"{value:.{digits}f}"


def table(head, rows):
    lines = [head, ["---"] + ["--:"] * (len(head) - 1)] + rows
    return "\n".join("| " + " | ".join(map(str, line)) + " |" for line in lines) + "\n"


def page(title, command, text):
    return f"# {title}\n\nMade by `{command}` on {cpu_name()}, 2 threads. Do not edit: it is written anew.\n\n{text}"


def chart(out, name, title, x_label, y_label, groups, command):
    """Time against error. groups: {group: [(method, time, error)]}; a group has a colour and its name beside its last
    point, a method a symbol, explained to the right of the data."""
    points = [p for g in groups.values() for p in g]
    methods = list(dict.fromkeys(p[0] for p in points))
    left, right, top = min(p[1] for p in points) / 1.5, max(p[1] for p in points) * 2.2, max(p[2] for p in points) * 1.12
    tics = [m * 10.0 ** e for e in range(-4, 8) for m in (1, 2, 5) if left <= m * 10.0 ** e <= right]
    lines = [f'set title "{title}" font ",15"', f'set xlabel "{x_label}"', f'set ylabel "{y_label}"', "set logscale x",
             f"set xrange [{left}:{right}]", f"set yrange [0:{top}]",
             "set xtics (" + ", ".join(f'"{t:g}" {t:g}' for t in tics) + ")", "set grid lc rgb '#dddddd' lt 1",
             "set border 3 lc rgb '#444444'", "set tics nomirror", "set key outside right top Left reverse samplen 1.5",
             "set bmargin 5.5", "set tmargin 3",
             f'set label "{command}; {cpu_name()}, 2 threads" at screen 0.01, 0.025 font ",9" tc rgb "#555555" noenhanced']
    names = sorted(((max(g, key=lambda p: p[1]), group) for group, g in groups.items()), key=lambda n: n[0][2])
    lowest = 0.0
    for (_, x, y), group in names:  # names of points that lie close together move up, one text height apart
        lowest = max(y, lowest)
        colour = COLOURS[list(groups).index(group)]
        lines.append(f'set label "{group}" at {x}, {lowest} left offset 1.5, 0 tc rgb "{colour}" noenhanced')
        lowest += top * 0.05
    plots = []
    for i, (group, g) in enumerate(groups.items()):
        lines += [f"$g{i} << EOD"] + [f"{x} {y} {SYMBOLS[methods.index(m)]}" for m, x, y in g] + ["EOD"]
        lines += [f"$l{i} << EOD"] + [f"{x} {y}" for m, x, y in g if not m.startswith("OpenCV")] + ["EOD"]
        plots += [f"$l{i} with lines lw 1.5 lc rgb '{COLOURS[i]}' notitle",
                  f"$g{i} using 1:2:3 with points pt variable ps 1.4 lw 2 lc rgb '{COLOURS[i]}' notitle"]
    plots += [f"keyentry with points pt {SYMBOLS[i]} ps 1.4 lw 2 lc rgb '#444444' title \"{m}\"" for i, m in enumerate(methods)]
    made = []
    for kind, terminal in (("svg", 'svg size 860,520 font "sans,12" background "#ffffff"'),
                           ("png", 'pngcairo size 1290,780 font "sans,12" fontscale 1.4 background "#ffffff"')):
        made.append(f"{out}/{name}.{kind}")
        script = [f"set terminal {terminal}", f"set output '{made[-1]}'"] + lines + ["plot " + ", \\\n".join(plots)]
        subprocess.run(["gnuplot"], input="\n".join(script) + "\n", text=True, check=True)
    return made


def write_page(out, name, text):
    with open(f"{out}/{name}.md", "w") as f:
        f.write(text)
    return [f"{out}/{name}.md"]


def stereo(source, out, command):
    by_method = read_rounds(source, "pair", "method")
    parts, groups = [], {}
    for pair in dict.fromkeys(k[0] for k in by_method):
        rows = []
        for (_, method), r in ((k, r) for k, r in by_method.items() if k[0] == pair):
            rows.append([method, f"{median(r, 'ms'):.1f}", spread(r), f"{ratio(r, by_method[pair, BASELINE]):.2f}",
                         f"{median(r, 'cpu_ms'):.1f}"] + [number(r[0][c]) for c in ("bad05", "bad1", "bad2", "bad4", "rmse")])
            groups.setdefault(pair, []).append((method, median(r, "ms"), r[0]["bad2"]))
        parts.append(f"## {pair}, {r[0]['width']:.0f}x{r[0]['height']:.0f}\n\n" + table(
            ["method", "ms", "min..max", "time / 3WAY", "CPU ms", "bad 0.5 %", "bad 1 %", "bad 2 %", "bad 4 %", "RMSE px"], rows))
    text = (f"Middlebury pairs, 64 disparities, {len(r)} interleaved rounds in one process after one to warm up: median,"
            " smallest and largest wall time, median over the rounds of the time relative to OpenCV's SGBM 3WAY, median CPU"
            " time of all threads. Errors over all pixels with truth, hidden ones too. OpenCV's maps are padded, filled and"
            " median-filtered to be dense (tests/bench/sgbm.cc), which its time includes; `sst accurate` loads its network"
            " each time.\n\n![time against error](time-error-stereo.svg)\n\n")
    return (write_page(out, "bench-stereo", page("Stereo: time against error", command, text + "\n".join(parts))) +
            chart(out, "time-error-stereo", "Middlebury pairs, 64 disparities", "time, ms", "pixels off by more than 2 px, %",
                  groups, command))


def render(source, out, command):
    by_method = read_rounds(source, "width", "height", "method")
    parts = []
    for size in dict.fromkeys(k[:2] for k in by_method):
        rows = []
        for (_, _, method), r in ((k, r) for k, r in by_method.items() if k[:2] == size):
            ours = "OpenCV" not in method
            other = by_method[(*size, method if not ours else f"OpenCV {method}")]
            seconds, rays = median(r, "ms") / 1000, 36 * size[0] * size[1]
            rows.append([f"sst {method}" if ours else method, f"{seconds * 1000:.1f}", spread(r), f"{ratio(r, other):.2f}",
                         f"{median(r, 'cpu_ms'):.1f}", f"{rays / seconds / 1e6:.0f}"] +
                        ([f"{r[0]['peak_mib']:.0f}", "-"] if ours else
                         ["-", f"{r[0]['mean_difference']:.2f}, {r[0]['max_difference']:.0f}"]))
        parts.append(f"## 36 views of {size[0]:.0f}x{size[1]:.0f}; the light field takes {r[0]['light_field_mib']:.0f} MiB\n\n" + table(
            ["method", "ms", "min..max", "time / OpenCV", "CPU ms", "million rays / s", "peak MiB", "differs: mean, max"], rows))
    text = (f"One picture from the simulated bush with its true maps, all views, exact mode, {len(r)} interleaved rounds in"
            " one process. OpenCV makes the same sums: bands of rows in parallel, each view by warpAffine (bilinear), blended"
            " in float; its views are interleaved beforehand, and for see-through it gets the weight of every ray"
            " ready-made, while `sst` forms the weights within its time. Time relative to OpenCV: median over the rounds."
            " Peak: largest memory of the process while it made its first picture. The last column is how far OpenCV's"
            " picture is from ours, in grey levels of 0..255 (warpAffine places its samples on 1/32 px).\n\n")
    return write_page(out, "bench-render", page("Rendering: time", command, text + "\n".join(parts)))


PICTURE_HEAD = ["scene", "covered %", "PSNR refocus", "PSNR SST", "gain dB", "PSNR occ. refocus", "PSNR occ. SST",
                "gain occ. dB", "SSIM refocus", "SSIM SST", "SSIM occ. refocus", "SSIM occ. SST"]


def picture_figures(report):
    plain, seen = report["refocus"], report["render"]
    figures = [report["occluders"][0]["covered"]]
    for key in ("psnr", "psnr_occluded"):
        figures += [plain[key], seen[key], seen[key] - plain[key]]
    for key in ("ssim", "ssim_occluded"):
        figures += [plain[key], seen[key]]
    return figures


def picture_table(scenes, reports):
    def line(name, figures):
        return [name] + [number(v, 1) for v in figures[:1]] + [number(v, 2) for v in figures[1:7]] + [number(v, 3) for v in figures[7:]]
    figures = [picture_figures(r) for r in reports]
    rows = [line(s["scene"], f) for s, f in zip(scenes, figures)]
    return table(PICTURE_HEAD, rows + [line("mean", [statistics.mean(c) for c in zip(*figures)])])


def disparity_figures(d):
    return [number(d[k]) for k in ("bad1", "bad2", "rmse")]


def stage_times(r):
    return [f"{r['seconds'][k]:.1f} / {r['cpu_seconds'][k]:.1f}"
            for k in ("load", "labels", "disparity", "refinement", "saving", "total")]


def scene_tables(scenes):
    estimated = [s["presets"]["balanced"] for s in scenes]
    disparity = [[s["scene"], "{:.0f}..{:.0f}".format(*r["searched_px"])] + disparity_figures(r["disparity"]) +
                 disparity_figures(r["disparity"]["nonocc"]) for s, r in zip(scenes, estimated)]
    labels = [[s["scene"]] + [number(r["labels"][k]) for k in ("miou_initial", "miou_hcsm", "coverage_hcsm", "miou_refined",
                                                              "accuracy_initial", "accuracy_refined")]
              for s, r in zip(scenes, estimated)]
    given = "" if scenes[0]["labels"] == "network" else " **The labels were given (true), for the network was absent.**"
    return (f"## See-through with true disparities and labels\n\n{picture_table(scenes, [s['truth'] for s in scenes])}\n"
            f"## See-through with estimated disparities and labels\n\n`sst process --preset balanced`.{given}\n\n"
            f"{picture_table(scenes, estimated)}\n## Disparity, all 36 views, preset balanced\n\n"
            + table(["scene", "searched px", "bad 1 %", "bad 2 %", "RMSE px", "visible: bad 1 %", "bad 2 %", "RMSE px"], disparity)
            + f"\n## Labels, all 36 views\n\nMean IoU, coverage and share of right pixels, percent.{given}\n\n"
            + table(["scene", "mIoU network", "mIoU HCSM", "coverage HCSM", "mIoU refined", "right network", "right refined"], labels)
            + "\n## Time of `sst process --preset balanced`, wall / CPU seconds\n\n"
            + table(["scene", "load", "labels", "disparity", "refinement", "saving", "total"],
                    [[s["scene"]] + stage_times(r) for s, r in zip(scenes, estimated)]))


def preset_part(scenes):
    """Table and chart points of the scenes that were matched with every preset."""
    rows, groups = [], {}
    for s in (s for s in scenes if len(s["presets"]) > 1):
        for preset in ("preview", "balanced", "accurate"):
            r = s["presets"][preset]
            d = r["disparity"]
            rows.append([f"{s['scene']}, {preset}", number(r["seconds"]["disparity"]), number(r["cpu_seconds"]["disparity"])] +
                        [number(d[k]) for k in ("bad05", "bad1", "bad2", "bad4", "rmse")] + [number(d["nonocc"]["bad2"])])
            groups.setdefault(s["scene"], []).append((f"sst {preset}", r["seconds"]["disparity"], d["bad2"]))
    return groups, ("\n## Disparity by preset\n\n![time against error](time-error-scenes.svg)\n\n" + table(
        ["scene, preset", "wall s", "CPU s", "bad 0.5 %", "bad 1 %", "bad 2 %", "bad 4 %", "RMSE px", "visible: bad 2 %"], rows))


def scenes(source, out, command):
    with open(source) as f:
        measured = json.load(f)
    size = measured[0]["size"]
    groups, presets = preset_part(measured)
    text = (f"Simulated scenes, 6x6 views of {size}, seed 1, against their exact truth. PSNR in dB and SSIM of the picture"
            " focused behind the principal occluder, over all pixels and (occ.) over those that the occluder covers, by plain"
            " refocusing and by semantic see-through (SST). \"Visible\" are the pixels whose surface a view beside, above or"
            " below sees too. One run each.\n\n")
    return (write_page(out, "bench-scenes", page("Simulated scenes", command, text + scene_tables(measured) + presets)) +
            chart(out, "time-error-scenes", f"Simulated scenes, disparity of 36 views of {size}", "time, s",
                  "pixels off by more than 2 px, %", groups, command))


def write(folder, command):
    """Tables and charts of what was measured, in folder/docs. Returns their paths."""
    out, made = f"{folder}/docs", []
    os.makedirs(out, exist_ok=True)
    for name, report in (("stereo.csv", stereo), ("render.csv", render), ("scenes.json", scenes)):
        if os.path.exists(f"{folder}/{name}"):
            made += report(f"{folder}/{name}", out, command)
    return made


if __name__ == "__main__":
    quick = os.path.basename(os.path.normpath(sys.argv[1])) == "bench-quick"
    print("\n".join(write(sys.argv[1], "make bench-quick" if quick else "make bench")))
