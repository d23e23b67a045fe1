#!/usr/bin/python3
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
"""Updates models/manifest.json: sizes and hashes of the listed files, and the figures given on the command line.

  models/manifest.py                                   sizes and hashes after a file has changed
  models/manifest.py pspnet-small.onnx miou_camvid_val=47.8 ms_480x360_1_thread=65
  models/manifest.py pspnet-small.onnx --figures bench.json   numbers of a JSON object; nested names are joined by _
  models/manifest.py new.onnx --new --kind labels --licence TEXT --data TEXT --description TEXT
  models/manifest.py --check                           exit 1 if a file differs from the listed one
"""
import argparse
import hashlib
import json
import math
import os
import sys

MANIFEST = "manifest.json"


def load(folder: str) -> dict:
    with open(os.path.join(folder, MANIFEST), encoding="utf-8") as f:
        return json.load(f)


def save(folder: str, manifest: dict) -> None:
    """Replace the file atomically."""
    path = os.path.join(folder, MANIFEST)
    with open(path + ".tmp", "w", encoding="utf-8") as f:
        json.dump(manifest, f, indent=2, ensure_ascii=False)
        f.write("\n")
    os.replace(path + ".tmp", path)


def measure(path: str) -> dict:
    with open(path, "rb") as f:
        data = f.read()
    return {"bytes": len(data), "sha256": hashlib.sha256(data).hexdigest()}


def renew(path: str) -> None:
    """Size and hash of one network, if a manifest beside it lists it. For the scripts that write networks."""
    folder, file = os.path.split(os.path.abspath(path))
    if not os.path.exists(os.path.join(folder, MANIFEST)):
        return
    manifest = load(folder)
    for entry in manifest["models"]:
        if entry["file"] == file:
            entry.update(measure(path))
            save(folder, manifest)


def flatten(value, name: str = "") -> dict[str, float]:
    """Numbers of nested objects: {"a": {"b": 1}} -> {"a_b": 1}."""
    if isinstance(value, dict):
        found = {}
        for key, inner in value.items():
            found.update(flatten(inner, f"{name}_{key}" if name else key))
        return found
    number = isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)
    return {name: value} if number else {}


def change(manifest: dict, args) -> None:
    entry = next((e for e in manifest["models"] if e["file"] == args.file), None)
    if entry is None and not args.new:
        sys.exit(f"{MANIFEST} does not list {args.file}; --new adds it")
    if entry is None:
        entry = {"file": args.file, "kind": "labels", "description": "", "bytes": 0, "sha256": "", "licence": "",
                 "training_data": "", "figures": {}}
        manifest["models"].append(entry)
    given = {"kind": args.kind, "licence": args.licence, "training_data": args.data, "description": args.description}
    entry.update({key: value for key, value in given.items() if value})
    if args.figures:
        with open(args.figures, encoding="utf-8") as f:
            entry["figures"].update(flatten(json.load(f)))
    for text in args.figure:
        name, _, value = text.partition("=")
        entry["figures"][name] = float(value) if "." in value else int(value)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("file", nargs="?", help="a listed network")
    parser.add_argument("figure", nargs="*", default=[], help="NAME=NUMBER")
    parser.add_argument("--folder", default=os.path.dirname(os.path.abspath(__file__)))
    parser.add_argument("--figures", help="JSON file with numbers")
    parser.add_argument("--new", action="store_true")
    parser.add_argument("--kind", choices=["labels", "matching"])
    for name in "licence", "data", "description":
        parser.add_argument("--" + name)
    parser.add_argument("--check", action="store_true")
    args = parser.parse_args()
    manifest = load(args.folder)
    wrong = [e["file"] for e in manifest["models"]
             if measure(os.path.join(args.folder, e["file"])) != {k: e[k] for k in ("bytes", "sha256")}]
    if args.check:
        sys.exit(f"{MANIFEST} lists other files than these: {', '.join(wrong)}; run models/manifest.py" if wrong else 0)
    if args.file:
        change(manifest, args)
    for entry in manifest["models"]:
        entry.update(measure(os.path.join(args.folder, entry["file"])))
    save(args.folder, manifest)


if __name__ == "__main__":
    main()
