#!/usr/bin/env bash
# The chain in a sanitized build that ends at floating-point exceptions: invalid operations, divisions by zero, overflow.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
set -u
. "$(dirname "$0")/../lib.sh"
checked=$root/build-address-undefined/sst
[ -x "$checked" ] || skip "no build with SAN=address,undefined"
export SST_TRAPS=all ASAN_OPTIONS="detect_leaks=0:${ASAN_OPTIONS:-}"

# try ARGS: ends well
try() { "$checked" "$@" >out 2>err || fail "sst $*: $(grep -E 'ERROR|#[0-4] ' err || tail -3 err)"; }

try scene pedestrian -o p --size 96x72 --grid 3x3
try process p --json
try eval p --truth p/truth --json
try render p -o a.png
try render p --method clear -o b.png --json
try render p --method refocus --focus 5 -o c.jpg
try stereo p/views/00_00.png p/views/00_01.png -m 20 -o d.pfm
try calibrate --check p
try process p --no-labels --preset preview
try scene bush -o b --size 64x48 --grid 3x3
try process b --no-labels --preset accurate --skip none
try render b --verify-rays on -o x.png
[ $failed = 0 ] && echo "no floating-point exception in the chain"
exit $failed
