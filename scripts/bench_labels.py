#!/usr/bin/python3
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
"""Measure the segmentation networks: `make bench-networks`. Renews docs/measured/bench-labels.md and its charts.

Runs the product (`sst segment --prob`, `sst process`) with every pspnet-*.onnx of models/ on CamVid's validation part and
on simulated scenes of seeds that no network was trained on. What is fitted (temperature, entropy threshold) is fitted on
the first half of the images and reported on the second. Raw figures go to BUILD/bench/labels.json.

  scripts/bench_labels.py [--every N] [--part NAME]... | --self-test
"""
import argparse
import glob
import itertools
import json
import os
import shutil
import statistics
import subprocess
import sys
import time

import numpy as np

import bench
import labels_math
import labels_report
import labels_scenes
from bench import say

PARTS = ("quality", "drives", "changes", "calibration", "times", "layouts", "refinement", "sheets")
LEVELS = {"best": {}, "AVX2": {"SST_CPU": "avx2", "ONEDNN_MAX_CPU_ISA": "AVX2"}}  # of the processor, by environment
CHUNK = 8  # images whose probabilities lie on the disk at a time


def call(*command):
    return subprocess.run([str(c) for c in command], check=True, text=True, stdout=subprocess.PIPE).stdout


def segment(images, folder, model, *options):
    """What `sst segment --json` says of the images; their labels lie in folder/labels."""
    os.makedirs(f"{folder}/labels", exist_ok=True)
    return json.loads(call(ARGS.sst, "segment", *images, "-o", f"{folder}/labels", "--json", "--model", model, *options))


def with_temperature(model, folder, temperature):
    """A copy of the network with this temperature; its own where that is None."""
    if temperature is None:
        return model
    copy = f"{folder}/t{temperature:.4f}.onnx"
    shutil.copy(model, copy)
    with open(f"{copy}.yaml", "w") as f:
        f.write(f"temperature: {temperature:.6f}\n")
    return copy


def measure(pairs, model, temperature=None, keep=0):
    """Confusion over all pixels and labels_math.Samples of every third pixel of every third row, of (image, truth) pairs;
    with keep, also the distributions and truths of one pixel in that many."""
    folder = f"{ARGS.out}/labels-run"
    shutil.rmtree(folder, ignore_errors=True)
    os.makedirs(folder)
    model, total, parts, kept = with_temperature(model, folder, temperature), 0, [], []
    for first in range(0, len(pairs), CHUNK):
        chunk = pairs[first:first + CHUNK]
        names = []
        for i, (image, _) in enumerate(chunk):  # names of different folders may be equal
            names.append(f"{folder}/{i}{os.path.splitext(image)[1]}")
            shutil.copy(image, names[-1])
        os.makedirs(f"{folder}/prob", exist_ok=True)
        segment(names, folder, model, "--prob", f"{folder}/prob")
        for i, (_, truth) in enumerate(chunk):
            prob, truth = np.load(f"{folder}/prob/{i}.npy"), truth()
            labels = labels_scenes.read_labels(f"{folder}/labels/{i}.png")
            total = total + labels_math.confusion(labels, truth, len(prob))
            parts.append(labels_math.samples(prob[:, ::3, ::3], truth[::3, ::3]))
            if keep:
                flat, known = prob.reshape(len(prob), -1), np.flatnonzero(truth.ravel())[::keep]
                kept.append((flat[:, known], truth.ravel()[known]))
    shutil.rmtree(folder)
    samples = {key: np.concatenate([p[key] for p in parts]) for key in parts[0]}
    if not keep:
        return total, samples
    return total, samples, np.concatenate([k[0] for k in kept], 1), np.concatenate([k[1] for k in kept])


def shipped(model):
    """Temperature and entropy threshold that the network carries."""
    said = json.loads(call(ARGS.sst, "models", model, "--json"))
    return float(said["temperature"]), float(said["epsilon_h"])


def calibration(pairs, model):
    """Fit on one half, report on the other: reliability and coverage before and after. The pictures come in the order of a
    drive, or by seed: neighbours in that order are alike and must not be in both halves."""
    fit, report = pairs[:len(pairs) // 2], pairs[len(pairs) // 2:]
    temperature, epsilon = shipped(model)
    _, _, prob, truth = measure(fit, model, 1.0, keep=97)
    fitted = labels_math.fit_temperature(prob, truth)
    _, fit_samples = measure(fit, model, fitted)
    fitted_epsilon = labels_math.fit_epsilon(fit_samples)
    result = {"images": len(report), "temperature": {"shipped": temperature, "fitted": fitted},
              "epsilon_h": {"shipped": epsilon, "fitted": fitted_epsilon}, "runs": {}}
    for name, t in (("T = 1", 1.0), ("shipped", None), ("fitted", fitted)):
        total, samples = measure(report, model, t)
        limit = {"shipped": epsilon, "fitted": fitted_epsilon}.get(name)
        result["runs"][name] = labels_math.summary(samples, limit)
        if name == "shipped":
            result["pixels_right"] = float(np.trace(total) / total.sum())
    return result


def quality(pairs, model, *options):
    """IoU per class and share of right pixels over all images."""
    folder, total, taken = f"{ARGS.out}/labels-run", 0, []
    shutil.rmtree(folder, ignore_errors=True)
    classes = labels_scenes.classes_of(ARGS.sst, model)
    for first in range(0, len(pairs), CHUNK):
        for i, (image, truth) in enumerate(pairs[first:first + CHUNK]):
            os.makedirs(f"{folder}/in", exist_ok=True)
            shutil.copy(image, f"{folder}/in/{i}{os.path.splitext(image)[1]}")
        said = segment([f"{folder}/in"], folder, model, "--threads", "1", *options)["images"]
        taken += [i["cpu_ms"] for i in said[1:] or said]  # the first of a run plans its memory
        for i, (_, truth) in enumerate(pairs[first:first + CHUNK]):
            total = total + labels_math.confusion(labels_scenes.read_labels(f"{folder}/labels/{i}.png"), truth(),
                                                  len(classes))
        shutil.rmtree(folder)
    iou = labels_math.iou(total)
    return {"miou": float(np.nanmean(iou)), "right": float(np.trace(total) / total.sum()),
            "cpu_ms": statistics.median(taken),
            "iou": {c: None if np.isnan(v) else float(v) for c, v in zip(classes, iou)}}


def times(images, models, rounds):
    """Median wall and CPU ms per 480x360 image, networks, levels of the processor and threads taking turns."""
    folder, taken, environment = f"{ARGS.out}/labels-run", {}, dict(os.environ)
    for _, model, (level, limit), threads in itertools.product(range(rounds), models, LEVELS.items(), (1, 2)):
        os.environ.update(limit)
        said = segment(images, folder, model, "--threads", threads)["images"][1:]  # the first plans its memory
        os.environ.clear()
        os.environ.update(environment)
        for key in ("ms", "cpu_ms"):
            taken.setdefault((model, level, threads, key), []).append(statistics.median(i[key] for i in said))
    shutil.rmtree(folder)
    return [{"model": os.path.basename(m), "level": c, "threads": t, "key": k, "ms": statistics.median(v),
             "least": min(v), "most": max(v)} for (m, c, t, k), v in taken.items()]


def drives(known):
    """Quality of the networks of --left-out, each on the drive that it has not seen; those measured before are kept."""
    found = {(d["drive"], d["network"]): d for d in known}
    for drive, _, model in (text.partition("=") for text in ARGS.left_out):
        pairs = (labels_scenes.camvid(ARGS.camvid, "train", drive) + labels_scenes.camvid(ARGS.camvid, "val", drive))
        if not drive or not pairs or not os.path.exists(model):
            sys.exit(f"bench: --left-out {drive}={model}: no picture of that drive, or no such file")
        name = os.path.basename(model)
        found[drive, name] = {"drive": drive, "network": name, "images": len(pairs),
                              "quality": quality(pairs[::ARGS.every], os.path.abspath(model))}
    return list(found.values())


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--build", default="build", help="folder with the built programs (build)")
    parser.add_argument("--camvid", default="../shared/data/camvid", help="folder with val, valannot (%(default)s)")
    parser.add_argument("--left-out", action="append", default=[], metavar="DRIVE=ONNX", help="also measure on this drive of "
                        "CamVid a network that was trained without it (models/train_pspnet.py --leave-out DRIVE)")
    parser.add_argument("--models", default="models", help="folder with the networks (%(default)s)")
    parser.add_argument("--every", type=int, default=1, help="measure one image in this many, for a first look; docs/ stays as it is")
    parser.add_argument("--part", action="append", choices=PARTS,
                        help="measure again only these; the others stay as they are")
    parser.add_argument("--self-test", action="store_true", help="check the figures' formulas against hand-worked values")
    global ARGS
    ARGS = parser.parse_args()
    if ARGS.self_test:
        return labels_math.self_test()
    os.chdir(os.path.join(os.path.dirname(os.path.abspath(__file__)), ".."))
    ARGS.sst, ARGS.out, start = f"{ARGS.build}/sst", f"{ARGS.build}/bench", time.monotonic()
    os.environ["SST_MODELS"] = os.path.abspath(ARGS.models)
    os.makedirs(ARGS.out, exist_ok=True)
    labels_math.self_test()
    models = sorted(glob.glob(f"{ARGS.models}/pspnet-*.onnx"), key=os.path.getsize)
    sets = {"CamVid val": labels_scenes.camvid(ARGS.camvid)[::ARGS.every],
            "scenes": labels_scenes.scenes(ARGS.sst, ARGS.out, "640x480", range(150, 154))[::ARGS.every]}
    if not sets["CamVid val"]:
        sys.exit(f"bench: {ARGS.camvid} lacks val and valannot; give --camvid DIR")
    saved = f"{ARGS.out}/labels.json"
    result = json.load(open(saved)) if ARGS.part and os.path.exists(saved) else {}
    for part in ARGS.part or PARTS:
        say(f"labels: {part}")
        if part == "times":
            result[part] = times([image for image, _ in sets["CamVid val"][:6]], models, 5)
        elif part == "layouts":
            result[part] = labels_scenes.layouts(ARGS, quality, segment, sets["CamVid val"], models[0])
        elif part == "sheets":  # CamVid's pictures are not ours to publish: they stay in the build folder
            pick = [sets["CamVid val"][i * len(sets["CamVid val"]) // 6] for i in range(6)]
            labels_scenes.sheet(pick, ARGS.out, segment, models[0], f"{ARGS.out}/labels-camvid.jpg")
            labels_scenes.sheet(sets["scenes"][:7], ARGS.out, segment, models[0], f"{ARGS.out}/labels-scenes.jpg")
            if ARGS.every == 1:
                shutil.copy(f"{ARGS.out}/labels-scenes.jpg", "docs/pictures")
        elif part == "drives":
            result[part] = drives(result.get(part, []))
        elif part == "changes":
            result[part] = labels_scenes.changes(ARGS, quality, sets["CamVid val"], models)
        elif part == "refinement":
            result[part] = labels_scenes.refinement(ARGS.sst, ARGS.out, call, shipped(models[0])[1])
        else:
            function = {"quality": quality, "calibration": calibration}[part]
            result[part] = {os.path.basename(m): {name: function(pairs, m) for name, pairs in sets.items()} for m in models}
        bench.write(saved, json.dumps(result, indent=1))
    missing = sorted(set(PARTS) - {"sheets"} - set(result))
    if missing:
        return say(f"labels: no page before these are measured: {', '.join(missing)}")
    os.makedirs(f"{ARGS.out}/docs", exist_ok=True)
    made = labels_report.write(result, f"{ARGS.out}/docs", "make bench-networks")
    for path in made if ARGS.every == 1 else ():
        shutil.copy(path, "docs/measured")
    say(f"labels: {time.monotonic() - start:.0f} s; {'docs/measured' if ARGS.every == 1 else ARGS.out + '/docs'}/bench-labels.md")


if __name__ == "__main__":
    try:
        main()
    except subprocess.CalledProcessError as error:
        sys.exit(f"bench: stopped: {error}")
