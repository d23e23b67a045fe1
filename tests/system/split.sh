#!/usr/bin/env bash
# cameras: split: pictures of simulated boards with 2x2 sensors become four cameras each. Their pictures equal the ones of
# cameras on their own, byte by byte; a lost frame is lost for all four; a board of another size is refused.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
. "$(dirname "${BASH_SOURCE[0]}")/../lib.sh"
sim=$root/${SST_BUILD:-build}/sst-sim
[ -x "$sim" ] || skip "sst-sim is not built"
need libavformat

printf 'scene: cat\ngrid: [2, 4]\nsize: [320, 240]\nstrip: false\n' >alone.yaml
{ cat alone.yaml; echo 'split: [2, 2]'; } >boards.yaml
# config FORMAT EXTRA: of an array of these cameras
config() { printf 'array: {rows: 2, cols: 4}\ncameras: {width: 320, height: 240, rate_hz: 10, format: %s%s}\n' "$1" "${2-}"; }
sim() { timeout 600 "$sim" --quiet --cache "$tmp/cache" "$@"; }
for f in MJPEG YUYV RGGB8 Y16; do
  config "$f" >"$f.alone.yaml"
  config "$f" ', split: 2x2' >"$f.yaml"
done
export sst

# The same world as eight cameras and as two boards.
sim --world alone.yaml -- sh -ec 'for f in MJPEG YUYV RGGB8 Y16; do "$sst" capture array --config $f.alone.yaml -n 4 -o $f.alone >/dev/null; done' 2>err || fail "alone: $(cat err)"
sim --world boards.yaml -- sh -ec '
  for f in MJPEG YUYV RGGB8 Y16; do "$sst" capture array --config $f.yaml -n 4 -o $f.boards >/dev/null; done
  "$sst" cameras --local --config MJPEG.yaml >list
  "$sst" plan --config YUYV.yaml --json >plan
  "$sst" identify --config MJPEG.yaml -o seen --write bind.yaml >/dev/null
' 2>err || fail "boards: $(cat err)"
for f in MJPEG YUYV RGGB8 Y16; do
  for k in alone boards; do
    for i in 0 1 2 3; do # a busy machine loses frames
      "$sst" import recording $f.$k --sets $i -o $f.$k.lf >/dev/null 2>err && break
    done
    [ -d $f.$k.lf ] || fail "$f $k: $(cat err)"
  done
  if [ $f = MJPEG ]; then # cut without restart markers: the same picture in other bytes
    for k in alone boards; do "$sst" render $f.$k.lf --method refocus --focus 0 -o $k.png >/dev/null 2>err || fail "render: $(cat err)"; done
    cmp -s alone.png boards.png || fail "JPEGs of boards are other pictures than those of cameras"
  else
    for v in $f.alone.lf/views/*; do
      cmp -s "$v" "$f.boards.lf/views/${v##*/}" || fail "$f: view ${v##*/} of a board is not that of a camera"
    done
  fi
  [ "$(ls $f.boards.lf/views | wc -l)" -eq 8 ] || fail "$f: $(ls $f.boards.lf/views)"
done
grep -q '^r1c1 .*SIM0000#4 ' list && grep -q '^r0c2 .*SIM0001#1 ' list || fail "list: $(cat list)"
grep -q 'row: 1, col: 2, serial: "SIM0001#3"' bind.yaml || fail "identify: $(cat bind.yaml)"
[ "$(ls seen/*#*.png | wc -l)" -eq 8 ] || fail "pictures: $(ls seen)"
/usr/bin/python3 - <<'PY' || fail "plan: $(cat plan)"
import json
p = json.load(open("plan"))
assert len(p["cameras"]) == 2 and p["split"] == "2x2" and p["needed_bytes_s"] == 2 * 640 * 480 * 10, p
PY

# Bound by part, some parts nowhere; the pictures of one board are lost, damaged and held: all its cameras alike, the others whole.
cat >bound.yaml <<'Y'
array: {rows: 2, cols: 4}
cameras:
  width: 320
  height: 240
  rate_hz: 10
  split: 2x2
  bind:
    - {row: 0, col: 0, serial: "SIM0001#4"}
    - {row: 1, col: 0, serial: "SIM0001#1"}
    - {row: 1, col: 3, port: "1-1#2"}
    - {row: 0, col: 3, port: "1-1#3"}
Y
sim --world boards.yaml --fault camera.1.gap=0.4 --fault camera.1.corrupt_mid=0.2 --fault camera.1.error_flag=0.2 --fault camera.0.frozen=1 -- \
  sh -c '"$sst" capture array --config bound.yaml -n 25 -o damaged --json' >out 2>err || fail "damaged: $(cat err)"
/usr/bin/python3 - <<'PY' || fail "account of a damaged board: $(head --config 3000 out)"
import json
a = json.load(open("out"))
cams = {(c["row"], c["col"]): c for c in next(v for v in a.values() if isinstance(v, list))}
assert a["frames"]["unexplained"] == 0 and sum(a["frames"]["buckets"].values()) == a["frames"]["delivered"], a["frames"]
left, right = (cams[0, 0], cams[1, 0]), (cams[1, 3], cams[0, 3])
assert left[0]["serial"] == "SIM0001#4" and right[0]["port"] == "1-1#2", (left, right)
for pair in (left, right):
    assert pair[0]["buckets"] == pair[1]["buckets"] and pair[0]["faults"] == pair[1]["faults"], pair
    assert pair[0]["frames"] == pair[1]["frames"] and pair[0]["lost"] == pair[1]["lost"], pair
assert left[0]["lost"] > 0 and left[0]["buckets"]["corrupt"] + left[0]["buckets"]["flagged"] > 0, left
assert right[0]["buckets"]["corrupt"] == 0 and right[0]["faults"]["frozen"] > 0, right
PY

# A board with pictures of another size: the refusal names a split that fits.
config MJPEG ', split: 1x2' >other.yaml
sim --world boards.yaml -- sh -c '"$sst" capture array --config other.yaml -n 1 -o bad' >out 2>err && fail "another size is taken"
grep -q 'nearest is 640x480.*which is 1x2 cameras of 320x480; set cameras: width, height and split' err || fail "another size: $(cat err)"
exit $failed
