#!/usr/bin/env bash
# The comparison behind `make bench-check`: a slower stage is named, noise that stages and loops share is not.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
echo '{"box": {"render": 2.0, "match": 5.0}}' >"$dir/base.json"
# part, factor of the machine's slowness and of the stage's
table() {
    echo "part,round,cpu_ms"
    for round in 1 2 3; do
        load=$(awk -v r="$round" -v l="$1" 'BEGIN { print l * (1 + r / 2) }')
        awk -v r="$round" -v l="$load" -v f="$2" 'BEGIN {
            print "loop a," r "," 5 * l; print "loop b," r "," 20 * l
            print "render," r "," 20 * l * f; print "match," r "," 50 * l }'
    done
}
compare() { python3 scripts/bench_check.py --baseline "$dir/base.json" --machine box --compare "$dir/now.csv"; }
table 1 1 >"$dir/now.csv"
compare || { echo "equal times are called slower"; exit 1; }
table 3 1.08 >"$dir/now.csv"
compare || { echo "a slow machine is called a slower stage"; exit 1; }
table 1 1.2 >"$dir/now.csv"
if out=$(compare); then echo "a stage of 1.2 times its time passed"; exit 1; fi
[ "$out" = "slower: render takes 1.20 times its baseline" ] || { echo "wrong message: $out"; exit 1; }
echo "1 passed"
