#!/usr/bin/env bash
# The service on simulated devices: it comes up, survives faults, reports them, and ends in time.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
. "$(dirname "$0")/../lib.sh"
need libcurl
. "$root/tests/service_lib.sh"
. "$root/tests/service_array.sh"

# unmeasured PART: not once more in make check-timing
unmeasured() { [ -n "${SST_TIMING-}" ] || "$1"; }

# A configuration is judged before anything is touched.
"$build/sstd" --check --config sstd.yaml 2>err || fail "--check: $(cat err)"
sed 's/^zones/zonse/' sstd.yaml >wrong.yaml
"$build/sstd" --check --config wrong.yaml 2>err; [ $? -eq 78 ] || fail "--check of a wrong key: not 78"
grep -q 'wrong.yaml:[0-9]*:1.*zones' err || fail "--check: $(cat err)"
mkfifo pipe.yaml
timeout 60 "$build/sstd" --check --config pipe.yaml 2>err; [ $? -eq 78 ] || fail "--check of a pipe that nobody writes to: not 78: $(cat err)"

begin
until_is 30 state 'v == "capturing"'
[ $failed -eq 0 ] || exit 1
until_is 30 live.ready 'v'
until_is 5 capture.present 'v == 36'
until_is 5 capture.frames.unexplained 'v == 0'
# The alarm by which the process ends, whatever hangs, is for the thread that nothing holds up.
takes_alarm() { [ $((0x$(awk '/^SigBlk/ { print $2 }' "$1/status") >> 13 & 1)) -eq 0 ]; }
takes_alarm "/proc/$daemon/task/$daemon" && fail "the main thread would be given the alarm"
takes_alarm "$(dirname "$(grep -lx sst-signals /proc/"$daemon"/task/*/comm)")" || fail "nobody takes the alarm"
# A healthy service may be busy for a moment, and reports it.
answers() {
  awaits "curl -sf -m 10 --unix-socket c.sock http://x/healthz >/dev/null" || fail "healthz"
  awaits "'$sst' snapshot -o now.jpg 2>err" || fail "snapshot: $(cat err)"
  [ "$(head -c 2 now.jpg | od -An -tx1)" = " ff d8" ] || fail "snapshot is no JPEG"
  for p in camera/r5c5 labels disparity main; do
    awaits "curl -sf -m 10 --unix-socket c.sock 'http://x/snapshot/$p' >p.jpg" && [ "$(head -c 2 p.jpg | od -An -tx1)" = " ff d8" ] || fail "/snapshot/$p"
  done
  # Huffman tables that a camera leaves out are in its pictures.
  "$build/sst-sim" fault --dir session camera.0.no_tables=1 >/dev/null
  awaits "curl -sf -m 10 --unix-socket c.sock http://x/snapshot/camera/r0c0 | od -An -v -tx1 | tr -d '\n' | grep -q 'ff c4 01 a2'" ||
    fail "a camera's picture without Huffman tables"
  "$build/sst-sim" fault --dir session camera.0.no_tables=0 >/dev/null
  awaits "curl -sf -m 10 --unix-socket c.sock http://x/metrics >metrics && grep -q '^sst_cameras_present 36$' metrics" || fail "metrics: $(cat metrics)"
  awk '$1 == "#" && $2 == "TYPE" { type[$3] = $4 } /^[^#].*quantile=/ { sub(/\{.*/, ""); if (type[$0] != "summary") { print; bad = 1 } }
    END { exit bad }' metrics || fail "quantiles of what is no summary"
}
unmeasured answers

# Without viewers one view is watched, and maps are brought up to date now and then.
until_is 20 live.demand 'v == "events"' # for visits to the zone
until_is 20 live.watched 'v > 20'
"$sst" status | grep -q 'no viewers' || fail "status without viewers: $("$sst" status)"
since=$(date +%s%3N)
curl -sf -m 10 --unix-socket c.sock http://x/snapshot >p.jpg || fail "a snapshot after a while without viewers"
quick $(($(date +%s%3N) - since)) 3000 || fail "the first picture after a while without viewers takes $(($(date +%s%3N) - since)) ms"
[ "$(value live.demand)" = '"pictures"' ] || fail "a snapshot was asked for, and the service computes for $(value live.demand)"

# A scene that stands still: nothing is computed.
stands_still() {
  timeout 300 curl -s -m 300 --unix-socket c.sock http://x/stream >/dev/null & viewer=$!
  until_is 20 live.idle 'v > 10'
  kill $viewer
}
unmeasured stands_still

# All views are looked at, one after the other, and nothing is noticed of them: in 18 s from the start on.
looked_at() {
  until_is 120 live.quality.views 'v == 36'
  awaits "curl -sf -m 10 --unix-socket c.sock http://x/metrics >metrics && grep -q '^sst_noticed{what=\"missing-views\"} 0$' metrics" ||
    fail "noticed: $(grep noticed metrics)"
  for what in missing-views blank-views time-offsets misaligned; do
    ! value noticed | grep -q "\"$what\"" || fail "$what is noticed of an array that is well: $(value noticed)"
  done
}
unmeasured looked_at

# Reload: a faulty configuration is refused and the old one stays; a right one applies.
cp sstd.yaml good.yaml
cp wrong.yaml sstd.yaml
want 3 zones reload
until_is 2 state 'v == "capturing"'
{ sed 's/rate_hz: 10/rate_hz: 5/' good.yaml; echo 'live: {focus_px: 2.5}'; } >sstd.yaml
"$sst" reload --dry-run >out || fail "reload --dry-run"
grep -q 'trigger.rate_hz' out || fail "dry run: $(cat out)"
until_is 2 capture.rate_hz 'v > 7'
"$sst" reload >out || fail "reload"
until_is 15 capture.rate_hz '3 < v < 6.5'
main_view_and_nobody() {
  sed 's/^live:.*//; $ a live: {c1: 0.5, focus_px: 3}' sstd.yaml >live.yaml && cp live.yaml sstd.yaml
  "$sst" reload >out || fail "reload of the main view's settings"
  ask /api/v1/views | grep -q '"focus_px":3.*"c1":0.5' || ask /api/v1/views | grep -q '"c1":0.5.*"focus_px":3' || fail "reload leaves the main view as it was: $(ask /api/v1/views)"
  grep -v '^zones' live.yaml >sstd.yaml
  "$sst" reload >out || fail "reload without zones: $(cat out)"
  until_is 30 live.demand 'v == "none"'
  # Unused work is not done: no picture, and maps at most each 5 s of the service's own time, however many sets come.
  curl -s --unix-socket c.sock http://x/api/v1/status >idle0
  until_is 60 live.watched "v >= $(value live.watched) + 30"
  curl -s --unix-socket c.sock http://x/api/v1/status >idle1
  /usr/bin/python3 -c 'import json
a, b = (json.load(open(name)) for name in ("idle0", "idle1"))
grown = lambda key: b["live"][key] - a["live"][key]
updates, s = grown("sets") - grown("watched"), b["uptime_s"] - a["uptime_s"]
assert grown("watched") >= 30 and updates <= s / 5 + 2 and grown("pictures") == 0, (updates, s, a["live"], b["live"])' ||
    fail "the service computes for nobody"
  cp live.yaml sstd.yaml
}
unmeasured main_view_and_nobody
kill -HUP "$daemon"
sleep 0.5
kill -0 "$daemon" || fail "SIGHUP ended it"

# A camera goes and comes back; a recording goes on meanwhile.
"$sst" record start >/dev/null || fail "record start"
until_is 5 storage.recording.active 'v'
fault camera.7.unplug=1
until_is 5 state 'v == "degraded"'
until_is 5 capture.present 'v == 35'
awaits "'$sst' events | grep -q 'row 1, col 1.*lost'" || fail "no event of the lost camera: $("$sst" events | tail -3)"
fault camera.7.unplug=0
until_is 10 state 'v == "capturing"'

# A tenth of the views is missing: noticed, and no longer so.
tenth_missing() {
  for i in 3 9 20 31; do fault camera.$i.unplug=1; done
  until_is 30 noticed 'any(n["what"] == "missing-views" for n in v)'
  "$sst" status | grep -q 'noticed .*views are missing' || fail "status: $("$sst" status)"
  for i in 3 9 20 31; do fault camera.$i.unplug=0; done
  until_is 10 state 'v == "capturing"'
  until_is 60 noticed 'not any(n["what"] == "missing-views" for n in v)'
}
unmeasured tenth_missing

# The trigger's chip goes and comes back.
fault gpio.vanish=1
until_is 10 state 'v in ("failed", "degraded")'
fault gpio.vanish=0
until_is 20 state 'v == "capturing"'
"$sst" record stop || fail "record stop"

# All cameras are gone: failed, and back by itself.
for i in $(seq 0 35); do echo camera.$i.unplug=1; done | xargs "$build/sst-sim" fault --dir session >/dev/null
until_is 20 state 'v == "failed"'
for i in $(seq 0 35); do echo camera.$i.unplug=0; done | xargs "$build/sst-sim" fault --dir session >/dev/null
until_is 30 state 'v == "capturing"'
picks main || fail "no pick after all cameras were away: $(cat picked)"

# Frames come, but belong to no trigger (half a period off): told with the remedy, and in few lines.
no_trigger() {
  for i in $(seq 0 35); do echo camera.$i.clock_step_us=-100000; done | xargs "$build/sst-sim" fault --dir session >/dev/null
  until_is 20 reason '"belong to no trigger" in v and "trigger_mode" in v'
  until_is 5 state 'v in ("failed", "degraded")'
  for i in $(seq 0 35); do echo camera.$i.clock_step_us=0; done | xargs "$build/sst-sim" fault --dir session >/dev/null
  until_is 30 state 'v == "capturing"'
  [ "$(grep -c 'cameras.*frames belong to no trigger' sstd.log)" -lt 20 ] || fail "a line for each camera: $(grep -c trigger sstd.log)"
}
unmeasured no_trigger

# Another service on the same socket is refused with a sentence, and this one lives on.
second_service() {
  "$build/sst-sim" --quiet --join session -- "$build/sstd" --config sstd.yaml >other.log 2>&1
  rc=$?
  [ $rc -ne 0 ] && grep -q 'error.*c.sock\|error.*store' other.log || fail "a second service: exit $rc, $(cat other.log)"
  until_is 2 state 'v == "capturing"'
}
unmeasured second_service

# kill -9 while recording: acknowledged sets are there, and it captures again in time.
"$sst" record start >/dev/null || fail "record start"
until_is 10 storage.recording.sets 'v > 5'
kill -9 "$daemon"
gone "$daemon" 5000
start=$(now)
begin
until_is 10 state 'v == "capturing"'
ms=$((($(now) - start) / 1000000))
echo "capturing again after $ms ms"
quick $ms 5000 || fail "capturing again after $ms ms"
count=0
for r in store/recordings/*/; do
  "$sst" recording "$r" --verify >out 2>&1 || fail "recording $r --verify: $(tail -n 2 out)"
  count=$((count + 1))
done
[ $count -ge 2 ] || fail "$count recordings"
curl -sf --unix-socket c.sock http://x/api/v1/recordings | grep -q '"sets"' || fail "recordings"

# Garbage, floods and clients that never read do not disturb it.
head -c 100000 /dev/urandom | timeout 2 curl -s --unix-socket c.sock -T - http://x/api/v1/record >/dev/null
/usr/bin/python3 - <<'PY'
import os, socket
held = []
for i in range(100):
    s = socket.socket(socket.AF_UNIX)
    try:
        s.connect("c.sock")
        s.sendall([b"GET /stream HTTP/1.1\r\nHost: x\r\n\r\n", os.urandom(500), b"GET / HT"][i % 3])
        held.append(s)
    except OSError:
        pass
PY
until_is 5 state 'v == "capturing"'
until_is 5 capture.rate_hz '3 < v < 6.5'

kill -TERM "$daemon"
gone "$daemon" 2000

# Nobody reads its log any more, and the logging thread hangs: it ends all the same.
mkfifo log.pipe
exec 9<>log.pipe
rm pid
"$build/sst-sim" --quiet --join session -- sh -c 'echo $$ >pid; exec "$0" "$@"' "$build/sstd" -v --config sstd.yaml 2>&9 &
written pid
daemon=$(cat pid)
until_is 30 state 'v == "capturing"'
/usr/bin/python3 -c 'import os
pipe = os.open("log.pipe", os.O_RDWR | os.O_NONBLOCK)
try:
    while True: os.write(pipe, b"x" * 4096)
except BlockingIOError: pass'
fault camera.0.unplug=1
kill -TERM "$daemon"
gone "$daemon" 2000
"$build/sstd" --help | grep -q -- --check || fail "--help"
exit $failed
