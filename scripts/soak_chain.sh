#!/usr/bin/env bash
# soak_chain.sh PROGRAM HOURS SEED: random chains on all processors until the time is over; fails at the first that is bad.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
set -u
# Where the build has traps, all of them (tests/traps.h).
export SST_TRAP_ALL=1
program=$1 seed=$3 end=$(($(date +%s) + $(awk "BEGIN { print int($2 * 3600) }"))) step=500
dir=$(mktemp -d) || exit 1
trap 'kill $(jobs -p) 2>/dev/null; rm -rf "$dir"' EXIT

# worker NUMBER: blocks of seeds of its own
worker() {
  local from=$((seed + $1 * 1000000000))
  while [ "$(date +%s)" -lt "$end" ]; do
    nice "$program" "$from" "$step" >"$dir/$1.last" 2>"$dir/$1.errors" || { cat "$dir/$1.last" "$dir/$1.errors"; return 1; }
    cat "$dir/$1.last" >>"$dir/all"
    from=$((from + step))
  done
}

rc=0
for ((i = 0; i < $(nproc); i++)); do worker "$i" & workers[i]=$!; done
for pid in "${workers[@]}"; do wait "$pid" || rc=1; done
awk -v seed="$seed" '{ chains += $1; bad += $6; fields += $8; refused += $12; pictures += $14; values += $16; if ($19 > most) most = $19; corrected += $28 }
  END { printf "%d chains from seed %s, %d bad: %d light fields processed, %d refused, %d pictures, %d values within %.4f levels of the exact ones, %d light fields corrected\n",
        chains, seed, bad, fields, refused, pictures, values, most, corrected }' "$dir/all"
exit $rc
