# Pulse trains on GPIO lines of a real kernel (gpio-sim): chips found by label or line name, edges seen on the lines, time
# stamps of a loop-back line, a line in use is named with its user, a chip that vanishes ends the train.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
. tests/guest/lib.sh

modprobe gpio-sim || fail "no gpio-sim" # stays: its chip goes while it is held, which keeps the module
cd /sys/kernel/config/gpio-sim && mkdir decoy decoy/bank array array/bank && cd "$tmp" || exit 1
chip() { # NAME LABEL LINES...: a chip with these line names
  local c=/sys/kernel/config/gpio-sim/$1 label=$2 n=0 name
  shift 2
  echo $# >"$c/bank/num_lines"
  echo "$label" >"$c/bank/label"
  for name in "$@"; do
    mkdir "$c/bank/line$n"
    echo "$name" >"$c/bank/line$n/name"
    n=$((n + 1))
  done
  echo 1 >"$c/live" || fail "chip $label does not come alive"
}
# The decoy takes the low number: a program that goes by numbers is wrong.
chip decoy decoy OTHER0 OTHER1
chip array sst-trigger TRIG0 TRIG1 TRIG2 TRIG3 TRIG4 TRIG5 LOOP0
udevadm settle --timeout=20
lines=/sys/devices/platform/$(cat /sys/kernel/config/gpio-sim/array/dev_name)/$(cat /sys/kernel/config/gpio-sim/array/bank/chip_name)
gpiodetect >chips
cat chips
says chips "[sst-trigger] (7 lines)" "[decoy] (2 lines)"

# A train: the pulses arrive on the last line, and each edge lies where it was said to lie.
wire_up "$lines/sim_gpio5/value" "$lines/sim_gpio6/pull"
"$bin/trigger" 5 30 80000 sst-trigger LOOP0 TRIG0 TRIG1 TRIG2 TRIG3 TRIG4 TRIG5 >train 2>&1 || fail "the train failed"
cut_wire
cat train
set -- $(tail -n 1 train) # end 0 fired N skipped N missing N
is "beats fired and skipped" "$1 $2 $(($4 + $6))" "end 0 30"
[ "$4" -ge 28 ] || fail "only $4 of 30 beats were in time"
[ "$pulses" -ge $(($4 - 1)) ] && [ "$pulses" -le "$4" ] || fail "$pulses pulses on the line of $4 that were fired"
[ "$8" -le $(($4 - pulses)) ] || fail "$8 edges are missing, although the line showed $pulses of $4 pulses"
awk '$1 == "edge" {
  n++
  if (!($4 <= $6 && $6 <= $8)) { print "FAIL: not in order: " $0 }
  if (last && ($4 - last) % 200000000 != 0) { print "FAIL: not a multiple of 200 ms after the beat before: " $0 }
  if ($10 && ($10 < $6 || $10 > $8 + 80000000)) { print "FAIL: a loop-back stamp outside of its pulse: " $0 }
  late = $6 - $4; if (late > worst) worst = late
  last = $4
}
END { printf "%d beats, at most %.2f ms after they were due\n", n, worst / 1e6 }' train | tee judged
! grep -q FAIL judged || failed=1
for l in 0 1 2 3 4 5; do is "line $l after the train" "$(cat "$lines/sim_gpio$l/value")" 0; done
! gpioinfo sst-trigger | grep -q used.*sst || fail "lines are still held: $(gpioinfo sst-trigger)"

# By line names alone, active low: idle is high from the opening on, a pulse is low. It rises once to idle, thrice after a
# pulse, and falls when it is let go.
wire_up "$lines/sim_gpio1/value" ""
"$bin/trigger" -l 1 3 300000 "" "" TRIG1 >low 2>&1 || fail "by line name"
cat low
cut_wire
is "rises of a line that is active low" "$pulses" 4

# The owner of a busy line is named.
gpioset --mode=signal sst-trigger 2=0 & holder=$!
wait_for 10 sh -c "gpioinfo sst-trigger | grep -q gpioset" || fail "gpioset holds nothing"
"$bin/trigger" 10 1 1000 sst-trigger "" TRIG1 TRIG2 >busy 2>&1 && fail "a busy line was taken"
cat busy
says busy TRIG2 gpioset "open -16"
! grep -q TRIG1 busy || fail "blames a line that is free"
kill $holder
wait $holder
"$bin/trigger" 10 1 1000 nosuch "" TRIG1 >missing 2>&1 && fail "a chip that is not there was found"
cat missing
says missing nosuch decoy sst-trigger "open -19"
"$bin/trigger" 10 1 1000 sst-trigger "" TRIG9 >missing 2>&1 && fail "a line that is not there was found"
cat missing
says missing TRIG9 TRIG5 "open -19"

# The chip goes away under the train: told, not hung.
"$bin/trigger" 20 0 5000 sst-trigger "" TRIG0 >gone 2>&1 & train=$!
wait_for 10 grep -q open gone
sleep 0.5
echo 0 >/sys/kernel/config/gpio-sim/array/live
wait $train && fail "a train on a chip that is gone ended well"
tail -n 3 gone
says gone "end -"
is "lines of error" "$(grep -c 'sst: error' gone)" 1
echo 0 >/sys/kernel/config/gpio-sim/decoy/live
cd /sys/kernel/config/gpio-sim && rmdir ./*/bank/line* ./*/bank ./* || fail "the chips do not go"
exit $failed
