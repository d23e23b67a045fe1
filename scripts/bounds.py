#!/usr/bin/python3
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
"""Write docs/measured/bounds.md: run the tests that hold kernels and formulas to their bounds, and list the largest errors."""
import argparse
import os
import pathlib
import platform
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent
TESTS = ["kernels/bounds", "unit/bounds", "unit/degenerate"]
HEAD = """# Bounds

Made by `make bounds` on {machine}. Do not edit: the next run overwrites this page.

Largest errors and their bounds. References are the formulas of [design.md](../design/design.md) in wider numbers
(`tests/reference/`: 64 bits of mantissa, 113 where sums cancel). Every level of every kernel gives the bytes of its plain reference
(`tests/kernels/`), so one line stands for all. `make check` fails where a bound is exceeded, with floating-point exceptions
(invalid, division by zero, overflow) ending the program (`tests/traps.h`).

Exact kernels on whole numbers, each with its largest value and the limit of its type: {exact}.

| kernel or formula | precision | bound | from | worst seen | cases | caused by |
| --- | --- | --: | --- | --: | --: | --- |
"""
CASES = """
## Degenerate inputs

Inputs without an answer of their own, and their result (`tests/unit/degenerate.c` fails where it differs).

| input | result |
| --- | --- |
"""
CHAINS = """
## Random chains

`make soak-chain HOURS=1` draws random grids, pictures, faults of views, displaced and darkened pictures, labels, disparities and settings,
runs alignment, processing and three pictures on each, and compares the bytes by threads, pixels with the sums in double, and all results with
their ranges; no NaN may cross a module's border (`tests/tools/chain.c`). A failure prints the seed that repeats it.
"""


def cell(text):
    return text.replace("|", "\\|")


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--build", default="build")
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as tmp:
        files = {name: pathlib.Path(tmp, name) for name in ("SST_BOUNDS", "SST_BOUNDS_CASES")}
        for test in TESTS:
            run = subprocess.run([f"{args.build}/tests/{test}"], cwd=ROOT, capture_output=True, text=True,
                                 env={**os.environ, **{name: str(path) for name, path in files.items()}})
            if run.returncode:
                sys.exit(f"{test} failed:\n{run.stdout}{run.stderr}")
        bounds = [line.split("\t") for line in files["SST_BOUNDS"].read_text().splitlines()]
        cases = [line.split("\t") for line in files["SST_BOUNDS_CASES"].read_text().splitlines()]
    exact = [row for row in bounds if row[2].startswith("0 error")]
    page = HEAD.format(machine=platform.machine(),
                       exact=", ".join(f"`{row[0]}` {row[6].removeprefix('largest value ')}" for row in exact))
    for name, precision, bound, why, worst, count, cause in (row for row in bounds if row not in exact):
        page += f"| {cell(name)} | {precision} | {bound} | {cell(why)} | {worst} | {count} | {cell(cause)} |\n"
    page += CASES + "".join(f"| {cell(what)} | {cell(result)} |\n" for what, result in cases) + CHAINS
    out = ROOT / "docs/measured/bounds.md"
    soak = ROOT / "docs/measured/soak-chain.txt"
    if soak.exists():
        page += "\nThe last long run:\n\n```\n" + soak.read_text() + "```\n"
    out.write_text(page)
    print(f"{out.relative_to(ROOT)}: {len(bounds)} bounds, {len(cases)} degenerate inputs")


if __name__ == "__main__":
    main()
