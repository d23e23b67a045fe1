#!/usr/bin/env python3
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
"""Run notebooks without Jupyter: code cells one after the other, in a folder that goes at the end.

run.py [--lines N] [--check EXPRESSION] NOTEBOOK.ipynb

--lines    fail where the code has more lines than N, blank ones and comments left out
--check    an expression of the notebook's variables that must be true at the end
--list     print the code instead

A notebook with stored outputs fails: they belong into nobody's history.
"""
import argparse
import json
import os
import shutil
import sys
import tempfile


def cells(path):
    with open(path, encoding="utf-8") as f:
        notebook = json.load(f)
    code = [c for c in notebook["cells"] if c["cell_type"] == "code"]
    if notebook["nbformat"] != 4 or not code:
        sys.exit(f"{path} is no notebook of version 4 with code")
    if any(c["outputs"] or c["execution_count"] is not None for c in code):
        sys.exit(f"{path} has stored outputs; strip them")
    return ["".join(c["source"]) for c in code]


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--lines", type=int)
    parser.add_argument("--check")
    parser.add_argument("--list", action="store_true")
    parser.add_argument("notebook")
    args = parser.parse_args()
    code = cells(args.notebook)
    if args.list:
        print("\n".join(code))
        return
    lines = sum(bool(line.strip()) and not line.strip().startswith("#") for text in code for line in text.split("\n"))
    if args.lines and lines > args.lines:
        sys.exit(f"{args.notebook}: {lines} lines of code, more than {args.lines}")
    here = os.path.dirname(os.path.abspath(args.notebook))
    name = os.path.abspath(args.notebook)
    folder = tempfile.mkdtemp(prefix="sst-notebook-")
    try:
        for file in os.listdir(here):
            if file.endswith(".yaml"):
                shutil.copy(os.path.join(here, file), folder)
        os.chdir(folder)
        space = {"__name__": "__main__"}
        for n, text in enumerate(code, 1):
            exec(compile(text, f"{name}[{n}]", "exec"), space)  # noqa: S102
        if args.check and not eval(args.check, space):  # noqa: S307
            sys.exit(f"{args.notebook}: not {args.check}")
        print(f"{os.path.basename(args.notebook)}: {len(code)} cells, {lines} lines of code")
    finally:
        shutil.rmtree(folder, ignore_errors=True)


main()
