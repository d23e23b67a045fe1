#!/usr/bin/env bash
# What sst calibrate refuses of its sources before a picture is looked at: grids that the source or the configuration
# contradicts would lead beyond what they hold.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
. "$(dirname "${BASH_SOURCE[0]}")/../lib.sh"

"$sst" scene cat --size 64x48 --grid 2x3 -o rig >out 2>err || fail "scene: $(cat err)"
: >rig/capture.jsonl # as captures of a rig have it: the drives' positions are by its views
want 3 "leave --grid out" calibrate rig --grid 3x3 --board chessboard:10x7:25mm -o bad.yaml
want 3 "is not a folder" calibrate out --board chessboard:10x7:25mm -o bad.yaml
mkdir unnamed && cp "$(find rig/views -type f | sort | head -n 1)" unnamed/left01.png
want 3 "do not fill a grid of 2x2" calibrate unnamed --grid 2x2 --board chessboard:10x7:25mm -o bad.yaml
for name in 0_3 0_12; do mkdir -p serial/$name && cp unnamed/left01.png serial/$name; done
want 3 "outside of a grid of 1x2; correct --grid, or add --plain-names" calibrate serial --grid 1x2 --board chessboard:10x7:25mm -o bad.yaml
want 3 "do not fill a grid of 1x3" calibrate serial --grid 1x3 --plain-names --board chessboard:10x7:25mm -o bad.yaml
printf 'array: { rows: 2, cols: 2 }\ncameras: { bind: [ { row: 1, col: 1, port: "1-1" } ] }\n' >array.yaml
want 2 "does not fit the configuration" calibrate --live --config array.yaml --grid 1x2 --board chessboard:10x7:25mm -o bad.yaml
echo "array: { rows: 2 }" >empty.yaml
want 2 "more than 256" calibrate --live --config empty.yaml --grid 256x256 --board chessboard:10x7:25mm -o bad.yaml

# Frames are spread evenly over what is there. (A flat board that never moves is refused after its corners were kept.)
"$sst" version --json | grep -q '"opencv": true' || exit $failed
"$sst" board chessboard:10x7:10mm -o board.png --dpi 60 -q >out 2>err || fail "board: $(cat err)"
mkdir many && for i in 1 2 3 4 5 6 7 8 9; do cp board.png many/a0$i.png; done
frames() { # OPTIONS... -> names of the frames taken
  "$sst" calibrate many --board chessboard:10x7:10mm --corners c.json -o bad.yaml "$@" >out 2>err
  /usr/bin/python3 -c 'import json; print(*json.load(open("c.json"))["frames"])'
}
got=$(frames --max-frames 3) && [ "$got" = "01 04 07" ] || fail "3 of 9 frames: $got $(cat err)"
got=$(frames --every 2 --max-frames 2) && [ "$got" = "01 05" ] || fail "2 of each second of 9 frames: $got $(cat err)"
[ ! -e bad.yaml ] || fail "a board that never moves was calibrated from"
exit $failed
