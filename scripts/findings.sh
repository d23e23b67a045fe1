#!/usr/bin/env bash
# findings.sh [NAME...]: run findings/*.sh, or those named, one after the other, and count what they say.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
set -u
cd "$(dirname "$0")/.." || exit 1
[ $# -gt 0 ] || set -- $(cd findings && ls -- *.sh)
held=0 changed=0 untried=0
for name in "$@"; do
  echo "--- ${name%.sh}"
  timeout 600 "findings/${name%.sh}.sh"
  case $? in 0) held=$((held + 1));; 1) changed=$((changed + 1));; *) untried=$((untried + 1));; esac
done
echo "$held hold, $changed changed, $untried could not be tried"
[ "$changed" -eq 0 ]
