#!/usr/bin/env bash
# From a scene to see-through pictures and back out, as a user goes: scene, process, render, sweep, eval, export, import.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
set -u
cd "$(dirname "$0")/../.." || exit 1
sst=$PWD/${SST_BUILD:-build}/sst
tmp=$(mktemp -d)
trap 'rm -rf "$tmp"' EXIT
cd "$tmp" || exit 1

fail() { echo "FAIL: $*"; exit 1; }

# ok ARGS...: succeeds and has nothing to complain about
ok() { "$sst" "$@" >out 2>err || fail "sst $*: exit $?: $(cat err)"; [ ! -s err ] || fail "sst $*: said: $(cat err)"; }

# same A B: the same files with the same bytes
same() { diff -r "$1" "$2" >/dev/null || fail "$1 differs from $2"; }

ok scene pedestrian -o lf --size 96x72 --grid 3x3 --threads 2
ok scene pedestrian -o lf1 --size 96x72 --grid 3x3 --threads 1
same lf lf1
rm -r lf1

# --- small pictures have few matches: views that are right are not said to have moved ---
for size in 160x120 200x150; do
  for seed in 1 2; do
    ok scene bush -o tiny --size $size --grid 3x3 --seed $seed --force
    "$sst" calibrate --check tiny >out 2>err
    grep -qE '^(OK: no camera is off|.*UNKNOWN: too little texture)' out err || fail "$size, seed $seed: $(cat out err)"
  done
done
rm -r tiny

# --- one process at a time; a lock is left by nobody ---
cp -r lf shared
exec 9<shared
flock -x 9
"$sst" process shared --no-labels >out 2>err && fail "processed what another process works on"
[ "$(cat err)" = "sst: error: shared: another process works on it; wait for its end, or share the work with --shard" ] || fail "said: $(cat err)"
exec 9<&-
"$sst" process shared --no-labels >out 2>err & # until it has the folder
killed=$!
for _ in $(seq 600); do flock -n shared true || break; kill -0 $killed 2>/dev/null || break; sleep 0.01; done
kill -KILL $killed 2>/dev/null
wait $killed 2>/dev/null
ok process shared --no-labels --preset preview
exec 9<shared
flock -s 9 # as other workers do
ok process shared --no-labels --preset preview --shard 1/2
exec 9<&-
rm -r shared

# --- every preset: the same bytes for 1 and 2 threads and for every CPU level, and better than chance ---
runs="1: 2: 2:ref 2:base 2:avx2"
[ -z "${SST_TEST_SMALL-}" ] || runs="1: 2:" # tests/kernels has every level under sanitizers
for preset in preview balanced accurate; do
  for run in $runs; do
    cp -r lf "$preset-$run"
    SST_CPU=${run#*:} ok process "$preset-$run" --labels lf/truth --preset $preset --threads "${run%:*}"
    same "$preset-1:" "$preset-$run"
    [ "$run" = 1: ] || rm -r "$preset-$run"
  done
  mv "$preset-1:" $preset
  for map in disparity confidence labels; do
    [ "$(ls $preset/$map | wc -l)" -eq 9 ] || fail "$preset/$map is incomplete"
  done
  same lf/views $preset/views
  ok eval $preset --truth lf/truth --json
  python3 - $preset out <<'PY' || fail "figures of $preset"
import json, sys

limit = {"preview": 25, "balanced": 8, "accurate": 8}[sys.argv[1]]
r = json.load(open(sys.argv[2]))
d, l = r["disparity"], r["labels"]
assert d["density"] == 100 and d["bad1"] < limit and d["rmse"] < 2, d
assert l["miou_refined"] == 100, l  # given labels are kept
assert r["render"]["psnr_occluded"] > r["refocus"]["psnr_occluded"], r["render"]
PY
done

# --- maps that came with the light field are kept; computed ones are computed again ---
cp -r balanced again
ok process again --preset preview --json
python3 -c 'import json, sys
r = json.load(open(sys.argv[1]))
assert 90 < r["confirmed_percent"] <= 100 and r["searched_px"][0] < r["focus_px"] < r["searched_px"][1]' out ||
  fail "confirmed_percent, focus_px: $(cat out)"
same balanced/labels again/labels
same preview/disparity again/disparity
grep -q disparity_tested balanced/lightfield.json && fail "maps of a range that needs no second pass are marked as tested"
ok scene bush -o wide --size 300x225 --grid 3x3
for preset in balanced preview; do
  ok process wide --labels wide/truth --preset $preset
  grep -c '"disparity_tested": true' wide/lightfield.json >>tested
done
[ "$(tr '\n' ' ' <tested)" = "1 0 " ] || fail "marked as tested in balanced, preview: $(cat tested)"

# --- views that do not belong ---
cp -r wide doubled
cp doubled/views/01_02.png doubled/views/01_01.png
"$sst" process doubled --no-labels --no-verify --preset preview --json >out 2>err || fail "a doubled view was refused"
grep -q 'not plausible: the view of row 1, column [12] shows the same picture as that of row 1, column [12]' err ||
  fail "a doubled view: $(cat err)"
python3 -c 'import json, sys
a = json.load(open(sys.argv[1])); b = json.load(open(sys.argv[2]))
assert a["plausible"] is b["plausible"] is False and a["implausible"] == b["implausible"] != ""
assert [v["fault"] for v in a["views"] if not v["plausible"]].count("doubled") == 1
assert a["align"]["mode"] == "auto" and a["levels"] is None' out doubled/lightfield.json || fail "a doubled view in JSON: $(cat out)"
"$sst" process wide --align maybe >out 2>err && fail "--align maybe is accepted"
grep -q "auto or off" err || fail "--align maybe: $(cat err)"
ok process again --disparity lf/truth
[ ! -e again/confidence ] || fail "the confidence of replaced disparities is still there"
cp -r again kept
ok process kept --preset accurate
same again/disparity kept/disparity
ok process again --no-labels --json
python3 -c 'import json, sys; assert json.load(open(sys.argv[1]))["searched_px"] == [0, 0]' out &&
  python3 -c 'import json, sys; assert json.load(open(sys.argv[1]))["confirmed_percent"] is None' out ||
  fail "given maps were matched"
cp -r lf bare
ok process bare --no-labels --range-min -1 --range-max 8
[ ! -e bare/labels ] || fail "--no-labels made labels"

# --- pictures ---
for threads in 1 2; do
  ok render balanced --focus 4.5 --threads $threads -o r$threads.png
  ok render balanced --focus 4.5 --label Car --threads $threads -o l$threads.png
  ok render balanced --focus 4.5 --method refocus --threads $threads -o f$threads.png
  ok render balanced --focus 4.5 --threads $threads -o r$threads.jpg
  ok sweep balanced --from 2 --to 6 --steps 3 --threads $threads -o sweep$threads
  ok stereo lf/views/01_01.png lf/views/01_02.png -m 12 --threads $threads -o d$threads.pfm
  ok stereo lf/views/01_01.png lf/views/01_02.png -m 12 --threads $threads -o d$threads.png
done
same r1.png r2.png; same l1.png l2.png; same f1.png f2.png; same r1.jpg r2.jpg; same d1.pfm d2.pfm; same d1.png d2.png
same sweep1 sweep2
cmp -s r1.png f1.png && fail "seeing through makes no difference"
SST_CPU=ref ok render balanced --focus 4.5 -o ref.png
same r1.png ref.png
ok sweep balanced --from 2 --to 2 --steps 1 -o one
ok render balanced --focus 2 -o two.png
same one/0000.png two.png
ok sweep balanced --from 1 --to 3 --steps 2 --force -o one
[ ! -e one/0002.png ] && [ -e one/0001.png ] || fail "--force did not replace the sweep"
cmp -s one/0000.png two.png && fail "--force kept the old sweep"

# --- out and in again ---
for format in stanford hci; do
  ok export $format balanced -o $format
  ok import $format $format -o $format.lf
  for view in 00_00 01_01 02_02; do
    cmp -s balanced/views/$view.* $format.lf/views/$view.* || fail "$format changed view $view"
  done
  ok process $format.lf --no-labels --range-min 0 --range-max 8
done
ok import folder lf/views --grid 3x3 --disparity lf/truth --labels lf/truth -o given
ok process given
ok eval given --truth lf/truth --json
python3 -c '
import json, sys
r = json.load(open(sys.argv[1]))
assert r["disparity"]["bad05"] == 0 and r["labels"]["miou_refined"] == 100, r' out || fail "given maps are not kept"

# --- odd arrays and sizes ---
for size in 1x1 1x9 17x5 64x1; do
  for grid in 1x2 2x1 3x3; do
    rm -rf odd odd.png
    ok scene pedestrian -o odd --size $size --grid $grid # a bush has ever more leaves beside so small a picture
    ok process odd --labels odd/truth --preset preview
    ok process odd --labels odd/truth
    ok render odd --focus 0 -o odd.png
  done
done
rm -rf odd
ok scene cell -o odd --size 64x48 --grid 1x1
ok render odd --focus 3 --method refocus -o odd.png --force

[ -z "$(find . -name '*.tmp-*' -o -name '.maps*')" ] || fail "temporary files are left"
echo "from scenes to pictures: ok"
