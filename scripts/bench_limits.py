# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
"""How far each stage is from what the machine can do: the page bench-limits and its chart."""
import json
import os
import statistics

from charts import COLOURS, draw, frame, median, number, page, read_rounds, table, word, write_page

LIMITS_TEXT = """\
What two threads of this machine can do at most, measured by small loops (`build/bench/peaks`; best of
{rounds} rounds), and how far each stage is from it. A stage's *limit* is the larger of its bytes over the bandwidth and its
operations over their peak, where the bytes are what it must read and write once and the operations what its formulas need
at least, by the widest instruction; *time / limit* is 1 for a stage that this machine cannot run faster. A stage's time is the CPU
time of all threads, halved: two busy threads; other programs change it less than wall time. Each level is compared with its own limits. A network's limit is its
convolutions alone, as bare oneDNN primitives.

{peaks}
## Roofline

![operations per byte against operations per second](roofline.svg)

## Share of the limit

{table}
What holds the stages that take more than twice their limit (looked at {looked}):

{words}"""

# Per ray: bytes read; 16-bit multiplications (byte dot products count as half); byte operations. Colour: 4 taps of 3
# channels; see-through: also 3 products with the weight, and disparity (2 bytes) and label (1).
RAYS = {"refocus": (3, 6, 6), "see-through": (6, 9, 12), "clear": (6, 9, 12)}
# Per pixel, disparity and path of semi-global matching 8 operations on 16 bits: 16 byte operations.
PATH_OPERATIONS = 16
PATHS = {"OpenCV SGBM 3WAY": 3, "OpenCV SGBM HH": 8, "sst preview": 4, "sst balanced": 4}
TAPS = {"bilinear": 2, "bicubic": 4, "lanczos": 6}  # along each side, of each of three channels
FRAME_BYTES = 78e3  # of a JPEG frame of 640x480
LOOKED = "2026-11-23"
WORDS = {
    "render refocus": "of the bandwidth that small pages allow, 21 GB/s, it reaches two thirds; that of huge pages was not "
                      "looked into.",
    "render see-through": "likewise; 0.6 ns a ray where all is in the cache.",
    "OpenCV": "floats, one pass over the picture for each view.",
    "render clear": "each ray moves to its own place: the kernels that gather rays there (`clear_take`) take a third of the "
                    "samples, those that blend, land and find surfaces a quarter.",
    "pair, sst": "in samples of all presets together the two path kernels, which the limit counts, have 9 %; choosing the winner, "
                 "filling, median, costs and the support of the second pass 1 to 2 % each.",
    "pair, OpenCV": "the same sums on 16 bits; its mode HH runs on one thread.",
    "rectify": "beside the products it computes the place of every pixel and interleaves the picture; not looked into further.",
    "live update": "of 110 ms of CPU time on one thread finding changes and decoding them have 32, matching the changed tiles of the key "
                   "views 43, the network 15, labels and maps of all views 20; none of it is counted by this limit.",
    "live frames": "finding what changed: the means of 8x8 blocks are decoded from the whole JPEG stream, bit by bit, which "
                   "this limit does not count (`sst_jpeg_means_read`).",
    "live see-through": "as the same picture of a light field.",
    "live clear": "as the same picture of a light field; it also keeps what it saw before.",
    "network": "beside the convolutions, the first layer of pictures, pooling, and the last enlargement.",
    "process load": "decoding PNG: libdeflate has a third of the samples, undoing filters a tenth, the kernel a quarter, SHA-256 "
                    "6 %.",
    "process disparity": "the costs of hypotheses are a third of the samples of the run, which wait for the windows of 24 views; "
                         "comparing the census of neighbours 11 %, the lists of hypotheses 9 %, filling 6 %, paths of hypotheses 4 %, "
                         "the multi-view check 3 %; the paths of the first pass, which the limit counts, 4 %.",
    "process refinement": "distances to the nearest labeled pixels (`sst_distance_columns`, `sst_distance_row`), normals of labels that "
                          "compete (`sst_normal_at`), votes of other views, and labels carried to them: 2 to 6 % each of a preview.",
    "process saving": "compressing PNG: zlib's runs alone (Z_RLE) take most of it; libdeflate's first level takes as long.",
}


def limit_row(name, ms, bytes_, multiplies, simple, peak):
    """Table cells, and the point of the roofline."""
    times = {"memory": bytes_ / peak["memory"] / 1e6, "multiplications": multiplies / peak["multiply"] / 1e6,
             "byte operations": simple / peak["minimum"] / 1e6}
    bound = max(times, key=times.get)
    lanes = 2 * multiplies + simple
    return [name, number(ms, 1), *(number(t, 1) if t else "-" for t in times.values()), bound, number(ms / times[bound], 1)], \
        (name, lanes / bytes_, lanes / ms / 1e6)


def limit_rows(folder, peak, at):
    """A row and a point for each stage whose times were measured at this level."""
    rows = []
    if os.path.exists(f"{folder}/render.csv"):
        for (level, width, height, method), r in read_rounds(f"{folder}/render.csv", "level", "width", "height",
                                                                  "method").items():
            name, pixels = method.removeprefix("OpenCV "), width * height
            if name in RAYS and level == at:
                per_ray = [36 * pixels * n for n in RAYS[name]]
                whose = "render " if name == method else "OpenCV "
                rows.append(limit_row(f"{whose}{name}, {width:.0f}x{height:.0f}", median(r, "cpu_ms") / 2, per_ray[0] + 3 * pixels,
                                      *per_ray[1:], peak))
    if os.path.exists(f"{folder}/stereo.csv"):
        for (level, pair, method), r in read_rounds(f"{folder}/stereo.csv", "level", "pair", "method").items():
            if level == at and pair == "motorcycle" and method in PATHS:
                half = 8 if method == "sst preview" else 1  # half the width, height and disparities
                pixels = r[0]["width"] * r[0]["height"]
                rows.append(limit_row(f"pair, {method}", median(r, "cpu_ms") / 2, 10 * pixels, 0,
                                      PATHS[method] * PATH_OPERATIONS * 64 * pixels / half, peak))
    if os.path.exists(f"{folder}/rectify.csv"):
        for (level, method), r in read_rounds(f"{folder}/rectify.csv", "level", "method").items():
            if method in TAPS and level == at:
                rows.append(limit_row(f"rectify {method}, 1 megapixel", median(r, "ms_per_mpx") / 2, 6e6, 3e6 * TAPS[method] ** 2, 0,
                                      peak))
    if os.path.exists(f"{folder}/skips.json"):
        with open(f"{folder}/skips.json") as f:
            entry = next((m for m in json.load(f) if m["scene"] == "bush" and m["skip"] == "none"), None)
        rows += process_rows(entry, peak, at) if entry else []
    if os.path.exists(f"{folder}/live.json") and os.path.exists(f"{folder}/clear.csv"):
        with open(f"{folder}/live.json") as f:
            frames = [m for m in json.load(f) if m["level"] == at]
        sets = [r for (level, _), r in read_rounds(f"{folder}/clear.csv", "level", "set").items() if level == at]
        rows += live_rows(frames, sets, peak) if frames and sets else []
    if os.path.exists(f"{folder}/networks.json"):
        with open(f"{folder}/networks.json") as f:
            rows += [network_row(m) for m in json.load(f) if m["level"] == at]
    return rows


def live_rows(frames, sets, peak):
    """Frames of a set, whose changed tiles are written; and pictures, which read every ray."""
    pixels, rows = 640 * 480, []
    for m in frames:
        if m["world"] == "pedestrian" and m["mode"] == "skip" and m["calibrated"] == "no":
            rows.append(limit_row("live frames, pedestrian", float(m["CPU, ms"]) / 2, 36 * pixels * 3 * float(m["tiles"]) / 100,
                                  0, 0, peak))
    tiles = next(float(m["tiles"]) for m in frames if m["world"] == "pedestrian" and m["mode"] == "skip" and m["calibrated"] == "no")
    moving = [r[0] for r in sets if r[0]["clear ms"] > 0]
    rows.append(limit_row("live update, pedestrian", statistics.median(r["update ms"] for r in moving) / 2,
                          36 * (FRAME_BYTES + 6 * pixels * tiles / 100), 0, 0, peak))
    for name in ("see-through", "clear"):
        ms = statistics.median(r[f"{name} ms"] for r in moving)
        per_ray = [36 * pixels * n for n in RAYS[name]]
        rows.append(limit_row(f"live {name} picture, pedestrian", ms / 2, per_ray[0] + 3 * pixels, *per_ray[1:], peak))
    return rows


def network_row(measured):
    """A network's limit: its convolutions alone."""
    ms = {t["what"]: t["cpu_ms"] / 2 for t in measured["times"] if t["precision"] == "int8" and t["threads"] == 2}
    bare, whole = ms["convolutions"], ms["network"]
    name = f"network {measured['model'].removesuffix('.onnx')}, {measured['width']}x{measured['height']}"
    return [name, number(whole, 1), "-", "-", "-", f"convolutions, {number(bare, 1)} ms", number(whole / bare, 1)], None


def process_rows(entry, peak, at):
    """Stages of sst process --skip none: what they read and write of every ray, and the paths of the first pass."""
    r = entry["report"]
    width, height = map(int, entry["size"].split("x"))
    rays, steps = 36 * width * height, r["searched_px"][1] - r["searched_px"][0] + 1
    return [limit_row(f"process {stage}, {entry['scene']} {entry['size']}", 500 * r["levels"][at]["cpu_seconds"][stage], per_ray * rays, 0,
                      simple * rays, peak)
            for stage, per_ray, simple in (("load", 3, 0), ("disparity", 6, 4 * PATH_OPERATIONS * steps),
                                           ("refinement", 7, 8), ("saving", 6, 0))]


def roofline(out, points, peak, command):
    """Byte operations per byte of memory against byte operations per second (a 16-bit multiplication counts as two)."""
    points = [p for p in points if p[1] > 0 and ", 1000x750" not in p[0]]
    roof = max(peak["minimum"], 2 * peak["multiply"])
    x = (min(p[1] for p in points) / 3, max(p[1] for p in points) * 3)
    y = (min(p[2] for p in points) / 3, roof * 3)
    lines = frame("Roofline: stages against what two threads can do", ("byte operations per byte of memory",
                  "1e9 byte operations per second"), x, y, True, command)
    lines[0] = 'set title "{/*1.3 Roofline: stages against what two threads can do}\\n{/*0.9 nearer to the line is better}"'
    lines += [f"roof(x) = x * {peak['memory']} < {roof} ? x * {peak['memory']} : {roof}", "set samples 500"]
    plots = ["roof(x) with lines lw 3 lc rgb '#444444' title 'limit'",
             f"{peak['cache']} * x < {roof} ? {peak['cache']} * x : {roof} with lines dt 2 lw 2 lc rgb '#888888' "
             "title 'from second-level cache'"]
    for i, (name, operations, speed) in enumerate(points):
        lines += [f"$r{i} << EOD", f"{operations} {speed}", "EOD"]
        colour = COLOURS[1] if "OpenCV" in name else COLOURS[0] if name.startswith(("render", "pair")) else COLOURS[2]
        symbol = (7, 5, 9, 13, 11, 15, 6, 4, 8, 12, 10, 14)[i % 12]
        plots.append(f"$r{i} with points pt {symbol} ps 1.3 lc rgb '{colour}' title \"{name}\"")
    return draw(out, "roofline", lines + ["plot " + ", \\\n".join(plots)])


def limits(source, out, command):
    rounds = read_rounds(source, "level", "limit")
    peaks = {}
    for (level, name), r in rounds.items():
        peaks.setdefault(level, {})[name] = max(row["value"] for row in r)
    levels = list(peaks)
    if not {"multiply", "minimum", "fma"} <= set(peaks[levels[0]]):
        return []
    units = {"memory": "GB/s from memory", "cache": "GB/s from the second level of cache", "scatter": "1e9 scattered updates/s",
             "multiply": "1e9 multiplications of 16 bits/s", "minimum": "1e9 minima of bytes/s",
             "fma": "1e9 multiply-adds of floats/s"}
    heads = {level: f"{word(level)}: " for level in levels}
    table_of_peaks = table(["limit"] + [h for head in heads.values() for h in (f"{head}best", "median")],
                           [[units[name]] + [cell for level in levels for cell in (
                               number(peaks[level][name], 1), number(median(rounds[level, name], "value"), 1))]
                            for name in peaks[levels[0]]])
    rows, *others = (limit_rows(os.path.dirname(source), peaks[level], level) for level in levels)
    if not rows:
        return []
    cells = [{row[0]: (row[1], row[-1]) for row, _ in other} for other in others]
    slow = [row[0] for row, _ in rows if float(row[-1]) > 2]
    words = "".join(f"- {start}: {text}\n" for start, text in WORDS.items() if any(n.startswith(start) for n in slow))
    words += "".join(f"- {n}: not looked into.\n" for n in slow if not n.startswith(tuple(WORDS)))
    text = LIMITS_TEXT.format(rounds=len(rounds[levels[0], "memory"]), peaks=table_of_peaks, looked=LOOKED, words=words, table=table(
        ["stage", f"{heads[levels[0]]}CPU ms / 2", "memory, ms", "multiplications, ms", "byte operations, ms", "limit is",
         "time / limit"] + [h for level in levels[1:] for h in (f"{heads[level]}CPU ms / 2", "time / limit")],
        [row + [cell for other in cells for cell in other.get(row[0], ("-", "-"))] for row, _ in rows]))
    return (write_page(out, "bench-limits", page("Limits: each stage against the machine", command, text, levels)) +
            roofline(out, [point for _, point in rows if point], peaks[levels[0]], command))
