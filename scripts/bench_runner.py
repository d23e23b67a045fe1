#!/usr/bin/python3
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
"""Measure the networks by precision, time beside error, and renew docs/measured/bench-runner.md and its chart: bench_runner.py.

Raw figures go to BUILD/bench/runner.json. Figures whose data or network this machine lacks are named and left out.
"""
import argparse
import json
import os
import shutil
import sys

import numpy as np
import onnx
from PIL import Image

import charts
from bench import call, say

PAIRS = {"cones": ("cones/im2.png", "cones/im6.png"), "teddy": ("teddy/im2.png", "teddy/im6.png"),
         "motorcycle": ("motorcycle/motorcycle_left.png", "motorcycle/motorcycle_right.png")}
CLASSES = 11  # of CamVid, first in the networks' lists
WAYS = (("f32", 1), ("int8", 1), ("f32, half size", 2), ("int8, half size", 2))
MATCHING, LABELS = "mccnn-fast.onnx", ("pspnet-small.onnx", "pspnet-large.onnx")
SIZES = {MATCHING: (1000, 750), **{name: (480, 360) for name in LABELS}}


def timed(build, model, rounds):
    """{scale: bench of the network at full and half size}."""
    width, height = SIZES[os.path.basename(model)]
    say(f"{os.path.basename(model)}: times, {rounds} rounds")
    return {scale: json.loads(call(f"{build}/bench/network", model, f"{width // scale}x{height // scale}", rounds,
                                   stdout=-1).stdout) for scale in (1, 2)}


def matching_errors(build, model, data, out):
    """{way: {pair: raw and chain}}."""
    if not os.path.exists(f"{data}/{PAIRS['cones'][0]}"):
        return say(f"skipped: matching errors; {data} lacks the Middlebury pairs, give --data DIR")
    call(sys.executable, "scripts/stereo_truth.py", data, out)
    return {way: {pair: json.loads(call(f"{build}/bench/features", *(f"{data}/{f}" for f in files), f"{out}/{pair}.pfm",
                                        model, way.split(",")[0], scale, stdout=-1).stdout)
                  for pair, files in PAIRS.items()} for way, scale in WAYS}


def at_half_size(model, out):
    """The network with half of its working size; its weights and ranges as they are."""
    network = onnx.load(model)
    for entry in network.metadata_props:
        if entry.key == "sst.size":
            entry.value = "x".join(str(int(n) // 2) for n in entry.value.split("x"))
    onnx.save(network, f"{out}/half.onnx")
    return f"{out}/half.onnx"


def label_errors(build, model, camvid, out, every):
    """{way: mean IoU over CamVid's classes, pixels right, agreement with f32}, percent, over part of its validation."""
    names = sorted(os.listdir(f"{camvid}/val"))[::every] if os.path.isdir(f"{camvid}/val") else []
    if not names:
        return say(f"skipped: label errors; {camvid} lacks val/, give --camvid DIR")
    say(f"{os.path.basename(model)}: labels of {len(names)} pictures, {len(WAYS)} ways")
    result, first = {}, {}
    for way, scale in WAYS:
        file, total, same = model if scale == 1 else at_half_size(model, out), np.zeros((CLASSES, 257), np.int64), []
        for name in names:
            call(f"{build}/sst", "segment", f"{camvid}/val/{name}", "-o", f"{out}/labels.png", "--model", file,
                 "--precision", way.split(",")[0], "--threads", 2)
            label = np.asarray(Image.open(f"{out}/labels.png")).astype(int) - 1
            truth = np.asarray(Image.open(f"{camvid}/valannot/{os.path.splitext(name)[0]}.png")).astype(int)
            known = truth < CLASSES
            np.add.at(total, (truth[known], label[known]), 1)
            same.append((label == first.setdefault(name, label)).mean())
        hits, seen = np.diag(total[:, :CLASSES]), total.sum(1) > 0
        union = total.sum(1) + total[:, :CLASSES].sum(0) - hits
        result[way] = {"miou": 100 * float((hits / np.maximum(union, 1))[seen].mean()),
                       "right": 100 * float(hits.sum() / total.sum()), "same": 100 * float(np.mean(same)),
                       "pictures": len(names)}
    return result


def ms(times, way, scale, threads=2, what="network", key="ms"):
    """Time at a scale of what a way of WAYS runs."""
    precision = way.split(",")[0]
    return next(t[key] for t in times[scale]["times"]
                if (t["what"], t["precision"], t["threads"]) == (what, precision, threads))


def time_table(times):
    head = ["precision, size", "threads", "network ms", "min..max", "CPU ms", "convolutions alone ms", "network / alone"]
    rows = []
    for way, scale in WAYS:
        for threads in (1, 2):
            whole, bare = ms(times, way, scale, threads), ms(times, way, scale, threads, "convolutions")
            ends = [ms(times, way, scale, threads, key=k) for k in ("min_ms", "max_ms")]
            rows.append([way, threads, f"{whole:.1f}", "{:.1f}..{:.1f}".format(*ends),
                         f"{ms(times, way, scale, threads, key='cpu_ms'):.1f}", f"{bare:.1f}", f"{whole / bare:.2f}"])
    return charts.table(head, rows)


TEXT = """\
Times: the whole network in the program beside its convolutions alone as bare oneDNN primitives, each in the layouts that
the library likes best (tests/bench/network.c); {rounds} interleaved rounds in one process after one to warm up, medians.
Half size: the network on pictures of half the width and height, its result enlarged.

![time against error](time-error-networks.svg)

"""


def report(measured, out, command):
    text, groups = TEXT.format(rounds=next(iter(measured.values()))["times"][1]["rounds"]), {}
    for name, m in measured.items():
        times = m["times"]
        text += "## {}, {}x{}\n\n{}\n".format(name, *SIZES[name], time_table(times))
        if m["errors"] and name == MATCHING:
            head = ["pixels off by more than 2 px, %"] + [f"{p}, {k}" for p in PAIRS for k in ("raw", "chain")]
            text += charts.table(head, [[way] + [f"{e[p][k]['bad2']:.2f}" for p in PAIRS for k in ("raw", "chain")]
                                              for way, e in m["errors"].items()])
            text += "\nRaw: the winner of the features alone; chain: preset accurate. All pixels, hidden ones too.\n\n"
            groups[name] = [(way, ms(times, way, scale), np.mean([e["chain"]["bad2"] for e in m["errors"][way].values()]))
                            for way, scale in WAYS]
        elif m["errors"]:
            head = ["CamVid validation", "mean IoU %", "pixels right %", "same label as f32 %"]
            text += charts.table(head, [[way] + [f"{e[k]:.2f}" for k in ("miou", "right", "same")]
                                              for way, e in m["errors"].items()])
            text += f"\n{m['errors']['f32']['pictures']} pictures, spread evenly.\n\n"
            groups[name] = [(way, ms(times, way, scale), 100 - m["errors"][way]["miou"]) for way, scale in WAYS]
    made = charts.write_page(out, "bench-runner", charts.page("Networks: time against error", command, text))
    if groups:
        made += charts.chart(out, "time-error-networks", "Networks by precision",
                                   ("time, ms", "bad 2 px (matching), 100 - mean IoU (labels), %"), groups, command)
    return made


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--build", default="build", help="folder with the built programs (build)")
    parser.add_argument("--data", default="../shared/data/stereo-middlebury", help="Middlebury pairs (%(default)s)")
    parser.add_argument("--camvid", default="../shared/data/camvid", help="CamVid with val and valannot (%(default)s)")
    parser.add_argument("--rounds", type=int, default=15, help="of times (%(default)s)")
    parser.add_argument("--every", type=int, default=4, help="takes every so manieth picture of CamVid (%(default)s)")
    parser.add_argument("--keep", action="store_true", help="leave docs/ as it is; the page stays in BUILD/bench/docs")
    args = parser.parse_args()
    os.chdir(os.path.join(os.path.dirname(os.path.abspath(__file__)), ".."))
    os.environ.setdefault("OMP_WAIT_POLICY", "passive")  # waiting threads would count as CPU time
    out = f"{args.build}/bench"
    os.makedirs(f"{out}/docs", exist_ok=True)
    measured = {}
    for name in (MATCHING, *LABELS):
        model = f"models/{name}"
        if not os.path.exists(model):
            say(f"skipped: {name} is not in models/")
            continue
        errors = (matching_errors(args.build, model, args.data, out) if name == MATCHING else
                  label_errors(args.build, model, args.camvid, out, args.every))
        measured[name] = {"times": timed(args.build, model, args.rounds), "errors": errors}
    with open(f"{out}/runner.json", "w") as f:
        json.dump(measured, f, indent=1)
    for path in report(measured, f"{out}/docs", "make bench-networks"):
        if not args.keep:
            shutil.copy(path, "docs/measured")
        say(path)


if __name__ == "__main__":
    main()
