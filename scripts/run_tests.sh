#!/usr/bin/env bash
# Run test programs: JOBS at a time (three more than there are processors). Tests that tests/special.txt marks `waits` run one
# after the other in a third of these places, so that processors are busy beside them; tests marked `first` before the others.
# A program's build is the folder that its tests/ lies in; scripts run on SST_BUILD. avx2@TEST runs it as on a processor with
# AVX2 alone, ref@TEST with the references of all kernels, plain@TEST the part that sanitized builds leave out. Each test's
# output is shown whole, in that order, waiting tests at the end. Exit status 77 is a skip; the last line of its output is the
# reason. A test that takes longer than TEST_LIMIT seconds is killed with all its processes, after their stacks are shown. A
# report of a sanitizer in any process of a test fails it, even if the test did not notice. RETRIES=N: a test that fails is run
# up to N times again, for limits of time that a busy machine may miss. Attempts that tests repeat themselves ("attempt N:
# why"), limits not judged in the end ("not judged: why") and such runs are counted, and named before the last line.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
set -u
cd "$(dirname "$0")/.." || exit 1
export SST_BUILD="${SST_BUILD:-build}"
case $SST_BUILD in /*) plain=$SST_BUILD;; *) plain=$PWD/$SST_BUILD;; esac
export TSAN_OPTIONS="${TSAN_OPTIONS:-suppressions=$PWD/scripts/tsan.supp}"
export LSAN_OPTIONS="${LSAN_OPTIONS:-suppressions=$PWD/scripts/lsan.supp:print_suppressions=0}"
jobs=${JOBS:-$(($(nproc) + 3))} limit=${TEST_LIMIT:-900}
dir=$(mktemp -d) || exit 1
trap 'kill $(jobs -p) 2>/dev/null; wait; rm -rf "$dir"' EXIT
trap 'exit 130' INT TERM
mkfifo "$dir/nothing" || exit 1
# Simulated worlds are prepared once, for the sanitized builds too, which take minutes for it.
export XDG_CACHE_HOME="${XDG_CACHE_HOME:-$PWD/build/cache}"
# Mesa compiles a shader once for all tests, also for those with a cache of pipelines of their own.
export MESA_SHADER_CACHE_DIR="${MESA_SHADER_CACHE_DIR:-$XDG_CACHE_HOME}"

# marked WORD TEST: as the table says, where tests are called unit/disparity, system/page
marked() {
  local name=${2##*tests/}
  grep -qE "^${name%.sh} +$1( |\$)" tests/special.txt
}

tests=() rest=() waiting=()
for t in "$@"; do
  if marked waits "$t"; then waiting+=("$t"); elif marked first "$t"; then tests+=("$t"); else rest+=("$t"); fi
done
tests+=("${rest[@]}")
busy=${#tests[@]} # those from here on wait
tests+=("${waiting[@]}")

# chosen WORD TEST: the names in brackets behind the word: the tests of this program that are asked for
chosen() {
  local name=${2##*tests/}
  sed -nE "s,^${name%.sh} +$1 +\[([^]]*)\].*,\1,p" tests/special.txt
}

# tree PID: it and all below it
tree() {
  local p
  echo "$1"
  for p in $(pgrep -P "$1"); do tree "$p"; done
}

# use_build TEST: what its build asks of the environment
use_build() {
  case $1 in *.sh) ;; */tests/*/*) export SST_BUILD=${1%/tests/*/*};; esac
  case $SST_BUILD in
    *thread*) export SST_TEST_SMALL=2;;
    *address*) export SST_TEST_SMALL=1;;
  esac
  marked unsound "$1" || export SST_TRAP_ALL=1
  local names=
  case $SST_BUILD in *thread*) names=$(chosen threads "$1");; esac
  [ -z "${SST_TIMING-}" ] || names=$(chosen timing "$1")
  [ -z "$names" ] || export SST_TESTS=$names
  # The address sanitizer wants to be loaded first; nothing in this library is its concern. An emulator starts threads itself.
  if [ -z "${SST_RUNNER-}" ] && [ -e "$plain/one_thread.so" ] && marked one-thread "$1"; then
    export LD_PRELOAD=$plain/one_thread.so ASAN_OPTIONS="verify_asan_link_order=0:${ASAN_OPTIONS:-}"
  fi
}

# use_level TEST: the processor and the tests of it that it asks for. $test: the same without it
use_level() {
  local names=
  test=$1
  case $1 in
    avx2@*) export SST_CPU=avx2 ONEDNN_MAX_CPU_ISA=AVX2; test=${1#avx2@} names=$(chosen processor "$test");;
    ref@*) export SST_CPU=ref; test=${1#ref@};;
    plain@*) test=${1#plain@} names=$(grep -oP 'plain_test\(\K\w+' "tests/${test##*tests/}.c" | xargs);;
  esac
  [ -z "$names" ] || export SST_TESTS=$names # tests/test.h
}

# used <TIMES: milliseconds of processors that a shell's children took
used() { awk -F'[ms ]+' 'NR == 2 { print int(60000 * $1 + 1000 * $2 + 60000 * $3 + 1000 * $4) }'; }

# run NUMBER: output in NUMBER.out, at the end status, milliseconds and those of processors in NUMBER.end
run() {
  local start pid rc watch test tries=0
  use_level "${tests[$1]}"
  use_build "$test"
  start=$(date +%s%N)
  # A script may look for other things in what a program says, or at nothing.
  if [[ $test = *.sh ]]; then
    export ASAN_OPTIONS="${ASAN_OPTIONS:-}:log_path=$dir/$1.report" UBSAN_OPTIONS="${UBSAN_OPTIONS:-}:log_path=$dir/$1.report"
  fi
  # A session, by which all is found that it leaves behind.
  while true; do
    setsid timeout -k 10 "$limit" ${SST_RUNNER-} "$test" >>"$dir/$1.out" 2>&1 </dev/null & pid=$!
    # Waits without a child, which could outlive it and keep our output open.
    (read -r -t "$((limit - limit / 10))" <>"$dir/nothing"; for p in $(tree $pid); do scripts/stacks.sh "$p"; done >"$dir/$1.stuck" 2>&1) & watch=$!
    trap 'kill $pid $watch 2>/dev/null; wait $pid; pkill -KILL -s $pid; exit' TERM
    wait $pid; rc=$?
    pkill -KILL -s $pid
    kill $watch 2>/dev/null; wait $watch 2>/dev/null
    [ "$rc" -ne 124 ] || cat "$dir/$1.stuck" >>"$dir/$1.out"
    [ "$rc" -ne 0 ] && [ "$rc" -ne 77 ] && [ "$tries" -lt "${RETRIES:-0}" ] || break
    tries=$((tries + 1))
    echo "attempt $tries: exit $rc" >>"$dir/$1.out"
  done
  times >"$dir/$1.times"
  echo "$rc $(( ($(date +%s%N) - start) / 1000000 ))" "$(used <"$dir/$1.times")" >"$dir/$1.new"
  mv "$dir/$1.new" "$dir/$1.end"
}

# reported NUMBER: by a sanitizer, in any of its processes
reported() { grep -qE '(ERROR|WARNING): [A-Za-z]*Sanitizer|: runtime error: ' "$dir/$1.out"; }

shown=0 passed=0 failed=0 skipped=0 repeated=0 unjudged=0 late=
show() {
  local rc ms cpu t out n not
  while [ -e "$dir/$shown.end" ]; do
    read -r rc ms cpu <"$dir/$shown.end"
    t=${tests[$shown]} out=$dir/$shown.out
    cat "$dir/$shown.report".* >>"$out" 2>/dev/null
    if reported "$shown" && { [ "$rc" -eq 0 ] || [ "$rc" -eq 77 ]; }; then rc="$rc, but a sanitizer has reported"; fi
    case $rc in
      0) passed=$((passed + 1)); echo "pass  $t (${ms} ms, CPU ${cpu} ms)";;
      77) skipped=$((skipped + 1)); echo "skip  $t: $(tail -n 1 "$out")";;
      *) failed=$((failed + 1))
         [ "$rc" != 124 ] || echo "not ended after $limit s" >>"$out"
         echo "FAIL  $t (exit $rc, ${ms} ms)"
         # What tells why, then all of it.
         grep -E '^FAIL|^\[ +(ERROR|LINE|FAILED) +\]|^ERROR|rror: |SUMMARY' "$out" | head -n 10 | sed 's/^/   >  /'
         sed 's/^/      /' "$out";;
    esac
    n=$(grep -cE '^attempt [0-9]+: ' "$out") not=$(grep -c '^not judged: ' "$out")
    repeated=$((repeated + n)) unjudged=$((unjudged + not))
    [ "$((n + not))" -eq 0 ] || late+=" ${t##*tests/} $n"
    shown=$((shown + 1))
  done
}

# run_waiting LANE: waiting tests one by one, each of its LANES-th
run_waiting() {
  trap 'kill $!; wait; exit' TERM
  for ((i = busy + $1; i < ${#tests[@]}; i += lanes)); do
    run "$i" &
    wait $!
  done
}

running=0
lanes=$(((jobs + 1) / 3 < ${#waiting[@]} ? (jobs + 1) / 3 : ${#waiting[@]}))
[ "$lanes" -gt 0 ] || lanes=$((${#waiting[@]} > 0))
while [ "$running" -lt "$lanes" ]; do
  run_waiting "$running" &
  running=$((running + 1))
done
for ((i = 0; i < busy; i++)); do
  while [ "$running" -ge "$jobs" ]; do wait -n; running=$((running - 1)); show; done
  run "$i" &
  running=$((running + 1))
done
wait
show
echo
[ -z "$late" ] || echo "attempts repeated: $repeated, not judged in the end: $unjudged;$late"
echo "$passed passed, $failed failed, $skipped skipped"
[ "$failed" -eq 0 ] && [ "$shown" -eq $# ]
