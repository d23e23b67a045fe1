#!/usr/bin/env bash
# `sst batch` of recordings in memory: the pictures of the way through folders, for every format, with a calibration, with
# views that are missing or displaced; what is written and what is not.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
set -u
. "$(dirname "$0")/../lib.sh"
writer=$root/${SST_BUILD:-build}/tests/tools/record_writer
[ -x "$writer" ] || skip "$writer is not built; make tests"
need libavformat
record() { timeout 600 "$writer" write "$@" cameras=12 width=160 height=120 bytes=200000 views=world >/dev/null 2>err || fail "record $*: $(cat err)"; }
batch() { timeout 600 "$sst" batch "$@" >out 2>err || fail "batch $*: $(cat err)"; }
mkdir recs
"$sst" scene pedestrian --size 160x120 --grid 2x6 -o world >/dev/null || fail "scene"
{
  printf 'format: sst-calib\nversion: 1\nrows: 2\ncols: 6\nwidth: 160\nheight: 120\nreference: [0, 2]\ncameras:\n'
  for k in 0 1 2 3 4 5 6 7 8 9 10 11; do
    printf '  - { row: %d, col: %d, name: S%03d, focal_px: [160.1, 160], centre_px: [79.5, 59.7], ' $((k / 6)) $((k % 6)) $k
    printf 'distortion: [-0.1, 0.02, 0, 0, 0], rotation: [1, 0, 0, 0, 1, 0, 0, 0, 1], position_mm: [%d.3, %d, 0] }\n' \
      $((40 * (k % 6) - 80)) $((40 * (k / 6)))
  done
} >calib.yaml

# alike NAME ARGS...: both ways make the same pictures and reports, but for times
alike() {
  local name=$1 f
  shift
  rm -rf "folders-$name" "memory-$name"
  batch "recs/$name" -o "folders-$name" --preset preview --steps 2 "$@"
  batch "recs/$name" -o "memory-$name" --preset preview --steps 2 --write clear,see-through,sweep,reports "$@"
  for f in clear.png see-through.png sweep.mp4; do
    cmp "folders-$name/$name-000000/$f" "memory-$name/$name-000000/$f" || fail "$name: $f differs"
  done
  [ ! -e "memory-$name/$name-000000/lightfield" ] || fail "$name: a light field was written"
  python3 - "$name" <<'PY' || fail "$name: reports differ"
import csv, json, sys
name = sys.argv[1]
def read(way, file):
    o = json.load(open(f"{way}-{name}/{name}-000000/{file}"))
    for k in ("seconds", "cpu_seconds", "output", "device", "networks"):
        o.pop(k, None)
    return o
def near(a, b):
    if isinstance(a, dict):
        return a.keys() == b.keys() and all(near(a[k], b[k]) for k in a)
    if isinstance(a, list):
        return len(a) == len(b) and all(map(near, a, b))
    return abs(a - b) <= 1e-5 * max(abs(a), abs(b)) if isinstance(a, float) and isinstance(b, float) else a == b
for file in ("process.json", "clear.json", "see-through.json"):
    a, b = read("folders", file), read("memory", file)
    assert near(a, b), (file, {k: (a.get(k), b.get(k)) for k in a.keys() | b.keys() if a.get(k) != b.get(k)})
rows = [list(csv.DictReader(open(f"{way}-{name}/figures.csv"))) for way in ("folders", "memory")]
for r in rows:
    assert len(r) == 1 and r[0]["name"] == f"{name}-000000" and float(r[0]["seen_percent"]) > 50, r
    r[0].pop("seconds"), r[0].pop("cpu_seconds")
assert rows[0] == rows[1], rows
PY
}
record recs/jpeg holes=0 sets=1
alike jpeg --device dummy
alike jpeg
for format in GREY Y16 RGGB; do
  record recs/$format format=$format holes=0 sets=1
  alike $format --no-labels
done
grep -q "16 bits become 8" memory-Y16/logs/Y16-000000.log || fail "no word of samples that are lost: $(cat memory-Y16/logs/*)"
record recs/shift format=GREY holes=0 sets=1 shift=3
alike shift --no-labels
grep -q '"moved": [1-9]' memory-shift/shift-000000/process.json || fail "no view was found displaced"
grep -q '"sampling": "raw"' memory-shift/shift-000000/clear.json || fail "the clear picture is not of the originals"
cp -r recs/jpeg recs/bent
alike bent --no-labels --calib calib.yaml
grep -q '"sampling": "raw"' memory-bent/bent-000000/clear.json || fail "the clear picture is not of the raw frames"
cp -r recs/shift recs/both
alike both --no-labels --calib calib.yaml
grep -q '"moved": [1-9]' memory-both/both-000000/process.json || fail "no calibrated view was found displaced"

# --- views that are missing or damaged leave holes, and a set without any fails alone, by name ---
record recs/holes sets=3
python3 - <<'PY'
import json
lines = [json.loads(l) for l in open("recs/holes/sets.jsonl") if l.startswith('{"set"')]
with open("recs/holes/segments/000000.mkv", "r+b") as f:
    for frame in lines[1]["frames"] + lines[0]["frames"][4:5]:
        f.seek(frame[5] + 9)
        f.write(b"\0\1\2")
PY
"$sst" batch recs/holes -o holes --preset preview --write clear >out 2>err && fail "a set without a picture is fine"
grep -q "holes-000001: set 1 of recs/holes lacks 12 of 12 views" err || fail "no cause: $(cat err)"
[ "$(ls holes | tr '\n' ' ')" = "figures.csv holes-000000 holes-000002 logs " ] || fail "made: $(ls holes)"
grep -q "warning: set 0 lacks [1-9] of 12 views: .*damaged on the disk" holes/logs/holes-000000.log || fail "log: $(cat holes/logs/*)"
grep -q "error: set 1 .* lacks 12" holes/logs/holes-000001.log || fail "log: $(cat holes/logs/*1.log)"
"$sst" batch recs/holes -o holes --preset preview --write clear --status | grep -q "^failed   holes-000001.* lacks 12" || fail "status"

# --- what is asked for alone is written, and figures.csv has its line; what is finished is skipped ---
[ "$(ls holes/holes-000002 | tr '\n' ' ')" = "clear.png figures.json " ] || fail "written: $(ls holes/holes-000002)"
grep -q '^holes-000002,2,6,160,120,[0-9.]*,1,,,[-0-9.]*,[0-9.]*,[0-9.]*,[0-9.]*,,,,,$' holes/figures.csv || fail "figures: $(cat holes/figures.csv)"
touch -d @1 holes/holes-000002/clear.png
"$sst" batch recs/holes -o holes --preset preview --write clear >out 2>err && fail "failed ones are forgotten"
[ "$(stat -c %Y holes/holes-000002/clear.png)" = 1 ] || fail "done again"
batch recs/jpeg -o other --preset preview --no-labels --write lightfield,clear
[ "$(ls other/jpeg-000000 | tr '\n' ' ')" = "clear.png figures.json lightfield " ] || fail "written: $(ls other/jpeg-000000)"
cmp other/jpeg-000000/clear.png memory-jpeg/jpeg-000000/clear.png || fail "labels or folders change the clear picture"
batch recs/jpeg -o other --preset preview --no-labels --write see-through
[ "$(ls other/jpeg-000000 | tr '\n' ' ')" = "figures.json see-through.png " ] || fail "written: $(ls other/jpeg-000000)"

# --- folders of light fields go the same way; kinds of sources ---
cp -r world recs/world
rm -rf recs/world/truth
batch recs -o kinds --from lightfield --preset preview --no-labels --write clear,reports --shard 1/1
[ "$(ls kinds | tr '\n' ' ')" = "figures.csv logs world " ] || fail "kinds: $(ls kinds)"
batch recs/world -o whole --preset preview --no-labels --steps 0
cmp kinds/world/clear.png whole/world/clear.png || fail "a light field in memory gives another picture"
want 3 "recs/world holds no recordings" batch recs/world -o bad --from recording
want 2 "use recording or lightfield" batch recs -o bad --from folder
want 2 "unknown .maps.; use clear, see-through, sweep, lightfield, reports, all or none" batch recs -o bad --write maps
want 2 "leaves nothing to do" batch recs -o bad --write none
exit $failed
