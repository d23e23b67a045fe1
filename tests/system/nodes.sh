#!/usr/bin/env bash
# Two nodes and a head on this machine: their sets become one array's; nodes and head that are killed come back; a count that
# slips is put right; datagrams that are lost are restored, and where none arrive pictures go over TLS; each frame is in one place
# over all hosts; recordings of the nodes are joined.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
. "$(dirname "$0")/../lib.sh"
need libcurl
need libgpiod
. "$root/tests/hosts_lib.sh"
[ -n "${SST_TIMING-}" ] || look=0.3
trap 'kill $relay 2>/dev/null; end_hosts; rm -rf "$tmp"' EXIT
clock[left]="1.5 0" clock[right]="-2.5 60"
# Between left and the head is a network.
address_of[left]=127.0.0.2
mkfifo network
"$build/tests/tools/relay" 127.0.0.2 127.0.0.1 "$port" <network >network.out 2>&1 &
relay=$!
exec {network}>network
for _ in $(seq 200); do grep -q up network.out && break; sleep 0.05; done
certificates
configure
for n in $nodes; do session "$n"; start "$n"; done
start head
whole='s["state"] == "capturing" and s["capture"]["present"] == 4'
await head "$whole and s['capture']['complete'] > 10"
await head 'abs(node("left")["clock_ms"] - node("right")["clock_ms"] - 4) < 3'

# Left is killed: its cameras are missing, and within 2 s of its return they are back.
left_returns() {
  kill -9 "${pid[left]}"
  await head 's["state"] == "degraded" and "node left is not connected" in s["reason"] and s["capture"]["present"] == 2'
  start left
  returned=$(date +%s%N)
  await left 's["capture"]["present"] == 2'
  await head "$whole"
  ms=$((($(date +%s%N) - returned) / 1000000))
  echo "left is back after $ms ms"
  quick $ms 3000 || fail "left is back only after $ms ms"
}
if [ -n "${SST_TIMING-}" ]; then # the rest measures nothing
  left_returns
  exit $failed
fi

# Pictures go by datagrams; losses are made good by parity, or over TLS; where none arrive all go over TLS, and the node says so.
if "$sst" version | grep -q 'isa-l *yes'; then
  for n in left right; do await $n 's["hosts"]["datagrams"]["used"]'; done
  echo "loss 0.1" >&$network
  await head "node('left')['datagrams']['asked'] > 2 and $whole"
  echo "udp 0" >&$network
  await left 'not s["hosts"]["datagrams"]["used"] and "UDP port" in s["hosts"]["datagrams"]["reason"]'
  sets=$(value_of head 's["capture"]["complete"]')
  await head "s['capture']['complete'] > $sets + 10 and $whole"
  SST_SOCKET=$tmp/left.sock timeout 60 "$sst" status >text
  grep -q 'pictures go over TLS: .*UDP port' text || fail "status of a node without datagrams: $(cat text)"
  echo "udp 1" >&$network
  await left 's["hosts"]["datagrams"]["used"]'
  await head "$whole"
  [ "$(value_of head 'node("left")["datagrams"]["missed_sets"]')" = 0 ] || fail "sets were missed: $(value_of head 'node("left")')"
else
  await left 's["hosts"]["datagrams"]["reason"] == "built without ISA-L"'
fi

SST_SOCKET=$tmp/head.sock timeout 60 "$sst" status >text
grep -q '^  node  *left connected, 2 cameras, clock ' text || fail "status of the head: $(cat text)"
SST_SOCKET=$tmp/left.sock timeout 60 "$sst" status >text
grep -q '^  head  *127.0.0.2.* connected; of [0-9]* frames 0 dropped' text || fail "status of a node: $(cat text)"

# A host without a certificate of the array is refused.
echo | timeout 5 openssl s_client -connect "127.0.0.1:$port" >/dev/null 2>&1
grep -q 'hosts: the connection of 127.0.0.1 ended before it was accepted' head.log || fail "no certificate: $(tail -n 3 head.log)"

# Recordings of both nodes and of the head.
for n in left right head; do SST_SOCKET=$tmp/$n.sock "$sst" record start >/dev/null || fail "record start on $n"; done

# Right misses edges: it is put right, and no set is mixed.
"$build/sst-sim" fault --dir right.session gpio.lost_edges=0.3
await head 'node("right")["slips"] > 1'
"$build/sst-sim" fault --dir right.session gpio.lost_edges=0
await head "node('left')['slips'] == 0 and $whole"

left_returns

# The head is restarted: nodes have a gap, which is counted, and go on.
kill -TERM "${pid[head]}"
ended "${pid[head]}" "the head"
await left 's["state"] == "degraded" and "the head is not connected" in s["reason"] and s["capture"]["rate_hz"] > 5'
for n in left right; do value_of $n 's["hosts"]["frames"]["sent"]' >$n.sent; done
start head
await head "$whole and s['capture']['complete'] > 5"
await left 's["state"] == "capturing"'

# No more frames: over all hosts each one is in exactly one place.
for n in left right; do "$build/sst-sim" fault --dir $n.session 'camera.*.stall=5'; done
for n in left right; do
  await $n 's["hosts"]["frames"]["waiting"] == 0 and s["capture"]["present"] == 0'
  await head "node('$n')['frames']['waiting'] == 0 and node('$n')['frames']['passed'] == ended(node('$n')['frames'])"
  sent=$(value_of $n 's["hosts"]["frames"]["sent"] + s["hosts"]["frames"]["unchanged"]')
  received=$(value_of head "node('$n')['frames']['received']")
  [ -n "$sent" ] && [ "$((sent - $(cat $n.sent)))" = "$received" ] ||
    fail "$n has sent $sent frames, $(cat $n.sent) of them to the head before; this one received $received"
  [ "$(value_of $n '[s["hosts"]["frames"]["unexplained"], s["capture"]["frames"]["unexplained"]]')" = '[0, 0]' ] ||
    fail "$n: frames are unexplained: $(value_of $n s)"
  [ "$(value_of $n 's["capture"]["frames"]["set"] == s["hosts"]["frames"]["captured"]')" = true ] ||
    fail "$n: $(value_of $n '[s["capture"]["frames"], s["hosts"]["frames"]]')"
done
[ "$(value_of head '[n["frames"]["unexplained"] for n in s["hosts"]["nodes"]] + [s["capture"]["frames"]["unexplained"]]')" = '[0, 0, 0]' ] ||
  fail "head: frames are unexplained: $(value_of head 's["hosts"]')"
SST_SOCKET=$tmp/head.sock timeout 60 "$sst" status --json >/dev/null
for n in head left; do
  curl -sf --unix-socket "$tmp/$n.sock" http://x/metrics >"$n.metrics" || fail "metrics of $n"
done
grep -q '^sst_node_up{node="left"} 1' head.metrics && grep -q '^sst_node_frames{node="right",bucket="set"} [1-9]' head.metrics ||
  fail "metrics: $(grep sst_node head.metrics | head -n 5)"
grep -q '^sst_link_frames{bucket="sent"} [1-9]' left.metrics || fail "metrics: $(grep sst_link left.metrics)"

# Recordings: on each host alone, and joined, every set is of one trigger.
for n in left right; do kill -TERM "${pid[$n]}"; ended "${pid[$n]}" $n; done
kill -TERM "${pid[head]}"
ended "${pid[head]}" "the head"
join() { echo $1/store/recordings/*/ | tr ' ' '\n' | head -n 1; }
"$build/tests/tools/strips" "$(join head)" >head.strips || fail "sets of the head are mixed: $(cat head.strips)"
"$build/tests/tools/strips" "$(join left)" "$(join right)" >joined.strips || fail "joined sets are mixed: $(cat joined.strips)"
cat head.strips joined.strips
grep -q '"sets": [1-9][0-9]' head.strips && grep -q '"unread": 0' head.strips || fail "head: $(cat head.strips)"
grep -q '"sets": [1-9][0-9]' joined.strips && grep -q '"unread": 0' joined.strips || fail "joined: $(cat joined.strips)"
for i in $(seq 0 40); do # one that both have
  "$sst" import recording "$(join left)" "$(join right)" --sets "$i" -o both.lf >out 2>err && break
done
grep -q '4 views of 320x240' out || fail "import: $(cat out err)"
[ "$(ls both.lf/views | wc -l)" -eq 4 ] || fail "views: $(ls both.lf/views)"
grep -q '"joined"' both.lf/set.json || fail "set.json: $(cat both.lf/set.json)"
want 2 'one source at a time' import stanford "$(join left)" "$(join right)" -o bad.lf
exit $failed
