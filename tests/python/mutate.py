# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
"""Mutations of files that python3-sst reads: each is read, or refused with one sentence. mutate.py SECONDS [SEED]

In the current folder: bush.lf, flight.lf, calib.yaml, rec-parts, as tests/python/check.sh makes them.
"""
import os
import random
import shutil
import sys
import time
import zlib

import sst
from sst import jpeg_parts, pictures

seed = int(sys.argv[2]) if len(sys.argv) > 2 else int(time.time())
rnd = random.Random(seed)


def read(path):
    with open(path, "rb") as f:
        return f.read()


def mutated(data):
    data = bytearray(data)
    for _ in range(rnd.choice((1, 1, 2, 5))):
        kind, i = rnd.random(), rnd.randrange(len(data))
        if kind < 0.6:
            data[i] = rnd.randrange(256)
        elif kind < 0.8 and len(data) > 100:
            del data[i:i + rnd.randrange(1, 40)]
        else:
            data[i:i] = rnd.randbytes(rnd.randrange(1, 20))
    return bytes(data)


def with_checksums(data):
    """A PNG with the checksums that its chunks need, so that a mutation reaches their content."""
    out, at = data[:8], 8
    while at + 12 <= len(data) and at + 12 + (n := int.from_bytes(data[at:at + 4], "big")) <= len(data):
        out += data[at:at + 8 + n] + zlib.crc32(data[at + 4:at + 8 + n]).to_bytes(4, "big")
        at += 12 + n
    return out


def put(path, data):
    with open(path, "wb") as f:
        f.write(data)


def lightfield(data):
    put("mutated.lf/lightfield.json", data)
    lf = sst.open("mutated.lf")
    if isinstance(lf, sst.Posed):
        lf.image(0)
    else:
        lf.image8(lf.reference), lf.disparity(lf.reference), lf.label(lf.views[0])


def recording(name, data):
    for other in ("recording.json", "sets.jsonl"):
        put("mutated.rec/" + other, data if other == name else read("rec-parts/" + other))
    made = sst.Recording("mutated.rec")
    for i in range(len(made)):
        made.frames(i)


def calibration(data):
    put("mutated.yaml", data)
    sst.Calibration("mutated.yaml")


shutil.copytree("bush.lf", "mutated.lf")
shutil.copytree("rec-parts", "mutated.rec")
frame = sst.Recording("rec-parts").frame(3, 0)
png = read("bush.lf/views/00_00.png")
cases = [(png, lambda d: pictures.decode_png(with_checksums(d))), (png, pictures.decode_picture),
         (frame.data, lambda d: jpeg_parts.join(frame.base, d, "parts")), (frame.base, lambda d: jpeg_parts.join(d, frame.data, "parts")),
         (read("bush.lf/lightfield.json"), lightfield), (read("flight.lf/lightfield.json"), lightfield), (read("calib.yaml"), calibration),
         (read("rec-parts/sets.jsonl"), lambda d: recording("sets.jsonl", d)), (read("rec-parts/recording.json"), lambda d: recording("recording.json", d))]
n, end = 0, time.time() + float(sys.argv[1])
while time.time() < end:
    source, use = rnd.choice(cases)
    data = mutated(source)
    n += 1
    try:
        use(data)
    except (ValueError, OSError) as e:
        if "\n" in str(e) or not str(e):
            sys.exit(f"seed {seed}, mutation {n}: no sentence: {e!r}")
    except Exception:
        put("failed", data)
        print(f"seed {seed}, mutation {n}, in {os.path.abspath('failed')}:", file=sys.stderr)
        raise
print(f"{n} mutated files: read, or refused with a sentence")
