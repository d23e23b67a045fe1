#!/usr/bin/env bash
# Two fake GigE cameras in network namespaces: their list, a capture by commands with packets lost, settings read back, a camera that
# is not there, PTP by sst doctor. `make check-genicam` has sixteen, cut cables, and both kinds of cameras in one array.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
. "$(dirname "$0")/../lib.sh"
. "$root/tests/genicam_lib.sh"

# The description of the fake camera, with a clock that follows a PTP master, or is one.
for role in Slave Master; do
  gresource extract "$(ldconfig -p | sed -n 's/.*=> \(.*libaravis-0.8.so.0\)$/\1/p' | head -n 1)" /org/aravis/arv-fake-camera.xml |
    sed "s|<pFeature>TestRegister</pFeature>|&<pFeature>PtpEnable</pFeature><pFeature>PtpStatus</pFeature><pFeature>PtpOffsetFromMaster</pFeature>|
         s|<IntReg Name=\"TestRegister\"|<Boolean Name=\"PtpEnable\"><pValue>PtpEnableRegister</pValue><OnValue>1</OnValue><OffValue>0</OffValue></Boolean><Enumeration Name=\"PtpStatus\"><EnumEntry Name=\"$role\"><Value>0</Value></EnumEntry><pValue>PtpStatusRegister</pValue></Enumeration><Integer Name=\"PtpOffsetFromMaster\"><pValue>PtpOffsetRegister</pValue></Integer>$(
           for r in PtpEnable:0x1e0 PtpStatus:0x1e4 PtpOffset:0x1e8; do
             printf '<IntReg Name="%sRegister"><Address>%s</Address><Length>4</Length><AccessMode>RW</AccessMode><pPort>Device</pPort><Sign>Signed</Sign><Endianess>BigEndian</Endianess></IntReg>' "${r%:*}" "${r#*:}"
           done)&|" >$role.xml
  grep -q PtpOffsetRegister $role.xml || skip "no description of the fake camera in libaravis"
done
camera 1 10 Slave.xml
camera 2 0 Slave.xml
{ settings 2 1 2 "format: GREY" "width: 160" "height: 120" "buffers: 8"
  echo "trigger: {source: software, rate_hz: 5}"
  echo "sets: {window_us: 99000, skew_limit_us: 100000}"
  echo "genicam: {trigger: software, exposure_us: 10000, ptp: true}"; } >a.yaml

in_array "$sst" cameras --local --json --config a.yaml >list.json 2>err || fail "cameras: $(cat err)"
in_array "$sst" capture array --config a.yaml -n 15 -o rec --json >json 2>log || fail "capture: $(tail -n 3 log)"
python3 - <<'PY' || fail "list, or frames: $(head -c 2000 json)"
import json
cams = json.load(open("list.json"))["genicam"]
assert sorted((c["serial"], c["col"], c["port"], c["id"]) for c in cams) == [
    ("G1", 0, "10.88.0.2", "Aravis-Fake-G1"), ("G2", 1, "10.88.0.3", "Aravis-Fake-G2")], cams
r = json.load(open("json"))
frames = [c["frames"] for c in r["array"]]
assert r["frames"]["unexplained"] == 0 and sum(frames) == sum(sum(c["buckets"].values()) for c in r["array"]), r
assert 12 <= frames[1] <= 15 and r["array"][1]["faults"]["flagged"] == 0, r # no packet of it is lost
assert frames[0] + r["array"][0]["lost"] <= 15 and r["array"][0]["buckets"]["set"] >= 3, r
PY
python3 "$root/tests/genicam_sets.py" rec 0.2 0=camera1.out 1=camera2.out >sets || fail "mixed sets: $(cat sets)"

# Pictures of the bound ones at their positions; of another one only if it is asked for.
sed '/serial: G2/d' a.yaml >one.yaml
in_array "$sst" identify --config one.yaml -o faces --json >json 2>err || fail "identify: $(cat err)"
grep -q '1 GenICam cameras are not bound' err || fail "identify: the other is not told: $(cat err)"
in_array "$sst" identify --config one.yaml -o faces2 --serial G2 --write bind.yaml >out 2>&1 || fail "identify --serial: $(cat out)"
grep -q 'kind: genicam, serial: "G2"' bind.yaml || fail "bindings: $(cat bind.yaml)"
python3 - <<'PY' || fail "identify: $(cat json)"
import json, os
cams = json.load(open("json"))["cameras"]
assert [(c["serial"], c["port"], c["row"], c["col"], c["picture"]) for c in cams] == [
    ("G1", "10.88.0.2", 0, 0, "faces/10.88.0.2_G1.png")], cams
for f in ("faces/10.88.0.2_G1.png", "faces/identify.png", "faces2/10.88.0.3_G2.png"):
    assert os.path.getsize(f) > 100, f
PY

# Settings that a camera has not are named with it; values that no camera can have are refused before.
sed 's/exposure_us: 10000/gain: 3.5, pixel_format: Mono12/; s/GREY/Y16/' a.yaml >bad.yaml
in_array timeout 20 "$sst" capture array --config bad.yaml -n 1 >/dev/null 2>err && fail "a format that no camera has"
grep -q 'camera G[12]: it has no pixel format for cameras: format and genicam: Mono12; it has.* Mono16' err || fail "format: $(cat err)"
sed 's/exposure_us: 10000/gain: 3.5/; s/GREY/Y16/' a.yaml >odd.yaml
in_array timeout 20 "$sst" capture array --config odd.yaml -n 1 >/dev/null 2>err || fail "capture of Y16: $(cat err)"
grep -q 'camera G2: gain is 3, not 3.5' err || fail "what a camera did not take is not told: $(cat err)"
rm bad.yaml
sed 's/GREY/MJPEG/' a.yaml >mjpeg.yaml
want 3 "MJPEG is no format of GenICam cameras" capture array --config mjpeg.yaml -n 1
sed 's/trigger: software/trigger: wire/' a.yaml >wire.yaml
want 3 "wire needs pulses" capture array --config wire.yaml -n 1

# PTP: both follow a master; then each is one. Devices that draw are none of this.
export VK_DRIVER_FILES=/dev/null VK_ICD_FILENAMES=/dev/null
in_array "$sst" doctor --config a.yaml >doctor 2>&1
grep -q 'all 2 GenICam cameras of the configuration answer' doctor || fail "doctor: $(grep -i genicam doctor)"
grep -q '2 cameras follow a PTP master, the farthest by 0.0 us' doctor || fail "clocks: $(grep -i ptp doctor)"
for i in 1 2; do kill "${camera_pid[$i]}"; wait "${camera_pid[$i]}" 2>/dev/null; done
camera 1 0 Master.xml
camera 2 0 Master.xml
sed 's/serial: G2/serial: Aravis-Fake-G2/; s/cols: 2/cols: 3/' a.yaml | sed '/^trigger:/i\    - {row: 0, col: 2, kind: genicam, serial: G3}' >more.yaml
in_array "$sst" doctor --config more.yaml >doctor 2>&1 && fail "a camera is missing, and doctor is content"
grep -q '1 of 3 GenICam cameras do not answer, G3' doctor || fail "doctor: $(grep -i genicam doctor)"
grep -q '2 cameras are PTP masters, Aravis-Fake-G' doctor || fail "clocks: $(grep -i ptp doctor)"

# Names that would move a terminal's cursor; it is opened nevertheless.
serial=$'G\e[31m3' camera 3 0 Master.xml
"$root/tests/until.sh" "ip netns exec $space '$sst' cameras --local >list 2>err; grep -qF 'G?[31m3' list" || fail "a name with escapes: $(cat -v list err)"
! grep -q $'\e' list || fail "escapes reach the terminal: $(cat -v list)"
sed 's/serial: G1/serial: "G?[31m3"/; /serial: G2/d; s/cols: 2/cols: 1/' a.yaml >odd.yaml
in_array timeout 20 "$sst" capture array --config odd.yaml -n 2 >/dev/null 2>err || fail "an odd name: $(cat -v err)"
exit $failed
