#!/usr/bin/env bash
# apt 2.6.2: a package with `Protected: yes` is as hard to remove as an essential one, though only dpkg's own removal forces are named for the
# field: `apt-get -y remove` refuses the whole list with it (exit 100), also a package that was installed as a dependency a moment before.
# systemd-sysv has the field since Debian 13, so piuparts on Debian 12 fails packages there that bring it by their dependencies.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
. "$(dirname "$0")/../scripts/finding.sh"
unpack apt=2.6.2 libapt-pkg6.0=2.6.2
mkdir -p state/lists/partial cache/archives/partial sources
for p in plain guarded; do
  printf 'Package: %s\nStatus: install ok installed\nMaintainer: x <x@example.org>\nArchitecture: amd64\nVersion: 1\nDescription: x\n' $p
  [ $p = plain ] || echo 'Protected: yes'
  echo
done >status
removed() {
  rc=0
  apt-get -o Dir::State=state -o Dir::Cache=cache -o Dir::State::status="$tmp/status" -o Dir::Etc::sourcelist=/dev/null -o Dir::Etc::sourceparts="$tmp/sources" \
    -o Debug::NoLocking=1 -o APT::Architecture=amd64 -y -s remove "$@" >out 2>err || rc=$?
  echo "$*: exit $rc$(grep -o 'Essential packages were removed' err | sed 's/^/, /')"
}
{ removed plain; removed plain guarded; } | tee seen
printf '%s\n' 'plain: exit 0' 'plain guarded: exit 100, Essential packages were removed' >expected
holds "a protected package is refused as an essential one, with all that were named beside it" cmp -s seen expected
# Seen: these two lines
