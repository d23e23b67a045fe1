#!/usr/bin/env bash
# A recorder is killed (SIGKILL) at random times, and goes on in the same folder: every set that it said was written is there
# with all its bytes, at most the one in flight is not. tests/system/record_kill.sh [KILLS] [SEED]; 10 and the time.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
set -u
. "$(dirname "$0")/../lib.sh"
kills=${1:-10} seed=${2:-$(date +%s)}
writer=$root/${SST_BUILD:-build}/tests/tools/record_writer
[ -x "$writer" ] || skip "$writer is not built; make tests"
need libavformat
RANDOM=$seed
array="cameras=6 bytes=3000 width=64 height=48 rate=1000 pace=1"
written=0
for ((i = 0; i < kills; i++)); do
  case $((i % 3)) in
    0) how="sync=0.01 segment_s=0.02";;        # a new segment every twenty sets
    1) how="sync=0 segment_s=0.02";;           # every set synced
    2) how="sync=1 segment_bytes=200000";;
  esac
  # shellcheck disable=SC2086
  "$writer" write rec $array $how append=1 first=$written sets=30000 >said 2>err &
  pid=$!
  sleep "0.0$((RANDOM % 10))$((RANDOM % 10))"
  # Half of the time, and the first time, in the middle of writing, not while it starts.
  [ $i != 0 ] && [ $((RANDOM % 2)) = 0 ] || for ((w = 0; w < 6000; w++)); do [ -s said ] && break; sleep 0.01; done
  sleep "0.0$((RANDOM % 10))$((RANDOM % 10))"
  { kill -KILL "$pid"; wait "$pid"; } 2>/dev/null >&2
  acked=$(tail -n 1 said) last=$written
  acked=${acked:-$last}
  [ -e rec/recording.json ] || continue # killed before anything was there
  # shellcheck disable=SC2086
  there=$(timeout 600 "$writer" check rec $array 2>check.err) || { fail "kill $i, seed $seed: $(cat check.err)"; break; }
  [ "$there" -ge "$acked" ] || fail "kill $i, seed $seed: $acked sets were written, $there are there"
  [ "$there" -le $((acked + 1)) ] || fail "kill $i, seed $seed: $acked sets were written, but $there are there"
  grep -v "warning" err >&2 && fail "kill $i, seed $seed: the writer complained"
  written=$there
done
[ "$written" -gt 0 ] || fail "nothing was written; the machine is too slow for this test"

# Without a writer in between: info agrees, and other programs read the files of the killed one.
sets=$("$sst" recording rec --verify --json 2>err | python3 -c 'import json, sys; o = json.load(sys.stdin); print(o["sets"], o["damaged"])')
[ "$sets" = "$written 0" ] || fail "sst recording says $sets, not $written 0"
if command -v ffprobe >/dev/null; then
  python3 - <<'PY' || fail "ffprobe sees other frames than were recorded"
import json, subprocess, sys
frames, segment = {}, None
for line in open("rec/sets.jsonl"):
    if not line.endswith("}\n"):
        continue  # torn
    line = json.loads(line)
    segment = line.get("segment", segment)
    frames[segment] = frames.get(segment, 0) + len(line.get("frames", []))
last = max(frames)
for s in sorted(frames)[:: len(frames) // 8 + 1] + [last]:
    out = subprocess.run(["ffprobe", "-v", "quiet", "-show_entries", "packet=stream_index", "-of", "csv=p=0",
                          f"rec/segments/{s:06d}.mkv"], stdout=subprocess.PIPE, timeout=60).stdout
    seen = len(out.split())
    # Behind the last set there may be some frames of the one in flight; everywhere else that end was cut off.
    if not frames[s] <= seen <= frames[s] + (6 if s == last else 0):
        sys.exit(f"segment {s}: {frames[s]} frames in the list, ffprobe sees {seen}")
PY
fi
echo "$kills kills, $written sets, $(find rec/segments -name '*.mkv' | wc -l) segments, seed $seed"
exit $failed
