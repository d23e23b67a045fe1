#!/usr/bin/env bash
# check.sh: build all programs for arm64 with warnings as errors, and run the tests of kernels in an emulator: on a CPU that
# has every level, and on one without byte dot products. Without the cross compiler, libraries or emulator it is a skip.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
set -eu
cd "$(dirname "$0")/../.."
skip() {
  echo "skip  arm64: $1"
  echo
  echo "0 passed, 0 failed, 1 skipped"
  exit 0
}
scripts/deps.sh scripts/arm64/packages.txt || skip "its compiler and emulator cannot be installed"
scripts/arm64/sysroot.sh build-arm64/sysroot || skip "its libraries cannot be unpacked"
# Kernels run here, as they are installed; the rest is compiled and linked alone, half as long with -O0 and without what hardens a
# program; gcc guesses worse there what a string can hold. Packages are built with both.
make ARCH=arm64 WERROR=1 OPT='-O0 -g0' HARDEN= KERNEL_OPT='-O3 -g0' CFLAGS='-Wno-format-truncation -Wno-maybe-uninitialized' \
  -j"$(nproc)" all kernel-tests
rc=0
run() {
  local cpu=$1
  shift
  echo "arm64, qemu-aarch64 -cpu $cpu:"
  SST_TEST_SMALL=1 SST_RUNNER="qemu-aarch64 -cpu $cpu -L $PWD/build-arm64/sysroot" scripts/run_tests.sh "$@" || rc=1
}
# The emulator signs pointers with a hash of its own: the architecture's hash takes three quarters of the time.
run max,pauth-impdef=on build-arm64/tests/kernels/*
# bounds measures the references, which are the same code on both.
run cortex-a53 $(ls -d build-arm64/tests/kernels/* | grep -v /bounds)
exit $rc
