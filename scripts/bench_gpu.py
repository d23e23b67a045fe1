#!/usr/bin/python3
"""Measure pictures, matching, label refinement and networks on every device against the CPU, interleaved in one run, and renew
docs/measured/gpu.md.

All through `sst render` and `sst process` on simulated light fields: time of a picture on the device and of its download,
upload of the light field, the share of values that differ and by how much; time of the disparity stage, and maps that
differ. `make bench-gpu` runs this; software devices are measured as well, for their errors. With --only the other sections
of the page stay as they are. Needs python3-numpy, python3-pil.
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
ALL_SCENES = ("bush", "pedestrian", "transportation", "cell", "humvee", "cd-cases", "cat")
SIZES = ((250, 188), (500, 375), (1000, 750), (2000, 1500))
SOFTWARE_WIDTH = 500  # software devices are measured up to it
METHODS = {"refocus": ["--method", "refocus"], "see-through": [], "see-through, soft aperture": ["--soft"],
           "verified rays": ["--verify-rays", "on"], "clear": ["--method", "clear"]}
ROUNDS = 3
REPEAT = 3
PRESETS = ("preview", "balanced", "accurate")
# Rows and columns, width, height of the light fields that are matched.
MATCHED = ((6, 6, 500, 375), (6, 6, 1000, 750), (6, 6, 2000, 1500))
MATCHED_SOFTWARE = ((3, 3, 96, 72), (3, 3, 160, 120))
MATCH_BYTES = 71  # of a disparity: 45 for 12 neighbours, 6 for the aggregation, 18 for 4 paths, 2 for the winner
PATH_BYTES = 18
# 6 for the others; clear: 6, and 4 to land, written and read; verified rays, where all pixels are left to votes: 6 to blend,
# 2 for the share, 6 to 4 of a ray with its votes, 4 to 2 of how near it is, which are read at last.
RAY_BYTES = {"refocus": 4, "clear": 14, "verified rays": 30}

# Networks, sizes of pictures, and products a result of theirs takes, in 10^9.
NETWORKS = (("pspnet-small.onnx", (480, 360), "int8"), ("pspnet-small.onnx", (480, 360), "f32"),
            ("pspnet-large.onnx", (480, 360), "int8"), ("mccnn-fast.onnx", (640, 256), "int8"))
SOFTWARE_SIZE = (160, 120)  # of networks on software devices
PRODUCTS = {"pspnet-small.onnx": 6.025 / (480 * 360), "pspnet-large.onnx": 11.599 / (480 * 360),
            "mccnn-fast.onnx": 111168e-9}  # of a pixel of the picture

NETWORK_ROOFLINE = """
### Networks

`net_conv8` computes one product of bytes in a float multiply-add: the rate of floats is its ceiling; half of it is what
tiles of 4 x 4 results an invocation may reach. `net_conv8_dot` computes four products an instruction.
`net_conv8_matrix` has the rate of the device's products of matrices as its ceiling. Weights and activations are read from
memory once a layer and tile: 8 to 30 MB a picture, far from the limit.

| network | products a picture | at 67 TFLOP/s (H200, floats) | half of it | at 2 TFLOP/s (integrated) | at 1979 TOP/s (H200, matrices of bytes) |
|---|---:|---:|---:|---:|---:|
"""

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
    """A light field with its true maps, which are trusted: rays are verified only where that is asked for."""
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


def measure_limits(build, device):
    """What the device reaches at most: GB/s copied, TFLOP/s of floats, GB/s up and down."""
    out = subprocess.run([os.path.join(build, "bench/device_limits"), device], check=True, capture_output=True, text=True)
    return json.loads(out.stdout)


def measure(build, folder, field, name, options, device, limits):
    """Rounds of CPU and device in turn; medians."""
    rounds = []
    for _ in range(ROUNDS):
        cpu, want = render(build, folder, field, options, "cpu")
        gpu, got = render(build, folder, field, options, device)
        d = gpu["device"]
        assert d["on_cpu"] == 0 and d["verified_on_cpu"] == 0 and d["failures"] == 0, d
        rounds.append((cpu["render_ms"]["median"], gpu["render_ms"]["median"], d["picture_ms"] - d["download_ms"],
                       d["download_ms"], d["upload_ms"], d["upload_bytes"]))
    apart = abs(want - got)
    cpu_ms, all_ms, device_ms, download_ms, upload_ms, upload_bytes = (statistics.median(c) for c in zip(*rounds))
    rays = gpu["width"] * gpu["height"] * 36 * RAY_BYTES.get(name, 6)
    return [f"{cpu_ms:.1f}", f"{all_ms:.1f}", f"{all_ms / cpu_ms:.2f}", f"{device_ms:.2f}", f"{download_ms:.2f}",
            f"{upload_ms:.0f} ({upload_bytes / 1e6:.0f})", f"{rays / device_ms / 1e6:.1f}",
            f"{100 * rays / device_ms / 1e6 / limits['copy_gb_s']:.0f}", str(apart.max()),
            f"{100 * (apart > 0).mean():.3f}"]


def same_maps(a, b, kinds=("disparity", "confidence")):
    """Maps of two folders whose bytes differ, and all of them."""
    names = [os.path.join(d, f) for d in kinds for f in sorted(os.listdir(os.path.join(a, d)))]
    return sum(open(os.path.join(a, n), "rb").read() != open(os.path.join(b, n), "rb").read() for n in names), len(names)


def measure_matching(build, folder, field, preset, device):
    """Rounds of CPU and device in turn; medians of the disparity stage."""
    rounds = []
    for _ in range(ROUNDS):
        reports = []
        for name in ("cpu", device):
            copy = os.path.join(folder, "cpu" if name == "cpu" else "gpu")
            subprocess.run(["rm", "-rf", copy], check=True)
            subprocess.run(["cp", "-r", field, copy], check=True)
            reports.append(json.loads(sst(build, "process", copy, "--no-labels", "--preset", preset, "--device", name,
                                          "--json")))
        cpu, gpu = reports
        d = gpu["device"]
        assert d["on_cpu"] == 0 and d["tested_on_cpu"] == 0 and d["failures"] == 0, d
        rounds.append((cpu["seconds"]["disparity"], gpu["seconds"]["disparity"], d["seconds"], d["wait_seconds"],
                       d["upload_seconds"], d["download_seconds"], d["upload_bytes"]))
    other, maps = same_maps(os.path.join(folder, "cpu"), os.path.join(folder, "gpu"))
    cpu_s, all_s, device_s, wait_s, upload_s, download_s, upload_bytes = (statistics.median(c) for c in zip(*rounds))
    return [f"{cpu_s:.2f}", f"{all_s:.2f}", f"{all_s / cpu_s:.2f}", f"{device_s:.3f}", f"{wait_s:.3f}",
            f"{1e3 * upload_s:.0f} ({upload_bytes / 1e6:.1f})", f"{1e3 * download_s:.0f}", f"{d['views']} / {d['tested']}",
            ", ".join(d["stages_on_cpu"]) or "none", f"{other} of {maps}"]


def bench_matching(build, folder, device):
    rows = []
    for grid_rows, cols, width, height in MATCHED_SOFTWARE if device["kind"] == "software" else MATCHED:
        world, field = (os.path.join(folder, k) for k in ("world", "lf"))
        sst(build, "scene", "bush", "--size", f"{width}x{height}", "--grid", f"{grid_rows}x{cols}", "-o", world)
        sst(build, "import", "folder", f"{world}/views", "--grid", f"{grid_rows}x{cols}", "-o", field)
        for preset in PRESETS:
            print(device["name"], "matching", width, height, preset, file=sys.stderr)
            rows.append([f"{grid_rows}x{cols} of {width}x{height}, {preset}"] +
                        measure_matching(build, folder, field, preset, device["name"]))
        subprocess.run(["rm", "-rf", world, field], check=True)
    head = ["`bush`, views of", "CPU s", "with device s", "ratio", "device s", "of them waits", "upload ms (MB)",
            "download ms", "views matched / tested", "stages on the CPU", "maps that differ"]
    return f"## {device['name']}: matching\n\n{bench_report.table(head, rows)}\n"


def cut_labels(truth, folder, unknown=0.55):
    """Label maps with gaps: at random, as if they had a high entropy."""
    os.makedirs(folder)
    random = np.random.default_rng(1)
    for name in sorted(n for n in os.listdir(truth) if n.endswith(".png")):
        label = np.asarray(Image.open(os.path.join(truth, name))).copy()
        label[random.random(label.shape) < unknown] = 0
        Image.fromarray(label).save(os.path.join(folder, name))


def measure_refinement(build, folder, field, labels, truth, device):
    """Rounds of CPU and device in turn; medians of the refinement stage, of true disparities and of labels with gaps."""
    rounds = []
    for _ in range(ROUNDS):
        reports = []
        for name in ("cpu", device):
            copy = os.path.join(folder, "cpu" if name == "cpu" else "gpu")
            subprocess.run(["rm", "-rf", copy], check=True)
            subprocess.run(["cp", "-r", field, copy], check=True)
            reports.append(json.loads(sst(build, "process", copy, "--labels", labels, "--disparity", truth, "--device",
                                          name, "--json")))
        cpu, gpu = reports
        d = gpu["device"]["refinement"]
        assert d["on_cpu"] == 0 and d["failures"] == 0 and d["views"] > 0, d
        rounds.append((cpu["seconds"]["refinement"], gpu["seconds"]["refinement"], d["seconds"], d["wait_seconds"],
                       d["upload_seconds"], d["download_seconds"], d["upload_bytes"]))
    other, maps = same_maps(os.path.join(folder, "cpu"), os.path.join(folder, "gpu"), ("labels",))
    cpu_s, all_s, device_s, wait_s, upload_s, download_s, upload_bytes = (statistics.median(c) for c in zip(*rounds))
    return [f"{cpu_s:.3f}", f"{all_s:.3f}", f"{all_s / cpu_s:.2f}", f"{device_s:.3f}", f"{wait_s:.3f}",
            f"{1e3 * upload_s:.0f} ({upload_bytes / 1e6:.1f})", f"{1e3 * download_s:.0f}", str(d["views"]),
            f"{other} of {maps}"]


def bench_refinement(build, folder, device):
    rows = []
    for grid_rows, cols, width, height in MATCHED_SOFTWARE if device["kind"] == "software" else MATCHED:
        world, field, labels = (os.path.join(folder, k) for k in ("world", "lf", "labels"))
        sst(build, "scene", "bush", "--size", f"{width}x{height}", "--grid", f"{grid_rows}x{cols}", "-o", world)
        sst(build, "import", "folder", f"{world}/views", "--grid", f"{grid_rows}x{cols}", "-o", field)
        cut_labels(f"{world}/truth", labels)
        print(device["name"], "refinement", width, height, file=sys.stderr)
        rows.append([f"{grid_rows}x{cols} of {width}x{height}"] +
                    measure_refinement(build, folder, field, labels, f"{world}/truth", device["name"]))
        subprocess.run(["rm", "-rf", world, field, labels], check=True)
    head = ["`bush`, views of", "CPU s", "with device s", "ratio", "device s", "of them waits", "upload ms (MB)",
            "download ms", "views refined", "maps that differ"]
    return f"## {device['name']}: label refinement\n\n{bench_report.table(head, rows)}\n"


def measure_whole(build, folder, world, preset, device):
    """The whole of `sst process` with labels and the proposed clear picture, once by the CPU and once by the device."""
    reports, pictures, copies = [], [], []
    for name in ("cpu", device):
        copies.append(os.path.join(folder, "cpu" if name == "cpu" else "gpu"))
        subprocess.run(["rm", "-rf", copies[-1]], check=True)
        subprocess.run(["cp", "-r", world, copies[-1]], check=True)
        reports.append(json.loads(sst(build, "process", copies[-1], "--preset", preset, "--device", name, "--json")))
        path = copies[-1] + ".png"
        sst(build, "render", copies[-1], "--device", name, "-o", path)
        pictures.append(np.asarray(Image.open(path)).astype(int))
    cpu, gpu = reports
    matched, refined, network = gpu["device"], gpu["device"]["refinement"], gpu["networks"]
    on_cpu = [d["on_cpu"] + d["failures"] for d in (matched, refined, network)]
    assert sum(on_cpu) == 0, reports
    other, maps = same_maps(*copies, ("disparity", "confidence", "labels"))
    kept = [f"{name}: {', '.join(d['stages_on_cpu'])}" for name, d in (("matching", matched), ("refinement", refined))
            if d["stages_on_cpu"]]
    return [f"{cpu['seconds']['total']:.2f}", f"{gpu['seconds']['total']:.2f}", f"{other} of {maps}",
            str(abs(pictures[0] - pictures[1]).max()), "; ".join(kept) or "none"]


def bench_whole(build, folder, device):
    rows = []
    grid, size = ("3x3", "96x72") if device["kind"] == "software" else ("6x6", "1000x750")
    for scene in ALL_SCENES:
        world = os.path.join(folder, "world")
        sst(build, "scene", scene, "--size", size, "--grid", grid, "-o", world)
        subprocess.run(["rm", "-rf", f"{world}/truth"], check=True)
        for preset in PRESETS:
            print(device["name"], "whole", scene, preset, file=sys.stderr)
            rows.append([f"{scene} {grid} of {size}, {preset}"] + measure_whole(build, folder, world, preset, device["name"]))
        subprocess.run(["rm", "-rf", world], check=True)
    head = ["whole `sst process`, with labels", "CPU s", "with device s", "maps that differ", "clear picture: worst levels",
            "stages on the CPU"]
    return f"## {device['name']}: whole light fields\n\nOne run each.\n\n{bench_report.table(head, rows)}\n"


def bench_networks(build, device):
    """The CPU and the device in turn: time, and results that differ."""
    rows, limits = [], measure_limits(build, device["name"])
    software = device["kind"] == "software"
    for model, size, precision in NETWORKS:
        width, height = SOFTWARE_SIZE if software else size
        print(device["name"], model, precision, file=sys.stderr)
        out = subprocess.run([os.path.join(build, "bench/network_device"), os.path.join(ROOT, "models", model),
                              f"{width}x{height}", str(ROUNDS if software else 3 * ROUNDS), device["name"], precision],
                             check=True, capture_output=True, text=True)
        r = json.loads(out.stdout)
        products = PRODUCTS[model] * width * height
        for v in r["variants"]:
            assert v["on_cpu"] == 0, r
            shader = f"`{v['conv8']}`{'' if v['chosen'] else ', by name'}" if v["conv8"] else "`net_conv`"
            rows.append([f"{model[:-5]} {width}x{height}, {precision}", shader, f"{r['cpu_ms']:.1f}",
                         f"{v['device_ms']:.1f}", f"{v['device_ms'] / r['cpu_ms']:.2f}", f"{v['upload_ms']:.2f}",
                         f"{v['download_ms']:.2f}", f"{v['memory_bytes'] / 1e6:.1f}",
                         f"{2 * products / v['device_ms']:.2g}",
                         f"{200 * products / v['device_ms'] / limits['float_tflop_s']:.0f}", f"{100 * v['differ']:.3f}",
                         f"{v['most'] / v['largest']:.1e}"])
    head = ["network", "convolutions", "CPU ms", "device ms", "ratio", "upload ms", "download ms", "memory MB", "TFLOP/s",
            "of the rate of floats %", "results that differ %", "worst, of the largest"]
    return f"## {device['name']}: networks\n\n{bench_report.table(head, rows)}\n"


def bench_device(build, folder, device):
    rows, limits = [], measure_limits(build, device["name"])
    for size in SIZES:
        if device["kind"] == "software" and size[0] > SOFTWARE_WIDTH:
            continue
        for scene in SCENES:
            field = make_field(build, folder, scene, size)
            for name, options in METHODS.items():
                print(device["name"], scene, size, name, file=sys.stderr)
                rows.append([f"{scene} {size[0]}x{size[1]}, {name}"] +
                            measure(build, folder, field, name, options, device["name"], limits))
            subprocess.run(["rm", "-rf", field], check=True)
    head = ["36 views of", "CPU ms", "with device ms", "ratio", "on device ms", "download ms", "upload ms (MB)",
            "GB/s of rays", "of the copy rate %", "worst levels", "values that differ %"]
    note = ("A software device: it runs on the CPU, and shows what the shaders compute, not how fast a GPU is.\n\n"
            if device["kind"] == "software" else "")
    note += (f"Measured limits: {limits['copy_gb_s']:.3g} GB/s read and written by a copy, {limits['float_tflop_s']:.3g} TFLOP/s of "
             f"floats, {limits['upload_gb_s']:.3g} GB/s\nuploaded and {limits['download_gb_s']:.3g} GB/s downloaded "
             "(`limits.comp`, best of 7).\n\n")
    return f"## {device['name']}\n\n{device['driver']}, {device['memory_bytes'] / 2**30:.1f} GiB.\n\n{note}{bench_report.table(head, rows)}\n"


def roofline():
    rows = ""
    for w, h in ((1000, 750), (2000, 1500), (4000, 3000)):
        total = w * h * (36 * 6 + 4)
        rows += f"| 36x{w}x{h} | {total / 1e6:.0f} MB | " + " | ".join(
            f"{total / rate * 1e3:.2f} ms" for rate in (4.3e12, 1.0e12, 5.0e10)) + " |\n"
    return ROOFLINE + rows + """
Download of the picture (4 bytes a pixel) and the CPU's pass over it come on top: 12 MB at 2000x1500, 0.5 ms at 25 GB/s.

### Matching

A disparity of a pixel is read and written several times: 45 bytes to gather the costs of 12 neighbours (the two cheapest,
2 bytes, are carried from dispatch to dispatch), 6 for a round of aggregation, 18 for 4 paths (the cost, 1 byte, and the sum,
2 bytes, which all paths but the first read as well), 2 for the winner. Of the optimisation alone, 18 bytes bound its rate:

| light field, disparities | disparities | optimisation at 4.3 TB/s | at 1.0 TB/s | at 50 GB/s | all of the first pass at 4.3 TB/s |
|---|---:|---:|---:|---:|---:|
""" + "".join(
        f"| 36x{w}x{h}, {n} | {36 * w * h * n / 1e9:.1f} G | " + " | ".join(
            f"{36 * w * h * n * PATH_BYTES / rate * 1e3:.0f} ms" for rate in (4.3e12, 1.0e12, 5.0e10)) +
        f" | {36 * w * h * n * MATCH_BYTES / 4.3e12 * 1e3:.0f} ms |\n"
        for w, h, n in ((1000, 750, 64), (1000, 750, 128), (2000, 1500, 128))) + f"""
That is {4.3e12 / PATH_BYTES / 1e9:.0f} G disparities a second of 4 paths at 4.3 TB/s. Presets that match one view in three need a third of it.
What bounds the paths besides is latency: the pixels of a path follow each other, and a direction of 2000x1500 has 1500 or
2000 paths at a time, a group of 32 invocations each. With 1 us a pixel a direction takes 1.5 to 2 ms a view, which is
{4 * 36 * 1.75:.0f} ms for 4 directions of 36 views: more than the bandwidth of a large GPU asks for.
""" + network_roofline()


def network_roofline():
    rows = ""
    for name, products in (("pspnet-small, a view of 480x360", PRODUCTS["pspnet-small.onnx"] * 480 * 360),
                           ("pspnet-large, a view of 480x360", PRODUCTS["pspnet-large.onnx"] * 480 * 360),
                           ("mccnn-fast, a view of 1000x750", PRODUCTS["mccnn-fast.onnx"] * 1000 * 750),
                           ("mccnn-fast, 36 views of 1000x750", PRODUCTS["mccnn-fast.onnx"] * 36 * 1000 * 750)):
        rows += f"| {name} | {products:.1f} G | " + " | ".join(
            f"{2 * products / rate:.2f} ms" for rate in (67, 33.5, 2, 1979)) + " |\n"
    return NETWORK_ROOFLINE + rows + """
100 TFLOP/s of features are beyond the rate of floats: they need products of matrices. `net_conv8_matrix` has not run on
a GPU, so what it reaches of that rate is not known.
"""


def sections(text):
    """The sections of a page by their headings, in order."""
    parts = ("\n" + text).split("\n## ")[1:]
    return {p.split("\n", 1)[0]: "## " + p.rstrip("\n") + "\n\n" for p in parts}


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--build", default="build")
    parser.add_argument("--only", choices=("pictures", "matching", "refinement", "whole", "networks"))
    args = parser.parse_args()
    build = os.path.abspath(args.build)
    version = json.loads(sst(build, "version", "--json"))
    if not version["devices"]:
        sys.exit("no device: install a Vulkan driver, or mesa-vulkan-drivers for the software device")
    with open(PAGE, encoding="utf-8") as f:
        old = sections(f.read())
    with tempfile.TemporaryDirectory() as folder:
        text = ""
        for d in version["devices"]:
            text += (bench_device(build, folder, d) if args.only in (None, "pictures") else old.get(d["name"], ""))
            text += (bench_matching(build, folder, d) if args.only in (None, "matching") else
                     old.get(f"{d['name']}: matching", ""))
            text += (bench_refinement(build, folder, d) if args.only in (None, "refinement") else
                     old.get(f"{d['name']}: label refinement", ""))
            text += (bench_whole(build, folder, d) if args.only in (None, "whole") else
                     old.get(f"{d['name']}: whole light fields", ""))
            text += (bench_networks(build, d) if args.only in (None, "networks") and version["parts"]["onednn"] else
                     old.get(f"{d['name']}: networks", ""))
    text = (f"The CPU and the device render in turn, {ROUNDS} rounds of {REPEAT} pictures each; medians. \"With device\" is a "
            "whole picture as the\ncaller sees it, with the plan, the download and the CPU's pass; \"on device\" is the "
            "shader with its waits. The upload\nhappens once per light field. Ratios above 1: the CPU is faster.\n\n"
            "Of matching the seconds are those of the whole disparity stage of `sst process`, of which the device has what "
            "is not\nlisted under \"stages on the CPU\"; the device is opened and tested before. Of label refinement they are "
            "those of its\nstage, with given disparities, and labels with gaps. Networks run in turn as well, on all threads "
            "of the CPU.\n\n" + text + roofline())
    with open(PAGE, "w", encoding="utf-8") as f:
        f.write(bench_report.page("GPU", "make bench-gpu", text))


if __name__ == "__main__":
    main()
