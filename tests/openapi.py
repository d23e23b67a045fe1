#!/usr/bin/python3
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
"""openapi.py SOCKET: do the service's answers have exactly the members, of the types, that its openapi.json describes?
A member that is described as null, or that only some answers have (`role`), may be absent there. Prints what differs."""
import json
import subprocess
import sys
import time

TYPES = {"object": dict, "array": list, "string": str, "boolean": bool, "number": (int, float), "integer": int}
SOMETIMES = {"role", "name"}  # of TCP and the socket; of a start, not of a stop
wrong = []


def ask(path, body=None):
    more = [] if body is None else ["-H", "Content-Type: application/json", "-d", json.dumps(body)]
    return subprocess.run(["curl", "-s", "-m", "60", "--unix-socket", sys.argv[1], *more, "http://x" + path],
                          check=True, capture_output=True, text=True).stdout


def check(value, schema, where):
    while "$ref" in schema:
        name = schema["$ref"].rsplit("/", 1)[1]
        schema = api["components"]["schemas"][name]
    if value is None:
        if not schema.get("nullable"):
            wrong.append(f"{where} is null")
        return
    kind = schema.get("type")
    if kind and (not isinstance(value, TYPES[kind]) or (isinstance(value, bool) and kind != "boolean")):
        wrong.append(f"{where} is {value!r}, not of type {kind}")
    elif "enum" in schema and value not in schema["enum"]:
        wrong.append(f"{where} is {value!r}")
    elif kind == "array":
        for one in value:
            check(one, schema["items"], where + "[]")
    elif kind == "object" and "properties" in schema:
        for key in value.keys() - schema["properties"].keys():
            wrong.append(f"{where}.{key} is not described")
        for key in schema["properties"].keys() - value.keys() - SOMETIMES:
            wrong.append(f"{where}.{key} is missing")
        for key in value.keys() & schema["properties"].keys():
            check(value[key], schema["properties"][key], f"{where}.{key}")


def answer(path, body=None, route=None):
    operation = api["paths"][route or path]["get" if body is None else "post"]
    content = operation["responses"]["200"]["content"]
    end = time.monotonic() + 60
    text = ask(path, body)
    while "ask again" in text and time.monotonic() < end:  # it is busy with a set
        text = ask(path, body)
    for line in text.splitlines() if "application/x-ndjson" in content else [text]:
        if "error" in json.loads(line):
            wrong.append(f"{path} answers {line}")
            continue
        check(json.loads(line), next(iter(content.values()))["schema"], path)


api = json.loads(ask("/api/v1/openapi.json"))
ids = [operation.get("operationId") for path in api["paths"].values() for operation in path.values()]
if None in ids or len(set(ids)) < len(ids):
    wrong.append("operations have no name of their own, which generators of clients call them by")
for name in ("status", "cameras", "labels", "tracks", "visits", "events", "views", "recordings"):
    answer("/api/v1/" + name)
answer("/api/v1/views/main/pick?x=80&y=60", route="/api/v1/views/{id}/pick")
answer("/api/v1/views", {})
answer("/api/v1/views/main", {"focus_px": None}, "/api/v1/views/{id}")
answer("/api/v1/views/main/remove", {"clear": True}, "/api/v1/views/{id}/remove")
answer("/api/v1/reload", {"dry_run": True})
answer("/api/v1/snapshot", {})
answer("/api/v1/record", {"action": "start", "seconds": 1})
print("\n".join(sorted(set(wrong))))
sys.exit(bool(wrong))
