#!/usr/bin/env bash
# `sst poses`: poses of simulated flights, the report, views that cannot be placed, and refusals in one sentence.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
set -u
. "$(dirname "$0")/../lib.sh"
need opencv
python=${PYTHON:-/usr/bin/python3}
"$python" -c 'import json' 2>/dev/null || skip "python3 is absent"

"$sst" scene forest -o forest --grid 1x5 --size 208x208 --unplaced >out 2>&1

# bad CODE WORDS ARGS...: refused in one sentence, the light field is as before
bad() {
  local code=$1 words=$2
  shift 2
  cp forest/lightfield.json before
  "$sst" poses "$@" >out 2>err
  judge "$code" "$words" $? "sst poses $*"
  cmp -s before forest/lightfield.json || fail "sst poses $*: the light field has changed"
}
bad 3 "no view is placed" forest --refine
bad 3 "needs two moments of two at least" forest --one-rig
bad 2 "named twice" forest forest --one-rig
bad 2 "does not go with --spacing" forest --refine --spacing 1000
bad 2 "are of given poses" forest --sigma-angle 1
bad 3 "no such folder" absent

# --- all views, the spacing that is given, and one that shows something else
"$sst" poses forest --spacing 500 --json >report 2>err || fail "poses: $(cat err)"
"$python" - <<'PY' || failed=1
import json
r = json.load(open("report"))
assert r["placed"] == r["views"] == 5 and not r["unplaced"] and not r["doubtful"], r
assert r["metric"] and abs(r["spacing"] - 0.5) < 1e-6 and r["median_px"] < 0.3 < r["p90_px"] + 0.3, r
assert len(r["centres"]) == 5 and all(len(c) == 3 for c in r["centres"].values()), r
lf = json.load(open("forest/lightfield.json"))
assert all("rotation" in v for v in lf["views"]) and "found 5 of 5" in lf["history"], lf["history"]
PY
"$sst" poses forest --spacing 500 --focal 250 >out 2>err || fail "again: $(cat err)"
grep -q "these replace 5 given poses (found 5 of 5" out && grep -q "focal length may be wrong: the matches ask for" out || fail "again: $(cat out)"
grep -q '"history": "found 5 of 5.*; before: found 5 of 5' forest/lightfield.json || fail "history: $(grep history forest/lightfield.json)"
"$sst" poses forest --spacing 500 --focal 0 >out 2>err || fail "third: $(cat err)"
grep -q "focal length [0-9.]* px +- [0-9.]* %" out && grep -q "hardly fix the focal length" out || fail "doubt of the focal length: $(cat out)"
"$sst" poses forest --spacing 500 >out 2>err || fail "fourth: $(cat err)"
grep -q "focal length [0-9.]* px +- [0-9.]* %" out || fail "the doubt of a kept focal length is forgotten: $(cat out)"
grep -q "focal length may be wrong" out && fail "--focal 0 keeps the focal length: $(cat out)"

# --- points with their tracks, as COLMAP reads them
"$sst" export colmap forest -o model >out 2>err || fail "export: $(cat err)"
"$python" - <<'PY' || fail "tracks of the export"
lines = lambda name: [l.rstrip("\n") for l in open("model/sparse/0/" + name) if l[0] != "#"]
two, seen, colours = lines("images.txt"), 0, set()
images = {int(a.split()[0]): b.split() for a, b in zip(two[::2], two[1::2])}
for l in lines("points3D.txt"):
    w = l.split()
    assert 0 <= float(w[7]) < 3 and len(w) >= 12, l
    colours.add(tuple(w[4:7]))
    for image, number in zip(map(int, w[8::2]), map(int, w[9::2])):
        x, y, point = images[image][3 * number:3 * number + 3]
        assert point == w[0] and 0 < float(x) < 208 and 0 < float(y) < 208, (l, x, y)
        seen += 3
assert seen == sum(map(len, images.values())) > 600 and len(colours) > 20, (seen, len(colours))
PY

mkdir pictures one
cp $(ls -d forest/views/* | head -n 3) pictures/
cp "pictures/$(ls pictures | head -n 1)" one/
"$sst" scene bush -o bush --grid 1x2 --size 208x208 >out 2>&1
cp "bush/views/$(ls bush/views | head -n 1)" pictures/zz.png
"$sst" import pictures pictures -o mixed >out 2>err || fail "import: $(cat err)"
"$sst" poses mixed >out 2>err || fail "mixed: $(cat err)"
grep -q "3 of 4 views placed" out && grep -q "not placed.*zz.png" out || fail "mixed: $(cat out)"

"$sst" import pictures one -o single >out 2>err || fail "import: $(cat err)"
bad 3 "one picture alone" single
bad 3 "they are not of one rig" forest mixed --one-rig

# --- moments of one array in one light field
"$sst" scene forest -o moments --grid 1x4 --size 208x208 --moments 2 --unplaced -q >out 2>err || fail "scene: $(cat err)"
"$sst" poses moments --one-rig --spacing 500 --json >report 2>err || fail "moments: $(cat err)"
"$python" - <<'PY' || failed=1
import json, math
r, lf = json.load(open("report")), json.load(open("moments/lightfield.json"))
assert r["placed"] == 8 and r["metric"] and abs(r["spacing"] - 0.5) < 1e-6, r
assert "one rig at 2 moments" in lf["history"] and r["median_px"] < 0.3, lf["history"]
c = [r["centres"][v["name"]] for v in lf["views"]]
for a in range(3):
    assert abs(math.dist(c[a], c[a + 1]) / math.dist(c[a + 4], c[a + 5]) - 1) < 0.05, c
PY

# --- a lens that is adjusted is kept by later runs; the fault of one light field leaves the others' results
"$sst" poses single forest --lens >out 2>err
judge 3 "one picture alone" $? "sst poses single forest"
grep -q "^forest: 5 of 5 views placed" out || fail "after a fault: $(cat out)"
"$sst" poses forest --refine >out 2>err || fail "refine: $(cat err)"
grep -q "5 of 5 views placed" out || fail "refine: $(cat out)"
cp forest/lightfield.json lens.json
"$sst" poses forest --lens >out 2>err || fail "lens: $(cat err)"
"$python" - <<'PY' || failed=1
import json
a, b = (json.load(open(n))["views"][0]["lens"]["k"][0] for n in ("lens.json", "forest/lightfield.json"))
assert a and abs(a - b) < 0.02, (a, b)
PY

# --- without the other program, which is found by PATH
PATH=/nowhere "$sst" poses forest --with colmap >out 2>err
judge 5 "no program .colmap." $? "--with colmap"
[ -z "$(find forest -name '*colmap*')" ] || fail "--with colmap: leaves $(find forest -name '*colmap*')"
exit $failed
