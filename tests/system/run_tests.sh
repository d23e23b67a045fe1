#!/usr/bin/env bash
# scripts/run_tests.sh: failures and their report.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
. "$(dirname "$0")/../lib.sh"
make_test() { printf '#!/bin/bash\n%s\n' "$2" >"$1" && chmod +x "$1"; }
make_test good 'exit 0'
make_test skipped 'echo no such thing here; exit 77'
make_test bad 'seq 100; echo "FAIL: it is bad"; seq 100; exit 1'
make_test crashes 'kill -SEGV $$'
make_test hangs 'sleep 100'
make_test late 'echo "attempt 1: a machine that was late"; echo "attempt 2: again"; echo "not judged: late, 2 times"'
make_test second '[ -e "$0.been" ] && exit 0; touch "$0.been"; exit 1'
make_test reported "echo 'WARNING: ThreadSanitizer: of a child'"
make_test unseen.sh "echo 'ERROR: AddressSanitizer: of a child' >\"\${ASAN_OPTIONS##*log_path=}.123\""

# runs CODE SUM TESTS...: the runner's exit status and its last line
runs() {
  local code=$1 sum=$2 rc
  shift 2
  TEST_LIMIT=5 "$root/scripts/run_tests.sh" "${@/#/$tmp/}" >out 2>err
  rc=$?
  [ "$rc" -eq "$code" ] || fail "$*: exit $rc, not $code: $(cat out err)"
  [ "$(tail -n 1 out)" = "$sum" ] || fail "$*: not '$sum': $(cat out err)"
}

runs 0 '1 passed, 0 failed, 1 skipped' good skipped
runs 1 '1 passed, 1 failed, 0 skipped' good bad
[ "$(grep -A 1 '^FAIL' out | tail -n 1)" = '   >  FAIL: it is bad' ] || fail "what tells why is not told first: $(cat out)"
[ "$(grep -c '^      100$' out)" -eq 2 ] || fail "not all is shown: $(cat out)"
runs 1 '0 passed, 1 failed, 0 skipped' crashes
runs 1 '0 passed, 1 failed, 0 skipped' hangs
grep -q 'not ended after 5 s' out || fail "a hang is not told: $(cat out)"
runs 0 '2 passed, 0 failed, 0 skipped' late good
grep -q '^attempts repeated: 2, not judged in the end: 1; .*late 2$' out || fail "attempts are not counted: $(cat out)"
RETRIES=2 runs 0 '1 passed, 0 failed, 0 skipped' second
grep -q '^attempts repeated: 1, .*second 1$' out || fail "a run again is not counted: $(cat out)"
RETRIES=2 runs 1 '0 passed, 1 failed, 0 skipped' bad
runs 1 '0 passed, 1 failed, 0 skipped' reported
runs 1 '0 passed, 1 failed, 0 skipped' unseen.sh
grep -q 'AddressSanitizer: of a child' out || fail "the report is not shown: $(cat out)"
# Levels of the processor: the test is the file behind the @.
make_test level '[ "$SST_CPU $ONEDNN_MAX_CPU_ISA" = "avx2 AVX2" ]'
make_test reference '[ "$SST_CPU ${ONEDNN_MAX_CPU_ISA-none}" = "ref none" ]'
"$root/scripts/run_tests.sh" "avx2@$tmp/level" "ref@$tmp/reference" "$tmp/level" >out 2>err && fail "a level is taken without its word: $(cat out)"
[ "$(tail -n 1 out)" = '2 passed, 1 failed, 0 skipped' ] && grep -q "^pass  avx2@$tmp/level" out || fail "levels: $(cat out err)"
# Tests that the table chooses by name are there, and alone run.
sed -nE 's,^([^# ]+) +(timing|threads) +\[([^]]*)\].*,\1 \3,p' "$root/tests/special.txt" >chosen
while read -r name tests; do
  for t in $tests; do
    grep -q "^static void $t(" "$root/tests/$name.c" || fail "tests/special.txt chooses $t, which $name has not"
  done
done <chosen
SST_TESTS=none "${sst%/sst}/tests/kernels/sha256" >out 2>&1 || fail "none of its tests: $(cat out)"
! grep -q RUN out || fail "a test runs that was not chosen: $(cat out)"
exit $failed
