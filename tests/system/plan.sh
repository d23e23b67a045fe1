#!/usr/bin/env bash
# sst topology, sst plan and the findings of sst doctor about USB, on a tree of devices by umockdev.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
set -u
. "$(dirname "$0")/../lib.sh"
command -v umockdev-run >/dev/null || skip "umockdev is not installed"
[ "$("$sst" version --json | python3 -c 'import json, sys; print(json.load(sys.stdin)["parts"]["libudev"])')" = True ] ||
  echo "without libudev: cameras are looked for in /dev"
# umockdev's library is loaded before the sanitizer's, which cannot name a file for its reports then.
export ASAN_OPTIONS=verify_asan_link_order=0
unset UBSAN_OPTIONS

# tree VENDOR: a controller of that vendor with 4 root ports; on port 1 a hub with three greedy cameras, on port 2 another
# camera; the SuperSpeed half of the controller is empty.
tree() {
  python3 - "$1" >tree.umockdev <<'PY'
import sys
root = "/devices/pci0000:00/0000:00:14.0"
def device(path, attributes, descriptors=b"", **env):
    print(f"P: {path}\nE: SUBSYSTEM={env.pop('SUBSYSTEM', 'usb')}")
    for key, value in env.items():
        print(f"E: {key}={value}")
    for key, value in attributes.items():
        print(f"A: {key}={value}")
    if descriptors:
        print(f"H: descriptors={descriptors.hex().upper()}")
    print()
def usb(path, bus, address, speed, cls, ports=0, protocol="01", maker="Acme", name="thing", serial=None, d=b""):
    a = dict(busnum=bus, devnum=address, speed=speed, bDeviceClass=cls, bDeviceProtocol=protocol, maxchild=ports,
             idVendor="1d6b", idProduct="0102", manufacturer=maker, product=name)
    if serial:
        a["serial"] = serial
    device(path, a, d, DEVTYPE="usb_device", BUSNUM=f"{bus:03}", DEVNUM=f"{address:03}")
d = bytes([18, 1, 0, 2, 0xef, 2, 1, 64, 0x6b, 0x1d, 2, 1, 0, 1, 1, 2, 3, 1, 9, 2, 0, 0, 2, 1, 0, 0x80, 250])
d += bytes([9, 4, 1, 0, 0, 14, 2, 0, 0])
for alt, packet in enumerate((0x0200, 0x0400, 0x1400), 1):
    d += bytes([9, 4, 1, alt, 1, 14, 2, 0, 0, 7, 5, 0x81, 5, packet & 255, packet >> 8, 1])
device(root, dict(vendor=sys.argv[1]), SUBSYSTEM="pci")
usb(root + "/usb1", 1, 1, 480, "09", 4, maker="Linux 6.1.0 xhci-hcd", name="xHCI Host Controller")
usb(root + "/usb2", 2, 1, 5000, "09", 4, "03", maker="Linux 6.1.0 xhci-hcd", name="xHCI Host Controller")
usb(root + "/usb1/1-1", 1, 2, 480, "09", 4, name="Hub")
for i, path in enumerate(("/usb1/1-1/1-1.1", "/usb1/1-1/1-1.2", "/usb1/1-1/1-1.10", "/usb1/1-2")):
    usb(root + path, 1, 3 + i, 480, "ef", name="Camera", serial=f"SN{i}", d=d)
    interface = root + path + "/" + path.rsplit("/", 1)[1] + ":1.0"
    device(interface, {}, DEVTYPE="usb_interface")
    device(f"{interface}/video4linux/video{i}", dict(index=0, name="Camera"), SUBSYSTEM="video4linux",
           DEVNAME=f"/dev/video{i}")
PY
}
mock() { umockdev-run -d tree.umockdev -- "$sst" "$@"; }
# check FILE PYTHON: the JSON object j in FILE
check() { python3 -c "import json; j = json.load(open('$1')); assert $2, $2" 2>check.err || fail "$2: $(tail -n 1 check.err)"; }

tree 0x8086
mock topology --json >topology.json 2>err || fail "topology: $(cat err)"
check topology.json '[d["port"] for d in j["devices"]] == "usb1 1-1 1-1.1 1-1.2 1-1.10 1-2 usb2".split()'
check topology.json 'j["devices"][2]["parent"] == "1-1" and j["devices"][2]["controller"] == "0000:00:14.0"'
check topology.json 'j["devices"][2]["serial"] == "SN0" and j["devices"][2]["node"] == "/dev/video0"'
check topology.json '[s["packet_bytes"] for s in j["devices"][2]["settings"]] == [512, 1024, 3072]'
check topology.json 'j["devices"][1]["ports"] == 4 and j["devices"][1]["single_tt"] and j["devices"][1]["power_switching"]'
mock topology >out 2>err || fail "topology: $(cat err)"
grep -q '1-1.10.*camera SN2 /dev/video2' out || fail "topology: $(cat out)"

# Three greedy cameras behind one root port of an Intel controller: one fits; the one on the next root port does too.
mock plan --json >plan.json 2>err
[ $? -eq 3 ] || fail "plan with refused cameras: not exit 3: $(cat err)"
check plan.json '[c["fits"] for c in j["cameras"]] == [True, False, False, True] and j["refused"] == 2'
check plan.json 'all(c["setting"] == 3 for c in j["cameras"]) and len(j["segments"]) == 2'
check plan.json '"free port 1-3" in j["advice"]'
# YUYV at 640x480: 1012 bytes a microframe is what the 1024-byte setting carries, 13.18 frames/s
check <(mock plan --json --format YUYV --size 640x480 --rate 13) 'j["refused"] == 0 and j["cameras"][0]["setting"] == 2'
check <(mock plan --json --format YUYV --size 640x480 --rate 14) 'j["refused"] == 2 and "13.1" in j["advice"]'
check <(mock plan --json --format YUYV --size 1920x1080 --rate 30) \
  'j["refused"] == 4 and j["cameras"][0]["setting"] == -1 and "No setting" in j["advice"]'
mock plan >out 2>err
grep -q '1-1.2 .*refused.*No space left' out || fail "plan: $(cat out)"

# Of another maker's controller one bus for all is taken for granted: no port helps.
tree 0x1912
check <(mock plan --json) 'j["refused"] == 3 and "No free port" in j["advice"]'
check <(mock plan --json --format YUYV --size 640x480 --rate 13) 'j["refused"] == 0 and len(j["segments"]) == 1'

# A configuration chooses and orders cameras.
cat >array.yaml <<'EOF'
array: { rows: 1, cols: 3 }
cameras:
  bind:
    - { row: 0, col: 0, serial: SN3 }
    - { row: 0, col: 1, port: 1-1.2 }
    - { row: 0, col: 2, serial: SN9 }
EOF
check <(mock plan --json --config array.yaml) '[c["port"] for c in j["cameras"]] == ["1-2", "1-1.2"] and j["refused"] == 1'
# Devices that draw are none of this; doctor would test them each time.
export VK_DRIVER_FILES=/dev/null VK_ICD_FILENAMES=/dev/null
mock doctor --json --config array.yaml -o . >doctor.json 2>err
[ $? -eq 3 ] || fail "doctor with problems: not exit 3: $(cat err)"
check doctor.json 'any(f["level"] == "PROBLEM" and "r0c2 (serial SN9)" in f["text"] for f in j["findings"])'
check doctor.json 'any(f["level"] == "PROBLEM" and "no bandwidth for 1 of 2" in f["text"] for f in j["findings"])'
check doctor.json 'any(f["area"] == "disk" and f["level"] != "PROBLEM" for f in j["findings"])'

# --- refusals and machines without ---
rm -rf none; mkdir none
"$sst" topology >out 2>err || fail "topology on this machine: $(cat err)"
want 2 "format" plan --format wrong
want 2 "outside" plan --rate 0
want 2 "too many" topology x
want 3 "nowhere.yaml" plan --config nowhere.yaml
want 3 "nowhere.yaml" doctor --config nowhere.yaml
printf 'cameras: { width: wide }\n' >wrong.yaml
want 3 "wrong.yaml:1:" doctor --config wrong.yaml
"$sst" doctor -o /proc --json >doctor.json 2>err
[ $? -eq 3 ] || fail "doctor -o /proc: not exit 3"
check doctor.json 'any(f["area"] == "disk" and f["level"] == "PROBLEM" for f in j["findings"])'
"$sst" doctor -o nowhere --json >doctor.json 2>err
check doctor.json 'any("nowhere: No such file" in f["text"] for f in j["findings"])'
exit $failed
