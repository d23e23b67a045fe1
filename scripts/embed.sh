#!/usr/bin/env bash
# embed.sh FILE... : C source of the table web_files (daemon/publish/publish_internal.h) with these files' bytes in it.
set -eu
echo '#include "daemon/publish/publish_internal.h"'
n=0
for f in "$@"; do
  case $f in *[!A-Za-z0-9_./-]*) echo "error: $f: rename it to letters, digits, _ . -" >&2; exit 1;; esac
  # The assembler reads the file: no size limit, no conversion.
  echo "__asm__(\".section .rodata\\nweb$n: .incbin \\\"$f\\\"\\nweb${n}_end: .byte 0\\n.previous\");"
  echo "extern const uint8_t web$n[], web${n}_end[];"
  n=$((n + 1))
done
echo 'const struct web_file web_files[] = {'
n=0
for f in "$@"; do
  echo "    { \"${f##*/}\", web$n, web${n}_end },"
  n=$((n + 1))
done
echo '    { NULL, NULL, NULL },'
echo '};'
