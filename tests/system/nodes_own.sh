#!/usr/bin/env bash
# A head that has cameras of its own, and a node: sets have the frames of both, a slip of the head's own count is put right,
# and a camera of its own that is unplugged is missing.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
. "$(dirname "$0")/../lib.sh"
need libcurl
need libgpiod
. "$root/tests/hosts_lib.sh"
[ -n "${SST_TIMING-}" ] || look=0.3
trap 'end_hosts; rm -rf "$tmp"' EXIT
clock[right]="2 50"
certificates
configure
for n in left right; do session $n; done
start right
# What would be the node "left" is the head: its cameras and trigger, and the rest as of a head.
sed "/^hosts:/,\$d; s/^role: .*/role: head/" left/sstd.yaml >head/own.yaml
sed -n '/^hosts:/,$p' head/sstd.yaml | sed 's/nodes: .*/nodes: [right]/' >>head/own.yaml
mv head/own.yaml head/sstd.yaml
ln -s left.session head.session
start head
await head 's["state"] == "capturing" and s["capture"]["present"] == 4 and s["capture"]["complete"] > 10'
own='next(n for n in s["hosts"]["nodes"] if not n["name"])'
[ "$(value_of head "[$own['cameras'], node('right')['cameras']]")" = '[2, 2]' ] || fail "hosts: $(value_of head 's["hosts"]')"
"$build/sst-sim" fault --dir left.session gpio.lost_edges=0.3
await head "$own['slips'] + node('right')['slips'] > 0"
"$build/sst-sim" fault --dir left.session gpio.lost_edges=0
"$build/sst-sim" fault --dir left.session camera.0.unplug=1
await head 's["state"] == "degraded" and s["capture"]["present"] == 3 and "r0c0 (absent)" in s["reason"]'
"$build/sst-sim" fault --dir left.session camera.0.unplug=0
await head 's["capture"]["present"] == 4'
SST_SOCKET=$tmp/head.sock "$sst" record start >/dev/null || fail "record start"
await head 's["storage"]["recording"]["sets"] > 8'
[ "$(value_of head 's["capture"]["frames"]["unexplained"] + sum(n["frames"]["unexplained"] for n in s["hosts"]["nodes"])')" = 0 ] ||
  fail "unexplained: $(value_of head s)"
kill -TERM "${pid[head]}"
ended "${pid[head]}" "the head"
"$build/tests/tools/strips" head/store/recordings/*/ >strips || fail "mixed: $(cat strips)"
grep -q '"unread": 0' strips || fail "$(cat strips)"
cat strips
exit $failed
