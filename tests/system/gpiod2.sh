#!/usr/bin/env bash
# The trigger with libgpiod 2.x on a machine that has 1.x: headers and library come from Debian 13's packages into
# build/gpiod2 (kept there), nothing is installed. Compiles without a warning, and its tests pass with the newer library.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
set -u
. "$(dirname "$0")/../lib.sh"

pkg-config --atleast-version=2 libgpiod && skip "libgpiod here is 2.x: the build itself uses it"
[ "$(dpkg --print-architecture 2>/dev/null)" ] || skip "no dpkg: Debian's packages of libgpiod 2.x cannot be unpacked"
cache=$root/build/gpiod2
export SST_BUILD=$root/${SST_BUILD:-build} # the tests run in another folder
arch=$(dpkg-architecture -qDEB_HOST_MULTIARCH 2>/dev/null || gcc -print-multiarch)

fetch() {
  local keys=/usr/share/keyrings/debian-archive-keyring.gpg
  rm -rf "$cache.new" && mkdir -p "$cache.new/lists/partial" "$cache.new/archives/partial" || return 1
  echo "deb [signed-by=$keys] http://deb.debian.org/debian trixie main" >"$cache.new/sources.list"
  cat >"$cache.new/apt.conf" <<EOF
Dir::Etc::sourcelist "$cache.new/sources.list";
Dir::Etc::sourceparts "-";
Dir::State::lists "$cache.new/lists";
Dir::Cache "$cache.new";
Acquire::Languages "none";
Acquire::http::Timeout "20";
Acquire::Retries "1";
APT::Sandbox::User "";
EOF
  (cd "$cache.new" && export APT_CONFIG=$cache.new/apt.conf &&
   timeout 60 apt-get -q update && timeout 60 apt-get -q download libgpiod-dev libgpiod3 &&
   for deb in *.deb; do dpkg -x "$deb" root || exit 1; done) >"$tmp/fetch.log" 2>&1 || return 1
  rm -rf "$cache" "$cache.new/lists" && mv "$cache.new" "$cache"
}
[ -e "$cache/root/usr/include/gpiod.h" ] || fetch ||
  { rm -rf "$cache.new"; skip "libgpiod 2.x cannot be fetched: $(grep -m1 '^[EW]:' fetch.log || tail -n 1 fetch.log)"; }

include=$cache/root/usr/include lib=$cache/root/usr/lib/$arch
build() { # NAME SOURCES...
  local name=$1
  shift
  gcc -std=c11 -D_DEFAULT_SOURCE -D_POSIX_C_SOURCE=200809L -O2 -g -pthread -Wall -Wextra -Wshadow -Wvla -Wundef \
      -Wconversion -Wno-sign-conversion -Wstrict-prototypes -Wmissing-prototypes -Werror -DWITH_GPIOD=2 \
      -I"$include" -I"$root" "$@" "$root"/drivers/trigger/{gpio,gpio_v2,pulse,trigger}.c \
      "$root/base/log.c" "$root/base/text.c" "$root/base/clock.c" "$root/base/thread.c" "$lib"/libgpiod.so.3 -lcmocka -ljansson -lm -o "$name" 2>gcc.log ||
    { fail "$name against libgpiod 2.x: $(head -c 2000 gcc.log)"; return 1; }
}
run() { # PROGRAM: 77 is fine where there are no simulated devices
  (cd "$root" && LD_LIBRARY_PATH=$lib timeout 600 "$tmp/$1") >run.log 2>&1
  case $? in
    0) ;;
    77) echo "$1: $(tail -n 1 run.log)";;
    *) fail "$1 with libgpiod 2.x: $(tail -c 2000 run.log)";;
  esac
}

build unit "$root/tests/unit/trigger.c" && run unit
build gpio "$root/tests/sim/trigger.c" && run gpio
exit $failed
