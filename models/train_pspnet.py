#!/usr/bin/python3
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
"""
Trains the segmentation network: a compact dilated residual network at 1/8, pyramid pooling at four levels (Zhao et al.
2017; design.md, 5.1) and a light decoder to 1/4. Learns the 23 classes of pipeline/image/classes.c from simulated scenes
and CamVid, then fits temperature and entropy threshold on held-out pictures and writes the ONNX file.

  /usr/bin/python3 models/train_pspnet.py --scenes DIR --camvid DIR --checkpoint psp.pt --out models/pspnet-small.onnx
"""
import argparse
import copy
import glob
import os
import time

import numpy as np
import onnx
import torch
import torch.nn as nn
import torch.nn.functional as F
from onnx import numpy_helper
from PIL import Image

import common
import label_augment
import onnx_file

CLASSES = ("Sky Building Pole Road Pavement Tree SignSymbol Fence Car Pedestrian Bicyclist Furniture Table Horse "
           "Bicycle Motorcycle Toy Case Poster Cat Hen Membrane Nucleus").split()
CAMVID = 11  # the first classes, in CamVid's order
GROUND = "Road,Pavement,Table"
TREE, VOID = 5, 255
MEAN, STD = (0.43, 0.44, 0.43), (0.26, 0.26, 0.27)


class ConvNorm(nn.Module):
    """Convolution and BatchNorm, without activation."""

    def __init__(self, cin: int, cout: int, kernel: int = 3, stride: int = 1, dilation: int = 1):
        super().__init__()
        self.conv = nn.Conv2d(cin, cout, kernel, stride, dilation * (kernel // 2), dilation, bias=False)
        self.norm = nn.BatchNorm2d(cout)

    def forward(self, x):
        return self.norm(self.conv(x))


class Block(nn.Module):
    """Residual block of two 3x3 convolutions; a 1x1 projection where the width changes."""

    def __init__(self, cin: int, cout: int, dilation: int = 1):
        super().__init__()
        self.first, self.second = ConvNorm(cin, cout, dilation=dilation), ConvNorm(cout, cout, dilation=dilation)
        self.project = ConvNorm(cin, cout, 1) if cin != cout else None

    def forward(self, x):
        y = self.second(F.relu(self.first(x)))
        return F.relu(y + (x if self.project is None else self.project(x)))


def resized(x: torch.Tensor, size) -> torch.Tensor:
    """Bilinear; always in float32, because bfloat16 has no fast kernel for it on CPUs."""
    return F.interpolate(x.float(), size, mode="bilinear", align_corners=False).to(x.dtype)


# channels at 1/2, 1/4, 1/8; blocks at 1/4; dilations of the blocks at 1/8; channels of a pooled level, merged, decoded
SIZES = {
    "small": dict(widths=(32, 64, 128), fine=1, dilations=(1, 2, 2, 4), pooled=32, merged=96, decoded=64),
    "large": dict(widths=(32, 64, 128), fine=3, dilations=(1, 2, 2, 4, 1, 2, 4, 8, 1), pooled=32, merged=96, decoded=64),
}


class PspNet(nn.Module):
    """[1,3,H,W] -> logits [1,classes,H/4,W/4], sizes rounded up."""

    def __init__(self, size: str, working: tuple[int, int], classes: int = len(CLASSES), bins=(1, 2, 3, 6)):
        super().__init__()
        self.working = working  # width and height of the pictures that it is trained for
        shape = SIZES[size]
        w0, w1, w2 = shape["widths"]
        self.stem = nn.ModuleList([ConvNorm(3, w0, stride=2), ConvNorm(w0, w1, stride=2)])
        self.fine = nn.ModuleList([Block(w1, w1) for _ in range(shape["fine"])])
        self.down = ConvNorm(w1, w2, stride=2)
        self.coarse = nn.ModuleList([Block(w2, w2, dilation) for dilation in shape["dilations"]])
        self.aux_after = (len(shape["dilations"]) + 1) // 2
        self.aux = nn.Conv2d(w2, classes, 1)
        self.bins = bins
        self.pyramid = nn.ModuleList([ConvNorm(w2, shape["pooled"], 1) for _ in bins])
        self.merge = ConvNorm(w2 + shape["pooled"] * len(bins), shape["merged"])
        self.decode = ConvNorm(shape["merged"] + w1, shape["decoded"])
        self.drop = nn.Dropout2d(0.1)
        self.classify = nn.Conv2d(shape["decoded"], classes, 1)

    def forward(self, x):
        for layer in self.stem:
            x = F.relu(layer(x))
        for block in self.fine:
            x = block(x)
        fine, x, aux = x, F.relu(self.down(x)), None
        for i, block in enumerate(self.coarse):
            x = block(x)
            if self.training and i + 1 == self.aux_after:
                aux = self.aux(x)
        pooled = [F.relu(layer(F.adaptive_avg_pool2d(x, size))) for layer, size in zip(self.pyramid, self.bins)]
        x = torch.cat([x] + [resized(p, x.shape[2:]) for p in pooled], 1)
        x = resized(F.relu(self.merge(x)), fine.shape[2:])
        x = F.relu(self.decode(torch.cat([x, fine], 1)))
        x = self.classify(self.drop(x))
        return (x.float(), aux.float()) if self.training else x


def grow(net: PspNet, weights: dict[str, torch.Tensor]) -> None:
    """
    Start a network from the weights of a smaller one of the same widths: the additional blocks (they follow the
    others) begin as the identity, since the scale of their last BatchNorm is zero, so nothing learnt is lost.
    """
    missing, unexpected = net.load_state_dict(weights, strict=False)
    if unexpected:
        raise SystemExit(f"cannot grow from a network that has {unexpected[0]}")
    for name in missing:
        if name.endswith("second.norm.weight"):
            nn.init.zeros_(net.get_parameter(name))


def unfold(net: PspNet, path: str, pictures: list[torch.Tensor]) -> None:
    """
    Start a network from an exported file. Its convolutions contain their BatchNorms; mean and deviation of what each
    gives for the pictures become a norm again, and the weights get the size of new ones, so that it trains like a
    network that was never folded. The auxiliary classifier, which is not in the file, stays as it is.
    """
    weights = [torch.from_numpy(numpy_helper.to_array(w).copy()) for w in onnx.load(path).graph.initializer]
    layers = [m for m in net.modules() if isinstance(m, ConvNorm)]
    if [w.shape for w in weights[::2]] != [m.conv.weight.shape for m in layers] + [net.classify.weight.shape]:
        raise SystemExit(f"{path}: not a network of this size")

    def settle(layer: ConvNorm, bias: torch.Tensor, values: torch.Tensor) -> torch.Tensor:
        """After the convolution: shrink its weights, and let the norm undo that for the values seen."""
        weight = layer.conv.weight.data
        shrink = (3 * weight[0].numel()) ** -0.5 / weight.flatten(1).std(1).clamp(min=1e-6)
        weight.mul_(shrink[:, None, None, None])
        values = values * shrink[:, None, None]
        norm = layer.norm
        norm.running_var.copy_(values.var((0, 2, 3), unbiased=False))
        norm.running_mean.copy_(values.mean((0, 2, 3)))
        norm.weight.data.copy_((norm.running_var + norm.eps).sqrt() / shrink)
        norm.bias.data.copy_(bias + norm.running_mean / shrink)
        return values

    hooks = []
    for layer, weight, bias in zip(layers, weights[::2], weights[1::2]):
        layer.conv.weight.data.copy_(weight)
        hooks.append(layer.conv.register_forward_hook(lambda _, __, y, layer=layer, b=bias: settle(layer, b, y)))
    net.classify.weight.data.copy_(weights[-2])
    net.classify.bias.data.copy_(weights[-1])
    net.eval()
    with torch.no_grad():
        net(torch.stack(pictures))
    for hook in hooks:
        hook.remove()
    onnx_file.check(path, pictures[0][None], net(pictures[0][None]).detach(), 1e-3)


def export(net: PspNet, path: str, metadata: dict[str, str]) -> None:
    """Node by node: BatchNorm folded, the sizes that depend on the input in two operators of the domain "sst"."""
    graph = onnx_file.GraphWriter()

    def conv(x: str, layer: ConvNorm) -> str:
        return graph.conv(x, layer.conv, layer.norm)

    def relu(x: str) -> str:
        return graph.node("Relu", [x])

    def like(x: str, size_of: str) -> str:
        return graph.node("ResizeLike", [x, size_of], domain="sst", align_corners=0)

    def residual(x: str, block: Block) -> str:
        y = conv(relu(conv(x, block.first)), block.second)
        return relu(graph.node("Add", [y, x if block.project is None else conv(x, block.project)]))

    x = "input"
    for layer in net.stem:
        x = relu(conv(x, layer))
    for block in net.fine:
        x = residual(x, block)
    fine, x = x, relu(conv(x, net.down))
    for block in net.coarse:
        x = residual(x, block)
    parts = [x]
    for layer, size in zip(net.pyramid, net.bins):
        pooled = graph.node("AdaptiveAveragePool", [x], domain="sst", output_size=[size, size])
        parts.append(like(relu(conv(pooled, layer)), x))
    x = like(relu(conv(graph.node("Concat", parts, axis=1), net.merge)), fine)
    x = graph.node("Concat", [x, fine], axis=1)
    graph.conv(relu(conv(x, net.decode)), net.classify)
    graph.save(path, 3, len(CLASSES), metadata)
    net.eval()
    for size in ((net.working[1], net.working[0]), (251, 333)):  # odd sizes too
        image = torch.randn(1, 3, *size)
        with torch.no_grad():
            onnx_file.check(path, image, net(image))


# --- data ------------------------------------------------------------------------------------------------------------

def camvid(folder: str, part: str, drives: list[str], inside: bool) -> list[tuple[np.ndarray, np.ndarray]]:
    """(picture, class map) of the given drives, or of all others; CamVid's void (11) becomes VOID."""
    data = []
    for path in sorted(glob.glob(os.path.join(folder, part, "*.jpg"))):
        name = os.path.basename(path)[:-4]
        if (name.split("_")[0] in drives) != inside:
            continue
        labels = np.array(Image.open(os.path.join(folder, part + "annot", name + ".png")))
        labels[labels >= CAMVID] = VOID
        data.append((common.read_rgb(path), labels))
    return data


def scenes(folder: str, seeds: range, per_scene: int) -> list[tuple[np.ndarray, np.ndarray]]:
    """(picture, class map) of some views of the light fields NAME-SEED in a folder; unlabeled (0) becomes VOID."""
    data = []
    for lightfield in common.lightfields(folder, seeds):
        views = common.lightfield_views(lightfield)
        for key in sorted(views)[::max(1, len(views) // per_scene)][:per_scene]:
            truth = os.path.join(lightfield, "truth", f"{key[0]:02d}_{key[1]:02d}.png")
            labels = np.array(Image.open(truth)) - np.uint8(1)  # 0 wraps to VOID
            data.append((common.read_rgb(views[key]), labels))
    return data


def augment(rng: np.random.Generator, data: list, leaves: list, args: argparse.Namespace, frequent: np.ndarray):
    """A crop of one of the pictures with altered colours, and what --augment asks for; leaves: pictures with foliage."""
    def draw(pictures: list):
        rgb, labels = pictures[rng.integers(len(pictures))]
        return label_augment.crop(rng, rgb, labels, tuple(args.crop), frequent, tuple(args.zoom), args.working[0])

    picture, truth = draw(data)
    if "plain" in args.augment and (len(args.augment) == 1 or rng.random() < 0.5):
        x = label_augment.plain_colours(rng, picture)
    else:
        def donor(source: int):
            return draw(leaves) if source and leaves else None if source else draw(data)
        x, truth = label_augment.strong(rng, picture, truth, donor, frozenset(args.augment))
    return normalise(x), torch.from_numpy(truth.astype(np.int64))


def normalise(x: np.ndarray) -> torch.Tensor:
    """[H,W,3] in 0..1 -> [3,H,W], the network's input."""
    return torch.from_numpy(((x - np.array(MEAN)) / np.array(STD)).astype(np.float32).transpose(2, 0, 1).copy())


# --- measuring -------------------------------------------------------------------------------------------------------

def network_input(net: PspNet, rgb: np.ndarray) -> torch.Tensor:
    """[3,H,W] at the working size."""
    small = Image.fromarray(rgb).resize(net.working, Image.Resampling.BOX)
    return normalise(np.asarray(small, np.float32) / 255)


def logits(net: PspNet, rgb: np.ndarray) -> torch.Tensor:
    """[classes, h/4, w/4] at the working size."""
    image = network_input(net, rgb)[None]
    with torch.no_grad():
        return net(image.to(net.classify.weight.device).contiguous(memory_format=torch.channels_last))[0].float().cpu()


def measure(net: PspNet, data, rng: np.random.Generator) -> tuple[np.ndarray, torch.Tensor, torch.Tensor]:
    """[truth, given] pixel counts at the size of the truth; logits (bilinear) and truth of one known pixel in 60."""
    count = len(CLASSES)
    total = np.zeros((count, count), np.int64)
    rows, truths = [], []
    for rgb, labels in data:
        full = F.interpolate(logits(net, rgb)[None], labels.shape, mode="bilinear", align_corners=False)[0].flatten(1)
        truth, known = labels.ravel().astype(np.int64), np.flatnonzero(labels != VOID)
        total += np.bincount(truth[known] * count + full.argmax(0).numpy()[known],
                             minlength=count * count).reshape(count, count)
        pick = rng.permutation(known)[:labels.size // 60]
        rows.append(full[:, torch.from_numpy(pick)].T)
        truths.append(torch.from_numpy(truth[pick]))
    return total, torch.cat(rows), torch.cat(truths)


def iou(total: np.ndarray) -> np.ndarray:
    """Per class; NaN where the truth has none."""
    union = total.sum(0) + total.sum(1) - np.diag(total)
    return np.where(total.sum(1) > 0, np.diag(total) / np.maximum(union, 1), np.nan)


def report(name: str, total: np.ndarray) -> None:
    """mIoU over the classes in the truth, pixel accuracy, and IoU of each class."""
    score = iou(total)
    right = np.trace(total) / total.sum()
    print(f"{name}: mIoU {100 * np.nanmean(score):.1f} %, pixels right {100 * right:.1f} %", flush=True)
    print("  " + ", ".join(f"{c} {100 * s:.0f}" for c, s in zip(CLASSES, score) if not np.isnan(s)), flush=True)


def fit_temperature(rows: torch.Tensor, truth: torch.Tensor) -> float:
    """Smallest negative log likelihood over a fine grid, sufficient for one parameter."""
    grid = np.exp(np.linspace(np.log(0.4), np.log(4), 121))
    loss = [float(F.cross_entropy(rows / t, truth)) for t in grid]
    return float(grid[int(np.argmin(loss))])


def fit_epsilon(rows: torch.Tensor, truth: torch.Tensor, temperature: float,
                power: int = 4) -> tuple[float, float, float]:
    """Entropy threshold with the largest accuracy^m * coverage (design.md, 5.1), with that accuracy and coverage."""
    p = (rows / temperature).softmax(1)
    entropy = -(p * p.clamp(min=1e-12).log()).sum(1)
    order = entropy.argsort()
    right = (p.argmax(1) == truth)[order].double().cumsum(0)
    kept = torch.arange(1, len(order) + 1, dtype=torch.double)
    accuracy, coverage = right / kept, right / len(order)
    best = int((power * accuracy.log() + coverage.log()).argmax())
    at = entropy[order]
    limit = float(at[best] + at[min(best + 1, len(at) - 1)]) / 2
    return limit, float(accuracy[best]), float(coverage[best])


# --- training --------------------------------------------------------------------------------------------------------

def class_weights(data) -> tuple[np.ndarray, torch.Tensor]:
    """Fraction of pixels of each class, and its weight in the loss: inverse square root, within limits."""
    counts = [np.bincount(labels.ravel(), minlength=256)[:len(CLASSES)] / labels.size for _, labels in data]
    share = np.maximum(np.mean(counts, 0), 1e-5)
    return share, torch.from_numpy(np.clip(np.sqrt(np.median(share) / share), 0.5, 2.5).astype(np.float32))


def train(args: argparse.Namespace, sources: list[tuple[float, list]], watched: dict) -> PspNet:
    device = "cuda" if torch.cuda.is_available() else "cpu"
    net = PspNet(args.size, tuple(args.working)).to(device, memory_format=torch.channels_last)
    mean = copy.deepcopy(net)  # running mean of the weights: is exported
    optimiser = torch.optim.AdamW(net.parameters(), lr=args.rate, weight_decay=0.02)
    first = 0
    saved = common.load_checkpoint(args.checkpoint)
    if saved:
        net.load_state_dict(saved["net"])
        mean.load_state_dict(saved["mean"])
        optimiser.load_state_dict(saved["optimiser"])
        first = saved["step"]
    elif args.grow:
        grow(net, torch.load(args.grow, map_location="cpu")["net"])
        mean.load_state_dict(net.state_dict())
    elif args.start and args.start.endswith(".onnx"):
        rng = np.random.default_rng(1)
        seen = [d[rng.integers(len(d))][0] for _, d in sources for _ in range(8)]
        unfold(net, args.start, [network_input(net, rgb) for rgb in seen])
        mean.load_state_dict(net.state_dict())
    elif args.start:
        start = torch.load(args.start, map_location="cpu")
        net.load_state_dict(start["net"])
        mean.load_state_dict(start["mean"])
        optimiser.load_state_dict(start["optimiser"])
    frequent, weight = class_weights([d for _, data in sources for d in data])
    weight = weight.to(device)
    shares = np.array([s for s, _ in sources]) / sum(s for s, _ in sources)
    leaves = [d for _, data in sources for d in data if (d[1] >= CAMVID)[d[1] != VOID].any() and TREE in d[1]]
    started, losses = time.time(), []
    net.train()
    for step in range(first, args.steps):
        rng = np.random.default_rng((args.seed, step))
        torch.manual_seed(args.seed * 1000003 + step)
        batch = []
        for _ in range(args.batch):
            batch.append(augment(rng, sources[rng.choice(len(sources), p=shares)][1], leaves, args, frequent))
        images = torch.stack([b[0] for b in batch]).to(device).contiguous(memory_format=torch.channels_last)
        truth = torch.stack([b[1] for b in batch]).to(device)
        rate = args.rate * min(1.0, (step + 1) / args.warm, (args.steps - step) / max(1, args.decay))
        for group in optimiser.param_groups:
            group["lr"] = rate
        with torch.autocast(device, dtype=torch.bfloat16, enabled=args.bfloat16):
            out, aux = net(images)
        half = truth[:, step % 2::2, (step // 2) % 2::2]
        loss = F.cross_entropy(resized(out, half.shape[1:]), half, weight, ignore_index=VOID)
        loss = loss + 0.4 * F.cross_entropy(aux, truth[:, 3::8, 3::8], weight, ignore_index=VOID)
        optimiser.zero_grad(set_to_none=True)
        loss.backward()
        optimiser.step()
        keep = min(args.keep, (step + 1) / (step + 20))
        with torch.no_grad():
            for to, source in zip(mean.state_dict().values(), net.state_dict().values()):
                to.copy_(to * keep + source * (1 - keep)) if to.is_floating_point() else to.copy_(source)
        losses.append(float(loss))
        if (step + 1) % 50 == 0 or step + 1 == args.steps:
            print(f"step {step + 1}/{args.steps} loss {np.mean(losses):.4f} {time.time() - started:.0f} s", flush=True)
            losses.clear()
            common.save_checkpoint(args.checkpoint, net=net.state_dict(), mean=mean.state_dict(),
                                   optimiser=optimiser.state_dict(), step=step + 1)
        if args.watch and (step + 1) % args.watch == 0:
            mean.eval()
            for name, data in watched.items():
                report(f"watched {name}", measure(mean, data[::args.watch_every], np.random.default_rng(1))[0])
    return mean.to("cpu").eval()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", help="folder of light fields NAME-SEED written by `sst scene`")
    parser.add_argument("--camvid", help="folder with train, trainannot, val, valannot")
    parser.add_argument("--checkpoint", required=True, help="written during training; training resumes from it")
    parser.add_argument("--leave-out", action="append", default=[], metavar="DRIVE", help="drive of CamVid (0001TP, "
                        "0006R0, 0016E5) that is not trained on and is judged instead; repeatable")
    parser.add_argument("--start", help="checkpoint of an earlier stage, or ONNX file, whose weights this one starts from")
    parser.add_argument("--grow", help="checkpoint of a smaller network that this one grows from")
    parser.add_argument("--out", help="ONNX file to write at the end")
    parser.add_argument("--size", choices=SIZES, default="small")
    parser.add_argument("--steps", type=int, default=2500)
    parser.add_argument("--batch", type=int, default=6)
    parser.add_argument("--crop", type=int, nargs=2, default=(320, 240), metavar=("W", "H"))
    parser.add_argument("--working", type=int, nargs=2, default=(480, 360), metavar=("W", "H"),
                        help="nominal size of the pictures for the network")
    parser.add_argument("--zoom", type=float, nargs=2, default=(-0.74, 0.68), metavar=("LOW", "HIGH"),
                        help="log2 of the scale of the crops")
    parser.add_argument("--augment", nargs="*", choices=("plain", "paste", "foliage", "leaves", "style", "light", "sensor"),
                        default=["plain"], help="how training pictures are altered (%(default)s); plain beside others: "
                        "half of the crops plainly")
    parser.add_argument("--rate", type=float, default=3e-3, help="step rate between warm-up and decay")
    parser.add_argument("--warm", type=int, default=100, help="steps over which the rate rises from 0")
    parser.add_argument("--decay", type=int, default=0, help="last steps, over which the rate falls to 0")
    parser.add_argument("--keep", type=float, default=0.995, help="decay of the running mean of the weights per step")
    parser.add_argument("--bfloat16", action="store_true", help="convolutions in bfloat16: twice as fast where the "
                        "CPU or GPU has it")
    parser.add_argument("--scene-share", type=float, default=0.35, help="share of scenes in a batch")
    parser.add_argument("--watch", type=int, default=0, help="print the error on CamVid's held-out pictures every "
                        "N steps")
    parser.add_argument("--watch-every", type=int, default=1, help="of one such picture in N")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--views", type=int, default=4, help="views used of each light field")
    args = parser.parse_args()
    common.seed_all(args.seed, args.threads)
    sources, held = [], {}
    if args.scenes:
        sources.append((args.scene_share, scenes(args.scenes, common.TRAIN_SEEDS, args.views)))
        held["scenes"] = scenes(args.scenes, common.HELD_SEEDS, 2)
    if args.camvid:
        sources.append((1 - args.scene_share, camvid(args.camvid, "train", args.leave_out, False)))
        held["camvid val"] = camvid(args.camvid, "val", args.leave_out, False)
        for drive in args.leave_out:
            held[f"left out: {drive}"] = [d for part in ("train", "val") for d in camvid(args.camvid, part, [drive], True)]
    empty = [name for name, data in held.items() if not data and name != "camvid val"]
    if empty:
        raise SystemExit(f"no pictures: {', '.join(empty)}")
    held = {name: data for name, data in held.items() if data}
    if args.leave_out and args.start:
        print(f"{args.start}: was it trained without {', '.join(args.leave_out)}? If not, these do not judge it", flush=True)
    print({"train": [len(d) for _, d in sources], "held out": {k: len(d) for k, d in held.items()}}, flush=True)
    net = train(args, sources, {k: d for k, d in held.items() if k != "scenes"})
    rows, truths = [], []
    for name, data in held.items():
        total, row, truth = measure(net, data, np.random.default_rng(1))
        report(name, total)
        rows.append(row)
        truths.append(truth)
    if args.out:
        rows, truth = torch.cat(rows), torch.cat(truths)
        temperature = fit_temperature(rows, truth)
        limit, accuracy, coverage = fit_epsilon(rows, truth, temperature)
        print(f"temperature {temperature:.3f}, epsilon_h {limit:.3f}: accuracy {accuracy:.3f}, coverage {coverage:.3f}")
        export(net, args.out, {
            "sst.kind": "segmentation", "sst.classes": ",".join(CLASSES), "sst.ground": GROUND,
            "sst.mean": ",".join(map(str, MEAN)), "sst.std": ",".join(map(str, STD)),
            "sst.size": "x".join(map(str, args.working)), "sst.epsilon_h": f"{limit:.4f}", "sst.temperature": f"{temperature:.4f}", "sst.output": "logits"})


if __name__ == "__main__":
    main()
