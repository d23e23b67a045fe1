#!/usr/bin/env bash
# sst capture rig on simulated drives and cameras: plan, refusals, a capture over RTU, Ctrl-C and going on, a trigger line,
# a camera that goes, and the result in the commands that read light fields.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
. "$(dirname "$0")/../lib.sh"
sim=$root/${SST_BUILD:-build}/sst-sim
rig=(--grid 1x3 --pitch 3mm --backlash 0.3 --profile sst-sim --camera SIM0000 --size 320x240 --speed 300 --accel 2000
     --settle 20 --guard 5)

"$sst" capture rig --grid 2x2 --pitch 4cm --dry-run >plan || fail "dry run"
grep -q "41.000     41.000" plan || fail "no pose in the plan: $(cat plan)"
want 2 "the output folder is missing" capture rig --pitch 40mm
want 2 "not a length" capture rig --pitch 40miles -n
want 2 "the bus and the drives of the rig are not set" capture rig --pitch 40mm -o bad
want 2 "but the travel is" capture rig --grid 6x6 --pitch 90mm -n
want 2 "unknown kind of capture" capture video

[ -x "$sim" ] || skip "sst-sim is not built"
"$sim" --quiet --rig --rig-port 0 --world "$root/simulators/scene/world/worlds/small.yaml" -- true 2>err &&
  fail "an array on a rig"
grep -q "do not change with the pose" err || fail "an array on a rig: $(cat err)"
"$sst" capture rig "${rig[@]}" --bus tcp:127.0.0.1:1 -o none 2>err
grep -q "without libmodbus" err && skip "built without libmodbus"
"$sst" capture rig "${rig[@]}" --bus "tcp:[::1]:1" -o none 2>err && fail "a rig of IPv6 that is nowhere"
grep -q "host \[" err && fail "the brackets of an address of IPv6 are a part of the host: $(cat err)"

cat >inside.sh <<'INSIDE'
rig=("$@")
fail() { echo "FAIL: $*"; bad=1; }
bad=0
bus=rtu:/dev/serial/by-id/usb-sim_rig,115200,8E1
"$sst" capture rig "${rig[@]}" --pitch 5mm --bus tcp:no..host:502 -o lf 2>err && fail "a rig that is nowhere"
grep -q "cannot connect: host no..host:" err || fail "the host is not named: $(cat err)"
# which leaves nothing that other settings could spoil
timeout 600 "$sst" capture rig "${rig[@]}" --bus $bus -o lf --json >report 2>err || fail "capture over RTU: $(cat err)"
grep -q '"taken":3' report || fail "not three views: $(cat report)"
[ -f lf/lightfield.json ] && [ "$(ls lf/views | wc -l)" -eq 3 ] || fail "no light field: $(ls lf lf/views)"
timeout 600 "$sst" capture rig "${rig[@]}" --bus $bus -o lf --json | grep -q '"taken":0' || fail "complete, and taken again"

for n in 1 2 3 4 5; do # who stands still for two seconds comes too late for the views that are left: again
  rm -rf cut
  "$sst" capture rig "${rig[@]}" --bus $bus --settle 1000 -o cut >/dev/null 2>err & pid=$!
  for _ in $(seq 1200); do [ "$(grep -c '"view"' cut/capture.jsonl 2>/dev/null)" -ge 1 ] 2>/dev/null && break; sleep 0.05; done
  kill -INT $pid; wait $pid; rc=$?
  [ $rc -eq 0 ] || break
  repeats $n "the capture ended before Ctrl-C"
done
[ $rc -eq 130 ] || fail "Ctrl-C gives $rc: $(cat err)"
grep -q "run the same command to resume" err || fail "no word of going on: $(cat err)"
[ -f cut/lightfield.json ] && fail "a light field that is none"
"$sst" capture rig "${rig[@]}" --pitch 5mm --bus $bus -o cut 2>err && fail "other settings are taken"
grep -q "pitch_um was" err || fail "what differs is not named: $(cat err)"
timeout 600 "$sst" capture rig "${rig[@]}" --bus $bus --settle 1000 --resume -o cut >/dev/null 2>err || fail "going on: $(cat err)"
[ -f cut/lightfield.json ] || fail "not complete after going on"

cat >gpio.yaml <<YAML
trigger: { source: gpio, chip: sst-trigger, lines: [TRIG0] }
cameras: { controls: { trigger_mode: 1 } }
YAML
timeout 600 "$sst" capture rig "${rig[@]}" -c gpio.yaml --bus $bus -o pulse --json >report 2>err
rc=$?
grep -q "libgpiod" err && rc=0
[ $rc -eq 0 ] || fail "with a trigger line: $(cat err)"

(for _ in $(seq 1200); do grep -q '"view"' plug/capture.jsonl 2>/dev/null && break; sleep 0.05; done
  LD_PRELOAD= "$sim" fault camera.0.unplug=1; sleep 1; LD_PRELOAD= "$sim" fault camera.0.unplug=0) &
timeout 600 "$sst" capture rig "${rig[@]}" --grid 1x6 --bus $bus -o plug --json >report 2>err || fail "unplugged camera: $(cat err)"
wait
exit $bad
INSIDE
export sim sst
timeout 600 "$sim" --quiet --rig --rig-port 0 --world "$root/simulators/scene/world/worlds/small-rig.yaml" -- bash inside.sh "${rig[@]}" ||
  fail "see above"
if [ -f lf/lightfield.json ]; then
  "$sst" render lf --focus 3 --method refocus -o seen.png || fail "sst render does not read it"
  "$sst" process lf --no-labels --preset preview --json >report 2>err || fail "sst process: $(cat err)"
  python3 -c 'import json
r = json.load(open("report"))
assert r["parallax"] is True and r["confirmed_percent"] > 50 and r["searched_px"][0] >= -1, r' || fail "the rig moved"
  grep -q '"parallel": true' lf/lightfield.json || fail "not parallel"
fi
exit $failed
