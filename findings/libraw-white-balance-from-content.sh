#!/usr/bin/env bash
# LibRaw 0.20.2 (and 0.21.4): a DNG without AsShotNeutral, which is optional, gets a white balance measured in the picture although
# `use_camera_wb` is set and `use_auto_wb` is not; nothing reports it. Grey becomes coloured by what is elsewhere in the
# picture, so views of one scene get different colours. `use_camera_wb = 0` for such files takes the matrix's daylight.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
. "$(dirname "$0")/../scripts/finding.sh"
unpack libraw20=0.20.2-2.1+deb12u2 libraw-dev=0.20.2-2.1+deb12u2 liblcms2-2 libjpeg62-turbo
cp "$here/develop.c" . && compile develop -lraw_r
echo "all samples 1000 and a patch of red, green and blue: a pixel outside the patch"
for patch in "1000 1000 1000" "2500 1000 500" "400 1500 2500"; do
  for tag in "" no-neutral; do
    /usr/bin/python3 "$here/dng.py" p.dng 1000 $patch $tag
    echo "patch ${patch// /,} ${tag:-with-neutral}: $(./develop p.dng)"
  done
done | tee seen
holds "without AsShotNeutral the balance is that of the content" \
  awk '/with-/ && $4 + $5 + $6 != 3 * $4 { bad = 1 } /no-/ { n[$4 " " $5 " " $6]++ } END { for (i in n) k++; exit bad || k != 3 }' seen
# Seen: with AsShotNeutral 136 136 136 in all; without it 136 136 136, 136 157 167 and 169 149 136
