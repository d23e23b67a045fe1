#!/bin/sh
# until.sh CONDITION: waits until a condition of the shell holds, a minute at most. `streaming N`: at least N cameras of the
# simulated session stream; `held LINE PROGRAM`: a program has that line of the trigger's chip.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
streaming() { [ "$("${SST_BUILD:-build}/sst-sim" status --json | grep -o '"streaming":true' | wc -l)" -ge "$1" ]; }
held() { gpioinfo sst-trigger | grep -q "\"$1\" *\"$2\""; }
root=$(cd "$(dirname "$0")/.." && pwd)
case ${SST_BUILD:-build} in /*) ;; *) SST_BUILD=$root/${SST_BUILD:-build};; esac

end=$(($(date +%s) + 60))
while [ "$(date +%s)" -le $end ]; do
  eval "$1" && exit
  sleep 0.1
done
echo "not within a minute: $1"
for pid in $(pgrep -s 0 '^sstd'); do "$root/scripts/stacks.sh" "$pid"; done
exit 1
