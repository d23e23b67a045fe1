#!/usr/bin/python3
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
"""Copyright and licence of each file, as tags of SPDX behind its first comment. Tracked files alone; no network.

spdx.py          names files without tags that .reuse/dep5 does not cover; exit status 1 if there are any
spdx.py --add    adds tags to them; a second run changes nothing
"""
import fnmatch
import os
import re
import subprocess
import sys

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
HOLDER, LICENCE = "2026 The sst contributors", "Apache-2.0"
# Split, so that no tool takes these lines for tags of this file.
TAGS = ("SPDX-" + "FileCopyrightText: " + HOLDER, "SPDX-" + "License-Identifier: " + LICENCE)
HEAD = 32000  # bytes in which reuse looks for tags
STAR = (".c", ".h", ".cc", ".css")
SLASH = (".js", ".comp", ".glsl")
HASH = (".sh", ".py", ".yaml", ".toml", ".conf", ".in", ".rules", ".socket", ".supp", "Makefile", "Kbuild", "run", "init", ".clang-format", ".gitignore")
ANGLE = (".md", ".html")
NO_TAGS = ("LICENSE", "LICENSES/*", ".reuse/*")  # reuse leaves them out


def tracked():
    done = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, check=False)
    if done.returncode:
        sys.exit(0)  # an archive, which was checked when it was made
    out = done.stdout.decode()
    return [f for f in out.split("\0") if f and os.path.isfile(os.path.join(ROOT, f)) and not os.path.islink(os.path.join(ROOT, f))]


def covered():
    """Patterns of .reuse/dep5, in which * matches / as well."""
    with open(os.path.join(ROOT, ".reuse/dep5"), encoding="utf-8") as f:
        return [p for line in f if line.startswith("Files:") for p in line.split()[1:]]


def is_tagged(path):
    with open(os.path.join(ROOT, path), "rb") as f:
        head = f.read(HEAD)
    return all(tag.split(":")[0].encode() + b":" in head for tag in TAGS)


def first_comment_star(lines):
    """Number of lines of the comment that a file begins with."""
    if not lines or not lines[0].startswith("/*"):
        return 0
    for i, line in enumerate(lines):
        if "*/" in line:
            return i + 1 if line.rstrip().endswith("*/") else 0
    return 0


def block(lines, start):
    n = 0
    while n < len(lines) and lines[n].startswith(start):
        n += 1
    return n


def add(path, text):
    """The text with tags behind its first comment; a shebang and a doctype stay first."""
    lines = text.splitlines(keepends=True)
    if path.endswith(STAR):
        at, new = first_comment_star(lines), [f"/* {t} */\n" for t in TAGS]
    elif path.endswith(SLASH):
        at, new = block(lines, "//") or first_comment_star(lines), [f"// {t}\n" for t in TAGS]
    elif path.endswith(ANGLE):
        doctype = path.endswith(".html") and lines and lines[0].lower().startswith("<!doctype")
        at, new = 1 if doctype or (lines and lines[0].startswith("#")) else 0, ["<!--\n"] + [f"{t}\n" for t in TAGS] + ["-->\n"]
    elif path.endswith(HASH):
        at, new = block(lines, "#"), [f"# {t}\n" for t in TAGS]
    else:
        return None
    if at and not lines[at - 1].endswith("\n"):
        lines[at - 1] += "\n"
    return "".join(lines[:at] + new + lines[at:])


def main():
    patterns, missing = covered(), []
    for path in tracked():
        if any(fnmatch.fnmatchcase(path, p) for p in patterns + list(NO_TAGS)) or is_tagged(path):
            continue
        missing.append(path)
    if "--add" not in sys.argv[1:]:
        for path in missing:
            print(f"error: {path} has no copyright and licence: scripts/spdx.py --add, or a pattern in .reuse/dep5", file=sys.stderr)
        return 1 if missing else 0
    for path in missing:
        full = os.path.join(ROOT, path)
        with open(full, encoding="utf-8", newline="") as f:
            text = f.read()
        tagged = add(path, text)
        if tagged is None:
            print(f"error: {path}: no comment is known for this kind of file; name it in .reuse/dep5", file=sys.stderr)
            continue
        with open(full, "w", encoding="utf-8", newline="") as f:
            f.write(tagged)
    return 0


if __name__ == "__main__":
    sys.exit(main())
