#!/usr/bin/python3
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
"""Measure time against error from scratch and renew the tables and charts of docs/measured/: `make bench`, `make bench-quick`.

Times are measured at the best level of the processor and, in turn with it, at AVX2 where that is less; errors once. Raw figures go to BUILD/bench/ (a file per part, and all of them with commit, flags and processor as bench.json), tables and
charts to BUILD/bench/docs/ and from there, unless --quick, to docs/measured/. What a machine lacks (the Middlebury
pairs, OpenCV) is named, left out, and its page of docs/ stays as it is.
"""
import argparse
import csv
import hashlib
import json
import os
import re
import shutil
import statistics
import subprocess
import sys
import time

import bench_report
import charts

PAIRS = ("cones/disp2.png", "teddy/disp2.png", "motorcycle/motorcycle_disp.npz", "aloe/aloeGT.png")
SCENES = ("bush", "pedestrian", "transportation", "cell", "humvee", "cd-cases", "cat")
ALL_PRESETS = ("bush", "pedestrian")  # scenes that are matched with every preset
SEEDS = (2, 3)  # more draws of each scene, in half size, for the clear picture
KINDS = ("leaves", "foliage", "branches", "slats", "mesh", "crowd")  # occluders of layered scenes
SETS = {"development": (1, 2), "validation": (3001, 3002)}  # seeds; methods are tuned on the first only
SKIP_SCENES = ("pedestrian", "bush", "cd-cases")
PARTS = {"stereo": "stereo.csv", "render": "render.csv", "rectify": "rectify.csv", "scenes": "scenes.json", "seeds": "seeds.json",
         "layers": "layers.json", "skips": "skips.json", "render-skips": "render-skips.json", "live": "live.json",
         "clear": "clear.csv", "pipeline": "pipeline.json",
         "networks": "networks.json", "density": "density.json", "narrow": "narrow.json", "limits": "limits.csv"}  # raw figures
COVERS = (0, 20, 40, 60, 80)  # percent of the picture that foliage hides
NARROW = ("bust", "terrace")
LIMITED = {"SST_CPU": "avx2", "ONEDNN_MAX_CPU_ISA": "AVX2"}  # environment of a program that is limited to AVX2
THREADS = "2"


def say(text):
    print(f"bench: {text}", file=sys.stderr, flush=True)


def call(*command, **options):
    return subprocess.run([str(c) for c in command], check=True, text=True, **options)


def busy():
    """Processors that other programs keep busy, over a second."""
    def read():
        with open("/proc/stat") as f:
            ticks = [int(t) for t in f.readline().split()[1:9]]
        return sum(ticks) - ticks[3] - ticks[4], sum(ticks)
    first = read()
    time.sleep(1)
    used, passed = (b - a for a, b in zip(first, read()))
    return os.cpu_count() * used / max(passed, 1)


def wait_for_quiet(part):
    """Wall times need idle processors: wait a minute for them, then measure all the same. Returns how busy they are."""
    for _ in range(30):
        if (used := busy()) < 0.3:
            return used
        time.sleep(1)
    say(f"warning: {part}: other programs keep {used:.1f} processors busy; wall times are too long, CPU times less so")
    return used


def write(path, text):
    """A file that appears whole or not at all."""
    with open(path + ".part", "w") as f:
        f.write(text)
    os.replace(path + ".part", path)


def to_file(path, *commands):
    """Tables that the commands print, one after the other under the first one's heading, as one file, whole or not."""
    lines = []
    for command in commands:
        table = call(*command, stdout=subprocess.PIPE).stdout.splitlines(True)
        lines += table[1:] if lines else table
    write(path, "".join(lines))


def levels(sst):
    """{level of the processor: environment} of the measurements: the best, then AVX2 where that is less."""
    best = json.loads(call(sst, "version", "--json", stdout=subprocess.PIPE).stdout)["cpu"]
    return {best: {}} | ({"avx2": LIMITED} if best in ("avxvnni", "avx512") else {})


def limited(environment):
    return [*(["env"] if environment else []), *(f"{name}={value}" for name, value in environment.items())]


def stereo(build, out, data, rounds):
    if not all(os.path.exists(os.path.join(data, p)) for p in PAIRS):
        return say(f"skipped: stereo; {data} lacks the Middlebury pairs cones, teddy, motorcycle and aloe, give --data DIR")
    if not os.path.exists(f"{build}/bench/stereo"):
        return say("skipped: stereo; this build has no OpenCV to compare with, install libopencv-dev")
    say(f"stereo: 4 pairs, 6 methods, {rounds} rounds")
    call(sys.executable, "scripts/stereo_truth.py", data, out)
    to_file(f"{out}/stereo.csv", [f"{build}/bench/stereo", data, out, rounds])


def render(build, out, sizes, rounds):
    if not os.path.exists(f"{build}/bench/render"):
        return say("skipped: render; this build has no OpenCV to compare with, install libopencv-dev")
    say(f"render: 36 views of {' and '.join(sizes)}, {rounds} rounds")
    to_file(f"{out}/render.csv", *([f"{build}/bench/render", size, rounds] for size in sizes))


def rectify(build, out, picture, rounds):
    if not os.path.exists(picture):
        return say(f"skipped: rectify; {picture} is absent, give --data DIR")
    if not os.path.exists(f"{build}/bench/rectify"):
        return say("skipped: rectify; this build has no OpenCV to compare with, install libopencv-dev")
    say(f"rectify: {rounds} rounds")
    to_file(f"{out}/rectify.csv", [f"{build}/bench/rectify", picture, rounds])


def evaluate(sst, lf, truth):
    return json.loads(call(sst, "eval", lf, "--truth", truth, "--json", "--threads", THREADS, stdout=subprocess.PIPE).stdout)


def process(sst, lf, truth, *options):
    """One run of sst process and what sst eval says of it."""
    report = json.loads(call(sst, "process", lf, "--json", "--threads", THREADS, *options,
                             stdout=subprocess.PIPE).stdout)
    return report | evaluate(sst, lf, truth)


def digest(lf, maps):
    """SHA-256 of all maps of a kind; None where there are none."""
    if not os.path.isdir(f"{lf}/{maps}"):
        return None
    total = hashlib.sha256()
    for name in sorted(os.listdir(f"{lf}/{maps}")):
        with open(f"{lf}/{maps}/{name}", "rb") as f:
            total.update(f.read())
    return total.hexdigest()


def process_levels(sst, lf, truth, *options, rounds=1):
    """As process(), and at every level, in turn, the times: report["levels"][level] has medians of seconds and cpu_seconds,
    and which maps have other bytes than the best level's, whose errors the report holds."""
    report, times, maps = {}, {}, {}
    for i in range(rounds):
        for level, environment in levels(sst).items():
            said = json.loads(call(sst, "process", lf, "--json", "--threads", THREADS, *options, stdout=subprocess.PIPE,
                                   env=os.environ | environment).stdout)
            times.setdefault(level, []).append(said)
            maps.setdefault(level, {kind: digest(lf, kind) for kind in ("disparity", "labels")})
            report = report or said | evaluate(sst, lf, truth)
    best = next(iter(maps.values()))
    report["maps"] = [kind for kind, hashed in best.items() if hashed]
    report["levels"] = {
        level: {key: {stage: statistics.median(r[key][stage] for r in runs) for stage in runs[0][key]}
                for key in ("seconds", "cpu_seconds")} | {"differ": [k for k in best if best[k] != maps[level][k]]}
        for level, runs in times.items()}
    return report


def opencv_views(build, lf):
    """Times and errors of OpenCV's modes on all views of a light field, each with its neighbour; none without OpenCV."""
    if not os.path.exists(f"{build}/bench/stereo"):
        return []
    lines = call(f"{build}/bench/stereo", lf, 1, stdout=subprocess.PIPE).stdout.splitlines()
    return [{k: v if k in ("level", "pair", "method") else float(v) for k, v in row.items()} for row in csv.DictReader(lines)]


def scene(build, out, name, size, presets):
    say(f"scene {name}, {size}")
    sst, lf, model = f"{build}/sst", f"{out}/lf", os.path.exists(os.path.join(os.environ["SST_MODELS"], "pspnet-small.onnx"))
    call(sst, "scene", name, "-o", lf, "--size", size, "--seed", 1, "--force")
    truth, labels = f"{lf}/truth", [] if model else ["--labels", f"{lf}/truth"]
    result = {"scene": name, "size": size, "labels": "network" if model else "given", "presets": {}}
    for preset in ("balanced", *presets):
        result["presets"][preset] = process_levels(sst, lf, truth, "--preset", preset, *labels)
    result["opencv"] = opencv_views(build, lf) if presets else []
    result["truth"] = process(sst, lf, truth, "--labels", truth, "--disparity", truth)
    shutil.rmtree(lf)
    return result


def scenes(build, out, names, size):
    results = [scene(build, out, n, size, ("preview", "accurate") if n in ALL_PRESETS else ()) for n in names]
    write(f"{out}/scenes.json", json.dumps(results, indent=1))


def seeds(build, out, names, drawn, size):
    """Clear pictures of other draws of the scenes, with the maps of sst process and with the true ones."""
    results = []
    for seed in drawn:
        for name in names:
            say(f"scene {name}, {size}, seed {seed}")
            lf, sst = f"{out}/lf", f"{build}/sst"
            call(sst, "scene", name, "-o", lf, "--size", size, "--seed", seed, "--force", "-q", stdout=subprocess.DEVNULL)
            own, true = (process(sst, lf, f"{lf}/truth", "--no-labels", *options)["clear"]
                         for options in ((), ("--disparity", f"{lf}/truth")))
            results.append({"scene": name, "seed": seed, "size": size, "own": own, "truth": true})
            shutil.rmtree(lf)
    write(f"{out}/seeds.json", json.dumps(results, indent=1))


def layered(sst, out, camvid, name, kind, seed):
    """A light field of photographs in layers, measured with the maps of sst process and with the true ones."""
    say(f"layers, {name}: {kind}, seed {seed}")
    lf = f"{out}/lf"
    truth = f"{lf}/truth"
    call(sst, "scene", "layers", "-o", lf, "--photos", f"{camvid}/train", "--masks", f"{camvid}/trainannot", "--kind",
         kind, "--seed", seed, "--size", "640x480", "--threads", THREADS, "--force", "-q", stdout=subprocess.DEVNULL)
    result = {"set": name, "kind": kind, "seed": seed, "own": process(sst, lf, truth, "--no-labels"),
              "truth": process(sst, lf, truth, "--no-labels", "--disparity", truth)}
    shutil.rmtree(lf)
    return result


def layers(build, out, camvid, sets):
    if not all(os.path.isdir(f"{camvid}/{part}") for part in ("train", "trainannot")):
        return say(f"skipped: layers; {camvid} lacks CamVid's train and trainannot, give --camvid DIR")
    results = [layered(f"{build}/sst", out, camvid, name, kind, seed)
               for name, seeds in sets.items() for kind in KINDS for seed in seeds]
    write(f"{out}/layers.json", json.dumps(results, indent=1))


def limits(build, out, rounds):
    say(f"limits of this machine, {rounds} rounds")
    to_file(f"{out}/limits.csv", *([*limited(environment), f"{build}/bench/peaks", rounds]
                                    for environment in levels(f"{build}/sst").values()))


def density(build, out, size, rounds):
    """One scene behind foliage that hides more and more of it: cost and errors of the whole command."""
    results, sst, lf = [], f"{build}/sst", f"{out}/lf"
    model = os.path.exists(os.path.join(os.environ["SST_MODELS"], "pspnet-small.onnx"))
    for cover in COVERS:
        say(f"density: foliage over {cover} % of {size}, {rounds} rounds")
        call(sst, "scene", "layers", "-o", lf, "--kind", "foliage", "--cover", cover, "--seed", 1, "--size", size, "--threads",
             THREADS, "--force", "-q", stdout=subprocess.DEVNULL)
        report = process_levels(sst, lf, f"{lf}/truth", *([] if model else ["--no-labels"]), rounds=rounds)
        results.append({"cover": cover, "size": size, "labels": model, "rounds": rounds, "report": report,
                        "opencv": opencv_views(build, lf)})
        shutil.rmtree(lf)
    write(f"{out}/density.json", json.dumps(results, indent=1))


def narrow_scene(sst, out, name, size):
    """The 6x6 views of a scene of 9x9 that HCI's benchmark leaves, with their truth, as out/lf."""
    whole, lf = f"{out}/lf9", f"{out}/lf"
    call(sst, "scene", name, "-o", whole, "--grid", "9x9", "--size", size, "--seed", 1, "--threads", THREADS, "--force", "-q",
         stdout=subprocess.DEVNULL)
    with open(f"{whole}/truth/truth.json") as f:
        low, high = json.load(f)["range_px"]
    call(sst, "import", "folder", f"{whole}/views", "--grid", "9x9", "--part", "1,1,6x6", "--range-min", low, "--range-max", high,
         "-o", lf, "--force", "-q", stdout=subprocess.DEVNULL)
    os.makedirs(f"{lf}/truth")
    for row in range(6):
        for col in range(6):
            shutil.copy(f"{whole}/truth/{row + 1:02}_{col + 1:02}.pfm", f"{lf}/truth/{row:02}_{col:02}.pfm")
    shutil.rmtree(whole)


def narrow(build, out, hci, names, size, rounds):
    results, sst, lf = [], f"{build}/sst", f"{out}/lf"
    if not os.path.isdir(hci):
        say(f"backgammon left out; {hci} is absent, give --hci DIR")
    for name in ([*(["backgammon"] if os.path.isdir(hci) else []), *names]):
        say(f"narrow: {name}, {rounds} rounds")
        if name == "backgammon":
            call(sst, "import", "hci", hci, "-o", lf, "--force", "-q", stdout=subprocess.DEVNULL)
        else:
            narrow_scene(sst, out, name, size)
        report = process_levels(sst, lf, f"{lf}/truth", "--no-labels", rounds=rounds)
        kinds = json.loads(call(sys.executable, "scripts/narrow_kinds.py", lf, stdout=subprocess.PIPE).stdout)
        results.append({"scene": name, "size": size, "rounds": rounds, "report": report, "kinds": kinds})
        shutil.rmtree(lf)
    write(f"{out}/narrow.json", json.dumps(results, indent=1))


def skips_of(sst):
    """What sst process can skip, from the description of its option; none before it had one."""
    described = json.loads(call(sst, "process", "--describe", stdout=subprocess.PIPE).stdout)
    meaning = next((o["help"] for o in described["options"] if o["name"] == "skip"), ": none")
    return [w for w in re.findall(r"[a-z]+", meaning.rpartition(":")[2]) if w not in ("all", "none", "or")]


def skips(build, out, names, size):
    """What leaving work out saves and spoils: each skip alone, and all, against none."""
    results, sst, lf = [], f"{build}/sst", f"{out}/lf"
    model = os.path.exists(os.path.join(os.environ["SST_MODELS"], "pspnet-small.onnx"))
    for name in names:
        say(f"skips: {name}, {size}")
        call(sst, "scene", name, "-o", lf, "--size", size, "--seed", 1, "--force", "-q", stdout=subprocess.DEVNULL)
        for skip in ("none", *skips_of(sst), "all"):
            report = process_levels(sst, lf, f"{lf}/truth", "--skip", skip, *([] if model else ["--no-labels"]))
            results.append({"scene": name, "size": size, "skip": skip, "report": report})
        shutil.rmtree(lf)
    write(f"{out}/skips.json", json.dumps(results, indent=1))


def render_skips(build, out, names, size, rounds):
    """See-through pictures with skips beside exact ones, in turn, at every level."""
    results, sst, lf = [], f"{build}/sst", f"{out}/lf"
    for name in names:
        say(f"render-skips: {name}, {size}")
        call(sst, "scene", name, "-o", lf, "--size", size, "--seed", 1, "--force", "-q", stdout=subprocess.DEVNULL)
        call(sst, "process", lf, "-q", stdout=subprocess.DEVNULL)
        for _ in range(rounds):
            for level, environment in levels(sst).items():
                for skip in ("none", "rays"):
                    report = call(sst, "render", lf, "--skip", skip, "--repeat", 15, "--threads", THREADS, "--json", "-o",
                                  f"{out}/skip.png", stdout=subprocess.PIPE, env=os.environ | environment).stdout
                    results.append({"scene": name, "size": size, "level": level, "skip": skip, "report": json.loads(report)})
        shutil.rmtree(lf)
    write(f"{out}/render-skips.json", json.dumps(results, indent=1))


def live(build, out, sets):
    """What the live engine leaves out of frames, from a still scene to one that moves everywhere: the table of live_frames."""
    say(f"live frames, {sets} sets of each world; worlds that are not in the cache take a minute each")
    results = []
    for level, environment in levels(f"{build}/sst").items():
        lines = call(f"{build}/bench/live_frames", sets, stdout=subprocess.PIPE, env=os.environ | environment).stdout.splitlines()
        cells = [[cell.strip(" %") for cell in line.strip("|").split("|")] for line in lines]
        results += [{"level": level, **dict(zip(cells[0], row))} for row in cells[2:]]
    write(f"{out}/live.json", json.dumps(results, indent=1))


def pipeline(build, out, names, sets, presets):
    """From decoded frames to the picture, live and by sst process, on the same frames: the tables of live_scene."""
    results = []
    for name in names:
        for level, environment in levels(f"{build}/sst").items():
            say(f"live and offline maps of {name}, {level}, {sets} sets{'' if presets else ', without presets'}")
            lines = call(f"{build}/bench/live_scene", name, sets, sets - 1, THREADS, "/tmp", "", *([] if presets else ["quick"]),
                         stdout=subprocess.PIPE, env=os.environ | environment).stdout.splitlines()
            results.append({"scene": name, "level": level, "sets": list(csv.DictReader(lines))})
    write(f"{out}/pipeline.json", json.dumps(results, indent=1))


def clear(build, out, sets):
    """Times of the live picture, set by set: the table of live_clear."""
    say(f"live clear picture, {sets} sets")
    table = []
    for level, environment in levels(f"{build}/sst").items():
        head, *lines = call(f"{build}/bench/live_clear", "pedestrian", f"sets={sets}", stdout=subprocess.PIPE,
                            env=os.environ | environment).stdout.splitlines()
        table += [] if table else [f"level,{head}"]
        table += [f"{level},{line}" for line in lines if not line.startswith("mean")]
    write(f"{out}/clear.csv", "".join(line + "\n" for line in table))


def networks(build, out, rounds):
    """Networks as the program runs them, beside their convolutions alone."""
    say(f"networks, {rounds} rounds")
    results = [{"level": level, **json.loads(call(f"{build}/bench/network", f"{os.environ['SST_MODELS']}/{name}", size, rounds,
                                                  stdout=subprocess.PIPE, env=os.environ | environment).stdout)}
               for name, size in (("pspnet-small.onnx", "480x360"), ("mccnn-fast.onnx", "1000x750"))
               for level, environment in levels(f"{build}/sst").items()]
    write(f"{out}/networks.json", json.dumps(results, indent=1))


def version(*command):
    """First line of what a command says of itself, or none where it is absent."""
    try:
        return call(*command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL).stdout.splitlines()[0]
    except (OSError, IndexError, subprocess.CalledProcessError):
        return None


def everything(build, out, used):
    """All raw figures and what they hold for, as one file. used: processors that others kept busy when a part began."""
    figures = {}
    for part, name in PARTS.items():
        if os.path.exists(f"{out}/{name}"):
            with open(f"{out}/{name}") as f:
                figures[part] = json.load(f) if name.endswith(".json") else list(csv.DictReader(f))
    with open(f"{build}/flags") as f:
        flags = f.read().strip()
    sst = json.loads(call(f"{build}/sst", "version", "--json", stdout=subprocess.PIPE).stdout)
    about = {"commit": version("git", "describe", "--always", "--dirty", "--abbrev=12"), "flags": flags,
             "compiler": version("gcc", "--version"), "processor": charts.cpu_name(), "kernels": sst["cpu"],
             "levels": [*levels(f"{build}/sst")], "threads": int(THREADS), "processors_busy": used, "made": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime())}
    write(f"{out}/bench.json", json.dumps({**about, "figures": figures}, indent=1))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--build", default="build", help="folder with the built programs (build)")
    parser.add_argument("--data", default="../shared/data/stereo-middlebury", help="Middlebury pairs (%(default)s)")
    parser.add_argument("--camvid", default="../shared/data/camvid", help="CamVid's pictures (%(default)s)")
    parser.add_argument("--hci", default="../shared/data/lf-hci-backgammon-6x6", help="HCI's backgammon (%(default)s)")
    parser.add_argument("--only", choices=PARTS, help="measure this part alone")
    parser.add_argument("--quick", action="store_true", help="few rounds and small pictures; docs/ stays as it is")
    args = parser.parse_args()
    os.chdir(os.path.join(os.path.dirname(os.path.abspath(__file__)), ".."))
    os.environ.setdefault("SST_MODELS", os.path.abspath("models"))
    if not shutil.which("gnuplot"):
        sys.exit("bench: gnuplot, which draws the charts, is missing: install gnuplot-nox")
    out, start = f"{args.build}/bench" + ("-quick" if args.quick else ""), time.monotonic()
    os.makedirs(out, exist_ok=True)
    size, names = ("500x375", SCENES[:1]) if args.quick else ("1000x750", SCENES)
    rounds = 3 if args.quick else 11
    parts = {
        "limits": lambda: limits(args.build, out, rounds),
        "stereo": lambda: stereo(args.build, out, args.data, rounds),
        "render": lambda: render(args.build, out, (size,) if args.quick else ("2000x1500", size), rounds),
        "rectify": lambda: rectify(args.build, out, f"{args.data}/aloe/aloeL.jpg", rounds),
        "scenes": lambda: scenes(args.build, out, names, size),
        "seeds": lambda: seeds(args.build, out, names, SEEDS[:1] if args.quick else SEEDS, "500x375"),
        "skips": lambda: skips(args.build, out, SKIP_SCENES[:1] if args.quick else SKIP_SCENES, "500x375"),
        "render-skips": lambda: render_skips(args.build, out, SKIP_SCENES[:1] if args.quick else SKIP_SCENES, size,
                                             2 if args.quick else 3),
        "live": lambda: live(args.build, out, 6 if args.quick else 21),
        "clear": lambda: clear(args.build, out, 6 if args.quick else 21),
        "pipeline": lambda: pipeline(args.build, out, ALL_PRESETS[1:] if args.quick else ALL_PRESETS, 4 if args.quick else 9,
                                     not args.quick),
        "networks": lambda: networks(args.build, out, rounds),
        "density": lambda: density(args.build, out, "240x180" if args.quick else "500x375", 1 if args.quick else 3),
        "narrow": lambda: narrow(args.build, out, args.hci, NARROW[:1] if args.quick else NARROW,
                                 "160x160" if args.quick else "512x512", 1 if args.quick else 3),
        "layers": lambda: layers(args.build, out, args.camvid, {"development": (1,)} if args.quick else SETS),
    }
    used = {}
    wanted = [args.only] if args.only else [*parts]
    one_page = {"scenes": "seeds", "seeds": "scenes"}
    if args.only in one_page and not os.path.exists(f"{out}/{PARTS[one_page[args.only]]}"):
        wanted.append(one_page[args.only])
    for part in wanted:
        if os.path.exists(f"{out}/{PARTS[part]}"):
            os.remove(f"{out}/{PARTS[part]}")
        used[part] = wait_for_quiet(part)
        parts[part]()
    everything(args.build, out, used)
    made = bench_report.write(out, "make bench-quick" if args.quick else "make bench")
    if not args.quick:
        os.makedirs("docs/measured", exist_ok=True)
        for path in made:
            shutil.copy(path, "docs/measured")
        call(sys.executable, "scripts/readme_figures.py", out)
    say(f"{time.monotonic() - start:.0f} s; tables and charts are in {f'{out}/docs' if args.quick else 'docs/measured'}")


if __name__ == "__main__":
    try:
        main()
    except subprocess.CalledProcessError as error:
        sys.exit(f"bench: stopped: {error}")
