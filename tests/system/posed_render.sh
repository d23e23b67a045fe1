#!/usr/bin/env bash
# `sst render` and `sst sweep` of light fields with a pose for every view: outputs of 8 and 16 bits and floats, terrain, the
# ground, same bytes with any number of threads, and bad surfaces, each refused in one sentence with nothing written.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
set -u
. "$(dirname "$0")/../lib.sh"

"$sst" scene forest -o forest.lf --size 176x176 -q >out 2>err || fail "scene: $(cat err)"
"$sst" scene flight -o flight.lf --size 160x128 --grid 1x12 -q >out 2>err || fail "scene: $(cat err)"
terrain=forest.lf/truth/ground.obj

for m in refocus see-through clear; do
  for t in 1 3; do
    "$sst" render forest.lf -m $m --surface $terrain -t $t -o $m$t.png --valid valid$t.png >out 2>err || fail "$m: $(cat err)"
  done
  cmp -s ${m}1.png ${m}3.png || fail "$m depends on the number of threads"
  cmp -s valid1.png valid3.png || fail "--valid of $m depends on the number of threads"
done
cmp -s refocus1.png clear1.png && fail "clear pictures are integrals"
"$sst" render forest.lf -m refocus --near 25 --far 60 --view C4 --json -o ground.png >out 2>err || fail "ground: $(cat err)"
grep -q '"kind": "ground"' out || fail "no ground in $(cat out)"
for end in png tif pfm jpg; do
  "$sst" render flight.lf -m refocus --surface flight.lf/truth/ground.obj -o thermal.$end >out 2>err || fail "$end: $(cat err)"
done
grep -q "levels [0-9]* to [0-9]* ([0-9.]* to [0-9.]* degrees Celsius) stretched" out || fail "the stretch of a JPEG is not said: $(cat out)"
"$sst" render flight.lf -m refocus --surface plane:30 --levels 7000,7300 --json -o fixed.jpg >out 2>err || fail "--levels: $(cat err)"
tr -d ' \n' <out | grep -q '"stretch":\[7000,7300\]' || fail "--levels: $(cat out)"
[ "$(head -c 25 thermal.png | tail -c 1 | od -An -tu1 | tr -d ' ')" = 16 ] || fail "thermal.png has not 16 bits"
"$sst" render flight.lf -m refocus --surface plane:30 --view nadir -o nadir.png >out 2>err || fail "nadir: $(cat err)"
"$sst" sweep forest.lf -m refocus --surface $terrain --from -1 --to 1 --steps 3 -o sweep >out 2>err || fail "sweep: $(cat err)"
grep -q "^sweep: terrain [34][0-9.]* m in front" out && grep -q "3 pictures, heights from -1.00 to 1.00 m" out || fail "sweep says: $(cat out)"
sed '/"up": \[/,/\]/d' flight.lf/lightfield.json >up.json && cp -r flight.lf level.lf && cp up.json level.lf/lightfield.json
"$sst" render level.lf -m refocus --surface plane:30 --view nadir -o level.png >out 2>err || fail "nadir without gravity: $(cat err)"
grep -q "gravity is unknown: nadir looks straight at the surface" err || fail "nadir without gravity: $(cat err)"
grep -q '"height_m": -1' sweep/sweep.json && [ -s sweep/0002.png ] || fail "sweep: $(cat sweep/sweep.json)"

refuse() { # text, arguments of sst render
  local text=$1
  shift
  "$sst" render "$@" -o refused.png >out 2>err && fail "$* is not refused"
  [ "$(grep -c error: err)" = 1 ] && grep -q -- "$text" err || fail "$*: $(cat err)"
  [ ! -e refused.png ] || fail "$*: something was written"
}
refuse "neither a distance" forest.lf --surface plane:0
refuse "neither a distance" forest.lf --surface plane:1,nan,3,4
refuse "on a line" forest.lf --surface plane:0,0,0,1,1,1,2,2,2
refuse "neither ground nor" forest.lf --surface somewhere
refuse "beside or behind" forest.lf -m refocus --surface plane:0,0,1,900
refuse "No such file" forest.lf --surface gone.tif
refuse "nor a view of" forest.lf --surface plane:40 --view gone
sed 's/^v \([^ ]*\) \([^ ]*\) .*/v \1 \2 500/' $terrain >high.obj
refuse "all above the camera" forest.lf --surface high.obj
sed "/^v /{s/^v \\([^ ]*\\) \\([^ ]*\\) .*/v \\1 \\2 -9999/;:a;n;ba}" $terrain >deep.obj # the first height
"$sst" render forest.lf -m refocus --surface deep.obj -o deep.png >out 2>err && grep -q "down to -9999 m; if these stand" err || fail "heights that are unknown: $(cat out err)"
refuse "not two ascending" flight.lf --surface plane:40 --levels 7300,7000
refuse "keeps all levels" flight.lf --surface plane:40 --levels 7000,7300
refuse "those of forest.lf have 8" forest.lf --surface plane:40 --levels 1,2
refuse "is of --surface with a terrain" forest.lf --surface plane:40 --utm 33N
refuse "not nearer than" forest.lf --near 50 --far 20
refuse "limits of --surface ground" forest.lf --surface plane:40 --far 20
for o in "--focus 3" "--focus=3" "-f 3" -f3 "-l tree" "-a 2"; do
  refuse "error: render: ${o:0:2}[a-z]* has no effect on a light field with a pose" forest.lf --surface plane:40 $o
done
"$sst" render forest.lf -q -m refocus -t2 --surface plane:40 --view=C4 -o=-f.png >out 2>err || fail "values: $(cat err)"
