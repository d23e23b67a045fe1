#!/usr/bin/env bash
# Foreign clients on sst-onvif, in networks of their own: npm's onvif, node-onvif and onvif-nvt, Debian's onvif-util, ffprobe over UDP and
# TCP. Downloads them into a temporary folder; needs root, node and npm.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
set -u
. "$(dirname "$0")/../lib.sh"
build=$root/${SST_BUILD:-build}
[ "$(id -u)" -eq 0 ] || skip "only root makes networks"
for p in node npm unshare ip ffprobe; do command -v $p >/dev/null || skip "$p is not installed"; done
npm install --silent --no-audit --no-fund onvif@0.8.3 node-onvif@0.1.7 onvif-nvt@0.3.3 >npm.log 2>&1 || skip "npm: $(tail -n 1 npm.log)"
(apt-get -qq download onvif-tools libonvif1 && for p in *.deb; do dpkg-deb -x "$p" debian; done) >apt.log 2>&1 || echo "onvif-util is left out: $(tail -n 1 apt.log)"
cat >sstd.yaml <<YAML
array: {rows: 6, cols: 6}
cameras: {width: 160, height: 128, check_frozen: false, controls: {trigger_mode: 1, auto_exposure: 1, exposure_time_absolute: 50}}
trigger: {source: gpio, chip: sst-trigger, lines: [TRIG0, TRIG1, TRIG2, TRIG3, TRIG4, TRIG5], loopback: LOOP0, rate_hz: 10}
control: {socket: $tmp/c.sock, group: ""}
web: {enabled: false}
storage: {dir: $tmp/store, ring_mb: 16, min_free_gb: 0}
zones: [{name: gate, x0: 0, y0: 0, x1: 1, y1: 1}]
rtsp: {enabled: true, address: 0.0.0.0, user: nvr, password_file: $tmp/password}
onvif: {enabled: true, address: 0.0.0.0}
YAML
(umask 077 && echo 'sesame seed' >password)
cat >inside.sh <<'SH'
ip link set lo up && mount -t tmpfs none /run && mkdir -p /run/netns && ip netns add recorder || exit 1
ip link add cam0 type veth peer name rec0 netns recorder || { echo "no pair of veth devices (kernel module veth)"; exit 77; }
ip addr add 10.9.8.7/24 dev cam0 && ip link set cam0 up && ip route add default dev cam0
there() { ip netns exec recorder "$@"; }
there ip link set lo up && there ip addr add 10.9.8.9/24 dev rec0 && there ip link set rec0 up && there ip route add default dev rec0
"$build/sst-sim" --quiet --world "$root/simulators/scene/world/worlds/quick.yaml" -- "$build/sstd" --config sstd.yaml 2>sstd.log & all=$!
"$build/sst-rtsp" --config sstd.yaml 2>rtsp.log & all="$all $!"
"$build/sst-onvif" --config sstd.yaml 2>onvif.log & all="$all $!"
trap 'kill $all; wait' EXIT
for _ in $(seq 120); do SST_SOCKET=$tmp/c.sock "$sst" status 2>/dev/null | grep -q capturing && break; sleep 0.5; done
failed=0
there node "$root/tests/onvif/clients.js" 8000 nvr 'sesame seed' 10.9.8.7 || failed=1
for transport in udp tcp; do
  seen=$(there timeout 60 ffprobe -v error -rtsp_transport $transport -show_entries stream=codec_name,width,height -of csv=p=0 'rtsp://nvr:sesame%20seed@10.9.8.7:8554/main' 2>&1)
  case $seen in h264,*) echo "ok   ffprobe: $transport $seen";; *) echo "FAIL ffprobe: $transport $seen"; failed=1;; esac
done
if [ -x debian/usr/bin/onvif-util ]; then
  seen=$(LD_LIBRARY_PATH=debian/usr/lib/$(gcc -print-multiarch):debian/usr/lib there timeout 60 debian/usr/bin/onvif-util -a 2>&1)
  case $seen in *10.9.8.7*) echo "ok   onvif-util: discovery" $seen;; *) echo "FAIL onvif-util: $seen"; failed=1;; esac
fi
[ $failed -eq 0 ] || tail -n 5 onvif.log rtsp.log sstd.log
exit $failed
SH
export build root tmp sst NODE_PATH=$tmp/node_modules
unshare -nm bash inside.sh
case $? in 0) ;; 77) skip "this kernel makes no pairs of network interfaces";; *) fail "a client failed";; esac
grep "wrong user" "$tmp/onvif.log" && fail "a client sent a wrong password"
exit $failed
