#!/usr/bin/env python3
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
"""Name the stages that became slower than the committed baseline.

A stage's time counts relative to reference loops (build/bench/check) that ran in turn with it, so that a loaded or slower
clocked machine changes both. The median over the rounds of time / geometric mean of the loops' times is compared with the
baseline of the same processor and kernel level; what is more than 10 % above it is measured again, and named if it
stays there.
"""
import argparse, csv, io, json, math, os, statistics, subprocess, sys

LIMIT = 1.10


def ratios(text):
    """Median ratio of each stage to the loops, from the CSV of build/bench/check."""
    times = {}
    for row in csv.DictReader(io.StringIO(text)):
        times.setdefault(row["part"], {})[int(row["round"])] = float(row["cpu_ms"])
    loops = [name for name in times if name.startswith("loop ")]
    if not loops:
        sys.exit("bench_check: the measurement has no reference loops")
    reference = {i: math.exp(statistics.fmean(math.log(times[name][i]) for name in loops)) for i in times[loops[0]]}
    return {name: statistics.median(t / reference[i] for i, t in rounds.items())
            for name, rounds in times.items() if name not in loops}


def slower(now, baseline):
    """Stages that are more than the limit above their baseline, with the factor."""
    return {name: now[name] / baseline[name] for name in now if name in baseline and now[name] > LIMIT * baseline[name]}


def machine(build):
    """What a baseline holds for: processor and kernel level."""
    cpu = "unknown processor"
    with open("/proc/cpuinfo") as f:
        for line in f:
            if line.startswith("model name"):
                cpu = line.split(":", 1)[1].strip()
                break
    version = subprocess.run([f"{build}/sst", "version", "--json"], capture_output=True, text=True, check=True)
    return f"{cpu}, {json.loads(version.stdout)['cpu']}"


def measure(build, rounds, names=()):
    run = subprocess.run([f"{build}/bench/check", str(rounds), *names], capture_output=True, text=True)
    if run.returncode:
        sys.exit(f"bench_check: {build}/bench/check failed: {run.stderr.strip()}")
    return ratios(run.stdout)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--build", default="build", help="folder of the build (%(default)s)")
    parser.add_argument("--baseline", default="docs/measured/bench-check.json", help="(%(default)s)")
    parser.add_argument("--rounds", type=int, default=9, help="(%(default)s)")
    parser.add_argument("--update", action="store_true", help="make this measurement the baseline of this machine")
    parser.add_argument("--compare", metavar="CSV", help="compare this file's figures with --machine's, measure nothing")
    parser.add_argument("--machine", help="name in the baseline; default: this machine's")
    args = parser.parse_args()
    name = args.machine or machine(args.build)
    baselines = json.load(open(args.baseline)) if os.path.exists(args.baseline) else {}
    if args.compare:
        found = slower(ratios(open(args.compare).read()), baselines[name])
    else:
        now = measure(args.build, args.rounds)
        if args.update:
            baselines[name] = {stage: round(ratio, 4) for stage, ratio in now.items()}
            with open(args.baseline, "w") as f:
                f.write(json.dumps(baselines, indent=1, sort_keys=True) + "\n")
            print(f"{args.baseline}: baseline of {name}")
            return
        if name not in baselines:
            print(f"skipped: {args.baseline} has no baseline of {name}; make bench-check-update measures one")
            return
        for stage, ratio in now.items():
            known = stage in baselines[name]
            print(f"{stage}: " + (f"{ratio / baselines[name][stage]:.2f} of the baseline" if known else "no baseline"))
        found = slower(now, baselines[name])
        if found:
            print(f"measured again: {', '.join(found)}")
            found = slower(measure(args.build, 2 * args.rounds, tuple(found)), baselines[name])
    for stage, factor in found.items():
        print(f"slower: {stage} takes {factor:.2f} times its baseline")
    sys.exit(1 if found else 0)


if __name__ == "__main__":
    main()
