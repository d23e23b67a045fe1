# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
"""Stereo pairs with exact disparity: textured, slanted planes in layers, drawn with no outside data."""
from dataclasses import dataclass

import numpy as np
import torch
import torch.nn.functional as F
from PIL import Image, ImageDraw, ImageFilter

SUPER = 2  # both views are drawn at twice the size and averaged, so that neither is blurred more than the other


@dataclass
class Pair:
    """left(x) matches right(x - disp) where valid; left and right are luma [H,W] uint8."""
    left: np.ndarray
    right: np.ndarray
    disp: np.ndarray
    valid: np.ndarray


def spectral_noise(rng: np.random.Generator, height: int, width: int, least: float = 0.3) -> np.ndarray:
    """Noise with amplitude 1 / frequency^k, k drawn from rough (least) to smooth (2); in 0..1."""
    fy, fx = np.fft.fftfreq(height)[:, None], np.fft.rfftfreq(width)[None, :]
    stretch = 2.0 ** rng.uniform(-1.5, 1.5)
    radius = np.hypot(fy * stretch, fx / stretch) + 1.0 / width
    spectrum = np.fft.rfft2(rng.standard_normal((height, width))) / radius ** rng.uniform(least, 2.0)
    noise = np.fft.irfft2(spectrum, s=(height, width))
    return np.clip(0.5 + 0.2 * (noise - noise.mean()) / noise.std(), 0, 1)


def shapes(rng: np.random.Generator, height: int, width: int) -> np.ndarray:
    """Polygons, discs and lines of random grey: hard edges and flat areas."""
    img = Image.new("L", (width, height), int(rng.integers(30, 226)))
    draw = ImageDraw.Draw(img)
    for _ in range(int(rng.integers(10, 120))):
        x, y = rng.uniform(0, width), rng.uniform(0, height)
        size, grey = 2.0 ** rng.uniform(1.5, 6.5), int(rng.integers(0, 256))
        kind = rng.integers(3)
        if kind == 0:
            angle = np.sort(rng.uniform(0, 2 * np.pi, int(rng.integers(3, 7))))
            draw.polygon([(x + size * np.cos(a), y + size * np.sin(a)) for a in angle], fill=grey)
        elif kind == 1:
            draw.ellipse([x - size, y - size * 0.7, x + size, y + size * 0.7], fill=grey)
        else:
            draw.line([x, y, x + rng.normal(0, 2 * size), y + rng.normal(0, 2 * size)], fill=grey,
                      width=int(rng.integers(1, 7)))
    return np.asarray(img, np.float64) / 255


def grating(rng: np.random.Generator, height: int, width: int) -> np.ndarray:
    """Slightly bent stripes or tiles, to include repetition in training."""
    y, x = np.mgrid[:height, :width]
    bend = 12 * spectral_noise(rng, height, width)
    period, angle = rng.uniform(8, 60), rng.uniform(0, np.pi)
    wave = np.sin(2 * np.pi * (x * np.cos(angle) + y * np.sin(angle) + bend) / period)
    if rng.random() < 0.5:
        across = y * np.cos(angle) - x * np.sin(angle) + bend
        wave = wave * np.sin(2 * np.pi * across / (period * rng.uniform(0.5, 2)))
    return 0.5 + 0.5 * np.clip(wave * rng.uniform(1, 6), -1, 1)


def texture(rng: np.random.Generator, height: int, width: int) -> np.ndarray:
    """One surface: a mix of two of the textures above with its own contrast, brightness and shading."""
    kinds = [spectral_noise, spectral_noise, shapes, grating]
    first, second = (kinds[rng.integers(len(kinds))](rng, height, width) for _ in range(2))
    share = rng.uniform(0, 0.6) if rng.random() < 0.7 else spectral_noise(rng, height, width) > 0.55
    mix = first + (second - first) * share
    contrast = 2.0 ** rng.uniform(-3.5, 0)
    shade = np.linspace(-1, 1, width)[None, :] * rng.normal(0, 0.08)
    shade = shade + np.linspace(-1, 1, height)[:, None] * rng.normal(0, 0.08)
    return np.clip(rng.uniform(0.15, 0.85) + contrast * (mix - 0.5) + shade, 0, 1)


def outline(rng: np.random.Generator, height: int, width: int) -> np.ndarray:
    """Mask of one object: a polygon, a bar, or foliage-like blobs."""
    kind = rng.integers(4)
    if kind == 3:
        return spectral_noise(rng, height, width, 1.5) > rng.uniform(0.5, 0.7)
    img = Image.new("L", (width, height), 0)
    x, y, size = rng.uniform(0, width), rng.uniform(0, height), rng.uniform(0.08, 0.35) * width
    if kind == 2:
        ImageDraw.Draw(img).line([x, -9, x + rng.normal(0, width / 4), height + 9], fill=255,
                                 width=int(rng.integers(6, 50)))
    else:
        angle = np.sort(rng.uniform(0, 2 * np.pi, int(rng.integers(3, 12))))
        radius = size * rng.uniform(0.5, 1.2, angle.size)
        ImageDraw.Draw(img).polygon(list(zip(x + radius * np.cos(angle), y + radius * np.sin(angle))), fill=255)
    return np.asarray(img.filter(ImageFilter.GaussianBlur(1)) if kind == 1 else img) > 127


def sample(plane: np.ndarray, x: np.ndarray) -> np.ndarray:
    """plane at (x, row), bilinear in x, mirrored at the sides."""
    height, width = plane.shape
    grid = np.empty((1, height, x.shape[1], 2), np.float32)
    grid[..., 0] = (2 * x + 1) / width - 1
    grid[..., 1] = ((2 * np.arange(height) + 1) / height - 1)[:, None]
    src = torch.from_numpy(plane.astype(np.float32))[None, None]
    return F.grid_sample(src, torch.from_numpy(grid), padding_mode="reflection", align_corners=False)[0, 0].numpy()


def make_pair(seed: int, height: int = 224, width: int = 288) -> Pair:
    """
    Layers from back to front. The plane d = a + b x + c y of a layer (left coordinates) is inverted exactly:
    x = (x' + a + c y) / (1 - b) for right coordinates x'.
    """
    rng = np.random.default_rng(seed)
    h, w = height * SUPER, width * SUPER
    y, x = np.mgrid[:h, :w].astype(np.float64)
    near = rng.uniform(6, 60)
    depths = np.sort(rng.uniform(0, near, int(rng.integers(3, 10))))
    img = [np.zeros((h, w)), np.zeros((h, w))]
    owner = [np.full((h, w), -1), np.full((h, w), -1)]
    disp = np.zeros((h, w))
    for i, depth in enumerate(depths):
        b, c = (rng.normal(0, 0.06), rng.normal(0, 0.04)) if rng.random() < 0.7 else (0.0, 0.0)
        b = float(np.clip(b, -0.25, 0.25))
        a = SUPER * depth - b * w / 2 - c * h / 2
        surface = texture(rng, h, w)
        mask = np.ones((h, w), bool) if i == 0 else outline(rng, h, w)
        offset = rng.uniform(0, 1)  # sub-texel, so that the left view is interpolated as well
        for side, at in enumerate((x, (x + a + c * y) / (1 - b))):
            inside = sample(mask, at) > 0.5
            img[side][inside] = sample(surface, at + offset)[inside]
            owner[side][inside] = i
        plane = a + b * x + c * y
        seen = owner[0] == i
        disp[seen] = plane[seen] / SUPER
    match = np.rint(x - disp * SUPER).astype(int)
    inside = (match >= 0) & (match < w)
    valid = inside & (np.take_along_axis(owner[1], np.clip(match, 0, w - 1), 1) == owner[0])
    shrink = [v.reshape(height, SUPER, width, SUPER).mean((1, 3)) for v in img]
    # a pixel counts when all its samples are of one surface
    block = owner[0].reshape(height, SUPER, width, SUPER)
    one = (block.max((1, 3)) == block.min((1, 3))) & valid.reshape(height, SUPER, width, SUPER).all((1, 3))
    left, right = (np.rint(255 * v).astype(np.uint8) for v in shrink)
    return Pair(left, right, disp.reshape(height, SUPER, width, SUPER).mean((1, 3)).astype(np.float32), one)
