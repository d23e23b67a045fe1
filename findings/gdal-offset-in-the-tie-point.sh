#!/usr/bin/env bash
# GDAL 3.6.2: scale and offset of a band (gdal_translate -a_scale, -a_offset) are items of the TIFF's GDAL_METADATA (tag 42112), unless the file has a
# vertical reference: then that tag is not written, and they are the third number of ModelPixelScale (33550) and the sixth of ModelTiepoint
# (33922) alone. A reader of the metadata, which takes two numbers of the one and the place of the other, has all heights off by the offset.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
. "$(dirname "$0")/../scripts/finding.sh"
# shellcheck disable=SC2046
unpack gdal-bin=3.6.2+dfsg-1+b2 libgdal32=3.6.2+dfsg-1+b2 gdal-data=3.6.2+dfsg-1 $(needed_by gdal-bin)
export GDAL_DATA=$root/usr/share/gdal
[ ! -e "$root/usr/share/proj/proj.db" ] || export PROJ_LIB=$root/usr/share/proj
printf 'ncols 3\nnrows 2\nxllcorner 448000\nyllcorner 5349800\ncellsize 2\n1 2 3\n4 5 6\n' >grid.asc
tags() {
  gdal_translate -q -ot Int16 -a_srs "$1" -a_scale 0.5 -a_offset 400 grid.asc grid.tif
  python3 - "$1" <<'PY'
import struct, sys
data = open("grid.tif", "rb").read()
at = struct.unpack_from("<I", data, 4)[0]
found = {}
for i in range(struct.unpack_from("<H", data, at)[0]):
    tag, kind, n, place = struct.unpack_from("<HHII", data, at + 2 + 12 * i)
    if kind == 12:
        found[tag] = list(struct.unpack_from(f"<{n}d", data, place))
    if tag == 42112:
        found[tag] = data[place:place + n].decode()
print(f"{sys.argv[1]}: metadata {'with' if 'offset' in found.get(42112, '') else 'without'} an offset, "
      f"scale {found[33550][2]:g}, tie point {found[33922][5]:g}")
PY
}
{ tags EPSG:25833; tags EPSG:25833+7837; } | tee seen
printf '%s\n' 'EPSG:25833: metadata with an offset, scale 0, tie point 0' 'EPSG:25833+7837: metadata without an offset, scale 0.5, tie point 400' >expected
holds "with a vertical reference, scale and offset are in the scale and the tie point alone" cmp -s seen expected
# Seen: these two lines
