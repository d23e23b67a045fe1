#!/usr/bin/python3
"""Error against perturbation: what each thing that is wrong with the pictures costs, and at which strength it is noticed.

Renews docs/measured/bench-perturb.md and its charts; `make bench-perturb` runs this. What is measured stays in
BUILD/perturb/results.csv: a run that is stopped goes on where it was. Needs python3-numpy, python3-pil, gnuplot.
"""
import argparse
import csv
import json
import os
import shutil
import subprocess
import sys

import numpy as np
from PIL import Image

import perturb
from bench_report import COLOURS, cpu_name

SCENES = ("bush", "pedestrian")
FIELDS = ("light_field", "seed", "kind", "strength", "align", "bad2", "see_through", "clear", "confirmed", "plausible",
          "moved", "lit", "faded", "faulty")
UNALIGNED = ("vertical", "both", "none")  # measured with --align off, too
MOVING = ("pedestrian",)  # the scenes for what depends on time
LABEL_NOISE = (0, 0.1, 0.3)
REAL_KINDS = {"noise": (5,), "gain": (0.2,), "jpeg": (75,)}  # what displaces pictures needs finer ones
CHARTED = ("vertical", "gain", "vignetting", "noise")


def say(*words):
    print(*words, flush=True)


class Bench:
    def __init__(self, args):
        self.sst = os.path.join(args.build, "sst")
        self.dir = os.path.join(args.build, "perturb")
        self.size = args.size
        os.makedirs(self.dir, exist_ok=True)
        self.path = os.path.join(self.dir, "results.csv")
        self.rows = []
        if os.path.exists(self.path):
            with open(self.path) as f:
                self.rows = list(csv.DictReader(f))

    def run(self, *args):
        return subprocess.run([self.sst, *args], stdin=subprocess.DEVNULL, capture_output=True, text=True, check=True).stdout

    def known(self, **key):
        return any(all(r[k] == str(v) for k, v in key.items()) for r in self.rows)

    def keep(self, **row):
        self.rows.append({k: str(row.get(k, "")) for k in FIELDS})
        with open(self.path + ".new", "w", newline="") as f:
            out = csv.DictWriter(f, FIELDS)
            out.writeheader()
            out.writerows(self.rows)
        os.replace(self.path + ".new", self.path)

    def measure(self, name, seed, kind, strength, align, lf, truth):
        """Process and judge one light field."""
        done = json.loads(self.run("process", lf, "--no-labels", "--align", align, "--json", "-q"))
        row = {"light_field": name, "seed": seed, "kind": kind, "strength": strength, "align": align,
               "confirmed": round(done["confirmed_percent"], 1), "plausible": done["plausible"],
               "moved": done["align"]["moved"], "lit": done["align"]["lit"],
               "faded": done["align"]["faded"],
               "faulty": sum(not v["plausible"] for v in done["views"])}
        if os.path.isdir(truth):
            errors = json.loads(self.run("eval", lf, "--truth", truth, "--json"))
            row.update(bad2=round(errors["disparity"]["bad2"], 2), see_through=round(errors["render"]["psnr_occluded"], 2),
                       clear=round(errors["clear"]["psnr"], 2) if errors["clear"].get("psnr") else "")
        else:
            row["bad2"] = round(changed(lf, truth), 2)
        self.keep(**row)
        say(*(f"{k}={v}" for k, v in row.items()))

    def moments(self, lf, name, seed, span):
        """Pictures of the scene at moments from 0 to span seconds, pixels formed as those of lf."""
        sets = [perturb.read_views(lf)[1]]
        for i in range(1, perturb.TIMES):
            out = os.path.join(self.dir, "moment")
            width, height = self.size.split("x")
            self.run("scene", name, "-o", out, "--size", f"{perturb.FINE * int(width)}x{perturb.FINE * int(height)}", "--seed",
                     str(seed), "--time", str(span * i / (perturb.TIMES - 1)))
            sets.append({k: perturb.coarse(v) for k, v in perturb.read_views(out)[1].items()})
            shutil.rmtree(out)
        return sets

    def one(self, name, seed, kind, strength, align, lf, truth):
        if self.known(light_field=name, seed=seed, kind=kind, strength=strength, align=align):
            return
        info, views = perturb.read_views(lf)
        rng = np.random.default_rng(seed)
        jpeg = int(strength) if kind == "jpeg" else None
        if kind in perturb.FAULTS:
            views = perturb.FAULTS[kind](views, rng)
        elif kind not in ("none", "jpeg"):
            change = perturb.SWEEPS[kind][3]
            if getattr(change, "fine", False):
                views = perturb.read_views(lf + "-fine")[1]
            if getattr(change, "moments", False):
                views = self.moments(lf, name, seed, strength)
            views = change(views, strength, rng)
        out = perturb.write_views(lf, os.path.join(self.dir, "case"), info, views, jpeg)
        self.measure(name, seed, kind, strength, align, out, truth)
        shutil.rmtree(out)


def measure_labels(bench, name, seed):
    """True labels with noise, refined: share of correct ones, and the see-through picture with them."""
    lf = os.path.join(bench.dir, f"{name}-{seed}")
    for share in LABEL_NOISE:
        if bench.known(light_field=name, seed=seed, kind="labels", strength=share):
            continue
        info, views = perturb.read_views(lf)
        out = perturb.write_views(lf, os.path.join(bench.dir, "case"), info, views)
        rng = np.random.default_rng(seed)
        given = os.path.join(bench.dir, "given")
        shutil.rmtree(given, ignore_errors=True)
        os.makedirs(given)
        for v in info["views"]:
            file = f"{v['row']:02d}_{v['col']:02d}.png"
            with Image.open(os.path.join(lf, "truth", file)) as picture:
                labels = np.asarray(picture)
            Image.fromarray(perturb.noisy_labels(labels, share, rng)).save(os.path.join(given, file))
        done = json.loads(bench.run("process", out, "--labels", given, "--json", "-q"))
        errors = json.loads(bench.run("eval", out, "--truth", os.path.join(lf, "truth"), "--json"))
        bench.keep(light_field=name, seed=seed, kind="labels", strength=share, align="auto",
                   confirmed=round(done["confirmed_percent"], 1), plausible=done["plausible"],
                   see_through=round(errors["render"]["psnr_occluded"], 2),
                   bad2=round(100 - errors["labels"]["accuracy_refined"], 2))
        shutil.rmtree(out)
        shutil.rmtree(given)


def disparity(lf, view="02_02"):
    with open(os.path.join(lf, "lightfield.json")) as f:
        info = json.load(f)
    with Image.open(os.path.join(lf, "disparity", view + ".png")) as picture:
        return np.asarray(picture).astype(float) / 64 + info["disp_min_px"]


def changed(lf, reference):
    """Percent of the reference view's disparities that differ by more than 0.25 px from those of the whole pictures."""
    return 100 * float(np.mean(np.abs(disparity(lf) - np.load(reference)) > 0.25))


def measure_scene(bench, name, seed, kind):
    lf = os.path.join(bench.dir, f"{name}-{seed}")
    if not os.path.isdir(lf):
        width, height = bench.size.split("x")
        size = f"{perturb.FINE * int(width)}x{perturb.FINE * int(height)}"
        bench.run("scene", name, "-o", lf + "-fine", "--size", size, "--seed", str(seed))
        bench.run("scene", name, "-o", lf + "-own", "--size", bench.size, "--seed", str(seed))
        perturb.make_coarse(lf + "-own", lf + "-fine")
        os.rename(lf + "-own", lf)
    truth = os.path.join(lf, "truth")
    for strength in (0,) if kind == "none" else perturb.SWEEPS[kind][2]:
        bench.one(name, seed, kind, strength, "auto", lf, truth)
        if kind in UNALIGNED:
            bench.one(name, seed, kind, strength, "off", lf, truth)


def measure_faults(bench, name, seed):
    for fault in perturb.FAULTS:
        bench.one(name, seed, fault, "", "auto", os.path.join(bench.dir, f"{name}-{seed}"),
                  os.path.join(bench.dir, f"{name}-{seed}", "truth"))


def measure_real(bench, source):
    lf, truth = os.path.join(bench.dir, "backgammon"), os.path.join(bench.dir, "backgammon.npy")
    if not os.path.isdir(lf):
        bench.run("import", "hci", source, "-o", lf)
    if not os.path.exists(truth):
        info, views = perturb.read_views(lf)
        out = perturb.write_views(lf, os.path.join(bench.dir, "case"), info, views)
        bench.run("process", out, "--no-labels", "-q")
        np.save(truth, disparity(out))
    for kind, strengths in REAL_KINDS.items():
        for strength in strengths:
            bench.one("backgammon", 1, kind, strength, "auto", lf, truth)


# --- page -------------------------------------------------------------------------------------------------------------

def mean(rows, field):
    values = [float(r[field]) for r in rows if r[field] not in ("", "None")]
    return sum(values) / len(values) if values else None


def select(rows, **key):
    return [r for r in rows if all(r[k] == str(v) for k, v in key.items())]


def number(value, digits=1):
    return "-" if value is None else f"{value:.{digits}f}"


def noticed(rows):
    """Share of the runs that name something or correct something."""
    return ", ".join(filter(None, (
        "warned" if any(r["plausible"] == "False" for r in rows) else "",
        f"{number(mean(rows, 'moved'), 0)} views moved" if mean(rows, "moved") else "",
        f"{number(mean(rows, 'lit'), 0)} gains" if mean(rows, "lit") else "",
        f"{number(mean(rows, 'faded'), 0)} fall-offs" if mean(rows, "faded") else "")))


def sweep_table(rows, kind):
    title, unit, strengths, _ = perturb.SWEEPS[kind]
    lines = [f"### {title}", "", f"| {unit} | " + " | ".join(f"{s}: bad-2 % | see-through dB | clear dB" for s in SCENES)
             + " | noticed |", "|---|" + "--:|" * 6 + "---|"]
    for align in ("auto", "off"):
        for strength in (0,) + tuple(strengths):
            found = select(rows, kind=kind if strength else "none", strength=strength, align=align)
            found = [r for r in found if r["light_field"] in SCENES]
            if not found or (align == "off" and kind not in UNALIGNED) or (align == "off" and not strength):
                continue
            cells = [f"{strength}" + (" (`--align off`)" if align == "off" else "")]
            for scene in SCENES:
                s = select(found, light_field=scene)
                cells += [number(mean(s, "bad2")), number(mean(s, "see_through")), number(mean(s, "clear"))]
            lines.append("| " + " | ".join(cells + [noticed(found)]) + " |")
    return "\n".join(lines) + "\n" if len(lines) > 5 else ""


def first(rows, kind, holds):
    """Least strength, in the order of the sweep, whose runs are so; "-": none."""
    return next((str(s) for s in perturb.SWEEPS[kind][2]
                 if (found := select(rows, kind=kind, strength=s, align="auto")) and holds(found)), "-")


def loses(rows, found, field, db):
    """Does a scene lose so many dB against its unperturbed picture?"""
    for scene in SCENES:
        before, after = (mean(select(r, light_field=scene), field) for r in (select(rows, kind="none", align="auto"), found))
        if before is not None and after is not None and before - after >= db:
            return True
    return False


def summary_table(rows):
    """What is noticed at which strength, beside the strength at which it costs something."""
    lines = ["| | unit | see-through loses 1 dB at | clear loses 1 dB at | corrected from | warned from |", "|---|---|--:|--:|--:|--:|"]
    for kind, (title, unit, _, _) in perturb.SWEEPS.items():
        if select(rows, kind=kind):
            cells = (first(rows, kind, lambda f: loses(rows, f, "see_through", 1)),
                     first(rows, kind, lambda f: loses(rows, f, "clear", 1)),
                     first(rows, kind, lambda f: any(mean(f, c) for c in ("moved", "lit", "faded"))),
                     first(rows, kind, lambda f: any(r["plausible"] == "False" for r in f)))
            lines.append(f"| {title} | {unit} | " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def label_table(rows):
    lines = ["| cells with another label | " + " | ".join(f"{s}: wrong labels % | see-through dB" for s in SCENES) + " |",
             "|---|" + "--:|" * 4]
    for share in LABEL_NOISE:
        found = select(rows, kind="labels", strength=share)
        cells = [number(mean(select(found, light_field=s), f)) for s in SCENES for f in ("bad2", "see_through")]
        if found:
            lines.append(f"| {100 * share:.0f} % | " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def fault_table(rows):
    lines = ["| fault | noticed | views named | confirmed % |", "|---|---|--:|--:|"]
    for fault in perturb.FAULTS:
        found = [r for r in select(rows, kind=fault)]
        if found:
            lines.append(f"| {fault} | {sum(r['plausible'] == 'False' for r in found)} of {len(found)} | "
                         f"{number(mean(found, 'faulty'), 0)} | {number(mean(found, 'confirmed'), 0)} |")
    return "\n".join(lines) + "\n"


def real_table(rows):
    lines = ["| | strength | disparities of the reference view changed by more than 0.25 px, % | noticed |", "|---|--:|--:|---|"]
    for kind, strengths in REAL_KINDS.items():
        for strength in strengths:
            found = select(rows, light_field="backgammon", kind=kind, strength=strength)
            if found:
                lines.append(f"| {perturb.SWEEPS[kind][0]} | {strength} | {number(mean(found, 'bad2'))} | {noticed(found)} |")
    return "\n".join(lines) + "\n"


def chart(rows, out):
    """See-through error against strength, one panel a perturbation."""
    commands = ['set datafile missing "nan"', "set key bottom left samplen 2", "set grid lc rgb '#dddddd' lt 1",
                "set border 3 lc rgb '#444444'", "set tics nomirror", "set multiplot layout 2,2"]
    for kind in CHARTED:
        title, unit, strengths, _ = perturb.SWEEPS[kind]
        commands += [f'set title "{title}"', f'set xlabel "{unit}"', 'set ylabel "see-through, PSNR in what is hidden, dB"']
        plots, data = [], []
        for i, scene in enumerate(SCENES):
            for align in ("auto", "off") if kind in UNALIGNED else ("auto",):
                points = [(s, mean(select(rows, light_field=scene, kind=kind if s else "none", strength=s, align=align),
                                   "see_through")) for s in (0,) + tuple(strengths)]
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
    for terminal, suffix in (("svg size 1000,760 font 'sans,12' background rgb 'white'", "svg"),
                             ("pngcairo size 1000,760 font 'sans,11'", "png")):
        script = "\n".join([f"set terminal {terminal}", f"set output '{out}.{suffix}'"] + commands) + "\n"
        subprocess.run(["gnuplot"], input=script, text=True, check=True)


def write_page(bench, docs, seeds):
    rows = bench.rows
    os.makedirs(docs, exist_ok=True)
    chart(rows, os.path.join(docs, "bench-perturb"))
    text = f"""# Error against perturbation

Made by `make bench-perturb` on {cpu_name()}. Do not edit: the next run overwrites this page.

Scenes of {bench.size} pixels, 6x6 views, seeds 1 to {seeds}, preset balanced, without labels; the perturbation is drawn for each view.
*bad-2*: disparities off by more than 2 px, all views. *See-through*: PSNR of `sst render` in what the occluder hides. *Clear*: PSNR
of the clear picture. Pixels are means of {perturb.FINE}x{perturb.FINE} pixels of finer pictures, which are displaced before: the
perturbation itself does not blur. What correction leaves of the clear picture's loss is the
resampling of pixels ([notes](notes-method.md#displaced-pictures)). Of gains, the mean of all views is 1. A run that was stopped leaves out rows (-). *Noticed*: `sst process` warns, or reports what it corrected ([design.md](../design/design.md#59-pictures-that-are-off)).

![See-through picture against vertical misalignment, gain, vignetting and noise](bench-perturb.svg)

"""
    text += "## What is noticed at which strength\n\nThe least strength measured; -: at none of them.\n\n" + summary_table(rows)
    text += "\n## Error against strength\n\n"
    text += "\n".join(filter(None, (sweep_table(rows, kind) for kind in perturb.SWEEPS)))
    if select(rows, kind="labels"):
        text += "\n### Label noise\n\nTrue labels, cells of 8x8 pixels exchanged, refined.\n\n" + label_table(rows)
    text += "\n## Faults\n\nOne thing that is plainly wrong; unperturbed, no scene is warned of.\n\n" + fault_table(rows)
    if select(rows, light_field="backgammon"):
        text += "\n## A photographed kind of scene\n\nBackgammon (HCI), against its own maps unperturbed.\n\n" + real_table(rows)
    path = os.path.join(docs, "bench-perturb.md")
    with open(path + ".new", "w") as f:
        f.write(text)
    os.replace(path + ".new", path)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--build", default="build")
    parser.add_argument("--docs", default="docs/measured")
    parser.add_argument("--size", default="256x192")
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--real", default="../shared/data/lf-hci-backgammon-6x6", help="left out where it is absent")
    parser.add_argument("--page", action="store_true", help="only write the page of what was measured")
    args = parser.parse_args()
    bench = Bench(args)
    if not args.page:
        for seed in range(1, args.seeds + 1):
            for kind in ("none", *perturb.SWEEPS):
                for scene in MOVING if kind in ("time", "rolling") else SCENES:
                    measure_scene(bench, scene, seed, kind)
            if seed == 1:
                for scene in SCENES:
                    measure_labels(bench, scene, seed)
                for scene in MOVING:
                    measure_faults(bench, scene, seed)
                if os.path.isdir(args.real):
                    measure_real(bench, args.real)
    write_page(bench, args.docs, args.seeds)


if __name__ == "__main__":
    sys.exit(main())
