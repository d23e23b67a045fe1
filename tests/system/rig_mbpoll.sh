#!/usr/bin/env bash
# The simulated drives as somebody else's Modbus client sees them, over TCP and RTU: homed and moved by mbpoll alone.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
. "$(dirname "$0")/../lib.sh"
sim=$root/${SST_BUILD:-build}/sst-sim
command -v mbpoll >/dev/null || skip "mbpoll is not installed"
[ -x "$sim" ] || skip "sst-sim is not built"

cat >inside.sh <<'INSIDE'
set -u
port=$(LD_PRELOAD= "$sim" status --json | sed -n 's/.*tcp:127.0.0.1:\([0-9]*\).*/\1/p')
value() { LD_PRELOAD= timeout 60 mbpoll -o 10 -q -1 -0 -B -m tcp -p "$port" "$@" 127.0.0.1 | sed -n 's/^\[[0-9]*\]:[^-0-9]*//p' | head -n 1; }
put() { local reg=$1; shift; LD_PRELOAD= timeout 60 mbpoll -o 10 -q -0 -B -m tcp -p "$port" -a 1 -r "$reg" "${@:2}" 127.0.0.1 -- "$1" >/dev/null; }
status() { value -a 1 -t 3 -r 0; }
wait_for() { # MASK WANT WHAT
  for _ in $(seq 600); do [ $(( $(status) & $1 )) -eq "$2" ] && return; sleep 0.1; done
  echo "FAIL: $3: status $(status)"; exit 1
}
[ "$(value -a 1 -t 3 -r 16)" = 21331 ] || { echo "FAIL: device is not 0x5353"; exit 1; }
put 0 1 -t 4; wait_for 2 2 "not enabled"
put 0 5 -t 4; wait_for 16 16 "not homed"
put 2 12345 -t 4:int
put 0 1 -t 4; put 0 3 -t 4; wait_for 12 8 "not in position"
at=$(value -a 1 -t 3:int -r 2)
[ "$at" -ge 12335 ] && [ "$at" -le 12355 ] || { echo "FAIL: at $at, not 12345"; exit 1; }
line=$(readlink "$SST_SIM_DIR/dev/serial/by-id/usb-sim_rig")
rtu=$(LD_PRELOAD= timeout 60 mbpoll -o 10 -q -1 -0 -B -m rtu -b 19200 -P even -a 1 -t 3:int -r 2 "$line" | sed -n 's/^\[[0-9]*\]:[^-0-9]*//p')
[ $((rtu - at)) -ge -3 ] && [ $((rtu - at)) -le 3 ] || { echo "FAIL: RTU says $rtu, TCP $at"; exit 1; }
LD_PRELOAD= timeout 60 mbpoll -o 10 -q -1 -0 -m tcp -p "$port" -a 1 -t 4 -r 64 127.0.0.1 2>&1 | grep -qi "illegal data address" || { echo "FAIL: no exception 2"; exit 1; }
INSIDE
export sim
timeout 600 "$sim" --quiet --rig --rig-port 0 --world "$root/simulators/scene/world/worlds/small-rig.yaml" -- bash inside.sh || fail "see above"
exit $failed
