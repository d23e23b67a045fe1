# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
"""Training pictures for labels: crops, and what makes them differ from the drives that they were taken on."""
import io

import numpy as np
from PIL import Image, ImageFilter

VOID = 255
RARE = (2, 6, 7, 9, 10)  # Pole SignSymbol Fence Pedestrian Bicyclist: copied from one picture into another
TREE = 5


def crop(rng: np.random.Generator, rgb: np.ndarray, labels: np.ndarray, size: tuple[int, int], frequent: np.ndarray,
         zooms: tuple[float, float], width: int) -> tuple[np.ndarray, np.ndarray]:
    """
    A crop at a random scale, 2^zooms of the working width; half are centred on a pixel of a class, rare classes
    preferred. What lies outside of the picture is grey and void.
    """
    height, wide = labels.shape
    zoom = 2.0 ** rng.uniform(*zooms) * width / wide
    box = np.array([size[0] / zoom * 2.0 ** rng.uniform(-0.1, 0.1), size[1] / zoom])
    centre = np.array([rng.uniform(0, wide), rng.uniform(0, height)])
    if rng.random() < 0.5:
        present = np.unique(labels[labels != VOID])
        if present.size:
            chance = 1 / np.sqrt(frequent[present])
            rows, cols = np.nonzero(labels == rng.choice(present, p=chance / chance.sum()))
            pick = rng.integers(rows.size)
            centre = np.array([cols[pick], rows[pick]]) + rng.normal(0, 1, 2) * box / 4
    room = np.array([wide, height]) - box
    corner = np.where(room > 0, np.clip(centre - box / 2, 0, np.maximum(room, 0)), room * rng.random(2))
    # The part of the box that lies inside of the picture, in the picture and in the crop.
    low, high = np.maximum(corner, 0), np.minimum(corner + box, [wide, height])
    to = np.rint((np.stack([low, high]) - corner) / box * size).astype(int)
    part = tuple(to[1] - to[0])
    picture, truth = np.full((size[1], size[0], 3), 128, np.uint8), np.full((size[1], size[0]), VOID, np.uint8)
    inside = np.s_[to[0, 1]:to[1, 1], to[0, 0]:to[1, 0]]
    where = (*low, *high)
    picture[inside] = np.asarray(Image.fromarray(rgb).resize(part, Image.Resampling.BILINEAR, where))
    truth[inside] = np.asarray(Image.fromarray(labels).resize(part, Image.Resampling.NEAREST, where))
    if rng.random() < 0.5:
        picture, truth = picture[:, ::-1], truth[:, ::-1]
    return picture, truth


def plain_colours(rng: np.random.Generator, picture: np.ndarray) -> np.ndarray:
    """The mild changes of blur, gamma, contrast, colour and noise of the first schedules; 0..1."""
    if rng.random() < 0.3:
        picture = np.asarray(Image.fromarray(picture).filter(ImageFilter.GaussianBlur(rng.uniform(0.3, 1.5))))
    x = (picture.astype(np.float32) / 255) ** (2.0 ** rng.uniform(-0.4, 0.4))
    x = (x - 0.5) * rng.uniform(0.7, 1.3) + 0.5 + rng.uniform(-0.12, 0.12)
    grey = x.mean(2, keepdims=True)
    x = grey + (x - grey) * rng.uniform(0.5, 1.5)
    return np.clip(x * (1 + rng.normal(0, 0.05, 3)) + rng.normal(0, abs(rng.normal(0, 0.02)), x.shape), 0, 1)


def paste(rng: np.random.Generator, picture, truth, other, other_truth, classes) -> tuple[np.ndarray, np.ndarray]:
    """Some of the given classes of another crop stand in front of this one, in the same place."""
    present = np.intersect1d(np.unique(other_truth), classes)
    if not present.size:
        return picture, truth
    mask = np.isin(other_truth, present[rng.random(present.size) < 0.7])
    return np.where(mask[..., None], other, picture), np.where(mask, other_truth, truth)


def leaf_stamps(rng: np.random.Generator, length: float, count: int) -> tuple[np.ndarray, np.ndarray]:
    """
    Leaves of about the given length (px), turned at random: [count, K, K] masks, and the shade of each of their pixels,
    about 1: halves that face the light differently, a midrib and side veins, each as strong as chance has it.
    """
    side = int(np.ceil(length * 1.3)) + 2
    grid = np.arange(side) - (side - 1) / 2
    turn = rng.uniform(0, 2 * np.pi, count)[:, None, None]
    half = length / 2 * rng.uniform(0.75, 1.3, count)[:, None, None]
    width, tip = half * rng.uniform(0.3, 0.75, count)[:, None, None], rng.uniform(0.8, 2)
    along = (grid[None, None] * np.cos(turn) + grid[None, :, None] * np.sin(turn)) / half
    across = (grid[None, :, None] * np.cos(turn) - grid[None, None] * np.sin(turn)) / width
    mask = np.abs(across) < np.maximum(1 - along ** 2, 0) ** (tip / 2)
    fold, rib, veins = rng.uniform(0, 0.3), rng.uniform(0, 0.4), rng.uniform(0, 0.15)
    shade = 1 + fold * np.sign(across) / 2 + veins * np.sin(9 * (along + np.abs(across)))
    return mask, np.where(np.abs(across) * width < 0.5, shade + rib, shade)


def leaves(rng: np.random.Generator, picture, truth) -> tuple[np.ndarray, np.ndarray]:
    """Leaves of one plant, drawn in front of a crop: of any size, density and colour that leaves have, in tufts or not."""
    height, width = truth.shape
    length = float(2.0 ** rng.uniform(2, 5.3))
    mask, shade = leaf_stamps(rng, length, 32)
    cover, side = rng.uniform(0.2, 0.95), mask.shape[1]
    wanted = -np.log(1 - cover) * height * width / mask.sum((1, 2)).mean()  # leaves hide each other
    count = int(min(wanted, 6000))
    y, x = rng.uniform(-side, height, count), rng.uniform(-side, width, count)
    if rng.random() < 0.7:  # tufts, and a hedge that ends somewhere
        field = smooth(rng, (height, width))
        if rng.random() < 0.5:
            field = field + 3 * (np.arange(height) / height - rng.uniform(0, 0.5))[:, None]
        tuft = np.array(Image.fromarray(rng.normal(0, 1.3, (7, 9)).astype(np.float32)).resize((width, height)))
        field = field + rng.uniform(0, 1.5) * tuft
        at = field[np.clip(y + side / 2, 0, height - 1).astype(int), np.clip(x + side / 2, 0, width - 1).astype(int)]
        kept = at > rng.uniform(-1, 0.3)
        y, x = y[kept], x[kept]
    count = y.size
    kind, depth = rng.integers(0, len(mask), count), np.linspace(0, 1, count)  # the nearest last
    base = np.array([rng.uniform(20, 150), rng.uniform(70, 170), rng.uniform(10, 80)])  # from dark green to yellow
    base = base * np.sqrt(np.clip(picture.mean() / 110, 0.2, 1.3))
    tone = rng.uniform(0.5, 1.2, count) * (1 - rng.uniform(0, 0.5) * (1 - depth))
    tint = rng.normal(0, rng.uniform(2, 18), (count, 3))
    leaf, row, col = np.nonzero(mask[kind])
    to_y, to_x = y[leaf].astype(int) + row, x[leaf].astype(int) + col
    inside = (to_y >= 0) & (to_y < height) & (to_x >= 0) & (to_x < width)
    leaf, row, col, to = leaf[inside], row[inside], col[inside], (to_y[inside], to_x[inside])
    colour = (base + tint[leaf]) * (tone[leaf] * shade[kind[leaf], row, col])[:, None]
    picture, truth = picture.copy(), truth.copy()
    picture[to] = np.clip(colour, 0, 255)  # of leaves at the same pixel the last one stays
    truth[to] = TREE
    return picture, truth


def style(rng: np.random.Generator, x: np.ndarray, other: np.ndarray) -> np.ndarray:
    """The low frequencies' amplitudes become those of another crop (Yang and Soatto, FDA, 2020), partly; 0..1."""
    spectrum = np.fft.rfft2(x, axes=(0, 1))
    theirs = np.abs(np.fft.rfft2(other.astype(np.float32) / 255, axes=(0, 1)))
    n, share = 1 + int(rng.integers(0, 3)), rng.uniform(0.3, 1)
    for rows in np.s_[:n], np.s_[x.shape[0] - n + 1:]:
        part = spectrum[rows, :n]
        amplitude = np.abs(part)
        part *= 1 + share * (theirs[rows, :n] - amplitude) / np.maximum(amplitude, 1e-6)
    return np.clip(np.fft.irfft2(spectrum, x.shape[:2], axes=(0, 1)), 0, 1)


def smooth(rng: np.random.Generator, shape) -> np.ndarray:
    """A smooth random field with deviation near 1."""
    field = Image.fromarray(rng.normal(0, 1.3, (3, 4)).astype(np.float32))
    return np.asarray(field.resize((shape[1], shape[0]), Image.Resampling.BICUBIC))


def light(rng: np.random.Generator, x: np.ndarray) -> np.ndarray:
    """Another camera at another time: exposure, white balance, curve, shade, haze, colourfulness; 0..1."""
    x = x * (2.0 ** rng.normal(0, 0.45) * 2.0 ** rng.normal(0, 0.12, 3)).astype(np.float32)
    if rng.random() < 0.4:
        x = x * np.exp(0.3 * smooth(rng, x.shape))[..., None]
    x = np.clip(x, 0, 1) ** np.float32(2.0 ** rng.normal(0, 0.4))
    x = (x - 0.5) * rng.uniform(0.6, 1.4) + 0.5 + rng.normal(0, 0.08)
    grey = x.mean(2, keepdims=True)
    x = grey + (x - grey) * (0 if rng.random() < 0.05 else rng.uniform(0.3, 1.7))
    if rng.random() < 0.1:
        haze = np.clip(rng.uniform(0.1, 0.5) + 0.1 * smooth(rng, x.shape), 0, 0.7)[..., None]
        x = x * (1 - haze) + rng.uniform(0.5, 0.9) * haze
    return np.clip(x, 0, 1)


def sensor(rng: np.random.Generator, x: np.ndarray) -> np.ndarray:
    """Blur of lens or motion, or sharpening; noise, equal or of the signal; JPEG; 0..1."""
    picture = Image.fromarray((x * 255).astype(np.uint8))
    kind = rng.random()
    if kind < 0.3:
        picture = picture.filter(ImageFilter.GaussianBlur(rng.uniform(0.3, 2)))
    elif kind < 0.45:
        picture = picture.filter(ImageFilter.UnsharpMask(rng.uniform(0.8, 2), int(rng.uniform(40, 180)), 0))
    if rng.random() < 0.25:
        packed = io.BytesIO()
        picture.save(packed, "JPEG", quality=int(rng.uniform(25, 90)))
        picture = Image.open(packed)
    x = np.asarray(picture, np.float32) / 255
    if rng.random() < 0.5:
        x = x + rng.normal(0, 1, x.shape).astype(np.float32) * (abs(rng.normal(0, 0.03)) * np.sqrt(x + 0.05))
    return np.clip(x, 0, 1)


def strong(rng: np.random.Generator, picture, truth, donor, kinds: frozenset) -> tuple[np.ndarray, np.ndarray]:
    """
    A crop as it could be on another drive; 0..1, and its truth. donor(source) draws a crop to copy from: of the same
    kind of data (0), or of simulated scenes (1; None where there are none).
    """
    if "paste" in kinds and rng.random() < 0.5:
        picture, truth = paste(rng, picture, truth, *donor(0), RARE)
    if "foliage" in kinds and rng.random() < 0.15:
        plants = donor(1)
        if plants:
            picture, truth = paste(rng, picture, truth, *plants, (TREE,))
    if "leaves" in kinds and rng.random() < 0.35:
        picture, truth = leaves(rng, picture, truth)
    x = picture.astype(np.float32) / 255
    if "style" in kinds and rng.random() < 0.4:
        x = style(rng, x, donor(int(rng.random() < 0.2) if donor(1) else 0)[0])
    if "light" in kinds:
        x = light(rng, x)
    return (sensor(rng, x) if "sensor" in kinds else x), truth
