#!/usr/bin/env bash
# sst eval: a light field with its exact maps is perfect, see-through beats plain refocusing, faults are one sentence.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
set -u
sst=${SST_BUILD:-build}/sst
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$(dirname "$0")/../.." || exit 1

fail() { echo "$*"; exit 1; }

# expect CODE TEXT ARGS...: exit code, one line on standard error that holds TEXT, nothing on standard output
expect() {
  local code=$1 text=$2; shift 2
  "$sst" eval "$@" >"$dir/out" 2>"$dir/err"; local rc=$?
  [ "$rc" -eq "$code" ] || fail "sst eval $*: exit $rc, not $code: $(cat "$dir/err")"
  [ "$(wc -l <"$dir/err")" -eq 1 ] || fail "sst eval $*: not one line: $(cat "$dir/err")"
  grep -q -- "$text" "$dir/err" || fail "sst eval $*: no '$text' in: $(cat "$dir/err")"
  [ -s "$dir/out" ] && fail "sst eval $*: wrote to standard output"
}

"$sst" scene pedestrian -o "$dir/lf" --size 200x150 --grid 5x5 >"$dir/log" 2>&1 || fail "scene: $(cat "$dir/log")"
truth=$dir/lf/truth
"$sst" import folder "$dir/lf/views" --grid 5x5 --disparity "$truth" --labels "$truth" -o "$dir/given" >"$dir/log" 2>&1 ||
  fail "import: $(cat "$dir/log")"
"$sst" eval "$dir/given" --truth "$truth" --json >"$dir/json" || fail "eval --json failed"
"$sst" eval "$dir/given" --truth "$truth" --json --threads 1 >"$dir/json1" || fail "eval --threads 1 failed"
python3 - "$dir/json" "$dir/json1" <<'PY' || exit 1
import json, sys

r, one = (json.load(open(p)) for p in sys.argv[1:])
d, l = r["disparity"], r["labels"]
assert d["bad1"] == 0 and d["bad2"] == 0 and d["density"] == 100 and d["rmse"] < 1 / 128, d
assert d["nonocc"]["bad1"] == 0 and 0 < d["nonocc"]["pixels"] < d["pixels"] == 25 * 200 * 150, d
assert l["miou_initial"] is None and l["miou_hcsm"] is None and l["coverage_hcsm"] is None, l
assert l["miou_refined"] == 100, l
for k in "psnr", "ssim", "psnr_occluded", "ssim_occluded", "psnr_target":
    assert r["render"][k] == r["occluders"][0]["render"][k], k
    assert r["refocus"][k] == r["occluders"][0]["refocus"][k], k
assert r["render"]["psnr_occluded"] > r["refocus"]["psnr_occluded"] + 1, r["render"]
c = r["clear"]
assert c == r["occluders"][0]["clear"] and c["psnr"] > r["render"]["psnr"] + 3, c
assert c["psnr_occluded"] > r["render"]["psnr_occluded"] and 0 <= c["filled_percent"] < 10, c
assert r["occluders"][0]["name"] == "pedestrian" and 0 < r["occluders"][0]["covered"] < 50
for x in r, one:
    for p in [x[k] for x in [x] + x["occluders"] for k in ("render", "refocus", "clear")]:
        p.pop("seconds", None)
assert r == one, "threads change the figures"
PY
"$sst" eval "$dir/given" --truth "$truth" | grep -q "see-through" || fail "the table lacks the see-through row"
"$sst" eval "$dir/given" --truth "$truth" | grep -q "filled %, cut px" || fail "the table lacks the clear picture"
"$sst" eval "$dir/given" --truth "$truth" --sigma inf --c2 1 --json >"$dir/json" || fail "eval --sigma inf failed"
python3 -c '
import json, sys
r = json.load(open(sys.argv[1]))
assert r["render"]["psnr"] == r["refocus"]["psnr"], "no weights must be plain refocusing"' "$dir/json" || exit 1

expect 2 "--truth" "$dir/given"
expect 2 "c1" "$dir/given" --truth "$truth" --c1 2
expect 3 "no such folder" "$dir/given" --truth "$dir/nothing"
expect 3 "not a light field" "$dir/nothing" --truth "$truth"
expect 3 "sst process" "$dir/lf" --truth "$truth"
mkdir "$dir/empty"
expect 3 "no truth" "$dir/given" --truth "$dir/empty"
mv "$truth/occluder_pedestrian.png" "$dir/mask.png"
expect 3 "occluder_pedestrian.png" "$dir/given" --truth "$truth"
mv "$dir/mask.png" "$truth/occluder_pedestrian.png"
head -c 300 "$truth/00_01.pfm" >"$dir/empty/00_01.pfm"
expect 3 "00_01.pfm" "$dir/given" --truth "$dir/empty"
echo "sst eval: ok"
