#!/usr/bin/env bash
# `sst find` of a simulated flight: folder, JSON, GeoJSON; options that exclude each other, sources without poses.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
set -u
. "$(dirname "$0")/../lib.sh"
python=${PYTHON:-/usr/bin/python3}
"$python" -c 'import json' 2>/dev/null || skip "python3 is absent"

"$sst" scene flight -o flight --size 320x256 --grid 1x12 -q >out 2>err || fail "scene: $(cat err)"
"$sst" find flight --surface flight/truth/ground.obj -o finds --json >found.json 2>err || fail "find: $(cat err)"
"$python" - <<'PY' || fail "finds differ from the walkers"
import json, math
found, truth, geo = json.load(open("found.json")), json.load(open("flight/truth/truth.json")), json.load(open("finds/finds.geojson"))
assert [f["box"] for f in json.load(open("finds/finds.json"))["finds"]] == [f["box"] for f in found["finds"]]
at = [f["position_m"] for f in found["finds"]]
for w in truth["walkers"]:
    if w["views"] >= 6:
        assert any(math.dist(w["position_m"][:2], p[:2]) < 0.8 for p in at), w
assert len(geo["features"]) == len(at) > 0
for f, g in zip(found["finds"], geo["features"]):
    lon, lat = g["geometry"]["coordinates"]
    assert abs((lat - 48.3) * 111194 - f["position_m"][1]) < 0.3 and f["views"] <= f["looking"]
PY
[ -s finds/find-01.png ] && [ -s finds/finds.png ] || fail "pictures are missing"
"$python" - <<'PY' || fail "levels of the pictures: $(cat found.json)"
import json
l = json.load(open("found.json"))["levels"]
assert -2000 < l["integral"][0] < 0 < l["integral"][1] < 2000 and 6000 < l["views"][0] < l["views"][1] < 9000, l
PY
"$sst" find flight --surface flight/truth/ground.obj -o finds --force --levels 7000,7400 >out 2>err || fail "--levels: $(cat err)"
grep -q "median ([-+0-9. to]* degrees); of views levels 7000 to 7400 (6.9 to 22.9 degrees Celsius)" out || fail "the stretch is not said: $(cat out)"
"$sst" find flight --surface flight/truth/ground.obj --view nadir >out 2>err || fail "nadir: $(cat err)"
grep -q '^ *1 *score' out || fail "nothing is found from above: $(cat out)"

# Three moments of an array: walkers have their speed and heading. Pictures that the search for the ground has kept are of all moments.
"$sst" scene forest -o walk --size 320x320 --grid 1x6 --moments 3 --cover 3 -q >out 2>err || fail "scene: $(cat err)"
"$sst" find walk -o strip --json >walk.json 2>err || fail "find of moments: $(cat err)"
"$python" - <<'PY' || fail "walkers have other paths: $(cat walk.json)"
import json, math
found, truth = json.load(open("walk.json")), json.load(open("walk/truth/truth.json"))
at = {(w["walker"], w["moment"]): w for w in truth["walkers"]}
assert [m["time_s"] for m in found["moments"]] == [0, 0.5, 1]
seen = 0
for k in {k for k, _ in at}:
    steps = [at[k, m] for m in range(3)]
    if any(s["views"] < 5 for s in steps):
        continue
    way = [b - a for a, b in zip(steps[0]["position_m"], steps[2]["position_m"])]
    hit = [f for f in found["finds"] if all(math.dist(s["position_m"][:2], p["position_m"][:2]) < 0.8 for s, p in zip(steps, f["path"]))]
    assert hit, steps
    if math.hypot(*way[:2]) > 0.5:
        turn = (hit[0]["heading_deg"] - math.degrees(math.atan2(way[0], way[1])) + 180) % 360 - 180
        assert abs(hit[0]["speed_m_s"] - math.hypot(*way[:2])) < 0.5 and abs(turn) < 30, (hit[0], way)
    seen += 1
assert seen
PY
[ -s strip/find-01.png ] || fail "the strip is missing"

refused() { # exit code, words of the sentence, arguments
  local code=$1 words=$2; shift 2
  "$sst" find "$@" >out 2>err; local r=$?
  [ $r -eq "$code" ] && [ "$(grep -c error: err)" -eq 1 ] && grep -q "$words" err || fail "find $*: $r, $(cat err)"
}
refused 2 "exclude each other" flight --threshold 5 --alarms 2
refused 3 "channels: one is grey" flight walk --surface plane:35
# Light fields that do not go together are refused before the ground is sought, which these would fail.
"$sst" scene flight -o small --size 64x48 --grid 1x2 -q >out 2>err || fail "scene: $(cat err)"
refused 3 "no moments of one world" small walk
refused 3 "walk has several moments itself" walk small
refused 3 "small is named twice" small ./small
# A moment of poses in other axes; a light field whose moments have one view each; a folder without rights.
cp -r small far && cp -r small single || fail "no copies"
"$python" - <<'PY'
import json
for name in "far", "single":
    lf = json.load(open(f"{name}/lightfield.json"))
    for k, v in enumerate(lf["views"]):
        if name == "far":
            v["position_mm"][0] += 1e9
        else:
            v["moment"] = k + 1
    json.dump(lf, open(f"{name}/lightfield.json", "w"))
PY
refused 3 "shows nothing of the ground" small far --surface plane:35
refused 3 "three placed views at least; there are 2" single
grep -q "warning: .*0 of its 2 moments have two placed views" err || fail "moments of one view: $(cat err)"
"$python" - <<'PY'
import json
lf = json.load(open("flight/lightfield.json"))
for v in lf["views"]:
    v["position_mm"] = [x / 1e5 for x in v["position_mm"]]
json.dump(lf, open("tiny.json", "w"))
PY
cp -r flight tiny && mv tiny.json tiny/lightfield.json
"$sst" find tiny --surface plane:0.0003 >out 2>err || fail "tiny: $(cat err)"
grep -q "smaller than the largest find" err || fail "lengths of another unit: $(cat out err)"
chmod 0 far/lightfield.json
if [ "$(id -u)" -ne 0 ]; then refused 3 "Permission denied" far; fi
refused 2 "not below" flight --least 3 --most 1
refused 2 "neither ground" flight --surface hill
refused 2 "is neither nadir nor a view" flight --view gone --surface plane:35
refused 2 "is for --by integral" flight --alarms 2 --by views --surface plane:35
refused 3 "no such folder" gone --surface plane:35
mkdir keep && echo mine >keep/mine.txt
"$sst" find flight --surface plane:35 -o keep --force >out 2>err && fail "a folder of other things was replaced"
"$sst" find flight --surface plane:35 -o flight --force >out 2>err && fail "the light field was replaced"
"$sst" scene forest --size 64x64 -o keep --force -q >out 2>err && fail "scene replaced a folder of other things"
[ -s keep/mine.txt ] && [ -s flight/lightfield.json ] || fail "files are gone"
before=$(md5sum <finds/finds.json)
"$sst" find flight --surface plane:35 -o finds >out 2>err && fail "a folder was replaced without --force"
[ "$before" = "$(md5sum <finds/finds.json)" ] || fail "a refused run changed its folder"
"$sst" scene bush -o bush --grid 2x2 --size 64x48 -q >out 2>err || fail "scene: $(cat err)"
refused 3 "pose for every view" bush
"$sst" scene flight -o lost --size 64x48 --grid 1x2 --unplaced -q >out 2>err || fail "scene: $(cat err)"
refused 3 "is placed" lost
refused 3 "no view is placed" flight lost
