#!/usr/bin/env bash
# Debian packages of this working tree, built in a clean root without a network: build.sh DIST [ARCH]; they are put into
# build/packages/DIST/ARCH/. CCACHE=0: without the objects of earlier builds. MAINTAINER="Name <mail>": of the packages. DEB_BUILD_OPTIONS and
# BUILD_PROFILES as usual. Needs root.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
set -eu
cd "$(dirname "$0")/../.."
dist=$1 arch=${2:-$(dpkg --print-architecture)}
native=$(dpkg --print-architecture)
case $dist in
bookworm) suffix=+deb12u1 ;;
trixie) suffix=+deb13u1 ;;
*) echo "build.sh: $dist: packages are built for bookworm and trixie (DIST=)" >&2; exit 2 ;;
esac
root=$(scripts/packages/root.sh "$dist" build "$arch")
out=$PWD/build/packages/$dist/$arch
rm -rf "$out"
mkdir -p "$out"
source=$(mktemp -d -p "$out" source.XXXXXX)
trap 'rm -rf "$source"' EXIT
version=$(sed -nE '1s/.*\((.*)\).*/\1/p' debian/changelog)
tree=$source/sst-$version$suffix
mkdir "$tree"
git ls-files -z --cached --others --exclude-standard | while IFS= read -r -d '' f; do [ ! -e "$f" ] || printf '%s\0' "$f"; done |
  tar -c --null -T - | tar -x -C "$tree"
# The entry of this release: a newer release of Debian upgrades to its own build.
author=${MAINTAINER:-$(sed -nE 's/^Maintainer: //p' debian/control)}
sed -i "s/^Maintainer: .*/Maintainer: $author/" "$tree/debian/control"
{
  echo "sst ($version$suffix) $dist; urgency=medium"
  echo
  echo "  * Build for this release of Debian."
  echo
  echo " -- $author  $(date -Ru -d "$(sed -nE '0,/^ -- /s/^ -- .*>  (.*)/\1/p' debian/changelog) + 1 minute")"
  echo
  cat debian/changelog
} >"$tree/debian/changelog"
binds=(--bind "$source:/build")
path=/usr/sbin:/usr/bin:/sbin:/bin
if [ "${CCACHE-1}" = 1 ]; then
  mkdir -p build/packages/ccache
  binds+=(--bind "$PWD/build/packages/ccache:/ccache")
  path=/usr/lib/ccache:$path
fi
cross=()
[ "$arch" = "$native" ] || cross=(-a"$arch" -B -Pcross,nocheck)
scripts/packages/enter.sh "${binds[@]}" "$root" sh -ec '
  chown -R builder /build; [ ! -d /ccache ] || chown builder /ccache
  cd "/build/$1"; path=$2 options=$3; shift 3
  exec setpriv --reuid=builder --regid=builder --init-groups env -i PATH="$path" HOME=/home/builder LC_ALL=C.UTF-8 CCACHE_DIR=/ccache CCACHE_NOHASHDIR=1 \
    DEB_BUILD_OPTIONS="$options" dpkg-buildpackage -us -uc --source-option=-Zgzip "$@"' - "${tree##*/}" "$path" \
  "${DEB_BUILD_OPTIONS-parallel=$(nproc)}" "${cross[@]:--F}" \
  >"$out/build.log" 2>&1 || { tail -n 40 "$out/build.log" >&2; echo "the packages cannot be built: $out/build.log" >&2; exit 1; }
find "$source" -maxdepth 1 -type f -exec mv {} "$out/" \;
chown -R --reference=debian "$out"
ls "$out"/*.deb
