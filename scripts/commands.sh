#!/usr/bin/env bash
# commands.sh FILE : C source of cli_manuals[] (cli/cli_internal.h) from a file with "=== NAME" and the lines of its
# summary for each command, then "--- usage", "--- detail" where there is more to say, and "--- example".
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
set -eu
echo '#include "cli/cli_internal.h"'
echo 'const struct cli_manual cli_manuals[] = {'
awk '
  function flush() {
    sub(/\n+$/, "", text)
    gsub(/[\\"]/, "\\\\&", text)
    gsub(/\n/, part == "example" ? "\\n  " : "\\n", text)
    if (part) printf "      .%s = \"%s\",\n", part, text
    text = ""
  }
  /^#/ { next }
  /^=== / { flush(); printf "%s    { .name = \"%s\",\n", part ? "    },\n" : "", substr($0, 5); part = "summary"; next }
  /^--- / { flush(); part = substr($0, 5); next }
  { text = text == "" ? $0 : text "\n" $0 }
  END { flush(); print "    },\n    { NULL },\n};" }
' "$1"
