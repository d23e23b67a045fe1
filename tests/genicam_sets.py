#!/usr/bin/env python3
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
"""Sets of a recording of fake GenICam cameras: whether frames of other triggers are in them, by the cameras' own word.

Pixel (0, 0) of a frame is its number modulo 255, and each camera logs when it exposes a number. A set is mixed if two of its frames
were exposed further apart than cameras of one trigger can be: half a period, where they run on their own. Prints one JSON object; exits with 1 if a set is mixed.

usage: genicam_sets.py RECORDING LIMIT_S CAMERA=LOG..."""
import datetime
import json
import re
import sys
from pathlib import Path


def exposures(path, day):
    """Times (s of the day's epoch) of the exposures of each number modulo 255."""
    found = {}
    for line in open(path, encoding="utf8", errors="replace"):
        m = re.search(r"\[(\d+):(\d+):(\d+)\.(\d+)\].* Send frame (\d+)", line)
        if m:
            h, minute, s, ms, number = map(int, m.groups())
            found.setdefault(number % 255, []).append(day + h * 3600 + minute * 60 + s + ms / 1000)
    return found


folder, limit = Path(sys.argv[1]), float(sys.argv[2])
files = sorted((folder / "segments").iterdir())
lines = [json.loads(line) for line in (folder / "sets.jsonl").read_text().splitlines()]
sets = [s for s in lines if "set" in s]
start = datetime.datetime.fromtimestamp(sets[0]["wall_ns"] / 1e9)
day = datetime.datetime(start.year, start.month, start.day).timestamp()
logs = {int(a.split("=")[0]): exposures(a.split("=")[1], day) for a in sys.argv[3:]}
mixed, frames, unknown, worst, segment = [], 0, 0, 0.0, 0
for s in lines:
    if "set" not in s:
        segment = s["segment"]
        continue
    times = []
    for f in s["frames"]:
        if f[0] not in logs:
            continue
        with open(files[segment], "rb") as file:
            file.seek(f[5])
            number = file.read(1)[0]
        frames += 1
        near = [t for t in logs[f[0]].get(number, []) if abs(t - s["wall_ns"] / 1e9) < 10]
        if not near:
            unknown += 1
            continue
        times.append(min(near, key=lambda t: abs(t - s["wall_ns"] / 1e9)))
    if times:
        worst = max(worst, max(times) - min(times))
        if max(times) - min(times) > limit:
            mixed.append(s["set"])
print(json.dumps({"sets": len(sets), "complete": sum(not s["missing"] for s in sets), "frames": frames, "mixed": mixed,
                  "unknown": unknown, "farthest_ms": round(1000 * worst)}))
sys.exit(bool(mixed or unknown))
