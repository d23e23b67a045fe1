#!/usr/bin/python3
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
"""Measure pictures, matching and networks on every device against the CPU, interleaved in
one run, and renew docs/measured/gpu.md.

All through `sst render`, `sst process` and benches on simulated light fields: times of the device and the CPU, and what differs
in their results. `make bench-gpu` runs this; software devices are measured as well, for their errors. Sections of the page
that are not measured stay as they are: with --devices those of the other devices, with --only the other parts. A machine that
cannot build needs the programs (BUILD/sst, which has the shaders, BUILD/bench), models/ and
scripts/; --merge puts a page that it wrote into this one. Needs python3-numpy, python3-pil.
"""
import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
import traceback

ROOT = os.path.abspath(os.path.join(os.path.dirname(os.path.abspath(__file__)), ".."))
sys.path.insert(0, os.path.join(ROOT, "scripts"))
import charts  # noqa: E402
import gpu_page  # noqa: E402
import gpu_pictures  # noqa: E402
import gpu_stages  # noqa: E402

ROUNDS = 3
LONG = ("matching", "times")  # one round with --quick
ONCE = ("limits", "sgm", "whole")
SPEED = ("live", "sgm", "times")  # without a meaning for software devices


def bench_limits(bench):
    d = bench.device
    return (f"{d['driver']}, {d['memory_bytes'] / 2**30:.1f} GiB.\n\n" +
            (gpu_page.SOFTWARE + "\n\n" if bench.software else "") + gpu_page.limits_text(bench.limits()))


# In the order of the page; `limits` is measured with each of the others.
PARTS = {"limits": bench_limits, "pictures": gpu_pictures.bench_pictures, "frames": gpu_pictures.bench_frames,
         "rays": gpu_pictures.bench_rays, "matching": gpu_stages.bench_matching,
         "sgm": gpu_stages.bench_sgm, "whole": gpu_stages.bench_whole,
         "times": gpu_stages.bench_times, "networks": gpu_stages.bench_networks}


class Bench:
    """A device, the programs, and a folder for light fields."""

    def __init__(self, build, folder, device, quick):
        self.build, self.folder, self.device, self.quick, self.rounds = build, folder, device, quick, ROUNDS
        self.software = device["kind"] == "software"
        self.reached = None

    def progress(self, *words):
        print(self.device["name"], *words, file=sys.stderr)

    def program(self, name, *args, env=None, log=False):
        """What a program of the build prints; with `log` also its standard error."""
        out = subprocess.run([os.path.join(self.build, name), *args], capture_output=True, text=True,
                             env={**os.environ, **(env or {})})
        if out.returncode:
            raise RuntimeError(f"{name} {' '.join(args)}: {out.stderr.strip()}")
        return (out.stdout, out.stderr) if log else out.stdout

    def sst(self, *args, **options):
        return self.program("sst", *args, **options)

    def timed(self, *args):
        start = time.monotonic()
        return self.sst(*args), time.monotonic() - start

    def limits(self):
        """What the device reaches at most: GB/s copied, TFLOP/s of floats, GB/s up and down."""
        self.reached = self.reached or json.loads(self.program("bench/device_limits", self.device["name"]))
        return self.reached

    def path(self, name):
        """A path in the folder where nothing lies yet."""
        path = os.path.join(self.folder, name)
        self.remove(path)
        return path

    @staticmethod
    def remove(path):
        subprocess.run(["rm", "-rf", path], check=True)

    def world(self, scene, size, grid=(6, 6)):
        """A scene's views and truth; made once."""
        path = os.path.join(self.folder, f"{scene}-{grid[0]}x{grid[1]}-{size[0]}x{size[1]}")
        if not os.path.exists(path):
            self.progress("scene", scene, *size)
            self.sst("scene", scene, "--size", f"{size[0]}x{size[1]}", "--grid", f"{grid[0]}x{grid[1]}", "-o", path)
        return path

    def field(self, views, *options, grid=(6, 6)):
        """A light field of a folder of views; made again each time."""
        path = self.path("lf")
        self.sst("import", "folder", views, "--grid", f"{grid[0]}x{grid[1]}", *options, "-o", path)
        return path

    def copy(self, field, name):
        path = self.path(name)
        shutil.copytree(field, path)
        return path


def measure(bench, parts, args):
    """Renew a device's sections, one after the other, so that none is lost with those after it. Returns whether all
    parts ended well."""
    machine, well = f"On {charts.cpu_name()}, {os.cpu_count()} threads", True
    for part in parts:
        bench.rounds = args.rounds or (1 if args.quick and part in LONG else ROUNDS)
        start = time.monotonic()
        try:
            rounds = "" if part in ONCE else f"; {bench.rounds} round{'s' if bench.rounds > 1 else ''}"
            text = gpu_page.section(bench.device, part, f"{machine}{rounds}.\n\n{PARTS[part](bench)}")
            gpu_page.write(args.page, {(bench.device["name"], part): text})
        except Exception:  # the other parts are worth having
            traceback.print_exc()
            well = False
        bench.progress(f"{part}: {time.monotonic() - start:.0f} s")
    return well


def names(text):
    return [n.strip() for n in text.split(",") if n.strip()]


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--build", default="build", help="folder of the programs (%(default)s)")
    parser.add_argument("--devices", metavar="NAME,...", type=names, help="parts of devices' names (all devices)")
    parser.add_argument("--only", metavar="PART,...", type=names, help=f"of {', '.join(PARTS)} (all)")
    parser.add_argument("--quick", action="store_true", help="one scene, one size, one round of the longer stages")
    parser.add_argument("--rounds", type=int, help=f"({ROUNDS})")
    parser.add_argument("--work", metavar="FOLDER", help="keep scenes there for the next run (a temporary folder)")
    parser.add_argument("--page", default=gpu_page.PAGE, help="page to renew (%(default)s)")
    parser.add_argument("--merge", metavar="PAGE", help="measure nothing; take the sections of this page")
    args = parser.parse_args()
    for part in args.only or []:
        if part not in PARTS:
            parser.error(f"unknown part `{part}`; there are {', '.join(PARTS)}")
    return args


def choose(devices, wanted):
    """Devices whose name or driver has one of these parts, as `sst --device` finds them."""
    for part in wanted or []:
        if not any(part.lower() in f"{d['name']} {d['driver']}".lower() for d in devices):
            sys.exit(f"no device `{part}`; this machine has {', '.join(d['name'] for d in devices)}")
    return [d for d in devices
            if not wanted or any(p.lower() in f"{d['name']} {d['driver']}".lower() for p in wanted)]


def measure_all(args, folder):
    build = os.path.abspath(args.build)
    version = json.loads(subprocess.run([os.path.join(build, "sst"), "version", "--json"], check=True, capture_output=True,
                                        text=True).stdout)
    if not version["devices"]:
        sys.exit("no device: install a Vulkan driver, or mesa-vulkan-drivers for the software device")
    parts = [p for p in PARTS if p == "limits" or not args.only or p in args.only]
    if not version["parts"]["onednn"]:
        parts = [p for p in parts if p not in ("networks", "whole")]
    devices = choose(version["devices"], args.devices)
    benches = [Bench(build, folder, device, args.quick) for device in devices]
    return all([measure(bench, [p for p in parts if not bench.software or p not in SPEED], args) for bench in benches])


def main():
    args = arguments()
    if args.merge:
        with open(args.merge, encoding="utf-8") as f:
            new = gpu_page.read(f.read())
        gpu_page.write(args.page, {(name, part): text for (name, part), text in new.items()
                                   if not args.devices or any(d.lower() in name.lower() for d in args.devices)})
        return 0
    if args.work:
        os.makedirs(args.work, exist_ok=True)
        return 0 if measure_all(args, os.path.abspath(args.work)) else 1
    with tempfile.TemporaryDirectory() as folder:
        return 0 if measure_all(args, folder) else 1


if __name__ == "__main__":
    sys.exit(main())
