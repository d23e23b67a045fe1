#!/usr/bin/env bash
# debian/tests of the built packages, each in a copy of a bare root folder of its own with a network of its own: autopkgtest.sh DIST [TEST]...;
# without systemd and AppArmor, which need a virtual machine (check.sh). Logs in build/packages/DIST/autopkgtest/TEST/. Needs root and an archive.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
set -u
cd "$(dirname "$0")/../.."
dist=$1
shift
out=$PWD/build/packages/$dist/$(dpkg --print-architecture) logs=$PWD/build/packages/$dist/autopkgtest
[ $# -gt 0 ] || read -ra tests <<<"$(sed -nE 's/^Tests: *//p' debian/tests/control | tr '\n' ' ')"
[ $# -eq 0 ] || tests=("$@")
root=$(scripts/packages/root.sh "$dist" bare) || exit 1
(cd "$out" && dpkg-scanpackages -m . >Packages 2>/dev/null)
bad=0
for t in "${tests[@]}"; do
  rm -rf "${logs:?}/$t"
  mkdir -p "$logs/$t"
  needs=$(sed -n "/^Tests: $t\$/,/^\$/s/^Depends: //p" debian/tests/control | tr -d ,)
  # The archive is asked first; the test and all that it installs have no network.
  # shellcheck disable=SC2016
  scripts/packages/enter.sh --network --bind "$out:/packages" --bind "$logs/$t:/log" --bind "$PWD/debian:/source/debian" "$root" bash -c '
    set -eu
    test=$1
    shift
    echo "deb [trusted=yes] file:/packages ./" >/etc/apt/sources.list.d/packages.list
    apt-get -qq update
    apt-get -qq -o Dpkg::Use-Pty=0 install -y --no-install-recommends autopkgtest iproute2 "$@" >/log/apt.log 2>&1 || { tail -n 20 /log/apt.log; exit 1; }
    rm -rf /log/out
    exec unshare --net sh -c "ip link set lo up; exec autopkgtest --test-name=$test \
      --ignore-restrictions=isolation-container,breaks-testbed --output-dir /log/out -B /source/ -- null"' - "$t" $needs >"$logs/$t/log" 2>&1
  rc=$?
  result=$(awk -v t="$t" '$1 == t { print $2 }' "$logs/$t/out/summary" 2>/dev/null)
  echo "$t ${result:-FAIL (exit $rc: $logs/$t/log)}"
  [ "$result" = PASS ] || bad=1
done
exit $bad
