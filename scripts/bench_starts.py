#!/usr/bin/env python3
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
"""The passer-by in the clear live picture of `sst demo --scene hedge`, start after start: bench_starts.py [--starts N] [--sstd PROGRAM]

Each start runs until a walker has passed behind the hedge and was tracked. Columns of its line: the automatic cut; pictures with the passer-by
away from both sides; the rows in which the passer-by differs from the pictures without anybody, as a share of the passer-by's (median, and
tenth percentile); the share of these pictures at whose time a box is there, of a track or an unconfirmed one; then for each pass the seconds
from the first picture seen to its begin, and from its begin to the first box and to the first track; seconds from the passer-by's last picture
to the last track (who leaves is held for some seconds); pictures in which a track was removed.
Figures of an idle machine; ends with 1 if a start misses the passer-by, shows less than WHOLE of the rows, or has no box within SOON_S in a pass.

--sstd: a service with a configuration written here, on the same simulated cameras, instead of the demo; sst-sim is of --build.
"""
import argparse
import http.client
import io
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time

import numpy as np
from PIL import Image

HEIGHT = 0.27    # of the passer-by, of the picture's width
DIFFERS = 30     # levels
WINDOW = 7       # pixels: most of a window differ
REACH = 0.1      # of the width, to both sides of the passer-by's middle
SIDES = 0.15     # of the width
LEAST = 400      # pixels that differ
WHOLE = 0.8      # of the rows, median
ROW = 4          # pixels that differ in a row that shows the passer-by
BOX_S = 0.6      # between a picture and its tracks
SOON_S = 2       # from a passer-by in the picture to a box
APART_S = 4      # between two passes
PASS = 5         # pictures of a pass, ...
WALKED = 0.2     # of the width, from the first to the last
HALF = 0.5       # of the rows, in a picture of each pass: bricks that become sharp after the start are nobody
ASK_S = 0.1      # between requests for tracks
PASS_S = 150     # until somebody has passed

CONFIG = """array: {{rows: 6, cols: 6}}
cameras: {{width: 640, height: 480, check_frozen: false, controls: {{trigger_mode: 1, auto_exposure: 1, exposure_time_absolute: 50}}}}
live: {{calibration: "{dir}/cameras.yaml"}}
trigger: {{source: gpio, chip: sst-trigger, lines: [TRIG0, TRIG1, TRIG2, TRIG3, TRIG4, TRIG5], loopback: LOOP0, rate_hz: 5}}
control: {{socket: "{dir}/sock", group: ""}}
web: {{port: {port}, token_file: "{dir}/hedge.token", zones_file: "{dir}/zones.yaml"}}
storage: {{dir: "{dir}/stored", ring_mb: 192, quota_gb: 2}}
"""


def most_of_windows(mask):
    total = np.pad(mask.astype(np.int32).cumsum(0).cumsum(1), ((1, 0), (1, 0)))
    n = WINDOW
    return (total[n:, n:] - total[:-n, n:] - total[n:, :-n] + total[:-n, :-n]) * 2 > n * n


def write(path, text):
    with open(path, "w") as f:
        f.write(text)


def service(build, sstd, to, port):
    """Command of a service with a configuration of its own."""
    world = f"{to}/world.yaml"
    write(world, "scene: hedge\nstrip: false\n")
    write(f"{to}/sstd.yaml", CONFIG.format(dir=to, port=port))
    subprocess.run([f"{build}/sst-sim", "--parameters", f"{to}/cameras.yaml", "--world", world], check=True, stdout=subprocess.DEVNULL)
    return [f"{build}/sst-sim", "--quiet", "--world", world, "--", sstd, "--config", f"{to}/sstd.yaml"]


class Start:
    def __init__(self, build, port, model, sstd=None):
        self.dir, self.port, self.pictures, self.tracks, self.going = tempfile.mkdtemp(prefix="sst-starts-"), port, [], [], True
        self.log = open(f"{self.dir}/log", "w")
        command = [f"{build}/sst", "demo", "--scene", "hedge", "-o", self.dir, "--port", str(port)]
        self.process = subprocess.Popen(service(build, sstd, self.dir, port) if sstd else command, stdout=self.log, stderr=self.log, start_new_session=True,
                                        env=os.environ | ({"SST_MODELS": model} if model else {}))
        token = f"{self.dir}/hedge.token"
        end = time.time() + 60
        while not (os.path.exists(token) and os.path.getsize(token)):
            if time.time() > end or self.process.poll() is not None:
                raise SystemExit(f"the service did not start; see {self.dir}/log")
            time.sleep(0.2)
        with open(token) as f:
            self.headers = {"Authorization": "Bearer " + f.read().strip()}

    def get(self, path):
        c = http.client.HTTPConnection("127.0.0.1", self.port, timeout=20)
        try:
            c.request("GET", path, headers=self.headers)
            return json.loads(c.getresponse().read())
        finally:
            c.close()

    def view(self):
        """Keep the pictures of the stream, with the time they came."""
        c = http.client.HTTPConnection("127.0.0.1", self.port, timeout=60)
        c.request("GET", "/stream", headers=self.headers)
        answer, data = c.getresponse(), b""
        while self.going:
            more = answer.read1(65536)
            if not more:
                return
            data += more
            while (head := data.find(b"\r\n\r\n")) >= 0:
                size = int(data[:head].split(b"Content-Length: ")[1].split()[0])
                if len(data) < head + 4 + size:
                    break
                self.pictures.append((time.time(), data[head + 4:head + 4 + size]))
                data = data[head + 4 + size:]

    def watch(self):
        """Until a track has come and gone."""
        end, seen = time.time() + PASS_S, 0
        while time.time() < end:
            try:
                self.get("/api/v1/status")
                break
            except (OSError, ValueError):
                time.sleep(0.5)
        threading.Thread(target=self.view, daemon=True).start()
        while time.time() < end and not (seen and time.time() > seen + 8):
            try:
                of = self.get("/api/v1/tracks")
            except (OSError, ValueError):
                of = {}
            found = [t for kind in ("tracks", "unconfirmed") for t in of.get(kind, [])]
            self.tracks.append((time.time(), found))
            seen = time.time() if of.get("tracks") else seen
            time.sleep(ASK_S)
        self.live = self.get("/api/v1/status")["live"]
        self.going = False

    def silhouettes(self):
        """Time, picture, middle, rows of who differs from the pictures' median, away from both sides."""
        pictures = [(t, np.asarray(Image.open(io.BytesIO(j)).convert("RGB")).astype(np.int16)) for t, j in self.pictures]
        usual = np.median(np.stack([p for _, p in pictures[::max(1, len(pictures) // 25)]]), axis=0)
        width = usual.shape[1]
        for t, picture in pictures:
            ys, xs = np.nonzero(most_of_windows((np.abs(picture - usual) > DIFFERS).any(axis=2)))
            if len(ys) < LEAST:
                continue
            middle = np.median(xs)
            ys = ys[np.abs(xs - middle) < REACH * width]
            if SIDES * width < middle < (1 - SIDES) * width:
                yield t, picture, middle, np.count_nonzero(np.bincount(ys) >= ROW) + WINDOW - 1

    def boxes(self, t, middle, width):
        """Of a picture's time, around the passer-by."""
        at = min(self.tracks, key=lambda k: abs(k[0] - t))
        return [b for b in at[1] if abs(at[0] - t) < BOX_S and b["box"][0] - 0.03 * width < middle < b["box"][2] + 0.03 * width]

    def judge(self):
        rows, passes = list(self.silhouettes()), []
        for t, picture, middle, n in rows:
            if not passes or t > passes[-1][-1][0] + APART_S:
                passes.append([])
            passes[-1].append((t, n / (HEIGHT * picture.shape[1]), self.boxes(t, middle, picture.shape[1]), middle / picture.shape[1]))
        passes = [p for p in passes if len(p) >= PASS and abs(p[-1][3] - p[0][3]) >= WALKED and max(at[1] for at in p) >= HALF]
        of = [at for p in passes for at in p]
        heights = [at[1] for at in of] or [0]
        removed = sum(any(b.get("removed") for b in found) for _, found in self.tracks)
        result = {"cut_px": self.live.get("cut_px"), "pictures": len(of), "rows": float(np.median(heights)),
                  "rows_p10": float(np.percentile(heights, 10)), "boxed": sum(bool(at[2]) for at in of) / max(len(of), 1)}
        soon = bool(passes)
        for p in passes:
            box, track = (next((t - p[0][0] for t, _, found, _ in p if any(map(has, found))), np.inf) for has in (bool, lambda b: "state" in b))
            result[f"pass {passes.index(p) + 1} at s"] = f"{p[0][0] - self.pictures[0][0]:.0f} (box {box:.2f}, track {track:.2f})"
            soon = soon and box <= SOON_S
        left = passes[-1][-1][0] if passes else np.inf
        tracked = [t for t, found in self.tracks if any("state" in b for b in found)]
        result |= {"tracked_after_s": max(tracked[-1] - left, 0) if tracked else 0.0, "removed": removed, "sets_s": self.live.get("rate_hz")}
        result["good"] = soon and result["rows"] >= WHOLE and not removed
        return result, [self.cut_out(picture, middle) for _, picture, middle, _ in rows[::max(1, len(rows) // 12)]]

    @staticmethod
    def cut_out(picture, middle):
        half = picture.shape[1] // 8
        left = int(np.clip(middle - half, 0, picture.shape[1] - 2 * half))
        return picture[picture.shape[0] // 3:, left:left + 2 * half].astype(np.uint8)

    def keep(self, to):
        """All pictures, named by milliseconds, and their boxes."""
        os.makedirs(to, exist_ok=True)
        first = self.pictures[0][0]
        for t, jpeg in self.pictures:
            with open(f"{to}/{(t - first) * 1000:06.0f}.jpg", "wb") as f:
                f.write(jpeg)
        write(f"{to}/boxes.json", json.dumps([[round(t - first, 3), found] for t, found in self.tracks]))

    def close(self):
        self.going = False
        os.killpg(self.process.pid, signal.SIGTERM)
        try:
            self.process.wait(20)
        except subprocess.TimeoutExpired:
            os.killpg(self.process.pid, signal.SIGKILL)
        self.log.close()
        shutil.rmtree(self.dir, ignore_errors=True)


def main():
    args = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    args.add_argument("--build", default="build")
    args.add_argument("--starts", type=int, default=20)
    args.add_argument("--port", type=int, default=8471)
    args.add_argument("--model", help="folder of networks")
    args.add_argument("--sstd", metavar="PROGRAM", help="this service instead of the demo")
    args.add_argument("--pictures", help="folder for pictures of each pass, and all pictures and boxes of a start that misses its aim")
    args = args.parse_args()
    good = 0
    for i in range(args.starts):
        start = Start(args.build, args.port, args.model, args.sstd)
        try:
            start.watch()
            r, shown = start.judge()
        finally:
            start.close()
        if args.pictures and shown:
            os.makedirs(args.pictures, exist_ok=True)
            Image.fromarray(np.hstack(shown)).save(f"{args.pictures}/{i:02}.png")
        if args.pictures and not r["good"] and start.pictures:
            start.keep(f"{args.pictures}/{i:02}")
        good += r["good"]
        print(f"start {i}: " + ", ".join(f"{k} {v:.2f}" if isinstance(v, float) else f"{k} {v}" for k, v in r.items()), flush=True)
    print(f"{good} of {args.starts} starts show the passer-by whole, and boxed within {SOON_S} s")
    return good != args.starts


if __name__ == "__main__":
    sys.exit(main())
