# Sourced after tests/lib.sh by tests of the running service: its status, its end. They set `daemon`, its process, and
# `log`, its journal. A question without an answer within a minute ends the test with the service's stacks (ask.sh).
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
build=$root/${SST_BUILD:-build}
export SST_SOCKET=$tmp/c.sock
daemon=
export SST_TEST_PID=$$ SST_TEST_OUT=8
exec 8>&1
mkdir ask
printf '#!/bin/sh\nexec "%s" "%s" "$@"\n' "$root/tests/ask.sh" "$sst" >ask/sst
chmod +x ask/sst
sst=$tmp/ask/sst
curl() { "$root/tests/ask.sh" curl "$@"; }

now() { date +%s%N; }
# written FILE: until it is there and holds something, a process's number
written() { for _ in $(seq 600); do [ -s "$1" ] && return; sleep 0.1; done; }
# value PATH [PYTHON]: member of the status, v; exit status 0 if it is as wanted
value() { "$sst" status --json 2>/dev/null | /usr/bin/python3 -c "
import json, sys
v = json.load(sys.stdin)
for k in '$1'.split('.'): v = v[k]
print(json.dumps(v))
sys.exit(not (${2:-True}))" 2>/dev/null; }
# until_is SECONDS PATH PYTHON: the member, v, is as wanted in time. What counts is when a look began that still saw it
# otherwise: how long it takes us to look is not the service's time. Looks take processors, and come close together only where
# limits of time are exact.
until_is() {
  local start=$(now) v= look
  local pause=$([ -n "${SST_TIMING-}" ] && echo 0.1 || echo 0.3)
  local otherwise=$start end=$((start + ($1 + 30) * 1000000000))
  while look=$(now) && [ "$look" -lt $end ]; do
    if v=$(value "$2" "$3"); then
      quick $(((otherwise - start) / 1000000)) $(($1 * 1000)) || fail "$2 is $3, but too late"
      return
    fi
    otherwise=$look
    sleep "$pause"
  done
  fail "$2 is $v, not $3: $(tail -n 3 "$log")"
  [ -z "$v" ] || return # it answers
  "$root/scripts/stacks.sh" "$daemon"
  exit 1
}
# runs PID: and is not only waiting for its parent, which may be held up itself, to take notice of its end
runs() {
  local line threads=("/proc/$1/task/"*)
  { read -r line <"/proc/$1/stat"; } 2>/dev/null && [[ $line != *") Z "* || ${#threads[@]} -gt 1 ]]
}
# gone PID MS: the process ends in time
gone() {
  local start=$(now) ms
  while runs "$1" && [ $((($(now) - start) / 1000000)) -lt 60000 ]; do sleep 0.02; done
  ms=$((($(now) - start) / 1000000))
  if runs "$1"; then
    "$root/scripts/stacks.sh" "$1"
    kill -KILL "$1" 2>/dev/null && fail "process $1 does not end"
  fi
  quick $ms "$2" || fail "process $1 ended only after $ms ms: $(tail -n 3 "$log")"
}
