#!/usr/bin/env bash
# The committed openapi.json and status.md match the tables, and `sst status` names members of the status only.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
set -u
. "$(dirname "$0")/../lib.sh"
"$root/scripts/openapi.py" --build "${SST_BUILD:-build}" --check >out 2>&1 || fail "openapi.py: $(cat out)"
/usr/bin/python3 - "$root" >out 2>&1 <<'EOF' || fail "cli/status.txt: $(cat out)"
import json, re, sys
api = json.load(open(sys.argv[1] + "/daemon/web/openapi.json"))
text = open(sys.argv[1] + "/cli/status.txt", encoding="utf8").read()
schemas = api["components"]["schemas"]

def member(schema, path):
    for key in path.split("."):
        while "$ref" in schema or "items" in schema:
            schema = schemas[schema["$ref"].rsplit("/", 1)[1]] if "$ref" in schema else schema["items"]
        schema = schema if not key else schema["properties"][key]
    return schema

named = 0
for of, line in re.findall(r"^=== ?([a-z._]*)[^\n]*\n((?:(?!===).*\n)*)", text, re.M):
    for path in re.findall(r"[{\[]([a-z0-9_.]+)[}:?!+#=]", line):
        named += 1
        if path != "complete_percent":
            member(member(schemas["status"], of), path)
assert named > 80, named
EOF
[ "$failed" -eq 0 ] || exit 1
