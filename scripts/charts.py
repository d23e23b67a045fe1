# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
"""Tables and pages (Markdown) and charts (SVG, PNG by gnuplot) of figures that were measured."""
import csv
import math
import platform
import statistics
import subprocess

BASELINE = "OpenCV SGBM 3WAY"
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#AA4499")  # of groups; distinct with any colour vision, on light and dark
# gnuplot point types of methods: crosses for others', full for ours (odd; one less is the open one, for AVX2)
SYMBOLS = {"f32": 5, "int8": 7, "f32, half size": 4, "int8, half size": 6,
           BASELINE: 2, "OpenCV SGBM HH": 1, "OpenCV BM": 3, "sst preview": 9, "sst balanced": 5, "sst accurate": 7, "live, first set": 13, "live, mean of later sets": 11,
           "0 %": 7, "20 %": 5, "40 %": 9, "60 %": 13, "80 %": 15}
LIMITED = ", AVX2"  # ends the name of a method that is limited to AVX2 where the machine has more
WORDS = {"avx512": "AVX-512", "avxvnni": "AVX-VNNI", "avx2": "AVX2"}


def word(level):
    return WORDS.get(level, level)


def suffixes(levels):
    """{level: end of a method's name}: none of the best, which comes first."""
    return {level: LIMITED if i else "" for i, level in enumerate(levels)}


def symbol(method, symbols=None):
    full = (symbols or SYMBOLS)[method.removesuffix(LIMITED)]
    return full - 1 if method.endswith(LIMITED) else full


def about_levels(levels):
    """Sentences for a page whose columns are levels of the processor, the best first."""
    best, *others = (word(level) for level in levels)
    if not others:
        return f"Kernels: {best}, the best level of this machine.\n\n"
    return (f"**{best}** is the best level of this machine; **AVX2** is the same program limited to it (`SST_CPU=avx2 "
            "ONEDNN_MAX_CPU_ISA=AVX2`), in turn with the other in one run. OpenCV uses all that the processor has.\n\n")


def cpu_name():
    with open("/proc/cpuinfo") as f:
        for line in f:
            if line.startswith("model name"):
                return " ".join(line.split(":", 1)[1].split())
    return platform.machine()


def read_rounds(path, *key):
    """Rows of a CSV file by key columns, in order of first appearance; numbers are numbers."""
    groups = {}
    with open(path) as f:
        for row in csv.DictReader(f):
            values = {k: v if k in ("pair", "method", "limit", "level") else float(v or "nan") for k, v in row.items()}
            groups.setdefault(tuple(values[k] for k in key), []).append(values)
    return groups


def median(rows, column):
    return statistics.median(r[column] for r in rows)


def spread(rows):
    return f"{min(r['ms'] for r in rows):.1f}..{max(r['ms'] for r in rows):.1f}"


def ratio(rows, others):
    """Median over the rounds of this time over that of the same round."""
    return statistics.median(a["ms"] / b["ms"] for a, b in zip(rows, others))


def number(value, digits=2):
    return "-" if value is None else f"{value:.{digits}f}"


def table(head, rows):
    lines = [head, ["---"] + ["--:"] * (len(head) - 1)] + rows
    return "\n".join("| " + " | ".join(map(str, line)) + " |" for line in lines) + "\n"


def page(title, command, text, levels=None):
    return (f"# {title}\n\nMade by `{command}` on {cpu_name()}, 2 threads. Do not edit: the next run overwrites this page.\n\n"
            f"{about_levels(levels) if levels else ''}{text}")


def tics(low, high):
    marks = (m * 10.0 ** e for e in range(-4, 8) for m in ((1, 2, 5) if high < 2000 * low else (1,)))
    return "(" + ", ".join(f'"{t:g}" {t:g}' for t in marks if low <= t <= high) + ")"


def frame(title, labels, x, y, log_y, command):
    """Gnuplot's commands for all but the data. x, y: smallest and largest value of each axis."""
    lines = [f'set title "{{/*1.3 {title}}}\\n{{/*0.9 further down is more accurate, further left is faster}}"',
             f'set xlabel "{labels[0]}"', f'set ylabel "{labels[1]}"',
             "set logscale x", f"set xrange [{x[0]}:{x[1]}]", f"set xtics {tics(*x)}", f"set yrange [{y[0]}:{y[1]}]",
             "set border 3 lc rgb '#444444'", "set tics nomirror", "set grid lc rgb '#dddddd' lt 1",
             "set key outside right top Left reverse samplen 1.5", "set bmargin 5.5", "set tmargin 4",
             f'set label "{command}; {cpu_name()}, 2 threads" at screen 0.01, 0.025 font ",9" tc rgb "#555555" '
             "noenhanced"]
    return lines + (["set logscale y", f"set ytics {tics(*y)}"] if log_y else [])


def name_groups(groups, y, log_y):
    """Each group's name beside its last point; those that would touch another or the axis move up."""
    scale, lines, free = math.log if log_y else float, [], 0.03
    last = {group: max(points, key=lambda p: p[1]) for group, points in groups.items()}
    for group in sorted(last, key=lambda g: last[g][2]):
        at = max(free, (scale(last[group][2]) - scale(y[0])) / (scale(y[1]) - scale(y[0])))
        lines.append(f'set label "{group}" at first {last[group][1]}, graph {at} left offset 1.5, 0 '
                     f'tc rgb "{COLOURS[list(groups).index(group)]}" noenhanced')
        free = at + 0.05
    return lines


def chart(out, name, title, labels, groups, command, log_y=False):
    """Time against error. groups: {group: [(method, time, error)]}. A group has a colour, its presets of sst are joined,
    those limited to AVX2 by a dashed line, and its name stands beside its last point; a method has a symbol, explained to
    the right of the data."""
    points = [p for g in groups.values() for p in g]
    times, errors = [p[1] for p in points], [max(p[2], 0.01) for p in points]
    y = (min(errors) / 1.5, max(errors) * 1.5) if log_y else (0, max(errors) * 1.12)
    lines = frame(title, labels, (min(times) / 1.5, max(times) * 3.2), y, log_y, command)
    lines += name_groups(groups, y, log_y)
    plots = []
    for i, (group, g) in enumerate(groups.items()):
        lines += [f"$g{i} << EOD"] + [f"{t} {e} {symbol(m)}" for m, t, e in g] + ["EOD"]
        plots.append(f"$g{i} using 1:2:3 with points pt variable ps 1.4 lw 2 lc rgb '{COLOURS[i]}' notitle")
        for limited in (False, True):
            joined = [f"{t} {e}" for m, t, e in g if not m.startswith("OpenCV") and m.endswith(LIMITED) == limited]
            if joined:
                lines += [f"$l{i}{limited:d} << EOD"] + joined + ["EOD"]
                plots.append(f"$l{i}{limited:d} with lines dt {1 + limited} lw 1.5 lc rgb '{COLOURS[i]}' notitle")
    for method in dict.fromkeys(p[0] for p in points):
        plots.append(f"keyentry with points pt {symbol(method)} ps 1.4 lw 2 lc rgb '#444444' title \"{method}\"")
    return draw(out, name, lines + ["plot " + ", \\\n".join(plots)])


def draw(out, name, lines):
    """What gnuplot's commands draw, as OUT/NAME.svg and .png. Returns both paths."""
    made = []
    for kind, terminal in (("svg", 'svg size 860,520 font "sans,12" background "#ffffff"'),
                           ("png", 'pngcairo size 1290,780 font "sans,12" fontscale 1.4 background "#ffffff"')):
        made.append(f"{out}/{name}.{kind}")
        script = [f"set terminal {terminal}", f"set output '{made[-1]}'"] + lines
        subprocess.run(["gnuplot"], input="\n".join(script) + "\n", text=True, check=True)
    return made


def write_page(out, name, text):
    with open(f"{out}/{name}.md", "w") as f:
        f.write(text)
    return [f"{out}/{name}.md"]
