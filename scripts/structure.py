#!/usr/bin/env python3
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
"""Count what makes code hard to read, in the C sources without tests, and guard limits. Part of `make check-names`.

structure.py [--list] [FOLDER...]

parameters  functions with more than 5 parameters, by their definitions; function types and variants of a kernel, which a macro names, do
            not count
lines       functions over 80 lines, from the line with their name to the closing brace
headers     headers over 500 lines
circles     circles of more than 8 files in a folder: a file uses each file of its folder that defines a function it calls or passes, or a
            structure, union, enumeration or function type it names; files that reach each other are a circle (strongly connected)

A limit is the number that is true now: a change that lowers the number lowers the limit. --list prints each place, FOLDER restricts to it;
without FOLDER the exit status is 1 above a limit.
"""
import argparse
import os
import re
import sys

ROOTS = "base capture cli client config daemon drivers pipeline publishers read simulators".split()
PARAMETERS, LINES, HEADER, CIRCLE = 5, 80, 500, 8
LIMITS = {"parameters": 97, "lines": 0, "headers": 1, "circles": 0}
TOKEN = re.compile(r'"(?:\\.|[^"\\\n])*"|\'(?:\\.|[^\'\\\n])*\'|//[^\n]*|/\*.*?\*/', re.S)
DIRECTIVE = re.compile(r"^[ \t]*#(?:[^\n]*\\\n)*[^\n]*", re.M)
PROTOTYPE = re.compile(r"^[A-Za-z][\w *]*?(\w+)\([^{};]*\)[^;{}]*;", re.M)
TYPE = re.compile(r"^((?:struct|union|enum) \w+)\s*\{|^typedef\b[^;{}]*?(\w+)\s*\([^;]*\);", re.M)
USE = re.compile(r"(?<![.>\w])([a-z]\w*)\s*\(|\b((?:struct|union|enum) \w+)|\b(\w+_fn)\b")
ADDRESS = re.compile(r"[({,=&?:]\s*([a-z]\w*)\s*(?=[,;)}])")
VARIABLE = re.compile(r"\w[ *]+([a-z]\w*)\s*[,;=)\[:]")


def blank(m):
    return "".join(c if c == "\n" else " " for c in m[0]) if m[0][0] == "/" else m[0][0] * 2 + "\n" * m[0].count("\n")


def opening(text, end):
    """Index of the parenthesis that text[end] closes, -1 without one."""
    depth = 0
    for k in range(end, -1, -1):
        depth += (text[k] == ")") - (text[k] == "(")
        if depth == 0:
            return k
    return -1


def parameters(text):
    if text.strip() in ("", "void"):
        return 0
    depth = commas = 0
    for c in text:
        depth += (c in "([{") - (c in ")]}")
        commas += c == "," and depth == 0
    return commas + 1


def functions(code):
    """(name, static, parameters, line, lines) of each function that is defined at the left margin."""
    for m in re.finditer(r"\)\s*\n\{", code):
        first = opening(code, m.start())
        name = re.search(r"(?<=[\s*])\w+$", code[:first])
        end = code.find("\n}", m.end())
        if name:
            start = max(code.rfind(c, 0, first) for c in ";}") + 1
            yield (name[0], bool(re.search(r"\bstatic\b", code[start:first])), parameters(code[first + 1:m.start()]),
                   code.count("\n", 0, first) + 1, code.count("\n", first, end + 2))


class File:
    """A file, the functions that it defines, and the names that other files may use and that it uses."""

    def __init__(self, path):
        with open(path, encoding="utf8", errors="replace") as f:
            text = f.read()
        self.path, self.length, header = path, text.count("\n"), path.endswith(".h")
        code = DIRECTIVE.sub(lambda m: "\n" * m[0].count("\n"), TOKEN.sub(blank, text))
        self.functions = list(functions(code))
        types = {name for m in TYPE.findall(code) for name in m if name}
        own = {f[0] for f in self.functions} | types | set(PROTOTYPE.findall(code) if header else ())
        self.defines = {f[0] for f in self.functions if header or not f[1]} | (types if header else set())
        passed = set() if header else set(ADDRESS.findall(code)) - set(VARIABLE.findall(code))
        self.uses = {name for m in USE.findall(code) for name in m if name} - own | passed - own



def circles(files):
    """Strongly connected components of more than one file, by Tarjan."""
    home = {}
    for f in files:
        for name in f.defines:
            home.setdefault(name, f)
    edges = {f: sorted({home[name] for name in f.uses if name in home}, key=lambda g: g.path) for f in files}
    number, low, stack, found = {}, {}, [], []

    def visit(f):
        number[f] = low[f] = len(number)
        stack.append(f)
        for g in edges[f]:
            if g not in number:
                visit(g)
            if g in stack:
                low[f] = min(low[f], low[g])
        if low[f] == number[f]:
            k = stack.index(f)
            if len(stack) - k > 1:
                found.append(sorted(g.path for g in stack[k:]))
            del stack[k:]

    for f in files:
        if f not in number:
            visit(f)
    return found


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--list", action="store_true", help="print each place")
    parser.add_argument("folder", nargs="*", help="count these alone")
    args = parser.parse_args()
    os.chdir(os.path.join(os.path.dirname(os.path.abspath(__file__)), ".."))
    sys.setrecursionlimit(10000)
    paths = sorted(os.path.join(d, n) for root in ROOTS for d, _, names in os.walk(root) for n in names if n.endswith((".c", ".h", ".cc")))
    files = [File(p) for p in paths]
    found = {name: {} for name in LIMITS}  # text by (path, name)
    for f in files:
        for name, _, count, line, lines in f.functions:
            if count > PARAMETERS:
                found["parameters"][f.path, name] = f"{line}: {name}: {count} parameters"
            if lines > LINES:
                found["lines"][f.path, name] = f"{line}: {name}: {lines} lines"
        if f.path.endswith(".h") and f.length > HEADER:
            found["headers"][f.path, ""] = f"1: {f.length} lines"
    for folder in sorted({os.path.dirname(p) for p in paths}):
        for circle in circles([f for f in files if os.path.dirname(f.path) == folder]):
            if len(circle) > CIRCLE:
                found["circles"][circle[0], ""] = f"1: {len(circle)} files: {' '.join(map(os.path.basename, circle))}"
    bad = False
    for name, places in found.items():
        places = [f"{path}:{text}" for (path, _), text in places.items()
                  if not args.folder or path.startswith(tuple(d.rstrip("/") + "/" for d in args.folder))]
        if args.list or not args.folder and len(places) > LIMITS[name] and name != "parameters":
            print("".join(f"{p}\n" for p in places), end="")
        above = not args.folder and len(places) > LIMITS[name]
        print(f"{'error: ' if above else ''}{name}: {len(places)}" + ("" if args.folder else f" (limit {LIMITS[name]})"))
        bad |= above
    return bad


if __name__ == "__main__":
    sys.exit(main())
