# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
"""The page docs/measured/gpu.md: its sections, which are replaced one by one."""
import os

ROOT = os.path.abspath(os.path.join(os.path.dirname(os.path.abspath(__file__)), ".."))
PAGE = os.path.join(ROOT, "docs/measured/gpu.md")

# Products a pixel of the picture takes in a network, in 10^9.
PRODUCTS = {"pspnet-small.onnx": 6.025 / (480 * 360), "pspnet-large.onnx": 11.599 / (480 * 360), "mccnn-fast.onnx": 111168e-9}
# Headings of a device's sections after its name, in the order of the page; the first one has none.
PARTS = {"limits": "", "pictures": "pictures", "frames": "pictures of raw frames", "rays": "verified rays in little memory",
         "matching": "matching", "sgm": "semi-global optimisation", "whole": "whole light fields", "times": "where the time goes",
         "networks": "networks"}

SOFTWARE = "A software device: it runs on the CPU, and shows what the shaders compute, not how fast a GPU is."

INTRODUCTION = """# GPU

Made by `make bench-gpu`. Do not edit: the next run replaces the sections of the devices that it measures and leaves the others,
which another machine may have measured.

The CPU and the device work in turn; figures are medians of the rounds, and ratios above 1 mean that the CPU is faster. Pictures:
"with device" is a whole picture as the caller sees it, "on device" is the shader with its waits; the upload happens once per
light field. Matching: seconds of the whole disparity stage of `sst process`, with the device opened and tested before.

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
        found[name, part] = "## " + piece.strip() + "\n\n"
    return found


def limits_text(limits):
    return (f"Measured limits: {amount(limits['copy_gb_s'])} GB/s read and written by a copy, "
            f"{amount(limits['float_tflop_s'])} TFLOP/s of floats, {amount(limits['upload_gb_s'])} GB/s\nuploaded and "
            f"{amount(limits['download_gb_s'])} GB/s downloaded (`limits.comp`, best of 7).\n")


def amount(value):
    return f"{value:.0f}" if value >= 100 else f"{value:.3g}"


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
        f.write(text.rstrip() + "\n")
