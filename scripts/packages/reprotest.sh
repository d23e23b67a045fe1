#!/usr/bin/env bash
# Reproducibility of the packages: reprotest.sh DIST ROOT. reprotest builds twice in copies of the root folder, the second time in another
# folder, at another time, in another locale and time zone, with another umask and one processor.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
set -eu
cd "$(dirname "$0")/../.."
dist=$1 root=$2 arch=$(dpkg --print-architecture)
place=$PWD/build/packages/$dist/reprotest
rm -rf "$place"
mkdir -p "$place"
dsc=$(ls "build/packages/$dist/$arch"/*.dsc)
dpkg-source -x --no-check "$dsc" "$place/sst" >/dev/null
# Without a network; the kernel's name, its users and a foreign home are not varied: both builds share this root folder.
unshare --net reprotest --source-root="$place/sst" --vary=-all,+build_path,+time,+locales,+timezone,+num_cpus,+umask,+environment,+exec_path \
  --min-cpus 1 --no-diffoscope "DEB_BUILD_OPTIONS=nocheck dpkg-buildpackage -b -us -uc" "../*.deb" -- chroot "$root" \
  || { echo "the two builds differ" >&2; exit 1; }
