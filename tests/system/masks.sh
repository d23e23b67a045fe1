#!/usr/bin/env bash
# Privacy masks in the service: black regions in pictures, streams, recordings, exports, videos and
# see-through pictures; a reload moves them; without its masks nothing is captured. Also in sst capture array and sst identify.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
. "$(dirname "$0")/../lib.sh"
need libcurl
/usr/bin/python3 -c 'import PIL' 2>/dev/null || skip "no PIL for /usr/bin/python3 (python3-pil)"
. "$root/tests/service_lib.sh"
log=sstd.log
printf 'scene: cat\ngrid: [2, 2]\nsize: [160, 128]\nstrip: false\n' >small.yaml

port=$((10000 + $$ % 20000))
# write_config MASKS...: the array, with these masks
write_config() {
  cat >sstd.yaml <<YAML
array: {rows: 2, cols: 2}
cameras:
  width: 160
  height: 128
  check_frozen: false
  controls: {trigger_mode: 1, auto_exposure: 1, exposure_time_absolute: 50}
trigger: {source: gpio, chip: sst-trigger, lines: [TRIG0, TRIG1], loopback: LOOP0, rate_hz: 10}
control: {socket: $tmp/c.sock, group: ""}
web: {port: 0, token_file: $tmp/token}
storage: {dir: $tmp/store, ring_mb: 16, preroll_s: 5, min_free_gb: 0}
live: {method: refocus}
rtsp: {enabled: true, port: $port, codec: h264}
privacy: {masks: [$1]}
YAML
}
rtsp=
# black FILE X0 Y0 X1 Y1: the picture is black there, and nowhere else as a whole (a margin of 17 px between)
black() {
  /usr/bin/python3 - "$@" <<'PY'
import sys
from PIL import Image
im = Image.open(sys.argv[1]).convert("L")
x0, y0, x1, y1 = map(int, sys.argv[2:])
worst = max(im.crop((x0 + 1, y0 + 1, x1 - 1, y1 - 1)).getdata())
rest = [im.getpixel((x, y)) for y in range(im.height) for x in range(im.width)
        if not (x0 - 17 <= x < x1 + 17 and y0 - 17 <= y < y1 + 17)]
sys.exit(f"{sys.argv[1]}: {worst} in the mask" if worst > 6 else f"{sys.argv[1]}: black outside" if rest and max(rest) < 40 else 0)
PY
}
is_black() { black "$@" 2>err || fail "$(cat err)"; }
awaits() { "$root/tests/until.sh" "$@"; }
get() { awaits "curl -sf -m 10 --unix-socket c.sock -o '$2' 'http://x$1' && [ -s '$2' ]" || fail "$1"; }

# Refusals of wrong masks name the fault.
refused() { write_config "$1"; "$build/sstd" --check --config sstd.yaml 2>err; [ $? -eq 78 ] && grep -q "$2" err || fail "$1: $(cat err)"; }
refused '{name: a, x0: 0.5}' 'needs near_px'
refused '{name: a, row: 1}' 'both row and col'
refused '{name: a, row: 1, col: 2}' 'beyond the rows'
refused '{name: a, row: 0, col: 0, near_px: 4}' 'has a depth'
refused '{name: a, row: 0, col: 0, x0: 0.5, x1: 0.4}' 'x0'
refused '{name: a, row: 0, col: 0, points: "0,0 1,1"}' 'two points'
refused '{name: a, row: 0, col: 0}, {name: a, row: 0, col: 1}' 'two masks named a'

# The right half of every camera, by the reference view; and the lower left of one.
write_config '{name: garden, x0: 0.6, near_px: 4}, {name: window, row: 1, col: 1, x0: 0.1, y0: 0.75, x1: 0.3, y1: 0.95}'
# One that cannot be placed: nothing is captured, with the reason.
sed "s|^live:.*|live: {method: refocus, calibration: $tmp/none.yaml}|" sstd.yaml >unplaced.yaml
"$build/sst-sim" --quiet --world small.yaml -- sh -c 'echo $$ >pid; exec "$0" "$@"' "$build/sstd" --config unplaced.yaml >sstd.log 2>&1 &
sim=$!
trap 'kill -9 $daemon $rtsp 2>/dev/null; kill $sim 2>/dev/null && ended $sim "the simulator"; rm -rf "$tmp"' EXIT
written pid
daemon=$(cat pid)
until_is 30 reason '"none.yaml" in v'
[ "$(value capture.sets)" = 0 ] || fail "sets without their masks"
kill $daemon
wait $sim

"$build/sst-sim" --quiet --world small.yaml -- sh -c 'echo $$ >pid2; exec "$0" "$@"' "$build/sstd" --config sstd.yaml >sstd.log 2>&1 &
sim=$!
written pid2
daemon=$(cat pid2)
until_is 60 live.ready 'v'
until_is 10 capture.privacy 'v["masks"] == 2 and v["cameras"] == 4 and v["withheld"] == 0'
right="112 0 160 128" # all of the region, in every camera
for c in r0c0 r0c1 r1c0 r1c1; do
  get /snapshot/camera/$c $c.jpg
  is_black $c.jpg $right
done
is_black r1c1.jpg 18 98 46 120
black r1c0.jpg 18 98 46 120 2>/dev/null && fail "the mask of one camera is in another's frames"
get /snapshot/main main.jpg
is_black main.jpg $right
[ "$(curl -sf --unix-socket c.sock http://x/api/v1/cameras | /usr/bin/python3 -c 'import json, sys; print(sum(c["masked"] > 0.25 for c in json.load(sys.stdin)["cameras"]))')" = 4 ] || fail "shares"
get /api/v1/masks masks.json
/usr/bin/python3 -c 'import json
garden, window = json.load(open("masks.json"))["masks"]
assert garden == {"name": "garden", "row": None, "col": None, "points": [[0.6, 0], [1, 0], [1, 1], [0.6, 1]], "near_px": 4, "far_px": 0}, garden
assert (window["row"], window["col"], window["near_px"], len(window["points"])) == (1, 1, None, 4), window' || fail "masks for the page"
"$sst" status >out && grep -Eq '^  masks +2; black: r0c0 [0-9]+ %, .*r1c1 [0-9]+ %$' out || fail "status: $(cat out)"
# Streams are made of the same pictures: the first of each.
for s in /stream /stream/camera/r1c1; do
  timeout 20 curl -s -m 5 --unix-socket c.sock "http://x$s" 2>/dev/null | head -c 60000 >stream
  /usr/bin/python3 -c 'import sys
b = open("stream", "rb").read()
i = b.index(b"\xff\xd8")
open("first.jpg", "wb").write(b[i:b.index(b"\r\n--", i)])' && is_black first.jpg $right || fail "$s: no picture"
done

# Storage: the recording's frames, a light field of it, its videos.
name=$("$sst" record start) || fail "record start: $name"
until_is 20 storage.recording.sets 'v >= 8'
awaits "'$sst' record list --json | /usr/bin/python3 -c \"import json, sys
sys.exit(not any(r['name'] == '$name' and r['view'] for r in json.load(sys.stdin)['recordings']))\"" || fail "no view in $name"
"$sst" record stop >/dev/null || fail "record stop"
until_is 20 storage.recording.active 'not v'
"$sst" recording store/recordings/"$name" --verify >out || fail "verify: $(cat out)"
"$sst" import recording store/recordings/"$name" -o lf --sets 3 >out 2>&1 || fail "import: $(cat out)"
for v in lf/views/*; do is_black "$v" $right; done
! grep -qaE 'Exif|JFXX' lf/views/00_00.jpg || fail "application segments in a masked frame"
for video in "" --camera=r1c1; do
  "$sst" record download "$name" $video -o v.mkv >/dev/null 2>err || fail "download: $(cat err)"
  if command -v ffmpeg >/dev/null; then
    ffmpeg -v error -y -i v.mkv -frames:v 1 v.png </dev/null && is_black v.png $right
  fi
  rm -f v.mkv
done

at=$(curl -sf --unix-socket c.sock http://x/api/v1/recordings | /usr/bin/python3 -c 'import json, sys; print(json.load(sys.stdin)["recordings"][0]["from"])')
"$sst" record export --time "$at" -o then.tar >out 2>&1 && mkdir then && tar xf then.tar -C then || fail "export: $(cat out)"
for v in then/*/views/*; do is_black "$v" $right; done
# RTSP and ONVIF, which leads to the same stream.
if [ -x "$build/sst-rtsp" ] && command -v ffmpeg >/dev/null; then
  "$build/sst-rtsp" --config sstd.yaml 2>rtsp.log & rtsp=$!
  for s in main camera/r1c1; do
    awaits "timeout 20 ffmpeg -nostdin -v error -y -rtsp_transport tcp -i rtsp://127.0.0.1:$port/$s -frames:v 1 rtsp.png 2>err" && is_black rtsp.png $right || fail "RTSP of $s: $(cat err rtsp.log)"
  done
  kill $rtsp
  ended $rtsp sst-rtsp
fi

# A reload moves them; sets of before, without the new one, are in no recording's pre-roll, and no picture of them is shown.
write_config '{name: sky, row: 0, col: 0, y1: 0.25}'
"$sst" reload >out || fail "reload: $(cat out)"
until_is 20 capture.privacy 'v["masks"] == 1 and v["cameras"] == 1'
name=$("$sst" record start) || fail "record start: $name"
until_is 20 storage.recording.sets 'v >= 3'
"$sst" record stop >/dev/null || fail "record stop"
until_is 20 storage.recording.active 'not v'
"$sst" import recording store/recordings/"$name" -o lf3 --sets 0 >out 2>&1 || fail "import: $(cat out)"
is_black lf3/views/00_00.jpg 0 0 160 32
until_is 20 capture.rate_hz 'v > 3'
awaits "curl -sf -m 10 --unix-socket c.sock -o sky.jpg http://x/snapshot/camera/r0c0 && [ \$(/usr/bin/python3 -c '
from PIL import Image
im = Image.open(\"sky.jpg\").convert(\"L\")
print(int(max(im.crop((0, 0, 160, 30)).getdata()) < 7 and max(im.crop((112, 48, 160, 128)).getdata()) > 40))') = 1 ]" || fail "the mask is not moved"
kill $daemon
wait $sim
daemon=

# Other programs that store frames.
"$build/sst-sim" --quiet --world small.yaml -- "$sst" capture array --config sstd.yaml -o shot --sets 2 >out 2>&1 || fail "capture array: $(cat out)"
"$sst" import recording shot -o lf2 --sets 0 >out 2>&1 && is_black lf2/views/00_00.jpg 0 0 160 32 || fail "capture array: $(cat out)"
"$build/sst-sim" --quiet --world small.yaml -- "$sst" identify --json --config sstd.yaml -o faces >out 2>&1 || fail "identify: $(cat out)"
is_black "$(/usr/bin/python3 -c 'import json; print([c["picture"] for c in json.load(open("out"))["cameras"] if (c["row"], c["col"]) == (0, 0)][0])')" 0 0 160 32
exit $failed
