#!/usr/bin/env bash
# scripts/deps.sh on a machine whose mirror does not answer at first: tried again; nothing is asked of apt when all is there.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
set -u
. "$(dirname "$0")/../lib.sh"

mkdir bin there
# fake NAME: a program of this name, from standard input
fake() { { printf '#!/bin/bash\ncd %q || exit 1\n' "$tmp"; cat; } >"bin/$1" && chmod +x "bin/$1"; }
fake dpkg-query <<'F'
for p in "$@"; do :; done
[ -e "there/$p" ] && printf 'install ok installed'
F
fake apt-get <<'F'
echo "$*" >>calls
[[ $* != *update* ]] || exit 100
echo >>installs
[ "$(wc -l <installs)" -gt "$(cat fails)" ] || exit 100
for p in "$@"; do [[ $p == -* || $p == *=* ]] || : >"there/$p"; done
F
fake sudo <<'F'
[ "$1" = env ] || exit 1
exec "$@"
F
fake sleep <<'F'
echo "$1" >>slept
F
deps() { rm -f calls installs slept; echo "$1" >fails; PATH=$tmp/bin:$PATH "$root/scripts/deps.sh" >out 2>&1; }

deps 2 || fail "two failures are the end: $(cat out)"
[ "$(wc -l <installs)" -eq 3 ] && [ "$(cat slept)" = $'5\n20' ] || fail "tried $(wc -l <installs) times, waited $(cat slept)"
[ -e there/gcc ] && [ -e there/python3-numpy ] && [ ! -e there/boards ] || fail "installed: $(ls there)"
deps 9 || fail "all is there: $(cat out)"
[ ! -e calls ] || fail "apt was asked for what is there: $(cat calls)"
rm there/gcc
deps 9 && fail "says that a package is there that is not"
grep -q "missing packages: gcc; they cannot be installed" out || fail "not told: $(cat out)"
[ "$(wc -l <installs)" -eq 4 ] || fail "tried $(wc -l <installs) times"
deps 0 || fail "the missing one: $(cat out)"
grep -q ' install .*gcc$' calls && ! grep -q 'install.*make' calls || fail "more than what is missing: $(cat calls)"
exit $failed
