#!/usr/bin/env bash
# debian/tests of the built packages in a copy of a bare root folder, with a network of its own: autopkgtest.sh DIST [TEST]...; all without a
# name. Systemd and AppArmor need a virtual machine (check.sh). Logs in build/packages/DIST/autopkgtest/. Needs root and an archive.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
set -eu
cd "$(dirname "$0")/../.."
dist=$1
shift
out=$PWD/build/packages/$dist/$(dpkg --print-architecture) logs=$PWD/build/packages/$dist/autopkgtest
[ $# -gt 0 ] || read -ra tests <<<"$(sed -nE 's/^Tests: *//p' debian/tests/control | tr '\n' ' ')"
[ $# -eq 0 ] || tests=("$@")
root=$(scripts/packages/root.sh "$dist" bare)
(cd "$out" && dpkg-scanpackages -m . >Packages.new 2>/dev/null && mv Packages.new Packages)
rm -rf "$logs"
mkdir -p "$logs"
needs= names=
for t in "${tests[@]}"; do
  needs="$needs $(sed -n "/^Tests: $t\$/,/^\$/s/^Depends: //p" debian/tests/control | tr -d ,)"
  names="$names --test-name=$t"
done
# The archive is asked first; the tests have no network.
# shellcheck disable=SC2016,SC2086
scripts/packages/enter.sh --network --bind "$out:/packages" --bind "$logs:/log" --bind "$PWD/debian:/source/debian" "$root" bash -c '
  set -eu
  names=$1
  shift
  echo "deb [trusted=yes] file:/packages ./" >/etc/apt/sources.list.d/packages.list
  apt-get -qq update
  apt-get -qq -o Dpkg::Use-Pty=0 install -y --no-install-recommends autopkgtest dpkg-dev iproute2 "$@" >/log/apt.log 2>&1 || { tail -n 20 /log/apt.log; exit 1; }
  exec unshare --net sh -c "ip link set lo up; exec autopkgtest $names \
    --ignore-restrictions=isolation-container,breaks-testbed --output-dir /log/out -B /source/ -- null"' - "$names" $needs >"$logs/log" 2>&1 || true
for t in "${tests[@]}"; do
  result=$(awk -v t="$t" '$1 == t { print $2 }' "$logs/out/summary" 2>/dev/null) || true
  echo "$t ${result:-FAIL ($logs/log)}"
  [ "$result" = PASS ] || bad=1
done
exit ${bad-0}
