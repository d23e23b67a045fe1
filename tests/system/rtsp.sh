#!/usr/bin/env bash
# sst-rtsp and sst-onvif beside the service: their clients are in the status; the end of one does not touch the others; a reload is
# followed; what recorders ask of sst-onvif leads them to the stream.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
. "$(dirname "$0")/../lib.sh"
. "$root/tests/service_lib.sh"
log=sstd.log
[ -x "$build/sst-rtsp" ] || skip "built without RTSP"
[ -x "$build/sst-sim" ] || skip "sst-sim is not built: no simulated cameras"
command -v ffmpeg >/dev/null || skip "ffmpeg is not installed"

# configure PORT CODEC
configure() {
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
zones: [{name: gate, x0: 0, y0: 0, x1: 1, y1: 1}]
rtsp: {enabled: true, port: $1, codec: $2, user: nvr, password_file: $tmp/password}
onvif: {enabled: $([ -x "$build/sst-onvif" ] && echo true || echo false), port: $onvif_port}
YAML
}
port=$((10000 + $$ % 20000))
onvif_port=$((port + 2))
(umask 077 && echo 'sesame seed' >password)
configure $port mjpeg
rtsp= viewer= onvif=
trap 'kill -9 $daemon $rtsp $viewer $onvif 2>/dev/null; rm -rf "$tmp"' EXIT
"$build/sst-sim" --quiet --world "$root/simulators/scene/world/worlds/quick.yaml" -- \
  sh -c 'echo $$ >pid; exec "$0" --config sstd.yaml' "$build/sstd" >sstd.log 2>&1 &
session=$!
written pid
daemon=$(cat pid)
serve() { "$build/sst-rtsp" --config sstd.yaml 2>>rtsp.log & rtsp=$!; }
# play ADDRESS [TRANSPORT]: some frames
play() {
  for _ in $(seq 20); do
    timeout 60 ffmpeg -nostdin -loglevel error -rtsp_transport "${2-tcp}" -i "rtsp://nvr:sesame%20seed@${1#rtsp://}" -frames:v 3 -f null - 2>err && return
    sleep 0.5
  done
  fail "$1: $(cat err)"
}
serve
until_is 60 state 'v == "capturing"'
[ $failed -eq 0 ] || exit 1
play 127.0.0.1:$port/main
[ -n "${SST_TIMING-}" ] || play 127.0.0.1:$port/camera/r2c3

# A client is in the status; a program that is killed and started again is counted.
ffmpeg -nostdin -loglevel quiet -rtsp_transport tcp -i rtsp://nvr:sesame%20seed@127.0.0.1:$port/main -f null - &
viewer=$!
until_is 20 clients.rtsp 'v == 1'
until_is 20 storage.recording.active 'v'
recording=$(value storage.recording.name)
sets=$(value storage.recording.sets)
kill -ABRT $rtsp
wait $rtsp 2>/dev/null
wait $viewer 2>/dev/null
serve
until_is 15 clients.rtsp_restarts 'v == 1'
until_is 15 clients.rtsp 'v == 0'
play 127.0.0.1:$port/main
until_is 5 storage.recording.sets "v > $sets + 10"
until_is 1 storage.recording.name "v == $recording"
until_is 1 capture.frames.unexplained 'v == 0'

# Another port and compression, without a restart of the service.
if [ -z "${SST_TIMING-}" ]; then # once
  configure $((port + 1)) h264
  "$sst" reload >/dev/null 2>&1 || fail "the reload is refused"
  play 127.0.0.1:$((port + 1))/main
fi

# Recorders search, ask, and are handed that port; one that is subscribed is in the status.
if [ -x "$build/sst-onvif" ]; then
  "$build/sst-onvif" --config sstd.yaml 2>>onvif.log & onvif=$!
  if [ -n "${SST_TIMING-}" ]; then # its end alone
    for _ in $(seq 600); do (: </dev/tcp/127.0.0.1/$onvif_port) 2>/dev/null && break; sleep 0.1; done
  elif /usr/bin/python3 "$root/tests/onvif_client.py" $onvif_port nvr 'sesame seed' >asked; then
    play "$(cat asked)" udp
    play "$(cat asked)" tcp
  else
    fail "sst-onvif: $(cat asked): $(tail -n 3 onvif.log)"
  fi
  until_is 15 clients.onvif_restarts 'v == 0'
  kill -TERM $onvif
  gone $onvif 2000
fi

kill -STOP $rtsp # one that hangs holds up nothing
kill -TERM "$daemon"
gone "$daemon" 2000
ended "$session" "the session"
kill -CONT $rtsp
kill -TERM $rtsp
gone $rtsp 2000
exit $failed
