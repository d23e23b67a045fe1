#!/usr/bin/python3
"""Measure calibration against known truth and renew docs/bench-calibration.md and its charts: bench_calib.py.

Corners are made up (tests/calib_truth.h): 6x6 cameras of 2000x1500 px, 100 frames of a board with 150 points, 0.1 px of
noise, unless a table says otherwise. Raw figures go to BUILD/bench/calib.json. The comparison with OpenCV needs its
Python module and real chessboards (--data); what is missing is named and left out.
"""
import argparse
import glob
import json
import os
import shutil
import statistics
import subprocess
import sys

import bench_report
from bench import say

FRAMES = (10, 20, 40, 70, 100)
LENS_NAMES = {5: "5 coefficients", 8: "8 coefficients"}
CHESSBOARD = (9, 6, 25.0)  # inner corners, mm


def solve(build, **settings):
    """Figures of one solution by build/bench/calib, or {"error": ..., "said": ...} where it refuses."""
    command = [f"{build}/bench/calib"] + [f"{k}={v}" for k, v in settings.items()]
    done = subprocess.run(command, text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE, check=False)
    if done.returncode > 1 or not done.stdout:
        sys.exit(f"bench: {' '.join(command)}: {done.stderr}")
    return {**json.loads(done.stdout), "said": done.stderr.strip()}


# --- comparison with OpenCV -----------------------------------------------------------------------------------------

def corners_of(images, cv2):
    cols, rows, _ = CHESSBOARD
    found = {}
    for path in images:
        grey = cv2.imread(path, cv2.IMREAD_GRAYSCALE)
        ok, at = cv2.findChessboardCorners(grey, (cols, rows))
        if ok:
            stop = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 50, 1e-4)
            found[os.path.basename(path)[-6:-4]] = cv2.cornerSubPix(grey, at, (5, 5), (-1, -1), stop)
    return found, grey.shape[::-1]


def written(path, found, size):
    """Corners as `sst calibrate --corners` reads them (docs/formats.md)."""
    names = sorted(set(found[0]) | set(found[1]))
    cols, rows, side = CHESSBOARD
    detections = [{"frame": i, "view": v, "id": list(range(cols * rows)),
                   "x": [float(p[0][0]) for p in found[v][n]], "y": [float(p[0][1]) for p in found[v][n]]}
                  for i, n in enumerate(names) for v in (0, 1) if n in found[v]]
    with open(path, "w") as f:
        json.dump({"format": "sst-corners", "version": 1, "board": f"chessboard:{cols}x{rows}c:{side:g}mm", "rows": 1,
                   "cols": 2, "width": size[0], "height": size[1], "cameras": ["left", "right"], "frames": names,
                   "detections": detections}, f)


def opencv_pair(found, size, cv2, numpy):
    """Everything free, five coefficients: what `sst` solves too, but for the board's warp. Returns RMS per point."""
    cols, rows, side = CHESSBOARD
    board = numpy.zeros((cols * rows, 3), numpy.float32)
    board[:, :2] = numpy.mgrid[:cols, :rows].T.reshape(-1, 2) * side
    names = sorted(set(found[0]) & set(found[1]))
    single = [cv2.calibrateCamera([board] * len(f), list(f.values()), size, None, None) for f in found]
    pair = cv2.stereoCalibrate([board] * len(names), [found[0][n] for n in names], [found[1][n] for n in names],
                               single[0][1], single[0][2], single[1][1], single[1][2], size,
                               flags=cv2.CALIB_USE_INTRINSIC_GUESS,
                               criteria=(cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 300, 1e-9))
    return {"pairs": len(names), "left": single[0][0], "right": single[1][0], "rms_px": pair[0],
            "baseline_mm": float(numpy.linalg.norm(pair[6])), "focal_px": float(pair[1][0, 0])}
