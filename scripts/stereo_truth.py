#!/usr/bin/env python3
"""Convert the truth of the Middlebury pairs to PFM (px, inf unknown): stereo_truth.py DATA OUT."""
import os
import struct
import sys
import zlib

import numpy as np


def read_grey_png(path):
    """8-bit grey or RGB PNG to an array of its first channel; enough for the truth files."""
    data = open(path, "rb").read()
    pos, idat, channels = 8, b"", 1
    while pos < len(data):
        (size,), kind = struct.unpack(">I", data[pos:pos + 4]), data[pos + 4:pos + 8]
        body = data[pos + 8:pos + 8 + size]
        if kind == b"IHDR":
            width, height, depth, colour = struct.unpack(">IIBB", body[:10])
            channels = {0: 1, 2: 3, 3: 1, 4: 2, 6: 4}[colour]
            assert depth == 8, path
        elif kind == b"IDAT":
            idat += body
        pos += 12 + size
    raw = np.frombuffer(zlib.decompress(idat), np.uint8).reshape(height, 1 + width * channels)
    out = np.zeros((height, width * channels), np.uint8)
    above = np.zeros(width * channels, np.int32)
    for y in range(height):
        line, kind = raw[y, 1:].astype(np.int32), raw[y, 0]
        if kind == 2:
            line = (line + above) & 255
        elif kind != 0:
            for x in range(width * channels):
                a = line[x - channels] if x >= channels else 0
                b, c = above[x], above[x - channels] if x >= channels else 0
                if kind == 1:
                    add = a
                elif kind == 3:
                    add = (a + b) // 2
                else:
                    p = a + b - c
                    add = min((abs(p - a), 0, a), (abs(p - b), 1, b), (abs(p - c), 2, c))[2]
                line[x] = (line[x] + add) & 255
        out[y], above = line, line
    return out.reshape(height, width, channels)[:, :, 0]


def write_pfm(path, disp):
    with open(path, "wb") as f:
        f.write(b"Pf\n%d %d\n-1.0\n" % (disp.shape[1], disp.shape[0]))
        f.write(disp[::-1].astype("<f4").tobytes())


def main():
    data, out = sys.argv[1:3]
    os.makedirs(out, exist_ok=True)
    for name in ("cones", "teddy"):
        disp = read_grey_png(f"{data}/{name}/disp2.png").astype(np.float32) / 4
        disp[disp == 0] = np.inf
        write_pfm(f"{out}/{name}.pfm", disp)
    disp = np.load(f"{data}/motorcycle/motorcycle_disp.npz")
    write_pfm(f"{out}/motorcycle.pfm", np.where(np.isfinite(disp["arr_0"]), disp["arr_0"], np.inf))


main()
