#!/usr/bin/env bash
# `sst models`, networks by name and with descriptions of their own, manifests, and files that must be refused.
set -u
. "$(dirname "$0")/../lib.sh"
[ -e "$root/models/manifest.json" ] || { echo "models/ is absent"; exit 77; }
export SST_MODELS=$tmp/mine
mkdir mine installed

# --- the list: every folder, shadowed names, what is wrong with a file ---
cp "$root/models/pspnet-small.onnx" mine/own.onnx
cp "$root/models/mccnn-fast.onnx" mine/mccnn-fast.onnx
cp "$root/models/pspnet-small.onnx" "$root/models/manifest.json" installed/
printf 'no network\n' >mine/broken.onnx
"$sst" models >out 2>err || fail "sst models: exit $?"
[ -s err ] && fail "sst models said: $(cat err)"
grep -q '^  own  *labels  *f32 .* ok ' out || fail "own.onnx: $(cat out)"
grep -q '^  broken .*unreadable .*not an ONNX file' out || fail "broken.onnx: $(cat out)"
[ "$(grep -c '^  mccnn-fast ' out)" -eq 2 ] && grep -q '^  mccnn-fast .*shadowed' out || fail "shadowed: $(cat out)"
grep -q '^  pspnet-small .* ok .*miou_camvid_val' out || fail "pspnet-small: $(cat out)"
[ "$(wc -L <out)" -le 120 ] || fail "wider than 120 columns"
"$sst" models --json >json || fail "sst models --json: exit $?"
python3 - json <<'PY' || fail "sst models --json: $(cat json)"
import json, sys

models = json.load(open(sys.argv[1]))["models"]
by = {(m["folder"].rsplit("/", 1)[1], m["file"]): m for m in models}
assert by["mine", "own.onnx"]["status"] == "ok" and not by["mine", "own.onnx"]["listed"]
assert by["mine", "broken.onnx"]["status"] == "unreadable" and by["mine", "broken.onnx"]["reason"]
assert by["models", "mccnn-fast.onnx"]["shadowed"] and not by["mine", "mccnn-fast.onnx"]["shadowed"]
psp = by["models", "pspnet-small.onnx"]
assert psp["listed"] and psp["kind"] == "labels" and psp["classes"] == 23 and psp["figures"]["miou_camvid_val"] > 0
assert by["models", "mccnn-fast.onnx"]["kind"] == "matching"
PY

# --- a listed file must be itself; a broken manifest is named with its line ---
printf 'x' >>installed/pspnet-small.onnx
want 3 "another SHA-256.*install" models installed/pspnet-small.onnx
SST_MODELS=$tmp/installed "$sst" models >out || fail "list with a mismatch: exit $?"
grep -q '^  pspnet-small .*hash mismatch' out || fail "mismatch: $(cat out)"
grep -q '^  mccnn-fast .*missing' out || fail "missing: $(cat out)"
printf '{\n "format": }\n' >installed/manifest.json
want 3 "manifest.json:2:" models installed/pspnet-small.onnx

# --- one network ---
"$sst" models own >out 2>err || fail "sst models own: $(cat err)"
for words in "^  runner  *onednn" "^  gives c,w,h *23 x 120 x 90" "^  parameters *864375" "^  classes .*Sky, Building"; do
  grep -q "$words" out || fail "sst models own: no '$words' in: $(cat out)"
done
"$sst" models mccnn-fast --json | python3 -c 'import json, sys; assert json.load(sys.stdin)["gives"][0] == 64' ||
  fail "sst models mccnn-fast --json"
want 3 "not an ONNX file" models broken
want 3 "No such file" models none.onnx
want 5 "sst models.*lists" models none
want 2 "too many" models a b

# --- by name, with a description beside it ---
"$sst" scene pedestrian -o lf --size 64x48 --grid 2x2 -q >/dev/null || fail "scene"
image=lf/views/00_00.png
"$sst" segment $image --model pspnet-small -o a.png || fail "segment by name"
"$sst" segment $image --model own.onnx -o b.png || fail "segment by file name"
"$sst" segment $image --model mine/own.onnx -o c.png || fail "segment by path"
cmp -s a.png b.png && cmp -s a.png c.png || fail "name and path differ"
want 5 "no network called nothing" segment $image --model nothing -o bad.png
want 5 "no network called nothing" process lf --model nothing
want 5 "no network called nothing" stereo $image lf/views/00_01.png -m 9 --cost mccnn --mccnn-model nothing -o bad.pfm
printf 'mean: 0.5\nsize: 64x48\n' >mine/own.yaml
"$sst" segment $image --model own -v -o d.png 2>err || fail "segment with a description: $(cat err)"
grep -q 'image of 64 x 48' err || fail "size of the description is not used: $(cat err)"
"$sst" models own | grep -q 'described by .*own.yaml' || fail "the description is not shown"
printf 'classes: [a, b]\n' >mine/own.yaml
want 3 "23 channels for the 2 classes" segment $image --model own -o bad.png
printf 'clases: [a, b]\n' >mine/own.yaml
want 3 "own.yaml:1:1: clases is no key" segment $image --model own -o bad.png
printf 'mean: 1\nstd: nan\n' >mine/own.yaml
want 3 "own.yaml:2:6: std wants a number" models own
printf 'std: 0\nmean: x\nfoo: 1\n' >mine/own.yaml
"$sst" models own >/dev/null 2>err && fail "three faults were accepted"
[ "$(cut -d: -f1-5 err)" = "$(for i in 1:6 2:7 3:1; do echo "sst: error: $tmp/mine/own.yaml:$i"; done)" ] ||
  fail "not all faults at once, in order: $(cat err)"
rm mine/own.yaml

# --- damaged files: every truncation, and memory stays bounded whatever the file says ---
for n in 1 100 5000 400000 446677; do
  head -c $n "$root/models/mccnn-fast.onnx" >mine/cut.onnx
  want 3 "cut.onnx" models cut
done
truncate -s 65M mine/large.onnx
want 3 "large.onnx" models large
mkdir mine/folder.onnx
want 3 "regular file" models mine/folder.onnx

# --- installed: the manifest and every network that it lists ---
make -s -C "$root" install DESTDIR="$tmp/dest" PREFIX=/usr BUILD="${SST_BUILD:-build}" >log 2>&1 || fail "install: $(cat log)"
(cd "$root/models" && ls ./*.onnx manifest.json | sed 's#^\./##' | sort) >want_files
(cd dest/usr/share/sst/models && ls | sort) | cmp -s - want_files || fail "installed: $(ls dest/usr/share/sst/models)"
SST_MODELS='' dest/usr/bin/sst models | grep -q "dest/usr/share/sst/models" || fail "the installed program finds no networks"

[ "$failed" -eq 0 ] && echo "networks are listed, described and judged"
exit "$failed"
