#!/usr/bin/env bash
# Checks of the built packages: check.sh DIST [lintian|quick|piuparts|autopkgtest|again|first|emulated|reprotest]...; all but the last
# two without a name: emulated runs the arm64 packages, reprotest builds twice with the packages of this machine (ONLY_ALL=1: packages
# without programs alone). A line for each, logs in build/packages/DIST/. Needs root, an archive, and for autopkgtest's virtual machine
# /dev/kvm (else a root folder, without systemd; TESTBED=root chooses it).
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
set -u
cd "$(dirname "$0")/../.."
dist=$1
shift
arch=$(dpkg --print-architecture)
logs=$PWD/build/packages/$dist
out=$logs/$arch
bad=0
[ $# -gt 0 ] || set -- lintian quick piuparts autopkgtest again first
compgen -G "$out/*.deb" >/dev/null || { echo "no packages in $out: make packages DIST=$dist" >&2; exit 1; }

judge() { # NAME RC LOG
  if [ "$2" -eq 0 ]; then echo "ok    $1"; else echo "FAIL  $1: $3"; tail -n 20 "$3"; bad=1; fi
}

# Every tag is shown; errors and warnings fail, also experimental and pedantic tags are in the log.
check_lintian() {
  local root rc
  root=$(scripts/packages/root.sh "$dist" build)
  local binds=(--bind "$out:/packages/$arch")
  [ "$arch" = arm64 ] || ! compgen -G "$logs/arm64/*.changes" >/dev/null || binds+=(--bind "$logs/arm64:/packages/arm64")
  scripts/packages/enter.sh "${binds[@]}" "$root" sh -c \
    'exec setpriv --reuid=builder --regid=builder --clear-groups lintian -EvIL +pedantic --fail-on error,warning /packages/*/*.changes' >"$logs/lintian.log" 2>&1
  rc=$?
  judge "lintian: $(grep -cE '^[EW]: ' "$logs/lintian.log") errors and warnings, $(grep -cE '^[IPXO]: ' "$logs/lintian.log") hints" $rc "$logs/lintian.log"
}

# Completions in the shells themselves, man pages by man, profiles by AppArmor's parser, units by systemd.
check_quick() {
  local root
  root=$(scripts/packages/root.sh "$dist" build)
  scripts/packages/enter.sh --network --bind "$out:/packages" --bind "$PWD/scripts/packages:/scripts" "$root" bash /scripts/installed.sh >"$logs/installed.log" 2>&1
  judge "installed: man pages, completions, profiles, units" $? "$logs/installed.log"
}

check_piuparts() {
  local root rc scripts
  root=$(scripts/packages/root.sh "$dist" bare)
  # All in a copy of the root (TMPDIR=/dev/shm: in memory, faster). Folders that systemd, a dependency, makes by its own
  # tmpfiles and leaves are not of these packages.
  local ignored=()
  for f in /root/.ssh /var/cache/private /var/lib/private /var/log/private /var/lib/systemd/coredump /var/lib/systemd/pstore; do ignored+=(--ignore="$f/"); done
  (cd "$out" && dpkg-scanpackages -m . >Packages.new 2>/dev/null && mv Packages.new Packages)
  # A dependency of Debian 13 brings systemd-sysv, which apt does not remove: it is there before, as on a machine.
  scripts=$(mktemp -d)
  printf '#!/bin/sh\nset -e\napt-get -qq install -y --no-install-recommends systemd-sysv\n' >"$scripts/post_setup_systemd"
  chmod 755 "$scripts" "$scripts/post_setup_systemd"
  piuparts --scriptsdir="$scripts" --existing-chroot="$root" --distribution="$dist" --mirror="${DEBIAN_MIRROR:-http://deb.debian.org/debian} main" --no-eatmydata \
    --bindmount="$out" --extra-repo="deb [trusted=yes] file:$out ./" --no-upgrade-test "${ignored[@]}" \
    "$out"/*.changes >"$logs/piuparts.log" 2>&1
  rc=$?
  rm -r "$scripts"
  # Broken links of dependencies (Qt's, of OpenCV) are warnings.
  ! grep -E ' -> .* \((lib|python3-)?sst' "$logs/piuparts.log" || rc=1
  judge "piuparts" $rc "$logs/piuparts.log"
}

# In a virtual machine with systemd and AppArmor, or (TESTBED=root, or no /dev/kvm) in a root folder.
check_autopkgtest() {
  local machine rc
  if [ "${TESTBED-machine}" = root ] || [ ! -w /dev/kvm ]; then
    scripts/packages/autopkgtest.sh "$dist" >"$logs/autopkgtest.log" 2>&1
    rc=$?
    judge "autopkgtest in a root folder: $(tr '\n' ' ' <"$logs/autopkgtest.log")" $rc "$logs/autopkgtest.log"
    return
  fi
  rm -rf "$logs/autopkgtest"
  machine=$(scripts/packages/machine.sh "$dist")
  autopkgtest --no-built-binaries --apt-upgrade --ignore-restrictions=isolation-container --output-dir "$logs/autopkgtest" "$out"/*.deb "$out"/*.dsc \
    -- qemu -q "$machine/qemu" --cpus 2 --ram-size 3072 --overlay-dir "$machine" --boot none "$machine/disk.img" >"$logs/autopkgtest.log" 2>&1
  rc=$?
  judge "autopkgtest in a virtual machine: $(awk '/(PASS|FAIL|SKIP|FLAKY)/ && NF < 4 { printf "%s%s %s", n++ ? ", " : "", $1, $2 }' "$logs/autopkgtest/summary" 2>/dev/null)" $rc "$logs/autopkgtest.log"
}

check_again() {
  local rc
  scripts/packages/again.sh "$dist" >"$logs/again.log" 2>&1
  rc=$?
  judge "reproducible: $(tail -n 1 "$logs/again.log")" $rc "$logs/again.log"
}

check_reprotest() {
  local place rc
  place=$(mktemp -d)
  dpkg-source -x --no-check "$out"/*.dsc "$place/sst" >"$logs/reprotest.log"
  (cd "$place/sst" && TMPDIR=$place reprotest --no-diffoscope \
    --vary=-all,+environment,+build_path,+exec_path,+home,+kernel,+locales,+num_cpus,+time,+timezone,+umask \
    "DEB_BUILD_OPTIONS=nocheck dpkg-buildpackage $([ -n "${ONLY_ALL-}" ] && echo -A || echo -b) -us -uc" '../*.deb' -- null) >>"$logs/reprotest.log" 2>&1
  rc=$?
  rm -rf "$place"
  judge "reprotest: $(grep -cE '^[0-9a-f]{64}  .*\.deb$' "$logs/reprotest.log") packages, $(grep -m 1 '^Reproduction' "$logs/reprotest.log")" $rc "$logs/reprotest.log"
}

check_first() {
  local rc
  scripts/packages/first.sh "$dist" >"$logs/first.log" 2>&1
  rc=$?
  judge "first live picture: $(grep packages "$logs/first.log")" $rc "$logs/first.log"
}

check_emulated() {
  local rc
  scripts/packages/emulated.sh "$dist" >"$logs/emulated.log" 2>&1
  rc=$?
  judge "emulated: $(tail -n 1 "$logs/emulated.log")" $rc "$logs/emulated.log"
}

for part in "$@"; do
  declare -F "check_$part" >/dev/null || { echo "check.sh: no check $part" >&2; exit 2; }
  "check_$part"
done
exit $bad
