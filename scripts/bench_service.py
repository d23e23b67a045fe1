#!/usr/bin/env python3
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
"""Measure the service on simulated arrays: rate, latency, processor time, memory; writes docs/measured/bench-service.md.

The processor time of the simulation is that of its own process, and reported apart. With --soak MINUTES instead: faults are set and
taken back at random, and the slope of memory is fitted."""
import argparse
import http.client
import json
import os
import random
import signal
import socket
import statistics
import subprocess
import tempfile
import threading
import time

CONFIG = """\
array: {{rows: 6, cols: 6}}
cameras:
  check_frozen: false
  controls: {{trigger_mode: 1, auto_exposure: 1, exposure_time_absolute: 50}}
trigger: {{source: gpio, chip: sst-trigger, lines: [TRIG0, TRIG1, TRIG2, TRIG3, TRIG4, TRIG5], loopback: LOOP0, rate_hz: {hz:g}}}
control: {{socket: {dir}/c.sock, group: ""}}
web: {{port: 0, token_file: {dir}/token}}
storage: {{dir: {dir}/store, ring_mb: 192, mode: {mode}, quota_gb: {quota}, min_free_gb: 0.5}}
live: {{rate_hz: {rate}}}
"""

FAST_HZ = 20  # more sets than two cores process


class Unix(http.client.HTTPConnection):
    def __init__(self, path):
        super().__init__("localhost", timeout=20)
        self.path = path

    def connect(self):
        self.sock = socket.socket(socket.AF_UNIX)
        self.sock.settimeout(self.timeout)
        self.sock.connect(self.path)


class Viewer(threading.Thread):
    """Reads a moving picture for as long as it comes."""

    def __init__(self, path):
        super().__init__(daemon=True)
        self.path, self.pictures, self.going = path, 0, True

    def run(self):
        try:
            c = Unix(self.path)
            c.request("GET", "/stream")
            r = c.getresponse()
            tail = b""
            while self.going:
                data = r.read1(65536)
                if not data:
                    break
                data = tail + data
                self.pictures += data.count(b"\r\nContent-Type: image/jpeg")
                tail = data[-32:] if b"\r\nContent-Type: image/jpeg" not in data[-32:] else b""
            c.close()
        except OSError:
            pass


class Service:
    def __init__(self, build, world, mode="off", rate=0, hz=10):
        self.build, self.dir = build, tempfile.mkdtemp(prefix="sst-bench-")
        self.session = os.path.join(self.dir, "session")
        with open(os.path.join(self.dir, "sstd.yaml"), "w") as f:
            f.write(CONFIG.format(dir=self.dir, mode=mode, rate=rate, hz=hz, quota=1 if hz <= 10 else 4))
        self.log = open(os.path.join(self.dir, "log"), "w")
        self.sim = subprocess.Popen([f"{build}/sst-sim", "--quiet", "--world", world, "--serve", self.session],
                                    stdout=self.log, stderr=self.log)
        while subprocess.run([f"{build}/sst-sim", "fault", "--dir", self.session, "--list"], stdout=subprocess.DEVNULL,
                             stderr=subprocess.DEVNULL).returncode:
            time.sleep(0.5)
        self.start()

    def start(self, setup="", options=""):
        """Start sstd with more options, after commands of the shell that become it."""
        pid_file = os.path.join(self.dir, "pid")
        if os.path.exists(pid_file):
            os.unlink(pid_file)
        self.shell = subprocess.Popen([f"{self.build}/sst-sim", "--quiet", "--join", self.session, "--", "sh", "-c",
                                       f'echo $$ >{pid_file}; {setup} exec "$0" {options} --config {self.dir}/sstd.yaml',
                                       f"{self.build}/sstd"], stdout=self.log, stderr=self.log)
        while not os.path.exists(pid_file) or not os.path.getsize(pid_file):
            time.sleep(0.02)
        self.pid = int(open(pid_file).read())

    def get(self, path="/api/v1/status"):
        c = Unix(os.path.join(self.dir, "c.sock"))
        try:
            c.request("GET", path)
            return json.loads(c.getresponse().read())
        finally:
            c.close()

    def wait(self, test, seconds=120):
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            try:
                if test(self.get()):
                    return
            except (OSError, ValueError, KeyError, http.client.HTTPException):
                pass
            time.sleep(0.05)
        raise SystemExit(f"the service did not come up; see {self.dir}/log")

    def fault(self, *faults):
        subprocess.run([f"{self.build}/sst-sim", "fault", "--dir", self.session, *faults], check=False,
                       stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)

    def stop(self):
        start = time.monotonic()
        os.kill(self.pid, signal.SIGTERM)
        while os.path.exists(f"/proc/{self.pid}/exe") and not self.ended():
            time.sleep(0.005)
        took = time.monotonic() - start
        self.shell.wait()
        return took

    def ended(self):
        try:
            return open(f"/proc/{self.pid}/stat").read().rsplit(")", 1)[1].split()[0] == "Z"
        except OSError:
            return True

    def close(self):
        self.sim.terminate()
        self.sim.wait()
        self.log.close()


def cpu_s(pid):
    """Seconds of processor time of a process, by the names of its threads; threads that ended count in the sum."""
    tick = os.sysconf("SC_CLK_TCK")
    fields = open(f"/proc/{pid}/stat").read().rsplit(")", 1)[1].split()
    by_name = {}
    for t in os.listdir(f"/proc/{pid}/task"):
        try:
            text = open(f"/proc/{pid}/task/{t}/stat").read()
        except OSError:
            continue
        name, rest = text.split("(", 1)[1].rsplit(")", 1)
        f = rest.split()
        by_name[name] = by_name.get(name, 0) + (int(f[11]) + int(f[12])) / tick
    return (int(fields[11]) + int(fields[12])) / tick, by_name


def rss_mb(pid):
    return int(open(f"/proc/{pid}/statm").read().split()[1]) * os.sysconf("SC_PAGESIZE") / 1e6


def measure(s, seconds, viewers=1):
    """Watch for a while: what the service says, and what it takes."""
    watching = [Viewer(os.path.join(s.dir, "c.sock")) for _ in range(viewers)]
    for v in watching:
        v.start()
    time.sleep(5)
    before, sim_before, t = cpu_s(s.pid), cpu_s(s.sim.pid)[0], time.monotonic()
    sets, seen = s.get()["live"]["sets"], [v.pictures for v in watching]
    idle = s.get()["live"]["idle"]
    time.sleep(seconds)
    after, sim_after, t = cpu_s(s.pid), cpu_s(s.sim.pid)[0], time.monotonic() - t
    status = s.get()
    # Threads of the live picture come and go: it has what the others, which stay, have not.
    others = sum(after[1][n] - before[1].get(n, 0) for n in after[1] if n != "sst-live")
    live = after[0] - before[0] - others
    out = {
        "rate": (status["live"]["sets"] - sets) / t, "idle": (status["live"]["idle"] - idle) / t,
        "capture": status["capture"]["rate_hz"], "p50": status["live"]["latency_ms"]["p50"],
        "p99": status["live"]["latency_ms"]["p99"], "cpu": 100 * (after[0] - before[0]) / t,
        "sim": 100 * (sim_after - sim_before) / t, "changed": status["live"]["changed_percent"],
        "stages": {k: v["p50"] for k, v in status["live"]["stages_ms"].items()}, "rss": rss_mb(s.pid),
        "seen": statistics.median((v.pictures - n) / t for v, n in zip(watching, seen)) if watching else 0,
        "complete": 100 * status["capture"]["complete"] / max(1, status["capture"]["sets"]),
        "threads": {n: 100 * (after[1][n] - before[1].get(n, 0)) / t for n in after[1]}, "live": 100 * live / t,
        "error": {k: v["error"] for k, v in status["live"]["skips"].items()},
    }
    for v in watching:
        v.going = False
    return out


def first_picture_ms(s):
    """Time from the request of a viewer, after a while without any, to the end of the first picture."""
    c, data, start = Unix(os.path.join(s.dir, "c.sock")), b"", time.monotonic()
    c.request("GET", "/stream")
    r = c.getresponse()
    while b"\xff\xd9" not in data:
        data += r.read1(65536)
    took = time.monotonic() - start
    r.close()
    c.close()
    return 1e3 * took


def measure_alone(s, seconds):
    """What the service takes without viewers, and the first pictures of those who come then."""
    time.sleep(6)  # a picture that was asked for is made for 5 s
    r, first = measure(s, seconds, 0), []
    for _ in range(5):
        first.append(first_picture_ms(s))
        time.sleep(12)
    return r, first


def report(rows, viewers, alone, times, out, hz):
    with open(out, "w") as f:
        f.write("# The service, measured\n\n"
                f"36 simulated cameras of 640x480 (MJPEG, trigger at {hz:g} Hz unless named), service and simulation on the same two cores, by\n"
                "`make bench-service`. Processor time in percent of one core; the simulation is counted apart and not in the\n"
                "service's. Latency is from the trigger's edge to the encoded picture. One viewer.\n\n"
                "| world | sets/s processed | pictures/s seen | latency p50, p99 (ms) | tiles changed | service | of it the live "
                "picture | simulation | memory |\n|---|---|---|---|---|---|---|---|---|\n")
        for name, r in rows:
            f.write(f"| {name} | {r['rate']:.1f} | {r['seen']:.1f} | {r['p50']:.0f}, {r['p99']:.0f} | {r['changed']:.0f} % | "
                    f"{r['cpu']:.0f} % | {r['live']:.0f} % | {r['sim']:.1f} % | {r['rss']:.0f} MB |\n")
        f.write("\nWhere the time goes, median ms of a set that changed something:\n\n| world | "
                + " | ".join(rows[0][1]["stages"]) + " |\n|---|" + "---|" * len(rows[0][1]["stages"]) + "\n")
        for name, r in rows:
            f.write(f"| {name} | " + " | ".join(f"{v:.1f}" for v in r["stages"].values()) + " |\n")
        f.write(f"\n10 viewers of the stream instead of none, still scene: {viewers[1]['cpu'] - viewers[0]['cpu']:+.1f} % of one core; "
                f"pedestrian: {viewers[3]['cpu'] - viewers[2]['cpu']:+.1f} % at {viewers[3]['seen']:.1f} pictures/s each against "
                f"{viewers[2]['rate']:.1f} sets/s with one viewer and {viewers[3]['rate']:.1f} with ten.\n\n"
                "Without viewers (one view is watched for motion, all is brought up to date every 5 s), and the time until the "
                "first picture of a viewer who comes then, median and longest of 5: "
                + "; ".join(f"{name} {r['cpu']:.0f} % of one core, {statistics.median(first):.0f} and {max(first):.0f} ms"
                            for name, (r, first) in alone) + ".\n\n"
                f"Stopping, median of {len(times['stop'])}: {1e3 * statistics.median(times['stop']):.0f} ms, at most "
                f"{1e3 * max(times['stop']):.0f} ms. From the start after `kill -9` to capturing, median of "
                f"{len(times['again'])}: {statistics.median(times['again']):.1f} s, at most {max(times['again']):.1f} s.\n")


def bench(args):
    rows, viewers, alone, times = [], [], [], {"stop": [], "again": []}
    worlds = [("still, noisy cameras", "simulators/scene/world/worlds/still.yaml"), ("pedestrian", "pedestrian"), ("bush", "bush")]
    worlds = [(*w, args.trigger_hz) for w in worlds if not args.only or w[0].startswith(args.only)]
    if not args.only:  # as many as the machine allows
        worlds += [(f"{name}, trigger at {FAST_HZ} Hz", name, FAST_HZ) for name in ("pedestrian", "bush")]
    for name, world, hz in worlds:
        s = Service(args.build, world, hz=hz)
        s.wait(lambda o: o["live"]["ready"], 600)
        time.sleep(15)  # the background settles
        r = measure(s, args.seconds)
        rows.append((name, r))
        print(name, json.dumps(r), flush=True)
        if args.only or hz != args.trigger_hz:
            s.stop()
            s.close()
            continue
        if name != "bush":
            viewers.append(measure(s, args.seconds / 2, 0 if name.startswith("still") else 1))
            viewers.append(measure(s, args.seconds / 2, 10))
        alone.append((name, measure_alone(s, args.seconds / 2)))
        print(name, "without viewers", alone[-1][1][0]["cpu"], alone[-1][1][1], flush=True)
        for _ in range(3):
            os.kill(s.pid, signal.SIGKILL)
            s.shell.wait()
            start = time.monotonic()
            s.start()
            s.wait(lambda o: o["state"] == "capturing")
            times["again"].append(time.monotonic() - start)
            time.sleep(2)
            times["stop"].append(s.stop())
            s.start()
            s.wait(lambda o: o["state"] == "capturing")
        s.stop()
        s.close()
    if not args.only:
        report(rows, viewers, alone, times, args.output, args.trigger_hz)


def soak(args):
    random.seed(1)
    s = Service(args.build, args.world, "continuous", args.rate)
    s.wait(lambda o: o["live"]["ready"], 600)
    viewers = [Viewer(os.path.join(s.dir, "c.sock")) for _ in range(2)]
    for v in viewers:
        v.start()
    begin, samples, told, faults = time.monotonic(), [], 0, 0
    kinds = ["unplug=1", "eio=0.2", "corrupt_mid=0.3", "truncated=0.3", "late_ms=80", "duplicate=0.2"]
    while time.monotonic() - begin < 60 * args.soak:
        cam, kind = random.randrange(36), random.choice(kinds)
        chip = random.random() < 0.05
        what = "gpio.vanish=1" if chip else f"camera.{cam}.{kind}"
        s.fault(what)
        time.sleep(random.uniform(1, 4))
        s.fault(what.split("=")[0] + "=0")
        faults += 1
        time.sleep(random.uniform(1, 4))
        o = s.get()
        samples.append((time.monotonic() - begin, rss_mb(s.pid), len(os.listdir(f"/proc/{s.pid}/fd"))))
        if samples[-1][0] - told > 60:
            told = samples[-1][0]
            print(f"{told / 60:5.1f} min  {o['state']:10} {samples[-1][1]:.1f} MB  {samples[-1][2]} descriptors  "
                  f"{o['live']['rate_hz']:.1f} sets/s  {o['storage']['state']}  {faults} faults", flush=True)
    for v in viewers:
        v.going = False
    time.sleep(10)
    s.wait(lambda o: o["state"] == "capturing")
    o = s.get()
    late = [x for x in samples if x[0] > samples[-1][0] / 3]  # after everything was touched once
    mean_t, mean_m = statistics.mean(x[0] for x in late), statistics.mean(x[1] for x in late)
    over = sum((x[0] - mean_t) ** 2 for x in late)
    slope = sum((x[0] - mean_t) * (x[1] - mean_m) for x in late) / over
    rest = sum((x[1] - mean_m - slope * (x[0] - mean_t)) ** 2 for x in late)
    error = (rest / max(1, len(late) - 2) / over) ** 0.5  # of the slope, standard
    heights = sorted(x[1] for x in late)
    # Memory goes up and down with the background's work, for minutes: what grows shows in the lows.
    parts = {}
    for x in samples:
        parts.setdefault(int(x[0] // 300), []).append(x[1])
    c = o["capture"]
    print(f"{faults} faults; memory {heights[0]:.1f} .. {heights[-1]:.1f} MB in the last two thirds, median "
          f"{statistics.median(heights):.1f}, slope {slope * 3600:+.2f} MB/h, standard error {error * 3600:.2f}, "
          f"least of each 5 minutes {', '.join(f'{min(m):.0f}' for m in parts.values())}; descriptors {min(x[2] for x in late)}..{max(x[2] for x in late)}; "
          f"{c['sets']} sets, {c['complete']} complete, {c['frames']['unexplained']} frames unexplained; "
          f"live {o['live']['sets']} sets, latency p99 {o['live']['latency_ms']['p99']:.0f} ms")
    print(f"stop: {1e3 * s.stop():.0f} ms")
    s.close()


def main():
    p = argparse.ArgumentParser(description=__doc__)
    p.add_argument("--build", default="build")
    p.add_argument("--seconds", type=float, default=30)
    p.add_argument("--trigger-hz", type=float, default=10, help="sets per second that the cameras take")
    p.add_argument("--output", default="docs/measured/bench-service.md")
    p.add_argument("--only", choices=["still", "pedestrian", "bush"], help="measure this world alone and print it; no page")
    p.add_argument("--soak", type=float, help="minutes")
    p.add_argument("--world", default="pedestrian")
    p.add_argument("--rate", type=float, default=0, help="of the live picture in a soak; 0: as the machine allows")
    args = p.parse_args()
    args.build = os.path.abspath(args.build)
    if args.soak:
        soak(args)
    else:
        bench(args)


if __name__ == "__main__":
    main()
