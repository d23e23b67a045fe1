#!/usr/bin/env bash
# --device: pictures on Mesa's software device against the CPU's, what ends on the CPU, damaged caches, devices that are
# missing. Without lavapipe it fails.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
set -u
. "$(dirname "$0")/../lib.sh"
. "$root/tests/lavapipe.sh"
export XDG_CACHE_HOME=$tmp/cache
mkdir cache
validate

"$sst" scene bush --size 160x120 -o world || exit 1
"$sst" import folder world/views --grid 6x6 --disparity world/truth --labels world/truth -o lf >/dev/null || exit 1

# close A B: pictures that differ by at most one level
cat >close.py <<'END'
import sys
import numpy
from PIL import Image
a, b = (numpy.asarray(Image.open(f)).astype(int) for f in sys.argv[1:3])
worst = abs(a - b).max()
print(f"{sys.argv[2]}: {worst} levels at most, {(a != b).sum()} values differ")
sys.exit(int(worst > 1))
END
close() { cmp -s "$1" "$2" || /usr/bin/python3 close.py "$1" "$2" || fail "$2 differs"; }

# --- pictures, and what is reported ---
i=0
for options in "" "--method refocus" "--method refocus --soft --aperture 1.5" "--label Pedestrian --unsupported invalid" \
  "--verify-rays on" "--method clear" "--method clear --remove-at 80,70 --view-x 0.5" "--method clear --remove-label Tree" "--c1 0 --c2 0 --sigma 0.1 --focus 11.5"; do
  i=$((i + 1))
  "$sst" render lf $options -o cpu$i.png --valid seen$i.png || fail "render $options"
  "$sst" render lf $options --device lavapipe -o gpu$i.png --valid valid$i.png --json >$i.json 2>err || fail "on lavapipe: $options: $(cat err)"
  [ ! -s err ] || fail "$options: $(cat err)"
  close cpu$i.png gpu$i.png
  cmp -s seen$i.png valid$i.png || fail "$options: another --valid"
  device $i.json 'd["pictures"] == 1 and d["on_cpu"] == 0 and d["failures"] == 0 and d["why_cpu"] is None and "lavapipe" in d["driver"]'
done
for i in 6 7 8; do
  device $i.json 'd["filled_on_cpu"] == 0 and d["dispatches"] == 2 + 16' # 8 levels
done
device 5.json 'd["verified_on_cpu"] == 0 and d["why_verified_on_cpu"] is None and d["dispatches"] == 5'

# --- a sweep uploads the light field once; with little memory, again and again ---
"$sst" sweep lf --steps 4 -o frames || fail "sweep"
"$sst" sweep lf --steps 4 --device lavapipe -o frames1 --json >sweep.json || fail "sweep on lavapipe"
device sweep.json 'd["pictures"] == 4 and d["uploads"] == 36'
"$sst" sweep lf --steps 4 --device lavapipe --device-memory 2 -o frames2 --json >small.json || fail "sweep in 2 MiB"
device small.json 'd["pictures"] == 4 and d["uploads"] > 36'
for f in 0000 0001 0002 0003; do
  close frames/$f.png frames1/$f.png
  cmp -s frames1/$f.png frames2/$f.png || fail "less memory changes $f.png"
done
# --- raw frames: rectified on the device, or their rays sampled there ---
sim=$root/${SST_BUILD:-build}/sst-sim
cat >world.yaml <<'Y'
scene: bush
grid: [3, 3]
size: [160, 120]
strip: false
loop: { seconds: 0.5, rate_hz: 2 }
optics: { distortion: [-0.15, 0.04, 0, 0, 0], focal_spread_percent: 0.5, principal_spread_px: 3, vignetting: 0.2 }
mounting: { rotation_spread_deg: 0.8, position_spread_mm: 2 }
sensor: { gain_spread_percent: 3 }
Y
"$sim" --quiet --world world.yaml --parameters calib.yaml || fail "parameters"
"$sst" scene bush --size 160x120 --grid 3x3 -o plain || exit 1
mkdir shots
/usr/bin/python3 -c '
import glob, os
from PIL import Image
for f in glob.glob("plain/views/*"): # pretend that they are raw
    Image.open(f).convert("RGB").save("shots/" + os.path.splitext(os.path.basename(f))[0] + ".jpg", quality=92)'
"$sst" import folder shots --grid 3x3 --calib calib.yaml -o cal >/dev/null || fail "import with a calibration"
"$sst" process cal --no-labels --preset balanced -q || fail "process with a calibration"
for options in "--sampling rectified --focus 9.3" "--sampling raw --focus 9.3" "--sampling rectified --method refocus --focus 7" "--sampling rectified --method clear --cut 9"; do
  "$sst" render cal $options -o cal.png --valid seen.png --json >cpu.json 2>err || fail "$options: $(cat err)"
  "$sst" render cal $options --device lavapipe -o cal1.png --valid valid.png --json >cal.json 2>err || fail "$options on lavapipe: $(cat err)"
  [ ! -s err ] || fail "$options on lavapipe: $(cat err)"
  close cal.png cal1.png
  cmp -s seen.png valid.png || fail "$options: another --valid"
  device cal.json 'd["pictures"] == 1 and d["on_cpu"] == 0 and d["rectified"] == 9 and d["uploads"] == 9'
done
for options in "--sampling raw --cut 9" "--cut 9 --view-x 0.4 --view-y -0.3"; do # each ray at a place of its own
  "$sst" render cal --method clear $options -o cal.png --valid seen.png || fail "clear, raw, $options"
  "$sst" render cal --method clear $options --device lavapipe -o cal1.png --valid valid.png --json >cal.json 2>err || fail "clear, raw, $options on lavapipe: $(cat err)"
  [ ! -s err ] || fail "clear, raw, $options on lavapipe: $(cat err)"
  close cal.png cal1.png
  cmp -s seen.png valid.png || fail "clear, raw, $options: another --valid"
  device cal.json 'd["pictures"] == 1 and d["on_cpu"] == 0 and d["filled_on_cpu"] == 0 and d["in_parts"] == 0 and d["uploads"] == 18'
done
"$sst" sweep cal --steps 4 -o cal2 || fail "sweep of raw frames"
"$sst" sweep cal --steps 4 --device lavapipe -o cal3 --json >cal.json || fail "sweep of raw frames on lavapipe"
device cal.json 'd["pictures"] == 4 and d["rectified"] == 9'
"$sst" sweep cal --steps 4 --device lavapipe --sampling raw -o cal4 --json >cal.json || fail "sweep, sampled on lavapipe"
device cal.json 'd["pictures"] == 4 and d["rectified"] > 18 and d["uploads"] == 9'
for f in 0000 0001 0002 0003; do
  close cal2/$f.png cal3/$f.png
done
"$sst" render cal --focus 9.3 --sampling rectified -o cal.png || fail "render of raw frames"
for fault in lost=40:lost timeout=41:answer wrong=34:refused; do
  "$sst" render cal --focus 9.3 --sampling rectified --device dummy:${fault%:*} -o fault.png --json >fault.json 2>err || fail "${fault%:*}: $(cat err)"
  cmp -s cal.png fault.png || fail "raw frames, ${fault%:*}: another picture"
  device fault.json "d['pictures'] == 0 and d['on_cpu'] == 1 and '${fault#*:}' in d['why_cpu']"
done

# --- pipelines are kept; damaged ones are compiled again ---
kept=$(compgen -G 'cache/sst/pipelines-*.bin')
[ "$(wc -w <<<"$kept")" -eq 1 ] || fail "one file of pipelines, not: $kept"
printf x | dd of="$kept" bs=1 seek=41 conv=notrunc 2>/dev/null
"$sst" render lf --device lavapipe -o again.png 2>err || fail "damaged pipelines: $(cat err)"
grep -q "damaged and removed" err || fail "damaged pipelines are not reported: $(cat err)"
cmp -s gpu1.png again.png || fail "damaged pipelines change the picture"
"$sst" render lf --device lavapipe -o again.png 2>err && [ ! -s err ] || fail "they are not stored again: $(cat err)"

# --- verdicts of tests are kept as well ---
[ "$(compgen -G 'cache/sst/verdicts-*.bin' | wc -l)" -eq 1 ] || fail "one file of verdicts, not: $(ls cache/sst)"
for known in yes no; do
  [ $known = yes ] || rm cache/sst/verdicts-*.bin
  SST_GPU_TIMES=1 "$sst" render lf --device lavapipe -o again.png -v 2>err || fail "verdicts: $(cat err)"
  grep -q ': blend: .* in 1 dispatches' err && tested=no || tested=yes
  [ $tested != $known ] || fail "verdicts are known: $known, tested: $tested: $(grep blend err)"
done

# --- failures end on the CPU, counted and logged ---
for fault in lost=33:lost timeout=33:answer; do
  "$sst" render lf --device dummy:${fault%:*} -o fault.png --json >fault.json 2>err || fail "${fault%:*}: $(cat err)"
  cmp -s cpu1.png fault.png || fail "${fault%:*}: another picture"
  grep -q "1 of 1 pictures were rendered on the CPU instead of dummy: .*${fault#*:}" err || fail "${fault%:*}: $(cat err)"
  device fault.json "d['pictures'] == 0 and d['on_cpu'] == 1 and d['failures'] == 1 and '${fault#*:}' in d['why_cpu']"
done
"$sst" sweep lf --steps 5 --device dummy:lost=34 -o lost --json >lost.json 2>err || fail "lost: $(cat err)"
device lost.json 'd["pictures"] == 3 and d["on_cpu"] == 2 and d["failures"] == 2'
"$sst" render lf --method clear --device dummy --device-memory 4 -o clear.png --json >clear.json 2>err || fail "clear: $(cat err)"
device clear.json 'd["on_cpu"] == 0 and d["in_parts"] == 1 and d["filled_on_cpu"] == 0 and d["why_filled_on_cpu"] is None'
cmp -s cpu6.png clear.png && [ ! -s err ] || fail "clear in 4 MiB: $(cat err)"
"$sst" render lf --method clear --device lavapipe --device-memory 1 -o clear.png --json >clear.json 2>err || fail "clear: $(cat err)"
device clear.json 'd["on_cpu"] == 0 and d["in_parts"] == 1 and d["filled_on_cpu"] == 0 and d["dispatches"] > 15'
close cpu6.png clear.png
[ ! -s err ] || fail "clear in 1 MiB: $(cat err)"
"$sst" render lf --method clear --device dummy:buffer=55 -o clear.png --json >clear.json 2>err || fail "clear: $(cat err)"
device clear.json 'd["on_cpu"] == 1 and "a part of a clear picture" in d["why_cpu"]'
cmp -s cpu6.png clear.png && grep -q "instead of dummy: not enough memory on the device for a part" err || fail "clear in small buffers: $(cat err)"

# --- maps: the bytes of the CPU, whatever the device does ---
"$sst" scene bush --size 96x72 --grid 3x3 -o small || exit 1
"$sst" import folder small/views --grid 3x3 -o field >/dev/null || exit 1
"$sst" scene bush --size 48x36 --grid 2x3 -o smaller || exit 1
"$sst" import folder smaller/views --grid 2x3 -o field_accurate >/dev/null || exit 1
# matched PRESET DEVICE [_FIELD]: maps against those of the CPU; the report is in match.json
matched() {
  rm -rf field1
  cp -r "field${3-}" field1
  "$sst" process field1 --no-labels --preset "$1" --device "$2" --json >match.json 2>err || fail "process $1 on $2: $(cat err)"
  diff -r "cpu_$1/disparity" field1/disparity >/dev/null && diff -r "cpu_$1/confidence" field1/confidence >/dev/null ||
    fail "$1 on $2: other maps"
}
for preset in preview accurate; do # balanced: tests/unit/gpu_vulkan.c
  of=$([ $preset = preview ] || echo _$preset)
  cp -r field$of cpu_$preset
  "$sst" process cpu_$preset --no-labels --preset $preset --json >match.json || fail "process $preset"
  grep -q '"device": "cpu"' match.json || fail "process $preset: no device"
  matched $preset lavapipe $of
  grep "instead of" err && fail "process $preset: $(cat err)"
  device match.json 'd["views"] >= 3 and d["on_cpu"] == 0 and d["failures"] == 0 and d["why_cpu"] is None'
  device match.json 'not {"range", "surfaces", "subpixel", "carrying", "check", "filling"} & set(d["stages_on_cpu"])'
  [ $preset != accurate ] || device match.json 'd["stages_on_cpu"] == []'
done
# --- rays that these maps do not explain are verified there, or on the CPU, and then named so ---
for options in "--focus 5" "--focus 9" "--focus 5 --verify-rays on --soft"; do
  "$sst" render cpu_preview $options -o cpu.png || fail "render $options"
  for device in lavapipe "lavapipe --device-memory 1"; do
    "$sst" render cpu_preview $options --device $device -o gpu.png --json >rays.json 2>err || fail "render $options on $device: $(cat err)"
    close cpu.png gpu.png
    device rays.json 'd["pictures"] == 1 and d["on_cpu"] == 0 and d["failures"] == 0'
    device rays.json '(d["verified_on_cpu"] == 0) == (d["why_verified_on_cpu"] is None)'
    case "$device $options" in
      "lavapipe --focus 9") device rays.json 'd["verified_on_cpu"] == 0 and d["dispatches"] == 2' ;; # nothing to verify
      "lavapipe --focus 5" | "lavapipe --device-memory 1 --focus 5") device rays.json 'd["verified_on_cpu"] == 0 and d["dispatches"] == 7' ;;
      "lavapipe --focus 5 --verify-rays on --soft") device rays.json 'd["verified_on_cpu"] == 0 and d["dispatches"] == 5' ;;
    esac
  done
done
"$sst" render cpu_preview --focus 5 -o cpu.png || fail "render --focus 5"
"$sst" render cpu_preview --focus 5 --device dummy:buffer=60 -o gpu.png --json >rays.json 2>err || fail "rays in small buffers: $(cat err)"
device rays.json 'd["verified_on_cpu"] == 0 and d["chunks"] > 1 and d["dispatches"] > 40' # rows of all views in one buffer
cmp -s cpu.png gpu.png || fail "rays in small buffers: $(cat err)"
# Steps are compared first, the same ones for pictures of any size.
"$sst" scene bush --size 32x24 --grid 1x2 -o tiny >/dev/null || exit 1
at=$(($(comparisons process tiny --no-labels --preset preview) + 3))
for fault in lost=$at:lost timeout=$at:answer; do
  matched preview dummy:${fault%:*}
  grep -q "views were matched on the CPU instead of dummy: .*${fault#*:}" err || fail "process: ${fault%:*}: $(cat err)"
  device match.json "d['on_cpu'] > 0 and '${fault#*:}' in d['why_cpu']"
done
rm -rf field1
cp -r field field1
"$sst" process field1 --no-labels --device dummy:wrong=20 2>err
[ $? -eq 5 ] && grep -q 'cannot match: ' err || fail "process on a device that gives wrong results: $(cat err)"
want 3 'no device `GeForce`' process field1 --device GeForce

# --- the learned cost: features and maps; the former differ by a step of a component at most ---
if "$sst" version --json | grep -q '"onednn": true'; then
  for view in small/views/*; do
    case $view in */00_00.png | */00_01.png) ;; *) rm "$view" ;; esac
  done
  "$sst" import folder small/views --grid 1x2 -o pair >/dev/null || exit 1
  cp -r pair cpu_learned
  rm -rf field1
  cp -r pair field1
  "$sst" process cpu_learned --no-labels --cost both >/dev/null || fail "process with the learned cost"
  "$sst" process field1 --no-labels --cost both --device lavapipe --json >match.json 2>err ||
    fail "process with the learned cost on lavapipe: $(cat err)"
  grep "instead of" err && fail "process with the learned cost: $(cat err)"
  device match.json 'd["views"] >= 2 and d["on_cpu"] == 0 and d["failures"] == 0 and d["why_cpu"] is None'
  /usr/bin/python3 -c '
import glob, json, sys, numpy
n = json.load(open("match.json"))["networks"]
assert n["runs"] == n["kept"] > 0, n
from PIL import Image
for f in sorted(glob.glob("cpu_learned/disparity/*.png")):
    a, b = (numpy.asarray(Image.open(x)) for x in (f, f.replace("cpu_learned/", "field1/")))
    assert (a != b).mean() < 1e-2, f' || fail "process with the learned cost: other maps on lavapipe"
fi

# --- labels of a light field ---
if "$sst" version --json | grep -q '"onednn": true'; then
  cp "$root/models/pspnet-small.onnx" . && echo "size: 96x72" >pspnet-small.yaml
  cp -r pair pair1
  "$sst" process pair --preset preview --model ./pspnet-small.onnx || fail "process with labels"
  "$sst" process pair1 --preset preview --model ./pspnet-small.onnx --device lavapipe --json >both.json 2>err || fail "process with labels on lavapipe: $(cat err)"
  grep "instead of" err && fail "process with labels on lavapipe: $(cat err)"
  /usr/bin/python3 -c '
import glob, json, sys, numpy
from PIL import Image
n = json.load(open("both.json"))["networks"]
assert n["runs"] == 2 and n["kept"] == 0 and n["on_cpu"] == 0 and n["failures"] == 0 and n["plans"] == 1, n
files = sorted(glob.glob("pair/labels/*.png"))
assert files
for f in files:
    a, b = (numpy.asarray(Image.open(x)) for x in (f, f.replace("pair/", "pair1/")))
    assert (a != b).mean() < 1e-3, f' || fail "process with labels: others on lavapipe"
  # --- gaps in given labels: the bytes of the CPU ---
  cp -r pair/labels_hcsm given
  rm -rf pair/labels* pair/entropy
  for device in cpu lavapipe; do
    rm -rf pair1
    cp -r pair pair1
    "$sst" process pair1 --preset preview --labels given --device $device 2>err || fail "labels on $device: $(cat err)"
    [ $device = lavapipe ] || cp -r pair1/labels want_labels
    diff -r want_labels pair1/labels >/dev/null || fail "given labels on $device: others"
  done
  diff -r given want_labels >/dev/null && fail "given labels: nothing was refined"
fi

# --- devices that are not there, or wrong ---
want 3 'no device `GeForce`; this machine has `llvmpipe' render lf --device GeForce -o bad.png
want 3 'software devices are used only by name' render lf --device gpu -o bad.png
"$sst" render lf --device auto -o auto.png --json >auto.json || fail "auto"
grep -q '"device": "cpu"' auto.json && cmp -s cpu1.png auto.png || fail "auto without a GPU is not the CPU"
"$sst" render lf --device dummy:wrong=3 -o bad.png 2>err
[ $? -eq 5 ] && [ ! -e bad.png ] || fail "a device that gives wrong results is used"
grep -q 'the step `blending` is refused' err && grep -q 'error: the device `dummy:wrong=3` cannot render' err || fail "wrong: $(cat err)"
"$sst" version | grep -q 'device .*lavapipe.*used only by name' || fail "version"
"$sst" version | grep -q 'dot products of bytes' || fail "version: no abilities"
"$sst" version --json | grep -q '"net_conv8_dot"' || fail "version: no variants"
exit $failed
