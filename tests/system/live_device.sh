#!/usr/bin/env bash
# live: device in the service: pictures and labels on Mesa's software device, which is lost again and again as its driver
# reports it, a device that fails on request, one that is not there: the live picture goes on, and the status, metrics, events and
# journal say so. Without lavapipe it fails. PARTS are those to run; SECONDS_LONG is the time of `losses`, LOSSES their number, HZ its
# sets per second, SIZE its views; FIGURES gets its figures, a line for each loss.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
. "$(dirname "$0")/../lib.sh"
need libcurl
. "$root/tests/lavapipe.sh"
networks=$("$sst" version --json | grep -q '"onednn": true' && echo yes)
long=${SECONDS_LONG:-12} times=${LOSSES:-3} hz=${HZ:-2}
IFS=x read -r width height <<<"${SIZE:-96x72}"
. "$root/tests/service_lib.sh"
log=sstd.log
sim=
viewer=
trap 'kill $viewer $sim 2>/dev/null; wait $sim; rm -rf "$tmp"' EXIT

# A layer between Vulkan's loader and the driver: tests/device_lost.c.
mkdir layers
cat >layers/lost.json <<JSON
{"file_format_version": "1.1.0", "layer": {"name": "VK_LAYER_SST_device_lost", "type": "GLOBAL", "library_path":
 "$build/device_lost.so", "api_version": "1.3.0", "implementation_version": "1", "description": "devices are lost on request"}}
JSON
export VK_LAYER_PATH=$tmp/layers VK_INSTANCE_LAYERS=VK_LAYER_SST_device_lost SST_DEVICE_LOST=$tmp/lost
echo 0 >lost
# The network that ships, on pictures of a size that a software device labels in a second.
cp "$root/models/pspnet-small.onnx" . && echo "size: 48x32" >pspnet-small.yaml
# The same cameras, fewer and smaller.
printf 'scene: cat\ngrid: [3, 3]\nsize: [%d, %d]\nstrip: false\n' "$width" "$height" >small.yaml

# begin WORLD ROWS WIDTH HEIGHT HZ DEVICE METHOD: the service on its array, without a viewer
begin() {
  local lines=TRIG0
  for ((line = 1; line < $2; line++)); do lines+=", TRIG$line"; done
  cat >sstd.yaml <<YAML
array: {rows: $2, cols: $2}
cameras:
  width: $3
  height: $4
  check_frozen: false
  controls: {trigger_mode: 1, auto_exposure: 1, exposure_time_absolute: 50}
trigger: {source: gpio, chip: sst-trigger, lines: [$lines], loopback: LOOP0, rate_hz: $5}
control: {socket: $tmp/c.sock, group: ""}
web: {port: 0, token_file: $tmp/token}
storage: {dir: $tmp/store, ring_mb: 16, min_free_gb: 0}
live: {device: "$6", method: $7, skip_change: false, model: $tmp/pspnet-small.onnx}
YAML
  rm -f pid
  "$build/sst-sim" --quiet --world "$1" -- sh -c 'echo $$ >pid; exec "$0" "$@"' "$build/sstd" -v --config sstd.yaml >sstd.log 2>&1 &
  sim=$!
  written pid
  daemon=$(cat pid)
  until_is 60 live.ready 'v'
}
quick_world() { begin "$root/simulators/scene/world/worlds/quick.yaml" 6 160 128 3 "$@"; }
watch() { timeout 300 curl -s -m 300 --unix-socket c.sock http://x/stream >/dev/null & viewer=$!; }
end() {
  [ -z "$viewer" ] || kill "$viewer"
  kill $daemon
  wait $sim
  sim= viewer=
}
# events TYPE WORK: their number
events() {
  curl -sf -m 10 --unix-socket c.sock 'http://x/api/v1/events?limit=1000' | /usr/bin/python3 -c '
import json, sys
print(sum(e["type"] == sys.argv[1] and e["data"]["work"] == sys.argv[2] for e in map(json.loads, sys.stdin)))' "$1" "$2"
}

# --- a software device, named: every method there, and the network ---
named() {
  quick_world lavapipe clear
  watch
  until_is 60 live.device.pictures 'v > 5'
  [ -z "$networks" ] || until_is 60 live.device.labels.runs 'v > 1'
  /usr/bin/python3 - "$("$sst" status --json)" "$networks" <<'END' || fail "lavapipe fails: $("$sst" status --json)"
import json, sys
d = json.loads(sys.argv[1])["live"]["device"]
cpu = ["change", "decode", "rectify", "disparity", "refine", "encode", "background"]
good = d["failures"] == d["on_cpu"] == 0 and "llvmpipe" in d["name"]
if sys.argv[2]:
    labels = d["labels"]
    good = good and labels["failures"] == labels["on_cpu"] == 0 and not labels["failing"] and d["stages_on_cpu"] == cpu
else:
    good = good and d["labels"] is None and d["stages_on_cpu"] == ["labels"] + cpu
sys.exit(not good)
END
  "$sst" status >text
  grep -q 'device .*llvmpipe' text && grep -q 'on the CPU: .*disparity' text || fail "sst status: $(cat text)"
  [ -z "$networks" ] || grep -q 'labels: [0-9]* runs of the network, 0 on the CPU' text || fail "sst status: $(cat text)"
  curl -sf -m 10 --unix-socket c.sock http://x/metrics >metrics
  grep -q '^sst_live_device_up 1$' metrics || fail "metrics: $(grep device metrics)"
  [ -z "$networks" ] || grep -q '^sst_live_device_labels_up 1$' metrics || fail "metrics: $(grep device metrics)"
  "$sst" doctor --config sstd.yaml >doctor.txt 2>&1
  grep -q 'live.device lavapipe: on llvmpipe.* are labels, render; on the CPU are change, .*disparity' doctor.txt || fail "sst doctor: $(cat doctor.txt)"
  # Not only what is kept of earlier tests, and with the variants of shaders.
  grep -q 'lavapipe.* passes its tests, run again: .*, carry_close, .*, check, .*, clear_surface,' doctor.txt || fail "sst doctor: $(cat doctor.txt)"
  grep -q 'lavapipe.* passes its tests, run again: .*net_conv8_dot' doctor.txt || fail "sst doctor: no variants: $(cat doctor.txt)"
  end
}

# --- lost as a driver loses it, once of them for some seconds: every set but the one in work has its picture ---
losses() {
  begin "$tmp/small.yaml" 3 "$width" "$height" "$hz" lavapipe sst
  "$root/tests/stream_sets.py" c.sock sets >stream.json & viewer=$!
  local start=$SECONDS
  until_is 60 live.device.pictures 'v > 2'
  [ -z "$networks" ] || until_is 60 live.device.labels.runs 'v > 0'
  "$sst" status --json >before.json
  for ((i = 1; i <= times; i++)); do
    sleep "$((long / (times + 1) / 2))"
    failures=$(value live.device.failures)
    [ -z "$networks" ] || labels_failures=$(value live.device.labels.failures)
    # Every third one is away for a while: it cannot be opened then.
    if ((i % 3 == 2)); then echo "$i gone" >lost; else echo "$i" >lost; fi
    echo "loss $i after the picture $(tail -n 1 sets)" >>each
    until_is 60 live.device.failures "v > $failures"
    [ -z "$networks" ] || until_is 60 live.device.labels.failures "v > $labels_failures" # after the picture, not in each set
    ((i % 3 != 2)) || { sleep 3; echo "$i" >lost; }
    until_is 120 live.device.failing 'not v'
    echo "  at work again by the picture $(tail -n 1 sets)" >>each
    [ -z "$networks" ] || until_is 120 live.device.labels.failing 'not v'
  done
  while ((SECONDS < start + long)); do sleep 0.5; done
  kill $viewer
  wait $viewer || fail "the stream: $(cat stream.json)"
  viewer=
  "$sst" status --json >after.json
  "$sst" status
  cat each stream.json
  /usr/bin/python3 - "$times" "$networks" "${SST_TIMING-}" <<'END' || fail "a device that is lost: $(tail -n 30 sstd.log)"
import json, sys
losses, networks, timing = int(sys.argv[1]), sys.argv[2], sys.argv[3]
before, after = (json.load(open(f)) for f in ("before.json", "after.json"))
stream = json.load(open("stream.json"))
a, b = before["live"], after["live"]
d, capture = b["device"], after["capture"]
passed = b["dropped"] - a["dropped"]
print(f"sets {b['sets'] - a['sets']}, passed over {passed}; pictures {b['pictures'] - a['pictures']}, on the device {d['pictures']}, "
      f"on the CPU {d['on_cpu']}, failures {d['failures']}; labels {d['labels']}")
wrong = []
if capture["refused"] or capture["dropped"] or capture["complete"] != capture["sets"]:
    wrong.append(f"the array lost sets: {capture}")
if not losses <= d["on_cpu"] or d["failures"] < losses or d["failing"]:
    wrong.append(f"pictures: {d}")
if networks and (d["labels"]["failures"] < losses or d["labels"]["failing"] or not d["labels"]["runs"]):
    wrong.append(f"labels: {d['labels']}")
# What was begun was shown; where others use the machine, sets come faster than pictures.
if stream["missing"] > b["dropped"] + losses:
    wrong.append(f"{stream['missing']} sets have no picture, {b['dropped']} were passed over")
if timing and stream["missing"] > losses:
    wrong.append(f"{stream['missing']} sets have no picture")
print("\n".join(wrong))
sys.exit(bool(wrong))
END
  lost=$(events device-lost pictures) found=$(events device-found pictures)
  [ "$lost" -ge "$times" ] && [ "$found" -ge "$times" ] || fail "$times losses, $lost and $found events"
  [ -z "$networks" ] || [ "$(events device-lost labels)" -ge 1 ] || fail "no event of labels"
  grep -q 'live pictures are rendered on the CPU' sstd.log || fail "nothing in the journal"
  if [ -n "${FIGURES-}" ]; then cat each stream.json before.json after.json >"$FIGURES"; fi
  end
}

# --- a device that fails some pictures after each opening ---
fails() {
  echo 0 >lost
  quick_world dummy:lost=60 sst
  watch
  # Pictures of the device after its last failure: how many an opening brings depends on the machine.
  until_is 120 live.device 'v["failures"] >= 3 and v["on_cpu"] >= 3 and "lost" in v["reason"]'
  local shown
  shown=$(value live.device.pictures)
  until_is 120 live.device 'v["pictures"] > max(3, '"$shown"')'
  until_is 60 live.rate_hz 'v > 0'
  [ "$(events device-lost pictures)" -ge 3 ] && [ "$(events device-found pictures)" -ge 2 ] || fail "events"
  end
}

# --- not there ---
missing() {
  quick_world "no such device" sst
  watch
  until_is 60 live.device.on_cpu 'v > 3'
  [ "$(value live.device.failing)" = true ] || fail "a device that is not there: $("$sst" status --json)"
  value live.device.stages_on_cpu '"render" in v and "labels" in v' >/dev/null || fail "a device that is not there does not do it all: $("$sst" status --json)"
  end
}

for part in ${PARTS:-named losses fails missing}; do $part; done
exit $failed
