#!/usr/bin/env bash
# `sst rectify` and `sst import --calib`: a simulated array that is mounted badly, its true calibration, disparities
# against the truth of the scene, and refusals.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
set -u
. "$(dirname "$0")/../lib.sh"
sim=$root/${SST_BUILD:-build}/sst-sim
truth=$root/${SST_BUILD:-build}/tests/tools/rect_truth
[ -x "$sim" ] && [ -x "$truth" ] || skip "sst-sim or rect_truth is not built; make all tests"
need libgpiod
need libavformat
ok() { timeout 600 "$sst" "$@" >out 2>err || fail "sst $*: $(cat err)"; }
json() { /usr/bin/python3 -c "import json; o = json.load(open('out')); assert $1, o" || fail "not $1"; }

cat >world.yaml <<'Y'
scene: pedestrian
grid: [2, 3]
size: [320, 240]
strip: false
jpeg_quality: 92
loop: { seconds: 0.5, rate_hz: 2 }
optics: { distortion: [-0.15, 0.04, 0, 0, 0], focal_spread_percent: 0.5, principal_spread_px: 3, vignetting: 0.2 }
mounting: { rotation_spread_deg: 0.8, position_spread_mm: 2 }
sensor: { gain_spread_percent: 3 }
Y
cat >array.yaml <<'Y'
array: { rows: 2, cols: 3, spacing_mm: 40 }
cameras:
  width: 320
  height: 240
  rate_hz: 10
  stall_ms: 3000
  controls: { auto_exposure: 1, exposure_time_absolute: 50, trigger_mode: 1 }
trigger: { source: gpio, chip: sst-trigger, lines: [TRIG0, TRIG1], loopback: LOOP0, rate_hz: 5 }
Y
"$sim" --quiet --world world.yaml --parameters calib.yaml || fail "parameters"
timeout 600 "$sim" --quiet --world world.yaml -- "$sst" capture array --config array.yaml -n 2 -o rec >out 2>err || fail "capture: $(cat err)"

# --- the same light field both ways, raw frames untouched ---
ok import recording rec --sets 0 -o raw
ok rectify raw --calib calib.yaml -o lf
[[ $(head -1 out) == "lf: 6 views of 320x240, grid 2x3, offsets x -1.0"* ]] || fail "printed: $(head -1 out)"
for words in "lattice: steps" "plane: centres off it" "exact at infinity" "of the raw frames kept"; do
  grep -q "$words" out || fail "no '$words' in: $(cat out)"
done
diff -r raw/views lf/views || fail "rectify changed the frames"
cmp -s lf/calibration.yaml calib.yaml || "$sst" calibration show lf/calibration.yaml >/dev/null || fail "no calibration in the folder"
ok import recording rec --sets 0 --calib calib.yaml -o direct
diff -r --exclude set.json direct lf || fail "import --calib makes another light field"
ok rectify raw --calib calib.yaml -o json --json --focal 560 --size 300x200 --plane 8000 --filter lanczos
json "o['width'] == 300 and o['focal_px'] == 560 and o['plane_mm'] == 8000 and o['filter'] == 'lanczos'"
json "0 < o['lattice_rms_mm'] <= o['lattice_max_mm'] < 10 and 0.5 < o['filled']['worst'] <= o['filled']['mean'] <= 1"

# --- stored, baked and exported views ---
grep -q '"version": 2' lf/lightfield.json || fail "not version 2"
ok rectify lf --bake -o baked
grep -q '"version": 1' baked/lightfield.json && [ ! -e baked/calibration.yaml ] || fail "a baked light field has a calibration"
ok export hci lf -o hci
ok export stanford lf -o stanford
for k in 0 1 2 3 4 5; do
  cmp -s hci/input_Cam00$k.png baked/views/0$((k / 3))_0$((k % 3)).png || fail "export hci: view $k is not the rectified one"
done
[ "$(find stanford -name 'out_*.png' | wc -l)" = 6 ] || fail "export stanford: $(ls stanford)"
ok import stanford stanford -o again
cmp -s again/views/01_02.png baked/views/01_02.png || fail "stanford: another picture"

# --- disparities: right with the calibration, hopeless without ---
"$truth" world.yaml lf truth 2>err || fail "truth: $(cat err)"
error() { # of a light field, bad-1 in percent
  ok process "$1" --no-labels --range-min 2 --range-max 26
  ok eval "$1" --truth truth/visible --json
  /usr/bin/python3 -c "import json; print(json.load(open('out'))['disparity']['bad1'])"
}
with=$(error lf)
without=$(error raw)
echo "bad-1: $with % with the calibration, $without % without"
/usr/bin/python3 -c "import sys; sys.exit(not ($with < 1.5 and $without > 10 * $with))" || fail "disparities: $with % and $without %"
diff -r raw/views lf/views || fail "process changed the frames"
"$sst" render lf --method refocus --focus 10 -o a.png --threads 1 && "$sst" render lf --method refocus --focus 10 -o b.png --threads 3 &&
  cmp -s a.png b.png || fail "threads change a rendering"

# --- refusals ---
want 2 "-o OUT is missing" rectify raw --calib calib.yaml
want 2 "none of bilinear" rectify raw --calib calib.yaml --filter best -o bad
want 2 "no calibration; add --calib" rectify raw -o bad
want 3 "none.yaml" rectify raw --calib none.yaml -o bad
want 4 "exists already" rectify raw --calib calib.yaml -o lf
want 2 "lf would be replaced\|choose another output" rectify lf --calib calib.yaml -o lf --force
want 2 "too close to camera" rectify raw --calib calib.yaml --plane 1 -o bad
sed 's/"SIM0001"/"SIMX"/; s/"SIM0002"/"SIM0001"/; s/"SIMX"/"SIM0002"/' calib.yaml >swapped.yaml
want 3 "camera SIM0002 was calibrated at row 0, column 1, but recorded at row 0, column 2" import recording rec --sets 0 --calib swapped.yaml -o bad
sed 's/"SIM0004"/"SIM0044"/' calib.yaml >other.yaml
want 3 "it has camera SIM0044, but SIM0004 was recorded" import recording rec --sets 0 --calib other.yaml -o bad
sed 's/grid: .*/grid: [2, 2]/' world.yaml >four.yaml
"$sim" --quiet --world four.yaml --parameters four-calib.yaml || fail "parameters of four"
want 3 "grid of 2x2 cameras, the views form one of 2x3" rectify raw --calib four-calib.yaml -o bad
sed 's/size: .*/size: [640, 480]/' world.yaml >large.yaml
"$sim" --quiet --world large.yaml --parameters large-calib.yaml || fail "parameters of large"
want 3 "frames of 640x480 pixels, the views have 320x240" import recording rec --sets 0 --calib large-calib.yaml -o bad
want 2 "calib is for raw frames" import hci hci --calib calib.yaml -o bad
echo "# a remark" >>lf/calibration.yaml
want 3 "has changed since the light field was made" render lf --method refocus --focus 10 -o bad.png

[ "$failed" -eq 0 ] && echo "rectify as documented"
exit "$failed"
