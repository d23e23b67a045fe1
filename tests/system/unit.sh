#!/usr/bin/env bash
# The installed service: where everything goes, that systemd takes the units, how exposed they are, and that nothing is
# left of it afterwards.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
. "$(dirname "$0")/../lib.sh"
build=$root/${SST_BUILD:-build}
[ -x "$build/sstd" ] || skip "sstd is not built"
run() { make -s -C "$root" BUILD="$build" PREFIX=/usr DESTDIR="$tmp/dest" "$@" >out 2>&1 || fail "make $*: $(cat out)"; }

run install-built
for f in usr/bin/sst usr/sbin/sstd usr/lib/systemd/system/sstd.service usr/lib/systemd/system/sstd.socket \
    usr/lib/sysusers.d/sst.conf usr/lib/tmpfiles.d/sst.conf usr/lib/udev/rules.d/60-sst.rules usr/lib/modules-load.d/sst.conf \
    usr/share/man/man1/sst.1 usr/share/man/man1/sst-sim.1 usr/share/man/man8/sstd.8 usr/share/man/man8/sst-rtsp.8 \
    usr/share/bash-completion/completions/sst usr/share/zsh/site-functions/_sst usr/share/fish/vendor_completions.d/sst.fish \
    usr/lib/sst/libsst-sim-preload.so etc/sst/sstd.yaml \
    usr/share/doc/sst/examples/lan.conf; do
  [ -s "dest/$f" ] || fail "$f is not installed"
done
for name in rtsp mqtt onvif; do
  [ -x "$build/sst-$name" ] || continue
  [ -x "dest/usr/sbin/sst-$name" ] && [ -e "dest/usr/lib/systemd/system/sstd.service.wants/sst-$name.service" ] ||
    fail "sst-$name is not installed and enabled"
done
if [ -e "$build/libsst-read.so.0" ]; then
  [ -s dest/usr/lib/libsst-read.so ] && [ -s dest/usr/lib/libsst-read.so.0 ] && [ -s dest/usr/include/sst/read.h ] || fail "libsst-read is not installed"
  flags=$(PKG_CONFIG_PATH=dest/usr/lib/pkgconfig PKG_CONFIG_ALLOW_SYSTEM_CFLAGS=1 pkg-config --cflags --libs sst-read)
  [[ $flags == *-I/usr/include*-lsst-read* ]] || fail "sst-read.pc: $flags"
fi
unit=dest/usr/lib/systemd/system/sstd.service
grep -q '^ExecStart=/usr/sbin/sstd$' $unit && grep -q '^ExecReload=/usr/bin/sst reload$' $unit || fail "paths: $(grep Exec $unit)"
grep -rlE '@[A-Z]+@' dest/usr/lib/systemd dest/usr/share/man && fail "a place was not filled in"

# An upgrade keeps edited files.
echo '# mine' >>dest/etc/sst/sstd.yaml
run install-built
grep -q '# mine' dest/etc/sst/sstd.yaml || fail "the configuration was overwritten"
run uninstall
grep -q 'it stays' out || fail "nothing said of the configuration: $(cat out)"
[ "$(find dest -type f | grep -c .)" -eq 1 ] || fail "left: $(find dest -type f)"
cp "$root/config/sstd.yaml" dest/etc/sst/sstd.yaml
run uninstall
[ -z "$(find dest -type f; find dest -name '*sst*')" ] || fail "left: $(find dest -type f -o -name '*sst*')"

if command -v systemd-analyze >/dev/null; then
  # Where the programs are, so that the unit can be judged as it is.
  make -s -C "$root" BUILD="$build" PREFIX="$tmp/here" SYSCONFDIR="$tmp/here/etc" install-built >out 2>&1 || fail "install: $(cat out)"
  units=here/lib/systemd/system
  # Man pages are not looked up: this tree's are not installed.
  systemd-analyze verify --man=no $units/sst*.service $units/sstd.socket >out 2>&1 || fail "verify: $(cat out)"
  # Only of ours: other units of the machine have faults of their own.
  grep -E '(^|/)sst[d-]' out && fail "verify: $(grep sst out)"
  for unit in $units/sst*.service; do
    systemd-analyze security --offline=true --threshold=15 $unit >out 2>&1 || fail "exposure of ${unit##*/}: $(tail -1 out)"
  done
  for example in "$root"/systemd/examples/*.conf; do
    mkdir -p $units/sstd.service.d
    cp "$example" $units/sstd.service.d/
    systemd-analyze verify --man=no $units/sstd.service 2>&1 | grep -E 'sstd' | grep -vE 'Restart(Steps|MaxDelaySec)|libcamerify is not executable' &&
      fail "verify with ${example##*/}"
    rm -r $units/sstd.service.d
  done
fi

if command -v systemd-sysusers >/dev/null; then
  mkdir -p image/etc
  systemd-sysusers --root="$tmp/image" "$root/systemd/sysusers.conf" >out 2>&1 || fail "sysusers: $(cat out)"
  grep -q '^sst:.*:/var/lib/sst:' image/etc/passwd || fail "no user sst: $(cat image/etc/passwd)"
  declare -A groups=([rtsp]=sst-view [mqtt]=sst [onvif]="sst-view sst-rtsp")
  for name in rtsp mqtt onvif; do
    unit=$root/systemd/sst-$name.service.in
    grep -q "^sst-$name:" image/etc/passwd && grep -qx "User=sst-$name" "$unit" || fail "no user sst-$name of its own"
    # Groups of a unit are its rights.
    [ "$(sed -n 's/^SupplementaryGroups=//p' "$unit")" = "${groups[$name]}" ] ||
      fail "$name: $(grep Groups "$unit")"
  done
  grep -qx 'sst-view:[^:]*:[^:]*:sst-onvif,sst-rtsp' image/etc/group || fail "sst-view: $(cat image/etc/group)"
  for group in video gpio dialout plugdev sst sst-view; do grep -q "^$group:" image/etc/group || fail "no group $group"; done
fi
for p in systemd-analyze systemd-sysusers; do
  command -v $p >/dev/null || skip "$p is not installed: units or users were not judged"
done
exit $failed
