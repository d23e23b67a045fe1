#!/usr/bin/env bash
# Notebooks whole, on simulated cameras, and python3-sst on public light fields below SHARED (docs/design/test-data.md), if they are there.
# check.sh [SHARED]; tests/system/python.sh is the part of `make check`.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
set -u
shared=${1-}
. "$(dirname "$0")/../lib.sh"
build=$root/${SST_BUILD:-build}
python=${PYTHON:-/usr/bin/python3}
export PYTHONPATH=$root/python PYTHONDONTWRITEBYTECODE=1 PATH=$build:$PATH
run() { "$python" "$root/python/notebooks/run.py" "$@" >out 2>err || fail "$*: $(tail -c 800 err)"; grep -E 'dB$|lines of code$|^off by|^confirmed' out; }

# The clear picture against the scene without its bush: a camera alone is at 13 dB.
ok() { "$sst" "$@" >out 2>err || fail "sst $*: $(tail -c 400 err)"; }
ok scene bush -o bush.lf --size 320x240
TRUTH=$tmp/bush.lf run --lines 15 --check \
  '[print(f"{d:.1f} dB") or d > 22 for t in [sst.open(__import__("os").environ["TRUTH"]).truth.behind()] for d in [10 * np.log10(65025 / np.mean((clear - t.astype(float)) ** 2))]][0]' \
  "$root/python/notebooks/recording.ipynb"
run --check 'wrong < 0.1 and wrong_confirmed < wrong_others' "$root/python/notebooks/maps.ipynb"
run --check 'picture.image.shape == (240, 320, 3) and status["capture"]["present"] == 36 and service.returncode is not None' "$root/python/notebooks/live.ipynb"

# Mutated files.
rm -rf bush.lf
ok scene bush -o bush.lf --size 96x80 --grid 2x2
ok process bush.lf --preset preview
ok scene flight -o flight.lf --size 96x80 --grid 1x4
"$build/sst-sim" --parameters calib.yaml --world "$root/python/notebooks/world.yaml" >/dev/null 2>err || fail "parameters: $(cat err)"
if [ -x "$build/tests/tools/record_writer" ]; then
  "$build/tests/tools/record_writer" write rec-parts cameras=3 width=88 height=50 jpeg=1 parts=1 holes=0 sets=5 >/dev/null || fail "rec-parts"
  "$python" "$root/tests/python/mutate.py" "${FUZZ_SECONDS:-20}" 2>err || fail "mutations: $(cat err)"
fi

# Public light fields, in both formats that they come in.
for d in "$shared"/lf-*; do
  [ -d "$d" ] || continue
  name=$(basename "$d")
  if ls "$d"/input_Cam* >/dev/null 2>&1; then ok import hci "$d" -o $name.lf
  elif ls "$d"/*_-[0-9]*_*.* >/dev/null 2>&1 || ls "$d"/out_* >/dev/null 2>&1; then ok import stanford "$d" -o $name.lf
  else ok import folder "$d" --grid 6x6 -o $name.lf; fi
  "$python" - "$sst" "$name.lf" 2>err <<'PY' || fail "$name: $(tail -c 600 err)"
import subprocess, sys
import numpy as np
import sst
program, name = sys.argv[1:]
subprocess.run([program, "export", "npz", name, "-o", name + ".npz"], check=True, stdout=subprocess.DEVNULL)
lf = sst.open(name)
with np.load(name + ".npz") as z:
    for i, view in enumerate(lf.views):
        assert (lf.image8(view) == z["views"][i]).all(), view
        if "disparity" in z.files:
            d = lf.disparity(view)
            assert d is None or np.array_equal(d, z["disparity"][i], equal_nan=True)
print(lf)
PY
done
[ "$failed" -eq 0 ] || exit 1
