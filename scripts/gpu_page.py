"""The page docs/measured/gpu.md: its sections, which are replaced one by one, and what a large GPU can reach on paper."""
import os
import re

import charts

ROOT = os.path.abspath(os.path.join(os.path.dirname(os.path.abspath(__file__)), ".."))
PAGE = os.path.join(ROOT, "docs/measured/gpu.md")

MATCH_BYTES = 71  # of a disparity: 45 for 12 neighbours, 6 for the aggregation, 18 for 4 paths, 2 for the winner
# Products a pixel of the picture takes in a network, in 10^9.
PRODUCTS = {"pspnet-small.onnx": 6.025 / (480 * 360), "pspnet-large.onnx": 11.599 / (480 * 360), "mccnn-fast.onnx": 111168e-9}
# Headings of a device's sections after its name, in the order of the page; the first one has none.
PARTS = {"limits": "", "pictures": "pictures", "frames": "pictures of raw frames", "rays": "verified rays in little memory",
         "live": "live rectification", "matching": "matching", "sgm": "semi-global optimisation",
         "refinement": "label refinement", "whole": "whole light fields", "times": "where the time goes",
         "networks": "networks"}

SOFTWARE = "A software device: it runs on the CPU, and shows what the shaders compute, not how fast a GPU is."

INTRODUCTION = """# GPU

Made by `make bench-gpu`. Do not edit: the next run replaces the sections of the devices that it measures, and leaves those
of others, which another machine may have measured. Each section names the processor of its machine.

The CPU and the device work in turn; figures are medians of the rounds. Of pictures, "with device" is a whole picture as the
caller sees it, with the plan, the download and the CPU's pass; "on device" is the shader with its waits. The upload
happens once per light field. Ratios above 1: the CPU is faster. Shares of the copy rate and of the rate of floats are those
of limits that were measured in the same run.

Of matching the seconds are those of the whole disparity stage of `sst process`, of which the device has what is not
listed under "stages on the CPU"; the device is opened and tested before. Of label refinement they are those of its
stage, with given disparities, and labels with gaps. Networks run in turn as well, on all threads of the CPU.

"""

ROOFLINE = """## What a large GPU can reach, on paper

{measured}

`blend` reads each ray once: R, G, B and label in 4 bytes, disparity in 2; a picture adds 4 bytes of result. Neighbouring
rays share what interpolation reads besides, which stays in the cache.

"""

MATCHING_ROOFLINE = """
Download of the picture (4 bytes a pixel) and the CPU's pass over it come on top: 12 MB at 2000x1500, 0.5 ms at 25 GB/s.

### Matching

A disparity of a pixel is read and written several times: 45 bytes to gather the costs of 12 neighbours (the two cheapest,
2 bytes, are carried from dispatch to dispatch), 6 for a round of aggregation, 18 for 4 paths (the cost, 1 byte, and the sum,
2 bytes, which all paths but the first read as well), 2 for the winner. Of the optimisation alone, 18 bytes bound its rate:

"""

PATHS_ROOFLINE = """
That is {rate:.0f} G disparities a second of 4 paths at {at}. Presets that match one view in three need a third of it.
What bounds the paths besides is latency: the pixels of a path follow each other, and a direction of 2000x1500 has 1500 or
2000 paths at a time, a group of 32 invocations each. With 1 us a pixel a direction takes 1.5 to 2 ms a view, which is
{latency:.0f} ms for 4 directions of 36 views: more than the bandwidth of a large GPU asks for.
"""

NETWORK_ROOFLINE = """
### Networks

`net_conv8` computes one product of bytes in a float multiply-add: the rate of floats is its ceiling; half of it is what
tiles of 4 x 4 results an invocation may reach. `net_conv8_dot` computes four products an instruction.
`net_conv8_matrix` has the rate of the device's products of matrices as its ceiling. Weights and activations are read from
memory once a layer and tile: 8 to 30 MB a picture, far from the limit.

"""


def path_bytes(paths):
    """Of a disparity: its cost read and its sum written along each path, the sum read along all but the first."""
    return paths + 2 * paths + 2 * (paths - 1)


def section(device, part, text):
    """A section as the page has it."""
    return f"{heading(device['name'], part)}\n\n{text.strip()}\n\n"


def heading(name, part):
    return f"## {name}: {PARTS[part]}" if PARTS[part] else f"## {name}"


def read(text):
    """Sections of devices by (name, part), in the order of the page."""
    found = {}
    for piece in ("\n" + text).split("\n## ")[1:]:
        name, part = piece.split("\n", 1)[0], "limits"
        for key, words in PARTS.items():
            if words and name.endswith(": " + words):
                name, part = name[:-len(words) - 2], key
        if not piece.startswith("What a large GPU"):
            found[name, part] = "## " + piece.strip() + "\n\n"
    return found


def limits_text(limits):
    return (f"Measured limits: {amount(limits['copy_gb_s'])} GB/s read and written by a copy, "
            f"{amount(limits['float_tflop_s'])} TFLOP/s of floats, {amount(limits['upload_gb_s'])} GB/s\nuploaded and "
            f"{amount(limits['download_gb_s'])} GB/s downloaded (`limits.comp`, best of 7).\n")


def amount(value):
    return f"{value:.0f}" if value >= 100 else f"{value:.3g}"


def measured_limits(found):
    """(name, bytes a second, floating-point operations a second) of the devices of the page that are no software."""
    limits = []
    for (name, part), text in found.items():
        rates = re.search(r"Measured limits:\s+([\d.e+-]+)\s+GB/s.*?,\s+([\d.e+-]+)\s+TFLOP/s", text, re.S)
        if part == "limits" and rates and SOFTWARE not in text:
            limits.append((name, 1e9 * float(rates[1]), 1e12 * float(rates[2])))
    return limits


def rate_text(rate):
    return f"{rate / 1e12:.2g} TB/s" if rate >= 1e12 else f"{rate / 1e9:.0f} GB/s"


def roofline(limits):
    """limits: as measured_limits() returns them; they stand before those of datasheets."""
    memory = [(f"{rate_text(rate)} ({name}, measured)", rate) for name, rate, _ in limits]
    memory += [("4.3 TB/s (H200, device copy)", 4.3e12), ("1.0 TB/s", 1.0e12), ("50 GB/s (integrated)", 5.0e10)]
    best = memory[0][1]
    measured = "Rates that are called measured are those of `limits.comp`, the others are from datasheets." if limits else \
        "Rates are from datasheets; no GPU was measured."
    blend, sgm = [], []
    for w, h in ((1000, 750), (2000, 1500), (4000, 3000)):
        total = w * h * (36 * 6 + 4)
        blend.append([f"36x{w}x{h}", f"{total / 1e6:.0f} MB"] + [f"{total / rate * 1e3:.2f} ms" for _, rate in memory])
    for w, h, n in ((1000, 750, 64), (1000, 750, 128), (2000, 1500, 128)):
        all_ = 36 * w * h * n
        sgm.append([f"36x{w}x{h}, {n}", f"{all_ / 1e9:.1f} G"] +
                   [f"{all_ * path_bytes(4) / rate * 1e3:.0f} ms" for _, rate in memory] +
                   [f"{all_ * MATCH_BYTES / best * 1e3:.0f} ms"])
    return (ROOFLINE.format(measured=measured) +
            charts.table(["light field", "bytes a picture"] + [f"at {m}" for m, _ in memory], blend) +
            MATCHING_ROOFLINE +
            charts.table(["light field, disparities", "disparities"] + [f"optimisation at {m}" for m, _ in memory] +
                               [f"all of the first pass at {memory[0][0]}"], sgm) +
            PATHS_ROOFLINE.format(rate=best / path_bytes(4) / 1e9, at=memory[0][0], latency=4 * 36 * 1.75) +
            network_roofline(limits))


def network_roofline(limits):
    rates = [(f"{rate / 1e12:.3g} TFLOP/s ({name}, measured)", rate) for name, _, rate in limits]
    rates += [("67 TFLOP/s (H200, floats)", 67e12), ("half of it", 33.5e12), ("2 TFLOP/s (integrated)", 2e12),
              ("1979 TOP/s (H200, matrices of bytes)", 1979e12)]
    rows = []
    for name, model, pixels in (("pspnet-small, a view of 480x360", "pspnet-small.onnx", 480 * 360),
                                ("pspnet-large, a view of 480x360", "pspnet-large.onnx", 480 * 360),
                                ("mccnn-fast, a view of 1000x750", "mccnn-fast.onnx", 1000 * 750),
                                ("mccnn-fast, 36 views of 1000x750", "mccnn-fast.onnx", 36 * 1000 * 750)):
        products = PRODUCTS[model] * pixels
        rows.append([name, f"{products:.1f} G"] + [f"{2e12 * products / rate:.2f} ms" for _, rate in rates])
    text = "\n100 TFLOP/s of features are beyond the rate of floats: they need products of matrices."
    if not limits:
        text += " `net_conv8_matrix` has not run on\na GPU, so what it reaches of that rate is not known."
    head = ["network", "products a picture"] + [f"at {r}" for r, _ in rates]
    return NETWORK_ROOFLINE + charts.table(head, rows) + text + "\n"


def write(path, new):
    """Replace sections of the page by those of `new`, {(name, part): text}; GPUs come before software devices."""
    try:
        with open(path, encoding="utf-8") as f:
            found = read(f.read())
    except FileNotFoundError:
        found = {}
    found.update(new)
    names = list(dict.fromkeys(name for name, _ in found))
    names.sort(key=lambda name: SOFTWARE in found.get((name, "limits"), ""))
    text = INTRODUCTION + "".join(found[name, part] for name in names for part in PARTS if (name, part) in found)
    with open(path, "w", encoding="utf-8") as f:
        f.write(text + roofline(measured_limits(found)))
