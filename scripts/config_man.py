#!/usr/bin/env python3
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
"""Write docs/man/sstd.yaml.5 from the table of keys, which api_tables prints, their texts in docs/man/keys.txt, and
docs/man/sstd.yaml.5.in.

`make man` runs it. With --check nothing is written: exit 1 if the page is not what it would be."""
import argparse
import json
import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
UNITS = {"_hz": "Hz", "_ms": "ms", "_us": "us", "_mm_s": "mm/s", "_mm_s2": "mm/s2", "_mm": "mm", "_um": "um", "_s": "seconds",
         "_gb": "GB", "_mb": "MB", "_px": "px", "_days": "days", "_m": "m", "_min": "minutes"}
# By the values of enum sst_text_kind, enum sst_key_type and enum sst_reload_class.
TEXT_KINDS = ["text", "text of a-z, 0-9, - and _", "path", "path of a file", "numeric address", "topic",
              "type of an event or \"*\"", "points of a polygon", "address of a page", "rows x columns"]
BOOL, INT, DOUBLE, TEXT, CHOICE, FORMAT, INTS, DOUBLES, TEXTS, CONTROLS, LIST, LINE, ZONE = range(13)
PLAIN = {BOOL: "true or false", TEXTS: "list of texts", CONTROLS: "mapping of names to whole numbers", LIST: "list of mappings",
         LINE: "name of a trigger line", ZONE: "name of a zone"}
RELOAD = ["applies at once", "restarts capturing", "needs a restart", "restarts the live picture"]


def roff(text):
    for character, escaped in ("\\", "\\e"), ("\"", "\\(dq"), ("-", "\\-"), ("'", "\\(aq"):
        text = text.replace(character, escaped)
    return text


def kind(key):
    limits = f"{key['min']:g}..{key['max']:g}"
    names = key["names"]
    text = {INT: f"whole number, {key['min']:.0f}..{key['max']:.0f}", DOUBLE: f"number, {limits}",
            INTS: f"whole number or list, {limits}", DOUBLES: f"number or list, {limits}", TEXT: TEXT_KINDS[key["kind"]],
            CHOICE: ", ".join(names[:-1]) + f" or {names[-1]}" if names else ""}
    text[FORMAT] = text[CHOICE]
    unit = [u for u in UNITS if key["name"].endswith(u)]
    return (text | PLAIN)[key["type"]] + (f", or {key['word']}" if key["word"] else "") + \
        (f"; {UNITS[max(unit, key=len)]}" if unit else "")


def entry(key, name, texts):
    """A key, and the keys of its elements. @param name  as in keys.txt; a text that is used leaves `texts`"""
    notes = kind(key) + ("; must be given" if key["standard"] is None else "; default " + (key["standard"] or '""'))
    if "[]" not in name and key["section"] not in ("rig", "still"):
        notes += f"; {RELOAD[key['reload']]}" + ("; set for the first time or removed: needs a restart" if key["switches"] else "")
    text = texts.pop(name) + "."
    if not re.match("[^ :]*:", text):  # a value that is explained stays
        text = text[:1].upper() + text[1:]
    out = [".TP", f".B {roff(key['name'])}", f"({roff(notes)})", ".br", "\\&" + roff(text)]
    if key["fields"]:
        out += ["Keys of each:", ".RS"] + sum((entry(k, f"{name}[].{k['name']}", texts) for k in key["fields"]), []) + [".RE"]
    return out


def page(tables):
    lines = (ROOT / "docs/man/keys.txt").read_text(encoding="utf8").splitlines()
    texts = dict(line.split(": ", 1) for line in lines if line)
    out, last = [], None
    for key in tables["keys"]:
        section = key["section"] or key["name"]
        if section != last:
            out += [f".SS {section}"] + ([roff(texts.pop(f"{section}."))] if key["section"] else [])
            last = section
        out += entry(key, f"{key['section']}.{key['name']}".lstrip("."), texts)
    if texts:
        sys.exit(f"docs/man/keys.txt has texts of keys that are not in the table: {', '.join(texts)}")
    text = (ROOT / "docs/man/sstd.yaml.5.in").read_text(encoding="utf8").replace("@VERSION@", tables["version"])
    text = text.replace("@KEYS@", "\n".join(out)).replace("@EVENTS@", ",\n".join(map(roff, tables["events"])) + ".")
    return ".\\\" Made by make man from config/schema.c and docs/man/keys.txt.\n" + text


def main():
    args = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    args.add_argument("--build", default="build")
    args.add_argument("--check", action="store_true")
    args = args.parse_args()
    text = page(json.loads(subprocess.run([ROOT / args.build / "api_tables"], check=True, capture_output=True).stdout))
    path = ROOT / "docs/man/sstd.yaml.5"
    if args.check and path.read_text(encoding="utf8") != text:
        sys.exit("docs/man/sstd.yaml.5 is not what the table gives: run make man")
    if not args.check:
        path.write_text(text, encoding="utf8")


main()
