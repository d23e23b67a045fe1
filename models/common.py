# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
"""Shared by both training scripts: images, disparity files, light fields, seeds and checkpoints."""
import os
import random
import re

import numpy as np
import torch
from PIL import Image


def seed_all(seed: int, threads: int) -> None:
    """Fix every source of randomness; one thread also fixes the order of the sums."""
    random.seed(seed)
    np.random.seed(seed)
    torch.manual_seed(seed)
    torch.set_num_threads(threads)


def read_rgb(path: str) -> np.ndarray:
    """[H,W,3] uint8."""
    return np.asarray(Image.open(path).convert("RGB"))


def luma(rgb: np.ndarray) -> np.ndarray:
    """[H,W] uint8, the same values as sst_luma() of pipeline/image/image.h."""
    return ((rgb.astype(np.int32) @ np.array([77, 150, 29]) + 128) >> 8).astype(np.uint8)


def standardise(x: np.ndarray) -> np.ndarray:
    """Zero mean and unit deviation over the whole image, float32; a flat image becomes all zero."""
    deviation = float(x.std())
    return ((x - x.mean()) / (deviation if deviation > 1e-6 else 1.0)).astype(np.float32)


def read_pfm(path: str) -> np.ndarray:
    """[H,W] float32, top row first; unknown values are infinite."""
    with open(path, "rb") as f:
        if f.readline().strip() != b"Pf":
            raise ValueError(f"{path}: not a one-channel PFM file")
        width, height = map(int, f.readline().split())
        order = "<" if float(f.readline()) < 0 else ">"
        data = np.frombuffer(f.read(4 * width * height), order + "f4")
    return data.reshape(height, width)[::-1].astype(np.float32)


TRAIN_SEEDS, HELD_SEEDS = range(100, 150), range(150, 200)  # of simulated scenes; below 100 is left to tests


def lightfields(folder: str, seeds: range) -> list[str]:
    """The light fields NAME-SEED in a folder with one of the given seeds."""
    found = []
    for name in sorted(os.listdir(folder)):
        match = re.fullmatch(r".*-(\d+)", name)
        if match and int(match[1]) in seeds:
            found.append(os.path.join(folder, name))
    return found


def lightfield_views(folder: str) -> dict[tuple[int, int], str]:
    """(row, col) -> picture of a simulated light field."""
    views = {}
    for name in sorted(os.listdir(os.path.join(folder, "views"))):
        match = re.fullmatch(r"(\d+)_(\d+)\.(png|jpg)", name)
        if match:
            views[int(match[1]), int(match[2])] = os.path.join(folder, "views", name)
    return views


def save_checkpoint(path: str, **state) -> None:
    """Write a checkpoint atomically."""
    torch.save(state, path + ".tmp")
    os.replace(path + ".tmp", path)


def load_checkpoint(path: str) -> dict | None:
    """Read the checkpoint of save_checkpoint(), or None."""
    return torch.load(path, map_location="cpu") if os.path.exists(path) else None
