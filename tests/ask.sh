#!/usr/bin/env bash
# ask.sh PROGRAM ARGS...: a client of the service (sst, curl), for a minute at most. A service that does not answer by then
# ends the test (process SST_TEST_PID), with the stacks of all its threads.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
timeout 60 "$@"
rc=$?
if [ $rc -eq 124 ] && [ -n "${SST_TEST_PID-}" ]; then
  {
    echo "FAIL: no answer within a minute: $*"
    for pid in $(pgrep -s 0 '^sstd'); do "$(dirname "$0")/../scripts/stacks.sh" "$pid"; done
  } >&"${SST_TEST_OUT:-2}"
  kill "$SST_TEST_PID"
fi
exit $rc
