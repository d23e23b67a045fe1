# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
"""Rectified pairs with known disparity, degraded as by the cameras of a real array."""
import os
from dataclasses import dataclass

import numpy as np
from PIL import Image

import common
from synthetic_pairs import Pair

MIDDLEBURY = ("cones", "teddy", "aloe", "motorcycle")
SCALES = (1.0, 0.62, 0.4)
REACH = 4   # of the blur, px
ALIKE = 0.5  # share of the crops whose cameras hardly differ: else plain pairs pay for the hard ones
BORDER = 6  # points this close to the edge of a crop are not used: the network sees beyond it


# --- pairs -----------------------------------------------------------------------------------------------------------

def seen_in_both(disp: np.ndarray, disp_right: np.ndarray) -> np.ndarray:
    """True where the left pixel is visible in the right view: the maps agree within a pixel."""
    height, width = disp.shape
    x = np.rint(np.arange(width)[None] - np.where(np.isfinite(disp), disp, 1e6)).astype(np.int64)
    back = np.take_along_axis(disp_right, np.clip(x, 0, width - 1), 1)
    with np.errstate(invalid="ignore"):
        return (x >= 0) & (x < width) & (np.abs(back - disp) < 1)


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


def known(disp: np.ndarray) -> np.ndarray:
    """0 means unknown in the truth of the older pairs."""
    return np.where(disp > 0, disp, np.inf).astype(np.float32)


def middlebury(folder: str, name: str) -> tuple[Image.Image, Image.Image, np.ndarray, np.ndarray]:
    """Left and right picture, disparity of the left one (px, inf unknown), and the mask of pixels visible in both."""
    def picture(file: str) -> Image.Image:
        return Image.open(os.path.join(folder, name, file))
    if name in ("cones", "teddy"):
        left, right = picture("im2.png"), picture("im6.png")
        disp, other = (known(np.asarray(picture(f"disp{i}.png").convert("L")).astype(np.float32) / 4) for i in (2, 6))
    elif name == "aloe":
        left, right = picture("aloeL.jpg"), picture("aloeR.jpg")
        disp = known(np.asarray(picture("aloeGT.png").convert("L")).astype(np.float32))
        other = forward_warp(disp)
    else:
        left, right = picture(f"{name}_left.png"), picture(f"{name}_right.png")
        disp = np.load(os.path.join(folder, name, f"{name}_disp.npz"))["arr_0"].astype(np.float32)
        disp = np.where(np.isfinite(disp), disp, np.inf).astype(np.float32)
        other = forward_warp(disp)
    return left.convert("RGB"), right.convert("RGB"), disp, seen_in_both(disp, other)


def middlebury_pairs(folder: str, left_out: str | None) -> list[Pair]:
    """Every pair except the one left out, at three sizes each."""
    pairs = []
    for name in MIDDLEBURY:
        if name == left_out:
            continue
        left, right, disp, valid = middlebury(folder, name)
        for scale in SCALES:
            width, height = int(left.width * scale), int(left.height * scale)
            rows = ((np.arange(height) + 0.5) / scale).astype(int).clip(0, left.height - 1)
            cols = ((np.arange(width) + 0.5) / scale).astype(int).clip(0, left.width - 1)
            small = (v.resize((width, height), Image.Resampling.LANCZOS) for v in (left, right))
            pick = np.ix_(rows, cols)
            pairs.append(Pair(*(common.luma(np.asarray(v)) for v in small),
                              disp[pick] * np.float32(width / left.width), valid[pick]))
    return pairs


def scene_pairs(folder: str, seeds: range) -> list[Pair]:
    """
    The first view of each simulated light field with its right and its lower neighbour; the latter pair is rotated so
    that it matches along rows.
    """
    pairs = []
    for lightfield in common.lightfields(folder, seeds):
        views = {k: v for k, v in common.lightfield_views(lightfield).items() if k in ((0, 0), (0, 1), (1, 0))}
        load = {k: common.luma(common.read_rgb(v)) for k, v in views.items()}
        disp = {k: common.read_pfm(os.path.join(lightfield, "truth", f"{k[0]:02d}_{k[1]:02d}.pfm")) for k in views}
        for other, turn in (((0, 1), False), ((1, 0), True)):
            maps = [load[0, 0], load[other], disp[0, 0], disp[other]]
            left, right, d_left, d_right = (np.ascontiguousarray(m.T) if turn else m for m in maps)
            pairs.append(Pair(left, right, d_left, seen_in_both(d_left, d_right)))
    return pairs


# --- cameras ---------------------------------------------------------------------------------------------------------

@dataclass
class Camera:
    """Radiometry of one view: grey' = 255 (grey / 255)^gamma * gain * fall-off + offset, then blur, noise, 8 bits."""
    gain: float = 1.0
    gamma: float = 1.0
    offset: float = 0.0
    fall: tuple[float, float, float] = (0.0, 0.0, 0.0)  # towards the corners, along x, along y; of the gain
    blur_px: float = 0.0  # deviation
    noise: float = 1.0    # deviation, of 255

    def tone(self, grey: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Before blur and noise; x and y in -1..1 of the view."""
        light = self.gain * (1 - self.fall[0] * (x * x + y * y) / 2 + self.fall[1] * x + self.fall[2] * y)
        return 255 * (np.maximum(grey, 0) / 255) ** self.gamma * light + self.offset


def draw_cameras(rng: np.random.Generator, alike: bool) -> tuple[Camera, Camera]:
    """Two cameras of the same scene; if alike, they differ by little more than noise."""
    spread = 0.05 if alike else 1.0
    gain, gamma = 2.0 ** rng.normal(0, 0.3), 2.0 ** rng.normal(0, 0.2)
    noise = abs(rng.normal(0, 1.5)) if alike or rng.random() < 0.55 else rng.uniform(2, 12)
    blur = max(0.0, rng.uniform(-0.8, 0.8))
    cameras = []
    for _ in range(2):
        cameras.append(Camera(
            gain=gain * 2.0 ** (spread * rng.normal(0, 0.25)), gamma=gamma * 2.0 ** (spread * rng.normal(0, 0.25)),
            offset=spread * rng.normal(0, 8), noise=noise * rng.uniform(0.8, 1.2), blur_px=blur,
            fall=(spread * max(0.0, rng.normal(0, 0.2)), spread * rng.normal(0, 0.05), spread * rng.normal(0, 0.05))))
    if not alike and rng.random() < 0.35:
        cameras[rng.integers(2)].blur_px += rng.uniform(0.2, 1.1)
    return cameras[0], cameras[1]


def bilinear(view: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """view at (x, y), edge repeated."""
    height, width = view.shape
    x, y = x.clip(0, width - 1.001), y.clip(0, height - 1.001)
    x0, y0 = x.astype(np.int64), y.astype(np.int64)
    fx, fy = x - x0, y - y0
    top = view[y0, x0] * (1 - fx) + view[y0, x0 + 1] * fx
    return top * (1 - fy) + (view[y0 + 1, x0] * (1 - fx) + view[y0 + 1, x0 + 1] * fx) * fy


def blurred(x: np.ndarray, deviation: float, reach: int) -> np.ndarray:
    """Gaussian blur; removes `reach` pixels on each side."""
    tap = np.exp(-0.5 * (np.arange(-reach, reach + 1) / max(deviation, 1e-3)) ** 2)
    tap /= tap.sum()
    for axis in (0, 1):
        n = x.shape[axis] - 2 * reach
        x = sum(t * x.take(range(i, i + n), axis) for i, t in enumerate(tap))
    return x


def look(rng: np.random.Generator, camera: Camera, view: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """The network's input for a view at (x, y), grids with a margin of REACH: standardised over the whole view."""
    height, width = view.shape
    grey = camera.tone(bilinear(view, x, y), 2 * x / width - 1, 2 * y / height - 1)
    grey = blurred(grey, camera.blur_px, REACH)
    grey = np.rint((grey + rng.normal(0, camera.noise, grey.shape)).clip(0, 255))
    some_y, some_x = np.mgrid[3:height:7, 3:width:7]
    whole = camera.tone(view[3::7, 3::7].astype(np.float64), 2 * some_x / width - 1, 2 * some_y / height - 1)
    whole = whole.clip(0, 255)
    deviation = np.sqrt(whole.var() + camera.noise ** 2)
    return ((grey - whole.mean()) / max(deviation, 1.0)).astype(np.float32)


def draw_crop(rng: np.random.Generator, pair: Pair, size: int):
    """
    A square crop of the left view and the crop of the right view that holds its matches: (left, right, match, valid),
    match the column in the right crop. The right camera may be slightly rotated, scaled and shifted up or down, like
    residual calibration errors: `match` follows, the row does not.
    """
    height, width = pair.disp.shape
    for _ in range(20):
        y0, x0 = int(rng.integers(0, height - size + 1)), int(rng.integers(0, width - size + 1))
        box = np.s_[y0:y0 + size, x0:x0 + size]
        if pair.valid[box].sum() < 0.1 * size * size:
            continue
        start = x0 - int(round(float(rng.choice(pair.disp[box][pair.valid[box]]))))
        start = int(np.clip(start, 0, width - size))
        match = np.arange(x0, x0 + size)[None] - np.where(pair.valid[box], pair.disp[box], 0) - start
        valid = pair.valid[box] & (match > BORDER) & (match < size - 1 - BORDER)
        valid[:BORDER], valid[-BORDER:], valid[:, :BORDER], valid[:, -BORDER:] = False, False, False, False
        if valid.sum() >= 200:
            break
    else:
        return None
    alike = rng.random() < ALIKE
    cameras = draw_cameras(rng, alike)
    y, x = np.mgrid[-REACH:size + REACH, -REACH:size + REACH].astype(np.float64)
    left = look(rng, cameras[0], pair.left, x + x0, y + y0)
    if not alike and rng.random() < 0.6:  # errors of calibration
        scale, turn, down = rng.normal(0, 0.003), rng.normal(0, 0.003), rng.uniform(-1, 1)
        middle = (size - 1) / 2
        x, y = x + scale * (x - middle) + turn * (y - middle), y + down + scale * (y - middle) - turn * (x - middle)
        match = match - scale * (match - middle) - turn * (np.arange(size)[:, None] - middle)
    right = look(rng, cameras[1], pair.right, x + start, y + y0)
    if rng.random() < 0.5:  # mirrored: the sign of the disparity turns, which the network must not care about
        left, right, valid, match = left[:, ::-1], right[:, ::-1], valid[:, ::-1], size - 1 - match[:, ::-1]
    if rng.random() < 0.5:  # upside down
        left, right, valid, match = left[::-1], right[::-1], valid[::-1], match[::-1]
    return left.copy(), right.copy(), match.astype(np.float32), valid.copy()
