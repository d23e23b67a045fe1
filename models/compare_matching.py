#!/usr/bin/python3
"""
Share of wrong pixels of the raw winner (no aggregation, no optimisation) of matching costs on Middlebury pairs that
were not trained on: census 9x7, our network, and any other network given as a torch state dict.

  /usr/bin/python3 models/compare_matching.py --data DIR models/mccnn-fast.onnx [other.pt]
"""
import argparse
import os
import time

import numpy as np
import torch
import torch.nn.functional as F

import common
import onnx_file
from train_mccnn import build, forward_warp, right_disparity_check


def middlebury(folder: str):
    """(name, left, right, disparity, candidates, not-occluded mask) of each pair, sizes as given."""
    for name in ("cones", "teddy"):
        at = os.path.join(folder, name)
        left, right = common.read_rgb(os.path.join(at, "im2.png")), common.read_rgb(os.path.join(at, "im6.png"))
        disp = [np.asarray(common.Image.open(os.path.join(at, f))).astype(np.float32) / 4 for f in ("disp2.png", "disp6.png")]
        disp = [np.where(d > 0, d, np.inf).astype(np.float32) for d in disp]
        yield name, left, right, disp[0], 64, right_disparity_check(disp[0], disp[1])
    at = os.path.join(folder, "motorcycle")
    disp = np.load(os.path.join(at, "motorcycle_disp.npz"))["arr_0"].astype(np.float32)
    left, right = (common.read_rgb(os.path.join(at, f"motorcycle_{s}.png")) for s in ("left", "right"))
    yield "motorcycle", left, right, disp, 72, right_disparity_check(disp, forward_warp(disp))


def winner(score, width: int, count: int) -> np.ndarray:
    """argmax over d of score(d), which gives [H, W - d] for the left columns d.. on."""
    volume = np.stack([np.pad(score(d), ((0, 0), (d, 0)), constant_values=-np.inf) for d in range(count)])
    return volume.argmax(0)


def census(left: np.ndarray, right: np.ndarray, count: int) -> np.ndarray:
    def bits(img: np.ndarray) -> np.ndarray:
        pad, (h, w) = np.pad(img, ((3, 3), (4, 4)), mode="edge"), img.shape
        return np.stack([pad[y:y + h, x:x + w] < img for y in range(7) for x in range(9) if (y, x) != (3, 4)])
    a, b = bits(common.luma(left)), bits(common.luma(right))
    return winner(lambda d: (a[:, :, d:] == b[:, :, :b.shape[2] - d]).sum(0).astype(np.float32), a.shape[2], count)


def features(network, left: np.ndarray, right: np.ndarray, count: int) -> np.ndarray:
    with torch.no_grad():
        a, b = (network(torch.from_numpy(common.standardise(common.luma(v)))[None, None])[0] for v in (left, right))
    return winner(lambda d: (a[:, :, d:] * b[:, :, :b.shape[2] - d]).sum(0).numpy(), a.shape[2], count)


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
    parser.add_argument("--data", required=True, help="folder with cones, teddy and motorcycle")
    parser.add_argument("networks", nargs="+", help=".onnx of ours or .pt of any 3x3 convolution stack")
    args = parser.parse_args()
    torch.set_num_threads(1)
    methods = {"census 9x7": census}
    for path in args.networks:
        net = (lambda x, p=path: onnx_file.run(p, x)) if path.endswith(".onnx") else state_dict_network(path)
        methods[os.path.basename(path)] = lambda left, right, count, n=net: features(n, left, right, count)
    print("| cost | pair | bad 1 | bad 2 | bad 4 | s |\n|---|---|---|---|---|---|")
    for pair, left, right, disp, count, seen in middlebury(args.data):
        for name, method in methods.items():
            started = time.time()
            error = np.abs(method(left, right, count) - disp)[seen]
            bad = " | ".join(f"{100 * (error > t).mean():.2f}" for t in (1, 2, 4))
            print(f"| {name} | {pair} | {bad} | {time.time() - started:.1f} |", flush=True)


if __name__ == "__main__":
    main()
