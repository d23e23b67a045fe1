#!/usr/bin/env bash
# The committed manual page of the configuration is the one that its table gives, and man can show it.
set -u
. "$(dirname "$0")/../lib.sh"
"$root/${SST_BUILD:-build}/config_man" >page || fail "config_man: exit $?"
cmp -s page "$root/docs/man/sstd.yaml.5" || fail "docs/man/sstd.yaml.5 is not what the table gives: run make man"
if command -v groff >/dev/null; then
  groff -man -Tutf8 -ww page >shown 2>err || fail "groff: $(cat err)"
  [ -s err ] && fail "groff said: $(head -5 err)"
  grep -q "whole number, 1..65535" shown || fail "the page lacks the MQTT port"
fi
[ "$failed" -eq 0 ] || exit 1
