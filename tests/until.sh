#!/bin/sh
# until.sh CONDITION: waits until a condition of the shell holds, a minute at most. `streaming N`: so many cameras of the
# simulated session stream; `held LINE PROGRAM`: a program has that line of the trigger's chip.
streaming() { [ "$("${SST_BUILD:-build}/sst-sim" status --json | grep -o '"streaming":true' | wc -l)" -ge "$1" ]; }
held() { gpioinfo sst-trigger | grep -q "\"$1\" *\"$2\""; }
case ${SST_BUILD:-build} in /*) ;; *) SST_BUILD=$(dirname "$0")/../${SST_BUILD:-build};; esac

for _ in $(seq 600); do
  eval "$1" && exit
  sleep 0.1
done
echo "not within a minute: $1"
exit 1
