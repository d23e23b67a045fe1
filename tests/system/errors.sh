#!/usr/bin/env bash
# Refusals of commands: the right exit code, one sentence that names the fault, no file left or lost.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
set -u
. "$(dirname "$0")/../lib.sh"

fresh() { rm -rf lf; cp -r good lf; }
state() { find "$1" -type f -exec md5sum {} + | sort; }

"$sst" scene pedestrian -o good --size 96x72 --grid 3x3 -q || exit 1
"$sst" process good --labels good/truth --preset preview -q >/dev/null || exit 1
"$sst" scene bush -o small --size 60x40 --grid 3x3 -q || exit 1
left=good/views/01_01.png right=good/views/01_02.png
printf 'no image at all\n' >text.txt

# --- a scene that could not be processed is not made ---
want 2 "disparity range [0-9]*..[0-9]* px is invalid: it must be ascending and span at most 511 px" \
  scene pedestrian --size 20000x20 --grid 2x2 -o bad
want 2 "disparity range [0-9]*..[0-9]* px is invalid: it must be ascending and span at most 511 px" \
  scene pedestrian --size 10000x20 --grid 2x2 -o bad
want 2 "disparity range 0..600 px is invalid: it must be ascending and span at most 511 px" \
  process good --range-min 0 --range-max 600

# --- usage: exit 2 ---
want 2 "unknown command" frobnicate
want 2 "unknown command" Scene
for command in scene import export process render sweep stereo segment eval; do
  want 2 "unknown option --frobnicate" $command --frobnicate
  want 2 "unknown option -Z" $command -Z
  want 2 "argument is missing" $command
  case $command in segment | process | import) ;; *) want 2 "too many" $command a b c d;; esac
done
want 2 "unknown command .improt.; did you mean .import.?" improt
want 2 "unknown import format .stanfrod.; did you mean .stanford.? use stanford, hci, folder, recording, poses or pictures" import stanfrod . -o bad
want 2 "did you mean .colmap.?" export colmpa good -o bad
want 2 "unknown option --ouput; did you mean --output?" render good --ouput bad.png
want 2 "unknown option --focsu=3; did you mean --focus?" render good --focsu=3
want 2 "did you mean .convert.?" calibration covert calib.yaml
want 2 "did you mean .array.?" capture arry
want 2 "did you mean .start.?" record strat
want 2 "unknown --preset .acurate.; did you mean .accurate.? choose from preview balanced accurate" process good --preset acurate
want 2 "unknown --scene .hegde.; did you mean .hedge.?" demo --scene hegde -o bad
want 2 "there is no scene forest" demo --scene forest -o bad

for command in scene render; do
  "$sst" help $command | cmp -s - <("$sst" $command --help) || fail "help $command"
done
"$sst" scene 2>err && fail "a scene without a name"
grep -q '\[--kind NAME\].* [.][.][.]; see' err || fail "a usage of several lines: $(cat err)"
mkdir -p bitmaps cut
touch bitmaps/00_00.bmp bitmaps/00_01.BMP
want 3 "only 00_00.bmp, 00_01.BMP; convert images to PNG, JPEG or TIFF" import folder bitmaps --grid 1x2 -o bad
"$sst" render good --method refocus --focus 1 -o cut.jpg -q >out || fail "a JPEG"
for i in 0 1; do head -c -2 cut.jpg >cut/00_0$i.jpg; done
"$sst" import folder cut --grid 1x2 -o cut.lf 2>err >out || fail "pictures without an end marker: $(cat err)"
[ "$(grep -c 'lacks the end marker' err)" = 1 ] && ! grep -q tmp- err || fail "said of end markers: $(cat err)"

# --- an input is no output, and one output is not two ---
fresh
cp "$left" photo.png
cp "$right" other.png
state . >before
for output in "segment photo.png -o photo.png" "segment photo.png -o lf/../photo.png" "segment photo.png other.png -o ." \
  "segment lf/views -o lf/views" "segment photo.png -o bad.png --prob photo.png" "stereo photo.png other.png --max-disparity 8 -o other.png" \
  "render lf --method refocus --focus 1 -o lf/views/01_01.png" "render lf -o q.png --valid lf/disparity/00_00.png"; do
  # shellcheck disable=SC2086
  want 2 "would be replaced, which is read from; choose another output" $output
done
want 2 "--output and --valid are both bad.png" render lf --method refocus --focus 1 -o bad.png --valid bad.png
want 2 "--output and --valid are both ../.*bad.png" render lf --method refocus --focus 1 -o bad.png --valid "../$(basename "$PWD")/./bad.png"
want 2 "bad.png would be written twice" segment lf/views/00_00.png -o bad.png --entropy ./bad.png
state . | grep -v ' ./\(out\|err\|before\)$' | diff - <(grep -v ' ./\(out\|err\|before\)$' before) || fail "an input was changed"
"$sst" render lf --method refocus --focus 1 -o lf/seen.png -q >out || fail "a picture in a light field"
"$sst" render lf --method refocus --focus 1 -o lf/seen.png -q >out || fail "a picture in a light field again"

# --- an output that cannot be made is refused before anything else is done or read ---
for command in "render good" "sweep good" "stereo absent absent --max-disparity 8" "segment absent.png" "calibrate absent" \
  "calibration convert absent" "import hci absent" "export colmap absent" "scene bush" "rectify absent" "board absent" "batch absent" \
  "capture array -n 1" "capture rig --grid 1x2" "snapshot" "record download absent" "identify" "demo"; do
  # shellcheck disable=SC2086
  want 4 "cannot create absent/.*No such file" $command -o absent/out.png
done
want 4 "cannot create absent/why" render good -o bad.png --explain absent/why
want 4 "cannot create absent/seen.png" render good -o bad.png --valid absent/seen.png
want 4 "good exists already" render good -o bad.png --explain good
want 4 "cannot create absent/report" calibrate absent -o bad.yaml --report absent/report.html
mkdir -p folder.png
want 4 "folder.png is a folder; name a file to write" render good -o folder.png
want 4 "good exists already" sweep good -o good
for name in bad.mp5 bad.mkv bad.WEBM bad.png bad.v2.gif; do
  want 2 "$name looks like a file.* $name/;" sweep good -o $name
done
for name in v1.2 v1.lf s.mkv/; do
  "$sst" sweep good --method refocus --from 1 --to 1 --steps 1 -o $name >/dev/null 2>err || fail "sweep -o $name: $(cat err)"
  [ -f $name/0000.png ] || fail "sweep -o $name is no folder"
done
want 2 "unknown scene" scene wood -o bad
want 2 "LF is missing" scene bush
mkfifo port
/usr/bin/python3 -c 'import socket, time; s = socket.create_server(("127.0.0.1", 0)); print(s.getsockname()[1], flush=True); time.sleep(60)' \
  >port 2>/dev/null &
listener=$!
read -r taken <port
want 3 "in use" demo --port "$taken" -o bad
kill $listener
for size in 0x0 100000x10 -1x10 10 10x 10x10x10 axb; do want 2 "size" scene bush -o bad --size $size; done
for grid in 0x1 1x257 17x16 x; do want 2 "grid\|views" scene bush -o bad --grid $grid; done
want 2 "whole number" scene bush -o bad --seed -1
want 2 "threads" scene bush -o bad --threads 0
fresh
want 2 "preset" process lf --preset fast
want 2 "cost" process lf --cost ncc
want 2 "skip" process lf --skip keyz
want 2 "must be given together" process lf --range-min 3
want 2 "must be given together" process lf --range-min 3 --range-max 3
want 2 "disparity range" process lf --no-labels --range-min 0 --range-max 600
want 2 "contradict" process lf --no-labels --model text.txt
want 2 "parameters" process lf --no-labels --p1 50 --p2 10
want 2 "parameters" process lf --no-labels --paths 5
want 2 "outside" process lf --threads 257
for n in 1e3 0x10 1.5 " 64" "" inf; do want 2 "not a whole number in decimal digits" process lf --memory "$n"; done
want 2 'memory 0 is outside 1..16777216;' process lf --memory 0
want 2 "not a number" render lf --focus 0x3 -o bad.png
for focus in 1000 -1000 -50; do want 2 "focus" render lf --focus $focus -o bad.png; done
for focus in nan x ""; do want 2 "not a number" render lf --focus "$focus" -o bad.png; done
for focus in inf 1e300; do want 2 "focus\|outside" render lf --focus $focus -o bad.png; done
want 2 "label" render lf --focus 3 --label Unicorn -o bad.png
want 2 "method" render lf --focus 3 --method magic -o bad.png
want 2 "sigma" render lf --focus 3 --sigma -1 -o bad.png
want 2 "c1" render lf --focus 3 --c1 2 -o bad.png
want 2 "unknown \`rays,magic\|unknown \`magic" render lf --focus 3 --skip rays,magic -o bad.png
want 2 "skip-error 5 is outside" render lf --focus 3 --skip rays --skip-error 5 -o bad.png
want 2 "no effect with --method clear" render lf --method clear --skip tiles -o bad.png
want 2 "contradict" sweep lf --skip rays --device gpu -o bad
want 2 "png" render lf --focus 3 -o bad.tiff
want 2 "steps" sweep lf --from 2 --to 5 --steps 0 -o bad
want 2 "focus" sweep lf --from 2 --to 500 --steps 2 -o bad
want 2 "together" sweep lf --from 2 --steps 2 -o bad
for n in 0 -3; do want 2 "disparity range" stereo $left $right -m $n -o bad.pfm; done
for n in nan x 1e9 inf; do want 2 "max-disparity" stereo $left $right -m $n -o bad.pfm; done
want 2 "disparity range" stereo $left $right -m 600 -o bad.pfm
want 2 "png holds" stereo $left $right -m 300 -o bad.png
want 2 "png holds" stereo $left $right -m 30 --min-disparity -2 -o bad.png
want 2 "must end" stereo $left $right -m 30 -o bad.exr
want 2 "missing" stereo $left $right -o bad.pfm
want 2 "use f32 or int8" stereo $left $right -m 9 --precision f16 -o bad.pfm
want 2 "use f32 or int8" segment $left --precision f16 -o bad.png

# --- inputs that are missing or damaged: exit 3, and the light field stays as it is ---
for command in "process none" "render none --focus 3 -o bad.png" "sweep none --from 2 --to 3 -o bad" \
    "eval none --truth good/truth" "export hci none -o bad"; do
  want 3 "no such folder" $command
done
want 3 "not a folder\|no such" import folder none --grid 3x3 -o bad
want 3 "not a folder\|no lightfield.json" render text.txt --focus 3 -o bad.png
want 3 "no lightfield.json" process good/views
want 3 "No such file" stereo none.png $right -m 9 -o bad.pfm
want 3 "no PNG, JPEG or TIFF" stereo $left text.txt -m 9 -o bad.pfm
want 3 "regular file" stereo $left good -m 9 -o bad.pfm
want 3 "regular file" stereo $left /dev/null -m 9 -o bad.pfm
want 3 "differs in size" stereo $left small/views/01_01.png -m 9 -o bad.pfm
want 3 "text.txt" segment $left -o bad.png --model text.txt
want 3 "none.onnx" segment $left -o bad.png --model none.onnx
want 3 "text.txt" stereo $left $right -m 9 --cost mccnn --mccnn-model text.txt -o bad.pfm
[ ! -e "$root/models/pspnet-small.onnx" ] || want 3 "3 channels, not luma alone" \
  stereo $left $right -m 9 --cost mccnn --mccnn-model "$root/models/pspnet-small.onnx" -o bad.pfm
want 3 "outside the grid" import folder good/views --grid 2x2 -o bad

# damaged WORDS COMMAND...: change lf as the command does, then every reader refuses it and it stays as it is
damaged() {
  local words=$1 before
  shift
  fresh
  "$@" || fail "cannot prepare: $*"
  before=$(state lf)
  want 3 "$words" process lf --labels good/truth --threads 1
  want 3 "$words" process lf --no-labels --threads 1
  want 3 "$words" render lf --focus 4 --threads 1 -o bad.png
  want 3 "$words" sweep lf --from 3 --to 4 --steps 2 --threads 1 -o bad
  [ "$(state lf)" = "$before" ] || fail "$*: the light field changed"
}
replace_json() { sed -i "$1" lf/lightfield.json; }
damaged "lightfield.json:1" sh -c 'printf "{" >lf/lightfield.json'
damaged "lightfield.json" sh -c ': >lf/lightfield.json'
damaged "lightfield.json" sh -c 'printf "\0\0\0" >lf/lightfield.json'
damaged "not a JSON object" sh -c 'echo "[1]" >lf/lightfield.json'
damaged "lightfield.json" sh -c 'head -c 900 good/lightfield.json >lf/lightfield.json'
damaged "rows" replace_json 's/"rows": 3/"rows": 0/'
damaged "row" replace_json 's/"rows": 3/"rows": 2/'
damaged "width" replace_json 's/"width": 96/"width": 1e9/'
damaged "version" replace_json 's/"version": 1/"version": 99/'
damaged "pixels" replace_json 's/"width": 96/"width": 95/'
damaged "plain file name" replace_json 's#"file": "01_01.png"#"file": "../../text.txt"#'
damaged "01_02.png" rm lf/views/01_02.png
damaged "01_02.png" truncate -s 500 lf/views/01_02.png
damaged "01_02.png is empty" truncate -s 0 lf/views/01_02.png
damaged "01_02.png is no PNG, JPEG or TIFF" cp text.txt lf/views/01_02.png
damaged "60x40 pixels" cp small/views/01_01.png lf/views/01_02.png
damaged "01_02.png" sh -c 'rm lf/views/01_02.png && mkdir lf/views/01_02.png'
fresh
rm -r lf/disparity
want 3 "sst process" render lf --focus 3 -o bad.png
fresh
truncate -s 200 lf/disparity/00_00.png
want 3 "disparity/00_00.png" render lf --focus 4 -o bad.png
fresh
cp small/truth/00_00.png lf/labels/00_00.png
want 3 "labels/00_00.png" render lf --focus 4 -o bad.png

# maps that are given
mkdir maps
given() { fresh; rm -f maps/*; cp good/truth/*.pfm good/truth/0?_0?.png maps; }
given
printf 'Pf\n96 72\n-1\n' >maps/01_01.pfm
head -c 27648 /dev/zero | tr '\0' '\377' >>maps/01_01.pfm
want 3 "NaN" process lf --disparity maps
want 3 "NaN" import folder lf/views --grid 3x3 --disparity maps -o bad
given
cp small/truth/00_00.pfm maps/01_01.pfm
want 3 "60x40" process lf --disparity maps
given
truncate -s 1000 maps/01_01.pfm
want 3 "truncated" process lf --disparity maps
given
rm maps/02_02.png
want 3 "02_02.png" process lf --labels maps
cp text.txt maps/02_02.png
want 3 "02_02.png" process lf --labels maps
given
want 3 "none" process lf --labels none
[ "$(state lf)" = "$(state good | sed 's# good/# lf/#')" ] || fail "a refused map changed the light field"
want 3 "text.txt" process small --model text.txt
want 3 "none.onnx" process small --no-labels --preset accurate --mccnn-model none.onnx

# --- models that are nowhere: exit 5 ---
if [ ! -e /usr/local/share/sst/models ]; then
  mkdir bin
  cp "$sst" bin/sst
  saved=$sst sst=$PWD/bin/sst
  export SST_MODELS=/nonexistent
  want 5 "pspnet-small.onnx.*SST_MODELS" process small
  want 5 "mccnn-fast.onnx" process small --no-labels --preset accurate
  want 5 "mccnn-fast.onnx" stereo $left $right -m 9 --cost both -o bad.pfm
  "$sst" stereo $left $right -m 9 --preset accurate -o good.pfm || fail "a pair asks for a network"
  want 5 "SST_MODELS" segment $left -o bad.png
  unset SST_MODELS
  sst=$saved
fi
[ "$(ls small)" = "$(printf 'lightfield.json\ntruth\nviews')" ] || fail "a process that failed left something in small"

# A light field of one view: nothing that options would mend.
mkdir single && cp lf/views/00_00.png single/00_00.png && "$sst" import folder single --grid 1x1 -o single.lf -q >/dev/null || fail "import of one view"
want 3 "two neighbouring views; this light field has 1 in all" process single.lf --no-labels
want 3 "no disparity map of view 00_00" render single.lf -o bad.png

# --- outputs that cannot be: exit 4 ---
want 4 "none" scene bush --size 20x20 -o none/bad
want 4 "none" render good --focus 4 -o none/bad.png
want 4 "none" stereo $left $right -m 9 -o none/bad.pfm
want 4 "exists already" scene bush --size 20x20 -o good
want 4 "exists already" sweep good --from 3 --to 4 --steps 1 -o small
mkdir folder.png folder.pfm
want 4 "folder" render good --focus 4 -o folder.png
want 4 "folder" stereo $left $right -m 9 -o folder.pfm
# A device is not replaced by a picture, nor a folder of another kind by a light field, --force or not.
ln -s /dev/full full.png
want 4 "not a regular file" render good --focus 4 -o full.png
[ -c full.png ] && [ -c /dev/full ] || fail "a device was replaced"
# Reports that do not arrive; a reader that has read enough is no fault.
for report in "version" "models" "render --help" "render good --focus 4 -o pic.png --json"; do
  # shellcheck disable=SC2086
  "$sst" $report >/dev/full 2>err
  [ $? = 4 ] && [ "$(grep -c "cannot write to standard output" err)" = 1 ] || fail "$report on a full disk: $(cat err)"
done
for program in sstd sst-sim sst-mqtt; do
  [ ! -x "${sst%/*}/$program" ] && continue
  "${sst%/*}/$program" --help >/dev/full 2>err
  [ $? = 4 ] && [ "$(grep -c "cannot write to standard output" err)" = 1 ] || fail "help of $program on a full disk: $(cat err)"
done
"$sst" --help 2>err | : && [ ! -s err ] || fail "help without a reader: $(cat err)"
mkdir mine && echo precious >mine/file
want 4 "does not replace" scene bush --size 20x20 -o mine --force
want 4 "does not replace" sweep good --from 3 --to 4 --steps 1 -o mine --force
want 4 "does not replace" render good --focus 4 -o pic.png --explain mine --force
want 4 "does not replace" export hci good -o mine --force
want 4 "does not replace" scene bush --size 20x20 -o text.txt --force
want 2 "would be replaced" sweep good --from 3 --to 4 --steps 1 -o good --force
[ "$(cat mine/file)" = precious ] || fail "--force took a folder that is not its own"
rm -f pic.png
"$sst" scene bush -o slow --size 500x375 --grid 3x3 -q || exit 1
before=$(state slow)
(
  ulimit -f 8
  want 4 "File too large" scene bush --size 200x150 --grid 2x2 -o bad --threads 1
  want 4 "File too large" render good --focus 4 -o bad.png --threads 1
  want 4 "File too large" stereo $left $right -m 9 -o bad.pfm
  want 4 "File too large" process slow --no-labels --preset preview --threads 1
  exit $failed
) || failed=1
[ "$(state slow)" = "$before" ] || fail "a process that could not write changed the light field"
if [ "$(id -u)" -ne 0 ]; then
  mkdir locked && chmod a-w locked
  want 4 "Permission denied" scene bush --size 20x20 -o locked/bad
  fresh && chmod a-w lf && want 4 "Permission denied" process lf --no-labels --preset preview; chmod u+w lf
fi

# --- a file name cannot break the line, nor write to the terminal ---
want 3 "no such" render "$(printf 'a\nb\033[31m')" --focus 1 -o bad.png

# --- interrupted: 130, the light field as it was, no temporary folders ---
for delay in 0.05 0.2 0.5 0.9; do
  # In the foreground: else it sends SIGCONT, too, and a sanitizer that looks for leaks at the end hangs by that.
  timeout --preserve-status --foreground -s INT -k 60 $delay "$sst" process slow --no-labels --preset balanced --threads 2 >/dev/null 2>err
  rc=$?
  [ $rc -eq 0 ] && break # it ended before
  [ $rc -eq 130 ] || fail "interrupted after $delay s: exit $rc, not 130 within a minute"
  [ "$(state slow)" = "$before" ] || fail "interrupted after $delay s: the light field changed"
  [ -z "$(find . -name '*.tmp-*')" ] || fail "interrupted after $delay s: left $(find . -name '*.tmp-*')"
  [ "$(wc -l <err)" -eq 0 ] || fail "interrupted after $delay s: said $(cat err)"
done
env --default-signal=INT "$sst" process slow --no-labels >/dev/null 2>err & # which the shell has it ignore
pid=$!
sleep 0.2
kill -INT $pid 2>/dev/null
ended $pid "an interrupted process"
rc=$?
[ $rc -eq 130 ] || [ $rc -eq 0 ] || fail "interrupted: exit $rc, not 130"

# A terminal that is closed, Ctrl-\; nohup goes on.
hangs_up() { # SIGNAL COMMAND: as soon as its folder is begun
  local sig=$1 pid
  shift
  "$@" scene pedestrian -o hung.lf --size 160x120 --threads 1 -q >/dev/null 2>err &
  pid=$!
  for _ in $(seq 6000); do [ -n "$(find . -maxdepth 1 -name 'hung.lf*')" ] && break; sleep 0.01; done
  kill -"$sig" $pid 2>/dev/null
  ended $pid "a command that gets SIG$sig"
}
ulimit -S -c 0
for end in HUP:129 QUIT:131; do
  hangs_up ${end%:*} env --default-signal=${end%:*} "$sst"
  rc=$?
  [ $rc -eq ${end#*:} ] || [ $rc -eq 0 ] || fail "SIG$end: exit $rc"
  [ -z "$(find . -name '*.tmp-*')" ] || fail "SIG${end%:*}: left $(find . -name '*.tmp-*')"
  rm -rf hung.lf
done
hangs_up HUP env --ignore-signal=HUP "$sst" && [ -d hung.lf ] || fail "nohup: ended with $?, $(cat err)"

[ "$failed" -eq 0 ] && echo "faults are named, nothing is lost"
exit "$failed"
