#!/usr/bin/env bash
# `sst export colmap`: the commands of each export's README.txt, run by the COLMAP that is installed, triangulate arrays
# whole, with a hole, with mixed lenses and endings, and views that converge, to the depths of the truth.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
set -u
. "$(dirname "$0")/../lib.sh"
python=${PYTHON:-/usr/bin/python3}
tool=$root/tests/colmap/tool.py
export QT_QPA_PLATFORM=offscreen

ok() { "$sst" "$@" >out 2>err || fail "sst $*: $(head -c 400 err)"; }

version=$(colmap -h 2>&1 | sed -n 's/^COLMAP \([0-9]*\.[0-9]*\).*/\1/p' | head -n 1)
[ -n "$version" ] || { fail "colmap does not name its version"; exit 1; }
case $version in 3.8|3.9|3.10|3.11) block="3.8 to 3.11";; *) block="3.12 and later";; esac

# triangulate EXPORT: by its README, then judged
triangulate() {
  sed -n "/^# COLMAP $block\$/,/^\$/p" "$1/README.txt" | grep -v '^#' >"$1/run.sh"
  if (cd "$1" && sh -ex run.sh >log 2>&1); then
    colmap model_converter --input_path "$1/points" --output_path "$1/points" --output_type TXT >>"$1/log" 2>&1
    "$python" "$tool" judge "$1" || fail "$1"
  else
    fail "$1: COLMAP $version: $(tail -n 5 "$1/log")"
  fi
}

ok scene bush -o scene --size 480x360 --grid 3x3
"$python" "$tool" make || { fail "the samples"; exit 1; }
ok export colmap scene -o whole
ok rectify scene --calib plain.yaml -o plain
ok export colmap plain -o array
ok import folder holed --grid 3x3 --infinity-px 0 -o holed.lf
ok export colmap holed.lf -o hole --focal-px "$(cat focal)" --spacing-mm "$(cat spacing)"
ok import folder holed --grid 3x3 --calib mixed.yaml -o mixed.lf
ok export colmap mixed.lf -o mixed
ok import hci converging -o converging.lf
ok export colmap converging.lf -o hci
for made in whole array hole mixed hci; do triangulate "$made"; done
[ "$failed" -eq 0 ] && echo "COLMAP $version triangulates exports to the depths of the truth"
exit $failed
