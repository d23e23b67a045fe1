# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
"""dng.py FILE LEVEL R G B [no-neutral]: a DNG of 64x64 Bayer samples of 12 bits (WhiteLevel 4095), all LEVEL but for a patch of these
colours in its upper left quarter; with AsShotNeutral 1 1 1, or without."""
import struct
import sys

path, level, patch = sys.argv[1], int(sys.argv[2]), [int(v) for v in sys.argv[3:6]]
xyz_to_srgb = [32405, -15371, -4985, -9693, 18760, 416, 556, -2040, 10572]
tags = [(254, 4, 1, 0), (256, 4, 1, 64), (257, 4, 1, 64), (258, 3, 1, 16), (259, 3, 1, 1), (262, 3, 1, 32803),
        (271, 2, 4, 0x656e6f), (272, 2, 4, 0x656e6f), (273, 4, 1, None), (274, 3, 1, 1), (277, 3, 1, 1), (278, 4, 1, 64),
        (279, 4, 1, 2 * 64 * 64), (284, 3, 1, 1), (33421, 3, 2, 0x20002), (33422, 1, 4, 0x2010100), (50706, 1, 4, 0x401),
        (50717, 4, 1, 4095), (50721, 10, 9, None), (50728, 5, 3, None), (50778, 3, 1, 21)]
if "no-neutral" in sys.argv:
    tags = [t for t in tags if t[0] != 50728]
matrix = 8 + 2 + 12 * len(tags) + 4
place = {50721: matrix, 50728: matrix + 72, 273: matrix + 72 + 24}
out = b"II*\0" + struct.pack("<IH", 8, len(tags))
out += b"".join(struct.pack("<HHII", t, kind, n, place.get(t, value)) for t, kind, n, value in tags) + bytes(4)
out += b"".join(struct.pack("<iI", v, 10000) for v in xyz_to_srgb) + struct.pack("<6I", *[1] * 6)
for y in range(64):
    out += b"".join(struct.pack("<H", patch[x % 2 + y % 2] if x < 32 and y < 32 else level) for x in range(64))
open(path, "wb").write(out)
