#!/usr/bin/env bash
# `sst import` and `sst export` on real light fields, and on input that must be refused.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
set -u
. "$(dirname "$0")/../lib.sh"
data=$(cd "$root/../shared/data" 2>/dev/null && pwd) || skip "../shared/data is absent"

# same FILE FILE: the same bytes
same() { cmp -s "$1" "$2" || fail "$1 is not $2"; }

# is TEXT: the last line that was printed
is() { [ "$line" = "$1" ] || fail "printed: $line"; }

# --- known answers ---
offsets="grid 6x6, offsets x -2.000..3.000, y -2.000..3.000"
line=$("$sst" import stanford "$data/lf-stanford-chess-6x6" -o chess --threads 2) || fail "chess"
is "chess: 36 views of 1024x640, grid 6x6, offsets x -1.975..3.079, y -1.963..2.794, disparity range unknown"
# Row 15 of the gantry has the smallest y and is the top row; columns run to the right.
same chess/views/00_00.png "$data"/lf-stanford-chess-6x6/out_15_00_*
same chess/views/05_03.png "$data"/lf-stanford-chess-6x6/out_00_09_*
line=$("$sst" import stanford "$data/lf-shop-6x6" -o shop --range-min -1 --range-max 31) || fail "shop"
is "shop: 36 views of 960x640, $offsets, disparity -1.000..31.000 px per spacing"
same shop/views/00_00.jpg "$data"/lf-shop-6x6/*_25_25_-369*
same shop/views/00_05.jpg "$data"/lf-shop-6x6/*_25_00_-369*
line=$("$sst" import hci "$data/lf-hci-backgammon-6x6" -o hci) || fail "hci"
is "hci: 36 views of 512x512, $offsets, disparity -1.553..0.529 px per spacing"
same hci/views/02_02.png "$data/lf-hci-backgammon-6x6/input_Cam030.png"
tail -c 1048576 "$data/lf-hci-backgammon-6x6/gt_disp_lowres.pfm" >truth.raw # 512x512 floats; headers differ in form
tail -c 1048576 hci/truth/03_03.pfm | cmp -s - truth.raw || fail "truth of view 40 is not at 03_03"

# --- any number of threads, and there and back ---
"$sst" import stanford "$data/lf-stanford-chess-6x6" -o one --threads 1 >/dev/null || fail "one thread"
diff -r chess one >/dev/null || fail "threads change the result"
"$sst" export stanford chess -o back >/dev/null || fail "export stanford"
"$sst" import stanford back -o again >/dev/null || fail "import of the export"
diff -r chess/views again/views >/dev/null || fail "views changed on the way"
"$sst" export hci shop -o back-hci 2>/dev/null >&2 || fail "export hci"
"$sst" import hci back-hci -o again-hci >/dev/null || fail "import of the hci export"
[ -e back-hci/parameters.cfg ] && [ -e back-hci/input_Cam035.png ] || fail "hci export is incomplete"
"$sst" import stanford "$data/lf-stanford-chess-6x6" -o chess --force >/dev/null || fail "--force"

# --- views that are one picture ---
mkdir still
for r in 0 1 2; do for c in 0 1 2; do cp "$data"/lf-hci-backgammon-6x6/input_Cam030.png still/0${r}_0$c.png; done; done
"$sst" import folder still --grid 3x3 -o still.lf >out 2>err || fail "import of one picture: $(cat err)"
grep -q "warning: still.lf: the views show no parallax" err || fail "one picture nine times: $(cat err)"
"$sst" process still.lf --no-labels --preset preview --json >out 2>err || fail "process of one picture: $(cat err)"
grep -q "no parallax" err && grep -q '"confirmed_percent": 0.0' out && grep -q '"parallax": false' out ||
  fail "one picture is confirmed: $(cat out err)"

# --- views without texture agree on whatever disparity they get ---
mkdir black
printf 'P6 64 48 255\n' >black/b.ppm
head -c $((64 * 48 * 3)) /dev/zero >>black/b.ppm
/usr/bin/python3 -c 'import cv2; [cv2.imwrite(f"black/00_0{k}.png", cv2.imread("black/b.ppm")) for k in range(2)]'
rm black/b.ppm
"$sst" import folder black --grid 1x2 -o black.lf >out 2>&1 || fail "import of black pictures: $(cat out)"
"$sst" process black.lf --no-labels --range-min 0 --range-max 16 --json >out 2>err || fail "process of black pictures: $(cat err)"
grep -q "2 of 2 views, the first one of row 0, column 0, have no texture" err && grep -q '"confirmed_percent": 0.0' out || fail "black views are confirmed: $(cat out err)"

# --- 16 bits: narrow samples are scaled, as 8 bits of the same levels come out; wide ones are rounded with a warning ---
mkdir deep flat wide fine
/usr/bin/python3 - <<'P' || fail "python3 with OpenCV"
import cv2, numpy
y, x = numpy.mgrid[0:60, 0:80]
for k in range(9):
    value = 127.5 + 67.5 * numpy.sin((x + 3 * (k % 3)) / 3) + 60 * numpy.sin((y + 3 * (k // 3)) / 4)
    fine = numpy.round(200 * value).astype(numpy.uint16)
    value = numpy.round(value).astype(numpy.uint16)
    if k == 4:
        value[0, :2] = 0, 255
    for name, picture in (("deep", 30000 + value), ("flat", value.astype(numpy.uint8)), ("wide", 200 * value), ("fine", fine)):
        cv2.imwrite(f"{name}/{k // 3:02d}_{k % 3:02d}.png", picture)
P
for l in deep flat wide; do "$sst" import folder $l --grid 3x3 -o $l.lf --range-min -1 --range-max 6 >out 2>err-$l || fail "16 bits: $(cat err-$l)"; done
grep -q "16 bits become 8" err-deep && fail "narrow samples are warned of: $(cat err-deep)"
grep -q "warning: wide.lf: 16 bits become 8, so 2[0-9]* levels become 1[0-9]*: samples 0 to 65535" err-wide ||
  fail "16 bits are cut in silence: $(cat err-wide)"
for l in deep flat; do "$sst" process $l.lf --no-labels --preset preview --json >out-$l 2>err || fail "process of $l: $(cat err)"; done
/usr/bin/python3 -c 'import json; a = json.load(open("out-deep"))["levels"]; assert a["before"] == a["after"] > 200 and a["samples"] == [30000, 30255], a' || fail "levels: $(cat out-deep)"
cmp deep.lf/disparity/01_01.png flat.lf/disparity/01_01.png || fail "16 bits give other disparities than the same 8 bits"
"$sst" render deep.lf --focus 3 --samples -o deep.png && "$sst" render flat.lf --focus 3 -o flat.png || fail "rendering of 16 bits"
/usr/bin/python3 -c '
import cv2, numpy
deep, flat = cv2.imread("deep.png", -1), cv2.imread("flat.png", -1)
assert deep.dtype == numpy.uint16 and (deep.astype(int) - 30000 == flat).all()' || fail "16-bit PNG out"
"$sst" import folder fine --grid 3x3 -o fine.lf --range-min -1 --range-max 6 >out 2>err || fail "16 bits: $(cat err)"
"$sst" process fine.lf --no-labels --preset preview -q >out 2>err || fail "process of fine: $(cat err)"
"$sst" render fine.lf --method refocus --focus 3 --f-stop 1000 --samples -o own.png 2>err || fail "16 bits of one view: $(cat err)"
"$sst" render fine.lf --method refocus --focus 3 --samples -o mean.png 2>>err || fail "16 bits of all views: $(cat err)"
"$sst" render fine.lf --method refocus --focus 3 -o level.png 2>>err || fail "8 bits of all views: $(cat err)"
"$sst" render fine.lf --focus 3 --samples -o see.png 2>>err || fail "16 bits, see-through: $(cat err)"
"$sst" render fine.lf --focus 3 -o see8.png 2>>err || fail "8 bits, see-through: $(cat err)"
[ -s err ] && fail "16 bits are warned of: $(cat err)"
/usr/bin/python3 -c '
import cv2, numpy
read = lambda name: cv2.imread(name, -1).astype(float)
own = read("own.png")
assert (own == read("fine/01_01.png")[..., None] if own.ndim > read("fine/01_01.png").ndim else own == read("fine/01_01.png")).all(), "own view"
mean, views = read("mean.png")[..., 1], {(r, c): cv2.imread(f"fine/{r:02d}_{c:02d}.png", 0 | cv2.IMREAD_ANYDEPTH).astype(float) for r in range(3) for c in range(3)}
h, w = mean.shape
want = sum(v[8 + 3 * (1 - r):h - 8 + 3 * (1 - r), 8 + 3 * (1 - c):w - 8 + 3 * (1 - c)] for (r, c), v in views.items()) / 9
assert abs(mean[8:-8, 8:-8] - want).max() <= 0.5 + 1e-6, abs(mean[8:-8, 8:-8] - want).max()
level, see = read("level.png")[..., 1], read("see.png")[..., 1]
assert abs(mean / 257 - level).max() < 1.5 and len(numpy.unique(mean)) > 4 * len(numpy.unique(level)), (abs(mean / 257 - level).max(), len(numpy.unique(mean)), len(numpy.unique(level)))
assert abs(see / 257 - read("see8.png")[..., 1]).max() <= 1.5 and len(numpy.unique(see)) > 4 * len(numpy.unique(read("see8.png")[..., 1]))' || fail "16-bit pictures of all levels"
cp -r fine.lf off.lf && /usr/bin/python3 -c '
import json
lf = json.load(open("off.lf/lightfield.json"))
lf["correction"] = [dict(row=0, col=0, right_px=0.0, down_px=1.0, roll_deg=0.0, scale=0.0, gain=[1.0, 1.0, 1.0])]
json.dump(lf, open("off.lf/lightfield.json", "w"))'
"$sst" render off.lf --focus 3 --samples -o off.png 2>err || fail "16 bits, corrected: $(cat err)"
grep -q "warning: off.png has 256 levels between samples 0 and 65535: its views are corrected" err || fail "levels are lost in silence: $(cat err)"
"$sst" stereo wide/00_00.png wide/00_01.png -m 9 -o deep.pfm 2>err || fail "stereo of 16 bits: $(cat err)"
grep -q "wide/00_00.png: 16 bits become 8" err || fail "stereo cuts 16 bits in silence: $(cat err)"

# --- a view that was altered after the import ---
cp chess/views/00_00.png altered.png && cp chess/views/00_01.png chess/views/00_00.png
want 3 "chess/views/00_00.png has changed" process chess --no-labels
want 3 "chess/views/00_00.png has changed" render chess --method refocus --focus 1 -o bad.png
want 3 "chess/views/00_00.png has changed" sweep chess --method refocus --from 1 --to 2 -o bad
want 3 "chess/views/00_00.png has changed" calibrate --check chess
"$sst" render chess --method refocus --focus 1 --no-verify -o altered-out.png || fail "--no-verify"
cp altered.png chess/views/00_00.png

# --- refusals ---
src=src
fresh() { rm -rf $src; cp -r --no-preserve=mode "$data/lf-shop-6x6" $src; }
first="$src/Original Camera_00_00_400.000000_400.000000_30_36.jpg"
fresh
want 3 "not a folder" import stanford none -o bad
want 2 "unknown import format" import tiff $src -o bad
want 2 "output\|-o LF" import stanford $src
want 2 "needs the grid" import folder $src -o bad
want 2 "belong to the format folder" import stanford $src --labels $src -o bad
want 2 "range" import stanford $src --range-min 5 --range-max 3 -o bad
want 4 "exists already" import stanford $src -o chess
want 4 "cannot create" import stanford $src -o none/bad
want 3 "another format" import hci $src -o bad
want 2 "such as 1,1,6x6" import stanford $src --part 1,1,6 -o bad
want 2 "no 6x6 views from row 1, column 0" import stanford $src --part 1,0,6x6 -o bad
want 3 "another format" import folder $src --grid 6x6 -o bad
want 3 "6x6 views, not 5x6" import stanford $src --grid 5x6 -o bad
rm "$first"
want 3 "lacks 1 of 36 views: \*_00_00_\*" import stanford $src -o bad
"$sst" import stanford $src --grid 6x6 -o hole 2>hole.err >/dev/null || fail "a hole in a known grid"
grep -q "warning.*lacks 1 of 36" hole.err || fail "no warning of the hole"
fresh
cp "$first" "$src/copy_00_00_400.000000_400.000000_.jpg"
want 3 "remove one of them" import stanford $src -o bad
fresh
head -c 20000 "$data/lf-shop-6x6/${first#*/}" >"$first"
want 3 "truncated JPEG" import stanford $src -o bad
echo "no image" >"$first"
want 3 "no PNG, JPEG or TIFF" import stanford $src -o bad
: >"$first"
want 3 "is empty" import stanford $src -o bad
cp "$data/lf-hci-backgammon-6x6/input_Cam010.png" "$first"
want 3 "512x512 pixels, but" import stanford $src -o bad
rm -rf $src
mkdir $src $src/maps
cp "$data/lf-hci-backgammon-6x6/input_Cam010.png" $src/00_00.png
cp "$data/lf-hci-backgammon-6x6/input_Cam011.png" $src/00_01.png
want 3 "outside the grid of 1x1" import folder $src --grid 1x1 -o bad
want 3 "maps/00_00.pfm" import folder $src --grid 1x2 --disparity $src/maps -o bad
printf 'Pf\n100000 1\n-1\n' >$src/maps/00_00.pfm
want 3 "100000x1" import folder $src --grid 1x2 --disparity $src/maps -o bad
printf 'Pf\n1 1\n-1\n\x00\x00\xc0\x7f' >$src/maps/00_00.pfm
want 3 "NaN at column 0, row 0" import folder $src --grid 1x2 --disparity $src/maps -o bad
printf 'Pf\n1 1\n-1\n\x00\x00\x80\x3f' >$src/maps/00_00.pfm
cp $src/maps/00_00.pfm $src/maps/00_01.pfm
want 3 "1x1 pixels, the views have 512x512" import folder $src --grid 1x2 --disparity $src/maps -o bad
want 3 "not a light field" export hci $src -o bad
want 3 "no such folder" export hci none -o bad
want 2 "unknown export format" export tiff chess -o bad

# --- the disk is full, or the user interrupts ---
(
  ulimit -f 64
  want 4 "File too large" import hci "$data/lf-hci-backgammon-6x6" -o bad --threads 1
  exit $failed
) || failed=1
timeout --foreground -s INT 0.3 "$sst" import stanford "$data/lf-stanford-chess-6x6" -o int >/dev/null 2>&1
[ -z "$(find . -name '*.tmp-*')" ] || fail "an interrupted import left a temporary folder"

[ "$failed" -eq 0 ] && echo "import and export as documented"
exit "$failed"
