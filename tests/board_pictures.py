#!/usr/bin/python3
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
"""Compare detections of a chessboard with OpenCV's, and calibrations from both: board_pictures.py FILE FOLDER."""
import json
import sys

try:
    import cv2
    import numpy as np
except ImportError:
    print("no OpenCV for Python (python3-opencv): not compared")
    sys.exit(77)

CRITERIA = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 50, 0.001)


def opencv_corners(path):
    image = cv2.imread(path, cv2.IMREAD_GRAYSCALE)
    found, corners = cv2.findChessboardCorners(image, (9, 6))
    return cv2.cornerSubPix(image, corners, (5, 5), (-1, -1), CRITERIA)[:, 0] if found else None


def rms(points, corners):
    return cv2.calibrateCamera(points, corners, (640, 480), None, None)[0]


def main(file, folder):
    with open(file, encoding="utf-8") as f:
        data = json.load(f)
    bad = False
    for view, name in enumerate(data["cameras"]):
        ours, theirs, points, off = [], [], [], []
        for d in data["detections"]:
            if d["view"] != view:
                continue
            mine = np.array([c[1:3] for c in d["corners"]])
            ids = np.array([c[0] for c in d["corners"]])
            other = opencv_corners(f"{folder}/{name}{data['frames'][d['frame']]}.jpg")
            if other is None:
                continue
            distance = np.linalg.norm(mine[:, None] - other[None], axis=2)
            off.append(distance.min(1))
            ours.append(mine.astype(np.float32))
            theirs.append(other[distance.argmin(1)].astype(np.float32))
            points.append(np.stack([ids % 9 * 25, ids // 9 * 25, 0 * ids], 1).astype(np.float32))
        off = np.concatenate(off)
        a, b = rms(points, ours), rms(points, theirs)
        print(f"{name}: {len(ours)} pictures, median distance from OpenCV's corners {np.median(off):.3f} px, "
              f"largest {off.max():.3f}; RMS of a calibration {a:.4f} px, with OpenCV's corners {b:.4f}")
        bad |= len(ours) != 13 or np.median(off) > 0.3 or off.max() > 1.5 or a > min(b, 0.3926)
    return bad


if __name__ == "__main__":
    sys.exit(int(main(*sys.argv[1:])))
