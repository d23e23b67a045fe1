#!/usr/bin/python3
"""
Trains the matching network: siamese 3x3 convolutions, unit-length features, cost = -dot product
(Zbontar and LeCun 2016, "fast" architecture; DESIGN 5.2). Whole crops go through the network, so one pass serves
thousands of matches; loss max(0, margin + s_neg - s_pos), half on a random and half on the hardest wrong position.

  /usr/bin/python3 models/train_mccnn.py --aloe DIR --scenes DIR --checkpoint /tmp/mccnn.pt --out models/mccnn-fast.onnx
"""
import argparse
import os
import time

import numpy as np
import torch
import torch.nn as nn
import torch.nn.functional as F
from PIL import Image

import common
import onnx_file
from synthetic_pairs import Pair, make_pair

MARGIN = 0.2
NEAR, FAR = 1.5, 18  # wrong positions, px from the true one
POINTS = 900  # matches drawn from one crop


def build(layers: int, width: int) -> nn.Sequential:
    """Convolutions with ReLU between; the unit length is applied outside."""
    parts: list[nn.Module] = []
    for i in range(layers):
        parts += [nn.Conv2d(1 if i == 0 else width, width, 3, padding=1), nn.ReLU()]
    return nn.Sequential(*parts[:-1])


def right_disparity_check(disp_left: np.ndarray, disp_right: np.ndarray) -> np.ndarray:
    """True where the left pixel is seen in the right view: the maps agree within a pixel."""
    height, width = disp_left.shape
    x = np.rint(np.arange(width)[None] - np.where(np.isfinite(disp_left), disp_left, 1e6)).astype(np.int64)
    back = np.take_along_axis(disp_right, np.clip(x, 0, width - 1), 1)
    with np.errstate(invalid="ignore"):
        return (x >= 0) & (x < width) & (np.abs(back - disp_left) < 1)


def forward_warp(disp: np.ndarray) -> np.ndarray:
    """Disparity of the right view from that of the left: the nearest surface wins."""
    height, width = disp.shape
    right = np.full((height, width), -np.inf, np.float32)
    row, col = np.nonzero(np.isfinite(disp))
    for shift in (np.floor, np.ceil):
        x = shift(col - disp[row, col]).astype(np.int64)
        ok = (x >= 0) & (x < width)
        np.maximum.at(right, (row[ok], x[ok]), disp[row, col][ok])
    return right


def aloe_pairs(folder: str) -> list[Pair]:
    """Aloe at three sizes; its truth is in pixels of the pictures, 0 unknown."""
    left, right = (Image.open(os.path.join(folder, n)).convert("RGB") for n in ("aloeL.jpg", "aloeR.jpg"))
    truth = np.asarray(Image.open(os.path.join(folder, "aloeGT.png"))).astype(np.float32)
    truth[truth == 0] = np.inf
    pairs = []
    for scale in (1.0, 0.62, 0.4):
        size = (int(left.width * scale), int(left.height * scale))
        pick_y = ((np.arange(size[1]) + 0.5) / scale).astype(int).clip(0, left.height - 1)
        pick_x = ((np.arange(size[0]) + 0.5) / scale).astype(int).clip(0, left.width - 1)
        disp = truth[np.ix_(pick_y, pick_x)] * (size[0] / left.width)
        views = [np.asarray(v.resize(size, Image.Resampling.LANCZOS)) for v in (left, right)]
        views = [common.standardise(common.luma(v)) for v in views]
        pairs.append(Pair(views[0], views[1], disp, right_disparity_check(disp, forward_warp(disp))))
    return pairs


def scene_pairs(folder: str, seeds: range) -> list[Pair]:
    """
    The first view of each simulated light field with its right and its lower neighbour; the latter pair is turned so
    that it matches along rows.
    """
    pairs = []
    for lightfield in common.lightfields(folder, seeds):
        views = {k: v for k, v in common.lightfield_views(lightfield).items() if k in ((0, 0), (0, 1), (1, 0))}
        load = {k: common.standardise(common.luma(common.read_rgb(v))) for k, v in views.items()}
        disp = {k: common.read_pfm(os.path.join(lightfield, "truth", f"{k[0]:02d}_{k[1]:02d}.pfm")) for k in views}
        for other, turn in (((0, 1), False), ((1, 0), True)):
            maps = [load[0, 0], load[other], disp[0, 0], disp[other]]
            left, right, d_left, d_right = (np.ascontiguousarray(m.T) if turn else m for m in maps)
            pairs.append(Pair(left, right, d_left, right_disparity_check(d_left, d_right)))
    return pairs


def photometric(rng: np.random.Generator, crop: np.ndarray, common_gain: float, blur: float) -> np.ndarray:
    """What two cameras never share: gain, brightness, gamma, noise; a common gain and blur for the scene."""
    x = crop * common_gain
    x = np.sign(x) * np.abs(x) ** (1 + rng.normal(0, 0.05))  # gamma about the mean
    x = x * (1 + rng.normal(0, 0.08)) + rng.normal(0, 0.12)
    if blur > 0:
        pad = np.pad(x, 1, mode="edge")
        x = (1 - blur) * x + blur / 4 * (pad[:-2, 1:-1] + pad[2:, 1:-1] + pad[1:-1, :-2] + pad[1:-1, 2:])
    return (x + rng.normal(0, abs(rng.normal(0, 0.03)), x.shape)).astype(np.float32)


def shift_rows(x: np.ndarray, dy: float) -> np.ndarray:
    """Vertical error of rectification, |dy| <= 1."""
    moved = np.roll(x, 1 if dy > 0 else -1, 0)
    return x + abs(dy) * (moved - x)


def draw_crop(rng: np.random.Generator, pair: Pair, size: int):
    """A square crop of the left view and the crop of the right view that holds its matches."""
    height, width = pair.disp.shape
    for _ in range(20):
        y0, x0 = int(rng.integers(0, height - size + 1)), int(rng.integers(0, width - size + 1))
        box = np.s_[y0:y0 + size, x0:x0 + size]
        if pair.valid[box].sum() < 0.1 * size * size:
            continue
        start = x0 - int(round(float(rng.choice(pair.disp[box][pair.valid[box]]))))
        start = int(np.clip(start, 0, width - size))
        match = np.arange(x0, x0 + size)[None] - np.where(pair.valid[box], pair.disp[box], 0) - start
        inside = pair.valid[box] & (match > 6) & (match < size - 7)
        inside[:6], inside[-6:], inside[:, :6], inside[:, -6:] = False, False, False, False
        if inside.sum() >= 200:
            break
    else:
        return None
    gain, blur = 2.0 ** rng.normal(0, 0.25), max(0.0, rng.uniform(-0.6, 0.6))
    left = photometric(rng, pair.left[box], gain, blur)
    right = photometric(rng, pair.right[y0:y0 + size, start:start + size], gain,
                        float(np.clip(blur + rng.normal(0, 0.1), 0, 0.8)) if blur > 0 else 0.0)
    if rng.random() < 0.5:
        right = shift_rows(right, rng.uniform(-0.5, 0.5))
    rows, cols = np.nonzero(inside)
    pick = rng.integers(0, rows.size, POINTS)
    rows, cols, match = rows[pick], cols[pick], match[rows[pick], cols[pick]]
    if rng.random() < 0.5:  # mirrored: the sign of the disparity turns, which the network must not care about
        left, right = left[:, ::-1], right[:, ::-1]
        cols, match = size - 1 - cols, size - 1 - match
    if rng.random() < 0.5:  # upside down
        left, right, rows = left[::-1], right[::-1], size - 1 - rows
    return left.copy(), right.copy(), rows, cols, match


def step_loss(net: nn.Module, batch: list, offsets: torch.Tensor) -> torch.Tensor:
    """Hinge loss over all points of a batch of crops."""
    size, count = batch[0][0].shape[0], len(batch)
    images = torch.from_numpy(np.stack([b[0] for b in batch] + [b[1] for b in batch]))[:, None]
    feature = F.normalize(net(images.contiguous(memory_format=torch.channels_last)), dim=1)
    table = feature.permute(0, 2, 3, 1).reshape(-1, feature.shape[1])
    rows, cols, match = (torch.from_numpy(np.stack([b[i] for b in batch])) for i in (2, 3, 4))
    base = torch.arange(count)[:, None] * size * size + rows * size
    true = torch.floor(match + 0.5).long()
    at = true[..., None] + offsets
    away = (at - match[..., None]).abs()
    wrong = (away >= NEAR) & (away <= FAR) & (at >= 5) & (at < size - 5)
    left = F.embedding(base + cols, table)
    index = base[..., None] + count * size * size + at.clamp(0, size - 1)
    score = (F.embedding(index, table) * left[:, :, None]).sum(-1)
    centre = int((offsets == 0).nonzero())
    hinge = (MARGIN + score - score[..., centre:centre + 1]).clamp(min=0) * wrong
    mean = hinge.sum(-1) / wrong.sum(-1).clamp(min=1)
    return 0.5 * (mean + hinge.amax(-1)).mean()


def sources(args: argparse.Namespace) -> list[tuple[float, list[Pair]]]:
    """Training pairs with the share of the crops that each source gives."""
    started = time.time()
    mix = [(1.0, [make_pair(args.seed * 100003 + i) for i in range(args.synthetic)])]
    if args.aloe:
        mix.append((0.8, aloe_pairs(args.aloe)))
    if args.scenes:
        mix.append((1.2, scene_pairs(args.scenes, common.TRAIN_SEEDS)))
    for share, pairs in mix:
        print(f"{len(pairs)} pairs, share {share}, valid {np.mean([p.valid.mean() for p in pairs]):.2f}")
    print(f"read in {time.time() - started:.0f} s", flush=True)
    return mix


def train(args: argparse.Namespace) -> nn.Module:
    net = build(args.layers, args.width).to(memory_format=torch.channels_last)
    optimiser = torch.optim.Adam(net.parameters(), lr=args.rate)
    first = 0
    saved = common.load_checkpoint(args.checkpoint)
    if saved:
        net.load_state_dict(saved["net"])
        optimiser.load_state_dict(saved["optimiser"])
        first = saved["step"]
    elif args.start:
        net.load_state_dict(torch.load(args.start, map_location="cpu")["net"])
    mix = sources(args) if first < args.steps else []
    share = np.array([m[0] for m in mix]) / sum(m[0] for m in mix) if mix else []
    offsets = torch.arange(-int(FAR), int(FAR) + 1)
    started, losses = time.time(), []
    for step in range(first, args.steps):
        rng = np.random.default_rng((args.seed, step))
        batch = []
        while len(batch) < args.batch:
            pairs = mix[rng.choice(len(mix), p=share)][1]
            crop = draw_crop(rng, pairs[rng.integers(len(pairs))], args.crop)
            if crop:
                batch.append(crop)
        rate = args.rate * min(1.0, (step + 1) / 100) * 0.5 * (1.02 + np.cos(np.pi * step / args.steps))
        for group in optimiser.param_groups:
            group["lr"] = rate
        loss = step_loss(net, batch, offsets)
        optimiser.zero_grad(set_to_none=True)
        loss.backward()
        optimiser.step()
        losses.append(float(loss))
        if (step + 1) % 50 == 0 or step + 1 == args.steps:
            print(f"step {step + 1}/{args.steps} loss {np.mean(losses):.4f} {time.time() - started:.0f} s", flush=True)
            losses.clear()
            common.save_checkpoint(args.checkpoint, net=net.state_dict(), optimiser=optimiser.state_dict(),
                                   step=step + 1)
    return net


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--aloe", help="folder with aloeL.jpg, aloeR.jpg, aloeGT.png")
    parser.add_argument("--scenes", help="folder of light fields written by `sst scene`")
    parser.add_argument("--synthetic", type=int, default=240, help="drawn pairs to train on")
    parser.add_argument("--checkpoint", required=True, help="written while training; training goes on from it")
    parser.add_argument("--start", help="checkpoint of an earlier stage whose weights this one starts from")
    parser.add_argument("--out", help="ONNX file to write at the end")
    parser.add_argument("--layers", type=int, default=4)
    parser.add_argument("--width", type=int, default=64)
    parser.add_argument("--steps", type=int, default=2000)
    parser.add_argument("--batch", type=int, default=4)
    parser.add_argument("--crop", type=int, default=96)
    parser.add_argument("--rate", type=float, default=1.5e-3)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--threads", type=int, default=1)
    args = parser.parse_args()
    common.seed_all(args.seed, args.threads)
    net = train(args)
    if args.out:
        onnx_file.write_mccnn(args.out, [m for m in net if isinstance(m, nn.Conv2d)])


if __name__ == "__main__":
    main()
