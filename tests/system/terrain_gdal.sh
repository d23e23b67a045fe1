#!/usr/bin/env bash
# Terrain as GDAL writes it: tiles, compressions, predictors, types, byte orders, areas and points, scaled integers, hemispheres. All give one picture.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
set -u
. "$(dirname "$0")/../lib.sh"
need libtiff
command -v gdal_translate >/dev/null && command -v gdalwarp >/dev/null || skip "gdal_translate is absent (Debian's gdal-bin)"
python=${PYTHON:-/usr/bin/python3}
"$python" -c 'import math' 2>/dev/null || skip "python3 is absent"

"$sst" scene flight -o flight --size 160x128 --grid 1x3 -q >out 2>err || fail "scene: $(cat err)"
# Hills around the flight, at 448087, 5349882 of zone 33N and an altitude of 400 m; a corner is unknown.
"$python" - <<'PY'
import math
with open("hills.asc", "w", encoding="ascii") as f:
    f.write("ncols 48\nnrows 40\nxllcorner 448038\nyllcorner 5349841\ncellsize 2\nNODATA_value -9999\n")
    for j in range(40):
        f.write(" ".join("-9999" if i < 2 and j < 2 else str(round(400 + 4 * math.sin(i / 5) * math.cos(j / 6))) for i in range(48)) + "\n")
PY

# write NAME ARGS...: of the hills by gdal_translate
write() { local name=$1; shift; gdal_translate -q "$@" hills.asc "$name.tif" >out 2>err || fail "gdal_translate $*: $(cat err)"; }
# render NAME ARGS...: into NAME.png and NAME.json
render() {
  local name=$1; shift
  "$sst" render flight -m refocus --surface "$name.tif" -o "$name.png" --json "$@" >"$name.json" 2>err
}

map="-a_srs EPSG:32633"
tiles="-co TILED=YES -co BLOCKXSIZE=32 -co BLOCKYSIZE=16"
write plain $map -ot Float32
render plain || fail "plain: $(cat err)"
"$python" - <<'PY' || failed=1
import json
s = json.load(open("plain.json"))["surface"]
assert abs(s["low_m"] + 4) < 0.01 and abs(s["high_m"] - 4) < 0.01, s
PY
write float3 $map -ot Float32 $tiles -co COMPRESS=DEFLATE -co PREDICTOR=3
write float2 $map -ot Float32 $tiles -co COMPRESS=LZW -co PREDICTOR=2
write short2 $map -ot Int16 -co COMPRESS=DEFLATE -co PREDICTOR=2
write unsigned $map -ot UInt16 -a_nodata 0 $tiles -co COMPRESS=LZW -co PREDICTOR=2
write points $map -ot Float32 -mo AREA_OR_POINT=Point
write big $map -ot Float32 -co BIGTIFF=YES
write order $map -ot Int16 -co ENDIANNESS=BIG
write scaled $map -ot Int16 -scale 396 404 9600 10400 -a_scale 0.01 -a_offset 300 -a_nodata -9999
write heights -a_srs EPSG:25833+7837 -ot Float32
write scaled_heights -a_srs EPSG:25833+7837 -ot Int16 -scale 396 404 9600 10400 -a_scale 0.01 -a_offset 300 -a_nodata -9999
gdalwarp -q -t_srs EPSG:32733 plain.tif south.tif >out 2>err || fail "gdalwarp: $(cat err)"
for name in float3 float2 short2 points big order scaled heights scaled_heights south; do
  render $name || fail "$name: $(cat err)"
  cmp -s plain.png $name.png || fail "$name: another picture than that of plain floats"
done
render unsigned || fail "unsigned: $(cat err)"
write named -ot Float32 -co TFW=YES -co PROFILE=BASELINE
render named --utm 33N || fail "world file: $(cat err)"
cmp -s plain.png named.png || fail "a world file and --utm give another picture"

# bad NAME WORDS: refused in one sentence
bad() {
  render "$1"
  judge 3 "$2" $? "$1.tif"
  [ ! -e "$1.png" ] || fail "$1: a picture was written"
}
write double $map -ot Float64
bad double "gdal_translate -b 1 -ot Float32"
write flat $map -ot Float32 -a_scale 0
bad flat "a scale of 0"
write feet -a_srs EPSG:32633+6360 -ot Float32
bad feet "heights are in another unit than metres"
gdalwarp -q -t_srs EPSG:4326 plain.tif degrees.tif >out 2>err || fail "gdalwarp: $(cat err)"
bad degrees "degrees"
gdalwarp -q -t_srs EPSG:3857 plain.tif web.tif >out 2>err || fail "gdalwarp: $(cat err)"
bad web "EPSG:3857, which is no zone of UTM"
exit $failed
