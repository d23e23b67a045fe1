#!/usr/bin/env bash
# embed.sh TABLE HEADER FILE... : C source of a table that HEADER declares, with the names and bytes of these files in it.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
set -eu
table=$1 header=$2
shift 2
echo "#include \"$header\""
n=0
for f in "$@"; do
  case $f in *[!A-Za-z0-9_./-]*) echo "error: $f: rename it to letters, digits, _ . -" >&2; exit 1;; esac
  # The assembler reads the file: no size limit, no conversion.
  echo "__asm__(\".section .rodata\\n.balign 4\\n$table$n: .incbin \\\"$f\\\"\\n$table${n}_end: .byte 0\\n.previous\");"
  echo "extern const uint8_t $table$n[], $table${n}_end[];"
  n=$((n + 1))
done
echo "const struct ${table%s} $table[] = {"
n=0
for f in "$@"; do
  echo "    { \"${f##*/}\", $table$n, $table${n}_end },"
  n=$((n + 1))
done
echo '    { NULL, NULL, NULL },'
echo '};'
