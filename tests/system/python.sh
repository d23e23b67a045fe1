#!/usr/bin/env bash
# Readers for others: python3-sst and libsst-read against `sst export npz`, recordings, a service that is not ours, and damaged files.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
set -u
. "$(dirname "$0")/../lib.sh"
build=$root/${SST_BUILD:-build}
python=${PYTHON:-/usr/bin/python3}
"$python" -c 'import numpy, PIL' 2>/dev/null || skip "python3-numpy or python3-pil is absent"
export PYTHONPATH=$root/python PYTHONDONTWRITEBYTECODE=1
ok() { "$@" >out 2>err || fail "$*: $(head -c 600 err)"; }

# --- light fields of every kind ---
ok "$sst" scene bush -o bush.lf --size 160x120 --grid 2x2
ok "$sst" process bush.lf --preset preview
ok "$sst" scene flight -o flight.lf --size 96x80 --grid 1x4
ok "$sst" scene forest -o forest.lf --size 96x80 --grid 1x3 --unplaced
ok "$sst" scene bush -o raw.lf --size 160x128 --grid 3x3
printf 'scene: bush\ngrid: [3, 3]\nsize: [160, 128]\nstrip: false\nmounting: {rotation_spread_deg: 0.3}\noptics: {distortion: [-0.05, 0.01, 0, 0, 0]}\n' >world.yaml
ok "$build/sst-sim" --parameters calib.yaml --world world.yaml
ok "$sst" rectify raw.lf --calib calib.yaml -o calibrated.lf
ok "$python" "$root/tests/python/readers.py" "$sst" lightfields,calibration,damage,png
rm -rf bad*

# --- npz: equal bytes, whole or not at all, never over its own input ---
ok "$sst" export npz bush.lf -o once.npz
ok "$sst" export npz bush.lf -o twice.npz --threads 1
cmp -s once.npz twice.npz || fail "two exports differ"
ok "$sst" export npz bush.lf -o maps.npz --maps
"$python" -c 'import numpy; z = numpy.load("maps.npz"); assert "views" not in z.files and "disparity" in z.files' || fail "--maps"
want 4 "exists already" export npz bush.lf -o once.npz
want 2 "would be replaced" export npz bush.lf -o bush.lf/views/00_00.png --force
want 3 "not a light field" export npz nowhere -o bad.npz
"$sst" export npz bush.lf -o bad.npz --focal-px 9 2>err && fail "--focal-px is accepted"
cp -r bush.lf changed.lf && printf x >>changed.lf/views/01_01.png
want 3 "SHA-256" export npz changed.lf -o bad.npz

# --- recordings ---
writer=$build/tests/tools/record_writer
if [ -x "$writer" ] && "$sst" version --json | grep -q '"libavformat": true'; then
  for f in MJPG GREY Y16 YUYV RGGB GRBG GBRG BA81; do
    jpeg=0; [ $f = MJPG ] && jpeg=1
    ok "$writer" write rec-$f cameras=4 width=38 height=26 format=$f jpeg=$jpeg holes=0 sets=4 segment_s=0.2 exact=1
    ok "$sst" import recording rec-$f -o set-$f --sets 2
  done
  ok "$writer" write rec-parts cameras=3 width=88 height=50 jpeg=1 parts=1 holes=0 sets=5 segment_s=0.2
  ok "$sst" import recording rec-parts -o set-parts --sets 3
  ok "$writer" write rec-holes cameras=4 width=38 height=26 format=GREY holes=1 sets=12 exact=1
  ok "$python" "$root/tests/python/readers.py" "$sst" recordings
fi

# --- the API ---
"$python" "$root/tests/fake_service.py" "$tmp/s" port 2>fake.err &
fake=$!
trap 'kill $fake; wait $fake; rm -rf "$tmp"' EXIT
for _ in $(seq 1200); do [ -S s ] && [ -s port ] && break; sleep 0.05; done
ok "$python" "$root/tests/python/readers.py" "$sst" client "$tmp/s" port

# --- a notebook, small ---
PATH=$(dirname "$sst"):$PATH SST_NOTEBOOK_SCENE="--size 120x90 --grid 2x2" SST_NOTEBOOK_PRESET=preview ok "$python" "$root/python/notebooks/run.py" \
  --check 'stack.shape == (4, 90, 120) and wrong < 0.9' "$root/python/notebooks/maps.ipynb"
for n in recording live; do ok "$python" "$root/python/notebooks/run.py" --list "$root/python/notebooks/$n.ipynb"; done

# --- the library; tests/system/unit.sh installs it ---
library=$(echo "$build"/libsst-read.so.0.*)
[ -e "$library" ] || skip "libsst-read is not in this build"
nm -D --defined-only "$library" | awk '{ print $NF }' | sort | diff - "$root/read/symbols.txt" >out || fail "the symbols of libsst-read changed: $(cat out)"
export LD_LIBRARY_PATH=$build
ok gcc -std=c11 -pedantic -Wall -Wextra -Werror -I"$root/read" "$root/read/example.c" -L"$build" -lsst-read -lm -o example
printf '#include <sst/read.h>\nint main() { return sst_read_error()[0]; }\n' >plus.cc
ok g++ -pedantic -Wall -Wextra -Werror -I"$root/read" plus.cc -L"$build" -lsst-read -o plus && ok ./plus
for lf in bush flight calibrated; do
  ok ./example $lf.lf $lf.ppm
  [ "$(wc -l <out)" -ge 4 ] || fail "example on $lf.lf: $(cat out)"
done
ok "$python" -c '
import numpy as np, sst
from PIL import Image
for name in ("bush", "calibrated"):
    z = np.load(name + ".lf.npz")
    assert (np.array(Image.open(name + ".ppm")) == z["views"][z["reference"]]).all(), name'
./example nowhere x.ppm 2>err && fail "the example reads nothing"
grep -q "nowhere is not a light field" err || fail "the example: $(cat err)"
[ "$failed" -eq 0 ] || exit 1
