#!/usr/bin/env bash
# sysroot.sh DIR [all | FILE.deb...]: unpack the arm64 libraries that the build cannot do without, or all optional
# parts too, or built packages with their dependencies, from Debian's archive into DIR. apt resolves them as on an empty arm64
# machine, with lists of its own: no root, and no change to the packages of this machine. RELEASE=trixie: of that release.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
set -eu
cd "$(dirname "$0")/../.."
dir=$(realpath -m "$1") what=${2-required}
# The libraries of scripts/packages.txt; the required ones come first.
built=()
if [[ $what = *.deb ]]; then
  shift
  built=("${@/#/$PWD/}") packages=
else
  packages=$([ "$what" = all ] && cat scripts/packages.txt || sed '/^# Optional/,$d' scripts/packages.txt)
  packages=$(sed 's/#.*//' <<<"$packages" | grep -E -- '-dev *$')
fi
stamp=$({ echo "$what ${RELEASE-}" $packages; cat ${built[@]+"${built[@]}"}; } | cksum)
[ "$(cat "$dir/.complete" 2>/dev/null)" != "$stamp" ] || exit 0
for p in dpkg-deb apt-get; do
  command -v $p >/dev/null || { echo "no $p: arm64 libraries come from Debian's packages" >&2; exit 1; }
done

new=$dir.new
trap 'rm -rf "$new"' EXIT
rm -rf "$new"
mkdir -p "$new/apt/lists/partial" "$new/apt/archives/partial" "$new/root"
: >"$new/apt/status"
sources=()
if [ -n "${RELEASE-}" ]; then
  echo "deb [signed-by=/usr/share/keyrings/debian-archive-keyring.gpg] ${DEBIAN_MIRROR:-http://deb.debian.org/debian} $RELEASE main" >"$new/apt/sources.list"
  sources=(-o Dir::Etc::sourcelist="$new/apt/sources.list" -o Dir::Etc::sourceparts=-)
fi
apt() {
  apt-get -qq ${sources[@]+"${sources[@]}"} -o APT::Architecture=arm64 -o APT::Architectures=arm64 -o Dir::State="$new/apt" -o Dir::Cache="$new/apt" \
    -o Dir::State::status="$new/apt/status" -o Acquire::Retries=3 -o Debug::NoLocking=1 -o APT::Sandbox::User=root "$@"
}
echo "unpacking arm64 libraries into $dir"
apt update || echo "not all lists of packages are new" >&2
apt install -y --no-install-recommends --download-only $packages ${built[@]+"${built[@]}"} >/dev/null
for deb in "$new"/apt/archives/*.deb ${built[@]+"${built[@]}"}; do dpkg-deb -x "$deb" "$new/root"; done
[ -e "$new/root/lib" ] || ln -s usr/lib "$new/root/lib" # since Debian 13 no package has it but base-files
# Links that start at the root lead out of it. What update-alternatives would link lies in folders of its own.
find "$new/root" -type l -lname '/*' | while read -r link; do
  ln -sfnr "$new/root$(readlink "$link")" "$link"
done
for lib in "$new"/root/usr/lib/aarch64-linux-gnu/{blas,lapack}/*.so*; do
  [ ! -e "$lib" ] || ln -sfr "$lib" "$new/root/usr/lib/aarch64-linux-gnu/"
done
echo "$stamp" >"$new/root/.complete"
rm -rf "$dir"
mkdir -p "${dir%/*}"
mv "$new/root" "$dir"
