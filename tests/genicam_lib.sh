# Sourced by tests of GenICam cameras after lib.sh: processes of arv-fake-gv-camera-0.8, one network namespace each, on one bridge.
# Afterwards: space (the array's namespace, 10.88.0.1/24), camera, cable, in_array, end_cameras.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
need aravis
fake=$(command -v arv-fake-gv-camera-0.8) || skip "no arv-fake-gv-camera-0.8 (package aravis-tools)"
[ "$(id -u)" -eq 0 ] || skip "network namespaces need root"
space=sst$$-array
ip netns add "$space" 2>/dev/null || skip "no network namespaces (package iproute2, or the kernel has none)"
hardware="chrt -f 10" # a busy machine does not delay cameras
$hardware true 2>/dev/null || hardware=
declare -A camera_pid
cameras_made=0
end_cameras() {
  local i
  for i in "${!camera_pid[@]}"; do kill "${camera_pid[$i]}" 2>/dev/null; wait "${camera_pid[$i]}" 2>/dev/null; done
  for i in $(seq "$cameras_made"); do ip netns del "sst$$-c$i" 2>/dev/null; done
  ip netns del "$space" 2>/dev/null
  rm -rf "$tmp"
}
trap end_cameras EXIT
in_array() { ip netns exec "$space" "$@"; }
if ! ip -n "$space" link add br0 type bridge 2>/dev/null; then skip "no bridge in this kernel"; fi
ip -n "$space" addr add 10.88.0.1/24 brd + dev br0
ip -n "$space" link set br0 mtu 9000
ip -n "$space" link set br0 up
ip -n "$space" link set lo up

# camera I [LOST_PER_1000 [XML]]: starts camera G<I>, or $serial, at 10.88.0.<I + 1>; camera<I>.out has the time of each exposure
camera() {
  local ns=sst$$-c$1
  if ! ip netns list | grep -q "^$ns\b"; then
    ip netns add "$ns"
    ip link add "g$1" netns "$space" mtu 9000 type veth peer name eth0 netns "$ns" mtu 9000
    ip -n "$space" link set "g$1" master br0 up
    ip -n "$ns" addr add "10.88.0.$(($1 + 1))/24" brd + dev eth0
    ip -n "$ns" link set eth0 up
    ip -n "$ns" link set lo up
    [ "$1" -le "$cameras_made" ] || cameras_made=$1
  fi
  ip netns exec "$ns" $hardware "$fake" -i eth0 -s "${serial:-G$1}" -r "${2:-0}" ${3:+-g "$3"} -d all:3 >"camera$1.out" 2>&1 &
  camera_pid[$1]=$!
}

# cable I up|down
cable() { ip -n "$space" link set "g$1" "$2"; }

# settings N ROWS COLS: keys of the array and its cameras; the rest is the caller's
settings() {
  echo "array: {rows: $2, cols: $3}"
  echo "cameras:"
  printf '  %s\n' "${@:4}"
  echo "  bind:"
  for i in $(seq "$1"); do echo "    - {row: $(((i - 1) / $3)), col: $(((i - 1) % $3)), kind: genicam, serial: G$i}"; done
}
