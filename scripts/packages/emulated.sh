#!/usr/bin/env bash
# Programs of the arm64 packages in an emulator, with the packages that they depend on: emulated.sh DIST. A small light field is drawn
# and matched, with the same pixels as by the programs in SST_BUILD (build); the service checks a configuration.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
set -eu
cd "$(dirname "$0")/../.."
dist=$1
out=build/packages/$dist/arm64 build=$(realpath "${SST_BUILD-build}") root=$PWD/build/packages/$dist/arm64-root
# Networks are of no architecture: the packages of this machine have them.
mapfile -t debs < <(find "$out" "${out%/*}/$(dpkg --print-architecture)" \( -name '*_arm64.deb' -o -name 'sst-models_*_all.deb' \) ! -name '*-dbgsym_*' \
  ! -name '*-dev_*' | sort)
RELEASE=$dist scripts/arm64/sysroot.sh "$root" "${debs[@]}"
tmp=$(mktemp -d)
trap 'rm -rf "$tmp"' EXIT
emulated() { qemu-aarch64 -cpu max,pauth-impdef=on -L "$root" "$root$1" "${@:2}"; }
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
echo "${#debs[@]} packages; programs start; views and maps are those of $(dpkg --print-architecture)"
