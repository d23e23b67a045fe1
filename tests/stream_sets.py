#!/usr/bin/python3
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
"""stream_sets.py SOCKET [FILE]: watches the service's main picture until SIGTERM, and prints as JSON how many pictures of sets came, which set numbers are missing between the first and the last, and the longest time without a new one. FILE gets a line
for each picture: seconds since the start, set."""
import json
import re
import signal
import socket
import sys
import time

path = sys.argv[1]
log = open(sys.argv[2], "w") if len(sys.argv) > 2 else None
ended = []
signal.signal(signal.SIGTERM, lambda *_: ended.append(True))
link = socket.socket(socket.AF_UNIX)
link.settimeout(0.5)
link.connect(path)
link.sendall(b"GET /stream HTTP/1.0\r\nHost: x\r\n\r\n")
start = time.monotonic()
seen = []  # (seconds, set)
data = b""
while not ended:
    try:
        more = link.recv(1 << 20)
    except socket.timeout:
        continue
    if not more:
        break
    data += more
    heads = list(re.finditer(rb"X-Sst-Set: (\d+)\r\n", data))
    for head in heads:
        number = int(head.group(1))
        if not seen or number != seen[-1][1]:
            seen.append((time.monotonic() - start, number))
            if log:
                print(f"{seen[-1][0]:.3f} {number}", file=log, flush=True)
    if heads:
        data = data[heads[-1].end():]
    data = data[-(1 << 20):]
lasted_s = time.monotonic() - start
if len(seen) < 2:
    sys.exit(f"{len(seen)} pictures in {lasted_s:.1f} s")
gaps = [(b[0] - a[0], a[1], b[1]) for a, b in zip(seen, seen[1:])]
missing = [n for _, a, b in gaps for n in range(a + 1, b)]
longest = max(gaps)
print(json.dumps({"seconds": round(lasted_s, 1), "pictures": len(seen), "first": seen[0][1], "last": seen[-1][1],
                  "missing": len(missing), "missing_sets": missing[:100], "most_in_a_row": max(b - a - 1 for _, a, b in gaps),
                  "longest_gap_s": round(longest[0], 3), "longest_gap_before_set": longest[2]}))
