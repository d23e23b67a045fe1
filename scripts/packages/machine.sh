#!/usr/bin/env bash
# Virtual machine of a release of Debian for autopkgtest, where systemd and AppArmor run as on a real one: machine.sh DIST; prints its
# folder, with disk.img and the command `qemu` that autopkgtest-virt-qemu calls. Needs root to make it, /dev/kvm to be quick.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
set -eu
cd "$(dirname "$0")/../.."
dist=$1
place=$PWD/build/packages/$dist/machine
[ -e "$place/disk.img" ] && { echo "$place"; exit 0; }
rm -rf "$place"
mkdir -p "$place"
mmdebstrap --quiet --mode=root --variant=apt --include=linux-image-amd64,systemd-sysv,dbus,udev,apparmor,ifupdown,isc-dhcp-client,ca-certificates \
  --customize-hook=/usr/share/autopkgtest/setup-commands/setup-testbed "$dist" "$place/root" "${DEBIAN_MIRROR:-http://deb.debian.org/debian}" >&2
cp "$(ls "$place"/root/boot/vmlinuz-* | tail -n 1)" "$place/vmlinuz"
cp "$(ls "$place"/root/boot/initrd.img-* | tail -n 1)" "$place/initrd"
mke2fs -q -t ext4 -d "$place/root" "$place/disk.part" 8G >&2
rm -rf --one-file-system "$place/root"
cat >"$place/qemu" <<Q
#!/bin/sh
exec qemu-system-x86_64 "\$@" -kernel $place/vmlinuz -initrd $place/initrd -append "root=/dev/vda rw console=ttyS0 quiet"
Q
chmod 755 "$place/qemu"
mv "$place/disk.part" "$place/disk.img"
echo "$place"
