#!/usr/bin/env bash
# Boot a stock Debian kernel in an emulator and run tests/guest/*.sh in it, or those named: check.sh [NAME...].
# Prints a line per test; exit 0 only if none failed. Everything is kept in build/kernel/results/.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
set -eu
cd "$(dirname "$0")/../.."
out=build/kernel results=build/kernel/results
accel=${GUEST_ACCEL:-tcg,thread=multi}
limit=${GUEST_LIMIT:-1200}

missing=$(scripts/deps.sh --missing scripts/kernel/packages.txt)
[ -z "$missing" ] || { echo "check-kernel: missing packages: $missing; install them: make deps-kernel" >&2; exit 1; }
scripts/kernel/prepare.sh

# What the machine needs before it has the host's files: busybox, the modules on the way to them in the order of loading,
# and who is who. /lib is the host's but for the modules.
initramfs() {
  local root=$out/initramfs tree m l
  tree=$out/lib/modules/$(cat $out/release)
  rm -rf $root
  mkdir -p $root/{boot,dev,proc,sys,run,tmp,usr,repo,results,root,etc/alternatives,lib,var}
  cp "$(command -v busybox)" $root/boot/busybox
  cp scripts/kernel/init $root/init
  for m in virtio_pci 9pnet_virtio 9p; do
    awk -v "m=/$m.ko:" 'index($1, m) { sub(":", "", $1); for (i = NF; i > 0; i--) print $i }' "$tree/modules.dep"
  done | awk '!seen[$0]++' >$root/boot/paths
  while read -r m; do cp "$tree/$m" $root/boot/ && basename "$m"; done <$root/boot/paths >$root/boot/order
  cp -a /etc/{passwd,group,ld.so.cache,nsswitch.conf} $root/etc/
  cp -a /etc/alternatives/*.so* $root/etc/alternatives/ 2>/dev/null || true
  for l in /usr/lib/*; do [ "$l" = /usr/lib/modules ] || ln -s "$l" $root/lib/; done
  for l in /usr/lib?* /usr/bin /usr/sbin; do ln -s "$l" $root/; done
  (cd $root && find . | busybox cpio -o -H newc 2>/dev/null | gzip -1) >$out/initramfs.gz
  rm -rf $root
}

names=("$@")
[ ${#names[@]} -gt 0 ] || for t in tests/guest/*.sh; do
  [ "$t" = tests/guest/lib.sh ] || names+=("$(basename "$t" .sh)")
done
for n in "${names[@]}"; do
  [ -e "tests/guest/$n.sh" ] || { echo "check-kernel: no test tests/guest/$n.sh" >&2; exit 1; }
done
rm -rf $results
mkdir -p $results
printf '%s\n' "${names[@]}" >$results/tests
initramfs

share() { echo "-virtfs local,path=$1,mount_tag=$2,security_model=none,multidevs=remap,id=$2,readonly=$3"; }
start=$SECONDS rc=0
# shellcheck disable=SC2046
nice -n 10 timeout --foreground -k 10 "$limit" qemu-system-x86_64 -accel "$accel" -cpu max -smp 2 -m "${GUEST_MB:-3072}" \
  -display none -no-reboot -nic none -monitor none -serial file:$results/console.log -serial stdio \
  -kernel $out/vmlinuz -initrd $out/initramfs.gz -append "console=ttyS0 quiet panic=-1 oops=panic SST_BUILD=${SST_BUILD:-build} GUEST_DEADLINE=${GUEST_DEADLINE:-300}" \
  $(share /usr usr on) $(share "$PWD" repo on) $(share "$PWD/$results" results off) </dev/null || rc=$?

last_words() { grep -a -m 1 'Kernel panic' $results/console.log || tail -n 1 $results/console.log; }

passed=0 failed=0 skipped=0
for n in "${names[@]}"; do
  case $(cat "$results/$n.rc" 2>/dev/null) in
    0) passed=$((passed + 1));;
    77) skipped=$((skipped + 1));;
    '') failed=$((failed + 1)); echo "FAIL  $n: the machine ended before it (qemu exit $rc): $(last_words)";;
    *) failed=$((failed + 1));;
  esac
done
echo
echo "$passed passed, $failed failed, $skipped skipped in $((SECONDS - start)) s; logs in $results/"
[ "$failed" -eq 0 ]
