#!/usr/bin/env bash
# Workers that share the views of one light field: in every step one is killed with -9 while it holds a piece, another
# one takes that over, and the bytes are those of one process.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
set -u
. "$(dirname "$0")/../lib.sh"
export SST_MODELS=$root/models

# kill_in_steps DIR OPTIONS...: workers one after the other, each of which is killed in the step after that of the last one
# (by its lease, the next one takes over what it held), until one finishes. Prints how many were killed, and the steps.
kill_in_steps() {
  python3 - "$sst" "$@" <<'PY'
import os, subprocess, sys, time
sst, folder, *options = sys.argv[1:]
steps = os.path.join(folder, ".process-views")

def held_in(step, pid):
    """Whether a worker holds an item of a step."""
    path = os.path.join(steps, "step-%02d" % step)
    try:
        for item in os.listdir(path):
            if ".maps" not in item and any(".%d." % pid in f for f in os.listdir(os.path.join(path, item))):
                return True
    except OSError:
        pass
    return False

killed = 0
for step in range(100):
    worker = subprocess.Popen([sst, "process", folder, *options, "--shard", "1/1", "--split-views", "--lease", "0.2"],
                              stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    end = time.monotonic() + 60
    later = os.path.join(steps, "step-%02d" % (step + 1))
    while worker.poll() is None and not held_in(step, worker.pid) and not os.path.exists(later):
        if time.monotonic() > end:
            sys.exit("step %d does not end" % step)
        time.sleep(0.002)
    if worker.poll() is None:
        worker.kill()
        killed += 1
        worker.wait()
    elif worker.returncode:
        sys.exit("a worker in step %d: %s" % (step, worker.stderr.read().decode()))
    else:
        break
print(killed, step)
PY
}

# same NAME KILLS SCENE OPTIONS...: at least so many are killed
same() {
  local name=$1 kills=$2 scene=$3 got
  shift 3
  # shellcheck disable=SC2086
  "$sst" scene $scene -o "$name" >/dev/null || fail "scene"
  cp -r "$name" "$name-whole"
  "$sst" process "$name-whole" --threads 1 "$@" --json >"$name.json" 2>err || fail "$name, whole: $(cat err)"
  cp -r "$name" "$name-two"
  got=$(kill_in_steps "$name" --threads 1 "$@") || fail "$name: $got"
  [ "${got% *}" -ge "$kills" ] || fail "$name: only ${got% *} killed in ${got#* } steps"
  diff -rq -x .process "$name" "$name-whole" || fail "$name: views that were shared differ"
  [ ! -e "$name/.process-views" ] || fail "$name: what workers exchanged is left"
  # Two at once, and their reports.
  for i in 1 2; do
    "$sst" process "$name-two" --threads $i "$@" --json --shard $i/2 --split-views >"$name.$i" 2>"err$i" &
    pid[$i]=$!
  done
  for i in 1 2; do wait "${pid[$i]}" || fail "$name, worker $i: $(cat "err$i")"; done
  diff -rq -x .process "$name-two" "$name-whole" || fail "$name: views that two shared differ"
  python3 - "$name" <<'PY' || fail "$name: another report"
import json, sys
name = sys.argv[1]
whole, shared = json.load(open(name + ".json")), [open("%s.%d" % (name, i)).read() for i in (1, 2)]
assert [bool(s) for s in shared].count(True) == 1, shared
shared = json.loads("".join(shared))
for part in whole, shared:
    for key in "seconds", "cpu_seconds":
        del part[key]
assert whole == shared, (whole, shared)
PY
}

# The second pass with carried views, and labels; a narrow range, refined between pixels; all views matched, in two
# rounds; tiles of short ranges; pictures that are corrected.
same labels 20 "pedestrian --size 160x120 --grid 3x3"
same narrow 12 "bush --size 96x72 --grid 2x3" --no-labels --range-min 0 --range-max 7
same accurate 10 "pedestrian --size 96x72 --grid 2x3" --preset accurate --no-labels
same tiles 12 "pedestrian --size 160x120 --grid 3x3" --no-labels --skip ranges
same gains 12 "layers --size 160x120 --grid 3x3 --gain 30 --noise 0 --jpeg 0" --no-labels --preset preview

# --- workers with a device each, and one that loses it: the same bytes ---
"$sst" scene pedestrian -o device --size 160x120 --grid 3x3 >/dev/null || fail "scene"
cp -r device device-whole
cp -r device device-lost
"$sst" process device-whole --threads 1 --no-labels >/dev/null 2>err || fail "device, whole: $(cat err)"
for i in 1 2; do
  "$sst" process device --threads $i --no-labels --device dummy --shard $i/2 --split-views >/dev/null 2>"err$i" & pid[$i]=$!
done
for i in 1 2; do wait "${pid[$i]}" || fail "device, worker $i: $(cat "err$i")"; done
diff -rq -x .process device device-whole || fail "device: views that were shared differ"
"$sst" scene pedestrian -o tiny --size 32x24 --grid 1x2 >/dev/null || fail "scene"
lost=$(($(comparisons process tiny --no-labels) + 40)) # as many for pictures of any size
"$sst" process device-lost --no-labels --device dummy:lost=$lost --shard 1/1 --split-views --json >lost.json 2>err ||
  fail "a device that is lost: $(cat err)"
diff -rq -x .process device-lost device-whole || fail "a device that is lost: other bytes"
python3 - <<'PY' || fail "a device that is lost: $(cat lost.json)"
import json
d = json.load(open("lost.json"))["device"]
assert d["failures"] > 0 and d["why_cpu"] == "the device is lost", d
assert d["views"] > 0 and d["dispatches"] >= 40 and d["stages_on_cpu"], d
PY

# --- a view that cannot be read: every worker says so; once it can be, the same command goes on ---
"$sst" scene pedestrian -o broken --size 96x72 --grid 2x3 >/dev/null || fail "scene"
cp -r broken broken-whole
"$sst" process broken-whole --threads 1 --no-labels >/dev/null 2>err || fail "broken, whole: $(cat err)"
echo "no picture" >broken/views/00_01.png
for i in 1 2; do "$sst" process broken --no-labels --shard $i/2 --split-views --lease 2 >/dev/null 2>"err$i" & pid[$i]=$!; done
for i in 1 2; do
  wait "${pid[$i]}"
  [ $? -eq 3 ] || fail "a damaged view, worker $i: $(cat "err$i")"
  grep -q '00_01\.png' "err$i" || fail "no cause, worker $i: $(cat "err$i")"
done
cp broken-whole/views/00_01.png broken/views/
"$sst" process broken --no-labels --shard 2/2 --split-views >/dev/null 2>err || fail "after a damaged view: $(cat err)"
diff -rq -x .process broken broken-whole || fail "other bytes after a damaged view"

# --- pictures that were exchanged by others belong to their light field ---
"$sst" scene pedestrian -o other --size 96x72 --grid 2x3 --seed 2 >/dev/null || fail "scene"
cp -r other other-whole
"$sst" process other-whole --threads 1 --no-labels >/dev/null 2>err || fail "other, whole: $(cat err)"
"$sst" scene pedestrian -o left --size 96x72 --grid 2x3 >/dev/null || fail "scene"
"$sst" process left --no-labels --shard 1/1 --split-views --lease 2 >/dev/null 2>&1 &
pid=$!
for _ in $(seq 1000); do [ -e left/.process-views/step-03 ] && break; sleep 0.01; done
kill -9 $pid
wait $pid 2>/dev/null
[ ! -e left/.process-views ] || mv left/.process-views other/
"$sst" process other --no-labels --shard 1/1 --split-views --lease 2 >/dev/null 2>err || fail "other: $(cat err)"
diff -rq -x .process other other-whole || fail "other: another one's pictures"
exit $failed
