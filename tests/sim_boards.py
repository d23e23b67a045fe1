#!/usr/bin/python3
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
"""Look with OpenCV for the boards in frames of simulated worlds, and compare with the truth: sim_boards.py FOLDER."""
import json
import sys

import cv2
import numpy as np

POSES = 2
KINDS = ["chessboard", "charuco", "aprilgrid"]


def expected(truth, cam, pose, points):
    """Where the truth puts points of a board, [n][2] mm from its centre, in a camera's picture."""
    c, p = truth["cameras"][cam], truth["board"]["poses"][pose]
    board, rotation = np.array(p["rotation"]), np.array(c["rotation"])
    world = points @ board[:, :2].T + p["position_mm"]
    translation = -rotation @ np.array(c["position_mm"])
    seen, _ = cv2.projectPoints(world, cv2.Rodrigues(rotation)[0], translation, np.array(c["K"]),
                                np.array(c["distortion"]))
    return seen[:, 0]


def refine(image, corners):
    criteria = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 50, 0.001)
    return cv2.cornerSubPix(image, corners, (5, 5), (-1, -1), criteria)[:, 0]


def find_chessboard(image, board):
    cols, rows = board["squares"]
    ok, corners = cv2.findChessboardCorners(image, (cols - 1, rows - 1))
    if not ok:
        return None, None
    corners = refine(image, corners)
    x, y = np.meshgrid(np.arange(1, cols) - cols / 2, np.arange(1, rows) - rows / 2)
    return np.stack([x.ravel(), y.ravel()], 1) * board["square_mm"], corners


def find_charuco(image, board):
    cols, rows = board["squares"]
    markers = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
    if hasattr(cv2.aruco, "CharucoDetector"):
        pattern = cv2.aruco.CharucoBoard((cols, rows), 1, board["marker"], markers)
        corners, ids, _, _ = cv2.aruco.CharucoDetector(pattern).detectBoard(image)
    else:
        pattern = cv2.aruco.CharucoBoard_create(cols, rows, 1, board["marker"], markers)
        seen, marker_ids, _ = cv2.aruco.detectMarkers(image, markers)
        _, corners, ids = cv2.aruco.interpolateCornersCharuco(seen, marker_ids, image, pattern)
    if ids is None:
        return None, None
    ids = ids.ravel()  # some versions of OpenCV have these corners half a pixel off, hence refine() below
    x, y = ids % (cols - 1) + 1 - cols / 2, ids // (cols - 1) + 1 - rows / 2
    return np.stack([x, y], 1) * board["square_mm"], refine(image, corners)


def find_aprilgrid(image, board):
    cols, rows = board["squares"]
    pitch, gap = 1 + board["marker"], board["marker"]
    tags = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    new = hasattr(cv2.aruco, "ArucoDetector")
    parameters = cv2.aruco.DetectorParameters() if new else cv2.aruco.DetectorParameters_create()
    parameters.markerBorderBits = 2
    parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    if new:
        seen, ids, _ = cv2.aruco.ArucoDetector(tags, parameters).detectMarkers(image)
    else:
        seen, ids, _ = cv2.aruco.detectMarkers(image, tags, parameters=parameters)
    if ids is None:
        return None, None
    points, corners = [], []
    for tag, four in zip(ids.ravel(), seen):
        for (u, v), corner in zip(((0, 0), (1, 0), (1, 1), (0, 1)), four[0]):
            points.append([gap + tag % cols * pitch + u, gap + tag // cols * pitch + v])
            corners.append(corner)
    middle = np.array([cols * pitch + gap, rows * pitch + gap]) / 2
    return (np.array(points) - middle) * board["square_mm"], np.array(corners)


def main(folder):
    bad = False
    for kind, name in enumerate(KINDS):
        with open(f"{folder}/{kind}.json", encoding="utf-8") as file:
            truth = json.load(file)
        cols, rows = truth["board"]["squares"]
        whole = 4 * cols * rows if name == "aprilgrid" else (cols - 1) * (rows - 1)
        errors, read = [], 0
        for k in range(POSES):
            image = cv2.imread(f"{folder}/{kind}-{k}.jpg", cv2.IMREAD_GRAYSCALE)
            points, corners = globals()["find_" + name](image, truth["board"])
            if points is None:
                continue
            read += len(points) / whole
            errors.append(np.linalg.norm(corners - expected(truth, 0, k, points), axis=1))
        mean = np.concatenate(errors).mean() if errors else np.inf
        print(f"{name}: {read / POSES:.0%} of the corners, on average {mean:.3f} px off")
        # The corners of tags are found less exactly than those where squares meet.
        bad |= read < 0.6 * POSES or mean > (0.3 if name == "aprilgrid" else 0.1)
    return bool(bad)


if __name__ == "__main__":
    sys.exit(int(main(sys.argv[1])))
