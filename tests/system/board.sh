#!/usr/bin/env bash
# sst board: boards to print, in true scale, and refusals.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
. "$(dirname "$0")/../lib.sh"

"$sst" board chessboard:10x7:25mm -o chess.svg >out || fail "chess.svg"
grep -q '275 x 200 mm' out || fail "size of the sheet: $(cat out)"
grep -q 'width="275mm" height="200mm"' chess.svg || fail "scale of the SVG"
python3 -c 'import sys, xml.dom.minidom as m; m.parse("chess.svg")' || fail "the SVG is not XML"
want 2 'kind of board is unknown' board disc:3x3:1mm -o bad.svg
want 2 'svg' board chessboard:10x7:25mm -o bad.pdf
want 2 'svg' board chessboard:10x7:25mm
want 2 'dpi' board chessboard:10x7:25mm -o bad.png --dpi 1
want 3 'no such file\|does not exist\|cannot' board missing.yaml -o bad.svg
want 4 'no such file\|does not exist\|cannot' board chessboard:10x7:25mm -o missing/bad.svg

printf 'target_type: aprilgrid\ntagCols: 3\ntagRows: 2\ntagSize: 0.05\ntagSpacing: 0.3\n' >kalibr.yaml
if "$sst" version | grep -q 'OpenCV *no\|opencv *no'; then
  want 5 'OpenCV' board kalibr.yaml -o bad.svg
else
  "$sst" board kalibr.yaml -o grid.png --dpi 100 >out || fail "grid.png"
  grep -q 'aprilgrid:3x2:50mm:0.3:bottom-up' out || fail "Kalibr's target: $(cat out)"
  [ "$(head -c 8 grid.png | od -An -tx1 | tr -d ' ')" = 89504e470d0a1a0a ] || fail "grid.png is no PNG"
  # Without the part that holds OpenCV, in one sentence; all else works.
  mkdir bin
  cp "$sst" bin
  sst=$tmp/bin/sst
  want 5 'need OpenCV: libsst-opencv.so is neither beside the program nor in ../lib/sst' board kalibr.yaml -o bad.svg
  "$sst" board chessboard:10x7:25mm -o chess.png >out || fail "a chessboard without OpenCV: $(cat out)"
  mkdir -p lib/sst && echo nonsense >lib/sst/libsst-opencv.so
  want 5 'cannot load libsst-opencv.so' board kalibr.yaml -o bad.svg
fi
exit $failed
