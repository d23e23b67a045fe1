#!/usr/bin/env python3
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
"""Write daemon/web/openapi.json and docs/integrate/status.md from the tables of fields and routes, and from the
hand-written part daemon/publish/openapi.in.json.

`make man` runs it. With --check nothing is written: exit 1 if a file is not what it would be.

A schema in openapi.in.json is a text "type: description", an object of its members, or {"$is": "type: description",
"minimum": 0 ...}. Types: string, number, integer, boolean, object, array, time, binary, "@schema", "[of]"; with "?" it
may be null. "$required", "$closed", "$help" are about the object itself. Operations have "id", "path", "query",
"header" (with "!" required), "body" or "body?", "form", "says" (of the answer 200), "answer" or "content", "more"
answers, "errors", and "like" for the part that several share."""
import argparse
import json
import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
TYPES = {"bool": "boolean", "integer": "integer", "real": "number", "text": "string", "name": "string",
         "time": "string", "choice": "string", "spread": "object", "object": "object", "pointer": "object",
         "map": "object", "list": "array", "json": "object"}
BODIES = {"body": "application/json", "body?": "application/json", "form": "application/x-www-form-urlencoded"}
SPREAD = ("p50", "p99", "max")


# --- schemas of the hand-written part ---------------------------------------------------------------------------------

def typed(text):
    name, _, nullable = text.partition("?") if text.endswith("?") else (text, "", None)
    if name.startswith("@"):
        out = {"$ref": "#/components/schemas/" + name[1:]}
        return out if nullable is None else {"nullable": True, "allOf": [out]}
    if name.startswith("["):
        out = {"type": "array", "items": typed(name[1:-1])}
    elif name in ("time", "binary"):
        out = {"type": "string", "format": {"time": "date-time"}.get(name, name)}
    else:
        out = {"type": name}
    return out if nullable is None else {**out, "nullable": True}


def schema(short):
    if isinstance(short, str):
        kind, _, help_ = short.partition(": ")
        return {**typed(kind), **({"description": help_} if help_ else {})}
    if "$is" in short:
        more = {k: schema(v) if k == "items" else v for k, v in short.items() if k != "$is"}
        return {**schema(short["$is"]), **more}
    out = {"type": "object"}
    for key, name in (("$help", "description"), ("$required", "required")):
        if key in short:
            out[name] = short[key]
    if "$closed" in short:
        out["additionalProperties"] = False
    out["properties"] = {k: schema(v) for k, v in short.items() if k[0] != "$"}
    return out


# --- schemas of fields ------------------------------------------------------------------------------------------------

def members(rows):
    """Members of an object, by the rows of its table."""
    out = {}
    for row in rows:
        key, described = row["key"], row["key"] is not None and field(row)
        if described and key and key in out:  # of another role
            out[key]["properties"] = {**described["properties"], **out[key]["properties"]}
        elif described and key:
            out[key] = described
        elif described:
            out.update(described["properties"])
    return out


def element(row):
    if row["item"]:
        return field({**row, "type": row["item"], "item": "", "help": None, "names": [],
                      "nullable": row["nullable"] and row["type"] == "map"})
    return {"type": "object", "properties": members(row["of"])}


def field(row):
    kind = row["type"]
    out = {"type": TYPES[kind]}
    if row["nullable"] and kind not in ("spread", "map"):
        out["nullable"] = True
    if row["help"]:
        out["description"] = row["help"]
    if kind == "time" and "\"\"" not in (row["help"] or ""):
        out["format"] = "date-time"
    if row["names"] and kind != "map":
        out["enum"] = row["names"]
    if kind == "spread":
        out["properties"] = {k: {"type": "number", **({"nullable": True} if row["nullable"] else {})} for k in SPREAD}
    elif kind == "map":
        out["properties"] = {name: element(row) for name in row["names"]}
    elif kind == "list":
        out["items"] = element(row)
        if row["count"]:
            out["minItems"] = out["maxItems"] = row["count"]
    elif row["of"]:
        out["properties"] = members(row["of"])
    return out


# --- openapi.json -----------------------------------------------------------------------------------------------------

def dump(value, depth=0, key=""):
    """JSON, on one line where it fits."""
    text = key + json.dumps(value, ensure_ascii=False)
    if not value or not isinstance(value, (dict, list)) or depth + len(text) < 120:
        return text
    items = [dump(v, depth + 1, json.dumps(k) + ": ") for k, v in value.items()] if isinstance(value, dict) else \
        [dump(v, depth + 1) for v in value]
    inside = ",\n".join(" " * (depth + 1) + item for item in items)
    return f"{key}{text[len(key)]}\n{inside}\n{' ' * depth}{text[-1]}"


def answer(more):
    more = {"says": more} if isinstance(more, str) else more
    out = {"description": more["says"]}
    if "headers" in more:
        out["headers"] = {name: {"schema": schema(s)} for name, s in more["headers"].items()}
    if "content" in more:
        out["content"] = {kind: {"schema": schema(s)} for kind, s in more["content"].items()}
    return out


def parameters(where, params):
    for name, short in params.items():
        one = schema(short)
        help_ = one.pop("description", None)
        yield {"name": name.rstrip("!"), "in": where, "required": where == "path" or name.endswith("!"), "schema": one,
               **({"description": help_} if help_ else {})}


def operation(route, op, like):
    op = {**like.get(op.get("like"), {}), **op}
    out = {"operationId": op["id"], "summary": route["what"], "x-role": route["role"]}
    params = [p for where in ("path", "query", "header") for p in parameters(where, op.get(where, {}))]
    if params:
        out["parameters"] = params
    for key, kind in BODIES.items():
        if key in op:
            out["requestBody"] = {"required": key != "body?", "content": {kind: {"schema": schema(op[key])}}}
    answers = dict(op.get("more", {}))
    if "answer" in op or "content" in op:
        answers["200"] = {"says": op.get("says", "Done"),
                          "content": op.get("content") or {"application/json": op["answer"]}}
    errors = set(op.get("errors", [])) | ({413, 415} if route["method"] == "POST" else set())
    errors |= set() if route["role"] == "anyone" else {401, 403}
    errors |= {400} if route["path"].startswith("/api/") else set()  # an unknown parameter
    out["responses"] = {code: answer(answers[code]) for code in sorted(answers)}
    out["responses"].update({str(code): {"$ref": "#/components/responses/error"} for code in sorted(errors)})
    if route["role"] == "anyone":
        out["security"] = []
    return out


def openapi(tables, source):
    operations, paths = dict(source["operations"]), {}
    for route in tables["routes"]:
        op = operations.pop(f"{route['method']} {route['path']}", None)
        if op is None:
            sys.exit(f"error: openapi.in.json lacks {route['method']} {route['path']}")
        described = {name.rstrip("!") for name in {**source["like"].get(op.get("like"), {}), **op}.get("query", {})}
        if route["path"].startswith("/api/") and described != set(route["query"]):
            sys.exit(f"error: {route['method']} {route['path']}: parameters {described} in openapi.in.json, "
                     f"{set(route['query'])} in the table of routes")
        paths.setdefault(route["path"], {})[route["method"].lower()] = operation(route, op, source["like"])
    if operations:
        sys.exit(f"error: no route: {', '.join(operations)}")
    schemas = {name: schema(s) for name, s in source["schemas"].items()}
    for name in ("status", "cameras"):
        ours = schemas.pop(name, {"type": "object", "properties": {}})
        schemas[name] = {**ours, "properties": {**members(tables[name]), **ours["properties"]}}
    schemas["live"] = schemas["status"]["properties"]["live"]
    schemas["status"]["properties"]["live"] = {"$ref": "#/components/schemas/live"}
    doc = {"openapi": "3.0.3", "info": source["info"], "servers": source["servers"], "security": source["security"],
           "paths": paths, "components": {**source["components"], "schemas": schemas}}
    return dump(doc) + "\n"


# --- status.md --------------------------------------------------------------------------------------------------------

def kind_of(row):
    kind = row["type"]
    if kind == "spread":
        return "`p50`, `p99`, `max`"
    if kind == "map":
        each = "each `p50`, `p99`, `max`: " if row["item"] == "spread" else "each: "
        return each + ", ".join(f"`{n}`" for n in row["names"])
    if row["names"]:
        return ", ".join(f'`{n or chr(34) * 2}`' for n in row["names"])
    return {"text": "text", "name": "text", "real": "number", "integer": "whole number", "bool": "true or false",
            "json": "object", "pointer": "object"}.get(kind, kind) + (" or null" if row["nullable"] else "")


def lines(rows, path="", labels=()):
    for row in rows:
        key, own = row["key"], [*labels, *([row["label"]] if row["label"] else [])]
        at = f"{path}.{key}".strip(".") if key else path
        metric = row["metric"] and f"`sst_{row['metric']}" + (f"{{{','.join(own)}}}" if own else "") + "`"
        if key is None:
            yield f"| | | {row['help']} | {metric} |"
        else:
            yield f"| `{at}` | {kind_of(row)} | {row['help']} | {metric or ''} |"
        if row["of"]:
            yield from lines(row["of"], at + {"list": "[]", "map": ".*"}.get(row["type"], ""), own)


def table(rows):
    """Each member once, also where hosts of two roles have it."""
    once = {}
    for line in lines(rows):
        once.setdefault(line if line.startswith("| | |") else tuple(line.split("|")[1:3]), line)
    return ["| member | | | metric |", "|---|---|---|---|", *once.values()]


def page(tables):
    out = ["# Status, cameras, metrics", "",
           "Made by `make man` from the tables in `daemon/service/` and `daemon/storage/status.c`. Names end in their",
           "units; metrics have base units (seconds, bytes). A metric without a member is in `/metrics` alone. `[]` is each",
           "element of a list, `*` each member.",
           "",
           "## `GET /api/v1/status`, `GET /metrics`", "", *table(tables["status"]), "",
           "## `GET /api/v1/cameras`", "", *table(tables["cameras"])]
    return "\n".join(out) + "\n"


def main():
    args = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    args.add_argument("--build", default="build")
    args.add_argument("--check", action="store_true")
    args = args.parse_args()
    tables = json.loads(subprocess.run([ROOT / args.build / "api_tables"], check=True, capture_output=True).stdout)
    source = json.loads((ROOT / "daemon/publish/openapi.in.json").read_text(encoding="utf8"))
    stale = False
    for name, text in (("daemon/web/openapi.json", openapi(tables, source)),
                       ("docs/integrate/status.md", page(tables))):
        path = ROOT / name
        if args.check and (not path.exists() or path.read_text(encoding="utf8") != text):
            print(f"{name} is not what the tables give: run make man")
            stale = True
        elif not args.check:
            path.write_text(text, encoding="utf8")
    sys.exit(stale)


main()
