#!/usr/bin/env bash
# Debian packages, without building them: each file that `make install` puts somewhere belongs to one package, each program has a man page
# and completions for three shells with their values, scripts and profiles are in order, and versions and build dependencies agree.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
. "$(dirname "$0")/../lib.sh"
build=$root/${SST_BUILD:-build}
for program in sst sstd sst-sim sst-rtsp sst-mqtt sst-onvif libsst-opencv.so libsst-video.so libsst-gphoto.so libsst-aravis.so; do
  [ -e "$build/$program" ] || skip "$program is not built: the packages have all optional parts"
done
multiarch=$(gcc -dumpmachine)
multiarch=${multiarch/-pc-/-}
export UNITDIR=/usr/lib/systemd/system UDEVDIR=/usr/lib/udev
make -s -C "$root" BUILD="$build" install-built DESTDIR="$tmp/dest" PREFIX=/usr SYSCONFDIR=/etc LIBDIR="/usr/lib/$multiarch" UNITDIR=$UNITDIR UDEVDIR=$UDEVDIR \
  ZSHDIR=/usr/share/zsh/vendor-completions >out 2>&1 || fail "make install-built: $(cat out)"

# --- contents -------------------------------------------------------------------------------------------------------
cat >contents.py <<'P'
"""Files below dest/ against the patterns of debian/*.install and not-installed, as dh_install and dh_missing read them."""
import os, pathlib, re, sys
root, dest = pathlib.Path(sys.argv[1]), pathlib.Path("dest")
files = {str(p.relative_to(dest)) for p in dest.rglob("*") if not p.is_dir() or p.is_symlink()}
owner, bad = {}, 0


def fail(text):
    global bad
    bad = 1
    print("FAIL:", text)


# Parts whose sources this tree lacks are no packages, as debian/rules has it.
lacking = [name for name, source in (("libsst-read", "read/read.map"), ("python3-sst", "python/sst/__init__.py")) if not (root / source).exists()]
for table in sorted(root.glob("debian/*.install")) + [root / "debian/not-installed"]:
    if any(table.name.startswith(name) for name in lacking):
        continue
    for line in table.read_text().splitlines():
        pattern = re.sub(r"\$\{env:(\w+)\}", lambda m: os.environ[m[1]].lstrip("/"), line.split(" ")[0])
        if not pattern or pattern[0] == "#":
            continue
        matched = [str(p.relative_to(dest)) for p in dest.glob(pattern)]
        found = {f for f in files for m in matched if f == m or f.startswith(m + "/")}
        if not found and not any((dest / m).is_dir() for m in matched) and not list(root.glob(pattern)):
            fail(f"{table.name}: nothing is installed as {line}")
        for f in found:
            if owner.setdefault(f, table.name) != table.name:
                fail(f"{f} is in {owner[f]} and {table.name}")
for f in sorted(files - owner.keys()):
    fail(f"{f} is in no package: name it in debian/*.install")
for f in sorted(f for f in files if re.match(r"usr/s?bin/", f)):
    name, section = os.path.basename(f), "8" if "/sbin/" in f else "1"
    page = f"usr/share/man/man{section}/{name}.{section}"
    if owner.get(page) != owner.get(f) or not owner.get(f):
        fail(f"{name} has no man page in its package: {page}")
for package in re.findall(r"^Package: (\S+)", (root / "debian/control").read_text(), re.M):
    made = [f"{package}.install", f"{package}.docs"]
    if not any((root / "debian" / m).exists() for m in made) and package not in (root / "debian/rules").read_text():
        fail(f"package {package} gets no files")
# Libraries of the program's build are libraries of the package's build.
wanted = {w for w in re.findall(r"^(lib\S+-dev|nettle-dev|zlib1g-dev)\b", (root / "scripts/packages.txt").read_text(), re.M)}
given = set(re.findall(r"^ ([a-z0-9.+-]+)", (root / "debian/control").read_text(), re.M))
for name in sorted(wanted - given):
    fail(f"debian/control: {name} of scripts/packages.txt is not in Build-Depends")
sys.exit(bad)
P
/usr/bin/python3 contents.py "$root" || failed=1

# --- completions ----------------------------------------------------------------------------------------------------
shells='bash-completion/completions/ zsh/vendor-completions/_ fish/vendor_completions.d/'
for program in sst sst-sim sstd; do
  for place in $shells; do
    [ -s "dest/usr/share/$place$program" ] || [ -s "dest/usr/share/$place$program.fish" ] || fail "$program: no completion ${place%%/*}"
  done
done
# values FILE PATTERN: a line that offers these values
values() { grep -qE -- "$2" "dest/usr/share/$1" || fail "$1: nothing completes $2"; }
values fish/vendor_completions.d/sst.fish '__sst_at render.* -l method .*refocus sst clear see-through'
values fish/vendor_completions.d/sst.fish '__sst_at process.* -l preset .*preview balanced accurate'
values fish/vendor_completions.d/sst.fish '__sst_first scene.*bush pedestrian'
values fish/vendor_completions.d/sst-sim.fish '-l world .*pedestrian hedge'
values zsh/vendor-completions/_sst '--method\}.*:\(refocus sst clear see-through\)'
values zsh/vendor-completions/_sst '--preset\}.*:\(preview balanced accurate\)'
values zsh/vendor-completions/_sst '1: :\(bush pedestrian'
values zsh/vendor-completions/_sst-sim '--world.*:\(pedestrian hedge'
values bash-completion/completions/sst-sim '--world\).*pedestrian hedge'
for shell in zsh fish; do
  command -v $shell >/dev/null || continue
  for f in "$root"/completions/$([ $shell = zsh ] && echo '_*' || echo '*.fish'); do $shell -n "$f" || fail "$shell: $f"; done
done

# --- scripts, profiles, versions ------------------------------------------------------------------------------------
for f in "$root"/debian/*.p{ost,re}{inst,rm}; do [ ! -e "$f" ] || sh -n "$f" || fail "$f"; done
for f in "$root"/debian/tests/* "$root"/scripts/packages/*.sh; do [ "${f##*/}" = control ] || bash -n "$f" || fail "$f"; done
for f in $(sed -nE 's/^Tests: *//p' "$root/debian/tests/control"); do [ -x "$root/debian/tests/$f" ] || fail "debian/tests/$f is not there to run"; done
for program in dest/usr/sbin/*; do
  profile=$root/debian/apparmor/usr.sbin.${program##*/}
  grep -q "^profile ${program##*/} /usr/sbin/${program##*/} " "$profile" || fail "no AppArmor profile of ${program##*/}"
  ! command -v apparmor_parser >/dev/null || apparmor_parser -Q -K -S "$profile" >/dev/null 2>err || fail "$profile: $(cat err)"
done
version=$(sed -nE 's/^VERSION := (.*)/\1/p' "$root/Makefile")
grep -qE "^sst \($version\) " <(head -n 1 "$root/debian/changelog") || fail "debian/changelog: $(head -n 1 "$root/debian/changelog"); the Makefile has $version"
! command -v dpkg-parsechangelog >/dev/null || dpkg-parsechangelog -l "$root/debian/changelog" >out 2>err && [ ! -s err ] || fail "debian/changelog: $(cat err)"
exit $failed
