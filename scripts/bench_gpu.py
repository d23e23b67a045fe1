#!/usr/bin/python3
"""Measure pictures on every device against the CPU, interleaved in one run, and renew docs/measured/gpu.md.

All through `sst render` on simulated light fields: time of a picture on the device and of its download, upload of the
light field, the share of values that differ and by how much. `make bench-gpu` runs this; software devices are measured as
well, for their errors. Needs python3-numpy, python3-pil.
"""
import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile

import numpy as np
from PIL import Image

ROOT = os.path.abspath(os.path.join(os.path.dirname(os.path.abspath(__file__)), ".."))
sys.path.insert(0, os.path.join(ROOT, "scripts"))
import bench_report  # noqa: E402

PAGE = os.path.join(ROOT, "docs/measured/gpu.md")
SCENES = ("bush", "transportation")
SIZES = ((250, 188), (500, 375), (1000, 750), (2000, 1500))
SOFTWARE_WIDTH = 500  # software devices are measured up to it
METHODS = {"refocus": ["--method", "refocus"], "see-through": [], "see-through, soft aperture": ["--soft"],
           "clear": ["--method", "clear"]}
ROUNDS = 3
REPEAT = 3
RAY_BYTES = {"refocus": 4, "clear": 14}  # 6 for the others; clear: 6, and 4 to land, written and read

ROOFLINE = """## What a large GPU can reach, on paper

No GPU was measured for this part. `blend` reads each ray once: R, G, B and label in 4 bytes, disparity in 2; a picture
adds 4 bytes of result. Neighbouring rays share what interpolation reads besides, which stays in the cache.

| light field | bytes a picture | at 4.3 TB/s (H200, device copy) | at 1.0 TB/s | at 50 GB/s (integrated) |
|---|---:|---:|---:|---:|
"""


def sst(build, *args):
    out = subprocess.run([os.path.join(build, "sst"), *args], check=True, capture_output=True, text=True)
    return out.stdout


def make_field(build, folder, scene, size):
    """A light field with its true maps, which are trusted: no verification takes part."""
    world, field = (os.path.join(folder, f"{scene}-{size[0]}-{k}") for k in ("world", "lf"))
    sst(build, "scene", scene, "--size", f"{size[0]}x{size[1]}", "-o", world)
    sst(build, "import", "folder", f"{world}/views", "--grid", "6x6", "--disparity", f"{world}/truth", "--labels",
        f"{world}/truth", "-o", field)
    subprocess.run(["rm", "-rf", world], check=True)
    return field


def render(build, folder, field, options, device):
    path = os.path.join(folder, f"{'cpu' if device == 'cpu' else 'gpu'}.png")
    report = json.loads(sst(build, "render", field, *options, "--device", device, "--repeat", str(REPEAT), "-o", path,
                            "--json"))
    return report, np.asarray(Image.open(path)).astype(int)


def measure(build, folder, field, name, options, device):
    """Rounds of CPU and device in turn; medians."""
    rounds = []
    for _ in range(ROUNDS):
        cpu, want = render(build, folder, field, options, "cpu")
        gpu, got = render(build, folder, field, options, device)
        d = gpu["device"]
        assert d["on_cpu"] == 0 and d["failures"] == 0, d
        rounds.append((cpu["render_ms"]["median"], gpu["render_ms"]["median"], d["picture_ms"] - d["download_ms"],
                       d["download_ms"], d["upload_ms"], d["upload_bytes"]))
    apart = abs(want - got)
    cpu_ms, all_ms, device_ms, download_ms, upload_ms, upload_bytes = (statistics.median(c) for c in zip(*rounds))
    rays = gpu["width"] * gpu["height"] * 36 * RAY_BYTES.get(name, 6)
    return [f"{cpu_ms:.1f}", f"{all_ms:.1f}", f"{all_ms / cpu_ms:.2f}", f"{device_ms:.2f}", f"{download_ms:.2f}",
            f"{upload_ms:.0f} ({upload_bytes / 1e6:.0f})", f"{rays / device_ms / 1e6:.1f}", str(apart.max()),
            f"{100 * (apart > 0).mean():.3f}"]


def bench_device(build, folder, device):
    rows = []
    for size in SIZES:
        if device["kind"] == "software" and size[0] > SOFTWARE_WIDTH:
            continue
        for scene in SCENES:
            field = make_field(build, folder, scene, size)
            for name, options in METHODS.items():
                print(device["name"], scene, size, name, file=sys.stderr)
                rows.append([f"{scene} {size[0]}x{size[1]}, {name}"] +
                            measure(build, folder, field, name, options, device["name"]))
            subprocess.run(["rm", "-rf", field], check=True)
    head = ["36 views of", "CPU ms", "with device ms", "ratio", "on device ms", "download ms", "upload ms (MB)",
            "GB/s of rays", "worst levels", "values that differ %"]
    note = ("A software device: it runs on the CPU, and shows what the shaders compute, not how fast a GPU is.\n\n"
            if device["kind"] == "software" else "")
    return f"## {device['name']}\n\n{device['driver']}, {device['memory_bytes'] / 2**30:.1f} GiB.\n\n{note}{bench_report.table(head, rows)}\n"


def roofline():
    rows = ""
    for w, h in ((1000, 750), (2000, 1500), (4000, 3000)):
        total = w * h * (36 * 6 + 4)
        rows += f"| 36x{w}x{h} | {total / 1e6:.0f} MB | " + " | ".join(
            f"{total / rate * 1e3:.2f} ms" for rate in (4.3e12, 1.0e12, 5.0e10)) + " |\n"
    return ROOFLINE + rows + """
Download of the picture (4 bytes a pixel) and the CPU's pass over it come on top: 12 MB at 2000x1500, 0.5 ms at 25 GB/s.
"""


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--build", default="build")
    build = os.path.abspath(parser.parse_args().build)
    version = json.loads(sst(build, "version", "--json"))
    if not version["devices"]:
        sys.exit("no device: install a Vulkan driver, or mesa-vulkan-drivers for the software device")
    with tempfile.TemporaryDirectory() as folder:
        parts = [bench_device(build, folder, d) for d in version["devices"]]
    text = (f"The CPU and the device render in turn, {ROUNDS} rounds of {REPEAT} pictures each; medians. \"With device\" is a "
            "whole picture as the\ncaller sees it, with the plan, the download and the CPU's pass; \"on device\" is the "
            "shader with its waits. The upload\nhappens once per light field. Ratios above 1: the CPU is faster.\n\n" +
            "".join(parts) + roofline())
    with open(PAGE, "w", encoding="utf-8") as f:
        f.write(bench_report.page("GPU", "make bench-gpu", text))


if __name__ == "__main__":
    main()
