#!/usr/bin/env bash
# What sst calibrate refuses of its sources before a picture is looked at: grids that the source or the configuration
# contradicts would lead beyond what they hold.
. "$(dirname "${BASH_SOURCE[0]}")/../lib.sh"

"$sst" scene cat --size 64x48 --grid 2x3 -o rig >out 2>err || fail "scene: $(cat err)"
: >rig/capture.jsonl # as captures of a rig have it: the drives' positions are by its views
want 3 "leave --grid out" calibrate rig --grid 3x3 --board chessboard:10x7:25mm -o bad.yaml
want 3 "is no folder" calibrate out --board chessboard:10x7:25mm -o bad.yaml
mkdir unnamed && cp "$(find rig/views -type f | sort | head -n 1)" unnamed/left01.png
want 3 "do not fill a grid of 2x2" calibrate unnamed --grid 2x2 --board chessboard:10x7:25mm -o bad.yaml
printf 'array: { rows: 2, cols: 2 }\ncameras: { bind: [ { row: 1, col: 1, port: "1-1" } ] }\n' >array.yaml
want 2 "does not fit the cameras" calibrate --live --config array.yaml --grid 1x2 --board chessboard:10x7:25mm -o bad.yaml
echo "array: { rows: 2 }" >empty.yaml
want 2 "more than 256" calibrate --live --config empty.yaml --grid 256x256 --board chessboard:10x7:25mm -o bad.yaml
exit $failed
