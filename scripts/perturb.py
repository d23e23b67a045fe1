# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
"""Copies of a light field with one thing wrong: what `make bench-perturb` measures against the unperturbed one.

Each perturbation takes the views as {(row, col): float array [height][width][3], 0..255} and a seeded generator.
"""
import hashlib
import io
import json
import os
import shutil

import numpy as np
from PIL import Image


def read_picture(path):
    with Image.open(path) as picture:
        return np.asarray(picture.convert("RGB"), dtype=np.float32)


def read_views(lf):
    """lightfield.json and the views of a folder whose files are the views."""
    with open(os.path.join(lf, "lightfield.json")) as f:
        info = json.load(f)
    views = {}
    for v in info["views"]:
        views[v["row"], v["col"]] = read_picture(os.path.join(lf, "views", v["file"]))
    return info, views


def write_views(lf, out, info, views, jpeg=None):
    """A light field of these views in place of lf's; truth/ is linked. jpeg: quality, else PNG."""
    shutil.rmtree(out, ignore_errors=True)
    os.makedirs(os.path.join(out, "views"))
    info = json.loads(json.dumps(info))
    info["views"] = [v for v in info["views"] if (v["row"], v["col"]) in views]
    info.update(disparity_given=False, labels_given=False)
    info.pop("disparity_tested", None)
    info.pop("correction", None)
    info.pop("judgement", None)
    for v in info["views"]:
        pixels = np.clip(np.floor(views[v["row"], v["col"]] + 0.5), 0, 255).astype(np.uint8)
        data = io.BytesIO()
        Image.fromarray(pixels).save(data, **({"format": "JPEG", "quality": jpeg} if jpeg else
                                              {"format": "PNG", "compress_level": 1}))
        v["file"] = f"{v['row']:02d}_{v['col']:02d}.{'jpg' if jpeg else 'png'}"
        v["sha256"] = hashlib.sha256(data.getvalue()).hexdigest()
        with open(os.path.join(out, "views", v["file"]), "wb") as f:
            f.write(data.getvalue())
    with open(os.path.join(out, "lightfield.json"), "w") as f:
        json.dump(info, f, indent=1)
    truth = os.path.join(os.path.abspath(lf), "truth")
    if os.path.isdir(truth):
        os.symlink(truth, os.path.join(out, "truth"))
    return out


# --- fine pictures: what moves a picture does so before its pixels are formed ------------------------------------------

FINE = 3  # odd: the middle of a pixel stays the middle of one


def coarse(image):
    """Means of FINE x FINE pixels: what a sensor makes of the light."""
    h, w = image.shape[0] // FINE, image.shape[1] // FINE
    return image[:h * FINE, :w * FINE].reshape(h, FINE, w, FINE, -1).mean(axis=(1, 3))


def make_coarse(lf, fine):
    """Replace the pictures of lf, truth's colours too, by the means of those of the same scene FINE times as large."""
    info, views = read_views(fine)
    own, _ = read_views(lf)
    truth = os.path.join(lf, "truth")
    for name in os.listdir(truth):
        if name.startswith("behind") and name.endswith(".png"):
            with Image.open(os.path.join(fine, "truth", name)) as picture:
                pixels = coarse(np.asarray(picture.convert("RGB"), dtype=np.float32))
            Image.fromarray(np.floor(pixels + 0.5).astype(np.uint8)).save(os.path.join(truth, name))
    out = write_views(lf, lf + ".new", own, {k: coarse(v) for k, v in views.items()})
    os.remove(os.path.join(out, "truth"))
    os.rename(truth, os.path.join(out, "truth"))
    shutil.rmtree(lf)
    os.rename(out, lf)


def make_small(lf, fine, source, most):
    """lf and fine, FINE times as large, of a photographed light field: at most `most` pixels wide."""
    info, views = read_views(source)
    width = min(most, info["width"] // FINE)
    height = width * info["height"] // info["width"]
    share = width / info["width"]
    info.update(range_min_px=info["range_min_px"] * share, range_max_px=info["range_max_px"] * share)
    size = (FINE * width, FINE * height)
    views = {k: np.asarray(Image.fromarray(v.astype(np.uint8)).resize(size, Image.BOX), dtype=np.float32)
             for k, v in views.items()}
    write_views(source, fine, {**info, "width": size[0], "height": size[1]}, views)
    write_views(source, lf, {**info, "width": width, "height": height}, {k: coarse(v) for k, v in views.items()})


# --- resampling ------------------------------------------------------------------------------------------------------

def cubic(t):
    t = np.abs(t)
    return np.where(t < 1, (1.5 * t - 2.5) * t * t + 1, np.where(t < 2, ((-0.5 * t + 2.5) * t - 4) * t + 2, 0))


def sample(image, x, y):
    """Bicubic, borders repeated."""
    h, w = image.shape[:2]
    x0, y0 = np.floor(x).astype(int), np.floor(y).astype(int)
    out = np.zeros(x.shape + (3,))
    for j in range(-1, 3):
        for i in range(-1, 3):
            weight = cubic(x - x0 - i) * cubic(y - y0 - j)
            out += weight[..., None] * image[np.clip(y0 + j, 0, h - 1), np.clip(x0 + i, 0, w - 1)]
    return out


def grid_of(image):
    h, w = image.shape[:2]
    y, x = np.mgrid[0:h, 0:w].astype(float)
    return x, y, (w - 1) / 2, (h - 1) / 2


def shift(image, right, down):
    for axis, by in ((1, right), (0, down)):
        at = np.arange(image.shape[axis]) - by
        first = np.floor(at).astype(int)
        shape = [-1 if a == axis else 1 for a in range(3)]
        image = sum(cubic(at - first - i).astype(np.float32).reshape(shape) * np.take(image, np.clip(first + i, 0, image.shape[axis] - 1), axis)
                    for i in range(-1, 3)) if by else image
    return image


def roll(image, deg):
    x, y, cx, cy = grid_of(image)
    c, s = np.cos(np.radians(deg)), np.sin(np.radians(deg))
    return sample(image, cx + c * (x - cx) + s * (y - cy), cy - s * (x - cx) + c * (y - cy))


def distort(image, k1):
    """A lens that is wrong by k1 at the corner: displaced by k1 of its distance from the centre."""
    x, y, cx, cy = grid_of(image)
    r2 = ((x - cx) ** 2 + (y - cy) ** 2) / (cx * cx + cy * cy)
    return sample(image, cx + (x - cx) * (1 + k1 * r2), cy + (y - cy) * (1 + k1 * r2))


def blur(image, sigma):
    n = int(np.ceil(3 * sigma))
    kernel = np.exp(-0.5 * (np.arange(-n, n + 1) / sigma) ** 2)
    kernel /= kernel.sum()
    for axis in (0, 1):
        padded = np.pad(image, [(n, n) if a == axis else (0, 0) for a in range(3)], "edge")
        image = sum(k * np.take(padded, range(i, i + image.shape[axis]), axis) for i, k in enumerate(kernel))
    return image


# --- perturbations: strength s -----------------------------------------------------------------------------------------

def each(change):
    return lambda views, s, rng: {k: change(v, s, rng) for k, v in views.items()}


REFERENCE = (2, 2)


def displaced(change):
    """change of fine pictures, lazily read, by an amount of -s to s; pixels are formed afterwards. The reference view stays: the
    pictures are displaced against it, and the truth is as it sees it."""
    def apply(views, s, rng):
        by = {k: rng.uniform(-s, s) for k in views}
        return {k: coarse(v if k == REFERENCE else change(v, by[k])) for k, v in views.items()}
    apply.fine = True
    return apply


def as_jpeg(image, quality):
    """The picture after a JPEG file of that quality."""
    data = io.BytesIO()
    Image.fromarray(np.clip(np.floor(image + 0.5), 0, 255).astype(np.uint8)).save(data, format="JPEG", quality=int(quality))
    with Image.open(data) as picture:
        return np.asarray(picture.convert("RGB"), dtype=np.float32)


def spread(s, n, rng):
    """n factors within 1 - s .. 1 + s whose geometric mean is 1: what all cameras share is no spread."""
    g = np.log(rng.uniform(1 - s, 1 + s, n))
    return np.exp(g - g.mean())


def gains(views, s, rng):
    return {k: v * g for (k, v), g in zip(views.items(), spread(s, len(views), rng))}


def gamma(views, s, rng):
    return {k: 255 * (np.clip(v, 0, 255) / 255) ** g for (k, v), g in zip(views.items(), spread(s, len(views), rng))}


def vignette(views, s, rng):
    out = {}
    for (k, v), f in zip(views.items(), rng.uniform(0, 2 * s, len(views))):
        x, y, cx, cy = grid_of(v)
        out[k] = v * (1 - f * ((x - cx) ** 2 + (y - cy) ** 2) / (cx * cx + cy * cy))[..., None]
    return out


def missing(views, s, rng):
    keys = [k for k in views if k != REFERENCE]
    gone = rng.permutation(len(keys))[:int(s)]
    return {k: v for k, v in views.items() if k == REFERENCE or keys.index(k) not in gone}


def jitter_and_gain(views, s, rng):
    """0.5 px of jitter and 10 % of gain for s = 1, 2 px and 30 % for s = 2."""
    px, share = {1: (0.5, 0.1), 2: (2, 0.3)}[s]
    return gains(vertical(views, px, rng), share, rng)


def moments(change):
    """change of pictures of the scene at TIMES moments from 0 to s seconds: [{(row, col): picture}]."""
    change.moments = True
    return change


TIMES = 5
LATE_S = 0.1


@moments
def time_offsets(sets, s, rng):
    """Each camera at a moment of its own; the reference camera at the first."""
    return {k: sets[0 if k == REFERENCE else rng.integers(TIMES)][k] for k in sets[0]}


@moments
def rolling(sets, s, rng):
    """Rows later from top to bottom, in bands."""
    out = {}
    for k in sets[0]:
        h = sets[0][k].shape[0]
        edges = [h * i // TIMES for i in range(TIMES + 1)]
        out[k] = np.concatenate([sets[i][k][edges[i]:edges[i + 1]] for i in range(TIMES)])
    return out


def noisy_labels(labels, share, rng):
    """Cells of 8x8 pixels with a label of another place."""
    h, w = labels.shape
    out = labels.copy()
    for y in range(0, h, 8):
        for x in range(0, w, 8):
            if rng.random() < share:
                out[y:y + 8, x:x + 8] = labels[rng.integers(h), rng.integers(w)]
    return out


jitter_and_gain.fine = True
vertical = displaced(lambda v, by: shift(v, 0, FINE * by))

# name: title, unit, strengths, function
SWEEPS = {
    "both": ("Vertical misalignment and gain", "1: 0.5 px, 10 %; 2: 2 px, 30 %", (1, 2), jitter_and_gain),
    "vertical": ("Vertical misalignment", "px, one side", (0.1, 0.25, 0.5, 1, 2, 4), vertical),
    "gain": ("Gain between cameras", "spread, one side", (0.05, 0.1, 0.2, 0.3, 0.4), gains),
    "roll": ("Rotation", "degrees, one side", (0.1, 0.25, 0.5, 1), displaced(roll)),
    "noise": ("Sensor noise", "levels RMS", (2, 5, 10, 20), each(lambda v, s, rng: v + rng.normal(0, s, v.shape))),
    "jpeg": ("JPEG", "quality", (98, 90, 75, 50, 30), None),
    "png": ("PNG of a JPEG", "quality", (90, 75, 50, 30), each(lambda v, s, rng: as_jpeg(v, s))),
    "gamma": ("Gamma between cameras", "spread, one side", (0.05, 0.1, 0.2, 0.3), gamma),
    "vignetting": ("Vignetting", "mean loss in the corners", (0.1, 0.2, 0.3), vignette),
    "lens": ("Wrong lens", "of the distance at the corner, one side", (0.002, 0.005, 0.01),
             displaced(distort)),
    "blur": ("Blur", "px, sigma", (0.5, 1, 2), each(lambda v, s, rng: blur(v, s))),
    "missing": ("Missing views", "views", (4, 9, 18), missing),
    "time": ("Time offsets between cameras", "s, one side", (0.01, 0.033, 0.1), time_offsets),
    "rolling": ("Rolling shutter", "s from first to last row", (0.01, 0.033, 0.1), rolling),
}


# --- faults: one thing that is plainly wrong -----------------------------------------------------------------------------

def one_view(change, at=(3, 1)):
    def apply(views, rng):
        views = dict(views)
        views[at] = change(views, at, rng)
        return views
    return apply


def neighbour(views, at):
    return views[at[0], at[1] + 1] if (at[0], at[1] + 1) in views else views[at[0], at[1] - 1]


def swap(views, rng):
    views = dict(views)
    views[1, 1], views[3, 2] = views[3, 2], views[1, 1]
    return views


@moments
def late(sets, rng):
    """One camera LATE_S after the others."""
    return sets[0] | {(3, 1): sets[-1][3, 1]}


def noise_view(v, rng):
    return rng.uniform(0, 255, v.shape)


def unrelated(views, rng):
    """Every view another texture: smoothed noise with the contrast of pictures."""
    return {k: 128 + 60 * (lambda n: (n - n.mean()) / n.std())(blur(rng.normal(0, 1, v.shape), 2) + 0.3 * rng.normal(0, 1, v.shape))
            for k, v in views.items()}


def stripes(v, rng):
    """Part of the frame lost: the lower half repeats one row."""
    v = v.copy()
    v[v.shape[0] // 2:] = v[v.shape[0] // 2]
    return v


FAULTS = {
    "a view doubled": one_view(lambda views, at, rng: neighbour(views, at)),
    "a view doubled, with noise": one_view(lambda views, at, rng: neighbour(views, at) + rng.normal(0, 3, views[at].shape)),
    "a view black": one_view(lambda views, at, rng: np.zeros_like(views[at])),
    "a view black, with noise": one_view(lambda views, at, rng: np.abs(rng.normal(0, 3, views[at].shape))),
    "a view white": one_view(lambda views, at, rng: np.full_like(views[at], 255)),
    "a view of noise": one_view(lambda views, at, rng: noise_view(views[at], rng)),
    "half a view lost": one_view(lambda views, at, rng: stripes(views[at], rng)),
    "a view rolled by 90 columns": one_view(lambda views, at, rng: np.roll(views[at], views[at].shape[1] // 5, axis=1)),
    "a view turned by 180 degrees": one_view(lambda views, at, rng: views[at][::-1, ::-1]),
    "a view mirrored": one_view(lambda views, at, rng: views[at][:, ::-1]),
    "a view 30 px too low": one_view(lambda views, at, rng: shift(views[at], 0, 30)),
    "a view blurred by 1 px": one_view(lambda views, at, rng: blur(views[at], 1)),
    "a view blurred by 2 px": one_view(lambda views, at, rng: blur(views[at], 2)),
    "a view of JPEG quality 30": one_view(lambda views, at, rng: as_jpeg(views[at], 30)),
    "a view 0.1 s late": late,
    "two views swapped": swap,
    "columns mirrored": lambda views, rng: {(r, 5 - c): v for (r, c), v in views.items()},
    "rows mirrored": lambda views, rng: {(5 - r, c): v for (r, c), v in views.items()},
    "all views noise": lambda views, rng: {k: noise_view(v, rng) for k, v in views.items()},
    "all views unrelated": unrelated,
    "all views one picture": lambda views, rng: {k: views[2, 2] for k in views},
    "views in random order": lambda views, rng: dict(zip(views, [list(views.values())[i] for i in rng.permutation(len(views))])),
}
