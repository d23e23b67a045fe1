#!/usr/bin/env bash
# install.sh install|uninstall: installs or removes what was built; one list for both. From make:
# BUILD, PREFIX, SYSCONFDIR, DESTDIR, and PLUGINDIR, UNITDIR, UDEVDIR, ZSHDIR. A configuration that was changed stays in both cases.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
set -eu
verb=$1
cd "$(dirname "$0")/.."
root=${DESTDIR:-}
p=$root$PREFIX
etc=$root$SYSCONFDIR/sst
doc=$p/share/doc/sst

put() { # MODE SOURCE TARGET
  if [ "$verb" = install ]; then
    install -D -m "$1" "$2" "$3"
  else
    rm -f "$3"
  fi
}
filled() { # SOURCE TARGET: a text with the places of the programs
  local text
  text=$(mktemp)
  sed "s,@BINDIR@,$PREFIX/bin,g; s,@SBINDIR@,$PREFIX/sbin,g" "$1" >"$text"
  put 644 "$text" "$2"
  rm -f "$text"
}
linked() { # TARGET LINK
  if [ "$verb" = install ]; then
    mkdir -p "${2%/*}"
    ln -sfn "$1" "$2"
  else
    rm -f "$2"
    rmdir "${2%/*}" 2>/dev/null || true
  fi
}
empty() { [ "$verb" = install ] || rmdir "$@" 2>/dev/null || true; }

put 755 "$BUILD/sst" "$p/bin/sst"
put 755 "$BUILD/sstd" "$p/sbin/sstd"
put 755 "$BUILD/sst-sim" "$p/bin/sst-sim"
put 644 "$BUILD/libsst-sim-preload.so" "$root$PLUGINDIR/libsst-sim-preload.so"
for f in opencv video gphoto aravis; do [ ! -e "$BUILD/libsst-$f.so" ] || put 644 "$BUILD/libsst-$f.so" "$root$PLUGINDIR/libsst-$f.so"; done
# Where versions before 0.3 had them.
for f in opencv video gphoto sim-preload; do rm -f "$p/lib/libsst-$f.so"; done
for f in config/profiles/*.yaml; do put 644 "$f" "$p/share/sst/profiles/${f##*/}"; done
for f in models/*.onnx models/manifest.json; do put 644 "$f" "$p/share/sst/$f"; done
for f in docs/man/*.[1-8]; do put 644 "$f" "$p/share/man/man${f##*.}/${f##*/}"; done
for f in sst sst-sim sstd; do
  put 644 completions/$f "$p/share/bash-completion/completions/$f"
  put 644 completions/_$f "$root$ZSHDIR/_$f"
  put 644 completions/$f.fish "$p/share/fish/vendor_completions.d/$f.fish"
done

filled systemd/sstd.service.in "$root$UNITDIR/sstd.service"
# Enabled: started with the service. They wait while they are disabled in the configuration.
for name in rtsp mqtt onvif; do
  [ "$verb" = install ] && [ ! -e "$BUILD/sst-$name" ] && continue # built without
  put 755 "$BUILD/sst-$name" "$p/sbin/sst-$name"
  filled systemd/sst-$name.service.in "$root$UNITDIR/sst-$name.service"
  linked ../sst-$name.service "$root$UNITDIR/sstd.service.wants/sst-$name.service"
done
put 644 systemd/sstd.socket "$root$UNITDIR/sstd.socket"
put 644 systemd/sysusers.conf "$p/lib/sysusers.d/sst.conf"
put 644 systemd/tmpfiles.conf "$p/lib/tmpfiles.d/sst.conf"
put 644 systemd/modules-load.conf "$p/lib/modules-load.d/sst.conf"
put 644 systemd/60-sst.rules "$root$UDEVDIR/rules.d/60-sst.rules"
for f in systemd/examples/*; do put 644 "$f" "$doc/examples/${f##*/}"; done

# libsst-read and what building with it needs.
eval "${READ_DIRS:-LIBDIR=$PREFIX/lib INCLUDEDIR=$PREFIX/include VERSION=$(sed -n 's/^VERSION := //p' Makefile)}"
if [ "$verb" = uninstall ] || [ -e "$BUILD/libsst-read.so.$VERSION" ]; then
  put 644 "$BUILD/libsst-read.so.$VERSION" "$root$LIBDIR/libsst-read.so.$VERSION"
  linked "libsst-read.so.$VERSION" "$root$LIBDIR/libsst-read.so.0"
  linked libsst-read.so.0 "$root$LIBDIR/libsst-read.so"
  put 644 read/sst/read.h "$root$INCLUDEDIR/sst/read.h"
  text=$(mktemp)
  sed "s,@PREFIX@,$PREFIX,; s,@LIBDIR@,$LIBDIR,; s,@INCLUDEDIR@,$INCLUDEDIR,; s,@VERSION@,$VERSION," read/sst-read.pc.in >"$text"
  put 644 "$text" "$root$LIBDIR/pkgconfig/sst-read.pc"
  rm -f "$text"
  put 644 read/example.c "$doc/examples/read.c"
fi
empty "$root$INCLUDEDIR/sst" "$root$LIBDIR/pkgconfig"

# The one file to edit; a new version comes beside the documentation only.
put 644 config/sstd.yaml "$doc/sstd.yaml"
if [ "$verb" = install ]; then
  install -d "$etc/conf.d"
  [ -e "$etc/sstd.yaml" ] || put 644 config/sstd.yaml "$etc/sstd.yaml"
elif cmp -s config/sstd.yaml "$etc/sstd.yaml"; then
  rm -f "$etc/sstd.yaml"
elif [ -e "$etc/sstd.yaml" ]; then
  echo "$etc/sstd.yaml was changed: it stays"
fi
empty "$etc/conf.d" "$etc"
empty "$root$PLUGINDIR" "$p/share/sst/profiles" "$p/share/sst/models" "$p/share/sst" "$doc/examples" "$doc"
