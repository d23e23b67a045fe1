#!/usr/bin/env bash
# sst calibrate: what the command line and a file of corners must be refused for, with the right exit code, one sentence
# and nothing left; the corners are made here, of a board before two pinhole cameras.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
. "$(dirname "${BASH_SOURCE[0]}")/../lib.sh"

cat >make.py <<'P'
import json, math, sys
frames, change = int(sys.argv[1]), sys.argv[2]
points = [(x * 25.0, y * 25.0) for y in range(1, 7) for x in range(1, 9)]
detections = []
for f in range(frames):
    tilt, turn = 0.5 * math.sin(2.1 * f), 0.5 * math.cos(1.3 * f)
    for view in range(2):
        corners = []
        for i, (x, y) in enumerate(points):
            u, v = x - 112.5, y - 87.5
            X = u * math.cos(turn) + v * math.sin(tilt) * math.sin(turn) + 120 * math.sin(1.7 * f) - 50 * view
            Y = v * math.cos(tilt) + 90 * math.cos(2.9 * f)
            Z = 600 + 150 * (f % 3) + v * math.sin(tilt) * math.cos(turn) - u * math.sin(turn)
            px, py = 319.5 + 500 * X / Z, 239.5 + 500 * Y / Z
            if 2 <= px <= 637 and 2 <= py <= 477:
                corners.append([i, px, py, 1.0])
        if corners:
            detections.append({"frame": f, "view": view, "corners": corners})
d = {"format": "sst-detections", "version": 1, "board": "charuco:9x7:25mm:0.7", "rows": 1, "cols": 2, "width": 640,
     "height": 480, "rig": False, "cameras": ["A", "B"], "frames": [str(f) for f in range(frames)],
     "detections": detections}
exec(change)
json.dump(d, open(sys.argv[3], "w"))
P
corners() { /usr/bin/python3 make.py "$1" "$2" corners.json || fail "make.py $2"; }

corners 12 ""
want 2 "does not combine with" calibrate corners.json --board charuco:9x7:25mm:0.7 -o bad.yaml
want 2 "does not combine with" calibrate corners.json --grid 1x2 -o bad.yaml
want 2 "does not combine with" calibrate corners.json --rig -o bad.yaml
want 2 "picture belongs" calibrate corners.json --picture bad.png -o bad.yaml
want 2 "exist already" calibrate --live --rig --board charuco:9x7:25mm:0.7 -o bad.yaml
want 2 "are both" calibrate corners.json -o bad.yaml --report bad.yaml
want 2 "it combines with" calibrate --check missing --force
want 2 "it combines with" calibrate --check missing -o bad.yaml
want 3 "missing does not exist" calibrate missing --board charuco:9x7:25mm:0.7 -o bad.yaml
# Before any picture is looked at, and before a camera is opened:
want 4 "nowhere/bad.yaml" calibrate missing --board charuco:9x7:25mm:0.7 -o nowhere/bad.yaml
want 4 "nowhere/bad.html" calibrate --live --board charuco:9x7:25mm:0.7 -o bad.yaml --report nowhere/bad.html
corners 12 "d['drive_mm'] = [[0, 0, 0], [1e300, 0, 0]]"
want 3 "drive_mm\[1\]" calibrate corners.json -o bad.yaml

"$sst" version --json | grep -q '"libdogleg": false' && { [ $failed -eq 0 ]; exit; }
corners 12 "d['width'] = 200"
want 3 "lie outside the 200x480 pictures" calibrate corners.json -o bad.yaml --report bad.html
corners 12 "d['detections'] = []"
want 3 "no frame shows the board" calibrate corners.json -o bad.yaml
# What is forced may fit well, and is not good for that: here a camera without the board.
corners 12 ""
"$sst" calibrate corners.json -o plain.yaml --json >plain.json 2>err || fail "plain: $(cat err)"
corners 12 "d['cameras'] += ['C']; d['cols'] = 3
for x in d['detections']: x['view'] *= 2"
"$sst" calibrate corners.json --force -o forced.yaml --json >forced.json 2>err || fail "forced: $(cat err)"
/usr/bin/python3 - <<'P' || fail "verdicts"
import json
plain, forced = (json.load(open(f)) for f in ("plain.json", "forced.json"))
bar = [next(b for b in j["bars"] if b["key"] == "overridden") for j in (plain, forced)]
assert bar[0]["value"] == 0 and bar[0]["state"] == "met easily", (bar[0], plain["verdict"])
assert bar[1]["value"] >= 1 and bar[1]["state"] == "missed" and forced["verdict"] != "good", (bar[1], forced["verdict"])
P
corners 12 "d['board'] = 'charuco:7x9:25mm:0.7'"
want 3 "did not converge" calibrate corners.json -o bad.yaml --report bad.html
[ $failed -eq 0 ]
