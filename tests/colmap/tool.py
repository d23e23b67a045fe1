#!/usr/bin/python3
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
"""Arrays with known depths for COLMAP, of ./scene, and the judgement of the points that it makes: tool.py make|judge EXPORT."""
import json
import os
import sys

import numpy as np
from PIL import Image

GRID = 3
SHIFT = 12  # px by which neighbouring views of the converging set are displaced
CROP = (440, 330)


def truth():
    """Depth in metres of each pixel of the reference view."""
    lf = json.load(open("scene/lightfield.json"))
    with open("scene/truth/01_01.pfm", "rb") as f:
        assert f.readline() == b"Pf\n"
        width, height = map(int, f.readline().split())
        order = "<" if float(f.readline()) < 0 else ">"
        d = np.flipud(np.frombuffer(f.read(), order + "f4").reshape(height, width))
    return lf["focal_px"], lf["spacing_mm"], lf["focal_px"] * lf["spacing_mm"] / 1000 / d


def write_calib(path, focal, spacing, lens):
    with open(path, "w") as o:
        o.write("format: sst-calib\nversion: 1\nrows: 3\ncols: 3\nwidth: 480\nheight: 360\nreference: [1, 1]\ncameras:\n")
        for row in range(GRID):
            for col in range(GRID):
                o.write("- { row: %d, col: %d, focal_px: [%r, %r], centre_px: [239.5, 179.5], distortion: %s, rotation: "
                        "[1, 0, 0, 0, 1, 0, 0, 0, 1], position_mm: [%r, %r, 0.0] }\n"
                        % (row, col, focal, focal, lens(col), (col - 1) * spacing, (row - 1) * spacing))


def make():
    focal, spacing, _ = truth()
    open("focal", "w").write(repr(focal))
    open("spacing", "w").write(repr(spacing))
    write_calib("plain.yaml", focal, spacing, lambda col: "[]")
    write_calib("mixed.yaml", focal, spacing, lambda col: "[1.0e-6, 0, 0, 0, 0]" if col == 2 else "[]")
    for folder in ("holed", "converging"):
        os.mkdir(folder)
    left, top = (480 - CROP[0]) // 2, (360 - CROP[1]) // 2
    for row in range(GRID):
        for col in range(GRID):
            view = Image.open("scene/views/%02d_%02d.png" % (row, col))
            if (row, col) not in ((0, 0), (2, 1)):
                view.save("holed/%02d_%02d.%s" % (row, col, "jpg" if col == 2 else "png"), quality=95)
            # a point with the disparity SHIFT stays where it is
            x, y = left - (col - 1) * SHIFT, top - (row - 1) * SHIFT
            view.crop((x, y, x + CROP[0], y + CROP[1])).save("converging/input_Cam%03d.png" % (row * GRID + col))
    open("converging/parameters.cfg", "w").write(
        "[intrinsics]\nfocal_length_mm = 100\nimage_resolution_x_px = %d\nimage_resolution_y_px = %d\nsensor_size_mm = %r\n"
        "[extrinsics]\nnum_cams_x = 3\nnum_cams_y = 3\nbaseline_mm = %r\nfocus_distance_m = %r\n"
        % (*CROP, 100 * CROP[0] / focal, spacing, focal * spacing / SHIFT / 1000))


def lines(path):
    return [line.rstrip("\n") for line in open(path) if not line.startswith("#")]


def judge(export):
    depth = truth()[2]
    offset = np.array([(480 - CROP[0]) // 2, (360 - CROP[1]) // 2]) if export == "hci" else np.zeros(2)
    points, errors = {}, []
    for line in lines(export + "/points/points3D.txt"):
        w = line.split()
        points[w[0]] = float(w[3])
        errors.append(float(w[7]))
    images = lines(export + "/points/images.txt")
    views = {line.split()[9] for line in images[::2]}
    wanted = {name for name in os.listdir(export + "/images")}
    off = []
    for head, seen in zip(images[::2], images[1::2]):
        if not head.split()[9].startswith("01_01."):
            continue
        w = seen.split()
        for x, y, point in zip(w[::3], w[1::3], w[2::3]):
            if point == "-1":
                continue
            at = np.floor([float(x), float(y)] + offset).astype(int)
            around = depth[max(at[1] - 2, 0):at[1] + 3, max(at[0] - 2, 0):at[0] + 3]  # features lie on edges
            off.append(np.abs(points[point] / around - 1).min())
    print("%s: %d views, %d points, %.3f px, depths of %d off by %.2f %% (median), %.2f %% (nine in ten)"
          % (export, len(views), len(points), np.mean(errors), len(off), 100 * np.median(off), 100 * np.quantile(off, 0.9)))
    if views != wanted or len(off) < 30 or np.mean(errors) > 0.6 or np.median(off) > 0.01 or np.quantile(off, 0.9) > 0.05:
        sys.exit("%s: not the views, or the depths, of the truth" % export)


make() if sys.argv[1] == "make" else judge(sys.argv[2])
