#!/usr/bin/python3
"""
Share of wrong pixels of the raw winner (no aggregation, no optimisation) of matching costs on Middlebury pairs that
were not trained on, and on held-out simulated scenes: census 9x7, our network, and any other network given as a torch
state dict.

  /usr/bin/python3 models/compare_matching.py --data DIR [--scenes DIR] models/mccnn-fast.onnx [other.pt]
"""
import argparse
import os

import numpy as np
import torch
import torch.nn.functional as F
from PIL import Image

import common
import onnx_file
from synthetic_pairs import Pair
from train_mccnn import build, forward_warp, right_disparity_check, scene_pairs


def pair_of(left: np.ndarray, right: np.ndarray, disp: np.ndarray, disp_right: np.ndarray) -> Pair:
    views = (common.standardise(common.luma(v)) for v in (left, right))
    return Pair(*views, disp, right_disparity_check(disp, disp_right))


def middlebury(folder: str):
    """(name, pair) of each, at the size given."""
    for name in ("cones", "teddy"):
        at = os.path.join(folder, name)
        views = [common.read_rgb(os.path.join(at, f)) for f in ("im2.png", "im6.png")]
        disp = [np.asarray(Image.open(os.path.join(at, f))).astype(np.float32) / 4 for f in ("disp2.png", "disp6.png")]
        yield name, pair_of(*views, *(np.where(d > 0, d, np.inf).astype(np.float32) for d in disp))
    at = os.path.join(folder, "motorcycle")
    disp = np.load(os.path.join(at, "motorcycle_disp.npz"))["arr_0"].astype(np.float32)
    views = [common.read_rgb(os.path.join(at, f"motorcycle_{s}.png")) for s in ("left", "right")]
    yield "motorcycle", pair_of(*views, disp, forward_warp(disp))


def held_out_scenes(folder: str):
    """One light field of each kind: its horizontal and its vertical pair."""
    seeds = common.HELD_SEEDS[:1]
    for at, pair in zip(np.repeat(common.lightfields(folder, seeds), 2), scene_pairs(folder, seeds)):
        yield "scene " + os.path.basename(at), pair


def winner(score, count: int) -> np.ndarray:
    """argmax over d of score(d), which gives [H, W - d] for the left columns d.. on."""
    best = score(0)
    at = np.zeros(best.shape, np.int64)
    for d in range(1, count):
        now = score(d)
        better = now > best[:, d:]
        best[:, d:][better], at[:, d:][better] = now[better], d
    return at


def census(left: np.ndarray, right: np.ndarray, count: int) -> np.ndarray:
    def bits(img: np.ndarray) -> np.ndarray:
        pad, (h, w) = np.pad(img, ((3, 3), (4, 4)), mode="edge"), img.shape
        return np.stack([pad[y:y + h, x:x + w] < img for y in range(7) for x in range(9) if (y, x) != (3, 4)])
    a, b = bits(left), bits(right)
    return winner(lambda d: (a[:, :, d:] == b[:, :, :b.shape[2] - d]).sum(0).astype(np.float32), count)


def features(network, left: np.ndarray, right: np.ndarray, count: int) -> np.ndarray:
    with torch.no_grad():
        a, b = (network(torch.from_numpy(v)[None, None])[0] for v in (left, right))
    return winner(lambda d: torch.einsum("cyx,cyx->yx", a[:, :, d:], b[:, :, :b.shape[2] - d]).numpy(), count)


def state_dict_network(path: str):
    """A sequential network of 3x3 convolutions from a state dict, whatever its keys are called."""
    state = torch.load(path, map_location="cpu")
    state = state.get("model", state.get("net", state))
    tensors = list(state.values())
    net = build(len(tensors) // 2, tensors[0].shape[0])
    net.load_state_dict(dict(zip(net.state_dict(), tensors)))
    return lambda x: F.normalize(net(x), dim=1)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", help="folder with cones, teddy and motorcycle")
    parser.add_argument("--scenes", help="folder of light fields written by make_scenes.sh")
    parser.add_argument("networks", nargs="+", help=".onnx of ours or .pt of any 3x3 convolution stack")
    args = parser.parse_args()
    torch.set_num_threads(1)
    methods = {"census 9x7": census}
    for path in args.networks:
        net = (lambda x, p=path: onnx_file.run(p, x)) if path.endswith(".onnx") else state_dict_network(path)
        methods[os.path.basename(path)] = lambda left, right, count, n=net: features(n, left, right, count)
    pairs = list(middlebury(args.data)) if args.data else []
    pairs += list(held_out_scenes(args.scenes)) if args.scenes else []
    print("| bad 1, 2, 4 in % | " + " | ".join(methods) + " |")
    print("|---" * (len(methods) + 1) + "|")
    for name, pair in pairs:
        count = int(np.ceil(pair.disp[pair.valid].max())) + 2
        bad = []
        for method in methods.values():
            error = np.abs(method(pair.left, pair.right, count) - pair.disp)[pair.valid]
            bad.append([100 * float((error > t).mean()) for t in (1, 2, 4)])
        print(f"| {name} | " + " | ".join(" ".join(f"{b:.2f}" for b in row) for row in bad) + " |", flush=True)


if __name__ == "__main__":
    main()
