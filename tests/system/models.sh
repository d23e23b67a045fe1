#!/usr/bin/env bash
# `sst models`, networks by name and with descriptions of their own, manifests, and files that must be refused.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
set -u
. "$(dirname "$0")/../lib.sh"
export SST_MODELS=$tmp/mine
mkdir mine installed

# --- the list: every folder, shadowed names, what is wrong with a file ---
cp "$root/models/pspnet-small.onnx" mine/own.onnx
cp "$root/models/mccnn-fast.onnx" mine/mccnn-fast.onnx
cp "$root/models/pspnet-small.onnx" "$root/models/manifest.json" installed/
printf 'no network\n' >mine/broken.onnx
"$sst" models >out 2>err || fail "sst models: exit $?"
[ -s err ] && fail "sst models said: $(cat err)"
grep -q '^  own  *labels  *f32.* ok ' out || fail "own.onnx: $(cat out)"
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
for words in "^  runner  *onednn" "^  gives c,w,h *23 x " "^  parameters *[1-9]" "^  classes .*Sky, Building"; do
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
want 5 'unknown network `nothing`' segment $image --model nothing -o bad.png
want 5 'unknown network `nothing`' process lf --model nothing
want 5 'unknown network `nothing`' stereo $image lf/views/00_01.png -m 9 --cost mccnn --mccnn-model nothing -o bad.pfm
printf 'mean: 0.5\nsize: 64x48\n' >mine/own.yaml
"$sst" segment $image --model own -v -o d.png 2>err || fail "segment with a description: $(cat err)"
grep -q 'image of 64 x 48' err || fail "size of the description is not used: $(cat err)"
"$sst" models own | grep -q 'described by .*own.yaml' || fail "the description is not shown"
printf 'classes: [a, b]\n' >mine/own.yaml
want 3 "23 channels for the 2 classes" segment $image --model own -o bad.png
printf 'clases: [a, b]\n' >mine/own.yaml
want 3 "own.yaml:1:1: unknown key \`clases\`" segment $image --model own -o bad.png
printf 'mean: 1\nstd: nan\n' >mine/own.yaml
want 3 "own.yaml:2:6: std must be a number" models own
printf 'std: 0\nmean: x\nfoo: 1\n' >mine/own.yaml
"$sst" models own >/dev/null 2>err && fail "three faults were accepted"
[ "$(cut -d: -f1-5 err)" = "$(for i in 1:6 2:7 3:1; do echo "sst: error: $tmp/mine/own.yaml:$i"; done)" ] ||
  fail "not all faults at once, in order: $(cat err)"
rm mine/own.yaml

# --- damaged files: every truncation, and memory stays bounded whatever the file says ---
for n in 1 100 5000 400000 $(($(stat -c %s "$root/models/mccnn-fast.onnx") - 1)); do
  head -c $n "$root/models/mccnn-fast.onnx" >mine/cut.onnx
  want 3 "cut.onnx" models cut
done
python3 - "$sst" <<'PY' || fail "memory or message"
import resource, struct, subprocess, sys

def varint(v):
    out = b""
    while v > 127:
        out, v = out + bytes([v & 127 | 128]), v >> 7
    return out + bytes([v])

def num(field, v):
    return varint(field << 3) + varint(v)

def msg(field, body):
    return varint(field << 3 | 2) + varint(len(body)) + body

def value(field, name, channels):
    dims = b"".join(msg(1, num(1, d) if d else b"") for d in (1, channels, 0, 0))
    return msg(field, msg(1, name) + msg(2, msg(1, num(1, 1) + msg(2, dims))))

def tensor(name, dims, kind, data):
    return msg(5, b"".join(num(1, d) for d in dims) + num(2, kind) + msg(8, name) + data)

def node(op, ins, out, *attrs):
    return msg(1, b"".join(msg(1, i) for i in ins) + msg(2, out) + msg(4, op) + b"".join(attrs))

def model(graph):
    return num(1, 7) + msg(8, num(2, 13)) + msg(7, graph)

def check(graph, words, times):
    data = model(graph)
    with open("mine/hostile.onnx", "wb") as f:
        f.write(data)
    run = subprocess.run([sys.argv[1], "models", "mine/hostile.onnx"], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    said, peak = run.stderr.decode(), resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss * 1024
    # A sanitizer keeps what is freed for a while: 256 MiB, and shadows.
    limit = times * len(data) + (200 << 20) + ((512 << 20) if "address" in sys.argv[1] else 0)
    print(f"{len(data) >> 20} MiB file, peak {peak >> 20} MiB: {said}", end="")
    assert run.returncode == 3 and said.count("\n") == 1 and words in said, said
    assert peak < limit, (peak, limit)

ends = value(11, b"x", 64) + value(12, b"y", 64)
# numbers that take one byte in the file and eight in memory
check(ends + tensor(b"i", [16 << 20], 7, msg(7, bytes(16 << 20))) + node(b"Relu", [b"x"], b"y"), "does not name the classes", 9)
# one constant as the weights of many layers
weights = tensor(b"w", [64, 64, 32, 16], 1, msg(9, struct.pack("<f", 0.5) * (64 * 64 * 32 * 16)))
chain = b"".join(node(b"Conv", [b"x" if not i else b"v%d" % i, b"w"], b"y" if i == 49 else b"v%d" % (i + 1))
                 for i in range(50))
check(ends + weights + chain, "128 MiB", 20)
# more numbers promised than there are
check(ends + tensor(b"w", [1 << 14, 1 << 14], 1, msg(9, b"1234")) + node(b"Relu", [b"x"], b"y"), "does not hold", 9)
check(ends + tensor(b"w", [1 << 40, 1 << 40], 1, b"") + node(b"Relu", [b"x"], b"y"), "too large dimension", 9)
check(ends + node(b"Relu", [b"y"], b"y"), "a cycle", 9)
PY
truncate -s 65M mine/large.onnx
want 3 "large.onnx" models large
mkdir mine/folder.onnx
want 3 "regular file" models mine/folder.onnx

# --- installed: the manifest and every network that it lists ---
make -s -C "$root" install-built DESTDIR="$tmp/dest" PREFIX=/usr BUILD="${SST_BUILD:-build}" >log 2>&1 || fail "install: $(cat log)"
(cd "$root/models" && ls ./*.onnx manifest.json | sed 's#^\./##' | sort) >want_files
(cd dest/usr/share/sst/models && ls | sort) | cmp -s - want_files || fail "installed: $(ls dest/usr/share/sst/models)"
SST_MODELS='' dest/usr/bin/sst models | grep -q "dest/usr/share/sst/models" || fail "the installed program finds no networks"

[ "$failed" -eq 0 ] && echo "networks are listed, described and judged"
exit "$failed"
