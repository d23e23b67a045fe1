#!/usr/bin/python3
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
"""
Find the ranges of a network's values and write them into its file, so that `sst` can run it on 8 bits. The weights and
runs on floats do not change.

  /usr/bin/python3 models/quantise.py models/pspnet-small.onnx --images CAMVID/train SCENES/*-1??/views

The pictures should be like those of the application; a hundred are plenty. Networks with one input channel get
the luma of whole pictures, standardised; those with three get the working size, mean and deviation of their metadata.

The range of a value is the one with the least mean square error of rounding to its 8 bits plus clipping (--clip mse),
found on a histogram; largest values (--clip max) and percentiles (--clip 99.99) are there to compare.
"""
import argparse
import os
import random

import numpy as np
import onnx
import torch
from PIL import Image

import common
import manifest
import onnx_file

KEY = "sst.ranges"  # SST_RANGES_KEY of pipeline/method/network/graph.h
BINS = 4096


def pictures(paths: list[str], count: int) -> list[str]:
    """At most count of the given files and the files in the given folders, drawn with a fixed seed."""
    files = []
    for path in paths:
        inside = sorted(os.listdir(path)) if os.path.isdir(path) else [""]
        files += [os.path.join(path, f) for f in inside if f.endswith((".png", ".jpg")) or not f]
    return random.Random(1).sample(files, min(count, len(files)))


def network_input(path: str, channels: int, metadata: dict[str, str]) -> torch.Tensor:
    """[1,channels,H,W], prepared as by sst."""
    rgb = common.read_rgb(path)
    if channels == 1:
        return torch.from_numpy(common.standardise(common.luma(rgb)))[None, None]
    size = tuple(int(n) for n in metadata.get("sst.size", "480x360").split("x"))
    mean, std = ([float(n) for n in metadata[k].split(",")] if k in metadata else [d] * 3
                 for k, d in (("sst.mean", 0), ("sst.std", 1)))
    x = np.asarray(Image.fromarray(rgb).resize(size, Image.Resampling.BOX), np.float32) / 255
    return torch.from_numpy(((x - np.float32(mean)) / np.float32(std)).transpose(2, 0, 1))[None]


class Observed:
    """Largest |x| of one value and, once that is known, the histogram of |x|."""

    def __init__(self) -> None:
        self.max, self.negative, self.counts = 0.0, False, np.zeros(BINS)

    def extend(self, x: torch.Tensor) -> None:
        self.max = max(self.max, float(x.abs().max()))
        self.negative |= bool((x < 0).any())

    def count(self, x: torch.Tensor) -> None:
        x = x.abs()
        self.counts += torch.histc(x[x > 0], BINS, 0, self.max or 1).numpy()  # zeros are stored exactly

    def range(self, clip: str) -> float:
        top = max(self.max, 1e-10)
        if clip == "max" or not self.counts.any():
            return top
        if clip == "mse":
            return self.least_error() * top
        below = np.cumsum(self.counts) / self.counts.sum()
        return top * (np.searchsorted(below, float(clip) / 100) + 1) / BINS

    def least_error(self) -> float:
        """Fraction of the largest value. Sums over the bins above t of n (x - t)^2 come from running moments."""
        x, steps = (np.arange(BINS) + 0.5) / BINS, 127 if self.negative else 255
        t = (np.arange(BINS) + 1) / BINS
        above = [np.sum(self.counts * x ** k) - np.cumsum(self.counts * x ** k) for k in range(3)]
        clipped = above[2] - 2 * t * above[1] + t * t * above[0]
        rounded = np.cumsum(self.counts) * (t / steps) ** 2 / 12
        return float(t[np.argmin(clipped + rounded)])


def observe(path: str, inputs: list[torch.Tensor]) -> dict[str, Observed]:
    values: dict[str, Observed] = {}

    def each(name: str, x: torch.Tensor, step) -> None:
        if x.dim() == 4 and x.is_floating_point():
            step(values.setdefault(name, Observed()), x)

    for step in Observed.extend, Observed.count:
        for x in inputs:
            onnx_file.run(path, x, lambda name, v, s=step: each(name, v, s))
    return values


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("model", help="ONNX file that the ranges are added to")
    parser.add_argument("--images", nargs="+", required=True, help="pictures, or folders of them")
    parser.add_argument("--count", type=int, default=64, help="number of pictures to use (%(default)s)")
    parser.add_argument("--clip", default="mse", help="mse, max, or a percentile (%(default)s)")
    parser.add_argument("--out", help="write another file instead")
    args = parser.parse_args()
    torch.set_num_threads(1)
    model = onnx.load(args.model)
    metadata = {p.key: p.value for p in model.metadata_props}
    weights = {w.name for w in model.graph.initializer}
    source = next(i for i in model.graph.input if i.name not in weights)
    channels = source.type.tensor_type.shape.dim[1].dim_value
    files = pictures(args.images, args.count)
    if not files:
        raise SystemExit("no pictures (.png, .jpg) among --images")
    with torch.no_grad():
        values = observe(args.model, [network_input(f, channels, metadata) for f in files])
    metadata[KEY] = "".join(f"{v.range(args.clip):.6g} {name}\n" for name, v in values.items())
    del model.metadata_props[:]
    onnx.helper.set_model_props(model, metadata)
    out = args.out or args.model
    with open(out + ".part", "wb") as f:
        f.write(model.SerializeToString())
    os.replace(out + ".part", out)
    manifest.renew(out)
    print(f"{out}: ranges of {len(values)} values from {len(files)} pictures")


if __name__ == "__main__":
    main()
