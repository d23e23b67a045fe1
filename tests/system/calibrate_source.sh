#!/usr/bin/env bash
# What sst calibrate refuses of its sources before a picture is looked at.
. "$(dirname "${BASH_SOURCE[0]}")/../lib.sh"

"$sst" scene cat --size 64x48 --grid 2x3 -o rig >out 2>err || fail "scene: $(cat err)"
: >rig/capture.jsonl # as captures of a rig have it: the drives' positions are by its views
want 3 "leave --grid out" calibrate rig --grid 3x3 --board chessboard:10x7:25mm -o bad.yaml
want 3 "is no folder" calibrate out --board chessboard:10x7:25mm -o bad.yaml
mkdir unnamed && cp "$(find rig/views -type f | sort | head -n 1)" unnamed/left01.png
want 3 "do not fill a grid of 2x2" calibrate unnamed --grid 2x2 --board chessboard:10x7:25mm -o bad.yaml
exit $failed
