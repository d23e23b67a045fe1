#!/usr/bin/python3
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
"""Fill the rows of README's figures that scripts/bench.py measured: readme_figures.py BUILD/bench [README].

A row is known by how it begins; its cells become: best level, AVX2, what it is compared with. Rows whose part was not
measured stay as they are. A machine without a level above AVX2 has no figure of one.
"""
import json
import os
import statistics
import sys

from charts import BASELINE, median, read_rounds, word


def load(path):
    with open(path) as f:
        return json.load(f)


def per_level(levels, text):
    """Cells of the best level and of AVX2, by text(level)."""
    return [text(level) for level in levels]


def pictures(path):
    found = [s["presets"]["balanced"] for s in load(path)]

    def mean(*keys):
        return statistics.mean(r[keys[0]][keys[1]] for r in found)
    return [f"{mean('clear', 'psnr'):.1f} dB; {mean('render', 'psnr_occluded'):.1f} dB", "–",
            f"{mean('refocus', 'psnr'):.1f} dB; {mean('refocus', 'psnr_occluded'):.1f} dB, plain refocusing"]


def whole(path):
    bush = next(s for s in load(path) if s["scene"] == "bush")
    of = bush["presets"]["balanced"]["levels"]
    others = next((o for o in bush["opencv"] if o["method"] == BASELINE), None)
    compared = f"{others['cpu_ms'] / 1000:.1f} s, {BASELINE} of 36 pairs, disparities alone" if others else "–"
    return per_level(list(of), lambda level: f"{of[level]['cpu_seconds']['total']:.1f} s") + [compared]


def stereo(path):
    measured = read_rounds(path, "pair", "method", "level")
    levels = list(dict.fromkeys(k[2] for k in measured))

    def figures(method, level):
        rounds = measured["cones", method, level]
        return f"{rounds[0]['bad2']:.1f} %; {median(rounds, 'ms'):.0f} ms"
    return per_level(levels, lambda level: figures("sst balanced", level)) + [f"{figures(BASELINE, levels[0])}, {BASELINE}"]


def render(path):
    measured = read_rounds(path, "level", "width", "method")
    levels, width = list(dict.fromkeys(k[0] for k in measured)), next(iter(measured))[1]

    def figures(level, prefix=""):
        return "; ".join(f"{median(measured[level, width, prefix + m], 'ms'):.0f} ms" for m in ("see-through", "refocus"))
    return per_level(levels, figures) + [f"{figures(levels[0], 'OpenCV ')}, OpenCV"]


def density(path):
    first, last = (load(path)[i]["report"]["levels"] for i in (0, -1))
    return per_level(list(first), lambda level: f"{last[level]['cpu_seconds']['total'] / first[level]['cpu_seconds']['total']:.2f}") + ["–"]


def narrow(path):
    report = next((m["report"] for m in load(path) if m["scene"] == "backgammon"), None)
    if not report:
        return None
    return per_level(list(report["levels"]), lambda level: f"{report['disparity']['bad007']:.1f} %; "
                     f"{report['levels'][level]['cpu_seconds']['total']:.1f} s") + ["–"]


ROWS = {"7 simulated scenes": ("scenes.json", pictures), "bush, 36 views": ("scenes.json", whole),
        "stereo, Middlebury cones": ("stereo.csv", stereo), "picture from 36 views": ("render.csv", render),
        "foliage over 80 %": ("density.json", density), "HCI's backgammon": ("narrow.json", narrow)}


def main():
    folder, readme = sys.argv[1], sys.argv[2] if len(sys.argv) > 2 else "README.md"
    levels = load(f"{folder}/bench.json")["levels"]
    with open(readme, encoding="utf8") as f:
        lines = f.read().split("\n")
    for i, line in enumerate(lines):
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        if not line.startswith("|") or len(cells) != 5:
            continue
        if cells[1].startswith("sst, ") and len(levels) > 1:
            lines[i] = f"| | sst, {word(levels[0])} | sst, {word(levels[1])} | compared with | |"
        for start, (name, figures) in ROWS.items():
            if cells[0].startswith(start) and os.path.exists(f"{folder}/{name}"):
                found = figures(f"{folder}/{name}") or cells[1:4]
                cells[1:4] = found if len(levels) > 1 else ["–", found[0], found[-1]]
                lines[i] = f"| {' | '.join(cells)} |"
    with open(readme + ".part", "w", encoding="utf8") as f:
        f.write("\n".join(lines))
    os.replace(readme + ".part", readme)


main()
