#!/usr/bin/env bash
# sst segment as a user meets it: one image, many, folders, strips, and images that are damaged.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
set -u
cd "$(dirname "$0")/../.." || exit 1
sst=$PWD/${SST_BUILD:-build}/sst
models=$PWD/models
tmp=$(mktemp -d)
trap 'rm -rf "$tmp"' EXIT
cd "$tmp" || exit 1
export SST_MODELS=${SST_MODELS:-$models}

fail() { echo "FAIL: $*"; exit 1; }
ok() { "$sst" "$@" >out 2>err || fail "sst $*: exit $?: $(cat err)"; [ ! -s err ] || fail "sst $*: said: $(cat err)"; }
want() { # want CODE WORDS ARGS...
  local code=$1 words=$2
  shift 2
  "$sst" "$@" >out 2>err
  local rc=$?
  [ $rc -eq "$code" ] || fail "sst $*: exit $rc, not $code: $(cat err)"
  grep -q "$words" err || fail "sst $*: does not say '$words': $(cat err)"
}

"$sst" segment --help >help || fail "help"
"$sst" version --json | grep -q '"onednn": *false' && { echo "this build has no oneDNN"; exit 77; }
ok scene bush -o lf --size 200x150 --grid 2x2
a=lf/views/00_00.png

# --- one image and several: the same labels, one file each ---
ok segment $a -o one.png
ok segment $a lf/views/01_01.png -o many --prob prob --entropy entropy --json
cmp one.png many/00_00.png || fail "labels differ between one image and several"
[ "$(ls many)" = "$(printf '00_00.png\n01_01.png')" ] && [ -e prob/01_01.npy ] && [ -e entropy/00_00.pfm ] || fail "files"
python3 - out one.png <<'PY' || fail "the summary"
import json, sys

report = json.load(open(sys.argv[1]))
assert [i["image"] for i in report["images"]] == ["lf/views/00_00.png", "lf/views/01_01.png"]
for image in report["images"]:
    assert (image["width"], image["height"]) == (200, 150) and image["ms"] > 0
    assert abs(sum(image["percent"].values()) - 100) < 1e-3 and "Tree" in image["percent"]
PY

# --- 8 bits by default without VNNI; AVX-512 without it has floats ---
if grep -qw avx2 /proc/cpuinfo; then
  for run in AVX2: AVX2:int8 AVX512_CORE: AVX512_CORE:f32; do
    precision=${run#*:}
    ONEDNN_MAX_CPU_ISA=${run%:*} ok segment $a --scale 0.5 -o l.png --prob "p$run.npy" ${precision:+--precision "$precision"}
  done
  cmp pAVX2:.npy pAVX2:int8.npy || fail "AVX2: not on 8 bits"
  ! grep -qw avx512bw /proc/cpuinfo || cmp pAVX512_CORE:.npy pAVX512_CORE:f32.npy || fail "AVX-512 without VNNI: not on floats"
fi

python3 - prob/00_00.npy <<'PY' || fail "probabilities do not sum to 1"
import array, sys

data = open(sys.argv[1], "rb").read()
start, n = 10 + int.from_bytes(data[8:10], "little"), 150 * 200
assert b"150, 200" in data[:start]
p = array.array("f", data[start:])
assert len(p) % n == 0 and min(p) >= 0 and all(abs(sum(p[i::n]) - 1) < 1e-5 for i in range(0, n, 97))
PY
ok segment lf/views -o folder
[ "$(ls folder | wc -l)" -eq 4 ] || fail "a folder of 4 views gave $(ls folder | wc -l) maps"
cmp one.png folder/00_00.png || fail "labels differ between an image and its folder"

# --- windows and scales, threads ---
for options in "--scale 2 --tiles" "--scale 0.5"; do
  ok segment $a -o s1.png $options --threads 1
  ok segment $a -o s2.png $options --threads 2
  cmp s1.png s2.png || fail "$options: labels differ between 1 and 2 threads"
done
for cpu in ref base; do
  SST_CPU=$cpu ok segment $a -o s2.png --scale 0.5 --entropy $cpu.pfm
  cmp s1.png s2.png || fail "SST_CPU=$cpu: other labels"
  cmp ref.pfm $cpu.pfm || fail "SST_CPU=$cpu: another entropy"
done

[ "${SST_CPU-}" != avx2 ] || exit 0 # all else is the same on every processor

# --- strips ---
python3 - <<'PY'
import struct, zlib

def png(name, w, h):
    chunk = lambda t, d: struct.pack(">I", len(d)) + t + d + struct.pack(">I", zlib.crc32(t + d))
    rows = b"".join(b"\0" + bytes((x * 7 + y * 13) % 256 for x in range(3 * w)) for y in range(h))
    open(name, "wb").write(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", w, h, 8, 2, 0, 0, 0)) +
                           chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b""))

png("wide.png", 3000, 40)
png("tall.png", 40, 3000)
png("line.png", 20000, 1)
png("dot.png", 1, 1)
PY
ok segment wide.png tall.png line.png dot.png -o strips
ok segment tall.png -o strips --tiles --scale 2

# --- photographs that a turned camera took ---
/usr/bin/python3 - $a <<'PY' || fail "no turned pictures"
import os, sys
from PIL import Image, ImageOps

up, undo = Image.open(sys.argv[1]).convert("RGB"), {6: 8, 8: 6}
os.mkdir("turned")
os.mkdir("mixed")
for o in range(1, 9):
    exif = Image.Exif()
    exif[0x112] = undo.get(o, o)
    stored = Image.Image()
    up.save("x.png", exif=exif)
    stored = ImageOps.exif_transpose(Image.open("x.png"))
    exif = Image.Exif()
    exif[0x112] = o
    stored.save(f"turned/{o}.png", exif=exif)
    if o in (1, 2, 4):
        stored.save(f"mixed/00_0{o // 2}.png", exif=exif)
PY
ok segment turned -o upright
for o in 1 2 3 4 5 6 7 8; do cmp -s upright/$o.png one.png || fail "orientation $o: other labels than of the upright picture"; done
"$sst" import folder mixed --grid 1x3 -o field --range-min 2 --range-max 12 2>err >/dev/null || fail "import of mixed orientations: $(cat err)"
[ "$(grep -c "EXIF orientation" err)" -eq 1 ] && grep -q "00_01.png: 2, 00_02.png: 4" err || fail "mixed orientations: $(cat err)"
for f in mixed/*; do cmp -s $f field/views/$(basename $f) || fail "$f: its stored pixels are not kept"; done
rm mixed/00_0[02].png
cp mixed/00_01.png mixed/00_00.png
"$sst" import folder mixed --grid 1x2 -o alike --range-min 2 --range-max 12 2>err >/dev/null || fail "import of one orientation: $(cat err)"
[ "$(grep -c "EXIF orientation" err)" -eq 1 ] && grep -q "all pictures have the EXIF orientation 2" err || fail "one orientation: $(cat err)"

# --- refusals ---
want 2 "twice" segment $a lf/truth/00_00.png -o many
want 2 "scale" segment $a -o one.png --scale big
want 2 "scale" segment $a -o one.png --scale 17
want 2 "output\|-o" segment $a
mkdir empty
want 3 "no PNG" segment empty -o many
cp -r lf/views damaged
truncate -s 300 damaged/00_01.png
want 3 "00_01.png" segment damaged -o rest --json
[ "$(ls rest | wc -l)" -eq 3 ] || fail "a damaged image stopped the others"
grep -q '"error"' out || fail "the summary does not name the damaged image"
want 4 "one.png" segment lf/views -o one.png
