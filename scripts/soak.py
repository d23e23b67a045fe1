#!/usr/bin/env python3
"""Run the simulated array for long and watch the capture: frames, processor time, memory, descriptors, skew.

Prints one JSON object and ends with 1 where a bar is missed. Everything is measured from outside: /proc of the capturing
process, its own account, and the simulation's log of what it really did.
"""
import argparse
import json
import os
import random
import subprocess
import sys
import tempfile
import threading
import time

CONFIG = """array: {{ rows: 6, cols: 6, spacing_mm: 40 }}
cameras:
  rate_hz: 30
  controls: {{ auto_exposure: 1, exposure_time_absolute: 50, trigger_mode: 1 }}
trigger:
  source: gpio
  chip: sst-trigger
  lines: [TRIG0, TRIG1, TRIG2, TRIG3, TRIG4, TRIG5]
  loopback: LOOP0
  rate_hz: {rate}
"""
# Exposures that differ from camera to camera and from frame to frame, so that there is skew to be told.
WORLD = """scene: pedestrian
timing:
  delay_us: 100
  delay_spread_us: 40
  jitter_us: 15
  latency_spread_us: 800
"""
TICK = os.sysconf("SC_CLK_TCK")


def sample(pid):
    with open(f"/proc/{pid}/stat") as f:
        fields = f.read().rsplit(")", 1)[1].split()
    with open(f"/proc/{pid}/status") as f:
        status = {line.split(":")[0]: int(line.split()[1]) for line in f if line.endswith("kB\n")}
    # Buffers in shared memory are the simulated kernel's; what the program itself holds is anonymous.
    return {"t": time.monotonic(), "cpu": (int(fields[11]) + int(fields[12])) / TICK,
            "own_kb": status["RssAnon"],
            "descriptors": len(os.listdir(f"/proc/{pid}/fd"))}


def slope(points):
    """Least squares, per second; 0 of fewer than two points."""
    n = len(points)
    mx = sum(x for x, _ in points) / n
    my = sum(y for _, y in points) / n
    over = sum((x - mx) ** 2 for x, _ in points)
    return sum((x - mx) * (y - my) for x, y in points) / over if over else 0.0


def disturb(options, stop, seed):
    """Random faults, one at a time; each is taken back."""
    kinds = ["corrupt_mid=0.3", "truncated=0.3", "error_flag=0.3", "gap=0.3", "duplicate=0.3", "eio=0.05", "unplug=1",
             "late_ms=40", "frozen=0.5"]
    rng = random.Random(seed)
    while not stop.wait(rng.uniform(1, 4)):
        name, value = rng.choice(kinds).split("=")
        cam = rng.randrange(36)
        for v in (value, "0"):
            subprocess.run([options.sim, "fault", "--dir", options.session, f"camera.{cam}.{name}={v}"], check=False)
            if stop.wait(rng.uniform(0.5, 3)) and v == "0":
                break


def skew_error_ns(recording, truth):
    """Largest difference between the spread that the recording tells and that of the true exposures."""
    true = {}  # V4L2 stamps are whole microseconds
    with open(truth) as f:
        for line in f:
            e = json.loads(line)
            if "stamp_ns" in e:
                true[e["camera"], e["stamp_ns"] // 1000] = e["t_ns"]
    worst = sets = 0
    widest = 0
    with open(os.path.join(recording, "sets.jsonl")) as f:
        for line in f:
            s = json.loads(line)
            if "frames" not in s:
                continue  # a run of the recorder begins
            at = [true[frame[0], (s["t_ns"] + frame[3]) // 1000] for frame in s["frames"]]
            if len(at) > 1:
                spread = max(at) - min(at)
                worst = max(worst, abs(spread - s["spread_ns"]))
                widest = max(widest, spread)
                sets += 1
    return {"sets": sets, "widest_us": widest / 1e3, "worst_error_us": worst / 1e3}


def run(options):
    config, truth = os.path.join(options.out, "array.yaml"), os.path.join(options.out, "truth.jsonl")
    stats, recording = os.path.join(options.out, "sim.json"), os.path.join(options.out, "soak.rec")
    if not options.world:
        options.world = os.path.join(options.out, "world.yaml")
        with open(options.world, "w") as f:
            f.write(WORLD)
    with open(config, "w") as f:
        f.write(CONFIG.format(rate=options.rate))
    command = [options.sim, "--truth", truth, "--stats", stats]
    command += ["--world", options.world, "--serve", options.session]
    with open(os.path.join(options.out, "sim.log"), "w") as log:
        sim = subprocess.Popen(command, stderr=log)
    deadline = time.monotonic() + 300
    while subprocess.run([options.sim, "status", "--dir", options.session], capture_output=True).returncode:
        if time.monotonic() > deadline or sim.poll() is not None:
            sys.exit("the simulation did not start: see sim.log in " + options.out)
        time.sleep(0.5)
    with open(os.path.join(options.out, "capture.log"), "w") as log:
        capture = subprocess.Popen([options.sim, "--join", options.session, "--", options.sst, "capture", "array",
                                    "--config", config, "-o", recording, "--json", "--quiet", "-n",
                                    str(round(options.seconds * options.rate))],
                                   stdout=subprocess.PIPE, stderr=log, text=True)
    stop = threading.Event()
    if options.faults:
        threading.Thread(target=disturb, args=(options, stop, options.seed), daemon=True).start()
    samples, out = [], []
    reader = threading.Thread(target=lambda: out.append(capture.stdout.read()))
    reader.start()
    while capture.poll() is None:
        try:
            with open(f"/proc/{capture.pid}/comm") as f:
                if f.read().strip() == "sst":  # sst-sim --join becomes it
                    samples.append(sample(capture.pid))
        except OSError:
            pass
        time.sleep(1 if options.seconds < 100 else 5)
        if time.monotonic() > deadline + 2 * options.seconds:
            capture.kill()
    stop.set()
    reader.join()
    subprocess.run([options.sim, "stop", "--dir", options.session], check=False)
    sim.wait(30)
    if capture.returncode != 0 or not out[0].strip():
        sys.exit(f"capture ended with {capture.returncode}: see capture.log in {options.out}")
    account = json.loads(out[0])
    with open(stats) as f:
        simulation = json.load(f)
    warm = [s for s in samples if s["t"] - samples[0]["t"] > 0.1 * options.seconds] or samples
    hours = [(s["t"] / 3600, s) for s in warm]
    result = {
        "seconds": round(warm[-1]["t"] - samples[0]["t"], 1),
        "sets": account["sets"], "complete": account["complete"], "unexplained": account["frames"]["unexplained"],
        "lost_by_driver": account["frames"]["lost_by_driver"], "buckets": account["frames"]["buckets"],
        "edges": account["trigger"], "megabytes": round(account["bytes"] / 1e6, 1),
        "capture_cores": round((warm[-1]["cpu"] - samples[0]["cpu"]) / (warm[-1]["t"] - samples[0]["t"]), 4),
        "simulation": simulation,
        "memory_mb": [round(s["own_kb"] / 1024, 2) for s in (warm[0], warm[-1])],
        "memory_mb_per_hour": round(slope([(h, s["own_kb"] / 1024) for h, s in hours]), 3),
        "descriptors": sorted({s["descriptors"] for s in warm}),
        "skew": skew_error_ns(recording, truth), "told_skew": account["skew"], "recovery": account["recovery"],
        "devices_lost": account["devices_lost"], "devices_found": account["devices_found"],
    }
    good = result["unexplained"] == 0 and result["capture_cores"] < 1 and result["skew"]["worst_error_us"] <= 1
    if not options.faults:
        good = good and result["complete"] == result["sets"]
    return result, good


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--build", default="build")
    parser.add_argument("--seconds", type=float, default=600)
    parser.add_argument("--rate", type=float, default=10)
    parser.add_argument("--world", help="default: the pedestrian, with timing that differs between cameras")
    parser.add_argument("--faults", action="store_true", help="disturb the cameras at random")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--keep", help="folder for the recording and logs; else they go")
    options = parser.parse_args()
    options.sst = os.path.abspath(os.path.join(options.build, "sst"))
    options.sim = os.path.abspath(os.path.join(options.build, "sst-sim"))
    with tempfile.TemporaryDirectory(prefix="sst-soak-") as tmp:
        options.out = options.keep or tmp
        os.makedirs(options.out, exist_ok=True)
        options.session = os.path.join(tmp, "session")
        result, good = run(options)
    print(json.dumps(result, indent=1))
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
