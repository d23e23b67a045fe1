#!/usr/bin/env python3
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
"""Check the documentation: links and anchors of all pages, citations of design.md, paths and functions of architecture.md.

check_docs.py   prints each fault as FILE:LINE: sentence; exit status 1 if there is one.
"""
import os
import re
import subprocess
import sys

os.chdir(os.path.join(os.path.dirname(os.path.abspath(__file__)), ".."))


def list_files():
    """Files of the tree, of a checkout or of an unpacked archive, without what is built."""
    git = subprocess.run(["git", "ls-files", "-co", "--exclude-standard"], capture_output=True, text=True)
    if not git.returncode:
        found = git.stdout.split("\n")
    else:
        found = [os.path.relpath(os.path.join(d, f), ".") for d, _, names in os.walk(".") for f in names
                 if not re.match(r"\./(build|\.git)", d)]
    return [f for f in found if f and os.path.isfile(f)]


FILES = list_files()
CODE = re.compile(r"\.(c|h|cc|py|sh|js|in|yaml|json|service|rules|txt)$|(^|/)Makefile$")
# Pages whose paths and functions must exist.
NAMING = ["CONTRIBUTING.md"] + [f"docs/design/{name}.md" for name in
                                ("architecture", "calibration", "design", "live", "method", "rectification")]
faults = []


def fault(path, line, text):
    faults.append(f"{path}:{line}: {text}")


def read(path):
    with open(path, encoding="utf8", errors="replace") as f:
        return f.read()


def prose(text):
    """The text without fenced code, line for line."""
    out, fenced = [], False
    for line in text.split("\n"):
        fence = line.lstrip().startswith(("```", "~~~"))
        fenced ^= fence
        out.append("" if fenced or fence else line)
    return out


def anchors(path):
    """The anchors of a page, as GitHub forms them."""
    found = {}
    for line in prose(read(path)):
        m = re.match(r"#+ +(.*?)\s*#*$", line)
        if m:
            text = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", m[1])
            slug = re.sub(r"[^\w\- ]", "", text.lower()).replace(" ", "-")
            n = found.get(slug, -1) + 1
            found[slug] = n
            if n:
                found[f"{slug}-{n}"] = 0
    return found


def check_links(path):
    for number, line in enumerate(prose(read(path)), 1):
        for target in re.findall(r"\]\(([^)\s]+)\)", re.sub(r"`[^`]*`", "", line)):
            name, _, anchor = target.partition("#")
            if re.match(r"[a-z]+:", target):
                continue
            to = os.path.normpath(os.path.join(os.path.dirname(path), name)) if name else path
            if not os.path.exists(to):
                fault(path, number, f"link to {target}: there is no {to}")
            elif anchor and to.endswith(".md") and anchor not in anchors(to):
                fault(path, number, f"link to {target}: {to} has no heading for #{anchor}")


def check_citations(path, sections):
    """Sections of design.md and pages of docs/ that code names."""
    for number, line in enumerate(read(path).split("\n"), 1):
        for section in re.findall(r"(?:design\.md, |\bDESIGN(?: section)? )(\d+(?:\.\d+)?)", line):
            if section not in sections:
                fault(path, number, f"docs/design/design.md has no section {section}")
        for page in re.findall(r"(?<![\w/])docs/[\w./-]+\.(?:md|svg|png|jpg)\b", line):
            if not os.path.exists(page):
                fault(path, number, f"there is no {page}")


def check_names(path):
    """Backticked paths and functions of a page exist."""
    sources, names = SOURCES, {os.path.basename(f) for f in FILES}
    for number, line in enumerate(prose(read(path)), 1):
        for text in re.findall(r"`([^`]+)`", line):
            if re.fullmatch(r"\w+\(\)", text):
                # A definition or a prototype: the name after a type, at the start of a line.
                if not re.search(rf"^[\w][^\n;=()]*[\s*]{text[:-2]}\(", sources, re.M):
                    fault(path, number, f"no function {text} in the sources")
            elif re.fullmatch(r"[\w.-]+(/[\w.-]+)*/?", text) and ("/" in text or re.search(r"\.(c|h|py|sh)$", text)):
                if not (os.path.exists(text) or text in names or text.startswith("build") or is_folder_of_table(text)):
                    fault(path, number, f"there is no {text}")


SOURCES = "\n".join(read(f) for f in FILES if f.endswith((".c", ".h", ".cc")) and not f.startswith("tests/"))


def is_folder_of_table(text):
    """`grab/` in the row of `drivers/`: a folder of that name somewhere in the tree."""
    return text.endswith("/") and any(f"/{text}" in f"/{f}" for f in FILES)


def main():
    pages = [f for f in FILES if f.endswith(".md")]
    sections = set(re.findall(r"^#+ (\d+(?:\.\d+)?)[. ]", read("docs/design/design.md"), re.M))
    for page in pages:
        check_links(page)
    for path in FILES:
        if CODE.search(path) and not path.startswith("docs/") and path != "scripts/check_docs.py" or path in pages:
            check_citations(path, sections)
    for path in NAMING:
        check_names(path)
    for page in pages:
        if page.startswith("docs/") and page != "docs/README.md" and os.path.basename(page) not in read("docs/README.md"):
            fault("docs/README.md", 1, f"the index does not name {page}")
    print("\n".join(faults), file=sys.stderr, end="\n" if faults else "")
    return bool(faults)


if __name__ == "__main__":
    sys.exit(main())
