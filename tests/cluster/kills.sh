#!/usr/bin/env bash
# 100 light fields by 4 workers, 20 of which are killed with -9 at random times and started again: all are there, with the
# bytes that one process gives, and none was done twice but those of killed workers. Then the time of 4 workers against 1.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
set -u
. "$(dirname "$0")/../lib.sh"
pieces=${PIECES:-100} kills=${KILLS:-20} seed=${SEED:-1} options="--preset preview --threads 1"
RANDOM=$seed
export SST_MODELS=$root/models
make_fields() { # DIR
  mkdir "$1"
  for i in $(seq "$pieces"); do
    "$sst" scene bush -o "$1/b$i" --size 128x96 --grid 3x3 --seed "$i" >/dev/null || fail "scene"
  done
}
make_fields alone
cp -r alone shared
cp -r alone timed
start=$(date +%s%N)
# shellcheck disable=SC2086
"$sst" process alone/* $options >/dev/null 2>err || fail "alone: $(cat err)"
alone_ns=$(($(date +%s%N) - start))

worker() { # I: an array's task, started again when it was killed
  # shellcheck disable=SC2086
  "$sst" process shared/* $options --shard "$1/4" --lease 2 >>"w$1.log" 2>&1 &
  pid[$1]=$!
}
for i in 1 2 3 4; do worker "$i"; done
killed=0
while [ "$killed" -lt "$kills" ]; do
  sleep "0.$((RANDOM % 8 + 1))"
  i=$((RANDOM % 4 + 1))
  kill -9 "${pid[$i]}" 2>/dev/null || break # it is all done
  wait "${pid[$i]}" 2>/dev/null
  killed=$((killed + 1))
  worker "$i"
done
for i in 1 2 3 4; do wait "${pid[$i]}" || fail "worker $i: $(tail -n 3 "w$i.log")"; done
"$sst" process shared/* --status | tail -n 1
"$sst" process shared/* --status --json | python3 -c "
import json, sys
o = json.load(sys.stdin)
assert o['done'] == $pieces, o" || fail "not all are done"
for f in alone/*; do
  diff -rq -x .process "$f" "shared/${f#alone/}" || fail "${f#alone/} differs"
done
done_here=$(cat w?.log | grep -c '^shared/.* views of')
twice=$((done_here - pieces))
taken=$(cat w?.log | grep -c 'taken over')
echo "$killed workers killed; $taken pieces taken over, $twice done twice"
[ "$twice" -le "$killed" ] || fail "$twice pieces were done twice, $killed workers killed"
[ -z "$(find shared -name '*.tmp-*')" ] || fail "left $(find shared -name '*.tmp-*')"

start=$(date +%s%N)
for i in 1 2 3 4; do
  # shellcheck disable=SC2086
  "$sst" process timed/* $options --shard "$i/4" >/dev/null 2>&1 &
  pid[$i]=$!
done
wait "${pid[@]}"
four_ns=$(($(date +%s%N) - start))
python3 -c "
import os
cores = min(4, len(os.sched_getaffinity(0)))
print('1 worker %.1f s, 4 workers %.1f s on %d processors: efficiency %.2f' % ($alone_ns / 1e9, $four_ns / 1e9, cores, $alone_ns / $four_ns / cores))"
exit $failed
