#!/usr/bin/env bash
# The committed manual page of the configuration is the one that its table gives, and man can show it.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
set -u
. "$(dirname "$0")/../lib.sh"
"$root/scripts/config_man.py" --build "${SST_BUILD:-build}" --check >out 2>&1 || fail "config_man.py: $(cat out)"
if command -v groff >/dev/null; then
  groff -man -Tutf8 -ww "$root/docs/man/sstd.yaml.5" >shown 2>err || fail "groff: $(cat err)"
  [ -s err ] && fail "groff said: $(head -5 err)"
  grep -q "whole number, 1..65535" shown || fail "the page lacks the MQTT port"
fi
[ "$failed" -eq 0 ] || exit 1
