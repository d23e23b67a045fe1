#!/usr/bin/env bash
# `sst recording` and `sst import recording`, the files in other programs, and a disk that is full or read-only.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
set -u
. "$(dirname "$0")/../lib.sh"
writer=$root/${SST_BUILD:-build}/tests/tools/record_writer
[ -x "$writer" ] || skip "$writer is not built; make tests"
need libavformat
record() { timeout 600 "$writer" write "$@" >/dev/null 2>err || fail "record $*: $(cat err)"; }
json() { python3 -c "import json, sys; o = json.load(open('$1')) if '$1' != '-' else json.load(sys.stdin); print($2)"; }

# --- pictures of six cameras, twelve sets in three segments ---
six="cameras=6 width=64 height=48"
# shellcheck disable=SC2086
record full $six jpeg=1 holes=0 sets=12 segment_s=0.5
for f in recording.json sets.jsonl segments/000000.mkv segments/000002.mkv; do [ -s full/$f ] || fail "no full/$f"; done
line=$("$sst" recording full --verify | sed -n 2p)
[[ $line == "sets      12 in 1 runs, 12 complete, 0 with missing or bad frames,"* ]] || fail "printed: $line"
"$sst" recording full --json >info.json || fail "info"
is=$(json info.json 'o["sets"], o["complete"], round(o["median_hz"], 6), o["gaps"], o["skew_us"]["max"], o["damaged"], o["tracks"][5]["serial"]')
[ "$is" = "12 12 10.0 0 3.999 0 S005" ] || fail "info: $is"

# Frames stamped by their arrival, and stamps later than that, are findings.
cp -r full stamps
python3 - <<'PY' || fail "stamps"
import json, zlib
lines = open("stamps/sets.jsonl").read().splitlines()
for i, line in enumerate(lines):
    s = json.loads(line)
    if "frames" in s and s["set"] in (3, 4):
        s["frames"][1][8] += 512
        s["frames"][2][4] = -190_000_000_000
        body = json.dumps({k: v for k, v in s.items() if k != "crc"}, separators=(",", ":"))[:-1]
        lines[i] = '%s,"crc":"%08x"}' % (body, zlib.crc32(body.encode()))
open("stamps/sets.jsonl", "w").write("\n".join(lines) + "\n")
PY
"$sst" recording stamps >line || fail "stamps: $(cat line)"
grep -q '^arrival .* r00 c01 S001: 2$' line && grep -q '^clock .* r00 c02 S002: 2$' line || fail "stamps: $(cat line)"
[ "$("$sst" recording stamps --json | json - '[(t["by_arrival"], t["after_arrival"]) for t in o["tracks"]][:3]')" = "[(0, 0), (2, 0), (0, 2)]" ] || fail "stamps"

# --- one set: the camera's bytes, and where they came from ---
"$sst" import recording full -o lf --sets 7 >line || fail "import"
[[ $(cat line) == "lf: 6 views of 64x48, grid 1x6, offsets x -2.000..3.000, y 0.000..0.000"* ]] || fail "printed: $(cat line)"
python3 - <<'PY' || fail "the views are not the bytes that were recorded"
import json, zlib
line = [l for l in open("full/sets.jsonl") if l.startswith('{"set"')][7]
body, crc = line.rstrip("\n")[:-18], line.rstrip("\n")[-10:-2]
assert zlib.crc32(body.encode()) == int(crc, 16), "checksum of the line"
assert open("lf/set.json").read() == line.rstrip("\n")
columns = json.load(open("full/recording.json"))["frame_columns"]
data = open("full/segments/000001.mkv", "rb").read()
for row in json.loads(line)["frames"]:
    f = dict(zip(columns, row))
    jpeg = data[f["offset"]:f["offset"] + f["bytes"]]
    assert jpeg[:2] == b"\xff\xd8" and zlib.crc32(jpeg) == f["crc32"], f
    assert open(f"lf/views/00_{f['cam']:02d}.jpg", "rb").read() == jpeg, f
# A finished segment says its size and has cues.
at = data.index(b"\x18\x53\x80\x67")
assert at + 12 + int.from_bytes(data[at + 4:at + 12], "big") - (1 << 56) == len(data) and b"\x1c\x53\xbb\x6b" in data
lf = json.load(open("lf/lightfield.json"))
assert lf["spacing_mm"] == 40, lf
for word in ("set 7", "trigger 7 of run 0", "2023-11-14T22:13:20.700Z", "edge of the trigger", "skew 3.999 us", "6 of 6 views"):
    assert word in lf["source"], (word, lf["source"])
PY
"$sst" import recording full -o some --sets 0,10-11,5 --range-min 1 --range-max 9 >line || fail "import of some"
[ "$(cat line)" = "some: 4 light fields, some/set-000000 to some/set-000011" ] || fail "printed: $(cat line)"
[ "$(ls some | tr '\n' ' ')" = "set-000000 set-000005 set-000010 set-000011 sets.json " ] || fail "made: $(ls some)"
cmp -s lf/views/00_03.jpg some/set-000005/views/00_03.jpg && fail "set 5 is set 7"
"$sst" import recording full -o some --sets all --force >/dev/null || fail "import of all, again"
[ "$(find some -name lightfield.json | wc -l)" = 12 ] || fail "all are not 12"
"$sst" import recording full -o last --sets last >/dev/null && cmp -s last/views/00_00.jpg some/set-000011/views/00_00.jpg || fail "last"
# A campaign takes its sets one by one. Noise has no depth: there is nothing to see through, and the pieces fail alone.
"$sst" batch full -o campaign --preset preview --no-labels --steps 0 --every 6 >line 2>err
"$sst" batch full -o campaign --every 6 --status >status || fail "status of the campaign"
[ "$(grep -c ' full-0000\(00\|06\)' status)" = 2 ] || fail "pieces: $(cat status)"
want 2 "12 sets; choose with" import recording full -o bad
want 2 "sets 0 to 11" import recording full -o bad --sets 3,12
for s in x 3- -4 5-3 1,,2 1, "1 2" ""; do want 2 "not a list" import recording full -o bad --sets "$s"; done
want 2 "has its own grid" import recording full -o bad --sets 1 --grid 6x6
want 2 "belong to the format recording" import hci full -o bad --sets 1
want 3 "not a recording" import recording lf -o bad
want 3 "not a recording" recording nothing
want 4 "exists already" import recording full -o lf --sets 1
want 2 "would be replaced" import recording full -o full --sets 1 --force

# --- sets with missing views, and damage ---
# shellcheck disable=SC2086
record holes $six jpeg=1 sets=40
python3 - <<'PY' >numbers || fail "no partial set"
import json
sets = [json.loads(l) for l in open("holes/sets.jsonl") if l.startswith('{"set"')]
partial = [i for i, s in enumerate(sets) if len(s["missing"]) == 1 and s["missing"][0] != 2]
print(partial[0], sets[partial[0]]["missing"][0], sum(1 for s in sets if s["missing"]), sum(len(s["missing"]) for s in sets))
PY
read -r set cam partial missing <numbers
is=$("$sst" recording holes --json | json - 'o["partial"], sum(t["missing"] for t in o["tracks"])')
[ "$is" = "$partial $missing" ] || fail "partial sets and missing frames: $is, not $partial $missing"
want 3 "lacks 1 of 6 views: 00_0$cam (missing); .*--allow-partial" import recording holes -o bad --sets "$set"
"$sst" import recording holes -o hole --sets "$set" --allow-partial >line 2>err || fail "a partial set"
grep -q "warning: set $set lacks 1 of 6" err || fail "no warning: $(cat err)"
[ "$(ls hole/views | wc -l)" = 5 ] && [ ! -e "hole/views/00_0$cam.jpg" ] || fail "views of a partial set: $(ls hole/views)"
python3 - <<'PY'
import json
s = [json.loads(l) for l in open("full/sets.jsonl") if l.startswith('{"set"')][3]
with open("full/segments/000000.mkv", "r+b") as f:
    f.seek(s["frames"][4][5] + 9)
    f.write(b"\0\1\2")
PY
"$sst" recording full --verify >info 2>err && fail "damage passes"
grep -q "set 3: camera r00 c04" info && grep -q "^damage    1 sets$" info || fail "damage: $(cat info)"
want 3 "00_04 (damaged on the disk)" import recording full -o bad --sets 3
"$sst" import recording full -o hurt --sets 3 --allow-partial >/dev/null 2>&1 && [ ! -e hurt/views/00_04.jpg ] || fail "a damaged view"

# A segment cut short and an emptied index are seen without reading the frames.
cp -r holes short && truncate -s -20000 short/segments/"$(ls short/segments | tail -1)"
"$sst" recording holes >info || fail "damage in a whole recording: $(cat info)"
"$sst" recording short >info 2>&1 && fail "a segment cut short passes"
grep -q "^damage    [1-9]" info || fail "a segment cut short: $(cat info)"
[ "$("$sst" recording short --json 2>/dev/null | json - 'o["partial"] >= 0 and o["complete"] + o["partial"] + o["damaged"] == o["sets"]')" = True ] || fail "sets of a segment cut short: $(cat info)"
cp -r holes fewer && sed -i '6,$d' fewer/sets.jsonl
"$sst" recording fewer >info 2>&1 && fail "an index that lost its last lines passes"
grep -q "^unlisted  [1-9].*restore it" info || fail "an index that lost its last lines: $(cat info)"
# One line that is lost between others, and the one of a whole set beside a segment's line.
for n in 4 5 9; do
  rm -rf fewer && cp -r full fewer && sed -i "${n}d" fewer/sets.jsonl
  "$sst" recording fewer >info 2>&1 && fail "an index that lost line $n passes: $(sed -n "${n}p" full/sets.jsonl | head -c 60)"
done
cp -r holes empty && : >empty/sets.jsonl
"$sst" recording empty >info 2>&1 && fail "an emptied index passes"
grep -q "^unlisted  [1-9].*restore it" info || fail "an emptied index: $(cat info)"

# --- raw formats ---
for format in GREY Y16 YUYV RGGB BA81 GRBG GBRG; do
  # shellcheck disable=SC2086
  record raw-$format $six format=$format holes=0 sets=2
  "$sst" import recording raw-$format -o lf-$format --sets first >/dev/null || fail "import of $format"
  file lf-$format/views/00_05.png 2>/dev/null | grep -q "64 x 48" || [ -z "$(command -v file)" ] || fail "$format: no PNG"
done
python3 - <<'PY' || fail "grey values changed"
import json
try:
    import numpy, PIL.Image
except ImportError:
    raise SystemExit(0)
for name, dtype in (("GREY", "u1"), ("Y16", "<u2")):
    s = [json.loads(l) for l in open(f"raw-{name}/sets.jsonl") if l.startswith('{"set"')][0]
    f = s["frames"][5]
    raw = open(f"raw-{name}/segments/000000.mkv", "rb").read()[f[5]:f[5] + f[6]]
    png = numpy.asarray(PIL.Image.open(f"lf-{name}/views/00_05.png"))
    assert (png.astype("u2") == numpy.frombuffer(raw, dtype).reshape(48, 64)).all(), name
PY

# --- other people's programs ---
if command -v ffprobe >/dev/null && command -v ffmpeg >/dev/null; then
  probe() { ffprobe -v error -select_streams 5 -show_entries "$1" -of csv=p=0 "$2" 2>&1; }
  is=$(probe stream=codec_name,width,height:stream_tags=title full/segments/000001.mkv | tr '\n' ' ')
  [ "$is" = "mjpeg,64,48,r00 c05 S005 " ] || fail "ffprobe: $is"
  is=$(probe packet=pts_time full/segments/000001.mkv | tr '\n' ' ')
  [ "$is" = "0.000000 0.100000 0.200000 0.300000 0.400000 " ] || fail "ffprobe: times $is"
  [ "$(probe format=duration full/segments/000001.mkv | cut -c1-3)" = 0.5 ] || fail "ffprobe: $(probe format=duration full/segments/000001.mkv)"
  ffmpeg -v error -i full/segments/000001.mkv -map 0:5 -c copy -frames:v 1 -f image2 one.jpg </dev/null 2>err ||
    fail "ffmpeg: $(cat err)"
  cmp -s one.jpg some/set-000005/views/00_05.jpg || fail "ffmpeg takes other bytes out"
  # To a place in the middle by the index that a finished segment has.
  ffmpeg -v error -ss 0.3 -i full/segments/000001.mkv -map 0:5 -c copy -frames:v 1 -f image2 seek.jpg </dev/null 2>err ||
    fail "ffmpeg -ss: $(cat err)"
  cmp -s seek.jpg some/set-000008/views/00_05.jpg || fail "ffmpeg -ss finds another frame"
  for format in GREY:gray Y16:gray16le YUYV:yuyv422 RGGB:bayer_rggb8 BA81:bayer_bggr8 GRBG:bayer_grbg8 GBRG:bayer_gbrg8; do
    is=$(probe stream=codec_name,pix_fmt raw-${format%:*}/segments/000000.mkv)
    [ "$is" = "rawvideo,${format#*:}" ] || fail "ffprobe: $format is $is"
  done
fi

# --- a disk of 3 MB that is full, then has room, then is read-only ---
if unshare -rm true 2>/dev/null; then
  mkdir disk
  cat >script <<'EOS'
mount -t tmpfs -o size=3m none disk || exit 77
head -c 2000000 /dev/zero >disk/ballast
timeout 600 "$1" write disk/rec cameras=6 bytes=20000 exact=1 holes=0 sets=60 stay=1 sync=0.01 >said 2>full.err &
for ((i = 0; i < 3000; i++)); do grep -qs stopped full.err && break; sleep 0.02; done
sleep 0.2
rm disk/ballast
wait $! || echo "the writer failed"
"$2" recording disk/rec --verify --json >full.json || echo "damage after a full disk"
df --output=used disk >/dev/null
mount -o remount,ro none disk || echo "cannot be remounted" # without `none`, not by an ordinary user
timeout 60 "$1" write disk/rec cameras=6 bytes=20000 append=1 2>ro.err && echo "writes on a read-only disk"
timeout 60 "$1" write disk/rec2 cameras=6 bytes=20000 2>ro2.err && echo "begins on a read-only disk"
exit 0
EOS
  out=$(unshare -rm bash script "$writer" "$sst" 2>&1)
  rc=$?
  if [ $rc = 0 ]; then
    [ -z "$out" ] || fail "full disk: $out"
    [ "$(grep -c "has stopped: No space left on device; free space there" full.err)" -ge 1 ] || fail "full disk: $(cat full.err)"
    [ "$(grep -c "resumed with segment" full.err)" -ge 1 ] || fail "does not resume: $(cat full.err)"
    [ "$(wc -l <full.err)" -le 6 ] || fail "a full disk is told too often: $(cat full.err)"
    is=$(json full.json 'o["damaged"], o["complete"] == o["sets"] and o["sets"] >= 12, o["torn_bytes"]')
    [ "$is" = "0 True 0" ] || fail "after a full disk: $is"
    [ "$(json full.json 'o["sets"]')" = "$(wc -l <said)" ] || fail "sets that were taken are not those that are there"
    grep -q "Read-only file system" ro.err && grep -q "Read-only file system" ro2.err || fail "read-only: $(cat ro.err ro2.err)"
    [ "$(wc -l <ro.err)" = 1 ] || fail "read-only: $(cat ro.err)"
  else
    echo "no tmpfs in a user namespace: the full disk is tested by unit/recording only"
  fi
else
  echo "no user namespaces: the full disk is tested by unit/recording only"
fi
# A limit on the size of files is an end of space like any other; the next file is below it.
(ulimit -f 400; trap '' XFSZ; timeout 600 "$writer" write limit cameras=6 bytes=20000 exact=1 holes=0 sets=12 stay=1 >said 2>err)
is=$("$sst" recording limit --verify --json | json - 'o["sets"], o["damaged"]')
[ "$is" = "$(wc -l <said) 0" ] && [ "$(wc -l <said)" -ge 8 ] && [ -e limit/segments/000002.mkv ] || fail "file-size limit: $is, $(cat err)"
exit $failed
