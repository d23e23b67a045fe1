#!/usr/bin/env bash
# --device: networks on Mesa's software device against the CPU's, on 8 bits and on floats: labels, features, what ends on the CPU,
# variants of shaders. Without lavapipe it fails.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
set -u
. "$(dirname "$0")/../lib.sh"
. "$root/tests/lavapipe.sh"
need onednn
validate

"$sst" scene bush --size 160x120 --grid 1x2 -o world || exit 1

# alike WHAT LABELS LABELS1 [PROBABILITIES PROBABILITIES1]: one label in a thousand may differ
cat >alike.py <<'END'
import sys
import numpy
from PIL import Image
a, b = (numpy.asarray(Image.open(f)) for f in sys.argv[2:4])
p, q = (numpy.load(f) for f in sys.argv[4:6]) if sys.argv[4:] else (numpy.zeros(1), numpy.zeros(1))
print(f"{sys.argv[1]}: {(a != b).sum()} labels differ, probabilities by {abs(p - q).max():.2g} at most")
sys.exit(int((a != b).mean() > 1e-3 or abs(p - q).max() > 0.005))
END
alike() { /usr/bin/python3 alike.py "$@" || fail "$1: the labels of lavapipe differ"; }

# --- labels: the network on a device ---
view=world/views/$(ls world/views | head -n 1)
int8="--precision int8" # some processors have floats by default
"$sst" segment "$view" --precision f32 --scale 0.2 -o labels.png || fail "segment on floats"
"$sst" segment "$view" --precision f32 --scale 0.2 -o labels1.png --device lavapipe || fail "segment on floats on lavapipe"
alike "on floats" labels.png labels1.png
"$sst" segment "$view" $int8 --scale 0.3 -o labels.png --prob prob.npy || fail "segment"
"$sst" segment "$view" $int8 --scale 0.3 -o labels1.png --prob prob1.npy --device lavapipe --json >labels.json 2>err || fail "segment on lavapipe: $(cat err)"
[ ! -s err ] || fail "segment on lavapipe: $(cat err)"
device labels.json 'd["runs"] == 1 and d["on_cpu"] == 0 and d["failures"] == 0 and d["why_cpu"] is None and d["plans"] == 1 and d["memory_bytes"] > 0'
alike "on 8 bits" labels.png labels1.png prob.npy prob1.npy
"$sst" segment "$view" $int8 "$view.copy" --scale 0.3 -o labels2 --device dummy 2>/dev/null && fail "segment of a missing file"
cmp -s labels1.png labels2/$(basename "$view") || fail "the labels of two devices differ"
"$sst" segment "$view" $int8 --scale 0.3 -o labels3.png --device dummy:lost=210 --json >lost.json 2>err || fail "segment, lost: $(cat err)"
cmp -s labels.png labels3.png || fail "segment, lost: other labels than the CPU's"
grep -q "1 of 1 runs of a network were on the CPU instead of dummy: the device is lost" err || fail "segment, lost: $(cat err)"
device lost.json "d['runs'] == 0 and d['on_cpu'] == 1 and d['failures'] == 1 and 'lost' in d['why_cpu']"
"$sst" segment "$view" $int8 --scale 0.3 -o labels4.png --device dummy --device-memory 1 --json >small.json 2>err || fail "segment in 1 MiB: $(cat err)"
cmp -s labels.png labels4.png || fail "segment in 1 MiB: other labels than the CPU's"
device small.json "d['runs'] == 0 and d['on_cpu'] == 1 and d['failures'] == 0 and 'does not fit' in d['why_cpu']"
# variants of convolutions on 8 bits: the same labels
for variant in plain:net_conv8 dot:net_conv8_dot; do
  SST_GPU_VARIANT=${variant%:*} "$sst" segment "$view" $int8 --scale 0.3 -o variant.png --device lavapipe --json >variant.json 2>err ||
    fail "segment, $variant: $(cat err)"
  cmp -s labels1.png variant.png || fail "segment, $variant: other labels"
  device variant.json "d['conv8'] == '${variant#*:}' and d['runs'] == 1"
done
"$sst" segment "$view" $int8 --scale 0.3 -o variant.png --device dummy:dot=1,wrong=300 --json >variant.json 2>err || fail "segment, a wrong variant"
grep -q 'the shader `net_conv8_dot` is refused' err || fail "segment, a wrong variant: $(cat err)"
cmp -s labels1.png variant.png || fail "segment, a wrong variant: other labels"
device variant.json "d['conv8'] == 'net_conv8' and d['on_cpu'] == 0"
SST_GPU_VARIANT=dots "$sst" segment "$view" $int8 --scale 0.3 -o variant.png --device dummy 2>&1 | grep -q 'unknown SST_GPU_VARIANT=dots' ||
  fail "segment, an unknown variant"
want 3 'no device `GeForce`' segment "$view" --device GeForce -o bad.png
"$sst" scene bush --size 96x72 --grid 1x2 -o two || exit 1
views=(two/views/*)
"$sst" stereo "${views[0]}" "${views[1]}" -m 8 --cost mccnn -o pair.pfm || fail "stereo"
"$sst" stereo "${views[0]}" "${views[1]}" -m 8 --cost mccnn --device lavapipe -o pair1.pfm 2>err || fail "stereo on lavapipe: $(cat err)"
[ ! -s err ] || fail "stereo on lavapipe: $(cat err)"
/usr/bin/python3 -c '
import sys, numpy
a, b = (numpy.frombuffer(open(f, "rb").read()[-96 * 72 * 4:], "<f4") for f in sys.argv[1:])
print(f"disparities: {(a != b).sum()} differ")
sys.exit(int((abs(a - b) > 0.5).mean() > 1e-3))' pair.pfm pair1.pfm || fail "stereo on lavapipe: other disparities"
want 2 'only the features' stereo "${views[0]}" "${views[1]}" -m 8 --cost census --device lavapipe -o bad.pfm
exit $failed
