# USB devices of a real kernel (gadgets on dummy_hcd): the tree is shown as lsusb shows it, and the rungs of recovery do
# what they say to a device: reset, authorisation, port power.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
. tests/guest/lib.sh

load dummy_hcd num=3
load libcomposite
gadgets=/sys/kernel/config/usb_gadget
gadget() { # NUMBER: a device with a serial on controller NUMBER
  local g=$gadgets/g$1
  mkdir "$g" "$g/strings/0x409" "$g/configs/c.1" "$g/functions/SourceSink.0" || fail "no gadget"
  echo 0x1d6b >"$g/idVendor"
  echo 0x0104 >"$g/idProduct"
  echo 0x0200 >"$g/bcdUSB"
  echo "Maker $1" >"$g/strings/0x409/manufacturer"
  echo "Device $1" >"$g/strings/0x409/product"
  echo "SERIAL$1" >"$g/strings/0x409/serialnumber"
  ln -s "$g/functions/SourceSink.0" "$g/configs/c.1/"
  echo "dummy_udc.$1" >"$g/UDC" || fail "gadget $1 does not come up"
}
leave_gadgets() {
  local rc=$? g
  for g in $gadgets/*; do
    echo >"$g/UDC"
    rm "$g/configs/c.1/SourceSink.0"
    rmdir "$g/configs/c.1" "$g/functions/SourceSink.0" "$g/strings/0x409" "$g"
  done
  modprobe -r usb_f_ss_lb
  (exit $rc)
  leave
}
trap leave_gadgets EXIT
for n in 0 1 2; do gadget $n; done
enumerated() { [ "$(cat /sys/bus/usb/devices/*-1/serial 2>/dev/null | wc -l)" = 3 ]; }
wait_for 20 enumerated || { fail "three devices do not enumerate"; exit 1; }
udevadm settle --timeout=20
lsusb

"$sst" topology --json >tree.json 2>err || fail "topology: $(cat err)"
"$sst" topology
python3 - <<'P' || failed=1
import glob, json, os, sys
found = {}
def walk(x):
    if isinstance(x, dict):
        if x.get("serial", "").startswith("SERIAL"):
            found[x["port"]] = (x["serial"], x["name"], x["maker"], x["speed_mbit"])
        for v in x.values():
            walk(v)
    elif isinstance(x, list):
        for v in x:
            walk(v)
walk(json.load(open("tree.json")))
real = {}
for d in glob.glob("/sys/bus/usb/devices/*-1"):
    r = lambda n: open(os.path.join(d, n)).read().strip()
    real[os.path.basename(d)] = (r("serial"), r("product"), r("manufacturer"), int(r("speed")))
print(found)
if found != real or len(real) != 3:
    print("FAIL: the tree is not the system's:", real)
    sys.exit(1)
P

port=$(basename "$(dirname "$(grep -l SERIAL1 /sys/bus/usb/devices/*/serial)")")
present() { [ "$(cat "/sys/bus/usb/devices/$port/serial" 2>/dev/null)" = SERIAL1 ]; }
rung() { # NAME WORDS: the kernel says these words of the port
  dmesg -c >/dev/null
  "$bin/usb" "$1" "$port" >out 2>&1 || fail "$1: $(cat out)"
  cat out
  wait_for 10 present || fail "$1: the device does not come back"
  dmesg >said
  grep -q "usb $port: $2" said || fail "$1: the kernel does not say '$2': $(cat said)"
}
rung reset "reset high-speed USB device"
rung authorise "authorized to connect"
rung power "USB disconnect"
for what in reset authorise power; do
  "$bin/usb" $what 9-9 >out 2>&1 && fail "$what of a port where nothing is"
  cat out
  says out 9-9 "$what -19"
done

# None of them is a camera, and that is said.
"$sst" plan >plan 2>&1
is "exit code of a plan without cameras" $? 3
cat plan
says plan "none of 6 USB devices is a camera"
"$sst" doctor >found 2>&1
is "exit code of the doctor without cameras" $? 3
cat found
says found "PROBLEM  cameras" "no camera is connected"
exit $failed
