#!/usr/bin/python3
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
"""Measure matching costs on pairs with known disparity, all through `sst stereo`, and renew docs/measured/bench-matching.md.

A network is judged on a pair that it has not seen: models/leave-one-out/ has one for each Middlebury pair. Compared
with census and, where its weights are at hand (--cnes), the fast network of CNES, which becomes an ONNX file in BUILD.
`make bench-networks` runs this. Needs python3-torch, python3-onnx, python3-pil, the Middlebury pairs.
"""
import argparse
import os
import subprocess
import sys
import time
from dataclasses import dataclass

import numpy as np
import torch
from PIL import Image, ImageFilter

ROOT = os.path.abspath(os.path.join(os.path.dirname(os.path.abspath(__file__)), ".."))
sys.path.insert(0, os.path.join(ROOT, "models"))
import bench  # noqa: E402
import common  # noqa: E402
import onnx_file  # noqa: E402
from bench import say  # noqa: E402
from matching_pairs import MIDDLEBURY, middlebury, seen_in_both  # noqa: E402
from train_mccnn import build  # noqa: E402

SCENES = ("bush", "cat", "pedestrian", "transportation")
SCENE_SEED = common.HELD_SEEDS[0]
MAX_DISPARITY = {"aloe": "127"}  # px; 63 for the others
HALVED = ("aloe",)  # to the size of the other pairs


@dataclass
class Scene:
    """A pair of pictures on disk and its truth."""
    name: str
    left: str
    right: str
    disp: np.ndarray
    seen: np.ndarray  # in both views


@dataclass
class Method:
    title: str
    cost: str
    model: str = ""  # "{}" stands for the pair that was left out

    def file(self, pair: str) -> str:
        return self.model.format(pair)

    def fits(self, pair: str) -> bool:
        return not self.model or os.path.exists(self.file(pair))


# --- input -----------------------------------------------------------------------------------------------------------

def middlebury_scene(data: str, out: str, name: str) -> Scene:
    left, right, disp, seen = middlebury(data, name)
    if name in HALVED:
        size = (left.width // 2, left.height // 2)
        scale = size[0] / left.width
        left, right = (v.resize(size, Image.Resampling.LANCZOS) for v in (left, right))
        pick = np.ix_(np.arange(size[1]) * 2, np.arange(size[0]) * 2)
        disp, seen = disp[pick] * np.float32(scale), seen[pick]
    files = [os.path.join(out, f"{name}-{side}.png") for side in ("left", "right")]
    for view, file in zip((left, right), files):
        view.save(file)
    return Scene(name, *files, disp, seen)


def simulated_scene(sst: str, out: str, name: str) -> Scene:
    """Two neighbouring views of a seed that no network was trained on."""
    lf = os.path.join(out, f"scene-{name}")
    subprocess.run([sst, "scene", name, "-o", lf, "--size", "640x480", "--grid", "2x2", "--seed", str(SCENE_SEED),
                    "--force", "-q"], check=True, stdout=subprocess.DEVNULL)
    disp, other = (common.read_pfm(os.path.join(lf, "truth", f"00_{c:02d}.pfm")) for c in (0, 1))
    views = common.lightfield_views(lf)
    return Scene(f"scene {name}", views[0, 0], views[0, 1], disp, seen_in_both(disp, other))


def convert_cnes(weights: str, out: str) -> str:
    """Five convolutions of 64, as a state dict in order; ONNX for `sst stereo`."""
    state = torch.load(weights, map_location="cpu")
    tensors = list(state.get("model", state).values())
    net = build(len(tensors) // 2, tensors[0].shape[0])
    net.load_state_dict(dict(zip(net.state_dict(), tensors)))
    path = os.path.join(out, "cnes-mccnn-fast.onnx")
    onnx_file.write_mccnn(path, [m for m in net if isinstance(m, torch.nn.Conv2d)])
    return path


# --- what a right camera may do otherwise ----------------------------------------------------------------------------

def shifted(img: Image.Image, dy: float) -> Image.Image:
    return img.transform(img.size, Image.Transform.AFFINE, (1, 0, 0, 0, 1, dy), Image.Resampling.BICUBIC)


def noisy(img: Image.Image, deviation: float) -> Image.Image:
    x = np.asarray(img, np.float64)
    x = x + np.random.default_rng(1).normal(0, deviation, x.shape)
    return Image.fromarray(np.rint(x).clip(0, 255).astype(np.uint8))


def toned(img: Image.Image, gain: float, gamma: float) -> Image.Image:
    table = [min(255, round(255 * gain * (v / 255) ** gamma)) for v in range(256)]
    return img.point(table * 3)


CHANGES = (
    ("as it is", lambda img: img),
    ("gain 0.8", lambda img: toned(img, 0.8, 1)), ("gain 1.25", lambda img: toned(img, 1.25, 1)),
    ("gamma 0.8", lambda img: toned(img, 1, 0.8)), ("gamma 1.25", lambda img: toned(img, 1, 1.25)),
    ("0.5 px down", lambda img: shifted(img, 0.5)), ("1 px down", lambda img: shifted(img, 1)),
    ("noise 5", lambda img: noisy(img, 5)), ("noise 10", lambda img: noisy(img, 10)),
    ("blur 1 px", lambda img: img.filter(ImageFilter.GaussianBlur(1))),
)


# --- measuring -------------------------------------------------------------------------------------------------------

def error(sst: str, out: str, scene: Scene, method: Method, options: tuple, right: str = "") -> np.ndarray:
    """|disparity - truth| of each pixel, px; infinite where nothing was found, NaN where there is no truth."""
    result = os.path.join(out, "disparity.pfm")
    model = ["--mccnn-model", method.file(scene.name)] if method.model else []
    subprocess.run([sst, "stereo", scene.left, right or scene.right, "-m", MAX_DISPARITY.get(scene.name, "63"), "-o",
                    result, "-q", "--cost", method.cost, "--preset", "accurate", *model, *options], check=True)
    wrong = np.abs(common.read_pfm(result) - np.where(np.isfinite(scene.disp), scene.disp, np.nan))
    return np.where(np.isfinite(scene.disp) & np.isnan(wrong), np.inf, wrong)


def bad(wrong: np.ndarray, mask: np.ndarray, limit: float) -> float:
    """Percent of the pixels with truth."""
    return 100 * float((wrong[mask & ~np.isnan(wrong)] > limit).mean())


def accuracy_rows(sst: str, out: str, scene: Scene, methods: list[Method]) -> list[str]:
    rows, everywhere = [], np.ones(scene.disp.shape, bool)
    for method in methods:
        if not method.fits(scene.name):
            continue
        runs = [error(sst, out, scene, method, options) for options in (("--raw",), ())]
        masks = (scene.seen, everywhere)
        figures = [f"{bad(run, mask, limit):.2f}" for run in runs for mask in masks for limit in (1, 2)]
        rows.append(f"| {scene.name} | {method.title} | " + " | ".join(figures) + " |")
    return rows


def robust_table(sst: str, out: str, scenes: list[Scene], methods: list[Method], options: tuple) -> str:
    """A row for each change of the right view, a column for each method."""
    rows, changed = [], os.path.join(out, "changed.png")
    rows.append("| right view | " + " | ".join(m.title for m in methods) + " |")
    rows.append("| --- |" + " --: |" * len(methods))
    for title, change in CHANGES:
        cells = []
        for method in methods:
            figures = []
            for scene in scenes:
                change(Image.open(scene.right).convert("RGB")).save(changed)
                figures.append(bad(error(sst, out, scene, method, options, changed), scene.seen, 2))
            cells.append(f"{np.mean(figures):.2f} ({' '.join(f'{f:.1f}' for f in figures)})")
        rows.append(f"| {title} | " + " | ".join(cells) + " |")
        say(rows[-1])
    return "\n".join(rows)


PAGE = """# Matching costs: census and networks

Made by `make bench-networks`. Do not edit: the next run overwrites this page.

Everything is run by `sst stereo`. *Raw*: the cheapest disparity of each pixel (`--raw`). *Whole chain*: preset
`accurate` with this cost. Percent of pixels more than 1 and 2 px off; *seen*: pixels that both views see; *all*: all
with truth, hidden ones too. Searched: 0..63 px (aloe 0..127, at half size: {aloe}).

- **mccnn, pair left out**: `models/leave-one-out/without-PAIR.onnx`, trained as the shipped network but never on the
  pair of its row. These are the figures to expect of new pictures.
- **mccnn shipped**: `models/mccnn-fast.onnx`. It was trained on all four pairs: on them its figures flatter it. Of the
  simulated scenes it knows the kinds, not these seeds.
- **CNES**: MC-CNN fast of CNES Pandora, five layers, trained on Middlebury pairs, perhaps on some of these.
- **+ census**: the mean of both costs, which preset `accurate` takes.

## Accuracy

| pair | cost | raw seen 1 | 2 | raw all 1 | 2 | chain seen 1 | 2 | chain all 1 | 2 |
| --- | --- | --: | --: | --: | --: | --: | --: | --: | --: |
{accuracy}

## When the right camera differs

Pixels that both views see, percent more than 2 px off: mean over the Middlebury pairs (each: {names}). Gain and
gamma are clipped at 255; noise in grey levels, one sigma; moved by bicubic interpolation; blur Gaussian, one sigma.

Raw:

{robust_raw}

Whole chain:

{robust_chain}
"""


def measure(args: argparse.Namespace, out: str) -> None:
    sst, start = f"{args.build}/sst", time.monotonic()
    left_out = Method("mccnn, pair left out", "mccnn", "models/leave-one-out/without-{}.onnx")
    missing = [left_out.file(name) for name in MIDDLEBURY if not os.path.exists(left_out.file(name))]
    if missing:
        sys.exit(f"bench: {', '.join(missing)} are missing; models/README.md says how to train them")
    shipped = Method("mccnn shipped", "mccnn", "models/mccnn-fast.onnx")
    census, others = Method("census", "census"), [Method(os.path.basename(f), "mccnn", f) for f in args.also]
    if os.path.exists(args.cnes):
        others.insert(0, Method("CNES", "mccnn", convert_cnes(args.cnes, out)))
    else:
        say(f"{args.cnes} is not there: CNES is left out; give --cnes FILE")
    both = [Method(m.title + " + census", "both", m.model) for m in (left_out, shipped, *others)]
    pairs = [middlebury_scene(args.data, out, name) for name in MIDDLEBURY]
    accuracy = []
    for scene in pairs + [simulated_scene(sst, out, name) for name in SCENES]:
        rows = accuracy_rows(sst, out, scene, [census, left_out, shipped, *others, *both])
        accuracy += rows
        say("\n".join([scene.name, *rows]))
    raw = robust_table(sst, out, pairs, [census, left_out, *others], ("--raw",))
    chain = robust_table(sst, out, pairs, [census, *(m for m in both if m.file("") != shipped.file(""))], ())
    page = PAGE.format(aloe="x".join(map(str, pairs[2].disp.shape[::-1])), accuracy="\n".join(accuracy),
                       names=", ".join(MIDDLEBURY), robust_raw=raw, robust_chain=chain)
    bench.write(args.out, page)
    say(f"{time.monotonic() - start:.0f} s; {args.out}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--build", default="build", help="folder with the built program (%(default)s)")
    parser.add_argument("--data", default="../shared/data/stereo-middlebury", help="Middlebury pairs (%(default)s)")
    parser.add_argument("--cnes", default="../shared/data/weights-mccnn-fast/mc_cnn_fast_mb_weights.pt",
                        help="weights of CNES Pandora to compare with (%(default)s)")
    parser.add_argument("--also", nargs="*", default=[], metavar="ONNX", help="more networks to measure")
    parser.add_argument("--out", default="docs/measured/bench-matching.md", help="page to write (%(default)s)")
    args = parser.parse_args()
    os.chdir(ROOT)
    torch.set_num_threads(1)
    missing = [n for n in MIDDLEBURY if not os.path.isdir(os.path.join(args.data, n))]
    if missing:
        sys.exit(f"bench: {args.data} lacks {', '.join(missing)}; give --data FOLDER with the Middlebury pairs")
    out = f"{args.build}/bench-matching"
    os.makedirs(out, exist_ok=True)
    measure(args, out)


if __name__ == "__main__":
    try:
        main()
    except subprocess.CalledProcessError as failed:
        sys.exit(f"bench: stopped: {failed}")
