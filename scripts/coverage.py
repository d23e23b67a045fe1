#!/usr/bin/env python3
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
"""coverage.py BUILD: statements and branches that were run, by folder, from gcov's data of a build with --coverage."""
import collections
import json
import os
import subprocess
import sys


def main():
    build = sys.argv[1]
    objects = [os.path.join(d, f) for d, _, files in os.walk(build + "/obj") for f in files
               if f.endswith(".gcno") and not d.startswith((build + "/obj/tests", build + "/obj/scripts"))]
    lines, branches = collections.defaultdict(dict), collections.defaultdict(dict)
    for i in range(0, len(objects), 50):
        out = subprocess.run(["gcov", "--json-format", "--stdout", "--branch-probabilities", *objects[i:i + 50]],
                             stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, check=True).stdout
        for document in out.splitlines():
            for f in json.loads(document)["files"]:
                name = f["file"]
                if name.startswith(("/", "tests/", build)):
                    continue
                for line in f["lines"]:
                    number = line["line_number"]
                    lines[name][number] = max(lines[name].get(number, 0), line["count"])
                    for k, branch in enumerate(line["branches"]):
                        key = number, k
                        branches[name][key] = max(branches[name].get(key, 0), branch["count"])
    folders = collections.defaultdict(lambda: [0, 0, 0, 0])
    for name in lines:
        for folder in (os.path.dirname(name), "all"):
            sums = folders[folder]
            sums[0] += sum(n > 0 for n in lines[name].values())
            sums[1] += len(lines[name])
            sums[2] += sum(n > 0 for n in branches[name].values())
            sums[3] += len(branches[name])
    print(f"{'folder':40} statements      branches")
    for folder, (ls, ln, bs, bn) in sorted(folders.items()):
        low = "  below 85 %" if ls < 0.85 * ln else ""
        print(f"{folder:40} {100 * ls / max(ln, 1):5.1f} % of {ln:5}  {100 * bs / max(bn, 1):5.1f} %{low}")


main()
