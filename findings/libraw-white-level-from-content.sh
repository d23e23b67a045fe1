#!/usr/bin/env bash
# LibRaw 0.20.2 (and 0.21.4): the brightest sample of a picture replaces the white level of the file once it is above three quarters of
# it (`adjust_maximum_thr`, 0.75), also with `no_auto_bright` and the camera's white balance. Pictures of one camera, equally exposed,
# differ by up to a third in linear light as soon as one shows a bright spot. `adjust_maximum_thr = 0` turns it off.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
. "$(dirname "$0")/../scripts/finding.sh"
unpack libraw20=0.20.2-2.1+deb12u2 libraw-dev=0.20.2-2.1+deb12u2 liblcms2-2 libjpeg62-turbo
cp "$here/develop.c" . && compile develop -lraw_r
echo "WhiteLevel 4095, all samples 1000 and a patch of V: a pixel outside the patch"
for v in 1000 3071 3072 3500 4095; do
  /usr/bin/python3 "$here/dng.py" v.dng 1000 $v $v $v
  echo "V $v: $(./develop v.dng)"
done | tee seen
holds "the pixel depends on V, from three quarters of the white level on" \
  awk '{ v[$2] = $3 } END { exit !(v["3071:"] == v["1000:"] && v["3072:"] > v["1000:"] + 10 && v["3500:"] > v["1000:"] + 5 && v["4095:"] == v["1000:"]) }' seen
# Seen: V 1000: 136 136 136, V 3071: 136 136 136, V 3072: 155 155 155, V 3500: 146 146 146, V 4095: 136 136 136
