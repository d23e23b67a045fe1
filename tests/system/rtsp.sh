#!/usr/bin/env bash
# The process that serves RTSP, and the service: the one ends, the other goes on; the other ends, the one does not stay.
. "$(dirname "$0")/../lib.sh"
. "$root/tests/service_lib.sh"
log=sstd.log
"$sst" version | grep -q 'libcurl *yes' || { echo "built without libcurl: sst cannot ask the service"; exit 77; }
ldd "$build/sstd" | grep -q libgstrtspserver || { echo "built without RTSP"; exit 77; }
[ -x "$build/sst-sim" ] || { echo "sst-sim is not built: no simulated cameras"; exit 77; }

cat >sstd.yaml <<YAML
array: {rows: 6, cols: 6}
cameras:
  width: 160
  height: 128
  check_frozen: false
  controls: {trigger_mode: 1, auto_exposure: 1, exposure_time_absolute: 50}
trigger: {source: gpio, chip: sst-trigger, lines: [TRIG0, TRIG1, TRIG2, TRIG3, TRIG4, TRIG5], loopback: LOOP0, rate_hz: 10}
control: {socket: $tmp/c.sock, group: ""}
web: {enabled: false}
storage: {dir: $tmp/store, ring_mb: 16, min_free_gb: 0, mode: continuous}
rtsp: {enabled: true, port: 0}
YAML

hung=
trap 'kill -9 $daemon $hung 2>/dev/null; rm -rf "$tmp"' EXIT
# begin: start the service; its process is $daemon
begin() {
  rm -f pid
  "$build/sst-sim" --quiet --world "$root/simulators/scene/world/worlds/quick.yaml" -- \
    sh -c 'echo $$ >pid; exec "$0" --config sstd.yaml' "$build/sstd" >sstd.log 2>&1 &
  session=$!
  written pid
  daemon=$(cat pid)
  until_is 60 state 'v == "capturing"'
}
server() { pgrep -P "$daemon" -x sstd-rtsp; }

begin
[ $failed -eq 0 ] || exit 1
first=$(server)
[ -n "$first" ] || fail "no process serves RTSP"
until_is 20 storage.recording.active 'v'
recording=$(value storage.recording.name)
sets=$(value storage.recording.sets)
kill -ABRT "$first"
until_is 15 clients.rtsp_restarts 'v == 1'
grep -q 'ended by signal 6' sstd.log || fail "nothing is said of the end: $(cat sstd.log)"
until_is 5 storage.recording.sets "v > $sets + 10"
until_is 1 storage.recording.name "v == $recording"
until_is 1 capture.frames.unexplained 'v == 0'
for _ in $(seq 600); do second=$(server) && [ "$second" != "$first" ] && break; sleep 0.1; done # counted before it has its name
[ -n "$second" ] && [ "$second" != "$first" ] || fail "it is not started again"

kill -STOP "$second" # one that hangs holds up nothing
kill -TERM "$daemon"
gone "$daemon" 2000
gone "$second" 2000
ended "$session" "the first session"

begin
third=$(server)
[ -n "$third" ] || fail "no process after the start"
kill -9 "$daemon"
gone "$third" 5000
ended "$session" "the second session"

# One that hangs while the service starts, on a single processor: the libraries have no thread then that takes signals.
cpu=$(awk '/^Cpus_allowed_list/ { split($2, n, "[,-]"); print n[1] }' /proc/self/status)
taskset -c "$cpu" "$build/sstd" --config sstd.yaml >sstd.log 2>&1 &
daemon=$!
for _ in $(seq 3000); do hung=$(pgrep -P "$daemon") && break; done
kill -STOP $hung
sleep 0.3
kill -TERM "$daemon"
gone "$daemon" 2000
kill -9 $hung 2>/dev/null
exit $failed
