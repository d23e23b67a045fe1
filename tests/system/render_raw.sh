#!/usr/bin/env bash
# `sst render --sampling`: choice of the way, nearly the same pictures by both, and refusals.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
set -u
. "$(dirname "$0")/../lib.sh"
ok() { timeout 600 "$sst" "$@" >out 2>err || fail "sst $*: $(head -c 400 err)"; }

# Frames of a scene taken for those of cameras with lenses: views are then bent, all alike.
{
  printf 'format: sst-calib\nversion: 1\nrows: 2\ncols: 3\nwidth: 200\nheight: 150\nreference: [0, 1]\ncameras:\n'
  for row in 0 1; do
    for col in 0 1 2; do
      printf '  - { row: %d, col: %d, name: c%d%d, focal_px: [200, 200], centre_px: [99.5, 74.5], ' $row $col $row $col
      printf 'distortion: [-0.1, 0.02, 0, 0, 0], rotation: [1, 0, 0, 0, 1, 0, 0, 0, 1], position_mm: [%d, %d, 0] }\n' \
        $((40 * col - 40)) $((40 * row))
    done
  done
} >calib.yaml
ok scene cell --size 200x150 --grid 2x3 -o world
ok import folder world/views --grid 2x3 --calib calib.yaml -o lf
ok import folder world/views --grid 2x3 --spacing-px 0 -o plain

sampling() { ok render lf --focus 7.4 --method refocus --json -o "$@"; sed -n 's/.*"sampling": "\(.*\)".*/\1/p' out; }
# --- one picture of no more views than there are: raw; more pictures: rectified ---
[ "$(sampling a.png)" = raw ] || fail "one picture of all views is not taken from raw frames"
[ "$(sampling one.png --max-views 1)" = raw ] || fail "one view is not taken from its raw frame"
[ "$(sampling b.png --sampling rectified)" = rectified ] || fail "--sampling rectified"
[ "$(sampling c.png --explain why)" = rectified ] || fail "--explain shows raw frames"
cmp -s b.png c.png || fail "rectified pictures differ"
cmp -s a.png b.png && fail "raw and rectified give the same bytes: one of them is the other"
ok render lf --focus 7.4 --method refocus --sampling raw --threads 1 -o d.png
SST_CPU=ref ok render lf --focus 7.4 --method refocus --sampling raw --threads 3 -o e.png
cmp -s a.png d.png && cmp -s a.png e.png || fail "threads or CPU level change the picture"
ok sweep lf --from 7.4 --to 7 --steps 6 --method refocus -o frames
cmp -s frames/0000.png b.png || fail "a sweep is not made of rectified views"
ok sweep lf --from 7.4 --to 7 --steps 6 --method refocus --max-views 1 -o frames1
cmp -s frames1/0000.png one.png || fail "a sweep of one view is not taken from its raw frame"

# --- clear pictures, too, sample raw frames ---
ok process lf --no-labels --preset preview
ok render lf --method clear --cut 50 --json -o f.png
grep -q '"sampling": "raw"' out || fail "a clear picture is not taken from raw frames"
ok render lf --method clear --cut 50 --sampling raw --threads 1 -o g.png
ok render lf --method clear --cut 50 --sampling rectified -o h.png
cmp -s f.png g.png || fail "threads change the clear picture"
cmp -s f.png h.png && fail "raw and rectified give the same clear picture: one of them is the other"

want 3 "neither a calibration nor a correction" render plain --focus 7.4 --method refocus --sampling raw -o bad.png
want 2 "use auto, raw or rectified" render lf --focus 7.4 --sampling both -o bad.png
want 2 "leave out --sampling raw" render lf --focus 7.4 --method refocus --sampling raw --explain x -o bad.png
[ ! -e bad.png ] || fail "bad.png exists"
exit "$failed"
