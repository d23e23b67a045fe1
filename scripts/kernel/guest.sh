# In the emulated machine: run the tests that /results/tests names, one after the other, each with a deadline. For each
# its output is left in /results/NAME.log, the kernel's in NAME.dmesg and its exit status in NAME.rc; what the host's user
# sees comes over the second serial line.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
show() { echo "$*" >/dev/ttyS1; }

run() { # NAME: tests/guest/NAME.sh
  local name=$1 rc start=$SECONDS took
  dmesg -c >/dev/null
  timeout -k 10 "$GUEST_DEADLINE" bash "tests/guest/$name.sh" >"/results/$name.log" 2>&1 </dev/null
  rc=$?
  took=$((SECONDS - start))
  dmesg >"/results/$name.dmesg"
  # A kernel that complains is a finding, whatever the test thinks.
  if [ $rc = 0 ] && grep -qE 'Oops|BUG:|WARNING: CPU|general protection' "/results/$name.dmesg"; then
    grep -m1 -E 'Oops|BUG:|WARNING: CPU|general protection' "/results/$name.dmesg" >>"/results/$name.log"
    rc=70
  fi
  echo $rc >"/results/$name.rc"
  case $rc in
    0) show "pass  $name (${took} s)";;
    77) show "skip  $name: $(tail -n 1 "/results/$name.log")";;
    124|137) show "FAIL  $name: no end after ${took} s: $(tail -n 1 "/results/$name.log")";;
    *) show "FAIL  $name (exit $rc, ${took} s)"; show "$(grep -a FAIL "/results/$name.log" | head -n 20 | sed 's/^/      /')";;
  esac
}

show "check-kernel: Linux $(uname -r) is up after $(cut -d' ' -f1 /proc/uptime) s"
while read -r name; do run "$name"; done </results/tests
