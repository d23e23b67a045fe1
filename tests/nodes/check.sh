#!/usr/bin/env bash
# Nodes and a head, each in a network namespace of its own, on a network that loses, delays and reorders packets (tests/tools/wire.c).
# Each minute a node is killed and comes back; at last its cable is cut, and it misses edges: every frame is in one place, no set is
# mixed, and sets are hardly later than on one host. MINUTES=30, NODES=2, LOSS=0.02, DELAY="25 25" (ms each way, +- ms), CYCLE=60 (s),
# DATAGRAMS=true (false: over TLS alone), PARITY=10, LATER=150 (ms that the head's sets may be later than those of one host). The last
# lines are a table for docs/measured/notes-service.md.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
set -u
. "$(dirname "$0")/../lib.sh"
[ "$(id -u)" -eq 0 ] || { echo "network namespaces need root"; exit 77; }
[ -c /dev/net/tun ] || { echo "no /dev/net/tun (kernel module tun)"; exit 77; }
ip netns list >/dev/null 2>&1 || { echo "no ip netns (package iproute2)"; exit 77; }
minutes=${MINUTES:-30} count=${NODES:-2} loss=${LOSS:-0.02} delay=${DELAY:-25 25} cycle=${CYCLE:-60}
nodes=$(seq -f 'n%g' "$count") nodes=${nodes//$'\n'/ }
datagrams=${DATAGRAMS:-true} parity=${PARITY:-10} # of each node
rows=6 cols=6 size="[320, 240]" width=320 height=240 quality=30 ring=128 head_address=0.0.0.0
. "$root/tests/hosts_lib.sh"
declare -A wire
wires=
space() { echo "sst$$-$1"; }
end_all() {
  local n
  for n in $wires; do kill "$n" 2>/dev/null; done
  end_hosts 2>/dev/null
  for n in head $nodes; do ip netns del "$(space "$n")" 2>/dev/null; done
  rm -rf "$tmp"
}
trap end_all EXIT

# --- the network ------------------------------------------------------------------------------------------------------------
i=0
ip netns add "$(space head)"
echo "network, each way: loss $loss, delay ${delay/ / +- } ms; pictures $([ "$datagrams" = true ] && echo "by datagrams, parity $parity %" || echo "over TLS")"
# shape NODE LOSS "DELAY JITTER"; cut NODE 1|0
shape() { printf 'loss %s\ndelay %s\n' "$2" "$3" >&"${wire[$1]}"; }
cut() { echo "cut $2" >&"${wire[$1]}"; }
for n in $nodes; do
  i=$((i + 1))
  ip netns add "$(space "$n")"
  at[$n]="ip netns exec $(space "$n")"
  address_of[$n]=10.77.$i.1
  clock[$n]="$((i * 2 - 5)) $((3 - i))" # ms and ppm: as far as a clock that is kept may be off in half an hour
  mkfifo "$n.wire"
  "$build/tests/tools/wire" "$(space "$n")" "10.77.$i.2/24" "$(space head)" "10.77.$i.1/24" <"$n.wire" >"$n.wire.out" 2>&1 &
  wires+=" $!"
  exec {fd}>"$n.wire"
  wire[$n]=$fd
  for _ in $(seq 200); do grep -q up "$n.wire.out" && break; sleep 0.05; done
  grep -q up "$n.wire.out" || { echo "the simulated network does not start: $(cat "$n.wire.out")"; exit 1; }
  ip -n "$(space "$n")" link set lo up
done
ip -n "$(space head)" link set lo up
at[head]="ip netns exec $(space head)"
certificates
configure

# --- one host alone, for comparison -----------------------------------------------------------------------------------------
mkdir one
sed '/^host:/d' n1/world.yaml >one/world.yaml
echo "host: {generator_hz: $rate}" >>one/world.yaml
sed "s/^role: .*/role: single/; /^hosts:/d; s,$tmp/n1,$tmp/one,g; /^    - {row/d; s/^  bind:/  bind: []/" n1/sstd.yaml >one/sstd.yaml
session one
start one
await one 's["capture"]["present"] == 36 and s["capture"]["complete"] > 20'
sleep 20
alone_ms=$(value_of one 's["capture"]["delay_ms"]["p99"]')
alone=$(value_of one '" | ".join("%.0f" % s["capture"]["delay_ms"][k] for k in ("p50", "p99", "max"))')
echo "one host: sets are there $(value_of one '[s["capture"]["delay_ms"][k] for k in ("p50", "p99", "max")]') ms after the trigger (p50, p99, max), $(value_of one 's["capture"]["complete"]') of $(value_of one 's["capture"]["sets"]') complete"
kill "${pid[one]}"
"$build/sst-sim" stop --dir one.session >/dev/null
unset 'pid[one]'

# --- all hosts --------------------------------------------------------------------------------------------------------------
for n in $nodes; do shape "$n" "$loss" "$delay"; session "$n"; start "$n"; done
start head
whole='s["state"] == "capturing" and s["capture"]["present"] == 36'
await head "$whole and s['capture']['complete'] > 10"
declare -A before
for n in $nodes; do before[$n]=0; done
turn=0 worst_ms=0 sets=0 frames=0

# Each sets $returned, and $opened_ms, which the node took for its own start: that is not the network's.
kill_node() {
  kill -9 "${pid[$1]}"
  await head "not node('$1')['connected']"
  sleep 2
  before[$1]=$(value_of head "node('$1')['frames']['received']")
  start "$1"
  returned=$(date +%s%N)
  await "$1" 's["capture"]["present"] > 0'
  opened_ms=$((($(date +%s%N) - returned) / 1000000))
}
cut_cable() {
  cut "$1" 1
  await head "not node('$1')['connected']"
  sleep 3
  cut "$1" 0
  returned=$(date +%s%N) opened_ms=0
}
miss_edges() {
  local slips
  slips=$(value_of head "node('$1')['slips']")
  "$build/sst-sim" fault --dir "$1.session" gpio.lost_edges=0.1
  await head "node('$1')['slips'] > $slips"
  "$build/sst-sim" fault --dir "$1.session" gpio.lost_edges=0
  returned=$(date +%s%N) opened_ms=0
}

# fault WHAT NODE SECONDS: while the head records; then what it recorded, and the sums
fault() {
  local next=$((SECONDS + $3)) ms r seen
  SST_SOCKET=$tmp/head.sock "$sst" record start >/dev/null || fail "record"
  "$1" "$2"
  await head "$whole"
  ms=$((($(date +%s%N) - returned) / 1000000 - opened_ms))
  [ "$ms" -le "$worst_ms" ] || worst_ms=$ms
  while [ $SECONDS -lt $((next - 8)) ]; do sleep 1; done
  SST_SOCKET=$tmp/head.sock "$sst" record stop >/dev/null || fail "record stop"
  await head 'not s["storage"]["recording"]["active"]'
  for r in head/store/recordings/*/; do
    seen=$("$build/tests/tools/strips" "$r" 2>strips.err) || fail "mixed: $seen $(head -n 3 strips.err)"
    sets=$((sets + $(echo "$seen" | /usr/bin/python3 -c 'import json, sys; print(json.load(sys.stdin)["sets"])')))
    frames=$((frames + $(echo "$seen" | /usr/bin/python3 -c 'import json, sys; d = json.load(sys.stdin); print(d["frames"] - d["unread"])')))
    rm -rf "$r"
  done
  [ "$(value_of head 'sum(n["frames"]["unexplained"] for n in s["hosts"]["nodes"]) + s["capture"]["frames"]["unexplained"]')" = 0 ] ||
    fail "unexplained frames: $(value_of head 's["hosts"]')"
  echo "$(date +%T) $1 $2, back after $ms ms; $(value_of head '[s["capture"]["sets"], s["capture"]["complete"], s["capture"]["delay_ms"], {n["name"]: n["slips"] for n in s["hosts"]["nodes"]}]')"
  turn=$((turn + 1))
  while [ $SECONDS -lt $next ]; do sleep 1; done
}

end=$((SECONDS + minutes * 60))
while [ $SECONDS -lt $end ] && [ $failed = 0 ]; do fault kill_node n$((turn % count + 1)) "$cycle"; done
p99_ms=$(value_of head 's["capture"]["delay_ms"]["p99"]')
delays=$(value_of head '" | ".join("%.0f" % s["capture"]["delay_ms"][k] for k in ("p50", "p99", "max"))')
complete=$(value_of head '"%.2f" % (100 * s["capture"]["complete"] / s["capture"]["sets"])')
counts=$(value_of head '"%d of %d sets repaired, %d missed, %d datagrams had no room" % (sum(n["datagrams"]["asked"] for n in s["hosts"]["nodes"]), sum(n["sets"] for n in s["hosts"]["nodes"]), sum(n["datagrams"]["missed_sets"] for n in s["hosts"]["nodes"]), s["hosts"]["datagrams_no_room"])')
rate=$(value_of head '"%.2f" % (sum(n["received_bytes"] for n in s["hosts"]["nodes"]) / max(1, s["capture"]["sets"]) * '$rate' / 1e6)')
load=$(/usr/bin/cut -d' ' -f1-3 /proc/loadavg)
late_ms=$worst_ms worst_ms=0
for n in $nodes; do
  fault cut_cable "$n" 15 # sets wait for who is silent, for 2 s: not part of the delays above
  fault miss_edges "$n" 15
done

# --- every frame in one place -----------------------------------------------------------------------------------------------
for n in $nodes; do "$build/sst-sim" fault --dir "$n.session" 'camera.*.stall=5'; done
for n in $nodes; do
  await "$n" 's["hosts"]["frames"]["waiting"] == 0 and s["capture"]["present"] == 0'
  await head "node('$n')['frames']['waiting'] == 0 and node('$n')['frames']['passed'] == ended(node('$n')['frames'])"
  sent=$(value_of "$n" 's["hosts"]["frames"]["sent"] + s["hosts"]["frames"]["unchanged"]')
  received=$(value_of head "node('$n')['frames']['received']")
  [ "$sent" = $((received - before[$n])) ] || fail "$n has sent $sent frames since its start, $((received - before[$n])) were received"
  echo "$n since its last start: $(value_of "$n" 's["hosts"]["frames"]'); at the head in all: $(value_of head "{k: v for k, v in node('$n')['frames'].items() if v}")"
done
echo "$count nodes, $((36 / count)) cameras each, $minutes minutes, $turn faults: $(value_of head 's["capture"]["sets"]') sets; $frames frames in $sets recorded sets, none mixed"
unquote() { echo "${*//\"/}"; }
cat <<END

| from the trigger until the set is there, ms | p50 | p99 | max |
|---|---|---|---|
| one host, without the network | $(unquote "$alone") |
| head of $count nodes, loss $loss, delay ${delay/ / +- } ms, $([ "$datagrams" = true ] && echo "datagrams, parity $parity %" || echo "TLS") | $(unquote "$delays") |

$minutes minutes: $(unquote "$complete") % of the sets complete; $(unquote "$counts"); $(unquote "$rate") MB/s came; a node that was killed was back after at most
$late_ms ms, one that was cut off after $worst_ms ms; load of the machine $load on $(nproc) cores
END
/usr/bin/python3 -c "import sys; sys.exit($p99_ms - $alone_ms > ${LATER:-150})" || fail "p99 is $p99_ms ms, of one host $alone_ms ms: more than ${LATER:-150} ms later"
[ "$late_ms" -le 2000 ] || fail "a node was back only after $late_ms ms"
[ "$worst_ms" -le 5000 ] || fail "a node was back only $worst_ms ms after its cable"
exit $failed
