#!/usr/bin/env bash
# Reproducibility of the packages: again.sh DIST builds the source package once more, in another folder, 400 days later, in another locale,
# time zone, umask, user's home and number of jobs, without ccache, and compares each package with the one that build.sh made. Needs root.
# ONLY_ALL=1: the packages without programs alone, in a minute.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
set -eu
cd "$(dirname "$0")/../.."
dist=$1
out=$PWD/build/packages/$dist/$(dpkg --print-architecture) place=$PWD/build/packages/$dist/again
root=$(scripts/packages/root.sh "$dist" build)
rm -rf "$place"
mkdir -p "$place/packages"
dpkg-source -x --no-check "$out"/*.dsc "$place/source" >/dev/null
# faketime leaves the times of files alone: make compares them.
# shellcheck disable=SC2016
scripts/packages/enter.sh --bind "$place:/home/builder/elsewhere" "$root" sh -ec '
  localedef -i de_DE -f UTF-8 de_DE.UTF-8
  chown -R builder /home/builder
  cd /home/builder/elsewhere/source
  umask 0002
  exec setpriv --reuid=builder --regid=builder --init-groups env -i PATH=/usr/bin:/bin:/usr/sbin:/sbin:/home/builder/bin HOME=/nonexistent TZ=Asia/Kolkata \
    LANG=de_DE.UTF-8 LC_ALL=de_DE.UTF-8 CAPTURED=1 DEB_BUILD_OPTIONS="nocheck parallel=3" NO_FAKE_STAT=1 faketime -f +400d dpkg-buildpackage "$1" -us -uc' - "$([ -n "${ONLY_ALL-}" ] && echo -A || echo -b)" \
  >"$place/build.log" 2>&1 || { tail -n 30 "$place/build.log" >&2; echo "the second build fails: $place/build.log" >&2; exit 1; }
n=0 differ=0
for deb in "$out"/*${ONLY_ALL:+_all}.deb; do
  n=$((n + 1))
  again=$place/${deb##*/}
  cmp -s "$deb" "$again" && continue
  differ=$((differ + 1))
  echo "${deb##*/} differs:"
  [ -e "$again" ] || { echo "  it is not built again"; continue; }
  for side in one two; do
    rm -rf "${place:?}/$side"
    dpkg-deb -R "$([ $side = one ] && echo "$deb" || echo "$again")" "$place/$side"
  done
  { diff -rq --no-dereference "$place/one" "$place/two" || true; } | head -n 20
  diff <(dpkg-deb -c "$deb") <(dpkg-deb -c "$again") | head -n 10 || true
done
echo "$n packages, $differ of them differ"
[ $n -gt 0 ] && [ $differ -eq 0 ]
