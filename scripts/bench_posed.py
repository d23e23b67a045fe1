#!/usr/bin/python3
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
"""Measure light fields with a pose for every view and renew docs/measured/bench-posed.md: bench_posed.py [--arrays DIR] [--thermal DIR].

Simulated forests and flights with exact truth; of public data, kept outside the tree: --arrays a folder of SET1, SET2, ... with ten pictures
C0.png ... each (Through-Foliage-Tracking-with-Airborne-Optical-Sectioning, Data/), --thermal a folder with Images/, Poses/ and
Labels/ (cvlab-2020, lab_03/data/F6). What is absent is skipped with a message.
"""
import argparse
import json
import math
import os
import re
import shutil
import subprocess
import tempfile
import time

import numpy as np

from bench import say, write
from perturb import read_picture

SEEDS = (1, 2, 3)
NEAR, FAR = 25, 50  # m: where the simulated ground is sought
LEAST_IOU = 0.1     # of a box and a label
LEAST_VIEWS = 8     # where an integral of ten views is compared with the picture beside


def run(sst, *args):
    """Output, and seconds of wall and processor time; None where the program fails, with its message."""
    before, start = os.times(), time.monotonic()
    done = subprocess.run([sst, *map(str, args)], text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE, check=False)
    after = os.times()
    seconds = time.monotonic() - start, after[2] - before[2] + after[3] - before[3]
    if done.returncode:
        say(done.stderr.strip().splitlines()[-1] if done.stderr.strip() else f"sst {args[0]} failed")
        return None, seconds
    return done.stdout, seconds


def run_json(sst, *args):
    text, seconds = run(sst, *args, "--json")
    return json.loads(text) if text else None, seconds


def psnr(a, b, where):
    return 10 * math.log10(255 ** 2 / max(float(((a - b)[where] ** 2).mean()), 1e-9))


# --- poses ----------------------------------------------------------------------------------------------------------

def cameras(lf):
    views = json.load(open(f"{lf}/lightfield.json"))["views"]
    return ([np.array(v["rotation"]).reshape(3, 3) for v in views],
            np.array([np.array(v["position_mm"]) / 1000 for v in views]))


def true_cameras(lf):
    listed = json.load(open(f"{lf}/truth/truth.json"))["cameras"]
    return [np.array(c["rotation"]).reshape(3, 3) for c in listed], np.array([c["position_m"] for c in listed])


def rotations_off(found, true):
    """Angles in degrees between rotations relative to the first view's."""
    def angle(k):
        m = found[k] @ found[0].T @ (true[k] @ true[0].T).T
        return math.degrees(math.acos(min(max((np.trace(m) - 1) / 2, -1), 1)))
    return max(angle(k) for k in range(len(found)))


def ground_off(lf, surface, view):
    """Error of the depths of a ground along a view's axis against the truth, percent, root mean square."""
    true = read_levels(f"{lf}/truth/floor.pfm")
    views = json.load(open(f"{lf}/lightfield.json"))["views"]
    v = next(v for v in views if v["name"] == view or v["name"].rsplit(".", 1)[0] == view)
    lens, rotation = v["lens"], np.array(v["rotation"]).reshape(3, 3)
    x, y = np.meshgrid(*((np.arange(n) - lens[c]) / lens[f] for n, c, f in zip(true.shape[::-1], ("cx", "cy"), ("fx", "fy"))))
    along = np.stack([x, y, np.ones_like(x)], -1) @ (rotation @ np.array(surface["normal"]))
    found = (surface["offset_m"] - np.array(surface["normal"]) @ np.array(v["position_mm"]) / 1000) / along
    return 100 * float(np.sqrt(((found / true - 1) ** 2).mean()))


def forest(sst, work, seed):
    """Poses from pictures of a simulated forest, and what is seen and found with them and with the true ones."""
    true, blind = f"{work}/true", f"{work}/blind"
    for lf, options in ((true, ()), (blind, ("--unplaced",))):
        run(sst, "scene", "forest", "-o", lf, "--seed", seed, "-q", "--force", *options)
    poses, (wall, cpu) = run_json(sst, "poses", blind, "--focal", 2180, "--spacing", 1000)
    result = {"seed": seed, "poses": poses, "wall_s": wall, "cpu_s": cpu}
    rotations, _ = cameras(blind)
    result["rotation_off_deg"] = rotations_off(rotations, true_cameras(true)[0])
    truth = json.load(open(f"{true}/truth/truth.json"))
    behind = read_picture(f"{true}/truth/behind.png")
    for name, lf in (("true", true), ("found", blind)):
        for method in ("refocus", "clear"):
            picture, valid = f"{work}/{name}-{method}.png", f"{work}/valid.png"
            shown, _ = run(sst, "render", lf, "--view", truth["middle"], "--method", method, "--near", NEAR, "--far", FAR, "-o",
                           picture, "--valid", valid, "--json")
            seen = read_picture(valid)[:, :, 0] > 0
            if name == "true" and method == "refocus":
                result["ground_off_percent"] = ground_off(lf, json.loads(shown)["surface"], truth["middle"])
            result[f"{name}_{method}_db"] = psnr(read_picture(picture), behind, seen)
            result[f"{name}_{method}_seen"] = float(seen.mean())
    finds, (_, result["find_cpu_s"]) = run_json(sst, "find", true, "--near", NEAR, "--far", FAR)
    walkers = [w for w in truth["walkers"] if w["views"] >= 3]
    near = [[math.dist(f["position_m"][:2], w["position_m"][:2]) < 0.8 for w in truth["walkers"]] for f in finds["finds"]]
    result["walkers"] = len(walkers)
    result["walkers_found"] = sum(any(n[truth["walkers"].index(w)] for n in near) for w in walkers)
    result["others"] = sum(not any(n) for n in near)
    return result


def flight(sst, work, seed):
    """A thermal flight whose compass is a degree off, before and after refinement."""
    lf = f"{work}/flight"
    run(sst, "scene", "flight", "-o", lf, "--seed", seed, "--turn", 1, "--shake", 0.3, "-q", "--force")
    true = true_cameras(lf)[0]

    def yaw():
        found, _ = cameras(lf)
        turns = [f.T @ t for f, t in zip(found, true)]  # of the world, which should stand still
        return abs(float(np.median([math.degrees(math.atan2(m[1, 0], m[0, 0])) for m in turns])))

    result = {"seed": seed, "yaw_before_deg": yaw()}
    _, (result["wall_s"], result["cpu_s"]) = run_json(sst, "poses", lf, "--refine")
    result["yaw_after_deg"] = yaw()
    truth = json.load(open(f"{lf}/truth/truth.json"))
    finds, _ = run_json(sst, "find", lf, "--surface", f"{lf}/truth/ground.obj")
    near = [[math.dist(f["position_m"][:2], w["position_m"][:2]) < 1 for w in truth["walkers"]] for f in finds["finds"]]
    seen = [i for i, w in enumerate(truth["walkers"]) if w["views"] >= 3]
    result["walkers"], result["walkers_found"] = len(seen), sum(any(n[i] for n in near) for i in seen)
    result["others"] = sum(not any(n) for n in near)
    return result


# --- public data ----------------------------------------------------------------------------------------------------

def agreement(picture, valid, beside):
    """Correlation of the grey levels of two pictures of the ground after registration by a homography, of all pixels and where
    eight views see: pictures beside show parts that the views' own pictures do not. None without OpenCV."""
    try:
        import cv2
    except ImportError:
        return None
    ours, theirs = (cv2.imread(p, 0).astype(np.float32) for p in (picture, beside))
    smooth, warp = [cv2.GaussianBlur(p, (0, 0), 2) for p in (ours, theirs)], np.eye(3, dtype=np.float32)
    for window in (15, 5):
        warp = cv2.findTransformECC(*smooth, warp, cv2.MOTION_HOMOGRAPHY, (3, 200, 1e-6), None, window)[1]
    size, how = ours.shape[::-1], cv2.INTER_LINEAR + cv2.WARP_INVERSE_MAP
    inside = cv2.warpPerspective(np.ones_like(theirs), warp, size, flags=how) > 0.999
    theirs, many = cv2.warpPerspective(theirs, warp, size, flags=how), inside & (cv2.imread(valid, cv2.IMREAD_UNCHANGED) >= LEAST_VIEWS)
    return [float(np.corrcoef(ours[where], theirs[where])[0, 1]) for where in (inside, many)]


def arrays(sst, work, folder):
    results = []
    names = sorted((n for n in os.listdir(folder) if re.fullmatch(r"SET\d+", n)), key=lambda n: int(n[3:]))
    for name in names:
        pictures, lf = f"{work}/pictures", f"{work}/set"
        shutil.rmtree(pictures, ignore_errors=True)
        os.mkdir(pictures)
        for k in range(10):
            shutil.copy(f"{folder}/{name}/C{k}.png", pictures)
        run(sst, "import", "pictures", pictures, "-o", lf, "--force")
        poses, (wall, cpu) = run_json(sst, "poses", lf, "--spacing", 1000)
        if not poses:
            results.append({"name": name, "poses": None})
            continue
        _, centres = cameras(lf)
        gaps = np.linalg.norm(np.diff(centres, axis=0), axis=1)
        finds, (_, find_cpu) = run_json(sst, "find", lf)
        run(sst, "render", lf, "--method", "refocus", "-o", f"{work}/integral.png", "--valid", f"{work}/views.png")
        beside = f"{folder}/{name}/Integral.png"
        results.append({"name": name, "poses": poses, "wall_s": wall, "cpu_s": cpu, "gaps": [float(gaps.min()), float(gaps.max())],
                        "finds": [f["score"] for f in finds["finds"]] if finds else None, "find_cpu_s": find_cpu,
                        "agreement": agreement(f"{work}/integral.png", f"{work}/views.png", beside) if os.path.exists(beside) else None})
        say(f"{name}: {poses['placed']} placed, {poses['median_px']:.2f} px")
    return results


def overlap(a, b):
    w, h = min(a[2], b[2]) - max(a[0], b[0]), min(a[3], b[3]) - max(a[1], b[1])
    if w <= 0 or h <= 0:
        return 0
    both = w * h
    return both / ((a[2] - a[0]) * (a[3] - a[1]) + (b[2] - b[0]) * (b[3] - b[1]) - both)


def read_levels(path):
    """Rows of a .pfm from the top."""
    with open(path, "rb") as f:
        f.readline()
        width, height = map(int, f.readline().split())
        order = "<" if float(f.readline()) < 0 else ">"
        return np.frombuffer(f.read(), order + "f4").reshape(height, width)[::-1].astype(float)


def persons(picture, labels):
    """Medians over labelled persons away from the border: diameter of a circle of the area above half of the peak, px, and the peak, levels."""
    smooth = picture.copy()
    smooth[1:-1, 1:-1] = sum(w * picture[1 + dy:picture.shape[0] - 1 + dy, 1 + dx:picture.shape[1] - 1 + dx]
                             for dy in (-1, 0, 1) for dx in (-1, 0, 1) for w in ((2 - abs(dx)) * (2 - abs(dy)) / 16,))
    found = []
    for x0, y0, x1, y1 in np.array(labels).astype(int):
        if x0 < 6 or y0 < 6 or x1 > picture.shape[1] - 4 or y1 > picture.shape[0] - 4:
            continue
        around = smooth[max(0, y0 - 29):y1 + 29, max(0, x0 - 29):x1 + 29]
        above = smooth[y0 - 4:y1 + 4, x0 - 4:x1 + 4] - np.nanmedian(around)
        peak = np.nanpercentile(above, 99)
        found.append((2 * math.sqrt((above > peak / 2).sum() / math.pi), peak))
    return np.median(found, 0).tolist()


def search(sst, work, lf, name, labels, ground=False):
    """Finds on a level plane 34.5 m below a view, or the ground that the program finds, right ones, and how labelled persons look in the integral there."""
    view = next(v for v in json.load(open(f"{lf}/lightfield.json"))["views"] if v["name"] == name)
    scene = ("--view", name, "--surface", "ground" if ground else f"plane:0,0,1,{view['position_mm'][2] / 1000 + 34.5:.4f}")
    finds, (_, cpu) = run_json(sst, "find", lf, *scene)
    run(sst, "render", lf, "--method", "refocus", *scene, "-o", f"{work}/line.pfm")
    used, right = set(), 0
    for f in finds["finds"]:
        best = max(((overlap(f["box"], b), i) for i, b in enumerate(labels) if i not in used), default=(0, -1))
        if best[0] > LEAST_IOU:
            used.add(best[1])
            right += 1
    width, peak = persons(read_levels(f"{work}/line.pfm"), labels)
    return {"finds": len(finds["finds"]), "right": right, "cpu_s": cpu, "width_px": width, "width_m": width * 34.5 / view["lens"]["fx"], "peak": peak}


def thermal(sst, work, folder):
    """Finds of each line beside its labels, with given poses and with refined ones."""
    results = []
    for name in sorted(os.listdir(f"{folder}/Images"), key=int):
        listed = json.load(open(f"{folder}/Labels/Label{name}.json"))["Labels"]
        listed = [listed] if isinstance(listed, dict) else listed
        lf = f"{work}/line"
        run(sst, "import", "poses", f"{folder}/Poses/{name}.json", "--pictures", f"{folder}/Images/{name}", "--focal", 529, "-o", lf,
            "--force")
        corners = [np.array(label["poly"], float) for label in listed]
        labels = [[*c.min(0), *c.max(0)] for c in corners]
        result = {"name": name, "labels": len(labels), "given": search(sst, work, lf, listed[0]["imagefile"], labels)}
        poses, (_, result["cpu_s"]) = run_json(sst, "poses", lf, "--refine")
        result["sharper"] = poses.get("sharper", 1) if poses else 1
        result["refined"] = search(sst, work, lf, listed[0]["imagefile"], labels)
        result["ground"] = search(sst, work, lf, listed[0]["imagefile"], labels, ground=True)
        results.append(result)
        say(f"line {name}: {result['given']['width_px']:.1f} px, refined {result['refined']['width_px']:.1f} px, on its ground {result['ground']['width_px']:.1f} px")
    return results


# --- page -----------------------------------------------------------------------------------------------------------

def table(head, rows):
    return "\n".join(["| " + " | ".join(head) + " |", "|" + " --: |" * len(head),
                      *("| " + " | ".join(str(c) for c in row) + " |" for row in rows)])


def page(figures):
    lines = ["# Light fields with a pose for every view\n",
             "Made by `make bench-posed` (`scripts/bench_posed.py`). Do not edit: the next run overwrites this page.\n",
             "## Ten cameras over a simulated forest\n",
             "`sst scene forest`, 1024x1024, focal length given. Rotations against the truth relative to the first view; PSNR of the middle view against the picture without trees, over",
             "the pixels that a method calls seen; walkers that at least three views show.\n",
             table(("seed", "placed", "median px", "rotation off °", "mean: true poses, found poses dB", "clear: true, found dB", "clear: seen %", "ground off %", "walkers found", "other finds",
                    "poses CPU s", "find CPU s"),
                   [(f["seed"], f"{f['poses']['placed']} of {f['poses']['views']}", f"{f['poses']['median_px']:.2f}", f"{f['rotation_off_deg']:.3f}",
                     f"{f['true_refocus_db']:.1f}, {f['found_refocus_db']:.1f}", f"{f['true_clear_db']:.1f}, {f['found_clear_db']:.1f}",
                     f"{100 * f['true_clear_seen']:.0f}", f"{f['ground_off_percent']:.2f}", f"{f['walkers_found']} of {f['walkers']}", f["others"], f"{f['cpu_s']:.1f}",
                     f"{f['find_cpu_s']:.1f}") for f in figures["forest"]]),
             "\n## A thermal flight whose compass is a degree off\n",
             "`sst scene flight --turn 1 --shake 0.3`, then `sst poses --refine`: error of the direction of all pictures together; finds on the true terrain.\n",
             table(("seed", "yaw before °", "after °", "walkers found", "other finds", "CPU s"),
                   [(f["seed"], f"{f['yaw_before_deg']:.2f}", f"{f['yaw_after_deg']:.2f}", f"{f['walkers_found']} of {f['walkers']}",
                     f["others"], f"{f['cpu_s']:.1f}") for f in figures["flight"]])]
    if figures.get("arrays"):
        lines += ["\n## Ten cameras over a real forest\n",
                  "Through-Foliage-Tracking-with-Airborne-Optical-Sectioning; poses, focal length and ground from the pictures alone. Finds are listed by score.",
                  "Agreement: correlation of the grey levels of `sst render --method refocus` and of the authors' integral, registered by a homography (ECC): of all",
                  f"pixels, and of those that {LEAST_VIEWS} views see. Their integrals also show parts that no picture beside them shows, and are",
                  "focused on planes on which the views correlate 0.55 to 0.8 times as much as on the ground.\n",
                  table(("set", "placed", "median px", "90 % px", "distances of neighbours", "finds", "agreement", "poses CPU s", "find CPU s"),
                        [(f["name"], f["poses"]["placed"], f"{f['poses']['median_px']:.2f}", f"{f['poses']['p90_px']:.2f}",
                          f"{f['gaps'][0]:.2f}..{f['gaps'][1]:.2f}", ", ".join(f"{s:.1f}" for s in f["finds"]) if f["finds"] is not None else "no ground",
                          "–" if f.get("agreement") is None else ", ".join(f"{a:.2f}" for a in f["agreement"]), f"{f['cpu_s']:.1f}", f"{f['find_cpu_s']:.1f}") if f["poses"] else (f["name"], 0, *["–"] * 7)
                         for f in figures["arrays"]])]
    if figures.get("thermal"):
        lines_ = figures["thermal"]
        ways = {"given": "given poses", "refined": "refined poses", "ground": "refined poses on the ground that the program finds"}
        count = {w: [sum(f[w][k] for f in lines_) for k in ("finds", "right")] for w in ways}
        people = max(sum(f["labels"] for f in lines_), 1)
        told = [f"{ways[w]}: precision {c[1] / max(c[0], 1):.2f}, recall {c[1] / people:.2f}, persons {np.mean([f[w]['width_px'] for f in lines_]):.1f} px "
                f"({np.mean([f[w]['width_m'] for f in lines_]):.2f} m) wide, peak {np.mean([f[w]['peak'] for f in lines_]):.1f} levels" for w, c in count.items()]
        lines += ["\n## A thermal flight over a real forest\n",
                  f"cvlab-2020, F6; a level plane 34.5 m below the labelled picture, IoU above {LEAST_IOU}. With " + "; with ".join(told) + ".",
                  "Widths are of labelled persons in the integral, at half of the peak; medians of each line. A refined lens changes what a pixel is on the ground. Columns of",
                  "three: given poses, refined (`sst poses --refine`), refined on the ground that the program finds.\n",
                  table(("line", "labelled persons", "finds", "right", "width px", "width m", "peak levels", "sharper", "poses CPU s", "find CPU s: plane, ground"),
                        [(f["name"], f["labels"], *(", ".join(str(f[w][k]) for w in ways) for k in ("finds", "right")),
                          *(", ".join(f"{f[w][k]:.{d}f}" for w in ways) for k, d in (("width_px", 1), ("width_m", 2), ("peak", 1))), f"{f['sharper']:.2f}", f"{f['cpu_s']:.1f}",
                          f"{f['refined']['cpu_s']:.1f}, {f['ground']['cpu_s']:.1f}") for f in lines_])]
    return "\n".join(lines) + "\n"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--build", default="build")
    parser.add_argument("--arrays", help="folder of SET1, SET2, ...")
    parser.add_argument("--thermal", help="folder with Images, Poses and Labels")
    parser.add_argument("--out", default="docs/measured/bench-posed.md", help="page to write (%(default)s)")
    args = parser.parse_args()
    sst, figures = f"{args.build}/sst", {}
    with tempfile.TemporaryDirectory() as work:
        figures["forest"] = [forest(sst, work, seed) for seed in SEEDS]
        figures["flight"] = [flight(sst, work, seed) for seed in SEEDS]
        for name, measure, folder in (("arrays", arrays, args.arrays), ("thermal", thermal, args.thermal)):
            if folder and os.path.isdir(folder):
                figures[name] = measure(sst, work, folder)
            else:
                say(f"skipped: {name}; give --{name} DIR with the public pictures")
    write(args.out, page(figures))


if __name__ == "__main__":
    main()
