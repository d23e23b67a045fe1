# Sourced by findings/*.sh: a temporary folder, pinned packages unpacked into it, and how a finding ends.
# shellcheck shell=bash
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
set -eu
here=$(cd "$(dirname "$0")" && pwd)
tmp=$(mktemp -d)
trap 'kill $(jobs -p) 2>/dev/null || true; rm -rf "$tmp"' EXIT
cd "$tmp"
root=$tmp/root lib=$tmp/root/usr/lib/$(gcc -print-multiarch)
export LD_LIBRARY_PATH=$lib PATH=$root/usr/bin:$root/usr/sbin:$PATH

# unpack PACKAGE=VERSION... [DEPENDENCY...]: Debian's packages, in these versions, and what they need, below $root; nothing is installed
unpack() {
  local p
  mkdir -p debs "$root"
  for p in "$@"; do
    (cd debs && apt-get -qq download "$p" 2>err) || { echo "$p cannot be downloaded: $(tail -n 1 debs/err)"; exit 2; }
  done
  for p in debs/*.deb; do dpkg-deb -x "$p" "$root"; done
  printf 'with %s\n' debs/*.deb | sed 's,debs/,,'
}
# needed_by PACKAGE: what this machine lacks of its dependencies
needed_by() { apt-get -s --no-install-recommends install "$1" | awk -v p="$1" '/^Inst/ && $2 != p { print $2 }'; }
# compile SOURCE FLAGS...: builds SOURCE.c against what was unpacked
compile() { gcc -O1 -w -I"$root/usr/include" -I"$root/usr/include/$(gcc -print-multiarch)" "$1.c" -o "$1" -L"$lib" "${@:2}"; }
# holds "BEHAVIOUR" CONDITION...: ends the finding: 0 where the condition is true, 1 where the behaviour has changed
holds() {
  if "${@:2}"; then echo "holds: $1"; else echo "CHANGED: $1"; exit 1; fi
}
