#!/usr/bin/env bash
# A simulated still camera under gphoto2, and sst capture rig with it: detection, settings, files; then a grid of 36
# poses with a dozen random faults and a kill -9, each fault named, resumed, and every file as the camera holds it.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
. "$(dirname "$0")/../lib.sh"
build=$root/${SST_BUILD:-build}
export sst sim=$build/sst-sim SST_PROFILES=$root/config/profiles
world=$root/simulators/scene/world/worlds/still-rig.yaml
run() { timeout 600 "$sim" --quiet --rig-port 0 "$@"; }

want 2 "sets a still camera; add --camera still" capture rig --pitch 4mm --camera SIM0000 --iso 100 -n
want 2 "none of jpeg, raw and raw+jpeg" capture rig --pitch 4mm --camera still --files tiff -n
"$sst" capture rig --grid 6x6 --pitch 4mm --camera still --files raw+jpeg -n >plan || fail "dry run"
grep -q "about 1440.0 MB" plan || fail "no estimate of a still camera: $(tail -n 1 plan)"

# --- the program of libgphoto2
if command -v gphoto2 >/dev/null; then
  cat >gphoto.sh <<'END'
gphoto2 --auto-detect; gphoto2 --summary
gphoto2 --get-config imagequality --get-config focusmode --get-config shutterspeed --get-config f-number --get-config iso
gphoto2 --set-config shutterspeed=0.0100s --set-config focusmode=Manual && gphoto2 --get-config shutterspeed
gphoto2 --set-config iso=123 && echo "iso 123"
gphoto2 --capture-image-and-download; gphoto2 --trigger-capture; sleep 0.5
gphoto2 --list-files; gphoto2 --get-all-files; gphoto2 --storage-info; gphoto2 --delete-all-files --recurse
gphoto2 --list-files | grep -c JPG
END
  run --world "$world" --truth truth.jsonl -- sh gphoto.sh >out 2>&1
  for words in "USB PTP Class Camera  *usb:" "Serial Number: SST0001" "Generic Image Capture" "Battery Level.*value: 80%" \
    "Free Space (Images)" "Current: Automatic" "Current: 0.0050s" "Current: f/8" "Current: 100" "Current: 0.0100s" \
    "New file is in location /store_00010001/DCIM/100SST/SST_0001.JPG" "Deleting file" "SST_0002.JPG .* image/jpeg" "free="; do
    grep -q "$words" out || fail "gphoto2: no '$words' in $(cat out)"
  done
  [ "$(tail -n 1 out)" = 0 ] || fail "gphoto2 does not delete: $(tail -n 3 out)"
  grep -q "iso 123" out && fail "gphoto2 sets an ISO that there is not"
  for f in SST_0001.JPG SST_0002.JPG; do
    grep -q "\"file\":\"$f\".*$(sha256sum "$f" | cut -c1-64)" truth.jsonl || fail "$f is another than the camera's"
  done
else
  echo "gphoto2 is not installed (scripts/deps.sh): only sst is tested"
fi

"$sst" cameras --local --json 2>/dev/null | grep -q '"still"' || fail "no list of still cameras"
run --world "$world" -- "$sst" cameras --local >out 2>err || fail "sst cameras: $(cat err)"
grep -q "built without libgphoto2" out && skip "built without libgphoto2"
grep -q "sst SST Still Camera  *SST0001  *2-1  *there" out || fail "sst cameras: $(cat out)"
VK_DRIVER_FILES=/dev/null VK_ICD_FILENAMES=/dev/null run --world "$world" -- "$sst" doctor >out 2>&1
grep -q "OK *still *1 still camera can be opened" out || fail "sst doctor: $(cat out)"
run --world "$world" -- "$sst" capture rig --pitch 4mm --bus tcp:127.0.0.1:1 --profile sst-sim -o none 2>err
grep -q "without libmodbus" err && skip "built without libmodbus"

# --- raw files, focus that is locked, a mirror that is lifted, refusals
cat >kinds.sh <<'END'
fail() { echo "FAIL: $*"; bad=1; }
bad=0
cap() {
  timeout 300 "$sst" capture rig -c quick.yaml --grid 1x2 --pitch 4mm --backlash 0.3 --profile sst-sim --speed 300 --accel 2000 \
    --bus rtu:/dev/serial/by-id/usb-sim_rig,115200,8E1 --settle 20 --guard 5 --camera still "$@" >report 2>err
}
want() { local rc=$1 words=$2; shift 2; cap "$@"; [ $? -eq "$rc" ] && grep -q "$words" err || fail "no '$words': $(cat err)"; }
cap --format 5 --files raw+jpeg --focus locked --exposure 1/100 --aperture f/5.6 --iso 200 -o both || fail "raw+jpeg: $(cat err)"
grep -q "still camera: 3 exposures; battery 80 %" report || fail "focus locked: $(cat report)"
[ -s both/raw/00_01.dng ] && [ -s both/views/00_01.jpg ] || fail "raw+jpeg: $(ls both both/*)"
grep -q '"raw":"00_01.dng".*"battery_percent":80' both/capture.jsonl || fail "no raw file or battery in the manifest"
if cap --format 4 --files raw -o raw; then
  [ -s raw/raw/00_00.dng ] && [ -s raw/views/00_00.png ] || fail "raw: $(ls raw/*)"
  rm raw/raw/00_01.dng; cap --format 4 --files raw -o raw; grep -q "1 captured now" report || fail "raw file is not captured again"
else
  grep -q "LibRaw" err || fail "raw: $(cat err)"
fi
want 2 "delivers .*DNG, but still: files asks for jpeg" --format 4 -o other
want 2 "has no exposure time .1/3.; choose one of 0.0010s" --format 1 --exposure 1/3 -o other1
want 5 "no still camera XX is connected; there are: SST0001 at" --camera still:XX -o other2
want 2 "iso= .*was\|controls was" --format 5 --files raw+jpeg --focus locked --exposure 1/100 --aperture f/5.6 --iso 400 -o both
LD_PRELOAD= "$sim" fault still.refuse=1; want 5 "refuses ISO 1600 and keeps 200" --format 1 --iso 1600 -o other3
cap --format 1 --iso 1600 -o other3 || fail "after a refusal: $(cat err)"
exit $bad
END
sed 's/mirror_lockup: false/mirror_lockup: true/' "$world" >mirror.yaml
echo "still: { card_ms: 6000, quiet_ms: 300, response_ms: 5000 }" >quick.yaml
run --world "$world" -- bash kinds.sh || fail "see above"
echo "still: { card_ms: 6000, quiet_ms: 300, response_ms: 5000, mirror_ms: 50 }" >quick.yaml
cat >mirror.sh <<'END'
"$sst" capture rig -c quick.yaml --grid 1x2 --pitch 4mm --backlash 0.3 --profile sst-sim --speed 300 --accel 2000 \
  --bus rtu:/dev/serial/by-id/usb-sim_rig,115200,8E1 --settle 20 --guard 5 --camera still -o mirror
END
run --world mirror.yaml -- bash mirror.sh >report 2>err || fail "mirror lock-up: $(cat err)"
grep -q "still camera: 2 exposures" report || fail "mirror lock-up: $(cat report)"

# --- stopped or killed while the camera writes its card, and resumed at once: each view shows its own pose
cat >shift.sh <<'END'
cap() {
  exec "$sst" capture rig -c quick.yaml --grid 1x3 --pitch 4mm --backlash 0.3 --profile sst-sim --speed 300 --accel 2000 \
    --bus rtu:/dev/serial/by-id/usb-sim_rig,115200,8E1 --settle 20 --guard 5 --camera still "$@"
}
shots() { LD_PRELOAD= "$sim" status --json | tr ',{' '\n' | grep '"exposures"' | tr -dc 0-9; }
for signal in INT KILL; do
  before=$(shots)
  cap -o "$1-$signal" & pid=$!
  for _ in $(seq 1200); do [ "$(shots)" -ge $((before + 2)) ] && break; sleep 0.1; done # the second is being written, for 800 ms
  kill -$signal $pid; wait $pid; (cap -o "$1-$signal") || echo "FAIL: $1, $signal"
done
END
echo "still: { card_ms: 20000, quiet_ms: 2500 }" >quick.yaml
for buffer in false true; do
  sed "s/write_ms: 100/write_ms: 800/; s/buffer: false/buffer: $buffer/" "$world" >shift.yaml
  run --world shift.yaml --truth "truth-$buffer" -- bash shift.sh "buffer-$buffer" >out 2>&1
  grep -aq FAIL out && fail "$(cat out)"
  for signal in INT KILL; do
    python3 - "truth-$buffer" "buffer-$buffer-$signal/capture.jsonl" <<'END' || fail "buffer $buffer, $signal: $(cat out)"
import json, sys
truth = {t["sha256"]: t["pose_um"] for t in map(json.loads, open(sys.argv[1])) if "still" in t}
views = [v for v in map(json.loads, open(sys.argv[2])) if "sha256" in v]
assert len(views) == 3
for v in views:
    assert max(abs(a - b) for a, b in zip(truth[v["sha256"]][:2], v["asked_um"])) <= 12, v
END
  done
done

# --- 36 poses with 12 random faults, and a kill
seed=${SEED:-1} # SEED=$(date +%s) for others
python3 - "$seed" "$world" <<'END' || fail "no plan of faults"
import random, sys
r = random.Random(int(sys.argv[1]))
kinds = [("busy", 400), ("busy", 3000), ("card_full", 1), ("battery", 3), ("refuse", 1), ("corrupt", 1), ("corrupt", 2),
         ("corrupt", 3), ("silence", 1), ("unplug_download", 300), ("no_event", 1)]
plan = kinds + [r.choice(kinds) for _ in range(12 - len(kinds))]
r.shuffle(plan)
shots = sorted(r.sample(range(2, 36), 12))
with open("faults.yaml", "w") as f:
    text = open(sys.argv[2]).read()
    f.write(text[:text.index("  lag_ms")] + "  lag_ms: 20\n  write_ms: 30\n  faults:\n")
    for shot, (name, value) in zip(shots, plan):
        if name == "refuse":  # there is something to set
            f.write(f"    - {{shot: {shot}, fault: dial, value: 333}}\n")
        f.write(f"    - {{shot: {shot}, fault: {name}, value: {value}}}\n")
END
echo "still: { card_ms: 2000, quiet_ms: 300, response_ms: 1000, keep: true, exposure: 1/100 }" >quick.yaml
cat >all.sh <<'END'
bus=rtu:/dev/serial/by-id/usb-sim_rig,115200,8E1 # a line that a killed program leaves as it is
for round in $(seq 12); do
  "$sst" capture rig -c quick.yaml --grid 6x6 --pitch 2mm --backlash 0.3 --profile sst-sim --speed 300 --accel 2000 \
    --bus "$bus" --settle 20 --guard 5 --camera still:SST0001 -o lf --json >report 2>>log & pid=$!
  if [ "$round" = 1 ]; then
    for _ in $(seq 600); do [ "$(cat lf/capture.jsonl 2>/dev/null | wc -l)" -ge 9 ] && break; kill -0 $pid 2>/dev/null || break; sleep 0.05; done
    kill -KILL $pid 2>/dev/null
  fi
  wait $pid; rc=$?
  [ $rc -eq 0 ] && break
  [ $rc -eq 137 ] || LD_PRELOAD= "$sim" fault still.battery=0 still.card_full=0 # a person came
done
[ -f lf/lightfield.json ] || echo "FAIL: not complete after $round rounds"
mkdir held; cd held; command -v gphoto2 >/dev/null && gphoto2 --get-all-files >../got 2>&1
exit 0
END
run --world faults.yaml --truth truth.jsonl -- bash all.sh >out 2>&1
grep -q FAIL out && fail "$(cat out)"
python3 - <<'END' || { fail "with seed $seed: $(cat log)"; cat faults.yaml; }
import hashlib, json, os, re
words = {"card_full": "is full|no space on its card", "battery": "battery of still camera .* is low", "refuse": "refuses exposure time",
         "silence": "does not answer within", "unplug_download": "was unplugged or switched off", "no_event": "announced 0 of 1 files",
         ("busy", 400): "is busy and does not release", ("busy", 3000): "stays busy for more than",
         ("corrupt", 1): "no complete JPEG", ("corrupt", 2): "no complete JPEG", ("corrupt", 3): "does not answer within|bytes, .* arrived"}
log = open("log").read()
faults = [(m[1], int(m[2])) for m in re.finditer(r"fault: (\w+), value: (\d+)", open("faults.yaml").read()) if m[1] != "dial"]
assert len(faults) == 12, faults
for f in faults:
    assert re.search(words.get(f) or words[f[0]], log), f"{f} is not named"
truth = {}
for line in open("truth.jsonl"):
    t = json.loads(line)
    if "still" in t:
        truth[t["sha256"]] = t
held = {hashlib.sha256(open("held/" + n, "rb").read()).hexdigest() for n in os.listdir("held")}
views = {}
for line in open("lf/capture.jsonl").read().splitlines()[1:]:
    v = json.loads(line)
    views[v["view"]] = v
assert len(views) == 36
for k, v in views.items():
    data = open("lf/views/" + v["file"], "rb").read()
    sha = hashlib.sha256(data).hexdigest()
    assert sha == v["sha256"] and sha in truth, f"view {k} is none of the camera's files"
    assert not held or sha in held, f"view {k} is none of the files that gphoto2 finds on the camera"
    assert len(data) == truth[sha]["bytes"] == v["bytes"]
    off = [abs(a - b) for a, b in zip(truth[sha]["pose_um"], v["asked_um"])]
    assert max(off[:2]) <= 12, f"view {k} was exposed {off} um from its pose"
    assert v["still"]["battery_percent"] >= 5
END
exit $failed
