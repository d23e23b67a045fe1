#!/usr/bin/env python3
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
"""Write what comes from the table of commands: the man page sst.1 (into docs/man/sst.1.in) and the completions for bash, zsh and
fish; and those of the other programs, from their --help.

`make man` runs it. With --check nothing is written: exit 1 if a file is not what it would be."""
import argparse
import json
import re
import subprocess
import sys
from pathlib import Path

import completions
from completions import COMMON

ROOT = Path(__file__).resolve().parent.parent
# Values of options of sst-sim; --world has the scenes of the table.
SIMULATED = {"usb": "wide tight single-tt multi-tt", "triggers": "rows one"}
PUBLISHERS = {
    "sst-rtsp": ("rtsp", "RTSP streams of a see-through camera array", """The main view of the service, views with a focus of their own and
single cameras, as streams that video recorders add like any network camera: rtsp://HOST:8554/main, /view/ID and /camera/r0c5, in
H.264 or JPEG.
Beyond this machine it wants a user and a password."""),
    "sst-mqtt": ("mqtt", "MQTT client of a see-through camera array", """State, events, visits and pictures of the service, published at an MQTT
broker, which Home Assistant finds by itself as one device; commands from the broker (record, focus, snapshot) are carried out.
A broker on another machine wants TLS."""),
    "sst-onvif": ("onvif", "ONVIF camera of a see-through camera array", """The main view of the service as an ONVIF camera: video recorders
find it by searching, fetch its stream from sst-rtsp, and receive motion and persons as events.
It is a subset of profiles S and T, not certified."""),
}


def escape(text, literal=False):
    text = text.replace("\\", "\\e")
    # What may be typed must be copied with the dash that programs read.
    text = text.replace("-", "\\-") if literal else re.sub(r"(?<![\w-])-(?=[-\w])", r"\\-", text).replace("\\--", "\\-\\-")
    return "\n".join("\\&" + line if line[:1] in (".", "'") else line for line in text.split("\n"))


def prose(text):
    """Detail of a command: paragraphs, and lists of lines that begin with two spaces."""
    out, fresh = [], True
    for line in text.split("\n"):
        item = re.match(r"  (\S.*?)  +(\S.*)$", line) or re.match(r"  (\S+) (\S.*)$", line) or re.match(r"  (\S+)()$", line)
        if not line.strip():
            out.append(".PP")
        elif item and not line.startswith("   "):
            out += [".TP", escape(item[1], True), escape(item[2])]
            fresh = False
        elif line.startswith("   "):
            out.append(escape(line.strip()))
        else:
            out += ([] if fresh else [".PP"]) + [escape(line)]
            fresh = True
    return [line for line in out if line]


def option(name, letter, meta, text):
    meta = f" \\fI{escape(meta, True)}\\fR" if meta else ""
    short = f"\\fB\\-{letter}\\fR, " if letter else ""
    return [".TP", f"{short}\\fB\\-\\-{escape(name, True)}\\fR{meta}", escape(text)]


def section(command):
    out = [f".SS \"sst {escape(command['name'], True)}\"", escape(command["summary"][:1].upper() + command["summary"][1:]) + ".",
           ".PP", f"\\fBsst {escape(command['name'], True)}\\fR {escape(command['usage'], True)}"]
    if command["detail"]:
        out += [".PP"] + prose(command["detail"])
    for o in command["options"]:
        out += option(o["name"], o["letter"], o["meta"], o["help"])
    out += [".PP", "Example:", ".PP", ".RS 4", ".nf"]
    out += [escape(line.strip(), True) for line in command["example"].split("\n")]
    return out + [".fi", ".RE"]


def man_page(commands, version):
    common = sum((option(name, letter, None, text) for name, letter, text in COMMON), [])
    page = (ROOT / "docs/man/sst.1.in").read_text(encoding="utf8").replace("@VERSION@", version)
    page = page.replace("@COMMON@\n", "\n".join(common) + "\n")
    return page.replace("@COMMANDS@\n", "\n".join(sum((section(c) for c in commands), [])) + "\n")


def words(command):
    """What the first argument may be, where it is one of a few words."""
    first = command["usage"].split()[0]
    if re.fullmatch(r"[a-z]+(\|[a-z]+)+", first):
        return first.split("|")
    if first == "FORMAT":
        return re.findall(r"^  ([a-z]+) ", command["detail"], re.M)
    if re.match(r"show .*\| convert", command["usage"]):
        return ["show", "convert"]
    listed = re.search(r"^Scenes: (.*?)\.", command["detail"] or "", re.M)
    return listed[1].split() if listed and first == "NAME" else []


def completion(commands):
    names, kinds, options, values, given = [], {}, {}, {}, {}
    for c in commands:
        name, _, kind = c["name"].partition(" ")
        if name not in names:
            names.append(name)
        if kind:
            kinds.setdefault(name, []).append(kind)
        elif words(c):
            kinds[name] = words(c)
        key = c["name"].replace(" ", "-")
        options[key] = [f"--{o['name']}" for o in c["options"]] + [f"--{name}" for name, _, _ in COMMON]
        for o in c["options"]:
            if o["type"] != "flag":
                for form in [f"--{o['name']}"] + ([f"-{o['letter']}"] if o["letter"] else []):
                    if o["name"] in ("model", "mccnn-model") or o.get("words"):
                        given.setdefault(o.get("words"), []).append(f"{key}:{form}")
                    else:
                        values.setdefault((key, o["type"] == "text"), []).append(form)
    lines = ["# Completion of sst for bash. Made from the table of commands by `make man`; do not edit.", "_sst()", "{",
             "    local cur=${COMP_WORDS[COMP_CWORD]} prev=${COMP_WORDS[COMP_CWORD - 1]} cmd=${COMP_WORDS[1]} kinds= opts=",
             "    COMPREPLY=()", "    if ((COMP_CWORD == 1)); then",
             f"        COMPREPLY=($(compgen -W '{' '.join(names)} --help --version' -- \"$cur\"))", "        return", "    fi",
             "    case $cmd in"]
    lines += [f"    {name}) kinds='{' '.join(kind)}' ;;" for name, kind in kinds.items()]
    lines += ["    esac", "    # Kinds with options of their own.", "    case $cmd-${COMP_WORDS[2]} in"]
    lines += [f"    {key}) cmd={key} ;;" for key in options if "-" in key]
    networks = "$(\"${COMP_WORDS[0]}\" models 2>/dev/null | sed -n 's/^  \\([a-z0-9][^ ]*\\) .*/\\1/p')"
    lines += ["    esac", "    # Known values, and networks that are installed.", "    case $cmd:$prev in"]
    lines += [f"    {' | '.join(forms)}) COMPREPLY=($(compgen -W \"{words or networks}\" -- \"$cur\")); return ;;"
              for words, forms in given.items()]
    lines += ["    esac", f"    [[ $cmd != models ]] || kinds={networks}"]
    lines += ["    # A file follows, or what only the user knows.", "    case $cmd:$prev in"]
    for (key, text), forms in values.items():
        pattern = " | ".join(f"{key}:{form}" for form in forms)
        lines.append(f"    {pattern})" + (" return ;;" if text else " compopt +o default +o bashdefault; return ;;"))
    lines += ["    esac", "    if [[ $cur == -* ]]; then", "        case $cmd in"]
    lines += [f"        {key}) opts='{' '.join(o)}' ;;" for key, o in options.items()]
    lines += ["        esac", "        COMPREPLY=($(compgen -W \"$opts\" -- \"$cur\"))", "    elif ((COMP_CWORD == 2)) && [[ $kinds ]]; then",
              "        COMPREPLY=($(compgen -W \"$kinds\" -- \"$cur\"))", "    fi", "}",
              "complete -o bashdefault -o default -F _sst sst"]
    return "\n".join(lines) + "\n"


def small_completion(program, options, words):
    """For bash, of a program with options and words in its --help."""
    names = [f"--{o['name']}" for o in options]
    files = [f"--{o['name']}" for o in options if o["values"] == "file"]
    name = "_" + program.replace("-", "_")
    lines = [
        f"# Completion of {program} for bash. Made from its --help by `make man`; do not edit.", f"{name}()", "{",
        "    local cur=${COMP_WORDS[COMP_CWORD]} prev=${COMP_WORDS[COMP_CWORD - 1]}", "    COMPREPLY=()", "    case $prev in"]
    lines += [f"    --{o['name']}) COMPREPLY=($(compgen -W \"{o['values']}\" -- \"$cur\")); return ;;"
              for o in options if o["values"] not in (None, "file")]
    lines += [f"    {' | '.join(files)}) return ;;", "    esac", "    if [[ $cur == -* ]]; then",
              f"        COMPREPLY=($(compgen -W '{' '.join(names)}' -- \"$cur\"))"]
    lines += ["    elif ((COMP_CWORD == 1)); then", f"        COMPREPLY=($(compgen -W '{' '.join(words)}' -- \"$cur\"))"] if words else []
    return "\n".join(lines + ["    fi", "}", f"complete -o bashdefault -o default -F {name} {program}"]) + "\n"


def usage_options(usage):
    """Options of a --help, with the lines that go on below them."""
    out = []
    for line in usage.splitlines():
        m = re.match(r"  (?:-(\w), |    )?--([a-z-]+)(?: ([A-Z][A-Z=]*))?\s+(.*)$", line) or re.match(r"  ()--([a-z-]+)(?: ([A-Z][A-Z=]*))?\s+(.*)$", line)
        if m:
            out.append(list(m.groups()))
        elif out and re.match(r"   {8}", line):
            out[-1][3] += " " + line.strip()
        elif not line.strip() and out:
            break
    return sum((option(name, letter, meta, text) for letter, name, meta, text in out), [])


def sim_page(usage, version):
    head, _, rest = usage.partition("\n\n")
    forms = [re.sub(r"^(usage:)?\s+", "", line) for line in head.splitlines()]
    forms = [re.sub(r"\s{2,}.*", "", line.replace("usage: ", "")) for line in forms]
    examples = [re.sub(r"^(example:)?\s+", "", line) for line in rest[rest.index("example:"):].splitlines()]
    page = (ROOT / "docs/man/sst-sim.1.in").read_text(encoding="utf8").replace("@VERSION@", version)
    page = page.replace("@SYNOPSIS@", "\n".join(escape(f, True) for f in forms))
    page = page.replace("@EXAMPLES@", "\n".join(escape(e, True) for e in examples))
    return page.replace("@OPTIONS@", "\n".join(usage_options(usage)))


def publisher_page(program, usage, version):
    section_name, purpose, text = PUBLISHERS[program]
    page = (ROOT / "docs/man/publisher.8.in").read_text(encoding="utf8")
    for key, value in {"VERSION": version, "PROGRAM": program, "TITLE": escape(program.upper(), True), "NAME": escape(program, True),
                       "PURPOSE": escape(purpose, True), "TEXT": escape(text), "SECTION": section_name}.items():
        page = page.replace(f"@{key}@", value)
    return page.replace("@OPTIONS@", "\n".join(usage_options(usage)))


def of_programs(build, version, scenes):
    """Man pages and completions of the programs beside sst that were built."""
    made = []
    for program in ["sst-sim", "sstd", *PUBLISHERS]:
        path = ROOT / build / program
        if not path.exists():
            continue
        run = subprocess.run([str(path), "--help"], capture_output=True, text=True)
        usage = run.stdout + run.stderr
        if program in PUBLISHERS:
            made.append((f"docs/man/{program}.8", publisher_page(program, usage, version)))
            continue
        if program == "sst-sim":
            made.append(("docs/man/sst-sim.1", sim_page(usage, version)))
        options = completions.of_usage(usage, {**SIMULATED, "world": scenes} if program == "sst-sim" else {})
        words = list(dict.fromkeys(re.findall(rf"^\s+{program} ([a-z]+)\b", usage, re.M)))
        made += [(f"completions/{program}", small_completion(program, options, words)),
                 (f"completions/_{program}", completions.zsh_program(program, options, words)),
                 (f"completions/{program}.fish", completions.fish_program(program, options, words))]
    return made


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--build", default="build")
    parser.add_argument("--check", action="store_true")
    args = parser.parse_args()
    sst = str(ROOT / args.build / "sst")
    run = lambda *a: subprocess.run([sst, *a], check=True, capture_output=True, text=True).stdout
    commands = [json.loads(line) for line in run("--describe").splitlines()]
    version = json.loads(run("version", "--json"))["version"]
    stale = 0
    table = completions.of_commands(commands, words)
    scenes = next(o["words"] for c in commands if c["name"] == "demo" for o in c["options"] if o["name"] == "scene")
    made = [("docs/man/sst.1", man_page(commands, version)), ("completions/sst", completion(commands)),
            ("completions/_sst", completions.zsh_commands(table)), ("completions/sst.fish", completions.fish_commands(table))]
    made += of_programs(args.build, version, f"{scenes} forest board")
    for name, text in made:
        path = ROOT / name
        if path.exists() and path.read_text(encoding="utf8") == text:
            continue
        if args.check:
            print(f"{name} is not what the commands say: run `make man`")
            stale = 1
        else:
            path.write_text(text, encoding="utf8")
    return stale


sys.exit(main())
