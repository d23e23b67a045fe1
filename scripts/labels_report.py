# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
"""docs/measured/bench-labels.md and its charts from what scripts/bench_labels.py measured."""
from charts import COLOURS, cpu_name, draw, number, page, table, write_page

# Published: Mehta et al., ESPNet (ECCV 2018), as quoted in the source paper's comparison.
REFERENCE = ("ESPNet on CamVid's *test* part, which is another split, measured by others on another machine: 58.68 % mIoU, "
             "88.59 % of the pixels right, 342 ms.")


def percent(value, digits=1):
    return "-" if value is None else f"{100 * value:.{digits}f}"


def quality_part(networks):
    rows, classes = [], {}
    for model, sets in networks.items():
        for name, q in sets.items():
            rows.append([model, name, percent(q["miou"]), percent(q["right"])])
            for c, v in q["iou"].items():
                if v is not None:
                    classes.setdefault(c, {})[model, name] = v
    columns = [(m, n) for m, sets in networks.items() for n in sets]
    return (table(["network", "set", "mIoU %", "pixels right %"], rows) + f"\n{REFERENCE}\n\nIoU per class, %:\n\n" +
            table(["class"] + [f"{m.removesuffix('.onnx')}, {n}" for m, n in columns],
                  [[c] + [percent(v.get(k)) for k in columns] for c, v in classes.items()]))


def times_part(times):
    rows = {}
    for t in times:
        rows.setdefault((t["model"], t["level"], t["threads"]), {})[t["key"]] = t
    return table(["network", "processor", "threads", "wall ms", "least..most", "CPU ms"],
                 [[m, c, n, number(r["ms"]["ms"], 0), f"{r['ms']['least']:.0f}..{r['ms']['most']:.0f}",
                   number(r["cpu_ms"]["ms"], 0)] for (m, c, n), r in rows.items()])


def calibration_part(networks):
    rows, limits = [], []
    for model, sets in networks.items():
        for name, c in sets.items():
            for run, s in c["runs"].items():
                t = {"T = 1": 1.0}.get(run) or c["temperature"][run]
                rows.append([f"{model.removesuffix('.onnx')}, {name}", f"{run}: {t:.3f}", number(s["width"]["ece"], 4),
                             number(s["width"]["mce"], 3), number(s["mass"]["ece"], 4), number(s["mass"]["mce"], 3),
                             number(s["brier"], 4), number(s["nll"], 4)])
                if "limit" in s:
                    limit, kept, right = s["limit"]
                    limits.append([f"{model.removesuffix('.onnx')}, {name}", f"{run}: {limit:.3f}", percent(kept),
                                   percent(right), percent(s["right"])])
    return (table(["network, set", "temperature", "ECE, equal width", "largest", "ECE, equal mass", "largest", "Brier",
                   "NLL"], rows),
            table(["network, set", "epsilon_H", "kept %", "right of these %", "right of all %"], limits))


def drives_part(drives):
    """One column per network and drive; a sentence where none was measured."""
    if not drives:
        return ("Not measured: the networks of `models/` have seen all drives of the training and validation parts. Train one "
                "with `models/train_pspnet.py --leave-out DRIVE` and give it to `scripts/bench_labels.py --left-out "
                "DRIVE=ONNX`.\n")
    classes = [c for c, v in drives[0]["quality"]["iou"].items() if v is not None]
    rows = [["**mIoU**"] + [percent(d["quality"]["miou"]) for d in drives],
            ["pixels right"] + [percent(d["quality"]["right"]) for d in drives]]
    return table(["%"] + [f"{d['network'].removesuffix('.onnx')}, {d['drive']} ({d['images']})" for d in drives],
                 rows + [[c] + [percent(d["quality"]["iou"].get(c)) for d in drives] for c in classes])


def changes_part(changes):
    models = list(next(iter(changes.values())))
    weak = ("Pedestrian", "Bicyclist", "Fence", "Pole")
    head = ["change"] + [f"{m.removesuffix('.onnx')}: {k}" for m in models for k in ("mIoU", "right") + weak]
    return table(head, [[name] + [percent(v) for m in models for v in
                                  (q[m]["miou"], q[m]["right"], *(q[m]["iou"][c] for c in weak))]
                        for name, q in changes.items()])


def axes(title, x, y, x_range, y_range, command):
    return [f'set title "{title}"', f'set xlabel "{x}"', f'set ylabel "{y}"', f"set xrange [{x_range}]",
            f"set yrange [{y_range}]", "set border 3 lc rgb '#444444'", "set tics nomirror",
            "set grid lc rgb '#dddddd' lt 1", "set bmargin 5.5", "set tmargin 4.5",
            f'set label "{command}; {cpu_name()}" at screen 0.01, 0.025 font ",9" tc rgb "#555555" noenhanced']


def data(name, rows):
    return [f"${name} << EOD"] + [" ".join(map(str, row)) for row in rows] + ["EOD"]


def reliability_chart(out, model, sets, command):
    lines = axes(f"{{/*1.3 Is a label as often right as its probability says?}}\\n{{/*0.9 {model}; below the diagonal: too sure of "
                 "itself}", "probability of the winning class, %", "of these pixels right, %", "30:100", "30:100", command)
    lines += ["set key left top Left reverse samplen 2", "set size ratio 0.62"]
    plots = ["x with lines lc rgb '#888888' dt 3 title 'ideal'"]
    for i, (name, c) in enumerate(sets.items()):
        for run, dash, point in (("T = 1", 2, 4), ("fitted", 1, 5)):
            key = f"r{i}{point}"
            lines += data(key, [(100 * b[0], 100 * b[1]) for b in c["runs"][run]["mass"]["bins"]])
            t = 1.0 if run == "T = 1" else c["temperature"]["fitted"]
            plots.append(f"${key} with linespoints lw 2 dt {dash} pt {point} ps 0.8 lc rgb '{COLOURS[i]}' "
                         f"title '{name}, T = {t:.2f}'")
    return draw(out, "labels-reliability", lines + ["plot " + ", \\\n".join(plots)])


def coverage_chart(out, model, sets, refinement, command):
    lines = axes(f"{{/*1.3 Fewer labels, but right ones: the entropy threshold}}\\n{{/*0.9 {model}; points: "
                 "the threshold that ships, and light fields before and after refinement}",
                 "pixels that keep a label, %", "of these right, %", "0:100", "*:100", command)
    lines += ["set key left bottom Left reverse samplen 2", "set xrange [40:115]", "set xtics 40, 10, 100"]
    plots = []
    for i, (name, c) in enumerate(sets.items()):
        run = c["runs"]["shipped"]
        lines += data(f"c{i}", [(100 * k, 100 * r) for _, k, r in run["curve"]])
        lines += data(f"s{i}", [(100 * run["limit"][1], 100 * run["limit"][2])])
        plots += [f"$c{i} with lines lw 2 lc rgb '{COLOURS[i]}' title '{name}'",
                  f"$s{i} with points pt 7 ps 1.5 lc rgb '{COLOURS[i]}' title '{name}, shipped threshold'"]
    shipped = [(r["scene"], r["labels"]) for r in refinement if r["shipped"]]
    if shipped:
        lines += data("a", [(l["coverage_hcsm"], l["accuracy_hcsm"], l["coverage_refined"] - l["coverage_hcsm"],
                             l["accuracy_refined"] - l["accuracy_hcsm"], f'" {scene}"') for scene, l in shipped])
        lines += data("n", [(100, l["accuracy_initial"]) for _, l in shipped])
        plots += [f"$a with vectors head filled lw 1.5 lc rgb '{COLOURS[2]}' title 'light fields: confident, then refined'",
                  f"$a using ($1+$3):($2+$4):5 with labels left tc rgb '{COLOURS[2]}' notitle",
                  f"$n with points pt 2 ps 1.2 lw 2 lc rgb '{COLOURS[2]}' title 'light fields: all labels of the network'"]
    return draw(out, "labels-coverage", lines + ["plot " + ", \\\n".join(plots)])


def refinement_part(rows):
    head = ["scene", "epsilon_H", "network: mIoU", "right", "confident: mIoU", "covered", "right", "refined: mIoU",
            "covered", "right"]
    keys = ("miou_initial", "accuracy_initial", "miou_hcsm", "coverage_hcsm", "accuracy_hcsm", "miou_refined",
            "coverage_refined", "accuracy_refined")
    return table(head, [[r["scene"], f"{r['limit']:.3f}" + (" (ships)" if r["shipped"] else "")] +
                        [number(r["labels"][k], 1) for k in keys] for r in rows])


def layouts_part(layouts):
    text = ""
    for kind, title in (("sizes", "Simulated scenes, seeds 150 and 151, one view each"), ("crops", "CamVid val, every 4th picture")):
        rows = [[name, f"`{way}`" if way else "default", percent(q["miou"]), percent(q["right"]), number(q["cpu_ms"], 0)]
                for name, ways in layouts[kind].items() for way, q in ways]
        text += f"{title}:\n\n" + table(["picture", "options", "mIoU %", "pixels right %", "CPU ms"], rows) + "\n"
    s = layouts["seams"]
    return text + (f"Seams: scenes of 1000x750, `--scale 2`; the picture moves by 40 px under the windows. Pixels whose label "
                   f"changes: {percent(s['windows'], 2)} % where windows give way to one another, {percent(s['elsewhere'], 2)} % "
                   f"elsewhere, {percent(s['one run'], 2)} % with one run instead of windows.\n")


TEXT = """\
What the networks of `models/` give through `sst segment`, on CamVid's validation part (480x360, 11 classes, void left out)
and on simulated scenes of seeds 150 to 153 (one view of 640x480 each). Both sets were held out from training. The shipped
temperature and epsilon_H, however, were fitted on held-out pictures, these among them. So below, what is called *fitted*
was fitted on the first half of the pictures (of the drive; of the seeds), and all figures of calibration and coverage are
those of the **second half**.

## Quality

{quality}
![picture, truth, labels, labels below epsilon_H](../pictures/labels-scenes.jpg)

*Scenes of seed 150: picture, truth, labels, labels whose entropy is below epsilon_H (black: none).*

## Drives that were left out

The validation part is of a drive that the networks were trained on (0016E5). What a network gives elsewhere is shown by
one that was trained without a drive and is measured on all pictures of that drive (their number in brackets).

{drives}
## Another camera, another hour

CamVid val, changed before it is given to the network; %.

{changes}
## Time per 480x360 picture

Without loading; networks, levels of the processor and threads taking turns, median of 5 rounds. AVX2: without AVX-512 and
VNNI.

{times}
## Calibration

15 bins of the winner's probability, of equal width and of equal mass. ECE: expected calibration error, the mean gap between
probability and share of right pixels; largest: the largest gap of a bin with at least 0.1 % of the pixels. Brier score
over all classes (0..2). One pixel in nine.

![reliability](labels-reliability.svg)

{calibration}
## Accuracy against coverage

A label is kept where its entropy is below epsilon_H. *Kept* counts right and wrong pixels.

![coverage](labels-coverage.svg)

{limits}
## Refinement wins coverage back

Light fields of 3x3 views of 500x375, seed 150, `sst process --epsilon-h`, then `sst eval`; percent of all pixels of all
views. A smaller epsilon_H keeps fewer, surer labels; disparity spreads them again, to nearly all pixels. Whether the result
is also more often right than what the network gives for all pixels (columns 3 and 4) depends on the scene: where disparity
separates the objects it is.

{refinement}
## Size of what the network sees

`--scale` is the side of what the network sees over its nominal size (480x360 by area). By default a picture keeps its own
pixels where that is 1 to 1.5, else it is resized to the nearer of the two.

{layouts}"""


def write(result, out, command):
    """All pages and charts. Returns their paths."""
    calibration, limits = calibration_part(result["calibration"])
    text = TEXT.format(quality=quality_part(result["quality"]), times=times_part(result["times"]),
                       drives=drives_part(result["drives"]), changes=changes_part(result["changes"]), calibration=calibration,
                       limits=limits, refinement=refinement_part(result["refinement"]),
                       layouts=layouts_part(result["layouts"]))
    model, sets = next(iter(result["calibration"].items()))
    return (write_page(out, "bench-labels", page("Labels", command, text)) +
            reliability_chart(out, model, sets, command) +
            coverage_chart(out, model, sets, result["refinement"], command))
