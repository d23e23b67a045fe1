#!/usr/bin/env python3
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
"""Count stand-ins for nouns in comments: what, who, whose, those, that of, of that, of them, likewise. Part of `make check-names`.

check_words.py [--base COMMIT] [--list]

A comment names the thing (CONTRIBUTING.md, Language). Two limits, in stand-ins for each 1,000 words of comments: CHANGED in lines that
differ from the base, from SLACK stand-ins on, and TREE in all files. The base is the commit at which this branch left main, on main
itself the commit before; in a clone without it (a single commit, an archive) the tree alone is judged. Questions do not count. --list
prints each stand-in in changed lines, without a base in all, as FILE:LINE: comment. Exit status 1 above a limit.
"""
import argparse
import os
import re
import subprocess
import sys

CHANGED, SLACK, TREE = 4.0, 4, 6.0
WORDS = re.compile(r"\b(?:what|who|whose|whom|those|likewise|that of|of that|of them)\b(?![^.]*\?)", re.I)
C_LIKE = (".c", ".h", ".cc", ".comp", ".glsl", ".js")
HASHES = (".py", ".sh")
TOKEN = r'"(?:\\.|[^"\\\n])*"|\'(?:\\.|[^\'\\\n])*\'|//[^\n]*|/\*.*?\*/'

os.chdir(os.path.join(os.path.dirname(os.path.abspath(__file__)), ".."))


def git(*args):
    """Output of git, None where it fails."""
    try:
        out = subprocess.run(["git", *args], capture_output=True, text=True, errors="replace")
    except OSError:
        return None
    return None if out.returncode else out.stdout


def files():
    found = git("ls-files", "-co", "--exclude-standard")
    if found is None:
        found = "\n".join(os.path.relpath(os.path.join(d, f), ".") for d, _, names in os.walk(".") for f in names
                          if not re.match(r"\./(build|\.git)", d))
    return [f for f in found.split("\n") if f.endswith(C_LIKE + HASHES) and os.path.isfile(f)]


def comments(path):
    """Text of comments by line number, but for tags of copyright and licence."""
    return {number: text for number, text in all_comments(path).items() if "SPDX-" not in text}


def all_comments(path):
    with open(path, encoding="utf8", errors="replace") as f:
        text = f.read()
    lines = {}
    if path.endswith(HASHES):
        for number, line in enumerate(text.split("\n"), 1):
            m = re.match(r"(?:.*\s)?#(?!!)(.*)", line)
            if m:
                lines[number] = m[1]
        return lines
    for m in re.finditer(TOKEN + (r"|`(?:\\.|[^`\\])*`" if path.endswith(".js") else ""), text, re.S):
        if m[0][:2] in ("//", "/*"):
            first = text.count("\n", 0, m.start()) + 1
            for k, line in enumerate(m[0].split("\n")):
                lines[first + k] = lines.get(first + k, "") + " " + line.strip(" /*")
    return lines


def base_commit(wanted):
    """The commit to compare with, None where there is none."""
    if wanted:
        return wanted
    for main in ("origin/main", "main"):
        base = git("merge-base", "HEAD", main)
        if base and base != git("rev-parse", "HEAD"):
            return base.strip()
    return (git("rev-parse", "--verify", "-q", "HEAD~1") or "").strip() or None


def changed(base):
    """Numbers of added lines by file."""
    diff, found, path = git("diff", "-U0", "--no-renames", base, "--"), {}, None
    if diff is None:
        sys.exit(f"error: git cannot compare with {base}")
    for line in diff.split("\n"):
        hunk = re.match(r"@@ -\S+ \+(\d+)(?:,(\d+))? @@", line)
        if line.startswith("+++ "):
            path = line[6:]
        elif hunk:
            first, count = int(hunk[1]), int(hunk[2] or 1)
            found.setdefault(path, set()).update(range(first, first + count))
    return found


def count(texts):
    """(stand-ins, words) of texts."""
    return sum(len(WORDS.findall(t)) for t in texts), sum(len(re.findall(r"[A-Za-z]{2,}", t)) for t in texts)


def judge(name, texts, limit, least):
    """One line about these comments. Returns whether they are within the limit."""
    found, words = count(texts)
    rate = 1000 * found / max(words, 1)
    bad = rate > limit and found >= least
    print(f"{'error: ' if bad else ''}{name}: {found} stand-ins for nouns in {words} words of comments, {rate:.1f} of 1,000 "
          f"(limit {limit:g})", file=sys.stderr if bad else sys.stdout)
    return not bad


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--base", metavar="COMMIT", help="compare with this commit")
    parser.add_argument("--list", action="store_true", help="print each one that is counted")
    args = parser.parse_args()
    tree = {path: comments(path) for path in files()}
    base = base_commit(args.base)
    lines = changed(base) if base else {}
    new = {path: {n: t for n, t in tree[path].items() if n in lines[path]} for path in lines if path in tree}
    if args.list:
        for path, texts in (new if base else tree).items():
            for number, text in texts.items():
                if WORDS.search(text):
                    print(f"{path}:{number}: {text.strip()}")
    well = judge("the tree", [t for texts in tree.values() for t in texts.values()], TREE, 1)
    if base:
        well &= judge(f"changed since {base[:12]}", [t for texts in new.values() for t in texts.values()], CHANGED, SLACK)
    return 0 if well else 1


if __name__ == "__main__":
    sys.exit(main())
