#!/usr/bin/env python3
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
"""Measure how long the service takes to stop, in what it may be doing, beside busy loops that want every core.

Each line is a state: the times of its stops in ms, and what the log says of them. After --kill also from the start after
kill -9 to capturing. The service's own times of its parts are in its log (sstd -v)."""
import argparse
import json
import os
import signal
import socket
import statistics
import subprocess
import sys
import time

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import bench_service  # noqa: E402

# Writes and syncs that wait for ever while a file is there: a disk that hangs.
HANG = r"""
#define _GNU_SOURCE
#include <fcntl.h>
#include <stdlib.h>
#include <sys/syscall.h>
#include <unistd.h>
static void wait_while_hung(void) { while (!access(getenv("SST_BENCH_HANG"), F_OK)) usleep(1000); }
ssize_t pwrite(int fd, const void *p, size_t n, off_t at) { wait_while_hung(); return syscall(SYS_pwrite64, fd, p, n, at); }
ssize_t pwrite64(int fd, const void *p, size_t n, off_t at) { return pwrite(fd, p, n, at); }
int fdatasync(int fd) { wait_while_hung(); return (int)syscall(SYS_fdatasync, fd); }
int fsync(int fd) { wait_while_hung(); return (int)syscall(SYS_fsync, fd); }
"""

MORE = """\
rtsp: {{enabled: true, port: {rtsp}}}
hooks: [{{event: "*", run: [/bin/sleep, "1000"]}}]
mqtt: {{enabled: true, host: 127.0.0.1, port: {mqtt}}}
"""


class Service(bench_service.Service):
    """With what may hang: a disk, programs, a broker; more keys in a file of its own."""

    def __init__(self, build, world):
        self.publishers = []
        self.broker = socket.create_server(("127.0.0.1", 0))  # takes connections, says nothing
        with socket.create_server(("127.0.0.1", 0)) as free:
            self.rtsp = free.getsockname()[1]
        super().__init__(build, world, "off", 0)

    def start(self):
        self.hang = os.path.join(self.dir, "hang")
        if os.path.exists(self.hang):
            os.unlink(self.hang)
        if not os.path.exists(os.path.join(self.dir, "hang.so")):
            subprocess.run(["cc", "-shared", "-fPIC", "-x", "c", "-", "-o", os.path.join(self.dir, "hang.so")],
                           input=HANG.encode(), check=True)
            with open(os.path.join(self.dir, "sstd.yaml"), "a") as f:
                f.write(MORE.format(rtsp=self.rtsp, mqtt=self.broker.getsockname()[1]))
        super().start(f'export SST_BENCH_HANG={self.hang} LD_PRELOAD="$LD_PRELOAD${{LD_PRELOAD:+:}}{self.dir}/hang.so";', "-v")
        if not self.publishers:
            self.publishers = [subprocess.Popen([f"{self.build}/sst-{name}", "--config", f"{self.dir}/sstd.yaml"],
                                                stdout=self.log, stderr=self.log) for name in ("rtsp", "mqtt")]

    def close(self):
        for p in self.publishers:
            p.terminate()
            p.wait()
        super().close()

    def post(self, path, body):
        c = bench_service.Unix(os.path.join(self.dir, "c.sock"))
        try:
            c.request("POST", path, json.dumps(body), {"Content-Type": "application/json"})
            return c.getresponse().read()
        finally:
            c.close()

    def readers(self, n, path):
        """Connections that ask for something and then take nothing."""
        held = []
        for _ in range(n):
            s = socket.socket(socket.AF_UNIX)
            s.connect(os.path.join(self.dir, "c.sock"))
            s.sendall(f"GET {path} HTTP/1.1\r\nHost: x\r\n\r\n".encode())
            held.append(s)
        return held


def record(s):
    s.post("/api/v1/record", {"action": "start"})
    s.wait(lambda o: o["storage"]["recording"]["sets"] > 10)


def watch(s):
    viewers = [bench_service.Viewer(os.path.join(s.dir, "c.sock")) for _ in range(10)]
    for v in viewers:
        v.start()
    return viewers


def play(s):
    # Without a picture in time the server refuses: on a busy machine it is asked again.
    player = subprocess.Popen(["sh", "-c", "until ffmpeg -nostdin -loglevel quiet -rtsp_transport tcp -i "
                               f"rtsp://127.0.0.1:{s.rtsp}/main -f null -; do sleep 1; done"], start_new_session=True)
    s.wait(lambda o: o["clients"]["rtsp"] > 0, 300)
    return [player]


def hang_disk(s):
    record(s)
    open(s.hang, "w").close()
    time.sleep(1)


def export(s):
    record(s)
    s.post("/api/v1/record", {"action": "stop"})
    at = s.get("/api/v1/recordings")["recordings"][-1]["from"]
    held = []
    for _ in range(4):
        k = socket.socket(socket.AF_UNIX)
        k.connect(os.path.join(s.dir, "c.sock"))
        body = json.dumps({"time": at}).encode()
        k.sendall(b"POST /api/v1/export HTTP/1.1\r\nHost: x\r\nContent-Type: application/json\r\nContent-Length: %d\r\n\r\n"
                  % len(body) + body)
        held.append(k)
    time.sleep(0.1)
    return held


def download(s):
    record(s)
    s.post("/api/v1/record", {"action": "stop"})
    s.wait(lambda o: not o["storage"]["recording"]["active"])
    name = s.get("/api/v1/recordings")["recordings"][-1]["name"]
    return s.readers(8, f"/api/v1/download/{name}.tar") + s.readers(4, f"/api/v1/download/{name}.r0c0.mkv")


def everything(s):
    held = download(s)
    record(s)
    return held + watch(s) + play(s)


STATES = {"idle": lambda s: None, "ten viewers": watch, "recording": record, "RTSP client": play, "disk hangs": hang_disk,
          "exporting": export, "downloads that stand": download, "all of it": everything}


def said(s, at):
    """What the log says of a stop: times of the parts, and warnings."""
    with open(os.path.join(s.dir, "log"), errors="replace") as f:
        f.seek(at)
        return [x.strip() for x in f if "stopped" in x or "ending" in x or "hang" in x or "does not answer" in x]


def main():
    p = argparse.ArgumentParser(description=__doc__)
    p.add_argument("--build", default="build")
    p.add_argument("--world", default="pedestrian")
    p.add_argument("--load", type=int, default=12, help="busy loops")
    p.add_argument("--times", type=int, default=3, help="stops in each state")
    p.add_argument("--kill", action="store_true", help="kill it as well, and tell how soon it captures again")
    p.add_argument("--states", default=",".join(STATES))
    args = p.parse_args()
    s = Service(os.path.abspath(args.build), args.world)
    s.wait(lambda o: o["live"]["ready"], 600)
    s.stop()
    loops = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(args.load)]
    took_all, again = [], []
    try:
        for state in args.states.split(","):
            took = []
            for _ in range(args.times):
                s.start()
                s.wait(lambda o: o["state"] == "capturing" and o["live"]["ready"], 300)
                time.sleep(1)
                held = STATES[state](s)
                time.sleep(0.5)
                s.log.flush()
                at = os.path.getsize(os.path.join(s.dir, "log"))
                took.append(1e3 * s.stop())
                for text in said(s, at):
                    print("   ", text)
                for h in held or []:
                    if isinstance(h, subprocess.Popen):
                        os.killpg(h.pid, signal.SIGKILL)
                        h.wait()
                    elif isinstance(h, socket.socket):
                        h.close()
            took_all += took
            print(f"{state:22} {' '.join(f'{t:6.0f}' for t in took)}", flush=True)
        for _ in range(args.times if args.kill else 0):
            s.start()
            s.wait(lambda o: o["state"] == "capturing", 300)
            record(s)
            os.kill(s.pid, signal.SIGKILL)
            s.shell.wait()
            start = time.monotonic()
            s.start()
            s.wait(lambda o: o["state"] == "capturing", 300)
            again.append(time.monotonic() - start)
            s.stop()
    finally:
        for x in loops:
            x.kill()
        if os.path.exists(f"/proc/{s.pid}"):
            s.fault()
        s.close()
    print(f"{len(took_all)} stops beside {args.load} busy loops: median {statistics.median(took_all):.0f} ms, "
          f"at most {max(took_all):.0f} ms")
    if again:
        print(f"from the start after kill -9 to capturing: median {statistics.median(again):.1f} s, at most {max(again):.1f} s")
    for root, _, files in os.walk(os.path.join(s.dir, "store")):
        bad = [f for f in files if f == "recording.json" and
               subprocess.run([f"{s.build}/sst", "recording", root, "--verify"], stdout=subprocess.DEVNULL).returncode]
        if bad:
            print(f"{root} is damaged")


if __name__ == "__main__":
    main()
