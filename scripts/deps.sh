#!/usr/bin/env bash
# deps.sh [LIST | --missing LIST]: install the packages of scripts/packages.txt, or of that list, that are missing; or only
# print them. Needs root or sudo only when something is missing.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
set -eu
cd "$(dirname "$0")/.."
print=
[ "${1-}" != --missing ] || { print=yes; shift; }
packages=$(sed 's/#.*//' "${1:-scripts/packages.txt}")

find_missing() {
  local p
  missing=()
  for p in $packages; do
    dpkg-query -W -f='${Status}' "$p" 2>/dev/null | grep 'ok installed' >/dev/null || missing+=("$p")
  done
}

find_missing
[ ${#missing[@]} -eq 0 ] && exit 0
[ -z "$print" ] || { echo "${missing[*]}"; exit 0; }
sudo=
if [ "$(id -u)" -ne 0 ]; then
  command -v sudo >/dev/null || { echo "missing packages: ${missing[*]}; install them as root" >&2; exit 1; }
  sudo=sudo
fi
# A mirror that does not answer, and another program that holds apt's lock, are often over after a while.
apt() { $sudo env DEBIAN_FRONTEND=noninteractive apt-get -qq -o Acquire::Retries=3 -o DPkg::Lock::Timeout=300 "$@"; }
for pause in 5 20 60 0; do
  echo "installing: ${missing[*]}"
  # What matters of the lists is whether the packages come: of another source that fails they need nothing.
  apt update || echo "not all lists of packages are new" >&2
  apt install -y --no-install-recommends "${missing[@]}" && exit 0
  find_missing
  [ ${#missing[@]} -eq 0 ] && exit 0
  [ "$pause" -eq 0 ] || { echo "once more in $pause s" >&2; sleep "$pause"; }
done
echo "missing packages: ${missing[*]}; they cannot be installed" >&2
exit 1
