#!/usr/bin/python3
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
"""Measure calibration against known truth and renew docs/measured/bench-calibration.md and its charts: bench_calib.py.

Corners are made up (tests/calib_truth.h): 6x6 cameras of 2000x1500 px, 100 frames of a board with 150 points, 0.1 px of
noise, unless a table says otherwise. Raw figures go to BUILD/bench/calib.json. The comparison with OpenCV needs its
Python module and real chessboards (--data); what is missing is named and left out.
"""
import argparse
import json
import os
import shutil
import statistics
import subprocess
import sys

import charts
from bench import say

FRAMES = (10, 20, 40, 70, 100)
SEEDS = (1, 2, 3)
SMALL_SEEDS = range(101, 131)
WIDE_PX = 1100  # focal length where lenses are compared: 98 degrees from corner to corner
CHESSBOARD = (9, 6, 25.0)  # inner corners, mm


def solve(build, **settings):
    """Figures of one solution by build/bench/calib, or {"error": ..., "said": ...} where it refuses."""
    command = [f"{build}/bench/calib"] + [f"{k}={v}" for k, v in settings.items()]
    done = subprocess.run(command, text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE, check=False)
    if done.returncode > 1 or not done.stdout:
        sys.exit(f"bench: {' '.join(command)}: {done.stderr}")
    return {**json.loads(done.stdout), "said": done.stderr.strip()}


# --- measuring ------------------------------------------------------------------------------------------------------

def measure(build):
    out = {}
    say("6x6 cameras, 100 frames")
    out["full"] = [solve(build, seed=s) for s in SEEDS]
    say("odd against even frames")
    out["cross"] = [solve(build, seed=s, cross=1) for s in SEEDS]
    say("fewer frames")
    out["frames"] = {n: [solve(build, seed=s, frames=n) for s in SEEDS] for n in FRAMES if n != 100}
    out["frames"][100] = out["full"]
    say(f"predicted against true errors, {len(SMALL_SEEDS)} small arrays")
    out["small"] = [solve(build, seed=s, rows=3, cols=3, frames=30, board="9x7") for s in SMALL_SEEDS]
    say("40 % of the detections removed")
    out["keep"] = [solve(build, seed=s, keep=0.6) for s in SEEDS]
    say("each camera removed")
    out["without"] = [solve(build, frames=30, without=view) for view in range(36)]
    say("2 % outliers")
    out["outliers"] = solve(build, frames=40, outliers=0.02)
    say("lenses")
    out["lens"] = {f"{true} by {used}": solve(build, rows=3, cols=3, frames=40, focal=WIDE_PX, true_lens=true,
                                                  lens=used)
                   for true in (5, 8) for used in (5, 8, 0)}
    return out


def board_points(numpy):
    cols, rows, side = CHESSBOARD
    board = numpy.zeros((cols * rows, 3), numpy.float32)
    board[:, :2] = numpy.mgrid[:cols, :rows].T.reshape(-1, 2) * side
    return board


def opencv_corners(folder, cv2):
    """{view: {number: corners}} as OpenCV finds them."""
    stop = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 50, 1e-4)
    found = ({}, {})
    for view, side in enumerate(("left", "right")):
        for number in range(1, 100):
            path = f"{folder}/{side}{number:02d}.jpg"
            if not os.path.exists(path):
                continue
            grey = cv2.imread(path, cv2.IMREAD_GRAYSCALE)
            ok, at = cv2.findChessboardCorners(grey, CHESSBOARD[:2])
            if ok:
                found[view][number] = cv2.cornerSubPix(grey, at, (5, 5), (-1, -1), stop)
    return found


def opencv_pair(found, size, cv2, numpy):
    """Both cameras, their pose and all boards free, five coefficients: what calib_pairs solves."""
    board, both = board_points(numpy), sorted(set(found[0]) & set(found[1]))
    single = [cv2.calibrateCamera([board] * len(f), list(f.values()), size, None, None) for f in found]
    pair = cv2.stereoCalibrate([board] * len(both), [found[0][n] for n in both], [found[1][n] for n in both],
                               single[0][1], single[0][2], single[1][1], single[1][2], size,
                               flags=cv2.CALIB_USE_INTRINSIC_GUESS,
                               criteria=(cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 300, 1e-10))
    return {"detections": len(found[0]) + len(found[1]), "rms_px": pair[0], "focal_px": float(pair[1][0, 0]),
            "baseline_mm": float(numpy.linalg.norm(pair[6]))}


def real_pairs(build, data):
    """sst and OpenCV on the same pictures, OpenCV also on our corners; None where something is missing."""
    try:
        import cv2
        import numpy
    except ImportError:
        return say("skipped: comparison with OpenCV; install python3-opencv")
    if not os.path.exists(f"{data}/left01.jpg"):
        return say(f"skipped: comparison with OpenCV; {data} lacks left01.jpg ..., give --data DIR")
    say("real chessboards")
    done = subprocess.run([f"{build}/bench/calib_pairs", data, "chessboard:{}x{}c:{:g}mm".format(*CHESSBOARD)],
                          stdout=subprocess.PIPE, text=True, check=True)
    ours = json.loads(done.stdout)
    size, same = (ours["width"], ours["height"]), ({}, {})
    for view, frame, at in ours.pop("found"):
        same[view][frame] = numpy.array(at, numpy.float32).reshape(-1, 1, 2)
    return {"sst": ours, "opencv": opencv_pair(opencv_corners(data, cv2), size, cv2, numpy),
            "opencv, corners of sst": opencv_pair(same, size, cv2, numpy)}


# --- the page -------------------------------------------------------------------------------------------------------

TEXT = """\
Corners are made up with known truth (tests/calib_truth.h): 6x6 cameras of 2000x1500 px, focal length 2250 px, 60 mm
apart, mounted wrong by 1 mm along each axis and 0.5 degrees about each (sigma); 100 frames of a board of 150 points,
0.9 to 2.2 m away; noise of 0.1 px (sigma of each axis). Then true points of planes are carried through the
rectification that the solution makes, by the way that pictures take. Seeds {seeds}; of several solutions the worst
figure is given unless stated otherwise. Times are CPU times of one thread.

**Cross disparity** is where a point is in one view against another, across the line between their centres, measured
minus predicted: in a row of cameras the y-disparity. A view that stands 1 mm before the plane of the others sees objects
larger than they do; rectification by homographies can undo that for one depth, here {range_mm:.0f} mm (median of the
boards). The lines *camera depth known* take the rest by the calibrated depth of each camera, and so show what the
calibration itself knows. The lines without it are what a light field of that array is like at other depths, however
well it is calibrated: with the *true parameters* they are the same. What helps there is exact mounting, or `--plane`
where one looks.

"""

WIDE_TEXT = """\
The predicted sigma is that of the whole raw picture: eight coefficients do not settle in its corners, which no board
reached, and the uncertainty shows it. Five that do not fit are wrong towards the edges without knowing it.

"""

PASS = {True: "pass", False: "**fail**"}


def worst(solutions, pick):
    return max(pick(s) for s in solutions)


def at_depth(kind, index, group, figure):
    return lambda s: s[kind][index][group][figure]


def bar(name, limit, stretch, value, digits=3, unit=""):
    ok = value <= limit
    text = PASS[ok] if not ok or value > stretch else "pass, stretch"
    return [name, f"{limit:g}{unit}", f"{stretch:g}{unit}", f"{value:.{digits}f}{unit}", text]


def triple(name, solutions, kind, index):
    values = [worst(solutions, at_depth(kind, index, "neighbours", f)) for f in ("mean", "p95", "max")]
    limits, stretch = (0.10, 0.25, 0.5), (0.05, 0.12, 0.25)
    ok, best = (all(v <= l for v, l in zip(values, b)) for b in (limits, stretch))
    return [name, " / ".join(f"{v:g}" for v in limits) + " px", " / ".join(f"{v:g}" for v in stretch) + " px",
            " / ".join(f"{v:.3f}" for v in values) + " px", "pass, stretch" if best else PASS[ok]]


def sigma_row(m):
    shares = [s["sigma"]["one"] for s in m["small"]]
    share = 100 * statistics.mean(shares)
    verdict = "pass, stretch" if 65 <= share <= 71 else PASS[60 <= share <= 76]
    return [f"truth inside the predicted sigma, {len(shares)} arrays of 3x3", "60..76 %", "65..71 %", f"{share:.1f} %",
            verdict]


def robust_rows(m):
    rows = []
    for name, tried in (("one camera removed, each of 36", m["without"]),
                        ("40 % of the detections removed", m["keep"])):
        solved = [s for s in tried if "error" not in s]
        told = [s for s in tried if "error" in s and s["said"]]
        ok = len(solved) + len(told) == len(tried)
        p95 = f", p95 {worst(solved, at_depth('levelled', 1, 'neighbours', 'p95')):.3f} px" if solved else ""
        rows.append([name, "solves or reports why", "", f"{len(solved)} of {len(tried)} solved{p95}", PASS[ok]])
    return rows


def expected(s):
    """RMS per point that 0.1 px of noise leaves after the solution."""
    return 2 ** 0.5 * 0.1 * (1 - s["states"] / s["measurements"]) ** 0.5


def bars(m):
    full, near, middle, far = m["full"], 0, 1, 2
    seconds = statistics.median(s["cpu_seconds"] for s in full)
    deviation = 100 * worst(full, lambda s: abs(s["rms_px"] / s["predicted_rms_px"] - 1))
    by_truth = 100 * worst(full, lambda s: abs(s["rms_px"] / expected(s) - 1))
    rows = [bar("full solution, one core, median", 60, 15, seconds, 1, " s"),
            bar("recovered RMS against what it predicts", 5, 2, deviation, 2, " %"),
            bar("recovered RMS against the true noise", 5, 2, by_truth, 2, " %"),
            bar("odd against even frames, central 80 %", 0.2, 0.1, worst(m["cross"], lambda s: s["cross_px"]), 3,
                " px"),
            triple("cross disparity of 60 neighbour pairs, mean / p95 / max, 1.4 m", full, "rectified", middle),
            triple("the same, 0.9 m", full, "rectified", near),
            triple("the same, 2.2 m", full, "rectified", far),
            triple("the same, 0.9 m, camera depth known", full, "levelled", near),
            triple("the same, 2.2 m, camera depth known", full, "levelled", far),
            triple("the same, infinity, camera depth known", full, "levelled", 3)]
    for index, name in ((near, "0.9 m"), (middle, "1.4 m"), (far, "2.2 m")):
        rows.append(bar(f"disparity / baseline of one plane over 35 pairs, {name}: largest less smallest", 0.5, 0.2,
                        100 * worst(full, lambda s: s["rectified"][index]["plane_spread"]), 3, " %"))
    for index, kind, name in ((middle, "rectified", "1.4 m"), (near, "rectified", "0.9 m"), (far, "rectified", "2.2 m"),
                              (near, "levelled", "0.9 m, camera depth known"),
                              (far, "levelled", "2.2 m, camera depth known")):
        rows.append(bar(f"cross disparity of all 630 pairs, p95, {name}", 0.35, 0.2,
                        worst(full, at_depth(kind, index, "all", "p95")), 3, " px"))
    rows.append(sigma_row(m))
    return charts.table(["bar", "pass", "stretch", "measured", "verdict"], rows + robust_rows(m))


def depth_table(m):
    rows = []
    for kind, name in (("rectified", "calibrated"), ("rectified_by_truth", "true parameters"),
                       ("levelled", "calibrated, camera depth known")):
        for index in range(4):
            depth = m["full"][0][kind][index]["depth_mm"]
            cells = [worst(m["full"], at_depth(kind, index, g, f)) for g in ("neighbours", "all")
                     for f in ("mean", "p95", "max")]
            rows.append([name, f"{depth / 1000:.1f} m" if depth < 1e5 else "infinity"] + [f"{v:.3f}" for v in cells])
    return charts.table(["geometry", "depth", "neighbours: mean px", "p95", "max", "all pairs: mean px", "p95",
                               "max"], rows)


def frames_table(m):
    rows = []
    for n in FRAMES:
        tried = m["frames"][n]
        solved = [s for s in tried if "error" not in s]
        if not solved:
            rows.append([n, "refused: " + tried[0]["said"].splitlines()[0].removeprefix("sst: error: ")] + ["-"] * 4)
            continue
        rows.append([n, f"{len(solved)} of {len(tried)}",
                     f"{statistics.median(s['cpu_seconds'] for s in solved):.1f}",
                     f"{worst(solved, at_depth('levelled', 1, 'neighbours', 'p95')):.3f}",
                     f"{worst(solved, lambda s: s['worst_position_mm']):.3f}",
                     f"{100 * worst(solved, lambda s: s['worst_focal']):.4f}"])
    return charts.table(["frames", "solved", "CPU s", "cross disparity, 1.4 m, camera depth known, p95 px",
                               "worst position, mm", "worst focal length, %"], rows)


def lens_table(m):
    rows = []
    for name, s in m["lens"].items():
        true, used = name.split(" by ")
        if "error" in s:
            rows.append([true, used, "refused: " + s["said"].splitlines()[0].removeprefix("sst: error: ")] + ["-"] * 5)
            continue
        rows.append([true, used if used != "0" else f"chosen: {s['lens']}", f"{s['rms_px']:.3f}", s["outliers"],
                     " / ".join(f"{v:.3f}" for v in s["held_out_px"]) if s["held_out_px"][0] else "-",
                     f"{s['sigma_px']:.3f}", f"{s['rectified'][1]['neighbours']['p95']:.3f}",
                     f"{s['rectified'][1]['neighbours']['max']:.3f}"])
    return charts.table(["true coefficients", "solved with", "RMS px", "outliers", "held out 5 / 8, px",
                               "predicted sigma px", "cross disparity, 1.4 m, p95 px", "max"], rows)


def outlier_text(m):
    s = m["outliers"]
    if "error" in s:
        return f"2 % of the corners moved by up to 20 px along each axis, 40 frames: refused, \"{s['said']}\"\n\n"
    return (f"2 % of the corners moved by up to 20 px along each axis, 40 frames: {s['outliers']} of "
            f"{s['outliers'] + s['corners']} corners found to be outliers, RMS of the others {s['rms_px']:.3f} px, "
            f"cross disparity at 1.4 m p95 {s['rectified'][1]['neighbours']['p95']:.3f} px.\n\n")


def pairs_table(pairs):
    rows = [[name, p["detections"], f"{p['rms_px']:.4f}", f"{p['focal_px']:.2f}", f"{p['baseline_mm']:.3f}"]
            for name, p in pairs.items()]
    return charts.table(["13 pairs of a real chessboard", "boards found", "RMS, px per point", "focal length, px",
                               "baseline, mm"], rows)


PAIRS_TEXT = """\
## Real chessboards, beside OpenCV

OpenCV's sample pictures, 640x480, 9x6 inner corners of 25 mm. Both solve the same thing: two cameras with five
coefficients, their pose and all boards, plain least squares over all corners, a flat board. `sst calibrate` itself also
solves the board's warp and leaves out outliers.

"""


# --- charts ---------------------------------------------------------------------------------------------------------

def style(title, command):
    return [f'set title "{{/*1.3 {title}}}"', "set border 3 lc rgb '#444444'", "set tics nomirror",
            "set grid lc rgb '#dddddd' lt 1", "set bmargin 5.5", "set tmargin 3.5",
            f'set label "{command}; {charts.cpu_name()}, 1 thread" at screen 0.01, 0.025 font ",9" '
            'tc rgb "#555555" noenhanced']


def depth_chart(m, out, command):
    """p95 by depth, beside the bar."""
    lines = style("Cross disparity of neighbouring views", command)
    lines += ['set ylabel "95 % of true points are within, px"', "set logscale y", "set yrange [0.004:3]",
              'set ytics ("0.005" 0.005, "0.01" 0.01, "0.02" 0.02, "0.05" 0.05, "0.1" 0.1, "0.2" 0.2, "0.5" 0.5, '
              '"1" 1, "2" 2)', "set xrange [0.7:4.5]", 'set xtics ("0.9 m" 1, "1.4 m" 2, "2.2 m" 3, "infinity" 4)',
              'set xlabel "depth of the plane (boards were seen from 0.9 to 2.2 m)"', "set key top left Left reverse",
              'set label "bar" at 4.45, 0.25 right offset 0, 0.6 tc rgb "#888888"',
              "set arrow from 0.7, 0.25 to 4.5, 0.25 nohead dt 2 lc rgb '#888888'"]
    shown = (("rectified_by_truth", "light field, true parameters", 4, "#888888", 2.6),
             ("rectified", "light field, calibrated", 7, charts.COLOURS[0], 1.2),
             ("levelled", "calibrated, depth of each camera known", 5, charts.COLOURS[1], 1.2))
    plots = []
    for kind, name, symbol, colour, size in shown:
        lines += [f"${kind} << EOD"] + [f"{i + 1} {worst(m['full'], at_depth(kind, i, 'neighbours', 'p95'))}"
                                        for i in range(4)] + ["EOD"]
        plots.append(f"${kind} with linespoints lw 1.5 pt {symbol} ps {size} lc rgb '{colour}' title '{name}'")
    return charts.draw(out, "calibration-depth", lines + ["plot " + ", ".join(plots)])


def frames_chart(m, out, command):
    """Error against frames: true, and what the solution predicts of it."""
    lines = style("How many frames", command)
    lines += ['set xlabel "frames of the board"', 'set ylabel "px"', "set xrange [0:105]", "set logscale y",
              "set yrange [0.002:0.1]",
              'set ytics ("0.002" 0.002, "0.005" 0.005, "0.01" 0.01, "0.02" 0.02, "0.05" 0.05, "0.1" 0.1)',
              "set key top right"]
    lines += ["$true << EOD"] + [f"{n} {at_depth('levelled', 1, 'neighbours', 'p95')(s)}" for n in FRAMES
                                 for s in m["frames"][n] if "error" not in s] + ["EOD"]
    lines += ["$sigma << EOD"] + [f"{n} {s['sigma_px']}" for n in FRAMES
                                  for s in m["frames"][n] if "error" not in s] + ["EOD"]
    plots = [f"$true with points pt 7 ps 1.2 lc rgb '{charts.COLOURS[0]}' title "
             "'cross disparity at 1.4 m, camera depth known, p95, by the truth'",
             f"$sigma with points pt 5 ps 1.2 lc rgb '{charts.COLOURS[1]}' title "
             "'sigma\\_px that the calibration tells, mean of the cameras'"]
    return charts.draw(out, "calibration-frames", lines + ["plot " + ", ".join(plots)])


def time_chart(m, out, command):
    """Time of the solution against its true error, by the number of frames."""
    lines = style("Calibration of 36 cameras: time against error", command)
    lines += ['set xlabel "CPU time of the solution, s"', 'set ylabel "cross disparity at 1.4 m, p95, px"',
              "set logscale xy", 'set ytics ("0.005" 0.005, "0.01" 0.01, "0.02" 0.02, "0.05" 0.05)',
              'set xtics ("0.2" 0.2, "0.5" 0.5, "1" 1, "2" 2, "5" 5, "10" 10)', "unset key"]
    points = []
    for n in FRAMES:
        solved = [s for s in m["frames"][n] if "error" not in s]
        if solved:
            points.append((statistics.median(s["cpu_seconds"] for s in solved),
                           worst(solved, at_depth("levelled", 1, "neighbours", "p95")), n))
    lines += [f"set {axis}range [{min(p[i] for p in points) / 1.5}:{max(p[i] for p in points) * 1.5}]" for i, axis in enumerate("xy")]
    lines += ["$t << EOD"] + [f'{x} {y} "{n} frames"' for x, y, n in points] + ["EOD"]
    colour = charts.COLOURS[0]
    return charts.draw(out, "time-error-calibration", lines + [
        f"plot $t using 1:2 with linespoints pt 7 ps 1.4 lw 1.5 lc rgb '{colour}', "
        f"$t using 1:2:3 with labels left offset 0.5, 0.8 tc rgb '{colour}'"])


def report(m, out, command):
    text = TEXT.format(seeds=", ".join(map(str, SEEDS)), range_mm=m["full"][0]["range_mm"])
    text += f"{bars(m)}\n![cross disparity by depth](calibration-depth.svg)\n\n{depth_table(m)}\n"
    text += "## Frames\n\n![error against frames](calibration-frames.svg)\n\n"
    text += f"![time against error](time-error-calibration.svg)\n\n{frames_table(m)}\n"
    text += f"## Lenses and outliers\n\n3x3 cameras of focal length {WIDE_PX} px, 40 frames. "
    text += f"Eight true coefficients: an equidistant lens.\n\n{lens_table(m)}\n{WIDE_TEXT}{outlier_text(m)}"
    if m["pairs"]:
        text += PAIRS_TEXT + pairs_table(m["pairs"])
    page = charts.page("Calibration against known truth", command, text)
    return (charts.write_page(out, "bench-calibration", page) + depth_chart(m, out, command) +
            frames_chart(m, out, command) + time_chart(m, out, command))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--build", default="build", help="folder with the built programs (build)")
    parser.add_argument("--data", default="../shared/data/calib-opencv-stereo",
                        help="leftNN.jpg and rightNN.jpg, chessboards of 9x6 corners (%(default)s)")
    parser.add_argument("--keep", action="store_true", help="leave docs/ as it is; the page stays in BUILD/bench/docs")
    parser.add_argument("--draw", action="store_true", help="page and charts again from the figures of the last run")
    args = parser.parse_args()
    os.chdir(os.path.join(os.path.dirname(os.path.abspath(__file__)), ".."))
    out = f"{args.build}/bench"
    os.makedirs(f"{out}/docs", exist_ok=True)
    if not args.draw:
        measured = measure(args.build)
        measured["pairs"] = real_pairs(args.build, args.data)
        with open(f"{out}/calib.json", "w") as f:
            json.dump(measured, f, indent=1)
    with open(f"{out}/calib.json") as f:  # keys of mappings are text from here on
        measured = json.load(f)
    measured["frames"] = {int(n): tried for n, tried in measured["frames"].items()}
    for path in report(measured, f"{out}/docs", "make bench-calib"):
        if not args.keep:
            shutil.copy(path, "docs/measured")
        say(path)


if __name__ == "__main__":
    main()
