# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
"""What `make bench-perturb` measures, and its page: docs/measured/bench-perturb.md and charts."""
import os
import subprocess

import perturb
from charts import COLOURS, cpu_name

SCENES = ("bush", "pedestrian")  # all strengths, and without correction
OTHERS = ("transportation", "cell", "humvee", "cd-cases", "cat")  # small, few strengths
REAL = {"chess": ("stanford", "lf-stanford-chess-6x6"), "shop": ("stanford", "lf-shop-6x6"),
        "backgammon": ("hci", "lf-hci-backgammon-6x6")}
MOVING = ("pedestrian", "humvee")  # what depends on time; leaves of the bush sway as those of humvee
FAULTY = ("pedestrian", "cd-cases")
UNALIGNED = ("vertical", "both", "none")  # measured with --align off, too
LABEL_NOISE = (0, 0.1, 0.3)
FEW = {"both": (1, 2), "vertical": (0.5, 2, 4), "gain": (0.1, 0.4), "roll": (0.25, 1), "noise": (2, 10, 20), "jpeg": (98, 75, 30),
       "png": (75, 30), "gamma": (0.1, 0.3), "vignetting": (0.2,), "lens": (0.01,), "blur": (0.5, 1, 2), "missing": (9, 18),
       "time": (0.1,), "rolling": (0.1,)}
REAL_KINDS = ("both", "vertical", "gain", "roll", "noise", "jpeg", "png", "gamma", "vignetting", "blur", "missing")
SEVERAL = ("both", "vertical")  # measured with other seeds, too
CHARTED = ("vertical", "gain", "vignetting", "noise", "jpeg", "blur")
EVERY = (*SCENES, *OTHERS, *REAL)
REPEATED = ("png",)  # has the figures of "jpeg", and is in the summary alone


def strengths(name, kind, many):
    return (0,) if kind == "none" else perturb.SWEEPS[kind][2] if name in SCENES and many else FEW[kind]


def mean(rows, field):
    values = [float(r[field]) for r in rows if r.get(field) not in ("", "None", None)]
    return sum(values) / len(values) if values else None


def select(rows, **key):
    return [r for r in rows if all(r[k] == str(v) for k, v in key.items())]


def number(value, digits=1):
    return "-" if value is None else f"{value:.{digits}f}"


def warnings(row):
    """What a run warns of, as words."""
    return ([] if row["plausible"] == "True" else ["implausible"]) + row["noticed"].split()


def noticed(rows):
    """What the runs warn of, and how many views they correct."""
    words = {w: sum(w in warnings(r) for r in rows) for r in rows for w in warnings(r)}
    return ", ".join([w if n == len(rows) else f"{w} ({n} of {len(rows)})" for w, n in sorted(words.items())] + [
        f"{number(mean(rows, field), 0)} {what}" for field, what in (("moved", "views moved"), ("lit", "gains"), ("bent", "gammas"), ("faded", "fall-offs"))
        if mean(rows, field)])


def sweep_table(rows, kind):
    title, unit, strengths_, _ = perturb.SWEEPS[kind]
    lines = [f"### {title}", "", f"| {unit} | " + " | ".join(f"{s}: bad-2 % | see-through dB | clear dB" for s in SCENES)
             + " | noticed |", "|---|" + "--:|" * 6 + "---|"]
    for align in ("auto", "off"):
        for strength in (0,) + tuple(strengths_):
            found = select(rows, kind=kind if strength else "none", strength=strength, align=align)
            found = [r for r in found if r["light_field"] in SCENES]
            if not found or kind in REPEATED or (align == "off" and kind not in UNALIGNED) or (align == "off" and not strength):
                continue
            cells = [f"{strength}" + (" (`--align off`)" if align == "off" else "")]
            for scene in SCENES:
                s = select(found, light_field=scene)
                cells += [number(mean(s, "bad2")), number(mean(s, "see_through")), number(mean(s, "clear"))]
            lines.append("| " + " | ".join(cells + [noticed(found)]) + " |")
    return "\n".join(lines) + "\n" if len(lines) > 5 else ""


def loss(rows, found, name, field):
    """dB lost by a light field against its unperturbed self; a photographed one has what is left, against its own picture."""
    before, after = (mean(select(r, light_field=name), field) for r in (select(rows, kind="none", align="auto"), found))
    return None if before is None or after is None else before - after


def other_table(rows, names, cell):
    """One line a strength, one column a light field."""
    lines = ["| | strength | " + " | ".join(names) + " | noticed |", "|---|--:|" + "---|" * (len(names) + 1)]
    for kind in ("none", *(k for k in perturb.SWEEPS if k not in REPEATED)):
        for strength in (0,) if kind == "none" else FEW[kind]:
            found = select(rows, kind=kind, strength=strength, align="auto")
            found = [r for r in found if r["light_field"] in names]
            if found:
                title = "Unperturbed" if kind == "none" else perturb.SWEEPS[kind][0]
                cells = [cell(select(found, light_field=n)) for n in names]
                lines.append("| " + " | ".join([title, f"{strength}" if strength else "", *cells, noticed(found)]) + " |")
    return "\n".join(lines) + "\n"


def errors_cell(rows):
    return " / ".join(number(mean(rows, f)) for f in ("bad2", "see_through", "clear")) if rows else "-"


def real_cell(rows):
    return " / ".join((number(mean(rows, "bad2")), number(mean(rows, "see_through")))) if rows else "-"


def first(rows, kind, holds):
    """Least strength, in the order of the sweep, whose runs are so; "-": none."""
    return next((str(s) for s in perturb.SWEEPS[kind][2]
                 if (found := select(rows, kind=kind, strength=s, align="auto")) and holds(found)), "-")


def loses(rows, found, field, db):
    """Does the mean of bush or pedestrian lose that many dB against its unperturbed picture?"""
    return any((loss(rows, found, s, field) or 0) >= db for s in SCENES)


def share(rows, holds):
    return f"{sum(map(holds, rows))} of {len(rows)}"


def corrects(row):
    return any(float(row[f] or 0) for f in ("moved", "lit", "faded", "bent"))


def summary_table(rows):
    """What is noticed at which strength, beside the strength at which it costs something."""
    lines = ["| | unit | see-through loses 1 dB at | clear loses 1 dB at | corrected from | warned from | at the greatest strength, warned or corrected |",
             "|---|---|--:|--:|--:|--:|--:|"]
    for kind, (title, unit, every, _) in perturb.SWEEPS.items():
        if select(rows, kind=kind, align="auto"):
            last = next(found for s in reversed(every) if (found := select(rows, kind=kind, strength=s, align="auto")))
            cells = (first(rows, kind, lambda f: loses(rows, f, "see_through", 1)),
                     first(rows, kind, lambda f: loses(rows, f, "clear", 1)),
                     first(rows, kind, lambda f: sum(map(corrects, f)) * 2 >= len(f)),
                     first(rows, kind, lambda f: sum(bool(warnings(r)) for r in f) * 2 >= len(f)),
                     share(last, lambda r: bool(warnings(r)) or corrects(r)))
            lines.append(f"| {title} | {unit} | " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def false_alarms(rows):
    whole = select(rows, kind="none", align="auto")
    wrong = [r for r in whole if warnings(r) or corrects(r)]
    return (f"Unperturbed, {len(wrong)} of {len(whole)} light fields are warned of or corrected"
            + (": " + ", ".join(f"{r['light_field']} {r['seed']} ({noticed([r])})" for r in wrong) if wrong else "") + ".\n")


def label_table(rows):
    lines = ["| cells with another label | " + " | ".join(f"{s}: wrong labels % | see-through dB" for s in SCENES) + " |",
             "|---|" + "--:|" * 4]
    for part in LABEL_NOISE:
        found = select(rows, kind="labels", strength=part)
        cells = [number(mean(select(found, light_field=s), f)) for s in SCENES for f in ("bad2", "see_through")]
        if found:
            lines.append(f"| {100 * part:.0f} % | " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def fault_table(rows):
    lines = ["| fault | noticed | as | views named | confirmed % |", "|---|---|---|--:|--:|"]
    for fault in perturb.FAULTS:
        found = [r for r in select(rows, kind=fault)]
        if found:
            words = sorted({w for r in found for w in warnings(r)})
            lines.append(f"| {fault} | {share(found, lambda r: bool(warnings(r)))} | {', '.join(words)} | "
                         f"{number(mean(found, 'faulty'), 0)} | {number(mean(found, 'confirmed'), 0)} |")
    return "\n".join(lines) + "\n"


def chart(rows, out):
    """See-through error against strength, one panel a perturbation."""
    commands = ['set datafile missing "nan"', "set key bottom left samplen 2", "set grid lc rgb '#dddddd' lt 1",
                "set border 3 lc rgb '#444444'", "set tics nomirror", "set multiplot layout 3,2"]
    for kind in CHARTED:
        title, unit, every, _ = perturb.SWEEPS[kind]
        commands += [f'set title "{title}"', f'set xlabel "{unit}"', 'set ylabel "see-through, PSNR in what is hidden, dB"']
        plots, data = [], []
        for i, scene in enumerate(SCENES):
            for align in ("auto", "off") if kind in UNALIGNED else ("auto",):
                points = [(s, mean(select(rows, light_field=scene, kind=kind if s else "none", strength=s, align=align),
                                   "see_through")) for s in (() if kind == "jpeg" else (0,)) + tuple(every)]
                points = [p for p in points if p[1] is not None]
                if not points:
                    continue
                name = f"{scene}, --align {align}" if kind in UNALIGNED else scene
                plots.append(f"'-' with linespoints lw 2 pt {7 if align == 'auto' else 6} dt {1 if align == 'auto' else 2} "
                             f"lc rgb '{COLOURS[i]}' title \"{name}\"")
                data += [f"{x} {y}" for x, y in points] + ["e"]
        if plots:
            commands += ["plot " + ", ".join(plots)] + data
    commands.append("unset multiplot")
    for terminal, suffix in (("svg size 1000,1100 font 'sans,12' background rgb 'white'", "svg"),
                             ("pngcairo size 1000,1100 font 'sans,11'", "png")):
        script = "\n".join([f"set terminal {terminal}", f"set output '{out}.{suffix}'"] + commands) + "\n"
        subprocess.run(["gnuplot"], input=script, text=True, check=True)


def seed_table(every):
    """Loss of bush and pedestrian against their own unperturbed pictures, seed by seed."""
    lines = ["| light field | seed | | " + " | ".join(("strength", "bad-2 %", "see-through dB", "clear dB", "see-through loses", "clear loses"))
             + " |", "|---|--:|---|" + "--:|" * 6]
    for scene in SCENES:
        for seed in sorted({int(r["seed"]) for r in every if r["light_field"] == scene}):
            rows = select(every, light_field=scene, seed=seed, align="auto")
            for kind in ("none", *SEVERAL):
                for strength in (0,) if kind == "none" else FEW[kind]:
                    found = select(rows, kind=kind, strength=strength)
                    if found:
                        cells = [number(mean(found, f)) for f in ("bad2", "see_through", "clear")]
                        cells += [number(loss(rows, found, scene, f), 2) if kind != "none" else "" for f in ("see_through", "clear")]
                        title = "Unperturbed" if kind == "none" else perturb.SWEEPS[kind][0]
                        lines.append("| " + " | ".join([scene, str(seed), title, f"{strength}" if strength else "", *cells]) + " |")
    return "\n".join(lines) + "\n"


def write(rows, args):
    os.makedirs(args.docs, exist_ok=True)
    every, rows = rows, select(rows, seed=1)
    chart(rows, os.path.join(args.docs, "bench-perturb"))
    text = f"""# Error against perturbation

Made by `make bench-perturb` on {cpu_name()}. Do not edit: the next run overwrites this page.

6x6 views, seed 1, preset balanced, without labels; the perturbation is drawn for each view. {" and ".join(SCENES)}
have {args.size} pixels, the other scenes {args.small}; not all have all strengths. *bad-2*: disparities off by more than 2 px, all views.
*See-through*, *clear*: PSNR of the see-through picture in the occluded part, of the clear picture as a whole. Pixels are means of
{perturb.FINE}x{perturb.FINE} of finer pictures, which are displaced before; the reference view stays in its place. Time offsets are without time
stamps. *Noticed*: warnings and corrections of `sst process` ([design.md](../design/design.md#59-pictures-that-are-off)).
Where curves have steps: [notes](notes-method.md#displaced-pictures).

![See-through picture against vertical misalignment, gain, vignetting, noise, JPEG and blur](bench-perturb.svg)

## What is noticed at which strength

The least strength measured, on all light fields together; corrected, warned: at least half of them; -: at none.

"""
    text += summary_table(rows) + "\n" + false_alarms(rows) + "\n## Error against strength\n\n"
    text += "\n".join(filter(None, (sweep_table(rows, kind) for kind in perturb.SWEEPS)))
    if any(r["seed"] != "1" for r in every):
        text += "\n## Several seeds\n\nOther draws of the scene and of the perturbation; losses are against the same scene unperturbed.\n\n" + seed_table(every)
    if select(rows, kind="labels"):
        text += "\n### Label noise\n\nTrue labels, cells of 8x8 pixels exchanged, refined.\n\n" + label_table(rows)
    text += "\n## Other scenes\n\nbad-2 % / see-through dB / clear dB. Strengths as above.\n\n" + other_table(rows, OTHERS, errors_cell)
    if any(select(rows, light_field=n) for n in REAL):
        text += f"""
## Photographed light fields

Made {args.small.split("x")[0]} pixels wide at most. The reference is the result of the unperturbed pictures: percent of the reference view's disparities that
change by more than 0.25 px / PSNR of the see-through picture at the same focus (99: equal).

""" + other_table(rows, tuple(REAL), real_cell)
    text += f"\n## Faults\n\nOne gross fault each: {', '.join(FAULTY)}.\n\n" + fault_table(rows)
    path = os.path.join(args.docs, "bench-perturb.md")
    with open(path + ".new", "w") as f:
        f.write(text)
    os.replace(path + ".new", path)
