# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
"""Stages of `sst process` on a device against the CPU, and what its time goes into, for scripts/bench_gpu.py."""
import json
import os
import re
import statistics
import time

import numpy as np
from PIL import Image

import charts
import gpu_page

PRESETS = ("preview", "balanced", "accurate")
SCENES = ("bush", "pedestrian", "transportation", "cell", "humvee", "cd-cases", "cat")
# Rows and columns, width, height of the light fields that are matched.
MATCHED = ((6, 6, 500, 375), (6, 6, 1000, 750), (6, 6, 2000, 1500))
MATCHED_QUICK = ((6, 6, 1000, 750),)
MATCHED_SOFTWARE = ((3, 3, 96, 72), (3, 3, 160, 120))
MATCHED_SOFTWARE_QUICK = ((3, 3, 96, 72),)
# Width, height, disparities of the semi-global optimisation.
PATHS = ((1000, 750, 64), (1000, 750, 128), (2000, 1500, 128), (2000, 1500, 256))
TIMES_SHARE = 0.01  # of the device's time, from which on a shader is listed
# Networks, and sizes of pictures.
NETWORKS = (("pspnet-small.onnx", (480, 360), "int8"), ("pspnet-small.onnx", (480, 360), "f32"),
            ("pspnet-large.onnx", (480, 360), "int8"), ("mccnn-fast.onnx", (640, 256), "int8"), ("mccnn-fast.onnx", (1000, 750), "int8"))
NETWORK_SOFTWARE = (160, 120)


def matched_sizes(bench):
    if bench.software:
        return MATCHED_SOFTWARE_QUICK if bench.quick else MATCHED_SOFTWARE
    return MATCHED_QUICK if bench.quick else MATCHED


def same_maps(a, b, kinds=("disparity", "confidence")):
    """Maps of two folders whose bytes differ, and all of them."""
    names = [os.path.join(d, f) for d in kinds for f in sorted(os.listdir(os.path.join(a, d)))]
    return sum(open(os.path.join(a, n), "rb").read() != open(os.path.join(b, n), "rb").read() for n in names), len(names)


def process_both(bench, field, *options):
    """The reports of CPU and device of a copy of the light field each, and the copies."""
    copies = [bench.copy(field, "cpu"), bench.copy(field, "gpu")]
    return [json.loads(bench.sst("process", copy, *options, "--device", name, "--json"))
            for copy, name in zip(copies, ("cpu", bench.device["name"]))], copies


def figures(stage, reports, d):
    """Seconds of a stage by the CPU, with the device, and what of the latter the device reports."""
    cpu, gpu = reports
    return (cpu["seconds"][stage], gpu["seconds"][stage], d["seconds"], d["wait_seconds"], d["upload_seconds"],
            d["download_seconds"], d["upload_bytes"])


def figures_text(rounds):
    cpu_s, all_s, device_s, wait_s, upload_s, download_s, upload_bytes = (statistics.median(c) for c in zip(*rounds))
    return [f"{cpu_s:.3f}", f"{all_s:.3f}", f"{all_s / cpu_s:.2f}", f"{device_s:.3f}", f"{wait_s:.3f}",
            f"{1e3 * upload_s:.0f} ({upload_bytes / 1e6:.1f})", f"{1e3 * download_s:.0f}"]


FIGURES = ["CPU s", "with device s", "ratio", "device s", "of them waits", "upload ms (MB)", "download ms"]


def bench_matching(bench):
    rows = []
    for grid_rows, cols, width, height in matched_sizes(bench):
        field = bench.field(f"{bench.world('bush', (width, height), (grid_rows, cols))}/views", grid=(grid_rows, cols))
        for preset in PRESETS:
            bench.progress("matching", width, height, preset)
            rounds = []
            for _ in range(bench.rounds):
                reports, copies = process_both(bench, field, "--no-labels", "--preset", preset)
                d = reports[1]["device"]
                assert d["on_cpu"] == 0 and d["tested_on_cpu"] == 0 and d["failures"] == 0, d
                rounds.append(figures("disparity", reports, d))
            other, maps = same_maps(*copies)
            rows.append([f"{grid_rows}x{cols} of {width}x{height}, {preset}"] + figures_text(rounds) +
                        [f"{d['views']} / {d['tested']}", ", ".join(d["stages_on_cpu"]) or "none", f"{other} of {maps}"])
        bench.remove(field)
    return charts.table(["`bush`, views of"] + FIGURES +
                              ["views matched / tested", "stages on the CPU", "maps that differ"], rows)


def measure_whole(bench, field, preset):
    """The whole of `sst process` with labels and the proposed clear picture, once by the CPU and once by the device."""
    (cpu, gpu), copies = process_both(bench, field, "--preset", preset)
    pictures = []
    for copy, name in zip(copies, ("cpu", bench.device["name"])):
        bench.sst("render", copy, "--device", name, "-o", f"{copy}.png")
        pictures.append(np.asarray(Image.open(f"{copy}.png")).astype(int))
    matched, network = gpu["device"], gpu["networks"]
    assert sum(d["on_cpu"] + d["failures"] for d in (matched, network)) == 0, gpu
    other, maps = same_maps(*copies, ("disparity", "confidence", "labels"))
    return [f"{cpu['seconds']['total']:.2f}", f"{gpu['seconds']['total']:.2f}", f"{other} of {maps}",
            str(abs(pictures[0] - pictures[1]).max()), ", ".join(matched["stages_on_cpu"]) or "none"]


def bench_whole(bench):
    rows = []
    grid, size = ((3, 3), (96, 72)) if bench.software else ((6, 6), (1000, 750))
    for scene in SCENES[:1] if bench.quick else SCENES:
        field = bench.field(f"{bench.world(scene, size, grid)}/views", grid=grid)
        for preset in ("balanced",) if bench.quick else PRESETS:
            bench.progress("whole", scene, preset)
            rows.append([f"{scene} {grid[0]}x{grid[1]} of {size[0]}x{size[1]}, {preset}"] + measure_whole(bench, field, preset))
        bench.remove(field)
    head = ["whole `sst process`, with labels", "CPU s", "with device s", "maps that differ", "clear picture: worst levels",
            "stages on the CPU"]
    return "One run each.\n\n" + charts.table(head, rows)


def read_times(log):
    """Milliseconds and dispatches by shader; of all submissions: milliseconds, how many, milliseconds between dispatches.
    The log has a block of lines for each opening of the device, which add up."""
    shaders, total = {}, [0.0, 0, 0.0]
    for line in log.splitlines():
        dispatched = re.search(r": (\w+): ([\d.]+) ms in (\d+) dispatches$", line)
        submitted = re.search(r": ([\d.]+) ms in (\d+) submissions, (-?[\d.]+) of them between dispatches", line)
        if dispatched:
            ms, n = shaders.get(dispatched[1], (0.0, 0))
            shaders[dispatched[1]] = (ms + float(dispatched[2]), n + int(dispatched[3]))
        if submitted:
            total = [t + float(v) for t, v in zip(total, submitted.groups())]
    return shaders, total


def times_of(bench, field, preset):
    """Of the run whose command took the median: its seconds, those that it reports, and the device's times."""
    runs = []
    for _ in range(bench.rounds):
        copy, start = bench.copy(field, "gpu"), time.monotonic()
        report, log = bench.sst("process", copy, "--preset", preset, "--device", bench.device["name"], "-v", "--json",
                                env={"SST_GPU_TIMES": "1"}, log=True)
        runs.append((time.monotonic() - start, json.loads(report)["seconds"], *read_times(log)))
    return sorted(runs, key=lambda r: r[0])[len(runs) // 2]


def times_text(name, command_s, seconds, shaders, total):
    (all_ms, submissions, copies_ms), sum_ms = total, sum(ms for ms, _ in shaders.values())
    stages = ", ".join(f"{k} {v:.2f}" for k, v in seconds.items() if k != "total")
    rows, rest = [], [0.0, 0]
    for shader, (ms, n) in sorted(shaders.items(), key=lambda item: -item[1][0]):
        if ms < TIMES_SHARE * all_ms:
            rest = [rest[0] + ms, rest[1] + n]
        else:
            rows.append([f"`{shader}`", f"{ms:.1f}", str(n), f"{1e3 * ms / n:.0f}", f"{100 * ms / all_ms:.1f}"])
    rows += [["others", f"{rest[0]:.1f}", str(rest[1]), f"{1e3 * rest[0] / rest[1]:.0f}" if rest[1] else "-",
              f"{100 * rest[0] / all_ms:.1f}"],
             ["between dispatches: copies", f"{copies_ms:.1f}", "-", "-", f"{100 * copies_ms / all_ms:.1f}"],
             ["all", f"{all_ms:.1f}", str(sum(n for _, n in shaders.values())), "-", "100.0"]]
    head = ["shader", "ms", "dispatches", "us a dispatch", "of the device's time %"]
    return (f"### {name}\n\nThe command takes {command_s:.2f} s, from load to end {seconds['total']:.2f} s ({stages}). The device "
            f"works {all_ms / 1e3:.3f} s\nof it, {100 * all_ms / 1e3 / command_s:.0f} %, in {submissions:.0f} submissions: "
            f"{sum_ms / 1e3:.3f} s in dispatches, {copies_ms / 1e3:.3f} s between them.\n\n{charts.table(head, rows)}\n")


def bench_times(bench):
    grid_rows, cols, width, height = MATCHED_QUICK[0]
    field = bench.field(f"{bench.world('bush', (width, height), (grid_rows, cols))}/views", grid=(grid_rows, cols))
    text = f"""Whole commands, `SST_GPU_TIMES=1 sst process --device NAME -v` with labels, the one of median time. Self-tests of the
shaders are part of it. Shaders below {100 * TIMES_SHARE:.0f} % of the device's time are added up under "others".

"""
    for preset in ("balanced",) if bench.quick else PRESETS:
        bench.progress("times", preset)
        command_s, seconds, shaders, total = times_of(bench, field, preset)
        if not shaders:
            raise ValueError("no times: the device cannot take any, or sst is too old")
        text += times_text(f"bush {grid_rows}x{cols} of {width}x{height}, {preset}", command_s, seconds, shaders, total)
    bench.remove(field)
    return text


def bench_sgm(bench):
    rows, limits = [], bench.limits()
    for width, height, disparities in PATHS:
        bench.progress("optimisation", width, height, disparities)
        r = json.loads(bench.program("bench/device_sgm", bench.device["name"], f"{width}x{height}", str(disparities)))
        row = [f"{width}x{height}, {disparities}", f"`{r['shader']}`"] + [f"{r[k]:.3g}" for k in ("row_ms", "column_ms", "paths4_ms", "paths8_ms")]
        for paths in (4, 8):
            rate = r[f"paths{paths}_g_disparities_s"]
            row += [f"{rate:.3g}", f"{100 * rate * gpu_page.path_bytes(paths) / limits['copy_gb_s']:.1f}"]
        rows.append(row)
    head = ["a view of, disparities", "shader", "a direction along rows, ms", "along columns, ms", "4 paths ms", "8 paths ms",
            "4 paths: G disparities/s", "of the copy rate %", "8 paths: G disparities/s", "of the copy rate %"]
    return f"""`device_sgm`: one view with random costs, best of 7 after 0.2 s of work. A disparity takes {gpu_page.path_bytes(4)} bytes
along 4 paths, {gpu_page.path_bytes(8)} along 8.

""" + charts.table(head, rows)


def bench_networks(bench):
    """The CPU and the device in turn: time, and results that differ."""
    rows, limits = [], bench.limits()
    sizes = {(model, NETWORK_SOFTWARE if bench.software else size, precision): None for model, size, precision in NETWORKS}
    for model, (width, height), precision in sizes:
        path = os.path.join(gpu_page.ROOT, "models", model)
        if not os.path.exists(path):
            bench.progress("networks: there is no", model)
            continue
        bench.progress(model, precision)
        r = json.loads(bench.program("bench/network_device", path, f"{width}x{height}",
                                     str(bench.rounds if bench.software else 3 * bench.rounds), bench.device["name"], precision))
        products = gpu_page.PRODUCTS[model] * width * height
        for v in r["variants"]:
            assert v["on_cpu"] == 0, r
            tflop_s = 2 * products / (v["device_ms"] - v["upload_ms"] - v["download_ms"])
            shader = f"`{v['conv8']}`{'' if v['chosen'] else ', by name'}" if v["conv8"] else "`net_conv`"
            rows.append([f"{model[:-5]} {width}x{height}, {precision}", shader, f"{r['cpu_ms']:.1f}",
                         f"{v['device_ms']:.1f}", f"{v['device_ms'] / r['cpu_ms']:.2f}", f"{v['upload_ms']:.2f}",
                         f"{v['download_ms']:.2f}", f"{v['memory_bytes'] / 1e6:.1f}",
                         f"{tflop_s:.2g}", f"{100 * tflop_s / limits['float_tflop_s']:.0f}", f"{100 * v['differ']:.3f}",
                         f"{v['most'] / v['largest']:.1e}"])
    head = ["network", "convolutions", "CPU ms", "device ms", "ratio", "upload ms", "download ms", "memory MB", "TFLOP/s",
            "of the rate of floats %", "results that differ %", "worst, of the largest"]
    return "TFLOP/s are those of the time without transfers.\n\n" + charts.table(head, rows)
