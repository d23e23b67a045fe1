#!/usr/bin/env bash
# A stop overtakes the reloads that wait before it: the service ends in its order, not by its alarm.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
. "$(dirname "$0")/../lib.sh"
build=$root/${SST_BUILD:-build}

cat >sstd.yaml <<Y
trigger: {source: free-run}
control: {socket: $tmp/c.sock, group: ""}
web: {port: 0, token_file: $tmp/token}
storage: {dir: $tmp/store, min_free_gb: 0}
Y
mkdir conf.d # a configuration that takes its time to be read
for i in $(seq 20 79); do
  { yes "# a comment of a line that the reader has to pass over" | head -n 400; echo "storage: {min_free_gb: 0}"; } >conf.d/$i.yaml
done
for n in 1 2 3; do # a machine that is held up for a second is no fault
  "$build/sstd" --config sstd.yaml >log 2>&1 & daemon=$!
  for _ in $(seq 1200); do [ -S c.sock ] && break; sleep 0.05; done
  /usr/bin/python3 - $daemon <<'END'
import os, signal, sys, time
for _ in range(600):
    os.kill(int(sys.argv[1]), signal.SIGHUP)
    time.sleep(0.0005)
os.kill(int(sys.argv[1]), signal.SIGTERM)
END
  wait $daemon || fail "it ended with status $?: $(cat log)"
  grep -q "something hangs" log || exit $failed
  repeats $n "the service ended by its alarm"
done
fail "it ends by its alarm, behind its reloads: $(cat log)"
exit $failed
