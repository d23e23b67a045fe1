#!/usr/bin/env bash
# sst calibrate --live: corners from simulated cameras until enough framesets are accepted, the recording and the picture
# of the coverage beside them, an end by Ctrl-C, and cameras that see no board.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
. "$(dirname "${BASH_SOURCE[0]}")/../lib.sh"
sim=$root/${SST_BUILD:-build}/sst-sim
[ -x "$sim" ] || skip "sst-sim is not built"
for part in opencv libgpiod libavformat; do
  need $part
done

cat >board.yaml <<'Y'
scene: board
grid: [1, 2]
size: [480, 360]
seed: 11
strip: false
jpeg_quality: 90
board: { kind: charuco, squares: [9, 7], square_mm: 25, poses: 16 }
loop: { seconds: 3.2, rate_hz: 5 }
Y
cat >array.yaml <<'Y'
array: { rows: 1, cols: 2, spacing_mm: 60 }
cameras:
  width: 480
  height: 360
  rate_hz: 30
  controls: { auto_exposure: 1, exposure_time_absolute: 50, trigger_mode: 1 }
trigger: { source: gpio, chip: sst-trigger, lines: [TRIG0], loopback: LOOP0 }
Y
"$sim" --quiet --world board.yaml --parameters truth.json || fail "parameters of the world"

# live WORLD OPTIONS...
live() {
  local world=$1
  shift
  timeout 120 "$sim" --quiet --cache "$tmp/cache" --world "$world" -- "$sst" calibrate --live --config array.yaml \
    --board charuco:9x7:25mm:0.7 --no-cross "$@" >out 2>err
}

live board.yaml --rate 10 -n 12 --keep boards.rec --coverage coverage.png --corners corners.json -o calib.yaml --json
rc=$?
grep -q "no calibration solver" err && skip "built without libdogleg"
[ $rc -eq 0 ] || fail "live: exit $rc: $(cat err)"
grep -q 'of [0-9]* sets accepted, coverage [0-9]* %; camera 0,\([01]\) (SIM000\1) lacks most: ' err || fail "status: $(cat err)"
[ -s coverage.png ] || fail "there is no picture of the coverage"
"$sst" recording --verify boards.rec >recording 2>&1 || fail "recording: $(cat recording)"
/usr/bin/python3 - <<'P' || fail "figures: $(head -c 600 out)"
import json
figures, corners, truth = (json.load(open(f)) for f in ("out", "corners.json", "truth.json"))
sets = [json.loads(line) for line in open("boards.rec/sets.jsonl")]
names = [f"set {s['set']}" for s in sets if "frames" in s]
assert len(corners["frames"]) == 12 and [f for f in names if f in corners["frames"]] == corners["frames"], corners["frames"]
assert corners["frames"][-1] == names[-1], "it runs on after the last accepted set"
assert len(names) > 14, "sets in which the board has not moved are accepted"
assert figures["cameras_known"] == 2 and figures["rms_px"] < 0.2, figures["rms_px"]
assert abs(figures["array"]["spacing_mm"] - truth["spacing_mm"]) < 0.25, figures["array"]["spacing_mm"]
P
mv out out.live

# Poses that fill the pictures: it ends when nothing is missing, without a limit (usable: no cross-validation here).
sed 's/poses: 16/poses: 32, fill: true/; s/seconds: 3.2/seconds: 6.4/' board.yaml >fill.yaml
live fill.yaml --rate 10 -o full.yaml || fail "a board that fills the pictures: exit $?: $(cat err)"
grep -q "calibration: usable" out || fail "a board that fills the pictures: $(cat out)"
grep -q "repeat" err && fail "poses repeat before nothing is missing: $(cat err)"
grep -q "worst camera  0,[01] (SIM000[01]): " out || fail "no row and column: $(cat out)"

# Poses that do not fill them: it ends when they repeat, and says so.
sed 's/poses: 16/poses: 10/; s/seconds: 3.2/seconds: 2/' board.yaml >few.yaml
live few.yaml --rate 10 --force -o few-calib.yaml || fail "ten poses: exit $?: $(cat err)"
grep -q "the board's poses repeat: calibrated from the [0-9]* that differ, coverage [0-9]* %; camera 0,[01] (SIM" err ||
  fail "ten poses: $(cat err)"

# The same pictures from the recording give the same lenses.
"$sst" calibrate boards.rec --board charuco:9x7:25mm:0.7 --no-cross -o again.yaml --json >again.json 2>err ||
  fail "from the recording: $(cat err)"
/usr/bin/python3 -c 'import json
a, b = (json.load(open(f)) for f in ("out.live", "again.json"))
assert abs(a["array"]["focal_px"] / b["array"]["focal_px"] - 1) < 0.01' || fail "the recording gives another focal length"

# Ctrl-C ends it early: the frames accepted until then are enough.
cat >interrupted <<S
"$sst" calibrate --live --config array.yaml --board charuco:9x7:25mm:0.7 --no-cross --rate 5 -o cut.yaml &
until grep -qE '^([89]|[0-9]{2}) of [0-9]+ sets accepted' err; do sleep 0.1; done
kill -INT \$!
wait \$!
S
timeout 60 "$sim" --quiet --cache "$tmp/cache" --world board.yaml -- sh interrupted >out 2>err || fail "Ctrl-C: $(cat err)"
[ -s cut.yaml ] || fail "Ctrl-C: there is no calibration"

refused() { # WORDS WHAT: exit code 3, a message with these words, and no calibration
  [ $rc -eq 3 ] || fail "$2: exit $rc, not 3: $(cat err)"
  grep -q "^sst: error: .*$1" err || fail "$2: no '$1' in $(cat err)"
  [ ! -e bad.yaml ] || fail "$2: there is a calibration"
}
sed 's/spacing_mm: 60/spacing_mm: 50/' array.yaml >narrow.yaml
live board.yaml --config narrow.yaml --rate 5 -n 10 -o bad.yaml
rc=$?
refused "spacing of the cameras is [0-9.]* mm, but the array's configuration has 50 mm" "another spacing"
{ echo "scene: cat"; sed '/^scene:/d; /^board:/d; /^loop:/d' board.yaml; } >scene.yaml
live scene.yaml --rate 5 --duration 1 -o bad.yaml
rc=$?
refused "no camera saw the board charuco:9x7:25mm:0.7" "no board"
exit $failed
