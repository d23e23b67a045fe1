#!/usr/bin/env bash
# Clean root folder of a release of Debian, made by mmdebstrap: root.sh DIST bare|build [ARCH]; prints its path. `build` has the packages
# that debian/control builds with, and lintian and shells, which judge packages; it is made again after a change of their list.
# DEBIAN_MIRROR: the archive. Needs root.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
set -eu
cd "$(dirname "$0")/../.."
dist=$1 kind=$2 arch=${3:-$(dpkg --print-architecture)}
native=$(dpkg --print-architecture)
mirror=${DEBIAN_MIRROR:-http://deb.debian.org/debian}
place=$PWD/build/packages/$dist
root=$place/$kind$([ "$arch" = "$native" ] || echo "-$arch")
checkers='faketime locales lintian fish zsh bash-completion man-db apparmor systemd'
case $kind in
bare) wanted= ;;
build) wanted=$(sed -n '/^Build-Depends/,/^Standards/p' debian/control) ;;
*) echo "root.sh: $kind is not bare or build" >&2; exit 2 ;;
esac
[ -e "$root/.complete" ] && [ "$(cat "$root/.complete")" = "$wanted" ] && { echo "$root"; exit 0; }

command -v mmdebstrap >/dev/null || { echo "mmdebstrap is missing: make deps-packages" >&2; exit 1; }
mkdir -p "$place"
if [ "$kind" = bare ]; then
  rm -rf --one-file-system "$root"
  mmdebstrap --quiet --mode=root --variant=minbase --include=ca-certificates,iproute2 "$dist" "$root" "$mirror" >&2
  # No service starts in a root folder, as piuparts and builders have it.
  printf '#!/bin/sh\nexit 101\n' >"$root/usr/sbin/policy-rc.d"
  chmod 755 "$root/usr/sbin/policy-rc.d"
else
  bare=$("$0" "$dist" bare)
  rm -rf --one-file-system "$root"
  cp -aH "$bare" "$root"
  rm -f "$root/.complete"
  mkdir "$root/tmp/debian"
  cp debian/control debian/changelog "$root/tmp/debian/"
  cp /etc/resolv.conf "$root/etc/resolv.conf"
  install="apt-get -qq -o Acquire::Retries=3 -o Dpkg::Use-Pty=0 install -y --no-install-recommends"
  cross=$([ "$arch" = "$native" ] || echo "-a$arch --arch-only -Pcross,nocheck")
  command="${cross:+dpkg --add-architecture $arch;} apt-get -qq update; $install build-essential ccache fakeroot $checkers \
    ${cross:+crossbuild-essential-$arch}; cd /tmp; apt-get -qq -o Dpkg::Use-Pty=0 build-dep -y --no-install-recommends $cross ./; useradd -m builder"
  env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME=/root LC_ALL=C.UTF-8 DEBIAN_FRONTEND=noninteractive \
    unshare --mount sh -c 'mount -t proc proc "$1/proc" && exec chroot "$1" sh -ec "$2"' - "$root" "$command" >"$root.log" 2>&1 || {
    tail -n 20 "$root.log" >&2; echo "$root: its packages cannot be installed" >&2; exit 1; }
fi
echo "$wanted" >"$root/.complete"
echo "$root"
