# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
"""Completions for zsh and fish, from the table of commands and from --help: scripts/man.py writes them beside those for bash."""
import re

NETWORKS = "sed -n 's/^  \\([a-z0-9][^ ]*\\) .*/\\1/p'"
COMMON = [("verbose", "v", "log more"), ("quiet", "q", "log errors only"), ("help", "h", "explain, with an example")]


def option(name, letter, text, values):
    """@param values  None: a flag; "file": of a file or free text; "": nothing is known; "networks"; else the words"""
    return {"name": name, "letter": letter, "help": " ".join(text.split()), "values": values}


def of_commands(commands, words):
    """The table of `sst --describe` as a list of (command, kind, summary, first words, options)."""
    out = []
    for c in commands:
        name, _, kind = c["name"].partition(" ")
        options = [option(n, letter, text, None) for n, letter, text in COMMON]
        for o in c["options"]:
            values = None if o["type"] == "flag" else o.get("words") or (
                "networks" if o["name"] in ("model", "mccnn-model") else "file" if o["type"] == "text" else "")
            options.append(option(o["name"], o["letter"], o["help"], values))
        out.append((name, kind, c["summary"], "networks" if name == "models" else " ".join([] if kind else words(c)), options))
    return out


def of_usage(usage, values):
    """Options of a program by its --help. @param values  words of options, by name; files where not listed"""
    options = [] if re.search(r"^  .*--help", usage, re.M) else [option("help", "h", "print this help", None)]
    for letter, name, meta, text in re.findall(r"^  (?:-(\w), |    )?--([a-z-]+)( [A-Z][A-Z=]*)?\s+(.*)$", usage, re.M):
        options.append(option(name, letter, text, values.get(name, "file") if meta else None))
    return options


# --- zsh ------------------------------------------------------------------------------------------------------------

FILES = "'*: :_files'"


def zsh_text(text):
    return re.sub(r"([\[\]:\\])", r"\\\1", text).replace("'", "'\\''")


def zsh_action(values):
    if values == "networks":
        return "{compadd -- $(_sst_networks)}"
    return "_files" if values == "file" else f"({values})" if values else " "


def zsh_option(o):
    value = "" if o["values"] is None else f":{o['name']}:{zsh_action(o['values'])}"
    tail = f"[{zsh_text(o['help'])}]{value}'"
    repeats = "*" if o["values"] is not None else ""
    if o["letter"]:
        return f"{{-{o['letter']},--{o['name']}}}'{tail}" if not repeats else f"'*'{{-{o['letter']},--{o['name']}}}'{tail}"
    return f"'{repeats}--{o['name']}{tail}"


def zsh_arguments(options, rest):
    return " \\\n".join(["_arguments -s"] + [f"      {zsh_option(o)}" for o in options] + [f"      {r}" for r in rest])


def zsh_commands(table):
    names = dict.fromkeys(name for name, *_ in table)
    lines = ["#compdef sst", "# Completion of sst for zsh. Made from the table of commands by `make man`; do not edit.",
             f"_sst_networks() {{ sst models 2>/dev/null | {NETWORKS} }}", "_sst() {",
             "  local state", "  local -a commands", "  commands=("]
    for name in names:
        summary = next(s for n, kind, s, *_ in table if n == name)
        lines.append(f"    '{name}:{zsh_text(summary)}'")
    lines += ["  )", "  _arguments -C '(- *)--version[print the version]' '(- *)--help[list the commands]' '1: :->command' '*:: :->rest'",
              "  case $state in", "  command) _describe command commands ;;", "  rest)",
              "    case $words[1]:${words[2]-} in"]
    for name, kind, _, _, options in table:
        if kind:
            lines += [f"    {name}:{kind})", "      shift words; (( CURRENT-- ))", f"      {zsh_arguments(options, [FILES])}", "      ;;"]
    for name in names:
        kinds = [kind for n, kind, *_ in table if n == name and kind]
        _, _, _, first, options = next(row for row in table if row[0] == name)
        if kinds:
            lines.append(f"    {name}:*) _arguments '1: :({' '.join(kinds)})' ;;")
        else:
            rest = [f"'1: :{zsh_action(first)}'"] if first else []
            lines += [f"    {name}:*)", f"      {zsh_arguments(options, rest + [FILES])}", "      ;;"]
    return "\n".join(lines + ["    esac", "    ;;", "  esac", "}", "_sst \"$@\""]) + "\n"


def zsh_program(program, options, words):
    rest = [f"'1: :({' '.join(words)})'"] if words else []
    return "\n".join([f"#compdef {program}", f"# Completion of {program} for zsh. Made from its --help by `make man`; do not edit.",
                      zsh_arguments(options, rest + ["'*: :_default'"])]) + "\n"


# --- fish -----------------------------------------------------------------------------------------------------------

def fish_text(text):
    return "'" + text.replace("\\", "\\\\").replace("'", "\\'") + "'"


def fish_option(program, o, where):
    line = f"complete -c {program}" + (f" -n {fish_text(where)}" if where else "")
    line += (f" -s {o['letter']}" if o["letter"] else "") + f" -l {o['name']}"
    if o["values"] == "file":
        line += " -r"
    elif o["values"] is not None:
        words = "(__sst_networks)" if o["values"] == "networks" else o["values"]
        line += " -x" + (f" -a {fish_text(words)}" if words else "")
    return f"{line} -d {fish_text(o['help'])}"


def fish_commands(table):
    lines = ["# Completion of sst for fish. Made from the table of commands by `make man`; do not edit.",
             "function __sst_at -d 'whether the line has this command, and this kind of it'", "    set -l words (commandline -opc)",
             "    test \"$words[2]\" = $argv[1]; or return 1", "    test (count $argv) -eq 1; or test \"$words[3]\" = $argv[2]", "end",
             "function __sst_first -d 'whether the word after this command is typed'",
             "    set -l words (commandline -opc)", "    test (count $words) -eq 2; and test \"$words[2]\" = $argv[1]", "end",
             "function __sst_networks", f"    sst models 2>/dev/null | {NETWORKS}", "end",
             "complete -c sst -n __fish_use_subcommand -f -l version -d 'print the version'"]
    done = set()
    for name, kind, summary, first, options in table:
        if name not in done:
            lines.append(f"complete -c sst -n __fish_use_subcommand -f -a {name} -d {fish_text(summary)}")
        done.add(name)
        where = f"__sst_at {name}" + (f" {kind}" if kind else "")
        if kind or first:
            words = "(__sst_networks)" if first == "networks" else kind or first
            lines.append(f"complete -c sst -n '__sst_first {name}' -a {fish_text(words)}")
        lines += [fish_option("sst", o, where) for o in options]
    return "\n".join(lines) + "\n"


def fish_program(program, options, words):
    lines = [f"# Completion of {program} for fish. Made from its --help by `make man`; do not edit."]
    lines += [f"complete -c {program} -n __fish_use_subcommand -a {fish_text(' '.join(words))}"] if words else []
    return "\n".join(lines + [fish_option(program, o, "") for o in options]) + "\n"
