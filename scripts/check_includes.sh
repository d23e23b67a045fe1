#!/usr/bin/env bash
# Code depends one way (design.md, 2: cli, daemon > drivers, pipeline > base). That headers compile alone is the Makefile's.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
set -u
cd "$(dirname "$0")/.."
bad=0
deny() { # folder, regex of includes it must not have
  [ -d "$1" ] || return 0
  if grep -rnE "^#include \"($2)/" "$1" --include='*.c' --include='*.h' --include='*.cc'; then
    echo "error: $1 must not include $2" >&2; bad=1
  fi
}
deny base 'read|config|drivers|capture|pipeline|client|publishers|daemon|cli|simulators'
deny client 'config|drivers|capture|pipeline|publishers|daemon|cli|simulators'
deny publishers 'drivers|capture|daemon|cli|simulators'
deny config 'drivers|capture|pipeline|daemon|cli|simulators'
deny pipeline 'read|config|drivers|capture|daemon|cli|simulators'
deny read 'config|drivers|capture|client|publishers|daemon|cli|simulators'
deny drivers 'config|capture|pipeline|daemon|cli|simulators'
deny capture 'daemon|cli|simulators'
deny daemon 'client|publishers|cli|simulators'
deny cli 'daemon|publishers|simulators/(devices|rig)'
deny simulators 'daemon|cli|drivers|capture'
exit $bad
