# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
"""Pictures with true labels that scripts/bench_labels.py measures on, and what it measures on light fields."""
import glob
import json
import os
import shutil
import subprocess

import numpy as np
from PIL import Image, ImageFilter

NAMES = ("bush", "pedestrian", "transportation", "cell", "humvee", "cd-cases", "cat")
TRUTH_VOID = 11  # CamVid's
CROPS = {"whole, 480x360": (480, 360), "2:1, 480x240": (480, 240), "1:1, 360x360": (360, 360), "3:4, 270x360": (270, 360),
         "4:1, 480x120": (480, 120)}
SHIFT = 40  # px that the picture moves under the windows


def read_labels(path):
    return np.array(Image.open(path))


def classes_of(sst, model):
    return json.loads(subprocess.run([sst, "models", model, "--json"], check=True, text=True,
                                     stdout=subprocess.PIPE).stdout)["classes"]


def camvid(folder, part="val", drive=""):
    """[(picture, function that reads its true labels)] of a part, or of one drive of it; void becomes 0."""
    def reader(path):
        def read():
            labels = read_labels(path)
            return np.where(labels >= TRUTH_VOID, 0, labels + 1).astype(np.uint8)
        return read
    return [(p, reader(os.path.join(folder, part + "annot", os.path.basename(p)[:-4] + ".png")))
            for p in sorted(glob.glob(os.path.join(folder, part, f"{drive}*.jpg")))]


def scenes(sst, out, size, seeds):
    """The same of one view of each scene and seed; made where they are missing."""
    pairs = []
    os.makedirs(f"{out}/label-scenes-{size}", exist_ok=True)
    for seed in seeds:
        for name in NAMES:
            lf = f"{out}/label-scenes-{size}/{name}-{seed}"
            if not os.path.exists(lf):
                subprocess.run([sst, "scene", name, "-o", lf, "--size", size, "--grid", "1x1", "--seed", str(seed), "-q"],
                               check=True, stdout=subprocess.DEVNULL)
            pairs.append((f"{lf}/views/00_00.png", lambda path=f"{lf}/truth/00_00.png": read_labels(path)))
    return pairs


def cropped(pairs, folder, width, height, size=None):
    """The middle of the pictures, then resized where a size is given (the truth is not)."""
    os.makedirs(folder, exist_ok=True)
    made = []
    for i, (image, truth) in enumerate(pairs):
        picture = Image.open(image)
        x, y = (picture.width - width) // 2, (picture.height - height) // 2
        picture = picture.crop((x, y, x + width, y + height))
        path = f"{folder}/{i}.png"
        (picture.resize(size, Image.Resampling.BOX) if size else picture).save(path)
        made.append((path, lambda t=truth, x=x, y=y: t()[y:y + height, x:x + width]))
    return made


def changed_pictures():
    """{name: function of a picture in 0..1} of what other cameras, hours and weather do to pictures."""
    noise = np.random.default_rng(1)

    def through(filtered):
        return lambda x: np.asarray(filtered(Image.fromarray((x * 255).astype(np.uint8))), np.float32) / 255

    return {"none": lambda x: x, "exposure halved": lambda x: x / 2, "exposure doubled": lambda x: x * 2,
            "gamma 0.6": lambda x: x ** 0.6, "gamma 1.7": lambda x: x ** 1.7,
            "warm: red 1.2, blue 0.8": lambda x: x * [1.2, 1, 0.8], "cold: red 0.8, blue 1.2": lambda x: x * [0.8, 1, 1.2],
            "grey": lambda x: np.repeat(x.mean(2, keepdims=True), 3, 2), "haze, 40 %": lambda x: 0.6 * x + 0.4 * 0.75,
            "noise, 10 of 255": lambda x: x + noise.normal(0, 10 / 255, x.shape),
            "blur, 1.5 px": through(lambda p: p.filter(ImageFilter.GaussianBlur(1.5)))}


def changes(args, quality, pairs, models):
    """Quality on pictures as another camera at another time would have given them."""
    result, folder = {}, f"{args.out}/labels-changed"
    os.makedirs(folder, exist_ok=True)
    for name, change in changed_pictures().items():
        made = []
        for i, (image, truth) in enumerate(pairs):
            x = np.clip(change(np.asarray(Image.open(image).convert("RGB"), np.float32) / 255), 0, 1)
            Image.fromarray((x * 255 + 0.5).astype(np.uint8)).save(f"{folder}/{i}.png")
            made.append((f"{folder}/{i}.png", truth))
        result[name] = {os.path.basename(m): quality(made, m) for m in models}
    shutil.rmtree(folder)
    return result


def starts(total, length, unit, overlap):
    """First cells of the windows, as tiles_plan() lays them."""
    if length >= total:
        return [0]
    step = length - overlap - unit
    steps = -(-(total - length) // step)
    room = (total - length) // unit
    return [(2 * room * k + steps) // (2 * steps) * unit for k in range(steps + 1)]


def hand_over(total_px, working, nominal):
    """True where one window gives way to the next along an axis of total_px that the network sees as `working` px."""
    length = nominal // 8 * 2
    overlap, at = length // 4, starts(working // 4, length, 2, length // 4)
    cells = (np.arange(total_px) + 0.5) / total_px * (working // 4)
    mask = np.zeros(total_px, bool)
    for a, b in zip(at, at[1:]):
        middle = (a + length + b) / 2
        mask |= abs(cells - middle) < overlap / 2
    return mask


def seams(pairs, out, segment, model):
    """Share of pixels whose label changes when the picture moves by SHIFT px under the windows: where one window gives way
    to another in either layout, and elsewhere; and with one run instead of windows."""
    folder, changed = f"{out}/labels-run", {"windows": [], "elsewhere": [], "one run": []}
    for i, (image, _) in enumerate(pairs):
        os.makedirs(folder, exist_ok=True)
        picture = Image.open(image)
        w, h = picture.size
        picture.crop((0, 0, w - SHIFT, h - SHIFT)).save(f"{folder}/a.png")
        picture.crop((SHIFT, SHIFT, w, h)).save(f"{folder}/b.png")
        w, h, maps = w - SHIFT, h - SHIFT, {}
        for name, options in (("windows", ["--tiles"]), ("one run", [])):
            segment([f"{folder}/a.png", f"{folder}/b.png"], folder, model, "--scale", "2", *options)
            a, b = (read_labels(f"{folder}/labels/{n}.png") for n in "ab")
            maps[name] = a[SHIFT:, SHIFT:] != b[:h - SHIFT, :w - SHIFT]
        scale = 2 * np.sqrt(480 * 360 / (w * h))
        masks = [hand_over(n, 8 * round(n * scale / 8), side) for n, side in ((w, 480), (h, 360))]
        two_d = masks[1][:, None] | masks[0][None]
        border = two_d[SHIFT:, SHIFT:] | two_d[:h - SHIFT, :w - SHIFT]
        for name, value in (("windows", maps["windows"][border]), ("elsewhere", maps["windows"][~border]),
                            ("one run", maps["one run"])):
            changed[name].append(float(value.mean()))
        shutil.rmtree(folder)
    return {name: float(np.mean(v)) for name, v in changed.items()}


def layouts(args, quality, segment, camvid_pairs, model):
    """Quality by the size of what the network sees, in one run or in windows; other proportions; seams."""
    result = {"sizes": {}, "crops": {}}
    ways = [[], ["--scale", "0.7"], ["--scale", "1"], ["--scale", "1.5"], ["--scale", "2"], ["--scale", "1.5", "--tiles"],
            ["--scale", "2", "--tiles"], ["--scale", "3", "--tiles"]]
    for size in ("1000x750", "2000x1500"):
        pairs = scenes(args.sst, args.out, size, (150, 151))[::args.every]
        result["sizes"][size] = [[" ".join(way), quality(pairs, model, *way)] for way in ways]
    few = camvid_pairs[::4]
    for name, (width, height) in CROPS.items():
        pairs = cropped(few, f"{args.out}/crops", width, height)
        result["crops"][name] = [[" ".join(way), quality(pairs, model, *way)] for way in ([], ["--scale", "0.7"], ["--scale", "1.5"])]
    pairs = cropped(few, f"{args.out}/crops", 480, 360, (240, 180))
    pairs = [(p, lambda t=t: t()[1::2, 1::2]) for p, t in pairs]
    result["crops"]["whole, shrunk to 240x180"] = [[" ".join(way), quality(pairs, model, *way)]
                                                   for way in ([], ["--scale", "0.5"], ["--scale", "0.7"])]
    shutil.rmtree(f"{args.out}/crops")
    result["seams"] = seams(scenes(args.sst, args.out, "1000x750", (150,))[::args.every], args.out, segment, model)
    return result


def sheet(pairs, out, segment, model, path, width=256):
    """Rows of picture, truth, labels, labels that are sure enough (JPEG)."""
    folder, height, rows = f"{out}/labels-run", width * 3 // 4, []
    for image, truth in pairs:
        os.makedirs(folder, exist_ok=True)
        cells = [Image.open(image).convert("RGB")]
        for options in ([], ["--hcsm"]):
            segment([image], folder, model, *options)
            cells.append(Image.open(glob.glob(f"{folder}/labels/*.png")[0]))
        true = Image.fromarray(truth())
        true.putpalette(cells[1].getpalette())
        cells.insert(1, true)
        row = Image.new("RGB", (4 * width, height), "white")
        for i, cell in enumerate(cells):
            row.paste((cell if i == 0 else cell.convert("RGB")).resize((width - 4, height - 4), Image.Resampling.BOX),
                      (i * width, 0))
        rows.append(row)
        shutil.rmtree(folder)
    whole = Image.new("RGB", (4 * width, height * len(rows)))
    for i, row in enumerate(rows):
        whole.paste(row, (0, i * height))
    whole.save(path, quality=80)
    return path


def refinement(sst, out, call, shipped):
    """Labels of light fields before and after refinement by disparity, for several entropy limits."""
    result = []
    for name in ("pedestrian", "humvee", "transportation"):
        lf = f"{out}/labels-lf"
        call(sst, "scene", name, "-o", lf, "--size", "500x375", "--grid", "3x3", "--seed", "150", "--force")
        for limit in sorted([0.05, 0.1, 0.2, 0.4, 0.8, shipped]):
            call(sst, "process", lf, "--epsilon-h", limit, "--json")
            labels = json.loads(call(sst, "eval", lf, "--truth", f"{lf}/truth", "--json"))["labels"]
            result.append({"scene": name, "limit": limit, "shipped": limit == shipped, "labels": labels})
        shutil.rmtree(lf)
    return result
