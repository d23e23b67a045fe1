#!/usr/bin/env bash
# The service with ten simulated cameras on a rod over a forest, tilted and at unequal heights: it finds the ground, shows it
# refocused, seen through and clear, near to the truth without trees, and stores posed light fields that sst render reads.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
. "$(dirname "$0")/../lib.sh"
. "$root/tests/service_lib.sh"
log=sstd.log
python=/usr/bin/python3
[ -x "$build/sst-sim" ] || skip "sst-sim is not built: no simulated cameras"
command -v curl >/dev/null || skip "curl is not installed"
"$python" -c 'import cv2, numpy' 2>/dev/null || skip "python3-opencv is absent"

# A loop of one frame: walkers stand still. The same world without trees is the truth.
world() { printf 'scene: forest\nsize: [256, 256]\nstrip: false\njpeg_quality: 95\nloop: {seconds: 0.5, rate_hz: 2}\nforest: {trees_per_100m2: %s}\n' "$1"; }
world 6 >world.yaml
world 0 >bare.yaml
"$build/sst-sim" --world world.yaml --parameters poses.yaml || fail "no true poses"
cat >sstd.yaml <<YAML
array: {rows: 1, cols: 10}
cameras:
  width: 256
  height: 256
  check_frozen: false
  controls: {trigger_mode: 1, auto_exposure: 1, exposure_time_absolute: 50}
trigger: {source: gpio, chip: sst-trigger, lines: [TRIG0], loopback: LOOP0, rate_hz: 5}
live: {poses: $tmp/poses.yaml, near_m: 25, far_m: 60, compare_px: 256}
control: {socket: $tmp/c.sock, group: ""}
web: {enabled: false}
storage: {dir: $tmp/store, ring_mb: 16, min_free_gb: 0}
YAML
"$build/sst-sim" --quiet --world bare.yaml --cache "$tmp/cache" -- \
  "$sst" capture array -q --config sstd.yaml -n 1 -o bare.rec >out 2>err || fail "capture: $(cat err)"
"$sst" import recording bare.rec --sets first --poses poses.yaml -o bare.lf >out 2>err || fail "import: $(cat err)"
grep -q "10 views of 256x256, colour of 8 bits, 10 placed" out || fail "import: $(cat out)"
cp -r bare.lf earth.lf
sed -i 's/^{/{"geographic": {"latitude": 48, "longitude": 14, "altitude_m": 300},/' earth.lf/lightfield.json
"$sst" import recording bare.rec --sets first --poses earth.lf -o again.lf >out 2>err || fail "import: $(cat err)"
grep -q '"longitude": 14' again.lf/lightfield.json || fail "the place on the earth is lost: $(head -c 600 again.lf/lightfield.json)"

"$sst" plan --live --config sstd.yaml --json >plan.json 2>err || fail "plan: $(cat err)"
"$python" -c 'import json, sys; p = json.load(open("plan.json")); sys.exit(not (p["cameras"] == 10 and "lear pictures" in p["advice"] and
  len(p["live"]) == 4 and all(t["rate_hz"] > 0 for t in p["live"]) and p["live"][-1]["width"] == 256))' || fail "plan: $(cat plan.json)"
"$sst" plan --live --config sstd.yaml --size 254x254 --json >plan.json 2>err || fail "plan of a size without a half: $(cat err)"
"$python" -c 'import json, sys; sys.exit(any(t["width"] != 254 for t in json.load(open("plan.json"))["live"]))' || fail "half sizes: $(cat plan.json)"
"$sst" plan --live --format GREY >out 2>err && fail "--format of --live is not refused"

trap 'kill -9 $daemon 2>/dev/null; rm -rf "$tmp"' EXIT
"$build/sst-sim" --quiet --world world.yaml --cache "$tmp/cache" -- \
  sh -c 'echo $$ >pid; exec "$0" --config sstd.yaml' "$build/sstd" >sstd.log 2>&1 &
session=$!
written pid
daemon=$(cat pid)
until_is 120 live.surface.known v
[ $failed -eq 0 ] || exit 1
value live.surface.distance_m '38.5 < v < 41.5' >out || fail "the ground is at $(cat out) m"
value live.labels True >/dev/null && fail "labels"
ask() { curl -sf --unix-socket c.sock "$@"; }
for m in refocus sst clear; do
  id=$(ask -H 'Content-Type: application/json' -d "{\"method\": \"$m\"}" http://sst/api/v1/views |
    "$python" -c 'import json, sys; print(json.load(sys.stdin)["id"])')
  for _ in $(seq 100); do ask "http://sst/snapshot/$id" -o $m.jpg && break; sleep 0.3; done
  [ -s $m.jpg ] || fail "no picture of $m"
done
for _ in $(seq 100); do ask "http://sst/api/v1/views/main/pick?x=128&y=128" >pick.json && break; sleep 0.3; done
grep -q disparity_px pick.json || fail "a click finds no surface"
for _ in $(seq 20); do ask "http://sst/snapshot/camera/r0c4" -o camera.jpg && break; sleep 0.3; done
ask -H 'Content-Type: application/json' -d '{}' http://sst/api/v1/snapshot >snapshot.json || fail "no snapshot"
name=$("$python" -c 'import json; print(json.load(open("snapshot.json"))["name"])')
kill "$daemon"
ended $session "the session"
lf=$(find "$tmp/store" -type d -name "$name" | head -1)
"$sst" render "$lf" -m clear --near 25 --far 60 --json --valid valid.png -o offline.png >render.json 2>err || fail "render: $(cat err)"
"$sst" find "$lf" --near 25 --far 60 -o finds >out 2>err || fail "find: $(cat err)"

"$python" - "$lf" <<'PY' || fail "pictures"
import json, sys
import cv2, numpy as np
bare = cv2.imread('bare.lf/views/00_04.jpg').astype(float)
got = {m: cv2.imread(m + '.jpg').astype(float) for m in ('camera', 'refocus', 'sst', 'clear')}
seen = cv2.imread('valid.png', -1) > 0
soft = lambda a: cv2.GaussianBlur(a, (0, 0), 1.5)
covered = np.abs(soft(got['camera']) - soft(bare)).max(2) > 25
off = lambda m, where: np.sqrt(((soft(got[m]) - soft(bare))[where] ** 2).mean())
same = lambda m, where: np.corrcoef(soft(got[m])[where].ravel(), soft(bare)[where].ravel())[0, 1]
figures = {'covered': covered.mean(), 'seen of it': (seen & covered).sum() / covered.sum(),
           'clear': [off('clear', seen & covered), same('clear', seen)], 'camera there': off('camera', seen & covered),
           **{m: [off(m, covered), same(m, covered)] for m in ('camera', 'refocus', 'sst')}}
walkers = (soft(bare).min(2) > np.median(bare) + 30) & seen
figures['walkers'] = [int(walkers.sum()), soft(got['clear'])[walkers].mean() - np.median(bare), soft(bare)[walkers].mean() - np.median(bare)]
print(figures)
ok = figures['seen of it'] > 0.15 and figures['clear'][0] < 0.75 * off('camera', seen & covered) and figures['clear'][1] > 0.75
ok &= walkers.sum() > 10 and figures['walkers'][1] > 0.6 * figures['walkers'][2]
ok &= figures['sst'][0] < figures['refocus'][0] < figures['camera'][0]
sys.exit(not ok)
PY
exit $failed
