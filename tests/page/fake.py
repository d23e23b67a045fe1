#!/usr/bin/env python3
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
"""A service that only pretends: speaks docs/integrate/api.md with pictures made by tests/page/pictures.sh, so that the page can be
worked on and tested without cameras.   fake.py --pictures DIR [--port N] [--still]

POST /fake changes what it pretends: {"status": {...}, "cameras": {"r3c2": {...}}, "role": "view", "views_max": 0,
"event": {...}, "refuse": {"/api/v1/record": [507, "the disk is full"]}, "hold": true, "old": true, "computing": true, "stall": true};
while it computes, recordings stand still and have no pictures; while they stall, only pictures do not come; GET /fake lists requests. A third
member of what refuses says how often it does; an old service has no clear picture."""
import argparse
import base64
import copy
import datetime
import hashlib
import http.server
import io
import json
import math
import os
import struct
import sys
import threading
import time
import urllib.parse

from PIL import Image, ImageDraw

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), ".."))
import websocket

WEB = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "daemon", "web")
TYPES = {"html": "text/html; charset=utf-8", "js": "text/javascript; charset=utf-8", "css": "text/css; charset=utf-8",
         "svg": "image/svg+xml"}
CSP = "default-src 'self'; img-src 'self' blob: data:; frame-ancestors 'none'; base-uri 'none'; form-action 'self'"
CLEAR = ("cut_px", "remove_label", "outline", "tint")
CLASSES = [("Sky", "#80b2e6"), ("Building", "#803c32"), ("Pole", "#c0c080"), ("Road", "#804080"), ("Pavement", "#3c28de"),
           ("Tree", "#6e8c1e"), ("SignSymbol", "#c08080"), ("Fence", "#404080"), ("Car", "#6414aa"),
           ("Pedestrian", "#e65a1e"), ("Bicyclist", "#0080c0")]
SETTINGS = {"method": "sst", "cut_px": None, "remove_label": "", "outline": False, "tint": False, "focus_px": None, "focus_label": "", "sigma_px": None, "c1": 0.005, "c2": 0.02,
            "label_factor": 2.0, "aperture": None, "follow": False, "follow_track": 0}


def now():
    return datetime.datetime.now(datetime.timezone.utc)


def stamp(at=None):
    return (at or now()).strftime("%Y-%m-%dT%H:%M:%S.%f")[:-3] + "Z"


def merge(into, patch):
    for key, value in patch.items():
        if isinstance(value, dict) and isinstance(into.get(key), dict):
            merge(into[key], value)
        else:
            into[key] = value


class World:
    """Pictures of the scene, by focus."""

    def __init__(self, folder, still):
        self.still = still
        self.truth = json.load(open(f"{folder}/truth.json"))
        self.range = self.truth["range_px"]
        self.data = {name[:-4]: open(f"{folder}/{name}", "rb").read()
                     for name in sorted(os.listdir(folder)) if name.endswith(".jpg")}
        self.steps = sum(name.startswith("sst_") for name in self.data)
        self.clip = open(f"{folder}/clip.mp4", "rb").read()
        self.labels = Image.open(f"{folder}/02_02.png")
        self.size = self.labels.size
        raw = open(f"{folder}/02_02.pfm", "rb").read()
        self.disp = raw[-4 * self.size[0] * self.size[1]:]
        counts = self.labels.histogram()
        self.cut = round(1.4 * self.truth["focus_px"], 2)
        values = struct.unpack(f"<{len(self.disp) // 4}f", self.disp)
        bins = [0] * 64
        for v in values:
            bins[min(max(int((v - self.range[0]) / (self.range[1] - self.range[0]) * 64), 0), 63)] += 1
        self.histogram = {"min_px": self.range[0], "max_px": self.range[1], "share": [round(n / len(values), 5) for n in bins]}
        self.share = [counts[i + 1] / (self.size[0] * self.size[1]) for i in range(len(CLASSES))]

    def focus(self, settings):
        far, near = self.range
        focus = settings["focus_px"]
        return min(max(self.truth["focus_px"] if focus is None else focus, far), near)

    def view(self, settings, number):
        far, near = self.range
        depth = self.focus(settings)
        if settings["method"] == "clear":
            depth = self.cut if settings["cut_px"] is None else settings["cut_px"]
            far += 0.2 * (near - far)
        step = min(max(round((depth - far) / (near - far) * (self.steps - 1)), 0), self.steps - 1)
        data = self.data[f"{settings['method']}_{step:02d}"]
        return data if self.still else self.marked(data, number)

    def marked(self, data, number):
        """Something that moves: a mark that walks along the upper edge."""
        image = Image.open(io.BytesIO(data))
        x = number * 4 % image.width
        ImageDraw.Draw(image).rectangle([x, 0, x + 8, 4], fill=(255, 255, 255))
        out = io.BytesIO()
        image.save(out, "JPEG", quality=85)
        return out.getvalue()

    def pick(self, settings, x, y):
        width, height = self.size
        at = int(min(max(y, 0), height - 1)) * width + int(min(max(x, 0), width - 1))
        front = struct.unpack_from("<f", self.disp, 4 * ((height - 1 - at // width) * width + at % width))[0]
        label = self.labels.getpixel((at % width, at // width))
        name = CLASSES[label - 1][0] if label else ""
        back, back_label = front, label
        for occluder in self.truth["occluders"]:
            if occluder["label"] == name and front > occluder["focus_px"] * 1.1:
                back = occluder["focus_px"]
                back_label = 1 + [c[0] for c in CLASSES].index(occluder["target"])
        return {"disparity_px": round(back, 2), "label": back_label, "name": CLASSES[back_label - 1][0],
                "front_px": round(front, 2), "front_label": label, "front_name": name}


VAPID = "BP4z9KsN6nGRTbVYI_c7VJSPQTBtkgcy27mlmlMoZIIgDll6e3vCYLocInmYWAmS6TlzAC8wEqKK6PBru3jl7A8"


class Service:
    def __init__(self, world, age_s):
        self.world = world
        self.lock = threading.RLock()
        self.start = time.time() - age_s
        self.role, self.views_max, self.refuse, self.hold, self.old = "control", 8, {}, False, False
        self.computing = self.stall = self.preview = self.hold_videos = self.pause = False
        self.late_s = 0  # delay of visits' pictures and counts
        self.patch, self.camera_patch = {}, {}
        self.tracks = []  # as of /api/v1/tracks, of a set as long ago as:
        self.unconfirmed = []  # of the same answer
        self.tracks_late_s = 0
        self.tracks_at = None  # time of the last set, while none is processed
        self.views = {"main": dict(copy.deepcopy(SETTINGS), removed=set(), viewers=0, seen=math.inf)}
        self.events, self.log, self.next_view = [], [], 1
        self.recording = None
        self.hour = now().replace(minute=0, second=0, microsecond=0)
        self.deleted, self.played, self.plays, self.kept_visits, self.reviewed = set(), None, 0, set(), set()
        self.many = 0  # visits more, one a minute before the others
        self.kept = []
        self.videos = []  # newest first
        self.tokens = [{"name": name, "rights": ["view", "recordings"], "created": stamp(), "expires": None, "expired": False}
                       for name in ("guard", "porch")]
        self.sessions = [{"session": f"{n:012x}", "role": role, "user": role, "address": address, "agent": agent, "since": stamp(), "seen": stamp(), "own": n == 1}
                         for n, role, address, agent in ((1, "control", "127.0.0.1", "Mozilla/5.0 (X11; Linux x86_64) Chrome/140.0"),
                                                         (2, "view", "192.168.1.7", "Mozilla/5.0 (iPhone; CPU iPhone OS 18) Safari/605"))]
        self.masks = [{"name": "window", "row": 0, "col": 1, "points": [[0.7, 0], [1, 0], [1, 0.3], [0.7, 0.3]], "near_px": None, "far_px": None}]
        self.zones = [{"name": "gate", "points": [[0.1, 0.4], [0.4, 0.4], [0.4, 0.9], [0.1, 0.9]], "near_px": None, "far_px": None,
                       "labels": [], "mask": False, "line": False, "direction": "both"}]
        began = now() - datetime.timedelta(seconds=age_s)
        self.event(0, "start", "sstd 0.1.0 started", {"version": "0.1.0"}, began)
        self.event(0, "state", "Capturing 36 of 36 cameras", {"state": "capturing"}, began)

    def event(self, level, kind, message, data=None, at=None):
        with self.lock:
            self.events.append({"id": len(self.events) + 1, "time": stamp(at), "level": ["info", "warning", "error"][level],
                                "type": kind, "message": message, "data": data or {}})

    def wave(self, low, high, phase=0.0):
        t = time.time()
        return low + (high - low) * (0.5 + 0.3 * math.sin(t / 7 + phase) + 0.2 * math.sin(t / 1.7 + phase))

    def status(self):
        up = time.time() - self.start
        sets = int(up * 10)
        stages = {"wait": (1, 9), "change": (14, 22), "decode": (22, 35), "rectify": (18, 27), "disparity": (61, 96),
                  "labels": (31, 88), "refine": (17, 26), "render": (24, 38), "encode": (4, 7)}
        recording = {"mode": "event", "active": False, "name": "", "why": "", "since": "", "sets": 0, "dropped": 0}
        if self.recording:
            recording.update(active=True, name=self.recording[0], why="on demand", since=stamp(self.recording[1]),
                             sets=int((now() - self.recording[1]).total_seconds() * 10))
        body = {
            "version": "0.1.0", "role": self.role, "state": "capturing", "reason": "", "uptime_s": round(up, 1),
            "time": stamp(),
            "capture": {
                "cameras": 36, "present": 36, "rate_hz": round(self.wave(9.9, 10.05), 2), "sets": sets, "complete": sets - 3,
                "dropped": 0, "refused": 0,
                "trigger": {"source": "gpio", "edges": sets, "stamped": sets, "skipped": 0},
                "frames": {"delivered": sets * 36, "set": sets * 36 - 9, "late": 4, "duplicate": 0, "stray": 2,
                           "corrupt": 3, "flagged": 0, "dropped": 0, "unexplained": 0},
                "skew_us": {"p50": 110, "p99": round(self.wave(160, 200)), "max": 220, "limit": 1000, "worst": "r3c2",
                            "over": 0}},
            "live": {
                "enabled": True, "ready": True, "settling": False, "rate_hz": round(self.wave(5.6, 6.8), 2), "sets": int(up * 6),
                "dropped": int(up * 4), "idle": 0, "changed_percent": round(self.wave(9, 19), 1),
                "latency_ms": {"p50": round(self.wave(190, 230)), "p99": round(self.wave(280, 340, 1)), "max": 412},
                "stages_ms": {k: {"p50": p50, "p99": p99} for k, (p50, p99) in stages.items()},
                "skips": {"change": {"on": True, "skipped_percent": 85.8, "error": 0.4},
                          "labels": {"on": True, "skipped_percent": 75.0, "error": 0.01}},
                "size": list(self.world.size), "range_px": self.world.range, "focal_px": 560.0, "spacing_mm": 120.0,
                "focus_px": self.world.truth["focus_px"], "cut_px": self.world.cut, "histogram": self.world.histogram, "views": 36, "cpu_percent": 92.0},
            "storage": {
                "state": "OK", "reason": "", "dir": "/var/lib/sst", "free_bytes": 412 * 10**9, "used_bytes": 188 * 10**9,
                "quota_bytes": 400 * 10**9, "oldest": stamp(now() - datetime.timedelta(days=6, hours=3)), "recordings": 4,
                "full": {"recordings": 4, "bytes": 150 * 10**9, "oldest": stamp(now() - datetime.timedelta(days=6)), "bytes_per_day": 24e9, "fits_days": 12.4},
                "reduced": {"recordings": 9, "bytes": 30 * 10**9, "oldest": stamp(now() - datetime.timedelta(days=30)), "bytes_per_day": 1e9, "fits_days": 63.2},
                "removed": 2, "recording": recording, "ring": {"bytes": 260 * 10**6, "sets": 100, "seconds": 10.0}},
            "clients": {"http": 3, "streams": 2, "videos": 0, "encoder": "", "listeners": 1, "rtsp": 1, "requests": len(self.log), "refused": 0},
            "process": {"rss_bytes": 640 * 10**6, "cpu_percent": 118.0, "descriptors": 141}}
        merge(body, self.patch)
        return body

    def cameras(self):
        up = time.time() - self.start
        cameras = []
        for i in range(36):
            frames = int(up * 10)
            camera = {"name": f"r{i // 6}c{i % 6}", "row": i // 6, "col": i % 6, "state": "streaming",
                      "serial": f"C10{i:02d}A7", "port": f"{1 + i // 12}-1.{1 + i % 12}", "frames": frames, "bad": 0, "lost": 0,
                      "rate_hz": 10.0, "skew_us": round((i * 37 % 23 - 11) * 9.5, 1), "last_s": 0.05,
                      "buckets": {"set": frames, "late": 0, "duplicate": 0, "stray": 0, "corrupt": 0, "flagged": 0,
                                  "dropped": 0},
                      "recovery": {"restream": 0, "reopen": 0, "reset": 0, "reauthorise": 0, "power": 0, "back_off": 0},
                      "reason": ""}
            merge(camera, self.camera_patch.get(camera["name"], {}))
            cameras.append(camera)
        return {"rows": 6, "cols": 6, "cameras": cameras}

    def visits(self):
        """Of a recording, of an hour ago and of yesterday."""
        body = []
        begin = self.hour - datetime.timedelta(hours=3) + datetime.timedelta(seconds=60)
        for n, (at, label, zones) in enumerate(((begin, "Pedestrian", ["gate"]), (begin - datetime.timedelta(hours=2), "Car", ["street"]),
                                                (begin - datetime.timedelta(days=1), "Pedestrian", ["gate", "street"]), (begin - datetime.timedelta(days=2), "", []))):
            body.append({"visit": f"{at:%Y-%m-%dT%H-%M-%S-000Z}-{9 - n}", "active": False, "hidden": n == 3, "label": label, "from": stamp(at),
                         "to": stamp(at + datetime.timedelta(seconds=12)), "seconds": 12.0, "direction": "left to right", "zones": zones + ["drive"] * (n == 0),
                         "crossed": [{"zone": "drive", "direction": "forward", "seconds": 4.0}] * (n == 0),
                         "distance_m": 8.2, "nearest_m": 6.1, "nearest_px": 8.0, "box": [0.3, 0.3, 0.5, 0.9], "picture_s": 6.0,
                         "path": [[0.4, 0.1, 0.9, 8.0], [6.0, 0.5, 0.95, 6.1], [12.0, 0.9, 0.9, 8.2]], "pictures": ["camera", "seen"]})
        for n in range(self.many):
            at = begin - datetime.timedelta(days=3, minutes=n)
            body.append({**copy.copy(body[n % 3]), "visit": f"{at:%Y-%m-%dT%H-%M-%S-000Z}-{n}", "from": stamp(at), "to": stamp(at + datetime.timedelta(seconds=12)), "crossed": []})
        for visit in body:
            visit["keep"] = visit["visit"] in self.kept_visits
            visit["reviewed"] = visit["visit"] in self.reviewed
            visit["reviewed_by"] = [self.role] if visit["reviewed"] else []
        return [visit for visit in body if visit["visit"] not in self.deleted]

    def recordings(self):
        hour = datetime.timedelta(hours=1)
        body = []
        for back, long, why in ((26, 0.0006, "zone gate: motion"), (9, 0.03, "Pedestrian in zone gate"), (3, 0.12, "on demand"),
                                (1, 0.02, "Pedestrian in zone gate")):
            start = self.hour - back * hour
            body.append({"name": start.strftime("%Y-%m-%dT%H-%M-%SZ"), "from": stamp(start), "to": stamp(start + long * hour),
                         "sets": int(long * 36000), "bytes": int(long * 36000 * 36 * 24000), "why": why, "by_hand": why == "on demand",
                         "view": back != 9,
                         "view_from": stamp(start + datetime.timedelta(seconds=0 if back == 26 else 20)) if back != 9 else "",
                         "active": False})
        if self.recording:
            sets = int((now() - self.recording[1]).total_seconds() * 10)
            body.append({"name": self.recording[0], "from": stamp(self.recording[1]), "to": stamp(), "sets": sets,
                         "bytes": sets * 864000, "why": "on demand", "by_hand": True, "view": True,
                         "view_from": stamp(self.recording[1]), "active": True})
        kept = [{"name": "snapshot-" + r["name"], "time": r["from"], "bytes": 31 * 10**6, "picture": True, "active": False} for r in body[:2]]
        made = [{"name": "export-" + r["name"], "time": r["to"], "bytes": 30 * 10**6, "picture": False, "active": False} for r in body[1:2]]
        return {"recordings": [r for r in body if r["name"] not in self.deleted],
                "snapshots": [r for r in kept if r["name"] not in self.deleted],
                "exports": [r for r in made if r["name"] not in self.deleted]}

    def zones_json(self):
        return {"zones": self.zones, "revision": str(abs(hash(json.dumps(self.zones)))), "file": "/var/lib/sst/zones.yaml"}

    def replay(self):
        """State of the recording that is played, whose clock goes on while it plays."""
        if not self.played:
            return {"replay": None, "open": False, "recording": "", "from": None, "to": None, "time": None, "computing": False, "playing": False, "speed": 1.0,
                    "error": "", "live": None}
        p = self.played
        if p["playing"] and not self.computing:
            p["at"] = min(p["at"] + p["speed"] * (time.time() - p["since"]), p["to"])
            p["playing"] = p["at"] < p["to"]
        p["since"] = time.time()
        at = lambda t: stamp(datetime.datetime.fromtimestamp(t, datetime.timezone.utc))
        return {"replay": p["id"], "open": True, "recording": p["recording"], "from": at(p["from"]), "to": at(p["to"]), "time": at(p["at"]),
                "computing": self.computing, "playing": p["playing"], "speed": p["speed"], "error": "", "live": self.status()["live"]}

    def change_replay(self, body):
        seconds = lambda text: datetime.datetime.fromisoformat(text.replace("Z", "+00:00")).timestamp()
        if body.get("replay") and (not self.played or body["replay"] != self.played["id"]):
            raise Refused(404, f"the replay {body['replay']} has ended; open the recording again")
        self.replay()
        if body.get("close"):
            self.played = None
            self.views = {name: view for name, view in self.views.items() if not name.startswith("r")}
            return self.replay()
        if "recording" in body or ("time" in body and not (self.played and self.played["from"] <= seconds(body["time"]) <= self.played["to"])):
            found = [r for r in self.recordings()["recordings"] if r["name"] == body.get("recording")
                     or "recording" not in body and r["from"] <= body["time"] <= r["to"]]
            if not found:
                raise Refused(404, "no recording has that moment, or there is none of that name")
            begin, end = seconds(found[0]["from"]), seconds(found[0]["to"])
            self.plays += 1
            self.played = {"id": f"r{self.plays}", "recording": found[0]["name"], "from": begin, "to": end, "at": begin, "since": time.time(),
                           "playing": False, "speed": 1.0}
        if "time" in body:
            self.played["at"] = seconds(body["time"])
        self.played.update({key: body[key] for key in ("playing", "speed") if key in body})
        return self.replay()

    def videos_json(self):
        """Each look at a video is a quarter of its making."""
        for video in [v for v in self.videos if v["state"] in ("waiting", "running")][-1:]:
            video["progress"] = min(video["progress"] + 0.25, 1)
            video["left_s"] = 4 * (1 - video["progress"])
            video["state"] = "done" if video["progress"] == 1 and not self.hold_videos else "running"
            video["bytes"] = len(self.world.clip) if video["state"] == "done" else 0
        return self.videos

    def view_json(self, name):
        view = self.views[name]
        clear = view["method"] == "clear"
        return {"id": name, "viewers": view["viewers"], "settings": {k: view[k] for k in SETTINGS},
                "shown_focus_px": self.world.focus(view), "shown_cut_px": (view["cut_px"] or self.world.cut) if clear else None,
                "objects": len(view["removed"]), "track": next((t for t in self.tracks if t["track"] == view["follow_track"]), None), "seen_percent": 96.1, "remembered_percent": 3.2, "filled_percent": 0.7,
                "oldest_s": 4.1}

    def remove(self, view, body):
        """Things are distinguished by their labels."""
        if body.get("clear"):
            view["removed"].clear()
            return {"removed": False, "objects": 0}
        label = self.world.pick(view, body["x"], body["y"])["front_label"]
        view["removed"] ^= {label}
        return {"removed": label in view["removed"], "objects": len(view["removed"])}

    def expire(self):
        for name in [n for n, v in self.views.items() if not v["viewers"] and time.time() - v["seen"] > 30]:
            del self.views[name]


class Refused(Exception):
    pass


class Handler(http.server.BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"
    service = None
    view_prefix = "v"

    def log_message(self, *_):
        pass

    def answer(self, code, body, kind="application/json", extra=()):
        data = body if isinstance(body, bytes) else json.dumps(body).encode()
        self.send_response(code)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(len(data)))
        self.send_header("Content-Security-Policy", CSP)
        self.send_header("X-Content-Type-Options", "nosniff")
        self.send_header("Cache-Control", "no-store")
        for header in extra:
            self.send_header(*header)
        self.end_headers()
        if self.command != "HEAD":
            self.wfile.write(data)

    def do_GET(self):
        self.route(None)

    def do_POST(self):
        data = self.rfile.read(int(self.headers.get("Content-Length") or 0))
        if self.headers.get("Content-Type", "").split(";")[0] != "application/json":
            self.answer(400, {"error": "Content-Type must be application/json"})
            return
        self.route(json.loads(data or b"{}"))

    def route(self, body):
        s = self.service
        url = urllib.parse.urlsplit(self.path)
        query = dict(urllib.parse.parse_qsl(url.query))
        path = urllib.parse.unquote(url.path)
        try:
            if path == "/fake":
                self.fake(body)
                return
            with s.lock:
                s.log.append({"method": self.command, "path": path, "query": query, "body": body})
            while s.hold and path.startswith(("/api", "/stream")):
                time.sleep(0.1)
            with s.lock:
                refused = s.refuse.get(path)
                if refused and len(refused) > 2:
                    s.refuse[path] = [*refused[:2], refused[2] - 1]
            if refused and (len(refused) == 2 or refused[2] > 0):
                raise Refused(*refused[:2])
            self.view_prefix = "v"
            if path.startswith("/replay/"):
                if not s.played:
                    raise Refused(404, "no recording is being played; POST /api/v1/replay with its name opens one")
                path = path[7:]
                self.view_prefix = "r"
            if body is None:
                self.get(path, query)
            else:
                self.post(path, body)
        except Refused as e:
            self.answer(e.args[0], {"error": e.args[1]})
        except (BrokenPipeError, ConnectionResetError):
            self.close_connection = True

    def fake(self, body):
        s = self.service
        if body is None:
            with s.lock:
                self.answer(200, list(s.log))
            return
        with s.lock:
            merge(s.patch, body.get("status", {}))
            for name, patch in body.get("cameras", {}).items():
                s.camera_patch.setdefault(name, {}).update(patch)
            for key in ("role", "views_max", "refuse", "hold", "old", "computing", "stall", "preview", "hold_videos", "tracks", "unconfirmed", "many", "masks", "pause", "late_s", "tracks_late_s", "tracks_at", "zones"):
                if key in body:
                    setattr(s, key, body[key])
            for e in body.get("events", []):
                s.event(e["level"], e["type"], e["message"], e.get("data"),
                        now() - datetime.timedelta(seconds=e.get("ago_s", 0)))
            if body.get("forget_reviews"):
                s.reviewed = set()
            if body.get("forget_views"):
                s.views = {"main": s.views["main"]}
        self.answer(200, {})

    def get(self, path, query):
        s = self.service
        part = path.strip("/").split("/")
        if path == "/":
            self.file("index.html")
        elif part[0] == "web" and len(part) == 2:
            self.file(part[1])
        elif path == "/api/v1/status":
            self.answer(200, s.status())
        elif path == "/api/v1/cameras":
            self.answer(200, s.cameras())
        elif path == "/api/v1/labels":
            self.answer(200, {"labels": [{"label": i + 1, "name": n, "colour": c, "share": round(s.world.share[i], 4)}
                                         for i, (n, c) in enumerate(CLASSES)]})
        elif path == "/api/v1/visits":
            limit, newest = int(query.get("limit", 100)), "after" not in query or "before" in query
            found = [v for v in s.visits() if self.wanted(v, query) and v["visit"] < query.get("before", "9") and v["visit"] > query.get("after", "")]
            self.answer(200, {"visits": found[:limit] if newest else found[-limit:], "more": len(found) > limit})
        elif path == "/api/v1/visits/days":
            days = {}
            time.sleep(s.late_s)
            for v in [v for v in s.visits() if self.wanted(v, {key: query[key] for key in ("label", "zone") if key in query})]:
                day = v["from"][:10]
                if query.get("from", "") <= day <= query.get("to", "9"):
                    one = days.setdefault(day, {"day": day, "visits": 0, "reviewed": 0})
                    one["visits"] += 1
                    one["reviewed"] += v["reviewed"]
            self.answer(200, {"days": list(days.values())})
        elif path == "/push-worker.js":
            self.file("push-worker.js")
        elif path == "/api/v1/push":
            self.answer(200, {"supported": True, "reason": "", "key": VAPID, "subscriptions": 0, "cool_down_s": 30, "sent": 0, "failed": 0})
        elif path == "/api/v1/videos":
            with s.lock:
                self.answer(200, {"videos": s.videos_json()})
        elif len(part) == 4 and part[2] == "download" and part[3].endswith((".mp4", ".zip")):
            self.answer(200, s.world.clip, "video/mp4")
        elif len(part) == 5 and part[2] == "visits" and part[4] in ("camera", "seen"):
            time.sleep(s.late_s)
            self.answer(200, s.world.data["refocus_00" if part[4] == "camera" else "sst_05"], "image/jpeg")
        elif path == "/api/v1/tracks":
            at = datetime.datetime.fromisoformat(s.tracks_at) if s.tracks_at else now() - datetime.timedelta(seconds=s.tracks_late_s)
            self.answer(200, {"set": 1, "time": stamp(at), "tracks": [
                {"seen": stamp(at - datetime.timedelta(seconds=t.get("unseen_s", 0))), **t} for t in s.tracks],
                "unconfirmed": [{"seen": stamp(at), **u} for u in s.unconfirmed]})
        elif path == "/api/v1/views":
            with s.lock:
                self.answer(200, {"views": [s.view_json(name) for name in s.views]})
        elif len(part) == 5 and part[2] == "views" and part[4] == "pick":
            x, y = float(query["x"]), float(query["y"])
            found = s.world.pick(self.view(part[3]), x, y)
            for which in ("", "front_"):
                at = [t for t in s.tracks if t["box"][0] <= x <= t["box"][2] and t["box"][1] <= y <= t["box"][3]
                      and t["name"] == found["front_name" if which else "name"]]
                found[which + "track"] = at[0]["track"] if at else 0
            self.answer(200, found)
        elif path == "/api/v1/events":
            after, limit = int(query.get("after", 0)), int(query.get("limit", 1000))
            lines = [json.dumps(e) for e in s.events if e["id"] > after][-limit:]
            self.answer(200, "".join(line + "\n" for line in lines).encode(), "application/x-ndjson")
        elif path == "/api/v1/events/stream":
            self.event_stream(int(query.get("after", 0)))
        elif path == "/api/v1/recordings":
            self.answer(200, s.recordings())
        elif path == "/api/v1/zones":
            self.answer(200, s.zones_json())
        elif path == "/api/v1/masks":
            self.answer(200, {"masks": s.masks})
        elif path == "/api/v1/sessions":
            self.answer(200, {"sessions": [one for one in s.sessions if one["own"] or s.role == "control"]})
        elif path == "/api/v1/tokens":
            self.answer(200, {"tokens": s.tokens})
        elif path == "/login":
            self.answer(200, b"<!doctype html><title>log in</title>", "text/html")
        elif path == "/api/v1/replay":
            self.answer(200, s.replay())
        elif part[0] == "video":
            self.no_video()
        elif part[0] in ("stream", "snapshot"):
            self.picture(part)
        elif path.startswith("/api/v1/download/"):
            self.download(part[3])
        else:
            raise Refused(404, f"there is no {path}")

    @staticmethod
    def wanted(visit, query):
        return (query.get("label") in (None, visit["label"]) and (query.get("zone") is None or query["zone"] in visit["zones"])
                and query.get("from", "") <= visit["to"] and visit["from"] <= query.get("to", "9")
                and query.get("reviewed", str(visit["reviewed"]).lower()) == str(visit["reviewed"]).lower())

    def download(self, name):
        more = [("Content-Disposition", f'attachment; filename="{name}"'), ("ETag", '"0123456789abcdef"')]
        self.answer(200, self.service.world.data["sst_00"], "image/jpeg", more)

    def file(self, name):
        path = os.path.join(WEB, os.path.basename(name))
        if not os.path.isfile(path):
            raise Refused(404, f"there is no {name}")
        with open(path, "rb") as f:
            self.answer(200, f.read(), TYPES[name.rsplit(".", 1)[-1]])

    def view(self, name):
        s = self.service
        with s.lock:
            s.expire()
            if name not in s.views:
                raise Refused(404, f"there is no view {name}: it went after its last viewer, or the service was restarted")
            return s.views[name]

    def jpeg(self, part, number):
        s = self.service
        name = part[1] if len(part) > 1 else "main"
        if name == "camera":
            if s.cameras()["cameras"][int(part[2][1]) * 6 + int(part[2][3])]["state"] != "streaming":
                raise Refused(503, f"camera {part[2]} has not delivered a picture yet")
            return s.world.data[f"camera_{part[2]}"]
        if name in ("labels", "disparity"):
            return s.world.data[name]
        return s.world.view(self.view(name), number)

    def picture(self, part):
        s = self.service
        if part[0] == "snapshot":
            self.answer(200, self.jpeg(part, 0), "image/jpeg")
            return
        name = part[1] if len(part) > 1 else "main"
        view = self.view(name) if name not in ("camera", "labels", "disparity") else {"viewers": 0}
        self.jpeg(part, 0)
        self.send_response(200)
        self.send_header("Content-Type", "multipart/x-mixed-replace; boundary=sst-picture")
        self.send_header("Cache-Control", "no-store")
        self.send_header("Connection", "close")
        self.end_headers()
        self.close_connection = True
        with s.lock:
            view["viewers"] += 1
        number = 0
        try:
            while not (s.hold or "main" in name and s.patch.get("state") == "failed"):
                played = self.view_prefix == "r"
                if played and (s.computing or s.stall) and not s.preview or s.pause and name != "camera":
                    time.sleep(0.05)
                    continue
                with s.lock:
                    at = datetime.datetime.fromisoformat(s.replay()["time"].replace("Z", "+00:00")).timestamp() if played else time.time() - 0.21
                number += 1
                data = self.jpeg(part, number)
                self.wfile.write(b"--sst-picture\r\nContent-Type: image/jpeg\r\nContent-Length: %d\r\nX-Timestamp: %.3f\r\n\r\n"
                                 % (len(data), at) + data + b"\r\n")
                time.sleep(0.15)
        except Refused:
            pass
        finally:
            with s.lock:
                view["viewers"] -= 1
                view["seen"] = min(view.get("seen", 0), math.inf) if name == "main" else time.time()

    def no_video(self):
        """A WebSocket that closes with a reason: the page shows JPEG."""
        accept = base64.b64encode(hashlib.sha1((self.headers["Sec-WebSocket-Key"] + websocket.GUID.decode()).encode()).digest()).decode()
        self.send_response(101)
        for name, value in (("Upgrade", "websocket"), ("Connection", "Upgrade"), ("Sec-WebSocket-Accept", accept)):
            self.send_header(name, value)
        self.end_headers()
        reason = struct.pack(">H", 4501) + b"this service only pretends"
        self.wfile.write(bytes([0x80 | websocket.CLOSE, len(reason)]) + reason)
        self.close_connection = True

    def event_stream(self, after):
        s = self.service
        self.send_response(200)
        sse = "text/event-stream" in self.headers.get("Accept", "")
        after = after or s.events[-1]["id"] if sse and s.events else after
        self.send_header("Content-Type", "text/event-stream" if sse else "application/x-ndjson")
        self.send_header("Connection", "close")
        self.end_headers()
        self.close_connection = True
        while True:
            for e in [e for e in s.events if e["id"] > after]:
                after = e["id"]
                self.wfile.write((f"id: {after}\ndata: {json.dumps(e)}\n\n" if sse else json.dumps(e) + "\n").encode())
            self.wfile.flush()
            time.sleep(0.1)

    def post(self, path, body):
        s = self.service
        part = path.strip("/").split("/")
        if part[:3] == ["api", "v1", "views"]:
            self.post_view(part[3] if len(part) > 3 else None, path, body)
            return
        if path == "/api/v1/replay":
            with s.lock:
                self.answer(200, s.change_replay(body))
            return
        if path == "/api/v1/logout":
            self.answer(200, {"ended": True})
            return
        if path == "/api/v1/visits" and "reviewed" in body:
            s.reviewed = s.reviewed | set(body["visits"]) if body["reviewed"] else s.reviewed - set(body["visits"])
            self.answer(200, {"changed": len(body["visits"]), "failed": []})
            return
        if s.role != "control":
            raise Refused(403, "this token is read-only: use the other token to control")
        if path == "/api/v1/visits":
            names = set(body["visits"])
            with s.lock:
                if "delete" in body:
                    s.deleted |= names
                else:
                    s.kept_visits = s.kept_visits | names if body["keep"] else s.kept_visits - names
            self.answer(200, {"changed": len(names), "failed": []})
            return
        if path == "/api/v1/push":
            self.answer(200, {"subscribed": "delete" not in body})
            return
        if path == "/api/v1/videos":
            if "2000" in str(body.get("from", "")):
                raise Refused(404, "no recording has that moment")
            with s.lock:
                name = f"video-{now():%Y-%m-%dT%H-%M-%S}-{len(s.videos):03d}Z"
                s.videos.insert(0, {"name": name, "title": "Pedestrian", "state": "waiting", "progress": 0, "left_s": None,
                                    "videos": len(body.get("visits", [1])), "bytes": 0, "error": ""})
            self.answer(200, {"name": name})
            return
        if part[:3] == ["api", "v1", "videos"]:
            with s.lock:
                s.videos = [v for v in s.videos if v["name"] != part[3]]
            self.answer(200, {"deleted": part[3]})
            return
        if path == "/api/v1/record":
            if body.get("action") == "start":
                s.recording = (now().strftime("%Y-%m-%dT%H-%M-%SZ"), now())
                s.event(0, "record-start", f"Recording {s.recording[0]} on demand", {"recording": s.recording[0]})
                self.answer(200, {"name": s.recording[0]})
            elif s.recording:
                s.event(0, "record-stop", f"Recording {s.recording[0]} ended", {"recording": s.recording[0]})
                s.recording = None
                self.answer(200, {})
            else:
                raise Refused(404, "nothing is being recorded on demand")
        elif path == "/api/v1/snapshot":
            name = now().strftime("%Y-%m-%dT%H-%M-%S.000Z")
            s.event(0, "snapshot", f"Snapshot {name} kept", {"name": name})
            self.answer(200, {"name": name})
        elif path == "/api/v1/tokens":
            if any(one["name"] == body["name"] for one in s.tokens):
                raise Refused(409, f"token: there is a token {body['name']} already")
            s.tokens.append({"name": body["name"], "rights": body["rights"], "created": stamp(), "expired": False,
                             "expires": stamp(now() + datetime.timedelta(seconds=body["expires_s"])) if body.get("expires_s") else None})
            self.answer(200, {"name": body["name"], "token": "secret-of-" + body["name"]})
        elif part[:3] == ["api", "v1", "tokens"]:
            s.tokens = [one for one in s.tokens if one["name"] != part[3]]
            self.answer(200, {"revoked": True})
        elif part[:3] == ["api", "v1", "sessions"]:
            s.sessions = [one for one in s.sessions if one["session"] != part[3]]
            self.answer(200, {"ended": True})
        elif path == "/api/v1/zones":
            if body.get("revision") != s.zones_json()["revision"]:
                raise Refused(409, "the zones have been changed by another client; load them again")
            s.zones = body["zones"]
            self.answer(200, s.zones_json())
        elif path == "/api/v1/delete":
            s.deleted.add(body["name"])
            self.answer(200, {"name": body["name"]})
        elif path == "/api/v1/export":
            at = datetime.datetime.fromisoformat(body["time"].replace("Z", "+00:00"))
            name = at.strftime("%Y-%m-%dT%H-%M-%SZ")
            s.event(0, "export", f"Exported {name}", {"name": name})
            self.answer(200, {"name": name})
        else:
            raise Refused(404, f"there is no {path}")

    def post_view(self, name, path, body):
        s = self.service
        if name and path.endswith("/remove"):
            with s.lock:
                self.answer(200, s.remove(self.view(name), body))
            return
        unknown = [k for k in body if k not in SETTINGS or s.old and k in CLEAR]
        if unknown:
            raise Refused(400, f"unknown member {unknown[0]}")
        if s.old and body.get("method") == "clear":
            raise Refused(400, "method: not sst or refocus")
        with s.lock:
            if name is None:
                s.expire()
                if len([n for n in s.views if n.startswith(self.view_prefix)]) >= s.views_max:
                    raise Refused(429, f"all {s.views_max} views are in use: close another page, or raise web.views")
                name = f"{self.view_prefix}{s.next_view}-{int(s.start) % 1000}"
                s.next_view += 1
                s.views[name] = dict(copy.deepcopy(SETTINGS), removed=set(), viewers=0, seen=time.time())
            elif name == "main" and s.role != "control":
                raise Refused(403, "this token is read-only: the main view is for those who control")
            if any(key in body for key in ("focus_px", "focus_label", "follow")):
                self.view(name)["follow_track"] = 0
            self.view(name).update(body)
            self.answer(200, s.view_json(name))


class Server(http.server.ThreadingHTTPServer):
    daemon_threads = True
    request_queue_size = 64

    def handle_error(self, request, client_address):
        pass  # browsers leave when they like


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--pictures", required=True)
    parser.add_argument("--port", type=int, default=0)
    parser.add_argument("--still", action="store_true", help="without a mark that moves")
    parser.add_argument("--age", type=float, default=0, help="seconds for which it pretends to run already")
    args = parser.parse_args()
    Handler.service = Service(World(args.pictures, args.still), args.age)
    server = Server(("127.0.0.1", args.port), Handler)
    print(f"http://127.0.0.1:{server.server_address[1]}/", flush=True)
    server.serve_forever()


if __name__ == "__main__":
    main()
