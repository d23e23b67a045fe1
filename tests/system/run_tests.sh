#!/usr/bin/env bash
# scripts/run_tests.sh: what counts as a failure, and what gets a second run.
. "$(dirname "$0")/../lib.sh"
mkdir -p tests/sim tests/unit
make_test() { printf '#!/bin/bash\n%s\n' "$2" >"tests/$1" && chmod +x "tests/$1"; }
make_test sim/good 'exit 0'
make_test sim/skipped 'echo no such thing here; exit 77'
make_test sim/bad 'seq 100; echo "FAIL: it is bad"; seq 100; exit 1'
make_test sim/once "[ ! -e $tmp/seen ] || exit 0; touch $tmp/seen; echo 'FAIL: too late'; exit 1"
make_test sim/crashes 'kill -SEGV $$'
make_test sim/child_crashes "bash -c 'kill -SEGV \$\$; exit 0'; exit 1"
make_test sim/hangs 'sleep 100'
make_test sim/reported "echo 'WARNING: ThreadSanitizer: of a child'"
make_test sim/unseen.sh "echo 'ERROR: AddressSanitizer: of a child' >\"\${ASAN_OPTIONS##*log_path=}.123\""
make_test unit/array 'exit 1' # one-thread, as the table of special tests says

# runs CODE WORDS TESTS...: the runner's exit status, and a line of what it says
runs() {
  local code=$1 words=$2 rc
  shift 2
  TEST_LIMIT=5 AGAIN_MOST=2 "$root/scripts/run_tests.sh" "${@/#/$tmp/tests/}" >out 2>err
  rc=$?
  [ "$rc" -eq "$code" ] || fail "$*: exit $rc, not $code: $(cat out err)"
  grep -qE -- "$words" out || fail "$*: no '$words' in: $(cat out err)"
}

# said WORD TEST: by a line of the last run
said() { grep -qE -- "^$1 .*tests/$2 " out || fail "$2: not '$1' in: $(cat out)"; }

# fails_at_once TEST: without a second run
fails_at_once() {
  runs 1 '^0 passed, 1 failed, 0 skipped$' "$1"
  said FAIL "$1"
}

runs 0 '^1 passed, 0 failed, 1 skipped$' sim/good sim/skipped
runs 1 '^1 passed, 1 failed, 0 skipped; 1 of them run twice' sim/good sim/bad
said again sim/bad
said FAIL sim/bad
[ "$(grep -A 1 '^FAIL' out | tail -n 1)" = '   >  FAIL: it is bad' ] || fail "what tells why is not told first: $(cat out)"
runs 0 '^2 passed, 0 failed, 0 skipped; 1 of them run twice' sim/once sim/good
said again sim/once
grep -q 'too late' out || fail "the first failure is not shown: $(cat out)"
grep -q '^pass .*once.* in its second run$' out || fail "the second run is not told: $(cat out)"

fails_at_once sim/crashes
fails_at_once sim/child_crashes
fails_at_once sim/hangs
grep -q 'not ended after 5 s' out || fail "a hang is not told: $(cat out)"
fails_at_once unit/array
fails_at_once sim/reported
fails_at_once sim/unseen.sh
grep -q 'AddressSanitizer: of a child' out || fail "the report is not shown: $(cat out)"

# So many at once are no chance.
for name in one two three; do make_test sim/$name 'exit 1'; done
runs 1 '^0 passed, 3 failed, 0 skipped; 2 of them run twice' sim/one sim/two sim/three
exit $failed
