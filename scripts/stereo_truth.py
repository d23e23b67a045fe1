#!/usr/bin/env python3
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
"""Convert the truth of the Middlebury pairs to PFM (px, inf unknown): stereo_truth.py DATA OUT."""
import os
import sys

import numpy as np
from PIL import Image


def write_pfm(path, disp):
    with open(path, "wb") as f:
        f.write(b"Pf\n%d %d\n-1.0\n" % (disp.shape[1], disp.shape[0]))
        f.write(disp[::-1].astype("<f4").tobytes())


def main():
    data, out = sys.argv[1:3]
    os.makedirs(out, exist_ok=True)
    for name in ("cones", "teddy"):
        disp = np.asarray(Image.open(f"{data}/{name}/disp2.png").convert("L")).astype(np.float32) / 4
        disp[disp == 0] = np.inf
        write_pfm(f"{out}/{name}.pfm", disp)
    disp = np.asarray(Image.open(f"{data}/aloe/aloeGT.png").convert("L")).astype(np.float32)
    write_pfm(f"{out}/aloe.pfm", np.where(disp == 0, np.inf, disp))
    disp = np.load(f"{data}/motorcycle/motorcycle_disp.npz")
    write_pfm(f"{out}/motorcycle.pfm", np.where(np.isfinite(disp["arr_0"]), disp["arr_0"], np.inf))


main()
