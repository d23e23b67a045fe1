#!/usr/bin/python3
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
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
import perturb_page

FIELDS = ("light_field", "seed", "kind", "strength", "align", "bad2", "see_through", "clear", "confirmed", "plausible",
          "moved", "lit", "faded", "bent", "faulty", "noise_levels", "noticed")


def say(*words):
    print(*words, flush=True)


class Bench:
    def __init__(self, args):
        self.sst = os.path.join(args.build, "sst")
        self.dir = os.path.join(args.build, "perturb")
        self.size = {**dict.fromkeys(perturb_page.SCENES, args.size), **dict.fromkeys(perturb_page.OTHERS, args.small)}
        self.few = args.few
        self.threads = ("--threads", str(args.threads)) if args.threads else ()
        os.makedirs(self.dir, exist_ok=True)
        self.cache, self.moment = {}, {}  # views of light fields, and of scenes at moments
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
        done = json.loads(self.run("process", lf, "--no-labels", "--align", align, "--json", "-q", *self.threads))
        row = {"light_field": name, "seed": seed, "kind": kind, "strength": strength, "align": align,
               "confirmed": round(done["confirmed_percent"], 1), "plausible": done["plausible"],
               "moved": done["align"]["moved"], "lit": done["align"]["lit"],
               "faded": done["align"]["faded"], "bent": done["align"]["bent"], "noise_levels": round(done["noise_levels"], 1),
               "noticed": " ".join(n["what"] for n in done["noticed"]),
               "faulty": sum(not v["plausible"] for v in done["views"])}
        if os.path.isdir(truth):
            errors = json.loads(self.run("eval", lf, "--truth", truth, "--json"))
            row.update(bad2=round(errors["disparity"]["bad2"], 2), see_through=round(errors["render"]["psnr_occluded"], 2),
                       clear=round(errors["clear"]["psnr"], 2) if errors["clear"].get("psnr") else "")
        else:
            row.update(bad2=round(changed(lf, truth), 2), see_through=psnr(self.render(lf, truth), truth))
        self.keep(**row)
        say(*(f"{k}={v}" for k, v in row.items()))

    def render(self, lf, truth, out="seen.png"):
        """See-through picture at the focus of the unperturbed light field."""
        with open(truth + ".json") as f:
            focus = json.load(f)["focus_px"]
        out = os.path.join(self.dir, out)
        self.run("render", lf, "--focus", str(focus), "-o", out, "-q")
        return perturb.read_picture(out)

    def views(self, lf):
        if lf not in self.cache:
            if len(self.cache) > 3:
                self.cache.clear()
            self.cache[lf] = perturb.read_views(lf)[1]
        return dict(self.cache[lf])

    def moments(self, lf, name, seed, span):
        """Pictures of the scene at moments from 0 to span seconds, pixels formed as those of lf."""
        sets = [self.views(lf)]
        width, height = (perturb.FINE * int(n) for n in self.size[name].split("x"))
        for i in range(1, perturb.TIMES):
            time = span * i / (perturb.TIMES - 1)
            key = f"{lf} {time}"
            if key not in self.moment:
                out = os.path.join(self.dir, "moment")
                self.run("scene", name, "-o", out, "--size", f"{width}x{height}", "--seed", str(seed), "--time", str(time), "-f")
                self.moment[key] = {k: perturb.coarse(v) for k, v in perturb.read_views(out)[1].items()}
                shutil.rmtree(out)
            sets.append(self.moment[key])
        return sets

    def one(self, name, seed, kind, strength, align, lf, truth):
        if self.known(light_field=name, seed=seed, kind=kind, strength=strength, align=align):
            return
        with open(os.path.join(lf, "lightfield.json")) as f:
            info = json.load(f)
        views = self.views(lf)
        rng = np.random.default_rng(seed)
        jpeg = int(strength) if kind == "jpeg" else None
        if kind in perturb.FAULTS:
            fault = perturb.FAULTS[kind]
            views = fault(self.moments(lf, name, seed, perturb.LATE_S) if getattr(fault, "moments", False) else views, rng)
        elif kind not in ("none", "jpeg"):
            change = perturb.SWEEPS[kind][3]
            if getattr(change, "fine", False):
                views = self.views(lf + "-fine")
            if getattr(change, "moments", False):
                views = self.moments(lf, name, seed, strength)
            views = change(views, strength, rng)
        out = perturb.write_views(lf, os.path.join(self.dir, "case"), info, views, jpeg)
        self.measure(name, seed, kind, strength, align, out, truth)
        shutil.rmtree(out)


def measure_labels(bench, name, seed):
    """True labels with noise, refined: share of correct ones, and the see-through picture with them."""
    lf = os.path.join(bench.dir, f"{name}-{seed}")
    for share in perturb_page.LABEL_NOISE:
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
        done = json.loads(bench.run("process", out, "--labels", given, "--json", "-q", *bench.threads))
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
    return 100 * float(np.mean(np.abs(disparity(lf) - np.load(reference + ".npy")) > 0.25))


def psnr(picture, reference):
    error = float(np.mean((picture - perturb.read_picture(reference + ".png")) ** 2))
    return round(10 * np.log10(255 ** 2 / error), 2) if error else 99


def make_scene(bench, name, seed):
    lf = os.path.join(bench.dir, f"{name}-{seed}")
    if not os.path.isdir(lf):
        width, height = bench.size[name].split("x")
        size = f"{perturb.FINE * int(width)}x{perturb.FINE * int(height)}"
        bench.run("scene", name, "-o", lf + "-fine", "--size", size, "--seed", str(seed), "-f")
        bench.run("scene", name, "-o", lf + "-own", "--size", bench.size[name], "--seed", str(seed), "-f")
        perturb.make_coarse(lf + "-own", lf + "-fine")
        os.rename(lf + "-own", lf)
    return lf


def measure_scene(bench, name, seed, kind):
    lf = make_scene(bench, name, seed)
    strengths = perturb_page.strengths(name, kind, seed == 1 and not bench.few)
    for strength in strengths:
        bench.one(name, seed, kind, strength, "auto", lf, os.path.join(lf, "truth"))
    for strength in strengths if kind in perturb_page.UNALIGNED and name in perturb_page.SCENES and seed == 1 else ():
        bench.one(name, seed, kind, strength, "off", lf, os.path.join(lf, "truth"))


def measure_faults(bench, name, seed):
    lf = make_scene(bench, name, seed)
    for fault, change in perturb.FAULTS.items():
        if getattr(change, "moments", False) and name not in perturb_page.MOVING:
            continue
        bench.one(name, seed, fault, "", "auto", lf, os.path.join(lf, "truth"))


def measure_real(bench, name, data, most, kinds):
    """A photographed light field against what comes of it unperturbed."""
    kind, folder = perturb_page.REAL[name]
    lf, truth = os.path.join(bench.dir, name), os.path.join(bench.dir, name + "-unperturbed")
    if not os.path.isdir(os.path.join(data, folder)):
        return
    if not os.path.isdir(lf):
        source = lf + "-import"
        bench.run("import", kind, os.path.join(data, folder), "-o", source, "-f")
        perturb.make_small(lf, lf + "-fine", source, most)
        shutil.rmtree(source)
    if not os.path.exists(truth + ".png"):
        info, views = perturb.read_views(lf)
        out = perturb.write_views(lf, os.path.join(bench.dir, "case"), info, views)
        done = bench.run("process", out, "--no-labels", "--json", "-q", *bench.threads)
        with open(truth + ".json", "w") as f:
            f.write(done)
        np.save(truth, disparity(out))
        bench.render(out, truth, name + "-unperturbed.png")
    for kind in ("none", *perturb_page.REAL_KINDS):
        if kinds and kind not in ("none", *kinds.split(",")):
            continue
        for strength in perturb_page.strengths(name, kind, False):
            bench.one(name, 1, kind, strength, "auto", lf, truth)


def measure_seed(bench, seed, args):
    for scene in perturb_page.EVERY:
        if args.only and scene not in args.only.split(","):
            continue
        if scene in perturb_page.REAL:
            if seed == 1:
                measure_real(bench, scene, args.real, int(args.small.split("x")[0]), args.kinds)
            continue
        if seed > 1 and scene not in perturb_page.SCENES:
            continue
        for kind in ("none", *perturb.SWEEPS) if seed == 1 else ("none", *perturb_page.SEVERAL):
            if args.kinds and kind not in ("none", *args.kinds.split(",")):
                continue
            if scene in perturb_page.MOVING or kind not in ("time", "rolling"):
                measure_scene(bench, scene, seed, kind)
        if args.kinds:
            continue
        if seed == 1 and scene in perturb_page.SCENES:
            measure_labels(bench, scene, seed)
        if seed == 1 and scene in perturb_page.FAULTY:
            measure_faults(bench, scene, seed)
        bench.moment.clear()


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--build", default="build")
    parser.add_argument("--docs", default="docs/measured")
    parser.add_argument("--size", default="256x192", help="of bush and pedestrian")
    parser.add_argument("--small", default="160x120", help="of the other scenes")
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--threads", type=int, default=0, help="of `sst process`; all")
    parser.add_argument("--real", default="../shared/data", help="folder of photographed light fields; left out where absent")
    parser.add_argument("--few", action="store_true", help="the few strengths of seed 2 for seed 1, too")
    parser.add_argument("--only", help="light fields, separated by commas")
    parser.add_argument("--kinds", help="perturbations, separated by commas: those alone, without faults and labels")
    parser.add_argument("--page", action="store_true", help="only write the page of what was measured")
    args = parser.parse_args()
    bench = Bench(args)
    for seed in range(1, args.seeds + 1) if not args.page else ():
        measure_seed(bench, seed, args)
    perturb_page.write(bench.rows, args)


if __name__ == "__main__":
    sys.exit(main())
