#!/usr/bin/env bash
# Simulated cameras under other people's programs: conformance, grabbing, triggers, faults, sessions.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
. "$(dirname "$0")/../lib.sh"
build=$root/${SST_BUILD:-build}
until=$root/tests/until.sh
sim="timeout 600 $build/sst-sim --quiet --world $root/simulators/scene/world/worlds/small.yaml"
grab="$build/tests/tools/sim_grab"
for p in v4l2-compliance v4l2-ctl ffmpeg gpioset; do
  command -v $p >/dev/null || skip "$p is not installed (scripts/deps.sh)"
done

# columns of sim_grab: camera trigger t_ns stamp_ns sequence flags bytes
# holds WHAT AWK-CONDITION-ON-EVERY-LINE LINES: of ./out
holds() {
  awk -v lines="$3" "{ if (!($2)) bad = 1 } END { exit bad || NR != lines }" out || fail "$1: $(head -c 600 out) $(head -c 300 err)"
}
# unbroken WHAT SIM-OPTIONS -- GRAB-ARGUMENTS: status 0, and no gap in the sequence: a simulator that stands still for a
# second leaves frames out, and then it is done once more.
unbroken() {
  for n in 1 2 3 4 5; do
    grabs 0 "$@"
    awk 'NR > 1 && $5 != (last + 1) % 4294967296 { gap = 1 } { last = $5 } END { exit gap }' out && break
    repeats $n "$1: a gap in the sequence"
  done
}
# grabs STATUS WHAT SIM-OPTIONS -- GRAB-ARGUMENTS
grabs() {
  local want=$1 what=$2 options=()
  shift 2
  while [ "$1" != -- ]; do options+=("$1"); shift; done
  shift
  $sim "${options[@]}" -- "$grab" "$@" >out 2>err
  local rc=$?
  [ $rc -eq "$want" ] || fail "$what: exit $rc, not $want: $(head -c 400 out) $(head -c 300 err)"
}

# --- conformance: the public tool finds nothing at all, DMABUF from another camera included. On a busy machine it misses
# frames, of which it warns, and where it was stopped itself its epoll_wait() ends with EINTR: then it looks again.
for format in MJPG YUYV RGGB; do
  for n in 1 2 3 4 5 6 7 8; do
    $sim -- sh -c "v4l2-ctl -d /dev/video1 -v width=160,height=120,pixelformat='$format' &&
      v4l2-compliance -d /dev/video1 -e /dev/video2 -s4" >out 2>&1
    grep -Eq 'warn: .*got sequence number|fail: v4l2-test-buffers.*: ret < 0 \(got -1\)' out || break
    repeats $n "v4l2-compliance on $format: frames that it missed"
  done
  grep -q 'Succeeded: 54, Failed: 0, Warnings: 0' out || fail "v4l2-compliance on $format: $(grep -E 'fail|FAIL|warn|Total' out | head -5)"
done

# --- every format carries the frames of its own camera, in order
for format in MJPG YUYV GREY 'Y16 ' BA81 GBRG GRBG RGGB; do
  unbroken "format $format" -- /dev/video2 3 "$format" 320x240
  holds "format $format" '$1 == 2 && $5 == NR - 1 && $4 <= $3 && $3 - $4 < 1000' 3
done

# --- other people's grabbers
$sim -- v4l2-ctl -d /dev/video3 --stream-mmap --stream-count=5 --stream-to=frames.mjpeg >out 2>&1 || fail "v4l2-ctl: $(cat out)"
[ "$(ffprobe -v error -f mjpeg -count_frames -show_entries stream=nb_read_frames -of csv=p=0 frames.mjpeg)" = 5 ] || fail "v4l2-ctl's frames"
$sim -- v4l2-ctl -d /dev/video3 --stream-user --stream-count=3 >out 2>&1 || fail "v4l2-ctl, user memory: $(cat out)"
$sim -- v4l2-ctl -w -d /dev/video3 --stream-mmap --stream-count=3 >out 2>&1 || fail "v4l2-ctl on libv4l2: $(cat out)"
$sim -- ffmpeg -v error -f v4l2 -input_format yuyv422 -video_size 320x240 -i /dev/video0 -frames:v 4 -f framecrc frames.crc >out 2>&1
[ "$(grep -vc '^#' frames.crc)" = 4 ] || fail "ffmpeg: $(cat out)"
if /usr/bin/python3 -c 'import cv2' 2>/dev/null; then
  $sim -- /usr/bin/python3 -c '
import cv2
c = cv2.VideoCapture("/dev/video1", cv2.CAP_V4L2)
c.set(cv2.CAP_PROP_FOURCC, cv2.VideoWriter_fourcc(*"MJPG"))
for i in range(4): ok, image = c.read(); assert ok
cv2.cvtColor(image, cv2.COLOR_BGR2GRAY).tofile("luma")' >out 2>&1 || fail "OpenCV: $(tail -n 1 out)"
  "$grab" --luma luma 320x240 >out && holds "OpenCV's frame" '$1 == 1' 1 || fail "OpenCV's frame has no strip: $(cat out)"
fi

# --- libusb reads a device's descriptors from where it seeks to: the vendor at byte 8
$sim -- sh -c 'set -- /dev/bus/usb/003/*; shift; dd if=$1 bs=1 skip=8 count=2 2>/dev/null' | od -An -tx1 >out
grep -q '09 12' out || fail "seek in a USB device: $(cat out)"

# --- edges of a line expose its cameras, a frame an edge, at the edge; the truth says the same
$sim --truth truth --triggers one -- sh -c "for i in 0 1 2 3; do $grab -t 60000 /dev/video\$i 3 MJPG 320x240 1 >grab\$i & done
  $until 'streaming 4'; for i in 1 2 3 4 5; do gpioset --mode=time --usec=1000 sst-trigger 0=1; gpioset sst-trigger 0=0; sleep 0.1; done; wait" 2>err
cat grab? | sort -k2n >out
holds "triggered" '$5 == $2 - first[$1] || ((!($1 in first)) && (first[$1] = $2 - $5) >= 0)' 12
awk '{ t = $3; if (!($2 in low) || t < low[$2]) low[$2] = t; if (t > high[$2]) high[$2] = t }
     END { for (k in low) if (high[k] - low[k] > 1000000) exit 1 }' out || fail "one edge, exposures over 1 ms apart: $(cat out)"
[ "$(grep -c stamp_ns truth)" -ge 12 ] || fail "log of the truth: $(head -n 3 truth)"

# --- faults
grabs 1 truncated --fault camera.1.truncated=1 -- /dev/video1 2
grabs 1 corrupt_soi --fault camera.1.corrupt_soi=1 -- /dev/video1 2
grabs 1 corrupt_eoi --fault camera.1.corrupt_eoi=1 -- /dev/video1 2
grabs 1 corrupt_mid --fault camera.1.corrupt_mid=1 -- /dev/video1 2
grabs 1 short --fault camera.1.short=1 -- /dev/video1 2
holds short '/bytes 32$/' 2
grabs 0 error_flag --fault camera.1.error_flag=1 -- /dev/video1 2
holds error_flag '$6 == 64' 2
unbroken duplicate --fault camera.1.duplicate=1 -- /dev/video1 4
holds duplicate '$2 == int((NR - 1) / 2) && $5 == NR - 1' 4
unbroken frozen --fault camera.1.frozen=1 -- /dev/video1 3
holds frozen '$2 == 0 && $5 == NR - 1' 3
grabs 0 gap --fault camera.1.gap=0.5 -- /dev/video1 8
awk 'END { exit !($5 > 7) }' out || fail "gap: no gap: $(cat out)"
unbroken sequence_wrap --fault camera.1.sequence_wrap=1 -- /dev/video1 10
holds sequence_wrap '$5 == (NR < 9 ? 4294967287 + NR : NR - 9)' 10
grabs 0 clock_step_us --fault camera.1.clock_step_us=-70000 -- /dev/video1 2
holds clock_step_us '$3 - $4 >= 70000000 && $3 - $4 < 70001000' 2
grabs 0 swap --fault camera.1.swap=1 -- /dev/video1 2
holds swap '$1 == 2' 2
grabs 2 eio --fault camera.1.eio=1 -- /dev/video1 2
grep -q 'DQBUF: Input/output error' err || fail "eio: $(cat err)"
grabs 2 busy --fault 'camera.*.busy=1' -- /dev/video1 2
grep -q 'S_FMT: Device or resource busy' err || fail "busy: $(cat err)"
grabs 2 nospace --fault camera.1.nospace=1 -- /dev/video1 2
grep -q 'STREAMON: No space left' err || fail "nospace: $(cat err)"
grabs 3 stall --fault camera.1.stall=3 -- -t 300 /dev/video1 2
grabs 0 late --fault camera.1.late_ms=300 -- /dev/video1 2
$sim --fault camera.1.stall=1 -- sh -c "$grab -t 200 /dev/video1 1; $grab -t 60000 /dev/video1 1" >out 2>&1
holds "stall ends by restreaming" '$1 == 1' 1
$sim --fault camera.1.control_stuck=1 -- sh -c "v4l2-ctl -d /dev/video1 -c gain=200; v4l2-ctl -d /dev/video1 -C gain" >out 2>&1
grep -q 'gain: 100' out || fail "control_stuck: $(cat out)"

# --- a file closed is closed for the next open, however soon
$sim -- sh -c "for i in 1 2 3 4 5 6 7 8 9 10; do $grab /dev/video1 1 || exit 1; done" >out 2>&1 || fail "reopen: $(cat out)"

# --- away and back while a program waits: it is told at once; another camera came first, so the number changes
cat >plug.sh <<END
$grab -t 60000 /dev/video2 9999 >/dev/null 2>gone & $until "streaming 1"
$build/sst-sim fault camera.2.unplug=1 || exit 1
wait \$!; echo "status \$?"; [ -e /dev/video2 ] && echo "still there"
$build/sst-sim fault camera.1.unplug=1 && $build/sst-sim fault camera.2.unplug=0 && $build/sst-sim fault camera.1.unplug=0
$grab /dev/video1 1 | cut -d' ' -f1; $grab /dev/video2 1 | cut -d' ' -f1
END
$sim -- sh plug.sh >out 2>&1
[ "$(cat out)" = "$(printf 'status 2\n2\n1')" ] || fail "unplug: $(cat out)"
grep -q 'No such device' gone || fail "unplug: $(cat gone)"

# --- the program itself
mkdir runtime
XDG_RUNTIME_DIR=$tmp/runtime $sim -- sh -c 'echo $$ >command; touch -d "5 minutes ago" $SST_SIM_DIR; kill -KILL $PPID; exec sleep 100' 2>/dev/null
"$root/tests/until.sh" "! kill -0 $(cat command) 2>/dev/null" || fail "the command of a killed session goes on"
[ -n "$(ls runtime)" ] || fail "nothing left of a killed session"
XDG_RUNTIME_DIR=$tmp/runtime $sim -- true
[ -z "$(ls runtime)" ] || fail "a killed session's folder stays: $(ls runtime)"
$sim -- sh -c 'exit 5'; [ $? -eq 5 ] || fail "exit status"
$sim -- sh -c 'kill -TERM $$'; [ $? -eq 143 ] || fail "status of a signal"
$sim -- ./no-such-program 2>err; [ $? -eq 127 ] || fail "no program"
$sim --fault camera.9.eio=1 -- true 2>err; [ $? -eq 3 ] && grep -q '0 to 3' err || fail "bad fault: $(cat err)"
$sim --stats stats -- "$grab" /dev/video0 2 >out; grep -Eq '"frames": ([2-9]|1[0-9])' stats || fail "figures: $(cat stats)"
$sim -- "$build/sst-sim" fault --list | grep -q 'camera.N.late_ms' || fail "list of faults"
$sim --serve served 2>err & server=$!
for i in $(seq 600); do [ -S served/control.sock ] && break; sleep 0.1; done
"$build/sst-sim" --join served -- "$grab" /dev/video0 1 >out 2>&1
holds "joined" '$1 == 0' 1
"$build/sst-sim" status --json --dir served | grep -q '"serial":"SIM0003"' || fail "status"
"$build/sst-sim" stop --dir served; ended $server "a served session" || fail "serve: $(cat err)"
[ -e served ] && fail "the session's folder stayed"
mkdir -p usr/bin usr/lib/sst
cp "$build/sst-sim" usr/bin; cp "$build/libsst-sim-preload.so" usr/lib/sst
timeout 600 usr/bin/sst-sim --quiet --world "$root/simulators/scene/world/worlds/small.yaml" -- "$grab" /dev/video0 1 >out 2>err
holds "installed" '$1 == 0' 1
mkdir full; touch full/mine
$sim --serve full 2>err && fail "a folder in use was taken"
[ -e full/mine ] || fail "a user's file is gone"
# Bad input ends with 3, as everywhere; the faults that there are need no session.
"$build/sst-sim" --world nowhere.yaml -- true 2>err
[ $? -eq 3 ] && grep -q 'unknown world `nowhere.yaml`' err || fail "a world that is not there: $(cat err)"
echo 'bad: x' >bad.yaml
"$build/sst-sim" --world bad.yaml -- true 2>err
[ $? -eq 3 ] && grep -q 'bad.yaml:1:1' err || fail "a world that is wrong: $(cat err)"
(unset SST_SIM_DIR; "$build/sst-sim" fault --list) >list 2>err && grep -q '^camera.N.unplug ' list && grep -q '^still\.' list &&
  grep -q '^rig.NAME=WHEN' list || fail "faults without a session: $(cat list err)"
# The library that is loaded into other programs is hardened like the programs.
if command -v readelf >/dev/null; then
  readelf -Wd "$build/libsst-sim-preload.so" | grep -q 'BIND_NOW' && readelf -Ws "$build/libsst-sim-preload.so" | grep -q '__stack_chk_fail' ||
    fail "the preloaded library is not hardened"
fi
exit $failed
