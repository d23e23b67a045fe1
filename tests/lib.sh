# Sourced by tests/system/*.sh: finds the program, works in a folder that goes at the end, and judges refusals.
# Afterwards: $root (the repository), $sst, $tmp (the current folder), $failed.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
cd "$(dirname "${BASH_SOURCE[0]}")/.." || exit 1
root=$PWD
sst=$PWD/${SST_BUILD:-build}/sst
# Other people's programs are judged by what they say, and there are paths that LD_PRELOAD and systemd's units cannot hold.
export LC_ALL=C.UTF-8
unset LANGUAGE
case ${TMPDIR-} in *[!A-Za-z0-9/._-]*) unset TMPDIR;; esac
tmp=$(mktemp -d)
trap 'rm -rf "$tmp"' EXIT
cd "$tmp" || exit 1
failed=0

fail() { echo "FAIL: $*"; failed=1; }

# skip WHY: the rest cannot be tried here; earlier failures stay
skip() { echo "$*"; [ "$failed" -eq 0 ] || exit 1; exit 77; }

# need PART: skips in a build without it, by its name in `sst version --json`
need() { "$sst" version --json | grep -q "\"$1\": true" || skip "built without $1"; }

# ended PID WHAT: the end of a child, for a minute at most. Its exit status
ended() {
  for _ in $(seq 600); do kill -0 "$1" 2>/dev/null || break; sleep 0.1; done
  kill -KILL "$1" 2>/dev/null && fail "$2 does not end within a minute"
  wait "$1"
}

# repeats N WHY: this attempt is not judged, as the machine was late, and another one follows; scripts/run_tests.sh counts these lines
repeats() { echo "attempt $1: $2"; }

# quick MS LIMIT_MS: it took no longer; outside `make check-timing` (SST_TIMING) half a minute more is fine, as in tests/quick.h
quick() { [ "$1" -le $(($2 + (${#SST_TIMING} ? 0 : 30000))) ]; }

# judge CODE WORDS RC WHAT: of a run whose standard error is in ./err; ./bad* must not exist afterwards
judge() {
  [ "$3" -eq "$1" ] || fail "$4: exit $3, not $1: $(head -c 300 err)"
  [ "$(wc -l <err)" -eq 1 ] || fail "$4: not one line: $(head -c 600 err)"
  case $(head -c 12 err) in "sst: error: ") ;; *) fail "$4: not an error: $(head -c 300 err)";; esac
  grep -qi -- "$2" err || fail "$4: no '$2' in: $(head -c 300 err)"
  [ -z "$(compgen -G 'bad*')" ] || fail "$4: left $(echo bad*)"
  [ -z "$(find . -name '*.tmp-*')" ] || fail "$4: left $(find . -name '*.tmp-*')"
  rm -rf bad*
}

# comparisons ARGS...: dispatches in the comparisons that the dummy device passes as a command opens it; its faults count from them on
comparisons() {
  local lost=0 opened=8192 at # a loss at these dispatches fails the opening, and does not
  while [ $((opened - lost)) -gt 1 ]; do
    at=$(((lost + opened) / 2))
    if "$sst" "$@" --device dummy:lost=$at >/dev/null 2>&1; then opened=$at; else lost=$at; fi
  done
  echo $lost
}

# want CODE WORDS ARGS...: exit code, one line of error with these words, no output
want() {
  local code=$1 words=$2
  shift 2
  "$sst" "$@" >/dev/null 2>err
  judge "$code" "$words" $? "sst $*"
}
