#!/usr/bin/env bash
# `sst render` and `sst sweep` on a simulated scene with its true maps, and wishes that must be refused.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
set -u
. "$(dirname "$0")/../lib.sh"

"$sst" scene bush --size 160x120 -o world || exit 1
"$sst" import folder world/views --grid 6x6 --disparity world/truth --labels world/truth -o lf >/dev/null || exit 1
focus=$(sed -n 's/^  "focus_px": \([0-9.]*\).*/\1/p' world/truth/truth.json | head -n 1)

# --- the same bytes for any number of threads and on any CPU level ---
"$sst" render lf --focus "$focus" -o a.png || fail "render"
"$sst" render lf --focus "$focus" --threads 1 -o b.png || fail "one thread"
SST_CPU=ref "$sst" render lf --focus "$focus" --threads 3 -o c.png || fail "references"
cmp -s a.png b.png && cmp -s a.png c.png || fail "threads or CPU level change the picture"

# --- the focus and the ends of a sweep are found by itself ---
for option in "" "--focus auto" "--method refocus"; do
  "$sst" render lf $option -o auto.png --json >auto.json || fail "render $option"
  python3 -c 'import json, sys
r = json.load(open("auto.json"))
assert r["focus_found"] is True and abs(r["focus_px"] - float(sys.argv[1])) < 0.5, r' "$focus" || fail "focus found"
done
"$sst" render lf -o auto.png | grep -q 'focus [0-9.]* px per spacing, found by itself' || fail "the focus is not reported"
"$sst" sweep lf --steps 2 -o whole --json | grep -q '"from_px": [0-9]' || fail "sweep over all disparities"
"$sst" sweep lf --over view-x --steps 2 -o sides || fail "sweep over all viewpoints"
grep -q '"view_x": -2' sides/sweep.json || fail "sides/sweep.json"
"$sst" scene cat --size 200x150 -o nogap.lf && "$sst" import folder nogap.lf/views --grid 6x6 --disparity nogap.lf/truth \
  -o nogap >/dev/null || fail "scene without a gap"
"$sst" render nogap --method clear -o nogap.png --json >nogap.json 2>err || fail "clear without a gap: $(cat err)"
grep -q '"cut_px": null' nogap.json && grep -q 'nothing is removed' err || fail "clear without a gap: $(cat nogap.json err)"

# --- weights that are all alike are plain refocusing, to the byte ---
"$sst" render lf --focus "$focus" --method refocus -o plain.png || fail "refocus"
"$sst" render lf --focus "$focus" --sigma inf --c2 1 -o limit.png || fail "limit"
cmp -s plain.png limit.png || fail "sigma inf, c2 1 is not plain refocusing"
cmp -s plain.png a.png && fail "see-through is plain refocusing"

# --- given maps are trusted, unless rays are to be verified all the same ---
"$sst" render lf --focus "$focus" --verify-rays off -o off.png --json | grep -q '"verify_rays": "off"' || fail "off"
cmp -s a.png off.png || fail "given maps are verified"
"$sst" render lf --focus "$focus" --verify-rays on -o on.png || fail "on"
"$sst" render lf --focus "$focus" --verify-rays on --threads 1 -o b.png || fail "on, one thread"
SST_CPU=ref "$sst" render lf --focus "$focus" --verify-rays on --threads 3 -o c.png || fail "on, references"
cmp -s a.png on.png && fail "--verify-rays on makes no difference"
cmp -s on.png b.png && cmp -s on.png c.png || fail "threads or CPU level change the verified picture"

# --- options, report, explanation ---
"$sst" render lf --focus "$focus" --label Pedestrian --range minmax --aperture 2 --soft --view-x 0.5 -o d.jpg --json \
  | grep -q '"label": "Pedestrian"' || fail "json"
"$sst" render lf --focus "$focus" --f-stop 2 --max-views 9 --repeat 3 -o d.jpg | grep -q 'median of 3' || fail "repeat"
"$sst" render lf --focus "$focus" --explain why --explain-pixel 100,70 -o d.jpg || fail "explain"
for f in disparity labels weight_depth weight_label weight rays; do [ -s why/$f.png ] || fail "why/$f.png"; done
grep -q '"share"' why/explain.json || fail "why/explain.json"

# --- sweep ---
"$sst" sweep lf --from "$focus" --to 12 --steps 3 --bounce -o frames || fail "sweep"
[ "$(ls frames)" = "$(printf '0000.png\n0001.png\n0002.png\n0003.png\nsweep.json')" ] || fail "frames: $(ls frames)"
cmp -s frames/0001.png frames/0003.png || fail "the way back differs"
cmp -s frames/0000.png a.png || fail "the first frame is not the picture"
if "$sst" version --json | grep -q '"libavformat": true'; then
  "$sst" sweep lf --from 6 --to 12 --steps 4 -o sweep.mp4 || fail "video"
  [ "$(dd if=sweep.mp4 bs=1 skip=4 count=4 2>/dev/null)" = ftyp ] || fail "sweep.mp4 is no MP4"
  # FFmpeg's libraries that cannot be opened.
  mkdir lost
  echo nonsense >"lost/$(ldd "${sst%/*}/libsst-video.so" | grep -o 'libavformat\.so\.[0-9]*' | head -n 1)"
  LD_LIBRARY_PATH=$PWD/lost want 5 'video needs libavformat: cannot load libsst-video.so' sweep lf --from 6 --to 12 --steps 4 -o bad.mp4
  [ ! -e bad.mp4 ] || fail "a video without an encoder"
else
  want 5 "libavformat" sweep lf --from 6 --to 12 --steps 4 -o bad.mp4
fi

# --- clear: all in focus, without the object in front ---
"$sst" render lf --method clear --valid seen.png -o clear.png --json >clear.json || fail "clear"
grep -q '"cut_px": [0-9]' clear.json && grep -q '"filled_percent"' clear.json || fail "clear --json: $(cat clear.json)"
cut=$(sed -n 's/.*"cut_px": \([0-9.]*\).*/\1/p' clear.json)
"$sst" render lf --method clear --cut "$cut" --valid seen2.png -o b.png --threads 1 || fail "clear --cut"
cmp -s clear.png b.png && cmp -s seen.png seen2.png || fail "the cut found, given, or threads change the clear picture"
SST_CPU=ref "$sst" render lf --method clear -o c.png --threads 3 || fail "clear, references"
cmp -s clear.png c.png || fail "the CPU level changes the clear picture"
"$sst" render lf --method clear --remove-label Tree --view-x 0.5 --view-y -0.25 -o d.png || fail "clear by label"
"$sst" render lf --method clear --remove-at 100,100 -o d.png || fail "clear by object"
"$sst" render lf --method clear --explain whyclear --explain-pixel 100,70 -o d.png || fail "clear --explain"
grep -q '"cut_px"' whyclear/explain.json && [ -s whyclear/rays.png ] || fail "whyclear"
"$sst" sweep lf --method clear --over view-x --from -1 --to 1 --steps 3 -o around || fail "sweep over the viewpoint"
cmp -s around/0001.png clear.png || fail "the middle of the sweep is not the clear picture"
grep -q '"view_x": -1' around/sweep.json || fail "around/sweep.json"
"$sst" sweep lf --method clear --from "$cut" --to 20 --steps 2 -o cuts || fail "sweep over the cut"
cmp -s cuts/0000.png clear.png || fail "the first cut is not the clear picture"
"$sst" sweep lf --over view-y --focus "$focus" --from 0 --to 1 --steps 2 -o rise || fail "sweep over the viewpoint, in focus"
cmp -s rise/0000.png a.png || fail "the first viewpoint is not the picture"

# --- refusals ---
want 2 "clear" render lf --focus "$focus" --cut 20 -o bad.png
want 2 "focus" render lf --method clear --focus "$focus" -o bad.png
want 2 "removes everything" render lf --method clear --cut 0 -o bad.png
want 2 "outside the views" render lf --method clear --view-x 4 -o bad.png
want 2 "X,Y" render lf --method clear --remove-at 5 -o bad.png
want 2 "outside the picture" render lf --method clear --remove-at 200,5 -o bad.png
want 2 "4294967306,5 is outside the picture" render lf --method clear --remove-at 4294967306,5 -o bad.png
want 2 "does not occur" render lf --method clear --remove-label Dog -o bad.png
want 2 ".png" render lf --method clear --valid seen.jpg -o bad.png
want 2 "no effect" sweep lf --over cut --from 1 --to 2 -o bad
want 2 "unknown --over" sweep lf --over all --from 1 --to 2 -o bad
want 2 "together" sweep lf --from 1 -o bad
want 2 "outside the disparities" render lf --focus 900 -o bad.png
want 2 "outside the disparities" sweep lf --from "$focus" --to 900 --steps 3 -o bad
want 2 "Pedestrian" render lf --focus "$focus" --label Dog -o bad.png
want 2 "off, on or auto" render lf --focus "$focus" --verify-rays maybe -o bad.png
want 2 "neither" render lf --focus "$focus" -o bad.gif
want 2 "sigma" render lf --focus "$focus" --sigma -1 -o bad.png
want 2 "same value" render lf --focus "$focus" --aperture 1 --f-stop 2 -o bad.png
want 2 "outside the picture" render lf --focus "$focus" --explain bad --explain-pixel 200,0 -o bad.png
want 3 "sst process" render world --focus "$focus" -o bad.png
want 3 "sst process" render world --method refocus -o bad.png
want 3 "sst process" render world -o bad.png
want 3 "no such folder" render missing --focus "$focus" -o bad.png
want 4 "nowhere" render lf --focus "$focus" -o nowhere/bad.png
want 4 "force" sweep lf --from 6 --to 12 --steps 2 -o frames
"$sst" import folder world/views --grid 6x6 --disparity world/truth -o plain >/dev/null || fail "import"
want 3 "no labels" render plain --focus "$focus" --label Pedestrian -o bad.png

[ "$failed" -eq 0 ] && echo "all passed"
exit "$failed"
