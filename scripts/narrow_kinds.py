#!/usr/bin/python3
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
"""Which pixels of a narrow light field are off by more than 0.07 and 0.03 px, as JSON: narrow_kinds.py LF.

All views with a map in LF/truth count together. A pixel is of the first kind that fits: edge (within 3 px of a step of
the truth), untextured (luma varies little around it), slanted, rest.
"""
import glob
import json
import os
import sys

import numpy as np
from PIL import Image

STEP_PX = 0.25    # between neighbours: an edge of the truth
NEAR = 3          # px from it
VARIANCE = 2      # of the luma over 5x5 pixels, levels squared; less is untextured
SLOPE = 0.012     # px a pixel; more is slanted
LIMITS = {"bad007": 0.07, "bad003": 0.03}


def read_pfm(path):
    with open(path, "rb") as f:
        if f.readline().strip() != b"Pf":
            sys.exit(f"narrow_kinds: {path} is no PFM of one channel")
        width, height = map(int, f.readline().split())
        order = "<" if float(f.readline()) < 0 else ">"
        return np.frombuffer(f.read(), order + "f4").reshape(height, width)[::-1].astype(np.float64)


def spread(mask, reach):
    """Pixels within `reach` of the mask's, along both axes."""
    for axis in (0, 1):
        wide = mask.copy()
        for i in range(1, reach + 1):
            wide |= np.roll(mask, i, axis) & (np.arange(mask.shape[axis]) >= i).reshape((-1, 1) if axis == 0 else (1, -1))
            wide |= np.roll(mask, -i, axis) & (np.arange(mask.shape[axis]) < mask.shape[axis] - i).reshape(
                (-1, 1) if axis == 0 else (1, -1))
        mask = wide
    return mask


def mean5(values):
    """Means over 5x5 pixels, the border repeated."""
    padded = np.pad(values, 2, mode="edge")
    rows = sum(padded[i:i + values.shape[0]] for i in range(5))
    return sum(rows[:, i:i + values.shape[1]] for i in range(5)) / 25


def kinds_of(truth, luma):
    step = np.zeros(truth.shape, bool)
    across, down = (np.abs(np.diff(truth, axis=axis)) > STEP_PX for axis in (1, 0))
    step[:, 1:] |= across
    step[:, :-1] |= across
    step[1:] |= down
    step[:-1] |= down
    edge = spread(step, NEAR - 1)  # the step's own pixels are 1 px from it
    untextured = mean5(luma * luma) - mean5(luma) ** 2 < VARIANCE
    slope_y, slope_x = np.gradient(truth)
    slanted = np.hypot(slope_x, slope_y) >= SLOPE
    return {"edge": edge, "untextured": ~edge & untextured, "slanted": ~edge & ~untextured & slanted,
            "rest": ~edge & ~untextured & ~slanted}


def main():
    lf = sys.argv[1]
    with open(f"{lf}/lightfield.json") as f:
        lowest = json.load(f)["disp_min_px"]
    counts, pixels = {}, 0
    for path in sorted(glob.glob(f"{lf}/truth/*_*.pfm")):
        view = os.path.basename(path)[:-4]
        truth = read_pfm(path)
        stored = np.asarray(Image.open(f"{lf}/disparity/{view}.png")).astype(np.float64)
        off = np.where(stored == 65535, np.inf, np.abs(lowest + stored / 64 - truth))
        luma = np.asarray(Image.open(glob.glob(f"{lf}/views/{view}.*")[0]).convert("L")).astype(np.float64)
        pixels += truth.size
        for kind, mask in kinds_of(truth, luma).items():
            of = counts.setdefault(kind, dict.fromkeys(("pixels", *LIMITS), 0))
            of["pixels"] += int(mask.sum())
            for name, limit in LIMITS.items():
                of[name] += int((mask & (off > limit)).sum())
    print(json.dumps({kind: {name: 100 * n / pixels for name, n in of.items()} for kind, of in counts.items()}))


main()
