#!/usr/bin/python3
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
"""Tables (Markdown) and charts (SVG, PNG) of what scripts/bench.py measured: bench_report.py BUILD/bench."""
import json
import math
import os
import statistics
import sys

from bench_limits import limits
from charts import (BASELINE, COLOURS, LIMITED, chart, draw, frame, median, number, page, ratio, read_rounds, spread, suffixes,
                    symbol, table, word, write_page)

STEREO_TEXT = """\
Middlebury pairs, 64 disparities (aloe 240), {rounds} interleaved rounds in one process after one to warm up: median, smallest
and largest wall time, median over the rounds of the time relative to OpenCV's SGBM 3WAY, median CPU time of all
threads. Errors over all pixels with truth, hidden ones too. OpenCV's maps are padded, filled and median-filtered to be
dense (tests/bench/sgbm.cc), which its time includes.

![time against error](time-error-stereo.svg)

"""


def level_head(levels, *columns):
    """Columns of every level, the level's name before the first."""
    return [f"{word(level)}: {c}" if i == 0 else c for level in levels for i, c in enumerate(columns)]


def time_cells(rounds, others):
    """Cells of one level: ms, min..max, time / others, CPU ms; dashes where it was not measured there."""
    if not rounds:
        return ["-"] * 4
    return [f"{median(rounds, 'ms'):.1f}", spread(rounds), f"{ratio(rounds, others):.2f}", f"{median(rounds, 'cpu_ms'):.1f}"]


def stereo(source, out, command):
    measured = read_rounds(source, "pair", "method", "level")
    levels = list(dict.fromkeys(k[2] for k in measured))
    head = ["method"] + level_head(levels, "ms", "min..max", "time / 3WAY", "CPU ms") + [
        "bad 0.5 %", "bad 1 %", "bad 2 %", "bad 4 %", "RMSE px"]
    text, groups = STEREO_TEXT.format(rounds=len(measured["cones", BASELINE, levels[0]])), {}
    for pair in dict.fromkeys(k[0] for k in measured):
        rows, baseline = [], measured[pair, BASELINE, levels[0]]
        for method in dict.fromkeys(k[1] for k in measured if k[0] == pair):
            of = {level: measured.get((pair, method, level)) for level in levels}
            first = of[levels[0]][0]
            rows.append([method] + [cell for r in of.values() for cell in time_cells(r, baseline)] +
                        [number(first[c]) for c in ("bad05", "bad1", "bad2", "bad4", "rmse")])
            groups.setdefault(pair, []).extend((method + end, median(of[level], "ms"), of[level][0]["bad2"])
                                               for level, end in suffixes(levels).items() if of[level])
        text += f"## {pair}, {first['width']:.0f}x{first['height']:.0f}\n\n{table(head, rows)}\n"
    return (write_page(out, "bench-stereo", page("Stereo: time against error", command, text, levels)) +
            chart(out, "time-error-stereo", "Middlebury pairs, 64 disparities (aloe 240)",
                  ("time, ms", "pixels off by more than 2 px, %"), groups, command))


RENDER_TEXT = """\
One picture from the simulated bush with its true maps, {rounds} interleaved rounds in one process. Error: root mean square and
largest difference from the picture of all views that double precision gives, before rounding to bytes (which alone makes
0.289 and 0.5), in grey levels of 0..255, at every 35th pixel. OpenCV makes the same sums: bands of rows in parallel,
each view by warpAffine (bilinear, samples on 1/32 px), blended in float; its views are interleaved beforehand, and for
see-through it gets the weight of every ray ready-made, while `sst` forms the weights within its time. *N views*: those
nearest to the viewpoint alone (`--max-views`). *Skips*: `--skip rays` at 50 dB. Time relative to OpenCV: median over the rounds; a clear picture is
compared with see-through ones made in turn with it. Peak: largest memory of the process while it made its first
picture. Rays are not verified (`--verify-rays off`).

![time against error](time-error-render.svg)

"""
RENDER_SYMBOLS = {"": 7, "OpenCV": 2, "skips": 15, "25 views": 5, "16 views": 9, "9 views": 11, "4 views": 13}


def render_cells(method, rounds, others):
    """Cells of one level: as time_cells(), and million rays / s."""
    if not rounds:
        return ["-"] * 5
    views = int(method.split(", ")[1].split()[0]) if method.endswith(" views") else 36
    return [*time_cells(rounds, others),
            f"{views * rounds[0]['width'] * rounds[0]['height'] / median(rounds, 'ms') / 1e3:.0f}"]


def render_row(method, of, others):
    """of, others: {level: rounds}; `others` at each level or, of OpenCV, one for all."""
    first = next(iter(of.values()))[0]
    exact = not math.isnan(first["error_rms"])
    return [method if method.startswith("OpenCV") else f"sst {method}",
            *(cell for level, r in of.items() for cell in render_cells(method, r, others.get(level) or next(iter(others.values())))),
            f"{first['error_rms']:.3f}, {first['error_most']:.2f}" if exact else "-"]


def render(source, out, command):
    measured = read_rounds(source, "level", "width", "height", "method")
    levels, sizes = (list(dict.fromkeys(k[part] for k in measured)) for part in (slice(0, 1), slice(1, 3)))
    levels = [level for level, in levels]
    head = ["method"] + level_head(levels, "ms", "min..max", "time / OpenCV", "CPU ms", "million rays / s") + ["error: RMS, largest"]
    text, groups = RENDER_TEXT.format(rounds=len(next(iter(measured.values())))), {}
    for size in sizes:
        methods = {k[3]: {level: measured.get((level, *size, k[3])) for level in levels} for k in measured if k[1:3] == size}
        rows = []
        for kind in ("refocus", "see-through"):
            for method, of in methods.items():
                if method.removeprefix("OpenCV ").split(",")[0] != kind:
                    continue
                rows.append(render_row(method, of, methods[f"OpenCV {kind}"]))
                variant = method.partition(" ")[0] if method.startswith("OpenCV") else method.partition(", ")[2]
                if size == sizes[0]:
                    groups.setdefault(kind, []).extend((variant + end, median(of[level], "ms"), of[level][0]["error_rms"])
                                                       for level, end in suffixes(levels).items() if of[level])
        rows.append([f"{cell} of see-through" if i in (3, 8) and cell != "-" else cell for i, cell in
                     enumerate(render_row("clear", methods["clear"], methods["see-through beside clear"]))])
        first, clear = (methods[m][levels[0]][0] for m in ("see-through", "clear"))
        text += (f"## 36 views of {size[0]:.0f}x{size[1]:.0f}\n\nThe light field takes {first['light_field_mib']:.0f} MiB; peak "
                 f"{first['peak_mib']:.0f} MiB, clear {clear['peak_mib']:.0f} MiB.\n\n{table(head, rows)}\n")
    title = f"Rendering 36 views of {sizes[0][0]:.0f}x{sizes[0][1]:.0f}"
    return (write_page(out, "bench-render", page("Rendering: time against error", command, text, levels)) +
            render_chart(out, title, groups, levels, command))


def render_chart(out, title, groups, levels, command):
    """Pictures of all views, of fewer, and OpenCV's; a line joins ours, dashed with AVX2."""
    points = [p for g in groups.values() for p in g]
    x = (min(p[1] for p in points) / 1.5, max(p[1] for p in points) * 2)
    y = (0.2, max(p[2] for p in points) * 1.5)
    lines, plots = frame(title, ("time, ms", "RMS error, grey levels"), x, y, True,
                         command), []
    lines += [f'set arrow from graph 0, first {12 ** -0.5} to graph 1, first {12 ** -0.5} nohead dt 2 lc rgb "#888888"',
              f'set label "rounding to bytes" at graph 0.02, first {0.82 * 12 ** -0.5} tc rgb "#666666"']
    for i, (kind, points) in enumerate(groups.items()):
        lines += [f"$g{i} << EOD"] + [f"{t} {e} {symbol(v, RENDER_SYMBOLS)}" for v, t, e in points] + ["EOD"]
        plots.append(f"$g{i} using 1:2:3 with points pt variable ps 1.4 lw 2 lc rgb '{COLOURS[i]}' notitle")
        for level, end in suffixes(levels).items():
            joined = [f"{t} {e}" for v, t, e in points
                      if v.endswith(LIMITED) == bool(end) and v.removesuffix(LIMITED) not in ("OpenCV", "skips")]
            lines += [f"$l{i}{level} << EOD"] + joined + ["EOD"]
            plots.append(f"$l{i}{level} with lines dt {2 if end else 1} lw 1.5 lc rgb '{COLOURS[i]}' title \"{kind}, {word(level)}\"")
    for variant, point in RENDER_SYMBOLS.items():
        plots.append(f"keyentry with points pt {point} ps 1.4 lw 2 lc rgb '#444444' title \"{variant or 'all views'}\"")
    if len(levels) > 1:
        plots.append("keyentry with points pt 6 ps 1.4 lw 2 lc rgb '#444444' title 'open: AVX2'")
    return draw(out, "time-error-render", lines + ["plot " + ", \\\n".join(plots)])


RECTIFY_TEXT = """\
A view of 2000x1500 with a lens of 8 coefficients, map ready, validity left out, one thread, {rounds} interleaved rounds:
CPU time per megapixel. OpenCV's `remap` finds the place of every pixel in a table of 6 bytes (convertMaps, 1/32 px) and its
picture interleaved; `sst` computes the place from cells of 2 KiB to 100 KiB a view (1/256 px) and interleaves the picture
within its time. Error: difference from the same filter in double at the exact place, in grey levels, of which rounding to
bytes is 0.289 RMS (OpenCV's bicubic and lanczos are other kernels, of 4x4 and 8x8 taps; ours have 4x4 and 6x6). *Moved*,
*turned*: PSNR of the Middlebury picture aloe after a true move by half a pixel, and after a turn by 2 degrees and back.

![time against error](time-error-rectify.svg)

"""


def rectify(source, out, command):
    measured = read_rounds(source, "method", "level")
    levels = list(dict.fromkeys(k[1] for k in measured))
    head = ["method"] + level_head(levels, "ms / megapixel", "time / OpenCV") + ["error: RMS, largest", "moved, dB", "turned, dB"]
    rows, points = [], []
    for method in dict.fromkeys(k[0] for k in measured):
        name, cells = method.removeprefix("OpenCV "), []
        others, first = measured[f"OpenCV {name}", levels[0]], measured[method, levels[0]][0]
        for level, end in suffixes(levels).items():
            r = measured.get((method, level))
            cells += [number(median(r, "ms_per_mpx"), 1), f"{ratio(r, others):.2f}"] if r else ["-", "-"]
            if r:
                whose = "OpenCV remap" if method != name else f"sst, {word(level)}"
                points.append((whose, name, median(r, "ms_per_mpx"), 255 * 10 ** (-r[0]["moved_db"] / 20)))
        rows.append([method if method != name else f"sst {name}", *cells, f"{first['error_rms']:.3f}, {first['error_most']:.2f}",
                     number(first["moved_db"]), number(first["turned_db"])])
    text = RECTIFY_TEXT.format(rounds=len(next(iter(measured.values())))) + table(head, rows)
    times, errors = [p[2] for p in points], [p[3] for p in points]
    lines = frame("Rectification", ("CPU time, ms per megapixel",
                  "RMS error of a move by half a pixel, grey levels"),
                  (min(times) / 1.5, max(times) * 1.7), (0, max(errors) * 1.15), False, command)
    plots = []
    for i, whose in enumerate(dict.fromkeys(p[0] for p in points)):
        lines += [f"$r{i} << EOD"] + [f'{t} {e} "{name}"' for w, name, t, e in points if w == whose] + ["EOD"]
        point = 2 if whose.startswith("OpenCV") else 6 if whose.endswith(LIMITED) and len(levels) > 1 else 7
        plots += [f"$r{i} using 1:2 with linespoints pt {point} ps 1.4 lw 1.5 lc rgb '{COLOURS[i]}' title \"{whose}\"",
                  f"$r{i} using 1:2:3 with labels offset 0, {-1 if point == 6 else 1} tc rgb '{COLOURS[i]}' notitle"]
    return (write_page(out, "bench-rectify", page("Rectification: time against error", command, text, levels)) +
            draw(out, "time-error-rectify", lines + ["plot " + ", \\\n".join(plots)]))


def picture_figures(report):
    plain, seen = report["refocus"], report["render"]
    figures = [report["occluders"][0]["covered"]]
    for key in ("psnr", "psnr_occluded"):
        figures += [plain[key], seen[key], seen[key] - plain[key]]
    for key in ("ssim", "ssim_occluded"):
        figures += [plain[key], seen[key]]
    return figures


def picture_table(scenes, reports):
    head = ["scene", "covered %", "PSNR refocus", "PSNR SST", "gain dB", "PSNR occ. refocus", "PSNR occ. SST",
            "gain occ. dB", "SSIM refocus", "SSIM SST", "SSIM occ. refocus", "SSIM occ. SST"]
    digits = [1] + [2] * 6 + [3] * 4
    figures = [picture_figures(r) for r in reports]
    figures.append([statistics.mean(column) for column in zip(*figures)])
    return table(head, [[name] + [number(v, n) for v, n in zip(f, digits)]
                        for name, f in zip([s["scene"] for s in scenes] + ["mean"], figures)])


def clear_table(scenes, reports):
    head = ["scene", "own maps: PSNR", "SSIM", "occ. PSNR", "holes %", "true maps: PSNR", "SSIM", "occ. PSNR", "holes %"]
    digits = [2, 3, 2, 1] * 2
    keys = ("psnr", "ssim", "psnr_occluded", "filled_percent")
    figures = [[r["clear"][k] for r in (own, s["truth"]) for k in keys] for s, own in zip(scenes, reports)]
    figures.append([mean_known(column) for column in zip(*figures)])
    return table(head, [[name] + [number(v, n) for v, n in zip(f, digits)]
                        for name, f in zip([s["scene"] for s in scenes] + ["mean"], figures)])


def seeds_table(draws):
    seeds = sorted({d["seed"] for d in draws})
    head = ["scene"] + [f"{maps} maps: seed {seed}" for maps in ("own", "true") for seed in seeds]
    rows = []
    for name in dict.fromkeys(d["scene"] for d in draws):
        of = {d["seed"]: d for d in draws if d["scene"] == name}
        rows.append([of[seed][maps]["psnr"] for maps in ("own", "truth") for seed in seeds])
    rows.append([mean_known(column) for column in zip(*rows)])
    names = [*dict.fromkeys(d["scene"] for d in draws), "mean"]
    return table(head, [[name] + [number(v) for v in row] for name, row in zip(names, rows)])


def disparity_table(scenes, reports):
    head = ["scene", "searched px", "bad 1 %", "bad 2 %", "RMSE px", "visible: bad 1 %", "bad 2 %", "RMSE px"]
    return table(head, [[s["scene"], "{:.0f}..{:.0f}".format(*r["searched_px"])] +
                        [number(d[k]) for d in (r["disparity"], r["disparity"]["nonocc"])
                         for k in ("bad1", "bad2", "rmse")]
                        for s, r in zip(scenes, reports)])


def label_table(scenes, reports):
    head = ["scene", "mIoU network", "mIoU HCSM", "coverage HCSM", "mIoU refined", "right network", "right refined"]
    keys = ("miou_initial", "miou_hcsm", "coverage_hcsm", "miou_refined", "accuracy_initial", "accuracy_refined")
    return table(head, [[s["scene"]] + [number(r["labels"][k]) for k in keys] for s, r in zip(scenes, reports)])


def stage_table(scenes, reports):
    stages = ["load", "labels", "disparity", "refinement", "saving", "total"]
    return table(["scene"] + level_head(reports[0]["levels"], *stages),
                 [[s["scene"]] + [f"{of['seconds'][k]:.1f} / {of['cpu_seconds'][k]:.1f}" for of in r["levels"].values()
                                  for k in stages] for s, r in zip(scenes, reports)])


def same_maps(named):
    """Sentence on maps that AVX2 changes. named: [(name, report with levels)]."""
    lines = []
    for kind in named[0][1]["maps"]:
        differing = [name for name, r in named if any(kind in of["differ"] for of in r["levels"].values())]
        where = "all runs" if len(differing) == len(named) else ", ".join(differing)
        lines.append(f"maps of {kind} differ in {where}" if differing else f"maps of {kind} are equal")
    levels = len(named[0][1]["levels"])
    return f"Errors were measured at the best level; with AVX2 {' and '.join(lines)}.\n" if levels > 1 else ""


def preset_part(scenes):
    """Chart points and table of the scenes that were matched with every preset."""
    levels = list(scenes[0]["presets"]["balanced"]["levels"])
    head = ["scene, preset"] + level_head(levels, "wall s", "CPU s") + [
        "bad 0.5 %", "bad 1 %", "bad 2 %", "bad 4 %", "RMSE px", "visible: bad 2 %", "clear, PSNR"]
    rows, groups, clear = [], {}, {}
    for s in (s for s in scenes if len(s["presets"]) > 1):
        for preset in ("preview", "balanced", "accurate"):
            r = s["presets"][preset]
            errors = [r["disparity"][k] for k in ("bad05", "bad1", "bad2", "bad4", "rmse")]
            errors += [r["disparity"]["nonocc"]["bad2"], r["clear"]["psnr"]]
            times = [r["levels"][level][k]["disparity"] for level in levels for k in ("seconds", "cpu_seconds")]
            rows.append([f"{s['scene']}, {preset}"] + [number(v) for v in times + errors])
            for level, end in suffixes(levels).items():
                seconds = r["levels"][level]["seconds"]
                groups.setdefault(s["scene"], []).append((f"sst {preset}{end}", seconds["disparity"], r["disparity"]["bad2"]))
                clear.setdefault(s["scene"], []).append((f"sst {preset}{end}", seconds["total"],
                                                         255 * 10 ** (-r["clear"]["psnr"] / 20)))
        for of in s["opencv"]:
            rows.append([f"{s['scene']}, {of['method']}", number(of["ms"] / 1000), number(of["cpu_ms"] / 1000)] +
                        ["-"] * (2 * len(levels) - 2) + [number(of[k]) for k in ("bad05", "bad1", "bad2", "bad4", "rmse")] + ["-"] * 2)
            groups[s["scene"]].append((of["method"], of["ms"] / 1000, of["bad2"]))
    return groups, clear, table(head, rows)


SCENES_TEXT = """\
Simulated scenes, 6x6 views of {size}, seed 1, against their exact truth. PSNR in dB and SSIM of the picture focused
behind the principal occluder, over all pixels and (occ.) over those that the occluder covers, by plain refocusing and
by semantic see-through (SST). "Visible" are the pixels whose surface a view beside, above or below sees too. One run
each.

## See-through with true disparities and labels

{true_pictures}
## See-through with estimated disparities and labels

`sst process --preset balanced`.{given}

{pictures}
## Clear picture

The whole picture, and the pixels that the occluder covers, against the scene without it (`sst render --method clear`, cut
behind the occluder, or it removed as an object where nothing lies between). Holes: pixels that fewer than two views show,
filled from behind.

{clear}
Other draws of the same scenes, {seeds_size}, PSNR of the whole picture:

{seeds}
Time of the whole `sst process`, cold, from reading the files to the maps on disk, with labels, against the clear picture's
error, by preset:

![time against error of the clear picture](time-error-clear.svg)

## Disparity, all 36 views, preset balanced

{disparity}
## Labels, all 36 views

Mean IoU, coverage and share of right pixels, percent.{given}

{labels}
## Time of `sst process --preset balanced`, wall / CPU seconds

{stages}
{same}
## Disparity by preset

OpenCV matches each view with its neighbour in the row, alone.

![time against error](time-error-scenes.svg)

{presets}"""


def scenes(source, out, command):
    with open(source) as f:
        measured = json.load(f)
    size, reports = measured[0]["size"], [s["presets"]["balanced"] for s in measured]
    given = " **The labels were given (true), for the network was absent.**"
    given = "" if measured[0]["labels"] == "network" else given
    with open(os.path.join(os.path.dirname(source), "seeds.json")) as f:
        draws = json.load(f)
    groups, clear, presets = preset_part(measured)
    text = SCENES_TEXT.format(
        size=size, given=given, true_pictures=picture_table(measured, [s["truth"] for s in measured]),
        pictures=picture_table(measured, reports), clear=clear_table(measured, reports),
        seeds=seeds_table(draws), seeds_size=draws[0]["size"],
        disparity=disparity_table(measured, reports), labels=label_table(measured, reports),
        stages=stage_table(measured, reports), presets=presets,
        same=same_maps([(f"{s['scene']} {preset}", r) for s in measured for preset, r in s["presets"].items()]))
    return (write_page(out, "bench-scenes", page("Simulated scenes", command, text, list(reports[0]["levels"]))) +
            chart(out, "time-error-scenes", f"Simulated scenes, disparity of 36 views of {size}",
                  ("time, s", "pixels off by more than 2 px, %"), groups, command, log_y=True) +
            chart(out, "time-error-clear", f"Clear picture of simulated scenes, 36 views of {size}",
                  ("time of sst process, s", "RMSE, grey levels of 255"), clear, command))


LAYERS_TEXT = """\
Photographs in layers (`sst scene layers`, CamVid's pictures), 6x6 views of 640x480 with noise, gain differences and JPEG
as the seed has it, `sst process --no-labels`. PSNR in dB of the covered pixels that show the target (`psnr_target`): by
plain refocusing on it, seen through with the program's own maps and with the true ones, and of the clear picture; *clear,
whole*: of all its pixels against the scene without the occluder. Rays in percent: *rejected* show the target, but their
map says nearer; *accepted wrongly* pass for the target, but show something nearer. Methods are tuned on the development
set only. *Median*: of the rays at the focus. *Gaps*: rejected rays by the size of the gap that they pass, in px.

"""


def layer_figures(measured):
    own, true = measured["own"], measured["truth"]
    occluder = own["occluders"][0]
    return [occluder["covered"], own["refocus"]["psnr_target"], occluder["psnr_median"], own["render"]["psnr_target"],
            true["render"]["psnr_target"], own["clear"]["psnr_target"], true["clear"]["psnr_target"],
            own["clear"]["psnr"], true["clear"]["psnr"], occluder["rejected_percent"], *occluder["rejected_by_gap"],
            occluder["accepted_wrong_percent"], own["disparity"]["bad1"]]


def mean_known(values):
    known = [v for v in values if v is not None]
    return statistics.mean(known) if known else None


def layers(source, out, command):
    with open(source) as f:
        measured = json.load(f)
    head = ["scene", "covered %", "refocus", "median", "see-through, own maps", "true maps", "clear, own maps", "true maps",
            "clear, whole, own maps", "true maps", "rejected %", "gaps 1..4", "5..12", "more",
            "accepted wrongly %", "bad 1 %"]
    text = LAYERS_TEXT
    for name in dict.fromkeys(m["set"] for m in measured):
        part = [m for m in measured if m["set"] == name]
        rows = [(f"{m['kind']} {m['seed']}", layer_figures(m)) for m in part]
        groups = {m["kind"]: [f for n, f in rows if n.startswith(m["kind"] + " ")] for m in part}
        for low, high in ((0, 50), (50, 70), (70, 100)):
            groups[f"covered {low}..{high} %"] = [f for _, f in rows if low <= f[0] < high]
        groups["mean"] = [f for _, f in rows]
        rows += [(f"*{n}*", [mean_known(c) for c in zip(*g)]) for n, g in groups.items() if g]
        text += f"## {name.capitalize()} set\n\n" + table(head, [[n] + [number(v) for v in f] for n, f in rows]) + "\n"
    return write_page(out, "bench-layers", page("Layers of photographs", command, text))


SKIPS_TEXT = """\
What the program leaves out, what that saves and what it spoils. Further left is less work, further down less error.

## Offline

`sst process --skip LIST` (balanced, 36 views of {size}, seed 1, labels from {labels}) against `--skip none`, CPU time of all
threads; one run each, so that differences of 10 % are noise. The chart has the figure that suffers most, the clear picture.
Percentage points of pixels off by more than 2 px in all views, mIoU of all views, dB of pictures. *Skipped*: views
not matched, hypotheses not tested, views not labeled; *wrong*: what the program itself estimates by doing some of the
skipped work all the same. `keys` carries no maps where the first pass of the key views does not allow it: then nothing
is skipped.

![time left against error added](skips-process.svg)
{labels_chart}
{table}
"""


def part_of(report, none, level, *stages):
    """CPU time of the stages at a level, percent of the time with --skip none."""
    mine, whole = (sum(r["levels"][level]["cpu_seconds"][s] for s in stages) for r in (report, none))
    return 100 * mine / whole


def skip_row(entry, none):
    r, base = entry["report"], none["report"]
    own = r["skips"].get(entry["skip"], {})
    change = lambda get: None if get(r) is None else get(r) - get(base)
    row = [f"{entry['scene']}, {entry['skip']}"]
    for level, of in r["levels"].items():
        row += [number(of["cpu_seconds"]["total"]), number(part_of(r, base, level, "total"), 0)]
    row += [number(own.get("skipped_percent"), 0), number(own.get("error_percent"))]
    return row + [number(change(get)) for get in (
        lambda x: x["disparity"]["bad2"], lambda x: x["labels"]["miou_refined"] if x.get("labels") else None,
        lambda x: x["render"]["psnr_occluded"], lambda x: x["clear"]["psnr"])]


def skip_chart(out, name, title, labels, points, command):
    """points: [(group, method, work left in percent, error added)]; a colour per group, a symbol per method, open for AVX2."""
    groups, methods = (list(dict.fromkeys(p[i].removesuffix(LIMITED) for p in points)) for i in (0, 1))
    symbols = dict(zip(methods, (7, 5, 9, 13, 15, 11, 3)))
    low, high = min(0, *(p[3] for p in points)), max(p[3] for p in points)
    room = 0.12 * (high - low or 1)
    lines = frame(title, labels, (0, max(100, *(p[2] for p in points)) + 8), (low - room, high + room), False, command)
    lines += ["unset logscale x", "set xtics 20", "set ytics autofreq", "set arrow from graph 0, first 0 to graph 1, first 0 "
              "nohead lc rgb '#444444' lw 1"]
    plots = []
    for i, group in enumerate(groups):
        lines += [f"$s{i} << EOD"] + [f"{p[2]} {p[3]} {symbol(p[1], symbols)}" for p in points if p[0] == group] + ["EOD"]
        plots.append(f"$s{i} using 1:2:3 with points pt variable ps 1.4 lw 2 lc rgb '{COLOURS[i]}' notitle")
    plots += [f"keyentry with lines lw 6 lc rgb '{COLOURS[i]}' title \"{group}\"" for i, group in enumerate(groups)]
    plots += [f"keyentry with points pt {symbols[m]} ps 1.4 lc rgb '#444444' title \"{m}\"" for m in methods]
    if any(p[1].endswith(LIMITED) for p in points):
        plots.append("keyentry with points pt 6 ps 1.4 lc rgb '#444444' title 'open: AVX2'")
    return draw(out, name, lines + ["plot " + ", \\\n".join(plots)])


def labels_chart(measured, none, out, command):
    points = []
    for m in measured:
        r, base = m["report"], none[m["scene"]]["report"]
        if m["skip"] in ("none", "labels", "all") and r.get("labels"):
            points += [(m["scene"], m["skip"] + end, part_of(r, base, level, "labels", "refinement"),
                        base["labels"]["miou_refined"] - r["labels"]["miou_refined"])
                       for level, end in suffixes(r["levels"]).items()]
    return skip_chart(out, "skips-labels", "Labels of views that the network does not see",
                      ("CPU time of labels and refinement, % of that of --skip none", "mean IoU lost, points"), points,
                      command) if points else []


def skips(source, out, command):
    with open(source) as f:
        measured = json.load(f)
    none = {m["scene"]: m for m in measured if m["skip"] == "none"}
    of_labels = labels_chart(measured, none, out, command)
    text = SKIPS_TEXT.format(
        labels_chart="\nLabels and their refinement alone:\n\n![time of labels left against error added](skips-labels.svg)\n"
        if of_labels else "",
        size=measured[0]["size"], labels="the network" if measured[0]["report"].get("labels") else "nowhere",
        table=table(["scene, skipped"] + level_head(measured[0]["report"]["levels"], "CPU s", "% of none") +
                    ["skipped %", "wrong %", "bad 2, points", "mIoU, points", "see-through occ., dB", "clear, dB"],
                    [skip_row(m, none[m["scene"]]) for m in measured]))
    points = []
    for m in measured:
        r, base = m["report"], none[m["scene"]]["report"]
        points += [(m["scene"], m["skip"] + end, part_of(r, base, level, "total"), base["clear"]["psnr"] - r["clear"]["psnr"])
                   for level, end in suffixes(r["levels"]).items()]
    made = skip_chart(out, "skips-process", "Work left out of sst process --preset balanced",
                      ("CPU time, % of that of --skip none", "clear picture, dB lost"), points, command)
    made += of_labels
    source = os.path.join(os.path.dirname(source), "live.json")
    if os.path.exists(source):
        more, charts = live_part(source, out, command)
        text, made = text + more, made + charts
    source = os.path.join(os.path.dirname(source), "pipeline.json")
    if os.path.exists(source):
        more, charts = pipeline_part(source, out, command)
        text, made = text + more, made + charts
    return write_page(out, "bench-skips", page("Skipping: work against error", command, text,
                                               list(measured[0]["report"]["levels"]))) + made


RENDER_SKIPS_TEXT = """\
`sst render --skip rays` on the maps of `sst process` (balanced, 36 views of {size}, seed 1), see-through at the focus that it
proposes, against `--skip none`: median of pictures made in turn, wall time on {threads} threads. Error: root mean square of
the difference from the exact picture in the pixels that the program samples for it (`error_levels`; 0: none differs, or the
picture is exact because next to nothing could be left out). The budget is 50 dB, 0.81 levels.

![time left against error added](skips-render.svg)

{table}
"""


def render_skips(source, out, command):
    with open(source) as f:
        measured = json.load(f)
    groups, levels = {}, list(dict.fromkeys(m["level"] for m in measured))
    for m in measured:
        groups.setdefault((m["scene"], m["skip"], m["level"]), []).append(m["report"])
    rows, points = [], []
    for scene, skip in dict.fromkeys(k[:2] for k in groups):
        own, cells = groups[scene, skip, levels[0]][0]["skip"] or {}, []
        error = own.get("error_levels") or 0
        for level, end in suffixes(levels).items():
            times, base = ([r["render_ms"]["median"] for r in groups[scene, s, level]] for s in (skip, "none"))
            part = statistics.median(100 * a / b for a, b in zip(times, base))
            cells += [number(statistics.median(times), 1), number(part, 0)]
            points.append((scene, skip + end, part, error))
        rows.append([f"{scene}, {skip}", *cells, number(own.get("rays_skipped_percent"), 1),
                     number(own.get("rays_even_percent"), 1), number(error)])
    text = RENDER_SKIPS_TEXT.format(size=measured[0]["size"], threads=2, table=table(
        ["scene, skipped"] + level_head(levels, "ms", "% of none") + ["rays skipped %", "without weights %", "error, levels"], rows))
    return (write_page(out, "bench-render-skips", page("Skipping rays: time against error", command, text, levels)) +
            skip_chart(out, "skips-render", "Rays left out of see-through pictures",
                       ("time, % of that of --skip none", "error, grey levels"), points, command))


LIVE_TEXT = """\
## Live

Frames of the live engine (`build/bench/live_frames`), 36 cameras of 640x480, MJPEG: CPU time of a set in skip mode against
exact mode, which computes every tile. Error: mean of all pixels against exact mode, and of the worst tile of any set, in
levels of 255; noise of the sensor counts as error where a tile that did not change keeps its older noise. Text in the frames
is read in one set of four: where worlds have the simulator's strip, the worst tile is one of its numbers.

![time left against error added](skips-live.svg)

{table}
"""


def live_part(source, out, command):
    with open(source) as f:
        measured = json.load(f)
    levels = list(dict.fromkeys(m["level"] for m in measured))
    times = {(m["world"], m["calibrated"], m["level"], m["mode"]): float(m["CPU, ms"]) for m in measured}
    rows, points = [], []
    for m in sorted((m for m in measured if m["mode"] == "skip" and m["level"] == levels[0]), key=lambda m: float(m["tiles"])):
        kind, cells = "rectified" if m["calibrated"] == "yes" else "not rectified", []
        for level, end in suffixes(levels).items():
            ms, whole = (times[m["world"], m["calibrated"], level, mode] for mode in ("skip", "exact"))
            cells += [number(ms, 1), number(whole, 1), number(100 * ms / whole, 0)]
            points.append((kind, m["world"] + end, 100 * ms / whole, float(m["error"])))
        rows.append([f"{m['world']}, {kind}", m["tiles"], *cells, m["error"], m["worst tile"]])
    text = LIVE_TEXT.format(table=table(["world", "tiles computed %"] + level_head(levels, "CPU ms, skip", "exact", "% of exact") +
                                        ["error", "worst tile"], rows))
    return text, skip_chart(out, "skips-live", "Work left out of live frames, from a still scene to a moving one",
                            ("CPU time, % of that of exact mode", "error added, levels of 255"), points, command)


PIPELINE_TEXT = """\
## The whole pipeline, live and offline

On the same frames (`build/bench/live_scene`, 36 cameras of 640x480 with noise and JPEG): CPU time from decoded frames to the
see-through picture, and its error in the pixels that the occluder hides, in the first set and in the last of {sets}. Live keeps
its maps from set to set; the presets of `sst process` compute each set from nothing. *Changed*: tiles, in the last set.

![time against error](time-error-live.svg)

{table}
"""


def rms_of(row, key):
    return 255 * 10 ** (-float(row[f"{key} dB"]) / 20)


def pipeline_points(sets):
    """[(maps, CPU ms of a set, RMS error)] of one scene at one level."""
    first, last = sets[0], sets[-1]
    picture = float(last["live cpu ms"]) - float(last["cpu ms"])
    later = statistics.fmean(float(row["cpu ms"]) for row in sets[1:]) + picture
    return ([("live, mean of later sets", later, rms_of(last, "live")),
             ("live, first set", float(first["live cpu ms"]), rms_of(first, "live"))] +
            [(f"sst {key}", float(last[f"{key} cpu ms"]), rms_of(last, key)) for key in ("preview", "balanced", "accurate")
             if first.get(f"{key} dB")])


def pipeline_part(source, out, command):
    with open(source) as f:
        measured = json.load(f)
    rows, groups, levels = [], {}, list(dict.fromkeys(m["level"] for m in measured))
    for scene in dict.fromkeys(m["scene"] for m in measured):
        sets = {m["level"]: m["sets"] for m in measured if m["scene"] == scene}
        points = {level: pipeline_points(sets[level]) for level in levels}
        groups[scene] = [(name + end, ms, error) for level, end in suffixes(levels).items() for name, ms, error in points[level]]
        rows += [[f"{scene}, {of[0][0]}", *(number(ms, 0) for _, ms, _ in of), number(of[0][2]),
                  number(-20 * math.log10(of[0][2] / 255))] for of in zip(*points.values())]
        last = sets[levels[0]][-1]
        rows += [[f"{scene}, {name}", *["-"] * len(levels), number(rms_of(last, name)), number(float(last[f"{name} dB"]))]
                 for name in ("refocus", "true maps")]
        rows.append([f"{scene}: changed {float(last['changed %']):.0f} %"] + [""] * (len(levels) + 2))
    text = PIPELINE_TEXT.format(sets=len(measured[0]["sets"]), table=table(
        ["scene, maps"] + level_head(levels, "CPU ms a set") + ["RMS error, levels", "PSNR, dB"], rows))
    return text, chart(out, "time-error-live", "The whole pipeline live and offline, 36 views of 640x480",
                       ("CPU time of a set, ms", "RMS error of hidden pixels, grey levels of 255"), groups, command)


DENSITY_TEXT = """\
One scene of layers (`sst scene layers --kind foliage --seed 1`, 36 views of {size}), behind foliage that hides more and more of
it: the whole `sst process --preset balanced`{labels}, CPU time of all threads (median of {rounds}). PSNR in dB
against the scene without foliage: see-through at the target's focus, and the clear picture, of all pixels and (occ.) of the hidden ones.
OpenCV matches each view with its neighbour in the row, alone.

![time against error](time-error-density.svg)

{table}
**Cost at {most} % over that at 0 %: {ratios}** (goal: at most 1.5).{opencv}

{same}"""


def density_row(m):
    r = m["report"]
    times = [number(of["cpu_seconds"]["total"]) for of in r["levels"].values()]
    return [f"{m['cover']} %", number(r["occluders"][0]["covered"], 1), *times, number(r["disparity"]["bad2"]),
            number(r["disparity"]["nonocc"]["bad2"]), *(number(r[k]["psnr"]) for k in ("refocus", "render", "clear")),
            number(r["clear"]["psnr_occluded"])] + [cell for of in m["opencv"] for cell in (number(of["cpu_ms"] / 1000), number(of["bad2"]))]


def density(source, out, command):
    with open(source) as f:
        measured = json.load(f)
    levels, first, last = list(measured[0]["report"]["levels"]), measured[0], measured[-1]
    modes = [of["method"] for of in first["opencv"]]
    head = (["cover asked for", "covered %"] + level_head(levels, "CPU s") +
            ["bad 2 %", "visible: bad 2 %", "PSNR refocus", "see-through", "clear", "clear occ."] +
            [c for mode in modes for c in (f"{mode}: CPU s", "bad 2 %")])

    def grown(get):
        return f"{get(last) / get(first):.2f}"
    ratios = ", ".join(f"{word(level)} {grown(lambda m, k=level: m['report']['levels'][k]['cpu_seconds']['total'])}"
                       for level in levels)
    others = ", ".join(f"{mode.removeprefix('OpenCV ')} {grown(lambda m, i=i: m['opencv'][i]['cpu_ms'])}" for i, mode in enumerate(modes))
    groups = {f"sst {word(level)}": [(f"{m['cover']} %{end}", m["report"]["levels"][level]["cpu_seconds"]["total"],
                                      m["report"]["disparity"]["bad2"]) for m in measured]
              for level, end in suffixes(levels).items()}
    groups |= {mode: [(f"{m['cover']} %", m["opencv"][i]["cpu_ms"] / 1000, m["opencv"][i]["bad2"]) for m in measured]
               for i, mode in enumerate(modes)}
    text = DENSITY_TEXT.format(
        size=first["size"], rounds=first["rounds"], labels=" with labels" if first["labels"] else " --no-labels", most=last["cover"],
        table=table(head, [density_row(m) for m in measured]), ratios=ratios,
        opencv=f" OpenCV's time grows with the range of disparities: {others}." if modes else "",
        same=same_maps([(f"{m['cover']} %", m["report"]) for m in measured]))
    return (write_page(out, "bench-density", page("Density: cost and error behind more and more foliage", command, text, levels)) +
            chart(out, "time-error-density", f"Foliage over 0 to {last['cover']} % of the picture, 36 views of {first['size']}",
                  ("CPU time, s", "pixels off by more than 2 px, %"), groups, command, log_y=True))


NARROW_TEXT = """\
Light fields whose disparities differ by a few pixels, 6x6 views: *backgammon* of the HCI benchmark, 512x512, and `sst scene bust`
and `terrace`, {size}, seed 1, of whose 9x9 views 6x6 are used (`--grid 9x9`, `sst import folder --part 1,1,6x6`). `sst process
--no-labels`, CPU time of all threads (median of {rounds}); all pixels of all views with truth.

{table}
## What is left

Points of all pixels that are off by more than 0.07 and 0.03 px, by the first kind that fits; in brackets the share of the kind. *Edges*:
within 3 px of a step of 0.25 px in the truth. *Untextured*: the luma's variance over 5x5 pixels is less than 2 levels². *Slanted*: the
truth changes by 0.012 px a pixel or more.

{kinds}
{same}"""


def narrow(source, out, command):
    with open(source) as f:
        measured = json.load(f)
    levels, rows, kinds = list(measured[0]["report"]["levels"]), [], []
    for m in measured:
        r, d = m["report"], m["report"]["disparity"]
        times = [number(of["cpu_seconds"]["total"]) for of in r["levels"].values()]
        rows.append([f"{m['scene']}, views with truth: {d['views']}", *times,
                     *(number(d[k]) for k in ("bad007", "bad003", "bad05", "bad1", "rmse"))])
        kinds.append([m["scene"]] + [f"{of['bad007']:.2f}, {of['bad003']:.2f} ({of['pixels']:.1f})" for of in m["kinds"].values()])
    text = NARROW_TEXT.format(
        rounds=measured[0]["rounds"], size=measured[-1]["size"], same=same_maps([(m["scene"], m["report"]) for m in measured]),
        table=table(["light field"] + level_head(levels, "CPU s") +
                    ["bad 0.07 %", "bad 0.03 %", "bad 0.5 %", "bad 1 %", "RMSE px"], rows),
        kinds=table(["beyond 0.07, 0.03 px", *({"edge": "edges"}.get(k, k) for k in measured[0]["kinds"])], kinds))
    return write_page(out, "bench-narrow", page("Narrow light fields", command, text, levels))


def write(folder, command):
    """Tables and charts of what was measured, in folder/docs. Returns their paths."""
    out, made = f"{folder}/docs", []
    os.makedirs(out, exist_ok=True)
    for name, report in (("stereo.csv", stereo), ("render.csv", render), ("rectify.csv", rectify), ("scenes.json", scenes), ("layers.json", layers),
                         ("skips.json", skips), ("render-skips.json", render_skips), ("density.json", density),
                         ("narrow.json", narrow), ("limits.csv", limits)):
        if os.path.exists(f"{folder}/{name}"):
            made += report(f"{folder}/{name}", out, command)
    return made


if __name__ == "__main__":
    quick = os.path.basename(os.path.normpath(sys.argv[1])) == "bench-quick"
    print("\n".join(write(sys.argv[1], "make bench-quick" if quick else "make bench")))
