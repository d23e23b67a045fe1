#!/usr/bin/python3
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
"""
Trains the matching network: siamese 3x3 convolutions, unit-length features, cost = -dot product
(Zbontar and LeCun 2016, "fast" architecture; design.md, 5.2). Whole crops go through the network, so one pass serves
thousands of matches; loss max(0, margin + s_neg - s_pos), half the mean over the wrong positions, half the hardest one.
First a base without the Middlebury pairs, then from it the network that ships, and one without each pair to measure by:

  models/train_mccnn.py --scenes DIR --checkpoint base.pt
  models/train_mccnn.py --scenes DIR --middlebury DIR --start base.pt --checkpoint all.pt --out models/mccnn-fast.onnx
"""
import argparse
import time

import numpy as np
import torch
import torch.nn as nn
import torch.nn.functional as F

import common
import onnx_file
from matching_pairs import BORDER, MIDDLEBURY, draw_crop, middlebury_pairs, scene_pairs
from synthetic_pairs import Pair, make_pair

MARGIN = 0.2
NEAR, FAR = 1.5, 18  # wrong positions, px from the true one


def build(layers: int, width: int) -> nn.Sequential:
    """Convolutions with ReLU between; the unit length is applied outside."""
    parts: list[nn.Module] = []
    for i in range(layers):
        parts += [nn.Conv2d(1 if i == 0 else width, width, 3, padding=1), nn.ReLU()]
    return nn.Sequential(*parts[:-1])


def step_loss(net: nn.Module, batch: list, bfloat16: bool, turn: bool) -> torch.Tensor:
    """
    Hinge loss over all known matches of a batch of crops. turn: the network sees the crops turned on their side, as it
    does when vertical neighbours are matched.
    """
    device = next(net.parameters()).device
    images, match, valid = (torch.from_numpy(np.stack(v)).to(device) for v in (
        [b[0] for b in batch] + [b[1] for b in batch], [b[2] for b in batch], [b[3] for b in batch]))
    images = images[:, None].transpose(2, 3) if turn else images[:, None]
    with torch.autocast(device.type, dtype=torch.bfloat16, enabled=bfloat16):
        out = net(images.contiguous(memory_format=torch.channels_last))
    feature = F.normalize(out.float(), dim=1)
    feature = feature.transpose(2, 3) if turn else feature
    left, right = feature.permute(0, 2, 3, 1).chunk(2)
    score = (left @ right.transpose(2, 3))[valid]  # [matches, columns of the right row]
    match = match[valid][:, None]
    columns = torch.arange(score.shape[1], device=device)
    away = (columns - match).abs()
    wrong = (away >= NEAR) & (away <= FAR) & (columns >= BORDER) & (columns < score.shape[1] - BORDER)
    hinge = (MARGIN + score - score.gather(1, torch.floor(match + 0.5).long())).clamp(min=0) * wrong
    mean = hinge.sum(1) / wrong.sum(1).clamp(min=1)
    return 0.5 * (mean + hinge.amax(1)).mean()


def sources(args: argparse.Namespace) -> list[tuple[float, list[Pair]]]:
    """Training pairs with each source's fraction of the crops."""
    started = time.time()
    mix = [(1.0, [make_pair(args.seed * 100003 + i) for i in range(args.synthetic)])]
    if args.scenes:
        mix.append((1.0, scene_pairs(args.scenes, common.TRAIN_SEEDS)))
    if args.middlebury:
        mix.append((1.0, middlebury_pairs(args.middlebury, args.leave_out)))
    for share, pairs in mix:
        print(f"{len(pairs)} pairs, share {share}, valid {np.mean([p.valid.mean() for p in pairs]):.2f}")
    print(f"read in {time.time() - started:.0f} s", flush=True)
    return mix


def train(args: argparse.Namespace) -> nn.Module:
    device = "cuda" if torch.cuda.is_available() else "cpu"
    net = build(args.layers, args.width).to(device, memory_format=torch.channels_last)
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
        loss = step_loss(net, batch, args.bfloat16, turn=rng.random() < 0.25)
        optimiser.zero_grad(set_to_none=True)
        loss.backward()
        optimiser.step()
        losses.append(float(loss))
        if (step + 1) % 50 == 0 or step + 1 == args.steps:
            print(f"step {step + 1}/{args.steps} loss {np.mean(losses):.4f} {time.time() - started:.0f} s", flush=True)
            losses.clear()
            common.save_checkpoint(args.checkpoint, net=net.state_dict(), optimiser=optimiser.state_dict(),
                                   step=step + 1)
    return net.to("cpu")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--middlebury", help="folder with the pairs cones, teddy, aloe and motorcycle")
    parser.add_argument("--leave-out", choices=MIDDLEBURY, help="pair to exclude from training, for evaluation on it")
    parser.add_argument("--scenes", help="folder of light fields written by `sst scene`")
    parser.add_argument("--synthetic", type=int, default=240, help="drawn pairs to train on")
    parser.add_argument("--checkpoint", required=True, help="written during training; training resumes from it")
    parser.add_argument("--start", help="checkpoint of an earlier stage whose weights this one starts from")
    parser.add_argument("--out", help="ONNX file to write at the end")
    parser.add_argument("--layers", type=int, default=4)
    parser.add_argument("--width", type=int, default=64)
    parser.add_argument("--steps", type=int, default=2000)
    parser.add_argument("--batch", type=int, default=4)
    parser.add_argument("--crop", type=int, default=96)
    parser.add_argument("--rate", type=float, default=1.5e-3)
    parser.add_argument("--bfloat16", action="store_true", help="convolutions in bfloat16: twice as fast where the "
                        "CPU or GPU has it")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--threads", type=int, default=1)
    args = parser.parse_args()
    if args.leave_out and not args.middlebury:
        parser.error("--leave-out NAME leaves a pair of --middlebury DIR out: give that too")
    common.seed_all(args.seed, args.threads)
    net = train(args)
    if args.out:
        onnx_file.write_mccnn(args.out, [m for m in net if isinstance(m, nn.Conv2d)])


if __name__ == "__main__":
    main()
