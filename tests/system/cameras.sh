#!/usr/bin/env bash
# sst cameras and sst identify on simulated cameras: present ones with their places, missing ones, and the pictures.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
. "$(dirname "$0")/../lib.sh"
sim=$root/${SST_BUILD:-build}/sst-sim
[ -x "$sim" ] || skip "$sim is not built: no simulated cameras"
export sst sim tmp

# One session for all, with one picture of each camera: it takes a moment to start.
if [ "${1-}" != inside ]; then
  printf 'scene: pedestrian\nstrip: false\nloop: { seconds: 0.5, rate_hz: 2 }\n' >world.yaml
  timeout 600 "$sim" --quiet --world world.yaml -- "$root/tests/system/cameras.sh" inside
  exit
fi

need libudev

"$sst" cameras --json >list.json || fail "cameras --json"
python3 - <<'PY' || fail "list of cameras"
import json
cams = json.load(open("list.json"))["cameras"]
assert len(cams) == 36, len(cams)
assert sorted(c["serial"] for c in cams) == ["SIM%04d" % i for i in range(36)]
assert all(c["state"] == "free" and "MJPG" in c["formats"] and c["driver"] == "uvcvideo" for c in cams)
# Without a configuration places follow the order of ports.
assert [(c["row"], c["col"]) for c in cams] == [(i // 6, i % 6) for i in range(36)]
PY

# Bindings decide; a camera that is not there is named, one that is not bound has no place.
cat >array.yaml <<'YAML'
array: { rows: 1, cols: 3 }
cameras:
  bind:
    - { row: 0, col: 0, serial: SIM0007 }
    - { row: 0, col: 1, serial: SIM0003 }
    - { row: 0, col: 2, serial: SIM9999 }
YAML
"$sst" cameras --config array.yaml >table 2>err || fail "cameras --config"
grep -q '^r0c1 .*SIM0003' table || fail "no place for SIM0003: $(grep SIM0003 table)"
grep -q '^- .*SIM0004' table || fail "a place for SIM0004"
grep -q 'row 0 col 2: no camera with serial SIM9999' err || fail "missing camera not told: $(cat err)"

"$sst" identify --serial SIM0003 --config array.yaml -o pictures --write bind.yaml >out 2>err || fail "identify: $(cat err)"
[ -s pictures/identify.png ] && [ "$(find pictures -name '*_SIM0003.png' | wc -l)" -eq 1 ] || fail "pictures: $(ls pictures)"
grep -q 'row: 0, col: 1, serial: "SIM0003"' bind.yaml || fail "bindings: $(cat bind.yaml)"

# Another camera is put at a free position, or in place of one that is not connected; in a full array it is left out.
proposal() { # CONFIG WORDS
  "$sst" identify --serial SIM0004 --config "$1" -o pictures --write bind.yaml >/dev/null 2>err || fail "identify of another: $(cat err)"
  grep -q "$2" bind.yaml err || fail "$1: $(cat bind.yaml err)"
}
proposal array.yaml 'row: 0, col: 2, serial: "SIM0004"'
sed 's/cols: 3/cols: 4/' array.yaml >wider.yaml
proposal wider.yaml 'row: 0, col: 3, serial: "SIM0004"'
sed 's/cols: 3/cols: 2/; /SIM9999/d' array.yaml >full.yaml
proposal full.yaml '1 camera has no free position in the array of 1x2'
[ "$(grep -c serial bind.yaml)" -eq 0 ] || fail "a full array: $(cat bind.yaml)"

cp array.yaml before.yaml
"$sst" identify --config array.yaml -o pictures --write ./array.yaml >/dev/null 2>err && fail "a configuration is replaced by bindings"
grep -q 'name another file' err && cmp -s array.yaml before.yaml || fail "replaced: $(cat err)"

# All of them, and the proposal is a configuration.
"$sst" identify -o all --write all.yaml --json >all.json || fail "identify of all"
python3 - <<'PY' || fail "pictures of all"
import json, os
d = json.load(open("all.json"))
assert len(d["cameras"]) == 36 and all(os.path.exists(c["picture"]) for c in d["cameras"]), d
assert os.path.exists(d["sheet"])
PY
"$sst" cameras --config all.yaml --json | python3 -c 'import json, sys
assert all("row" in c for c in json.load(sys.stdin)["cameras"])' || fail "proposed bindings"

# Cameras that do not open: the reason of each, once.
"$sim" fault camera.3.busy=1 camera.7.busy=1
sed '/SIM9999/d' array.yaml >two.yaml
"$sst" identify --config two.yaml --serial SIM0003 -o none >out 2>err && fail "a picture of a busy camera"
[ "$(grep -c 'camera row 0, col 1 (serial SIM0003): another program' err)" -eq 1 ] || fail "busy: $(cat err)"
"$sst" identify --config two.yaml -o some >out 2>err || fail "identify of the others: $(cat err)"
[ "$(cat out err | grep -c 'another program')" -eq 2 ] && grep -q 'no picture of 2 of 36' err || fail "busy ones: $(cat out err)"
"$sst" capture array --config two.yaml -n 1 -o rec >out 2>err && fail "sets of busy cameras"
[ "$(grep -c 'another program' err)" -eq 2 ] && grep -q 'camera row 0, col 0 (serial SIM0007): another' err || fail "capture: $(cat err)"
"$sim" fault camera.3.busy=0 camera.7.busy=0

# A camera that another program has, one that hangs, one that is gone.
"$sim" fault camera.5.busy=1 camera.6.slow_open_ms=5000 camera.8.unplug=1
"$sst" cameras >table 2>err || fail "cameras with faults"
grep -q 'SIM0005.* busy' table || fail "busy not told: $(grep SIM0005 table)"
grep -q 'SIM0006.* hangs' table || fail "hanging not told: $(grep SIM0006 table)"
grep -q SIM0008 table && fail "SIM0008 is listed and away"
"$sim" fault camera.6.slow_open_ms=0 camera.5.busy=0 camera.8.unplug=0

want 3 'no such camera' identify --serial NOBODY
want 2 'unknown option' cameras --nonsense
exit $failed
