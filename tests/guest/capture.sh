# sst capture array on 36 capture nodes (vivid) and a GPIO chip (gpio-sim) of a real kernel: sets are recorded, what its
# error injection does to cameras is in the account of every frame, and pulses make sets with time stamps of their edges.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
. tests/guest/lib.sh

load vivid n_devs=36 $(python3 -c '
for name, value in ("node_types", "0x1"), ("multiplanar", "1"), ("num_inputs", "1"), ("input_types", "0x0"):
    print(name + "=" + ",".join([value] * 36))')
wait_for 30 test -e /dev/video35 || fail "36 nodes do not appear"

run() { # NAME ARGS...: an account in NAME.json
  local name=$1
  shift
  "$sst" capture array --format GREY --size 320x180 --json "$@" >"$name.json" 2>"$name.err" ||
    fail "$name: exit $?: $(cat "$name.err")"
}

# Everything is recorded, and every frame is accounted for.
run all --trigger free-run --rate 2 -n 10 -o rec
holds all.json 'j["cameras"] == 36' 'j["sets"] == 10' 'j["complete"] >= 6' 'j["frames"]["unexplained"] == 0' \
  'j["frames"]["bad"] == 0' 'sum(j["frames"]["buckets"].values()) == j["frames"]["delivered"]' \
  'j["bytes"] >= 6 * 36 * 320 * 180'
json all.json '{k: j[k] for k in ("sets", "complete", "seconds", "cpu_seconds", "bytes", "skew", "frames")}'
"$sst" import recording rec -o lf --sets last --allow-partial 2>err || fail "import: $(cat err)"
ls rec lf
rm -rf rec lf

# Camera 1 is flagged once and drops a third of its frames, camera 2 is unplugged: both are named, the other 34 go on.
# (Patience, or three drops in a row restart its stream, and its count begins anew.)
echo 'cameras: { stall_ms: 8000 }' >patient.yaml
recorded() { [ "$(cat recording/sets.jsonl 2>/dev/null | wc -l)" -ge "$1" ]; }
"$sst" capture array --config patient.yaml --format GREY --size 320x180 --json --trigger free-run --rate 2 --sync 0 -o recording \
  >faults.json 2>faults.err & capture=$!
wait_for 60 recorded 3 || fail "nothing is recorded: $(cat faults.err)"
v4l2-ctl -d /dev/video1 -c inject_v4l2_buf_flag_error=1 -c percentage_of_dropped_buffers=33
v4l2-ctl -d /dev/video2 -c disconnect=1
wait_for 20 grep -q unplugged faults.err || fail "an unplugged camera is not told"
so_far=$(wc -l <recording/sets.jsonl)
wait_for 60 recorded $((so_far + 16)) || fail "the others do not go on"
kill -INT $capture
wait $capture || fail "faults: exit $?"
cat faults.err
holds faults.json 'j["frames"]["unexplained"] == 0' 'j["frames"]["bad"] == 1' 'j["devices_lost"] == 1' \
  'j["devices_found"] == 37' 'j["frames"]["buckets"]["flagged"] == 1' 'j["array"][1]["faults"]["flagged"] == 1' \
  'j["array"][1]["lost"] >= 1' 'all(c["bad"] == 0 for i, c in enumerate(j["array"]) if i != 1)' \
  'j["array"][2]["frames"] < j["array"][3]["frames"]'
json faults.json '{k: v for k, v in j.items() if k != "array"}'
says faults.err "platform:vivid-002"
is "lines about the camera that was unplugged" "$(grep -c unplugged faults.err)" 1
rm -rf recording

# Pulses on GPIO, with a loop-back line.
modprobe gpio-sim || fail "no gpio-sim" # stays, see trigger.sh
chip=/sys/kernel/config/gpio-sim/capture
mkdir $chip $chip/bank $chip/bank/line0 $chip/bank/line1
echo 2 >$chip/bank/num_lines
echo capture-trigger >$chip/bank/label
echo FIRE >$chip/bank/line0/name
echo LOOP >$chip/bank/line1/name
echo 1 >$chip/live || fail "no GPIO chip"
udevadm settle --timeout=20
lines=/sys/devices/platform/$(cat $chip/dev_name)/$(cat $chip/bank/chip_name)
cat >gpio.yaml <<'Y'
cameras: { rate_hz: 4 }
trigger: { source: gpio, chip: capture-trigger, lines: [FIRE], loopback: LOOP, pulse_us: 100000, rate_hz: 4 }
Y
"$sst" doctor --config gpio.yaml >doctor 2>&1 || [ $? = 3 ] || fail "doctor: $(cat doctor)"
cat doctor
says doctor "OK       cameras" "OK       trigger"
wire_up "$lines/sim_gpio0/value" "$lines/sim_gpio1/pull"
run gpio --config gpio.yaml -n 10
cut_wire
cat gpio.err
holds gpio.json 'j["sets"] == 10' 'j["trigger"]["edges"] >= 10' 'j["frames"]["unexplained"] == 0' \
  "j['trigger']['edges'] - 1 <= $pulses <= j['trigger']['edges']" "$pulses - 1 <= j['trigger']['stamped'] <= $pulses"
json gpio.json '{k: j[k] for k in ("sets", "complete", "trigger", "from_edge", "frames")}'

# The chip goes away and comes back under a capture.
sed -i 's/, loopback: LOOP//' gpio.yaml
"$sst" capture array --config gpio.yaml --format GREY --size 320x180 --sync 0 --json -o recording \
  >gone.json 2>gone.err & capture=$!
wait_for 60 recorded 3 || fail "nothing is recorded: $(cat gone.err)"
echo 0 >$chip/live
wait_for 20 grep -q 'sst: error: .*trigger' gone.err || fail "a chip that is gone is not told"
so_far=$(wc -l <recording/sets.jsonl)
sleep 1
echo 1 >$chip/live || fail "the chip does not come back"
wait_for 30 recorded $((so_far + 4)) || fail "no sets after the chip is back"
kill -INT $capture
wait $capture
cat gone.err
holds gone.json 'j["frames"]["unexplained"] == 0'
echo 0 >$chip/live
rmdir $chip/bank/line* $chip/bank $chip
exit $failed
