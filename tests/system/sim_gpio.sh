#!/usr/bin/env bash
# Simulated GPIO chips under libgpiod's programs and under plain ioctls of uAPI 2: names, values, edges, exposures, faults.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
. "$(dirname "$0")/../lib.sh"
build=$root/${SST_BUILD:-build}
until=$root/tests/until.sh
sim="timeout 600 $build/sst-sim --quiet --world $root/simulators/scene/world/worlds/small.yaml"
for p in gpioinfo gpioset gpioget gpiomon gpiofind gpiodetect v4l2-ctl; do
  command -v $p >/dev/null || skip "$p is not installed (scripts/deps.sh)"
done
gpiodetect --version | grep -q 'v1\.' || skip "gpiod's programs are not of version 1: their options differ"

# --- names: 2 rows, so 2 trigger lines and the loop-back behind them
$sim -- sh -c 'gpiodetect; gpioinfo sst-trigger; gpiofind LOOP0; gpioget sst-trigger 2' >out 2>&1 || fail "names: $(cat out)"
grep -q '^gpiochip1 \[sst-trigger\] (10 lines)' out || fail "gpiodetect: $(head -n 2 out)"
grep -Eq 'line +1: +"TRIG1" +unused +input +active-high' out || fail "gpioinfo: $(cat out)"
[ "$(tail -n 2 out)" = "$(printf 'gpiochip1 2\n0')" ] || fail "gpiofind, gpioget: $(tail -n 2 out)"

# --- from a folder whose name LD_PRELOAD cannot hold
mkdir 'a b:c' && cp "$build"/{sst-sim,libsst-sim-preload.so} 'a b:c'
timeout 600 'a b:c/sst-sim' --quiet --world "$root/simulators/scene/world/worlds/small.yaml" -- gpiodetect >out 2>&1
grep -q '^gpiochip1 \[sst-trigger\]' out && [ -e 'a b:c/libsst-sim-preload.so' ] || fail "a name with a space: $(cat out)"

# --- edges through the loop-back wire, by both versions of the uAPI; a line in use is shown and refused
for n in 1 2 3 4 5; do # a busy machine makes a pulse longer: again
  $sim -- sh -c "timeout 60 gpiomon --num-events=4 sst-trigger 2 & $until 'held LOOP0 gpiomon'
    gpioset --mode=time --usec=20000 sst-trigger 0=1; gpioset --mode=time --usec=1000 sst-trigger 0=1; wait" >out 2>&1
  [ "$(grep -Eo 'RISING|FALLING' out | tr '\n' ' ')" = 'RISING FALLING RISING FALLING ' ] || fail "gpiomon: $(cat out)"
  width=$(awk '{ gsub(/[][]/, " "); t[NR] = $NF } END { print t[2] - t[1] < 0.02 ? "short" : t[2] - t[1] < 0.2 ? "right" : "long" }' out)
  [ $width != long ] && break
  repeats $n "a pulse of $width width"
done
[ $width = right ] || fail "width: $(cat out)"
$sim -- "$build/tests/tools/sim_bus" gpio /dev/gpiochip1 0 2 >out 2>&1 || fail "uAPI 2: $(cat out)"
$sim -- sh -c "gpioset --mode=signal sst-trigger 1=1 & $until 'held TRIG1 gpioset'
  gpioinfo sst-trigger | grep TRIG1; gpioset sst-trigger 1=0; kill \$!; wait \$!" >out 2>&1
grep -q '"TRIG1" *"gpioset" *output' out && grep -q 'busy' out || fail "in use: $(cat out)"

# --- an edge of TRIG1 exposes the second row, and nothing else
cat >expose.sh <<END
exposed() { $until "[ \\\$(grep -c stamp_ns truth) -ge \$1 ]"; sleep 0.2; }
for i in 0 2 3; do
  v4l2-ctl -d /dev/video\$i -c trigger_mode=1
  timeout 90 v4l2-ctl -d /dev/video\$i --stream-mmap --stream-count=2 --stream-to=/dev/null &
done
$until 'streaming 3'
for n in 2 4; do gpioset --mode=time --usec=2000 sst-trigger 1=1; exposed \$n; done
for n in 5 6; do gpioset --mode=time --usec=2000 sst-trigger 0=1; exposed \$n; done
wait
END
$sim --truth truth -- sh expose.sh >out 2>&1
[ "$(grep -c '"stamp_ns"' truth)" = 6 ] || fail "triggered: $(cat truth out)"
[ "$(sort -t: -k2n truth | grep -o '"camera":[0-9]*,.*"trigger":[0-9]*' | tr -dc '0-9\n' | cut -c 1,3 | tr '\n' ' ')" = "00 01 20 21 30 31 " ] ||
  fail "triggers: $(cat truth)"
[ "$(head -n 4 truth | grep -c '"camera":[23]')" = 4 ] || fail "order: $(cat truth)"

# --- faults
fault() { echo "$build/sst-sim fault $*"; }
$sim --fault gpio.busy=1 -- gpioset sst-trigger 0=1 2>err; grep -q busy err || fail "busy: $(cat err)"
$sim --fault gpio.denied=1 -- cat /dev/gpiochip1 2>err; grep -q 'Permission denied' err || fail "denied: $(cat err)"
$sim --fault gpio.denied=2 -- cat /dev/gpiochip1 2>err; grep -q 'not permitted' err || fail "denied: $(cat err)"
$sim --fault gpio.stuck=1 -- sh -c "gpioset --mode=signal sst-trigger 0=1 & $until 'held TRIG0 gpioset'; gpioget sst-trigger 2
  kill \$!; wait \$! 2>/dev/null" >out 2>&1 # the shell may tell of the signal
[ "$(cat out)" = 0 ] || fail "stuck: $(cat out)"
$sim --fault gpio.lost_edges=1 -- sh -c "timeout 60 gpiomon --num-events=1 sst-trigger 2 & $until 'held LOOP0 gpiomon'; gpioset sst-trigger 0=1; sleep 0.5
  kill \$!; wait \$! 2>/dev/null" >out 2>&1
[ ! -s out ] || fail "lost_edges: $(cat out)"
$sim -- sh -c "timeout 90 gpiomon sst-trigger 2 & $until 'held LOOP0 gpiomon'; $(fault gpio.vanish=1); wait \$!; gpiodetect; $(fault gpio.vanish=0); gpiodetect" >out 2>&1
grep -q 'No such device' out && [ "$(grep -c sst-board out)" = 2 ] && [ "$(grep -c '\[sst-trigger' out)" = 1 ] || fail "vanish: $(cat out)"
exit $failed
