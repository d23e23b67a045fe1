#!/usr/bin/env bash
# slurm.sh start DIR NODES | stop DIR: a Slurm of this machine alone: one controller and nodes of one CPU each, with all its
# files in DIR. Afterwards SLURM_CONF=DIR/slurm.conf makes sbatch and squeue speak to it. Needs root, as slurmd does.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
set -eu
dir=$(realpath -m "$2")

stop() {
  for f in "$dir"/*.pid; do
    [ -f "$f" ] && kill "$(cat "$f")" 2>/dev/null || true
  done
  for _ in $(seq 100); do
    pgrep -F "$dir/slurmctld.pid" >/dev/null 2>&1 || return 0
    sleep 0.1
  done
}

if [ "$1" = stop ]; then
  stop
  exit 0
fi
nodes=$3
host=$(hostname -s)
# Ports that nobody has: of many tries the first ones that are free.
base=$(python3 - "$nodes" <<'PY'
import socket, sys
need = int(sys.argv[1]) + 1
for base in range(21000, 32000, 50):
    held = []
    try:
        for port in range(base, base + need):
            s = socket.socket()
            held.append(s)
            s.bind(("", port))
        print(base)
        break
    except OSError:
        pass
    finally:
        for s in held:
            s.close()
PY
)
mkdir -p "$dir/state"
cat >"$dir/slurm.conf" <<CONF
ClusterName=sst
SlurmctldHost=$host(127.0.0.1)
SlurmctldPort=$base
SlurmUser=root
SlurmdUser=root
AuthType=auth/none
CredType=cred/none
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SwitchType=switch/none
MpiDefault=none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU_Memory
SchedulerParameters=batch_sched_delay=0,sched_interval=1
StateSaveLocation=$dir/state
SlurmdSpoolDir=$dir/spool-%n
SlurmctldPidFile=$dir/slurmctld.pid
SlurmdPidFile=$dir/slurmd-%n.pid
SlurmctldLogFile=$dir/slurmctld.log
SlurmdLogFile=$dir/slurmd-%n.log
SlurmdParameters=config_overrides
ReturnToService=2
NodeName=n[1-$nodes] NodeHostname=$host NodeAddr=127.0.0.1 Port=[$((base + 1))-$((base + nodes))] CPUs=1 RealMemory=8000
PartitionName=all Nodes=ALL Default=YES MaxTime=INFINITE State=UP
CONF
export SLURM_CONF=$dir/slurm.conf
slurmctld
for i in $(seq "$nodes"); do
  mkdir -p "$dir/spool-n$i"
  slurmd -N "n$i"
done
for _ in $(seq 300); do
  [ "$(sinfo -h -t idle -o %D 2>/dev/null)" = "$nodes" ] && exit 0
  sleep 0.2
done
echo "the nodes are not idle after a minute: $(sinfo -h 2>&1 | head -n 3)" >&2
tail -n 5 "$dir"/*.log >&2
stop
exit 1
