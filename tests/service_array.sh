# Sourced after tests/service_lib.sh: a 6x6 array of small simulated cameras in a session that stays while services come and go.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
log=sstd.log

cat >sstd.yaml <<YAML
array: {rows: 6, cols: 6}
cameras:
  width: 160
  height: 128
  check_frozen: false
  controls: {trigger_mode: 1, auto_exposure: 1, exposure_time_absolute: 50}
trigger: {source: gpio, chip: sst-trigger, lines: [TRIG0, TRIG1, TRIG2, TRIG3, TRIG4, TRIG5], loopback: LOOP0, rate_hz: 10}
control: {socket: $tmp/c.sock, group: ""}
web: {port: 0, token_file: $tmp/token}
storage: {dir: $tmp/store, ring_mb: 16, preroll_s: 1, postroll_s: 1, min_free_gb: 0}
zones: [{name: all, x0: 0, y0: 0, x1: 1, y1: 1}]
YAML

# A session that stays while services come and go in it.
"$build/sst-sim" --quiet --world "$root/simulators/scene/world/worlds/quick.yaml" --serve session >sim.log 2>&1 &
sim=$!
trap 'kill -9 $daemon 2>/dev/null; kill $sim 2>/dev/null && ended $sim "the simulator"; rm -rf "$tmp"' EXIT
for _ in $(seq 600); do "$build/sst-sim" fault --dir session --list >/dev/null 2>&1 && break; sleep 0.1; done

# begin [ARGS]: start the service; its process is $daemon
begin() {
  rm -f pid
  "$build/sst-sim" --quiet --join session -- sh -c 'echo $$ >pid; exec "$0" "$@"' "$build/sstd" -v --config sstd.yaml "$@" >sstd.log 2>&1 &
  written pid
  daemon=$(cat pid)
}
awaits() { "$root/tests/until.sh" "$@"; }
fault() { "$build/sst-sim" fault --dir session "$@" >/dev/null || fail "fault $*"; }
# ask PATH [JSON]: the service's answer
ask() { curl -s --unix-socket c.sock -H 'Content-Type: application/json' "http://x$1" ${2:+-d "$2"}; }
# picks ID: surface under a point of a view; a service that is busy with a set is asked again
picks() { awaits "curl -s -m 10 --unix-socket c.sock 'http://x/api/v1/views/$1/pick?x=80&y=64' >picked; grep -q disparity_px picked" >/dev/null; }
