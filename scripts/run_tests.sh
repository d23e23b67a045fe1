#!/usr/bin/env bash
# Run test programs one after another; exit status 77 is a skip and says why on its last line.
set -u
passed=0 failed=0 skipped=0
export SST_BUILD="${SST_BUILD:-build}"
export TSAN_OPTIONS="${TSAN_OPTIONS:-suppressions=$(dirname "$0")/tsan.supp}"
for t in "$@"; do
  start=$(date +%s%N)
  out=$("$t" 2>&1 </dev/null); rc=$?
  ms=$(( ($(date +%s%N) - start) / 1000000 ))
  case $rc in
    0) passed=$((passed + 1)); echo "pass  $t (${ms} ms)";;
    77) skipped=$((skipped + 1)); echo "skip  $t: $(tail -n 1 <<<"$out")";;
    *) failed=$((failed + 1)); echo "FAIL  $t (exit $rc)"; echo "$out" | sed 's/^/      /';;
  esac
done
echo
echo "$passed passed, $failed failed, $skipped skipped"
[ "$failed" -eq 0 ]
