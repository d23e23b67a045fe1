#!/usr/bin/python3
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
"""Measure detection behind simulated foliage and renew docs/measured/bench-watch.md and its chart: bench_watch.py.

Runs build/bench/watch on worlds of simulators/scene/hedge.h: cover, wind, light and distance vary. Each world is one process; its
figures stay in BUILD/bench-watch/, and a world that has them is not run again (--fresh: all are).
"""
import argparse
import concurrent.futures
import itertools
import json
import os
import shutil
import subprocess
import sys

import charts
from bench import say

COVERS, WINDS = (0.5, 0.65, 0.8), (0.5, 1.0)
LIGHTS = {"day": {"light": 1, "noise": 2}, "night": {"light": 0.3, "noise": 4}}
DISTANCES = {"near": {"disp": 3.5, "height": 60}, "far": {"disp": 2.2, "height": 42}}
WORLD = {"rate": 0.5, "width": 160, "views": 5, "near": 8, "spread": 2, "wall": 1}
METHODS = {"array": "all cameras, differences first", "camera": "one camera", "refocus": "plain refocusing"}
THRESHOLDS = [0.5 * 1.25 ** i for i in range(25)]


def worlds(hours):
    seed = 100
    for cover, wind, light, distance in itertools.product(COVERS, WINDS, LIGHTS, DISTANCES):
        seed += 1
        yield (f"{cover:g}-{wind:g}-{light}-{distance}",
               {**WORLD, "hours": hours, "seed": seed, "cover": cover, "wind": wind, **LIGHTS[light],
                **DISTANCES[distance]})


def run(build, name, settings):
    path = f"{build}/bench-watch/{name}.json"
    if not os.path.exists(path):
        say(name)
        command = [f"{build}/bench/watch"] + [str(x) for item in settings.items() for x in item]
        done = subprocess.run(command, text=True, stdout=subprocess.PIPE, check=False)
        if done.returncode:
            sys.exit(f"bench: {' '.join(command)} failed")
        with open(f"{path}.new", "w") as f:
            f.write(done.stdout)
        os.rename(f"{path}.new", path)
    with open(path) as f:
        return json.load(f)


# --- figures --------------------------------------------------------------------------------------------------------

def pooled(some, method):
    """Recall and alarms an hour of several worlds together."""
    passes, hours = sum(w["passes"] for w in some), sum(w["empty_hours"] for w in some)
    found = sum(w["methods"][method]["found"] for w in some)
    alarms = sum(w["methods"][method]["alarms"] for w in some)
    return found, passes, alarms, hours


def measured(some, method):
    return all(method in w["methods"] for w in some)


def cells(some):
    out = []
    for method in METHODS:
        if not measured(some, method):
            out.append("not measured | ")
            continue
        found, passes, alarms, hours = pooled(some, method)
        out.append(f"{found / max(passes, 1):.2f} ({found}) | {alarms / max(hours, 1e-9):.1f} ({alarms})")
    return " | ".join(out)


def best_recall(some, method, alarms_per_hour):
    """Of all thresholds with at most that many alarms."""
    passes, hours = sum(w["passes"] for w in some), sum(w["empty_hours"] for w in some)
    best = 0
    for i in range(len(THRESHOLDS)):
        if sum(w["methods"][method]["alarms_at"][i] for w in some) <= alarms_per_hour * hours:
            best = max(best, sum(w["methods"][method]["found_at"][i] for w in some) / max(passes, 1))
    return best


def chart(out, some):
    lines = ["set xlabel 'false alarms an hour'", "set ylabel 'recall'", "set yrange [0:1.02]", "set logscale x",
             "set xrange [0.03:100]", "set grid", "set key bottom right",
             "set title 'Persons behind a hedge in the wind: all worlds'",
             "set arrow from 1,0 to 1,1.02 nohead lc rgb '#aaaaaa' dt 2"]
    passes, hours = sum(w["passes"] for w in some), sum(w["empty_hours"] for w in some)
    plots = []
    for i, (method, text) in enumerate(METHODS.items()):
        if not measured(some, method):
            continue
        lines.append(f"$m{i} << EOD")
        for k in range(len(THRESHOLDS)):
            alarms = sum(w["methods"][method]["alarms_at"][k] for w in some) / hours
            found = sum(w["methods"][method]["found_at"][k] for w in some) / passes
            lines.append(f"{max(alarms, 0.03)} {found}")
        lines.append("EOD")
        plots.append(f"$m{i} with linespoints lw 2 pt {5 + 2 * i} ps 0.7 lc rgb '{charts.COLOURS[i]}' "
                     f"title '{text}'")
    return charts.draw(out, "watch-recall", lines + ["plot " + ", ".join(plots)])


TEXT = """\
# Persons behind foliage

`make bench-watch` measures the detection of `pipeline/live/hidden/` ([how](../design/live.md#behind-the-foreground)) on simulated
hedges (`simulators/scene/hedge.h`) and writes this page. {worlds} worlds, {hours:.1f} simulated hours, of which {empty:.1f} without anybody, {passes} persons.

Each world: 5x5 cameras of 160x120 px, one set every 2 s of the scene's time, computed as fast as it goes; leaves
of about 4 px at disparities of 6 to 8 px per spacing, a wall at 1 px. Every leaf swings with its twig and by itself; gusts
come and go (wind 0.5: twigs go to and fro by 0.1 to 1 px, 1: twice as far). Night: 0.3 of the light and noise of 4 levels, day: 2 levels.
Persons of random colours walk by in 24 s or stand for 40 s, 60 px tall at 3.5 px (near) or 42 px at 2.2 px (far). The service gets pictures of 16 times as many pixels, from
36 cameras, twice a second.

**One camera** is the same detection with the reference view alone, **plain refocusing** the same with the mean of all pictures, focused on the
plane on which the person is (which it is told). A person counts as found if a report is made while it is there, within a quarter of the
picture's width. An alarm is any other report.

Worlds that are not in the table at the end were not measured for this page.

## As the service reports

`hidden_alarms_per_hour: 1`, with the threshold that each learns in the hour. Recall (number found) and false alarms an hour (number):

| leaves cover | persons | all cameras: recall | alarms/h | one camera: recall | alarms/h | refocusing: recall | alarms/h |
|---|---|---|---|---|---|---|---|
{covers}

| | persons | all cameras: recall | alarms/h | one camera: recall | alarms/h | refocusing: recall | alarms/h |
|---|---|---|---|---|---|---|---|
{splits}

## At one fixed threshold for all worlds

The largest recall of any threshold with at most 1 false alarm an hour: {best}.

![recall against false alarms an hour](watch-recall.svg)

## Each world

Seen: part of a person that the reference camera sees, mean. Times to the report are those of persons that were found.

| cover | wind | light | distance | seen | persons | all cameras: recall | alarms/h | one camera: recall | alarms/h | refocusing: recall | alarms/h | s to report |
|---|---|---|---|---|---|---|---|---|---|---|---|---|
{rows}

Processor time of a set, all of it changed, {cost}.
"""


def write(out, figures, cost):
    some = list(figures.values())

    def line(name, those):
        return f"| {name} | {sum(w['passes'] for w in those)} | {cells(those)} |"

    def where(part, at):
        return [w for name, w in figures.items() if name.split("-")[at] == part]

    covers = [line(f"{float(c) * 100:.0f} %", where(f"{c:g}", 0)) for c in COVERS if where(f"{c:g}", 0)]
    splits = [line(f"wind {w:g}", where(f"{w:g}", 1)) for w in WINDS if where(f"{w:g}", 1)]
    splits += [line(n, where(n, 2)) for n in LIGHTS if where(n, 2)] + [line(n, where(n, 3)) for n in DISTANCES if where(n, 3)]
    rows = []
    for name, w in sorted(figures.items()):
        cover, wind, light, distance = name.split("-")
        rows.append(f"| {float(cover) * 100:.0f} % | {wind} | {light} | {distance} | {w['visible']:.2f} | {w['passes']} | "
                    f"{cells([w])} | {w['methods']['array']['delay_s']:.0f} |")
    best = ", ".join(f"{text} {best_recall(some, m, 1):.2f}" for m, text in METHODS.items() if measured(some, m))
    text = TEXT.format(worlds=len(some), hours=sum(w["hours"] for w in some), passes=sum(w["passes"] for w in some),
                       empty=sum(w["empty_hours"] for w in some), covers="\n".join(covers + [line("all", some)]),
                       splits="\n".join(splits), rows="\n".join(rows), best=best, cost=cost)
    return chart(out, some) + charts.write_page(out, "bench-watch", text)


def main():
    p = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    p.add_argument("--build", default="build")
    p.add_argument("--out", default="docs/measured")
    p.add_argument("--hours", type=float, default=1)
    p.add_argument("--jobs", type=int, default=os.cpu_count())
    p.add_argument("--fresh", action="store_true", help="measure all worlds again")
    p.add_argument("--measured", action="store_true", help="only worlds that have been measured")
    a = p.parse_args()
    if a.fresh:
        shutil.rmtree(f"{a.build}/bench-watch", ignore_errors=True)
    os.makedirs(f"{a.build}/bench-watch", exist_ok=True)
    todo = {name: s for name, s in worlds(a.hours)
            if not a.measured or os.path.exists(f"{a.build}/bench-watch/{name}.json")}
    with concurrent.futures.ThreadPoolExecutor(a.jobs) as pool:
        jobs = {name: pool.submit(run, a.build, name, s) for name, s in todo.items()}
        figures = {name: job.result() for name, job in jobs.items()}
    large = {"rate": 1, "hours": 0.012, "width": 640, "views": 6, "near": 28, "spread": 6, "wall": 4, "disp": 12,
             "height": 220, "seed": 1}
    ms = run(a.build, "cost", large)["methods"]["array"]["ms"]
    for path in write(a.out, figures, f"36 cameras of 640x480: {ms:.0f} ms"):
        say(path)


if __name__ == "__main__":
    main()
