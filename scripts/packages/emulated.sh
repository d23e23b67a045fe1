#!/usr/bin/env bash
# Programs of the arm64 packages in an emulator, with the libraries of Debian 12: emulated.sh. A small light field is drawn and
# matched, with the same pixels as by the programs in SST_BUILD (build); the service checks a configuration.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
set -eu
cd "$(dirname "$0")/../.."
out=$PWD/build/packages/bookworm/arm64 build=$(realpath "${SST_BUILD-build}")
scripts/arm64/sysroot.sh build/packages/arm64-libraries all
tmp=$(mktemp -d)
trap 'rm -rf "$tmp"' EXIT
root=$tmp/root
cp -a build/packages/arm64-libraries "$root"
for deb in "$out"/*_arm64.deb; do
  [[ $deb = *-dbgsym_* ]] || dpkg-deb -x "$deb" "$root"
done
emulated() { qemu-aarch64 -cpu max,pauth-impdef=on -L "$root" "$root$@"; }
for f in "$root"/usr/bin/sst "$root"/usr/bin/sst-sim "$root"/usr/sbin/sst{d,-rtsp,-mqtt,-onvif}; do
  file -L "$f" | grep -q 'ARM aarch64' || { echo "$f is not for arm64" >&2; exit 1; }
  emulated "${f#"$root"}" --help >/dev/null || { echo "${f##*/} --help fails" >&2; exit 1; }
done
emulated /usr/bin/sst version | tee "$tmp/version"
grep -q 'kernels for i8mm' "$tmp/version"
cd "$tmp"
emulated /usr/bin/sst scene bush --size 96x72 -o there >/dev/null
"$build/sst" scene bush --size 96x72 -o here >/dev/null
emulated /usr/bin/sst process there --no-labels -q
"$build/sst" process here --no-labels -q
# Compressors of pictures have code of their own for each processor: pixels are compared.
/usr/bin/python3 - <<'PY' || { echo "maps or pictures differ from those of $build" >&2; exit 1; }
import glob
from PIL import Image
files = sorted(glob.glob("here/views/*.png") + glob.glob("here/disparity/*.png") + glob.glob("here/confidence/*.png"))
assert len(files) == 108, files
for f in files:
    here, there = (Image.open(f.replace("here", lf)) for lf in ("here", "there"))
    assert here.size == there.size and here.tobytes() == there.tobytes(), f
PY
echo "array: {rows: 2, cols: 2}" >sstd.yaml
emulated /usr/sbin/sstd --check --config sstd.yaml >/dev/null
echo "$(ls "$out"/*_arm64.deb | grep -vc dbgsym) packages; programs start; views and maps are those of $(dpkg --print-architecture)"
