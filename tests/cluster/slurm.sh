#!/usr/bin/env bash
# A job array on a real Slurm: the script of docs/use/cluster.md, one of whose tasks is killed, makes what one process makes.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
set -u
. "$(dirname "$0")/../lib.sh"
export SST_MODELS=$root/models
PATH=$(dirname "$sst"):$PATH
trap '"$root/scripts/cluster/slurm.sh" stop slurm; rm -rf "$tmp"' EXIT
"$root/scripts/cluster/slurm.sh" start slurm 4 || exit 1
export SLURM_CONF=$tmp/slurm/slurm.conf

mkdir captures
for i in $(seq 8); do
  "$sst" scene pedestrian -o "captures/p$i" --size 160x120 --grid 3x3 --seed "$i" >/dev/null || fail "scene"
done
"$sst" batch captures -o alone --threads 1 >/dev/null 2>err || fail "alone: $(cat err)"

sed -n '/<!-- tests\/cluster\/slurm.sh/,/^```$/p' "$root/docs/use/cluster.md" | sed '1,2d;$d' >job.sh
sed -i 's/ --threads/ --lease 3 --threads/' job.sh
job=$(sbatch --parsable --export=ALL job.sh) || { fail "sbatch"; exit 1; }
# One of the tasks is killed as soon as it has a piece.
for _ in $(seq 300); do compgen -G 'results/.state/*/held.*' >/dev/null && break; sleep 0.1; done
scancel --signal=KILL --full "${job}_2"
for _ in $(seq 3000); do [ -z "$(squeue -h -j "$job" 2>/dev/null)" ] && break; sleep 0.2; done
[ -z "$(squeue -h -j "$job" 2>/dev/null)" ] || fail "the job does not end: $(squeue)"
"$sst" batch captures -o results --status >status || fail "status"
tail -n 1 status | grep -q '^8 pieces: 8 done, 0 running, 0 failed, 0 waiting' || fail "status: $(cat status sst-*.log)"
for i in $(seq 8); do
  for f in lightfield/disparity lightfield/labels lightfield/lightfield.json clear.png see-through.png sweep.mp4; do
    diff -rq "alone/p$i/$f" "results/p$i/$f" || fail "p$i/$f differs"
  done
done
echo "workers of the pieces:"
sed 's/.* on //' status | head -n -1 | sort | uniq -c
exit $failed
