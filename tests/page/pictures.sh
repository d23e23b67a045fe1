#!/usr/bin/env bash
# pictures.sh SST SCENE WxH STEPS OUT: real pictures for tests/page/fake.py: a simulated scene seen through (sst_NN.jpg) and
# plainly refocused (refocus_NN.jpg) at STEPS focuses from far to near, clear at as many cuts (clear_NN.jpg; not at the farthest,
# which remove everything), its maps, and the views of all cameras.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
set -eu
sst=$1 scene=$2 size=$3 steps=$4 out=$5
tmp=$(mktemp -d)
trap 'rm -rf "$tmp"' EXIT

"$sst" scene "$scene" --size "$size" -o "$tmp/world" -q
"$sst" import folder "$tmp/world/views" --grid 6x6 --disparity "$tmp/world/truth" --labels "$tmp/world/truth" \
  -o "$tmp/lf" -q >/dev/null
mkdir -p "$out"
cp "$tmp/world/truth/truth.json" "$tmp/world/truth/02_02.pfm" "$tmp/world/truth/02_02.png" "$out"
range=$(/usr/bin/python3 -c 'import json, sys; print(*json.load(open(sys.argv[1]))["range_px"])' "$out/truth.json")
read -r far near <<<"$range"
for method in sst refocus; do
  "$sst" sweep "$tmp/lf" --from "$far" --to "$near" --steps "$steps" --method "$method" -o "$tmp/$method" -q >/dev/null
done
"$sst" sweep "$tmp/lf" --from "$far" --to "$near" --steps "$steps" --method refocus -o "$out/clip.mp4" -q >/dev/null
cut=$(/usr/bin/python3 -c 'import sys; far, near = map(float, sys.argv[1:]); print(far + 0.2 * (near - far))' "$far" "$near")
"$sst" sweep "$tmp/lf" --from "$cut" --to "$near" --steps "$steps" --method clear -o "$tmp/clear" -q >/dev/null
"$sst" render "$tmp/lf" --focus "$far" --explain "$tmp/why" -o "$tmp/far.png" -q >/dev/null
/usr/bin/python3 - "$tmp" "$out" <<'PY'
import glob
import json
import os
import struct
import sys
from PIL import Image

tmp, out = sys.argv[1:]
for method in ("sst", "refocus", "clear"):
    for i, name in enumerate(sorted(glob.glob(f"{tmp}/{method}/*.png"))):
        Image.open(name).convert("RGB").save(f"{out}/{method}_{i:02d}.jpg", quality=88)
view = Image.open(glob.glob(f"{tmp}/lf/views/02_02.*")[0]).convert("RGB")
labels = Image.open(f"{tmp}/why/labels.png").convert("RGB")
Image.blend(view, labels, 160 / 256).save(f"{out}/labels.jpg", quality=90)

# far to near, as the service draws disparities
stops = [bytes.fromhex(c) for c in ("3b0d53", "343987", "0068a8", "0098ae", "00c09a", "8bdd74", "f9ed52")]
table = []
for i in range(256):
    at = i / 255 * (len(stops) - 1)
    k = min(int(at), len(stops) - 2)
    table += [round(a + (b - a) * (at - k)) for a, b in zip(stops[k], stops[k + 1])]
far, near = json.load(open(f"{out}/truth.json"))["range_px"]
count = view.width * view.height
values = struct.unpack(f"<{count}f", open(f"{out}/02_02.pfm", "rb").read()[-4 * count:])
image = Image.frombytes("P", view.size, bytes(min(max(round((v - far) / (near - far) * 255), 0), 255) for v in values))
image.putpalette(table)
image.transpose(Image.FLIP_TOP_BOTTOM).convert("RGB").save(f"{out}/disparity.jpg", quality=90)
for name in sorted(glob.glob(f"{tmp}/lf/views/*")):
    row, col = os.path.basename(name)[:5].split("_")
    Image.open(name).convert("RGB").resize((320, 240)).save(f"{out}/camera_r{int(row)}c{int(col)}.jpg", quality=80)
PY
