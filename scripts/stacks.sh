#!/usr/bin/env bash
# stacks.sh PID: where a process that does not answer stands: the state of each thread, and its stack where gdb or eu-stack
# is installed.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
echo "process $1: $(tr '\0' ' ' <"/proc/$1/cmdline")"
for t in /proc/"$1"/task/*; do
  echo "  $(cat "$t/comm"): $(awk '/^State/ { print $2, $3 }' "$t/status"), in $(cat "$t/wchan"), system call $(cat "$t/syscall")"
done
if command -v gdb >/dev/null; then
  timeout 60 gdb -p "$1" -batch -ex 'thread apply all bt 12' 2>/dev/null | grep -E '^(Thread|#)'
elif command -v eu-stack >/dev/null; then
  timeout 60 eu-stack -p "$1" -n 12 2>/dev/null
fi
exit 0
