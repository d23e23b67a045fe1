# Sourced after tests/lib.sh by tests of the running service: its status, its end. They set `daemon`, its process, and
# `log`, its journal.
build=$root/${SST_BUILD:-build}
export SST_SOCKET=$tmp/c.sock
daemon=
watch_machine

now() { date +%s%N; }
# written FILE: until it is there and holds something, a process's number
written() { for _ in $(seq 600); do [ -s "$1" ] && return; sleep 0.1; done; }
# value PATH: member of the status
value() { "$sst" status --json 2>/dev/null | /usr/bin/python3 -c "
import json, sys
o = json.load(sys.stdin)
for k in '$1'.split('.'): o = o[k]
print(json.dumps(o))" 2>/dev/null; }
# until_is SECONDS PATH PYTHON: the member, v, is as wanted in time. What counts is when a look began that still saw it
# otherwise: how long it takes us to look is not the service's time.
until_is() {
  local start=$(now) v look
  local otherwise=$start end=$((start + ($1 * 12 + 60) * 1000000000))
  while look=$(now) && [ "$look" -lt $end ]; do
    v=$(value "$2")
    if [ -n "$v" ] && /usr/bin/python3 -c "import json, sys; v = json.loads(sys.argv[1]); sys.exit(not ($3))" "$v"; then
      quick $(((otherwise - start) / 1000000)) $(($1 * 1000)) || fail "$2 is $3, but too late"
      return
    fi
    otherwise=$look
    sleep 0.1
  done
  fail "$2 is $v, not $3: $(tail -n 3 "$log")"
}
# runs PID: and is not only waiting for its parent, which may be held up itself, to take notice of its end
runs() {
  local line threads=("/proc/$1/task/"*)
  { read -r line <"/proc/$1/stat"; } 2>/dev/null && [[ $line != *") Z "* || ${#threads[@]} -gt 1 ]]
}
# gone PID MS: the process ends in time
gone() {
  local start=$(now) ms
  for _ in $(seq 3000); do runs "$1" || break; sleep 0.02; done
  ms=$((($(now) - start) / 1000000))
  runs "$1" && kill -KILL "$1" 2>/dev/null && fail "process $1 does not end"
  quick $ms "$2" || fail "process $1 ended only after $ms ms: $(tail -n 3 "$log")"
}
