#!/usr/bin/env bash
# The public headers as a Markdown list, one line each: what its first comment says after "path - ". api_index.sh
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
set -eu
cd "$(dirname "$0")/.."
for folder in base config drivers capture pipeline daemon client publishers cli simulators; do
  [ -d "$folder" ] || continue
  echo; echo "## $folder"; echo
  find "$folder" -name '*.h' ! -name '*_internal.h' ! -name '*_tmpl.h' ! -name templates.h | sort | while read -r header; do
    awk -v header="$header" '
      NR == 1 { text = $0; sub(/^.*\.h - /, "", text) }
      NR > 1 { sub(/^ \*\/?/, ""); text = text $0 }
      text ~ /\.( |$)/ || text ~ /\*\// || NR == 6 {
        sub(/^.*\.h - /, "", text); sub(/ *\*\/.*/, "", text); sub(/\. .*/, ".", text)
        print "- `" header "`: " text; exit
      }' "$header"
  done
done
