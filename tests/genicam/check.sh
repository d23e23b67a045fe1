#!/usr/bin/env bash
# Fake GigE cameras, each in a network namespace of its own, on a network that loses packets: every frame is in one bucket, no set is
# mixed, numbers of frames wrap at 16 bits, and a camera comes back after its cable was cut. Then V4L2 and GenICam cameras in one array,
# exposed by one trigger. MINUTES=10, CAMERAS=16, LOSS=10 (of 1000 packets), RATE=10 (Hz), MIXED=18 (cameras of each kind; 0: none).
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
set -u
. "$(dirname "$0")/../lib.sh"
. "$root/tests/genicam_lib.sh"
build=$root/${SST_BUILD:-build}
minutes=${MINUTES:-10} # may be a fraction
count=${CAMERAS:-16} loss=${LOSS:-10} rate=${RATE:-10} mixed=${MIXED:-18}
for i in $(seq "$count"); do camera "$i" "$loss"; done

# capture SETS CONFIG RECORDING: frames in ./json, the product's messages in ./log
capture() {
  nice -n 0 ip netns exec "$space" "$sst" capture array --config "$2" -n "$1" -o "$3" --json >json 2>log || fail "capture: $(tail -n 3 log)"
}
# judge_sets RECORDING LIMIT_S FIRST LAST: cameras FIRST .. LAST of the array are fake ones, the first is G1
judge_sets() {
  local i logs=()
  for i in $(seq "$3" "$4"); do logs+=("$i=camera$((i - $3 + 1)).out"); done
  python3 "$root/tests/genicam_sets.py" "$1" "$2" "${logs[@]}" || fail "sets of $1 are mixed"
}
# account NAME [CONDITION]: every frame is in one bucket
account() {
  python3 - "$1" "${2:-True}" <<'PY' || fail "$1: frames without a bucket, or not $2"
import json, sys
r = json.load(open("json"))
c = r["array"]
frames, buckets = sum(x["frames"] for x in c), sum(sum(x["buckets"].values()) for x in c)
total = {k: sum(x["buckets"][k] for x in c) for k in c[0]["buckets"]}
print(f"{sys.argv[1]}: {frames} frames, {frames - buckets} unexplained; lost before {sum(x['lost'] for x in c)}; {total}; "
      f"packets missing {sum(x['packets_missing'] for x in c)}; {r['cpu_seconds']:.0f} s of CPU in {r['seconds']:.0f} s")
sys.exit(not (frames == buckets and not r["frames"]["unexplained"] and eval(sys.argv[2])))
PY
}

# --- many cameras on a bad network ------------------------------------------------------------------------------------------
rows=$(((count + 3) / 4))
{ settings "$count" "$rows" 4 "format: GREY" "width: 320" "height: 240" "rate_hz: $rate" "buffers: 16"
  echo "genicam: {trigger: none, exposure_us: 10000, packet_bytes: 8192}"; } >many.yaml
sets=$(awk "BEGIN {print int($minutes * 60 * $rate)}")
capture "$sets" many.yaml many
account "$count cameras, $rate Hz, $loss of 1000 packets lost, $minutes minutes"
judge_sets many "$(awk "BEGIN {print 0.5 / $rate}")" 0 $((count - 1))
wrapped=$(grep -l "Send frame 1$" camera*.out | wc -l)
echo "numbers of frames wrapped at 16 bits: $wrapped of $count cameras"
[ "$wrapped" -eq "$count" ] || [ "$sets" -lt 200 ] || fail "the numbers of frames did not wrap"
rm -rf many

# --- a cable that is cut ----------------------------------------------------------------------------------------------------
(sleep 4; cable 2 down; sleep 6; cable 2 up) &
capture $((20 * rate)) many.yaml cut
wait $!
account "a cable cut for 6 s" 'sum(x["recovery"]["reopen"] for x in c) >= 1 and c[1]["buckets"]["set"] > 40'
[ "$(grep -c 'camera G2: streaming again' log)" -eq 1 ] || fail "G2 does not come back, or more than once: $(grep G2 log)"
[ "$(grep -c 'camera G2: no frame for' log)" -eq 1 ] || fail "the loss of G2 is not logged once: $(grep G2 log)"
rm -rf cut

# --- both kinds in one array, one trigger -----------------------------------------------------------------------------------
if [ "$mixed" -gt 0 ]; then
  for i in $(seq "$((mixed < count ? mixed : count))"); do
    kill "${camera_pid[$i]}"; wait "${camera_pid[$i]}" 2>/dev/null
  done
  for i in $(seq "$mixed"); do camera "$i" 0; done
  { echo "array: {rows: 2, cols: $mixed}"
    echo "cameras: {format: GREY, width: 320, height: 240, rate_hz: 30, buffers: 16, controls: {trigger_mode: 1}, bind: ["
    for i in $(seq "$mixed"); do printf '  {row: 0, col: %d, serial: SIM%04d},\n' $((i - 1)) $((i - 1)); done
    for i in $(seq "$mixed"); do echo "  {row: 1, col: $((i - 1)), kind: genicam, serial: G$i},"; done
    echo "]}"
    echo "trigger: {source: gpio, chip: sst-trigger, lines: [TRIG0], rate_hz: 5}"
    echo "sets: {window_us: 90000, skew_limit_us: 100000}"
    echo "genicam: {trigger: software, exposure_us: 10000, packet_bytes: 8192}"; } >both.yaml
  printf 'scene: cat\ngrid: [2, %d]\nsize: [320, 240]\n' $((mixed / 2)) >both.world
  ip netns exec "$space" "$build/sst-sim" --quiet --triggers one --world both.world -- \
    "$sst" capture array --config both.yaml -n 100 -o both --json >json 2>log || fail "both kinds: $(tail -n 3 log)"
  account "$mixed V4L2 and $mixed GenICam cameras, one trigger, 5 Hz" 'r["complete"] >= 95'
  judge_sets both 0.15 "$mixed" $((2 * mixed - 1))
fi
exit $failed
