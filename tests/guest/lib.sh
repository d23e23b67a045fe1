# Sourced by tests/guest/*.sh, which run in the emulated machine as root, in the repository (read-only), with a kernel of
# their own: they load what modules they need and leave none that another test needs otherwise.
# Afterwards: $sst, $bin (programs of tests/guest), the current folder is $tmp (in memory), fail, skip, wait_for.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
sst=$PWD/${SST_BUILD:-build}/sst
bin=$PWD/${SST_BUILD:-build}/tests/guest
tmp=$(mktemp -d)
failed=0
loaded=()
cd "$tmp" || exit 1

# Started programs and loaded modules go again, whatever happened.
leave() {
  local rc=$? j m
  for j in $(jobs -p); do kill "$j" 2>/dev/null; done
  wait
  for m in "${loaded[@]}"; do
    [ ! -e "/sys/module/$m" ] || modprobe -r "$m" || { echo "FAIL: module $m is still in use"; rc=1; }
  done
  exit $rc
}
trap leave EXIT

fail() { echo "FAIL: $*"; failed=1; }
skip() { echo "$*"; exit 77; }

# wait_for SECONDS COMMAND...: until it succeeds; in the emulator one look takes about 0.2 s
wait_for() {
  local until=$((SECONDS + $1))
  shift
  until "$@" >/dev/null 2>&1; do
    [ $SECONDS -lt $until ] || return 1
    sleep 0.1
  done
}

# load MODULE [OPTION...]; what udev has to do about it is done afterwards
load() {
  modprobe "$@" || { fail "modprobe $*"; exit 1; }
  loaded=("$1" "${loaded[@]}")
  udevadm settle --timeout=30 || fail "udev does not come to rest after $1"
}

# json FILE EXPRESSION: print a Python expression over the document j
json() { python3 -c 'import json,sys; j = json.load(open(sys.argv[1])); print(eval(sys.argv[2]))' "$1" "$2"; }

# holds FILE EXPRESSION...: Python expressions over the document j; those that are false fail
holds() {
  python3 - "$@" <<'P' || failed=1
import json, sys
j = json.load(open(sys.argv[1]))
wrong = [e for e in sys.argv[2:] if eval(e) is not True]
for e in wrong:
    print("FAIL: %s: not %s" % (sys.argv[1], e))
if wrong:
    print(j)
sys.exit(bool(wrong))
P
}

# is WHAT GOT WANTED
is() { [ "$2" = "$3" ] || fail "$1: $2, not $3"; }

# says FILE WORDS...: all of them are in the file
says() {
  local file=$1 w
  shift
  for w in "$@"; do grep -qiF -- "$w" "$file" || fail "no '$w' in: $(head -c 1000 "$file")"; done
}

# wire_up FROM/value TO/pull: in the background until cut; then $pulses
wire_up() {
  "$bin/wire" "$1" "$2" >wired & wire=$!
  wait_for 10 grep -q wired wired || fail "no wire"
}
cut_wire() {
  kill $wire
  wait $wire
  pulses=$(tail -n 1 wired)
}
