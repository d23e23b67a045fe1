#!/usr/bin/env python3
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
"""The passer-by in the clear live picture of `sst demo --scene hedge`, start after start: bench_starts.py [--starts N]

Each start runs until a walker has passed behind the hedge. Columns of its line: the automatic cut; pictures of the pass with the passer-by
away from both sides; the rows in which the passer-by differs from the pictures without anybody, as a share of the passer-by's (median, and
tenth percentile); the share of these pictures at whose time a track has a box there; pictures in which a track was removed. Figures of an idle
machine; ends with 1 if a start misses the passer-by, shows less than WHOLE of the rows, or boxes none.
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
PASS_S = 150     # until somebody has passed


def most_of_windows(mask):
    total = np.pad(mask.astype(np.int32).cumsum(0).cumsum(1), ((1, 0), (1, 0)))
    n = WINDOW
    return (total[n:, n:] - total[:-n, n:] - total[n:, :-n] + total[:-n, :-n]) * 2 > n * n


class Start:
    def __init__(self, build, port, model):
        self.dir, self.port, self.pictures, self.tracks, self.going = tempfile.mkdtemp(prefix="sst-starts-"), port, [], [], True
        self.log = open(f"{self.dir}/log", "w")
        self.process = subprocess.Popen([f"{build}/sst", "demo", "--scene", "hedge", "-o", self.dir, "--port", str(port)],
                                        stdout=self.log, stderr=self.log, start_new_session=True,
                                        env=os.environ | ({"SST_MODELS": model} if model else {}))
        token = f"{self.dir}/hedge.token"
        end = time.time() + 60
        while not (os.path.exists(token) and os.path.getsize(token)):
            if time.time() > end or self.process.poll() is not None:
                raise SystemExit(f"the demo did not start; see {self.dir}/log")
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
                found = [t for t in self.get("/api/v1/tracks")["tracks"] if t.get("box")]
            except (OSError, ValueError, KeyError):
                found = []
            self.tracks.append((time.time(), found))
            seen = time.time() if found else seen
            time.sleep(0.25)
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

    def judge(self):
        rows = list(self.silhouettes())
        heights = [n / (HEIGHT * picture.shape[1]) for _, picture, _, n in rows] or [0]
        boxed = 0
        for t, picture, middle, _ in rows:
            w = picture.shape[1]
            at = min(self.tracks, key=lambda k: abs(k[0] - t))
            boxed += abs(at[0] - t) < BOX_S and any(b["box"][0] - 0.03 * w < middle < b["box"][2] + 0.03 * w for b in at[1])
        removed = sum(any(b.get("removed") for b in found) for _, found in self.tracks)
        result = {"cut_px": self.live.get("cut_px"), "pictures": len(rows), "rows": float(np.median(heights)),
                  "rows_p10": float(np.percentile(heights, 10)), "boxed": boxed / max(len(rows), 1), "removed": removed,
                  "sets_s": self.live.get("rate_hz")}
        result["good"] = bool(rows) and result["rows"] >= WHOLE and boxed > 0 and not removed
        return result, [self.cut_out(picture, middle) for _, picture, middle, _ in rows[::max(1, len(rows) // 12)]]

    @staticmethod
    def cut_out(picture, middle):
        half = picture.shape[1] // 8
        left = int(np.clip(middle - half, 0, picture.shape[1] - 2 * half))
        return picture[picture.shape[0] // 3:, left:left + 2 * half].astype(np.uint8)

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
    args.add_argument("--pictures", help="folder for pictures of each pass")
    args = args.parse_args()
    good = 0
    for i in range(args.starts):
        start = Start(args.build, args.port, args.model)
        try:
            start.watch()
            r, shown = start.judge()
        finally:
            start.close()
        if args.pictures and shown:
            os.makedirs(args.pictures, exist_ok=True)
            Image.fromarray(np.hstack(shown)).save(f"{args.pictures}/{i:02}.png")
        good += r["good"]
        print(f"start {i}: " + ", ".join(f"{k} {v:.2f}" if isinstance(v, float) else f"{k} {v}" for k, v in r.items()), flush=True)
    print(f"{good} of {args.starts} starts show the passer-by whole and boxed")
    return good != args.starts


if __name__ == "__main__":
    sys.exit(main())
