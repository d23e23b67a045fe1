#!/usr/bin/env bash
# The simulated USB tree under lsusb, libusb, libudev, udevadm and the shell: present devices, plugs, and bandwidth.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
. "$(dirname "$0")/../lib.sh"
build=$root/${SST_BUILD:-build}
sim="timeout 600 $build/sst-sim --quiet --world $root/simulators/scene/world/worlds/small.yaml"
bus=$build/tests/tools/sim_bus
for p in lsusb v4l2-ctl; do
  command -v $p >/dev/null || skip "$p is not installed (scripts/deps.sh)"
done
fault() { echo "$build/sst-sim fault $*"; }

# --- present devices: 2 buses, 2 hubs with 2 halves each, 4 cameras; descriptors are whole
$sim --usb tight -- sh -c 'lsusb; lsusb -t; lsusb -v -d 1209:0001 2>&1' >out 2>&1 || fail "lsusb: $(head -c 400 out)"
[ "$(grep -c '^Bus .* ID' out)" = 14 ] || fail "lsusb: $(grep -c '^Bus .* ID' out) devices" # -v prints the cameras again
[ "$(grep -c 'Class=Video, Driver=uvcvideo, 480M' out)" = 8 ] || fail "lsusb -t: $(grep Class out)"
[ "$(grep -c 'iSerial *3 SIM000' out)" = 4 ] || fail "lsusb -v: serials"
grep -q 'wMaxPacketSize *0x1400 *3x 1024 bytes' out || fail "lsusb -v: no large setting"
grep -iq 'warning\|invalid\|short' out && fail "lsusb -v: $(grep -i 'warning\|invalid\|short' out | head -n 3)"
$sim -- lsusb >out 2>&1; [ "$(wc -l <out)" = 8 ] || fail "wide: $(cat out)"

# --- names that last
$sim --usb tight -- sh -c 'readlink -f /dev/v4l/by-id/usb-sst_SST_Array_Camera_SIM0002-video-index0
  readlink -f /dev/v4l/by-path/pci-0000:00:14.0-usb-0:1.1.4:1.0-video-index0
  cat /sys/bus/usb/devices/1-1.1.2/serial /sys/class/video4linux/video1/device/../serial
  basename $(readlink -f /sys/bus/usb/devices/1-1.1/1-1.1:1.0/1-1.1-port2/peer)
  v4l2-ctl --list-devices | tail -n 3 | head -n 2' >out 2>&1
[ "$(cat out)" = "$(printf '/dev/video2\n/dev/video3\nSIM0001\nSIM0001\n2-1.1-port2\nSST Array Camera (usb-0000:00:14.0-1.1.4):\n\t/dev/video3')" ] ||
  fail "names: $(cat out)"
if command -v udevadm >/dev/null; then
  $sim -- udevadm info -q property /dev/video2 >out 2>&1
  for want in ID_SERIAL_SHORT=SIM0002 ID_V4L_CAPABILITIES=:capture: ID_PATH=pci-0000:05:00.0-usb-0:1:1.0 DEVNAME=/dev/video2; do
    grep -qx "$want" out || fail "udevadm: no $want in $(cat out)"
  done
fi

# --- bandwidth: of greedy cameras on one bus the second is refused; each on its own controller they all stream
export until=$root/tests/until.sh
stream='v4l2-ctl -d /dev/video0 --stream-mmap --stream-count=6000 --stream-to=/dev/null >/dev/null 2>&1 & $until "streaming 1"
  v4l2-ctl -d /dev/video1 --stream-mmap --stream-count=1 --stream-to=/dev/null; kill $!; wait $!'
$sim --usb tight -- sh -c "$stream" >out 2>&1; grep -q 'No space left on device' out || fail "tight: $(cat out)"
$sim --usb wide -- sh -c "$stream" >out 2>&1; grep -q 'No space left' out && fail "wide: $(cat out)"

# --- by the shell: authorised, bound, enabled; wrong values are refused
cat >shell.sh <<'END'
there() { [ -e /dev/video0 ] && echo "$1 there" || echo "$1 gone"; }
d=/sys/bus/usb/devices/1-1.1.1 p=$(readlink -f /sys/bus/usb/devices/1-1.1.1/port)
echo 0 >$d/authorized; there 0; echo 1 >$d/authorized; there 1
echo 1-1.1.1:1.0 >/sys/bus/usb/drivers/uvcvideo/unbind; there unbind
echo 1-1.1.1:1.0 | tee /sys/bus/usb/drivers/uvcvideo/bind >/dev/null; there bind
echo 1 >$p/disable; there disabled; [ -e $d ] && echo "still in sysfs"; cat $p/disable; echo 0 >$p/disable; there enabled
sh -c "echo 7 >$d/authorized" 2>/dev/null || echo refused
sh -c "echo 1-9:1.0 >/sys/bus/usb/drivers/uvcvideo/bind" 2>/dev/null || echo refused
sh -c "echo 5 >$d/devnum" 2>/dev/null || echo refused
END
$sim --usb tight -- bash shell.sh >out 2>&1
[ "$(tr '\n' ' ' <out)" = "0 gone 1 there unbind gone bind there disabled gone 1 enabled there refused refused refused " ] ||
  fail "by the shell: $(cat out)"

# --- by libusb; a stall that waits for a reset ends with it
$sim --usb tight --fault camera.0.stall=3 -- sh -c "timeout 1 v4l2-ctl -d /dev/video0 --stream-mmap --stream-count=1 --stream-to=a
  $bus usb 1-1.1.1; timeout 60 v4l2-ctl -d /dev/video0 --stream-mmap --stream-count=1 --stream-to=b" >out 2>/dev/null
if [ $? -ne 77 ] && ! grep -q 77 out; then
  [ "$(grep -v '^<' out | tr '\n' ' ')" = "serial SIM0000 node gone node there reset LIBUSB_SUCCESS / LIBUSB_TRANSFER_COMPLETED port 0503 power LIBUSB_SUCCESS / LIBUSB_TRANSFER_COMPLETED " ] ||
    fail "libusb: $(cat out)"
  [ ! -s a ] && [ -s b ] || fail "stall until reset: $(ls -l a b)"
  $sim --usb tight --fault usb.reset_fails=1 --fault usb.no_port_power=1 -- "$bus" usb 1-1.1.1 >out 2>&1
  grep -q 'reset LIBUSB_ERROR' out && grep -q 'power LIBUSB_ERROR_PIPE' out || fail "faults: $(cat out)"
fi

# --- events of plugs: in order, to two listeners at once, with what udev knows; a hub takes its cameras along
cat >plugs.sh <<END
for i in 1 2; do $bus monitor video4linux add >events\$i & done
for i in \$(seq 600); do grep -q listening events1 && grep -q listening events2 && break; sleep 0.1; done
$(fault camera.1.unplug=1); $(fault camera.1.unplug=0); wait
$(fault hub.1.unplug=1); ls /dev/video* 2>/dev/null; lsusb | wc -l; $(fault hub.1.unplug=0); ls /dev/video* | wc -l
$(fault camera.2.swap=1); cat /sys/bus/usb/devices/1-1.1.3/serial
END
$sim --usb tight -- sh plugs.sh >out 2>&1
if ! [ -s events1 ]; then echo "built without libudev"; else
  for i in 1 2; do
    [ "$(tr '\n' ' ' <events$i)" = "listening remove video1 SIM0001 add video1 SIM0001 " ] || fail "events: $(cat events$i)"
  done
fi
[ "$(tail -n 3 out)" = "$(printf '4\n4\nSIM0003')" ] || fail "hub: $(cat out)"
$sim --usb star -- true 2>err && fail "an unknown layout"
grep -q "'star'.*wide, tight" err || fail "unknown layout: $(cat err)"
exit $failed
