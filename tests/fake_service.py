#!/usr/bin/python3
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
"""A service that answers as docs/integrate/api.md says, on a UNIX socket: for tests of its clients.

fake_service.py SOCKET [TCP_PORT_FILE]; what it was told goes to SOCKET.log, a line of JSON each. The file SOCKET.mode
changes what it does: refuse, hang, stalled, garbage, other, huge, cut, torn, failed,
evil.
"""
import json
import os
import socket
import socketserver
import sys
import time
from http.server import BaseHTTPRequestHandler

SOCKET = sys.argv[1]
TOKEN = "fake-token"
JPEG = b"\xff\xd8fake picture\xff\xd9"

STATUS = {
    "version": "0.1.0", "state": "degraded", "reason": "35 of 36 cameras", "uptime_s": 93784.5,
    "time": "2026-11-21T18:05:00.123Z",
    "capture": {"cameras": 36, "present": 35, "rate_hz": 10.0, "sets": 1000, "complete": 990, "dropped": 3, "refused": 0,
                "trigger": {"source": "gpio", "edges": 1000, "stamped": 1000, "skipped": 0},
                "frames": {"delivered": 36000, "set": 35988, "late": 5, "duplicate": 0, "stray": 0, "corrupt": 7,
                           "flagged": 0, "dropped": 0, "unexplained": 0},
                "skew_us": {"p50": 110, "p99": 180, "max": 1220, "limit": 1000, "worst": "r3c2", "over": 2}},
    "live": {"enabled": True, "ready": True, "settling": False, "rate_hz": 6.1, "sets": 75, "dropped": 45, "idle": 0,
             "changed_percent": 14.2, "latency_ms": {"p50": 210, "p99": 300, "max": 320}, "focus_px": 7.8},
    "storage": {"state": "LOW", "reason": "old recordings are being removed", "dir": "/var/lib/sst",
                "free_bytes": 4.1e11, "used_bytes": 9.94e10, "quota_bytes": 1e11, "oldest": "2026-11-21T17:00:00Z",
                "recordings": 2, "removed": 1,
                "recording": {"mode": "event", "active": True, "name": "2026-11-21T18-04-00Z", "why": "motion in door",
                              "since": "2026-11-21T18:04:00Z", "sets": 600, "dropped": 0}},
    "clients": {"http": 1, "streams": 2, "listeners": 1, "rtsp": 0, "requests": 9, "refused": 0},
    "process": {"rss_bytes": 5.2e8, "cpu_percent": 110.0, "descriptors": 120},
}


def cameras():
    found = []
    for row in range(6):
        for col in range(6):
            gone = (row, col) == (0, 5)
            found.append({"name": f"r{row}c{col}", "row": row, "col": col, "state": "absent" if gone else "streaming",
                          "serial": f"SIM{row * 6 + col:04d}", "port": f"1-1.{col + 1}", "frames": 120, "bad": 1,
                          "lost": 0, "rate_hz": 0.0 if gone else 10.0, "reason": "unplugged" if gone else ""})
    return {"rows": 6, "cols": 6, "cameras": found}


EVENTS = [{"id": i, "time": f"2026-11-21T18:05:{i:02d}.000Z", "level": "warning" if i % 5 == 0 else "info",
           "type": "camera-lost" if i % 5 == 0 else "camera-found", "message": f"camera r0c5: event {i}",
           "data": {"row": 0, "col": 5}} for i in range(1, 31)]


looks = [0]


class Handler(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"

    def log_message(self, *args):
        pass

    def address_string(self):
        return "unix"

    def send(self, code, body, kind="application/json"):
        data = body if isinstance(body, bytes) else json.dumps(body).encode()
        self.send_response(code)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(len(data)))
        self.end_headers()
        self.wfile.write(data)

    def chunk(self, data):
        self.wfile.write(b"%x\r\n%s\r\n" % (len(data), data))
        self.wfile.flush()

    def mode(self):
        try:
            return open(SOCKET + ".mode", encoding="utf8").read().strip()
        except OSError:
            return ""

    def common(self, body):
        """Answered, or told, whatever is asked?"""
        with open(SOCKET + ".log", "a", encoding="utf8") as log:
            log.write(json.dumps({"method": self.command, "path": self.path, "body": body}) + "\n")
        if self.server.token and self.headers.get("Authorization") != "Bearer " + TOKEN:
            self.send(401, {"error": "the token is missing or wrong: it is in the service's token file"})
            return True
        mode = self.mode()
        if mode == "hang":
            time.sleep(60)
        elif mode == "other":
            self.send(200, b"[1]\n", "application/json")
        elif mode == "stalled":
            self.wfile.write(b"HTTP/1.1 200 OK\r\nContent-Length: 100\r\n\r\nabc")
            self.wfile.flush()
            time.sleep(60)
        elif mode == "garbage":
            self.send(200, b"<html>another program</html>", "text/html")
        elif mode == "huge":
            self.send(200, b"[" + b" " * (17 << 20) + b"]")
        elif mode == "cut":
            self.send_response(200)
            self.send_header("Content-Length", "100000")
            self.end_headers()
            self.wfile.write(JPEG)
            self.wfile.flush()
            self.connection.shutdown(socket.SHUT_RDWR)
        elif mode == "evil":
            self.send(500, {"error": "two\nlines and \x1b[2J an escape"})
        else:
            return False
        return True

    def events(self, after, stream):
        self.send_response(200)
        self.send_header("Content-Type", "application/x-ndjson")
        self.send_header("Transfer-Encoding", "chunked")
        self.end_headers()
        lines = [json.dumps(e).encode() + b"\n" for e in EVENTS if e["id"] > after]
        if not stream:
            text = b"".join(lines[:12])
            for i in range(0, len(text), 100):  # not at the ends of lines
                self.chunk(text[i:i + 100])
        else:
            for i in (31, 32):
                self.chunk(json.dumps({**EVENTS[0], "id": i, "message": f"live {i}"}).encode() + b"\n")
                time.sleep(0.1)
        self.wfile.write(b"0\r\n\r\n")

    def do_GET(self):
        if self.common(None):
            return
        path, _, query = self.path.partition("?")
        after = int(query.partition("after=")[2].partition("&")[0] or 0)
        if path == "/api/v1/status":
            self.send(200, {**STATUS, "state": "failed", "reason": "no camera"} if self.mode() == "failed" else STATUS)
        elif path == "/api/v1/cameras":
            self.send(200, cameras())
        elif path == "/api/v1/events":
            self.events(after, False)
        elif path == "/api/v1/events/stream" and "ndjson" in self.headers.get("Accept", ""):
            self.events(after, True)
        elif path == "/api/v1/tokens":
            self.send(200, {"tokens": [{"name": "guard", "rights": ["view", "recordings"], "created": "2026-11-21T18:00:00.000Z",
                                        "expires": None, "expired": False}]})
        elif path == "/api/v1/audit":
            self.send(200, b'{"time":"2026-11-21T18:00:00.000Z","name":"guard","address":"192.0.2.7","action":"delete","object":"old"}\n',
                      "application/x-ndjson")
        elif path == "/api/v1/recordings":
            self.send(200, {"recordings": [{"name": "2026-11-21T18-04-00Z", "from": "2026-11-21T18:04:00Z",
                                            "to": "2026-11-21T18:05:00Z", "sets": 600, "bytes": 1.5e9, "active": False,
                                            "why": "motion in door", "by_hand": False, "view": True}],
                            "snapshots": [{"name": "snapshot-2026-11-21T18-04-30Z", "time": "2026-11-21T18:04:30Z",
                                           "bytes": 3e7, "picture": True, "active": False}], "exports": []})
        elif path == "/api/v1/videos":  # a video is done at the third look
            looks[0] += 1
            state = "failed" if self.mode() == "failed" else "running" if looks[0] % 3 else "done"
            self.send(200, {"videos": [{"name": "video-2026-11-21T18-05-00-000Z", "title": "x", "state": state, "progress": 0.5, "left_s": 1,
                                        "videos": 1, "bytes": 9, "error": "no recording has this moment" if state == "failed" else ""}]})
        elif path == "/api/v1/signing-key.pem":
            self.send(200, b"-----BEGIN PUBLIC KEY-----\n", "application/x-pem-file")
        elif path.endswith((".mp4", ".json", ".zip")):
            self.send(200, path.encode(), {"mp4": "video/mp4", "son": "application/json", "zip": "application/zip"}[path[-3:]])
        elif path.startswith("/snapshot") or path.startswith("/api/v1/download/"):
            tar = path.endswith(".tar")
            self.send(200, JPEG + path.encode() + (b"\0" * 1024 if tar and self.mode() != "torn" else b""),
                      "application/x-tar" if tar else "video/x-matroska" if path.endswith(".mkv") else "image/jpeg")
        else:
            self.send(404, {"error": f"there is no {path}"})

    def do_POST(self):
        body = json.loads(self.rfile.read(int(self.headers["Content-Length"])))
        if self.common(body):
            return
        if self.headers.get("Content-Type") != "application/json":
            self.send(400, {"error": "not JSON"})
        elif self.path == "/api/v1/reload" and self.mode() == "refuse":
            self.send(409, {"error": "/etc/sst/sstd.yaml:7:12: rate_hz -3 is outside 0.1..1000"})
        elif self.path == "/api/v1/reload":
            self.send(200, {"applied": not body["dry_run"], "changes": [
                {"key": "cameras.rate_hz", "before": "10", "after": "20", "takes": "restart-camera"},
                {"key": "live.focus_px", "before": "", "after": "7.5", "takes": "live"}]})
        elif self.path == "/api/v1/record" and body["action"] == "stop":
            self.send(200, {})
        elif self.path == "/api/v1/tokens":
            self.send(200, {"name": body["name"], "token": "abcdef"})
        elif self.path.startswith("/api/v1/tokens/"):
            self.send(200, {"revoked": True})
        elif self.path == "/api/v1/snapshot":
            self.send(200, {"name": "2026-11-21T18-05-00.123Z"})
        elif self.path == "/api/v1/delete":
            self.send(200, {"name": body["name"]})
        elif self.path == "/api/v1/videos":
            looks[0] = 0
            self.send(200, {"name": "video-2026-11-21T18-05-00-000Z"})
        elif self.path in ("/api/v1/record", "/api/v1/export"):
            self.send(200, {"name": "2026-11-21T18-05-00Z"})
        else:
            self.send(404, {"error": f"there is no {self.path}"})


class Unix(socketserver.ThreadingMixIn, socketserver.UnixStreamServer):
    daemon_threads = True
    token = False


class Tcp(socketserver.ThreadingTCPServer):
    daemon_threads = True
    token = True


if len(sys.argv) > 2:
    import threading

    tcp = Tcp(("127.0.0.1", 0), Handler)
    with open(sys.argv[2] + ".new", "w", encoding="utf8") as f:
        f.write(str(tcp.server_address[1]))
    os.rename(sys.argv[2] + ".new", sys.argv[2])
    threading.Thread(target=tcp.serve_forever, daemon=True).start()
unix = Unix(SOCKET + ".new", Handler)
os.rename(SOCKET + ".new", SOCKET)  # who sees it finds somebody who listens
unix.serve_forever()
