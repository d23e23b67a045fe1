#!/usr/bin/env bash
# Command in a throw-away copy of a root folder: all changes are gone afterwards; without a network but by --network.
#   enter.sh [--network] [--bind HOST:INSIDE]... ROOT COMMAND [ARGUMENT]...       needs root
# LAYERS: the folder of what is changed, beside the root otherwise; one in memory (/dev/shm) is faster.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
set -eu
network=--net
binds=()
while :; do
  case $1 in
  --network) network=; shift ;;
  --bind) binds+=("$2"); shift 2 ;;
  *) break ;;
  esac
done
root=$(realpath "$1")
shift
if [ "${ENTERED-}" != "$root" ]; then
  args=()
  [ -n "$network" ] || args+=(--network)
  for b in "${binds[@]}"; do args+=(--bind "$b"); done
  # shellcheck disable=SC2086
  ENTERED=$root exec unshare --mount --pid --fork --kill-child --ipc --uts $network -- "$0" "${args[@]}" "$root" "$@"
fi
unset ENTERED
layers=$(mktemp -d -p "${LAYERS:-$(dirname "$root")}" enter.XXXXXX)
# The mounts go with their namespace, the layer by hand: a trap of the process that waits.
trap 'cd /; umount -R -l "$layers/root" 2>/dev/null || true; rm -rf --one-file-system "$layers"' EXIT
mkdir "$layers/upper" "$layers/work" "$layers/root"
mount -t overlay overlay -o "lowerdir=$root,upperdir=$layers/upper,workdir=$layers/work" "$layers/root"
in=$layers/root
mount -t proc proc "$in/proc"
mount -t sysfs sysfs "$in/sys" 2>/dev/null || mount --bind /sys "$in/sys"
mount -t tmpfs -o mode=755 tmpfs "$in/dev"
for d in null zero full random urandom tty; do
  touch "$in/dev/$d"
  mount --bind "/dev/$d" "$in/dev/$d"
done
mkdir "$in/dev/shm" "$in/dev/pts"
mount -t tmpfs -o mode=1777 tmpfs "$in/dev/shm"
mount -t devpts -o newinstance,ptmxmode=0666,mode=620 devpts "$in/dev/pts"
ln -s pts/ptmx "$in/dev/ptmx"
ln -s /proc/self/fd "$in/dev/fd"
for n in 0:stdin 1:stdout 2:stderr; do ln -s "/proc/self/fd/${n%:*}" "$in/dev/${n#*:}"; done
for b in "${binds[@]}"; do
  mkdir -p "$in${b#*:}"
  mount --bind "${b%%:*}" "$in${b#*:}"
done
[ -n "$network" ] && ip link set lo up 2>/dev/null || true
[ -n "$network" ] || cp -L /etc/resolv.conf "$in/etc/resolv.conf" 2>/dev/null || true
rc=0
env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME=/root LC_ALL=C.UTF-8 TERM=dumb DEBIAN_FRONTEND=noninteractive \
  chroot "$in" "$@" || rc=$?
exit $rc
