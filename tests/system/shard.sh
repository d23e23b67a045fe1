#!/usr/bin/env bash
# Workers that share light fields: one is killed, another takes its work over, and the bytes are those of one process.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
set -u
. "$(dirname "$0")/../lib.sh"
options="--preset preview --no-labels --threads 1"
mkdir alone
for i in 1 2 3 4 5 6; do
  "$sst" scene bush -o "alone/b$i" --size 96x72 --grid 2x3 --seed "$i" >/dev/null || fail "scene"
done
cp -r alone shared
# shellcheck disable=SC2086
"$sst" process alone/* $options >lines 2>err || fail "alone: $(cat err)"
[ "$(grep -c '^alone/b[1-6]: 2x3 views of 96x72: ' lines)" = 6 ] || fail "printed: $(cat lines)"

# --- four workers; the second is killed while it holds a light field ---
for i in 1 2 3 4; do
  # shellcheck disable=SC2086
  "$sst" process shared/* $options --shard "$i/4" --lease 2 >"w$i" 2>&1 &
  pid[$i]=$!
done
for _ in $(seq 200); do compgen -G "shared/*/.process/held.*.${pid[2]}.*" >/dev/null && break; sleep 0.01; done
kill -9 "${pid[2]}"
for i in 1 3 4; do wait "${pid[$i]}" || fail "worker $i: $(cat "w$i")"; done
"$sst" process shared/* --status >status || fail "status"
tail -n 1 status | grep -qx '6 pieces: 6 done, 0 running, 0 failed, 0 waiting' || fail "status: $(cat status)"
for i in 1 2 3 4 5 6; do diff -rq -x .process "alone/b$i" "shared/b$i" || fail "b$i differs"; done

# --- the views of one light field, by two workers; a third comes when it is done ---
"$sst" scene pedestrian -o views --size 128x96 --grid 3x3 >/dev/null || fail "scene"
cp -r views whole
"$sst" process whole --no-labels --threads 1 >/dev/null 2>err || fail "whole: $(cat err)"
for i in 1 2; do "$sst" process views --no-labels --threads 1 --shard $i/2 --split-views >"v$i" 2>&1 & pid[$i]=$!; done
for i in 1 2; do wait "${pid[$i]}" || fail "worker $i of the views: $(cat "v$i")"; done
"$sst" process views --no-labels --shard 2/3 --split-views >v3 2>&1 || fail "third: $(cat v3)"
[ "$(cat v1 v2 v3 | grep -c 'views of')" = 1 ] || fail "not saved once: $(cat v1 v2 v3)"
diff -rq -x .process views whole || fail "views that were shared differ"
[ ! -e views/.process-views ] || fail "what workers exchanged is left"
want 2 "belongs to --shard" process views --split-views

# --- again: nothing to do; with other options all; failed ones are named, and tried again on request ---
# shellcheck disable=SC2086
again=$("$sst" process shared/* $options --shard 1/1) || fail "again"
[ -z "$again" ] || fail "done again: $again"
echo "no picture" >shared/b3/views/00_01.png
"$sst" process shared/* --preset preview --no-labels --threads 2 --paths 8 --shard 1/1 >lines 2>err
[ $? -eq 3 ] || fail "a damaged view: $(cat err)"
[ "$(wc -l <lines)" -eq 10 ] || fail "others were not done: $(cat lines)" # two lines each
"$sst" process shared/* --status --json >status.json
is=$(python3 -c "
import json
o = json.load(open('status.json'))
p = o['pieces'][2]
print(o['done'], o['failed'], o['waiting'], p['state'], '00_01.png' in p['error'])")
[ "$is" = "5 1 0 failed True" ] || fail "status: $is, $(cat status.json)"
cp alone/b3/views/00_01.png shared/b3/views/
"$sst" process shared/* --preset preview --no-labels --paths 8 --shard 1/1 >/dev/null 2>err && fail "failed ones are forgotten"
"$sst" process shared/* --preset preview --no-labels --paths 8 --shard 1/1 --retry >/dev/null 2>err || fail "retry: $(cat err)"

# --- as schedulers number their processes ---
SLURM_ARRAY_TASK_ID=7 SLURM_ARRAY_TASK_COUNT=2 SLURM_ARRAY_TASK_MIN=5 SLURM_ARRAY_TASK_STEP=2 \
  "$sst" process shared/b1 --preset preview --no-labels --shard auto >/dev/null || fail "as of an array"
OMPI_COMM_WORLD_RANK=0 OMPI_COMM_WORLD_SIZE=4 "$sst" process shared/b1 --preset preview --no-labels --shard auto || fail "mpirun"
want 2 "neither Slurm nor mpirun" process shared/b1 --shard auto
for s in 0/2 3/2 1 1/2/3 a/b -1/2; do want 2 "neither I/N" process shared/b1 --shard $s; done

# --- an interrupted worker leaves its light field free ---
rm -rf shared/b?/.process
# shellcheck disable=SC2086
"$sst" process shared/* $options --preset accurate --shard 1/1 >/dev/null 2>&1 &
worker=$!
for _ in $(seq 200); do compgen -G "shared/*/.process/held.*" >/dev/null && break; sleep 0.01; done
kill -TERM $worker
ended $worker "a worker after SIGTERM"
"$sst" process shared/* --status | grep -q '^running' && fail "a claim was left"
[ -z "$(find shared -name '*.tmp-*')" ] || fail "left $(find shared -name '*.tmp-*')"

# --- a campaign ---
mkdir captures
cp -r alone/b1 alone/b2 captures
rm -rf captures/*/disparity captures/*/confidence
echo secret >secret
ln -s "$PWD/secret" captures/b1/notes.txt # entries that are no files are not copied, and nothing waits for them
ln -s . captures/b1/again
mkfifo captures/b1/pipe
"$sst" batch captures -o results --preset preview --no-labels --steps 2 >line 2>err || fail "batch: $(cat err)"
[ "$(cat line)" = "results: 2 pieces; figures in results/figures.csv" ] || fail "printed: $(cat line)"
for f in notes.txt again pipe; do
  grep -q "captures/b1/$f is a link or no file" err || fail "no word of $f: $(cat err)"
  [ ! -e results/b1/lightfield/$f ] || fail "$f was copied"
done
for f in lightfield/disparity/00_00.pfm clear.png see-through.png process.json eval.json; do
  [ -s results/b1/$f ] || [ -s "results/b1/${f%pfm}png" ] || fail "no results/b1/$f: $(ls results/b1 results/b1/lightfield/disparity)"
done
diff -rq alone/b2/disparity results/b2/lightfield/disparity || fail "another disparity"
python3 - <<'PY' || fail "figures: $(cat results/figures.csv)"
import csv
rows = list(csv.DictReader(open("results/figures.csv")))
assert [r["name"] for r in rows] == ["b1", "b2"], rows
assert all(r["width"] == "96" and 0 < float(r["bad2_percent"]) < 60 and float(r["clear_occluded_db"]) > 10 for r in rows), rows
PY
echo "no picture" >captures/b2/views/00_00.png
rm -r results/b2 results/.state/b2
"$sst" batch captures -o results --preset preview --no-labels --steps 2 >line 2>err && fail "a damaged view is fine"
grep -q 'b2: `sst process`: .*00_00.png' err || fail "no cause: $(cat err)"
[ ! -e results/b2 ] && [ -s results/b1/clear.png ] || fail "half of b2, or no b1"
want 3 "neither light fields" batch results/logs -o bad --status
want 2 "-o DIR is missing" batch captures
want 4 "would have the same output" batch captures captures/b1 -o results
for n in logs figures.csv; do
  mkdir -p taken/$n; echo {} >taken/$n/lightfield.json
  want 4 "would have the output $n, which is the campaign's own" batch taken -o results
  rm -r taken
done
# nothing but an earlier output is replaced, and no source holds what copies it
cp -r captures kept
want 2 "captures/b1 would be replaced, and captures/b1 with it" batch captures -o captures
mkdir -p full/b1 && echo mine >full/b1/mine
want 4 "full/b1 holds no lightfield, .* remove it yourself" batch captures -o full
want 4 "captures/b1/out/ lies in captures/b1, which it would hold a copy of" batch captures/b1 -o captures/b1/out/
want 4 "captures/b1 lies in captures/b1" batch captures/b1 -o captures/b1
[ "$(cd captures && find . -type f -exec md5sum {} + | sort)" = "$(cd kept && find . -type f -exec md5sum {} + | sort)" ] ||
  fail "a source was changed"
want 3 "cannot read the folder absent" batch absent -o absent.out
[ ! -e absent.out ] || fail "a folder for nothing"
mkdir -p "deep/b1/$(printf 'd/%.0s' $(seq 900))" && cp captures/b1/lightfield.json deep/b1
"$sst" batch deep -o deeper >/dev/null 2>err
[ $? -lt 128 ] && grep -q "lies deeper than 16 folders" err || fail "deep folders: $(cat err)"
[ -s results/logs/b1.log ] && [ -f results/figures.csv ] || fail "logs or figures are gone"
mkdir -p odd/=1+1 oddly/=1+1; echo {} >odd/=1+1/lightfield.json
"$sst" batch odd -o oddly >/dev/null 2>&1 && fail "an empty light field is fine"
grep -q "^\"'=1+1\"," oddly/figures.csv || fail "a formula: $(cat oddly/figures.csv)"
exit $failed
