# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
"""Pictures on a device against the CPU's, for scripts/bench_gpu.py: of light fields with true maps, of raw frames, and
with verified rays in little memory."""
import json
import os
import re
import statistics

import numpy as np
from PIL import Image

import charts

REPEAT = 3  # pictures of a round after the first
REPEAT_SHADERS = 100  # of what shaders take: until clocks are up
VIEWS = 36
SIZES = ((250, 188), (500, 375), (1000, 750), (2000, 1500))
SOFTWARE_WIDTH = 250  # software devices are measured up to it
# Options, views, and bytes a ray takes: 6 where nothing else is said; clear: 6, and 4 to land, written and read; verified
# rays, where all pixels are left to votes: 6 to blend, 2 for the share, 6 to 4 of a ray with its votes, 4 to 2 of how near
# it is, which are read at last.
METHODS = {"refocus": (["--method", "refocus"], VIEWS, 4), "see-through": ([], VIEWS, 6),
           "see-through, soft aperture": (["--soft"], VIEWS, 6), "verified rays": (["--verify-rays", "on"], VIEWS, 30),
           "clear": (["--method", "clear"], VIEWS, 14),
           "clear, 9 views": (["--method", "clear", "--max-views", "9"], 9, 14)}
# Of raw frames; the cut is a share of the width. Rays are not verified: those of views are tested, not those of frames.
FRAMES = {"see-through": ["--verify-rays", "off"], "clear": ["--method", "clear", "--cut", "{cut}"]}
FRAMES_SIZES = ((1008, 752), (2000, 1504))
FRAMES_CUT = 0.045
SOFTWARE_FRAMES = (256, 192)
# Sizes of views, and MiB of the device that may be used; None: three quarters of it.
RAYS = ((1000, 750, (None, 256, 128)), (2000, 1500, (None, 1024, 512)))
SOFTWARE_RAYS = (250, 188, (None, 8))

# Cameras with lenses that distort, turned a little, of different gains.
WORLD = """scene: {scene}
grid: [6, 6]
size: [{width}, {height}]
strip: false
jpeg_quality: 92
loop: {{ seconds: {seconds}, rate_hz: {rate} }}
optics: {{ distortion: [-0.15, 0.04, 0, 0, 0], focal_spread_percent: 0.5, principal_spread_px: 3, vignetting: 0.2 }}
mounting: {{ rotation_spread_deg: 0.8, position_spread_mm: 2 }}
sensor: {{ gain_spread_percent: 3 }}
"""


def render(bench, field, options, device):
    """The report and the picture."""
    path = os.path.join(bench.folder, f"{'cpu' if device == 'cpu' else 'gpu'}.png")
    out, seconds = bench.timed("render", field, *options, "--device", device, "--repeat", str(REPEAT), "-o", path, "--json")
    report = json.loads(out)
    report["command_s"] = seconds
    return report, np.asarray(Image.open(path)).astype(int)


def rounds_of(bench, field, options, device_options=()):
    """Rounds of CPU and device in turn: the medians of what both report, the last report of the device, and how far its
    picture is off."""
    rounds = []
    for _ in range(bench.rounds):
        cpu, want = render(bench, field, options, "cpu")
        gpu, got = render(bench, field, [*options, *device_options], bench.device["name"])
        d = gpu["device"]
        assert d["on_cpu"] == 0 and d["failures"] == 0 and d["filled_on_cpu"] == 0, d
        rounds.append({"cpu_ms": cpu["render_ms"]["median"], "all_ms": gpu["render_ms"]["median"],
                       "cpu_s": cpu["command_s"], "all_s": gpu["command_s"],
                       "device_ms": d["picture_ms"] - d["download_ms"], "download_ms": d["download_ms"],
                       "upload_ms": d["upload_ms"], "upload_mb": d["upload_bytes"] / 1e6, "frames_ms": d["frames_ms"]})
    return {k: statistics.median(r[k] for r in rounds) for k in rounds[0]}, gpu, abs(want - got)


def shaders_ms(bench, field, options):
    """What the shaders of a picture take together, the mean over many."""
    path = os.path.join(bench.folder, "gpu.png")
    _, log = bench.sst("render", field, *options, "--device", bench.device["name"], "--repeat", str(REPEAT_SHADERS), "-o", path,
                       "-v", env={"SST_GPU_TIMES": "1"}, log=True)
    return sum(float(ms) for ms in re.findall(r": ([\d.]+) ms in \d+ dispatches", log)) / (REPEAT_SHADERS + 1)


def off(apart):
    return [str(apart.max()), f"{100 * (apart > 0).mean():.3f}"]


def bench_pictures(bench):
    rows, limits = [], bench.limits()
    for size in [s for s in SIZES if not bench.software or s[0] <= SOFTWARE_WIDTH]:
        if bench.quick and not bench.software and size not in SIZES[2:]:
            continue
        for scene in ("bush",) if bench.quick else ("bush", "transportation"):
            world = bench.world(scene, size)
            # True maps, which are trusted: rays are verified only where that is asked for.
            field = bench.field(f"{world}/views", "--disparity", f"{world}/truth", "--labels", f"{world}/truth")
            for name, (options, views, ray_bytes) in METHODS.items():
                bench.progress(scene, size, name)
                m, gpu, apart = rounds_of(bench, field, options)
                assert gpu["device"]["verified_on_cpu"] == 0, gpu
                shaders = m["device_ms"] if bench.software else shaders_ms(bench, field, options)
                gb_s = gpu["width"] * gpu["height"] * views * ray_bytes / shaders / 1e6
                filled = f", {gpu['filled_percent']:.1f} % filled" if "clear" in name else ""
                rows.append([f"{scene} {size[0]}x{size[1]}, {name}{filled}", f"{m['cpu_ms']:.1f}", f"{m['all_ms']:.1f}",
                             f"{m['all_ms'] / m['cpu_ms']:.2f}", f"{m['device_ms']:.2f}",
                             "" if bench.software else f"{shaders:.3f}", f"{m['download_ms']:.2f}",
                             f"{m['upload_ms']:.0f} ({m['upload_mb']:.0f})", f"{gb_s:.1f}",
                             f"{100 * gb_s / limits['copy_gb_s']:.0f}"] + off(apart))
            bench.remove(field)
    head = ["36 views of", "CPU ms", "with device ms", "ratio", "on device ms", "of them shaders ms", "download ms",
            "upload ms (MB)", "GB/s of rays", "of the copy rate %", "worst levels", "values that differ %"]
    return (f"Holes of clear pictures are filled on the device. Of GPUs the shaders' own time is the mean of {REPEAT_SHADERS} pictures, "
            "and the rates are those of the shaders.\n\n" + charts.table(head, rows))


def world_file(bench, scene, width, height, seconds, rate):
    path = os.path.join(bench.folder, f"{scene}-{width}.yaml")
    with open(path, "w", encoding="utf-8") as f:
        f.write(WORLD.format(scene=scene, width=width, height=height, seconds=seconds, rate=rate))
    return path


def match(bench, field, preset):
    """Its maps, on a GPU where that is measured: they are the same."""
    bench.progress("maps", preset)
    device = "cpu" if bench.software else bench.device["name"]
    bench.sst("process", field, "--no-labels", "--preset", preset, "--device", device)


def frames_field(bench, width, height):
    """A calibrated light field of the JPEG frames of simulated cameras, with maps."""
    shots = bench.path(f"shots-{width}")
    os.makedirs(shots)
    bench.program("bench/raw_frames", world_file(bench, "bush", width, height, 0.5, 2), shots)
    field = bench.field(f"{shots}/frames", "--calib", f"{shots}/calib.yaml")
    match(bench, field, "balanced")
    bench.remove(shots)
    return field


def bench_frames(bench):
    rows = []
    for width, height in [SOFTWARE_FRAMES] if bench.software else FRAMES_SIZES[:1] if bench.quick else FRAMES_SIZES:
        field = frames_field(bench, width, height)
        for sampling in ("rectified", "raw"):
            for name, options in FRAMES.items():
                bench.progress("frames", width, height, sampling, name)
                options = [o.format(cut=FRAMES_CUT * width) for o in options]
                m, gpu, apart = rounds_of(bench, field, [*options, "--sampling", sampling])
                assert gpu["device"]["verified_on_cpu"] == 0 and gpu["sampling"] == sampling, gpu
                filled = f", {gpu['filled_percent']:.1f} % filled" if name == "clear" else ""
                rows.append([f"{width}x{height}, {sampling}, {name}{filled}", f"{m['cpu_s']:.2f}", f"{m['all_s']:.2f}",
                             f"{m['cpu_ms']:.1f}", f"{m['all_ms']:.1f}", f"{m['device_ms']:.2f}",
                             f"{m['upload_ms']:.0f} ({m['upload_mb']:.0f})", f"{m['frames_ms']:.0f}",
                             str(gpu["device"]["in_parts"])] + off(apart))
        bench.remove(field)
    head = ["`bush`, 36 frames of", "CPU, command s", "with device, command s", "CPU ms", "with device ms",
            "on device ms", "upload ms (MB)", "frames ms", "pictures in parts", "worst levels", "values that differ %"]
    return (f"""JPEG frames of calibrated cameras, `--sampling rectified` and `raw`. A command makes {REPEAT + 1} pictures: its seconds
include loading, and with a device its opening and tests; milliseconds are those of a picture after the first one.
Views are rectified once: without a device while the CPU loads them, with one for the first picture. "Upload", and
"frames", the part of it that decodes and makes tables, are those of all pictures.

""" + charts.table(head, rows))


def bench_rays(bench):
    rows = []
    for width, height, memory in [SOFTWARE_RAYS] if bench.software else RAYS[:1] if bench.quick else RAYS:
        field = bench.field(f"{bench.world('bush', (width, height))}/views")
        match(bench, field, "preview")
        for mib in memory:
            bench.progress("rays", width, height, mib or "all memory")
            m, gpu, apart = rounds_of(bench, field, ["--verify-rays", "auto"],
                                      ["--device-memory", str(mib)] if mib else [])
            d = gpu["device"]
            rows.append([f"{width}x{height}, " + (f"{mib} MiB" if mib else "all memory"), f"{m['cpu_ms']:.1f}",
                         f"{m['all_ms']:.1f}", f"{m['all_ms'] / m['cpu_ms']:.2f}", f"{m['device_ms']:.2f}",
                         f"{m['upload_ms'] / d['pictures']:.1f} ({m['upload_mb'] / d['pictures']:.0f})",
                         f"{d['dispatches'] / d['pictures']:.0f}", f"{d['verified_on_cpu']} of {d['pictures']}"] + off(apart))
        bench.remove(field)
    head = ["36 views of", "CPU ms", "with device ms", "ratio", "on device ms", "upload a picture, ms (MB)",
            "dispatches a picture", "verified on the CPU", "worst levels", "values that differ %"]
    return """`--verify-rays auto` with maps of the preset preview, `--device-memory` as named. Where that does not hold all views in one
buffer they are compared in rows, and give way to each other.

""" + charts.table(head, rows)
