#!/usr/bin/env bash
# Put into build/kernel/ what `make check-kernel` boots: Debian's stock kernel with all its modules, and those for
# simulated devices that it leaves out, built from Debian's sources. Nothing is installed on this machine; what is there
# already is kept. Afterwards: vmlinuz, release (its name), lib/modules/.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
set -eu
cd "$(dirname "$0")/../.."
source=$PWD/scripts/kernel/modules
mkdir -p build/kernel/debs
cd build/kernel

stop() { echo "check-kernel: $*" >&2; exit 1; }

# The newest 6.1 kernel that apt knows; what was fetched before is good enough.
release=$(cat release 2>/dev/null) || {
  release=$(apt-cache depends linux-image-amd64 2>/dev/null | sed -n 's/.*Depends: linux-image-//p' | head -n 1)
  [ -n "$release" ] || stop "apt knows no linux-image-amd64; run apt-get update on Debian 12"
}
base=${release%.*-*-*}

fetch() { # PACKAGE: its .deb in debs/
  compgen -G "debs/$1_*.deb" >/dev/null && return
  echo "check-kernel: fetching $1"
  (cd debs && apt-get -qq download "$1" 2>apt.log) || stop "cannot fetch $1: $(tail -n 1 debs/apt.log); is there a network?"
}

unpack() { dpkg-deb -x debs/"$1"_*.deb "$2"; }

# Headers point to /usr/src and to a compiler by its version; ours are elsewhere and any near one does.
headers() {
  local common=linux-headers-${release%-amd64}-common
  for p in "linux-headers-$release" "$common" "linux-kbuild-$base"; do fetch "$p"; unpack "$p" headers; done
  echo "include $PWD/headers/usr/src/$common/Makefile" >"headers/usr/src/linux-headers-$release/Makefile"
}

sources() {
  fetch "linux-source-$base"
  fetch v4l2loopback-dkms
  unpack v4l2loopback-dkms loopback
  cp loopback/usr/src/v4l2loopback-*/*.[ch] "$source"/* modules/
  echo "check-kernel: unpacking three files of the kernel's source"
  dpkg-deb --fsys-tarfile debs/linux-source-"$base"_*.deb | tar xO "./usr/src/linux-source-$base.tar.xz" |
    tar xJ -C modules --strip-components=3 "linux-source-$base"/{drivers/gpio/gpio-sim.c,drivers/gpio/gpiolib.h,kernel/irq/irq_sim.c}
}

modules() {
  rm -rf modules headers loopback
  mkdir modules
  headers
  sources
  echo "check-kernel: building gpio-sim and v4l2loopback"
  make -C "headers/usr/src/linux-headers-$release" M="$PWD/modules" CC=gcc modules >modules.log 2>&1 ||
    stop "the modules do not build: $(grep -m1 -i error modules.log), see $PWD/modules.log"
  mkdir -p "lib/modules/$release/extra"
  cp modules/*.ko "lib/modules/$release/extra/"
  rm -rf headers loopback
}

kernel() {
  fetch "linux-image-$release"
  rm -rf image lib
  unpack "linux-image-$release" image
  mv image/lib lib
  cp "image/boot/vmlinuz-$release" vmlinuz
  rm -rf image
}

if ! [ -e release ] || [ "$source/irqsim.c" -nt release ] || [ "$source/Kbuild" -nt release ]; then
  kernel
  modules
  busybox depmod -b "$PWD" "$release"
  echo "$release" >release
fi
