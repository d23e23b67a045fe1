# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
"""What the tests of the page have in common: the service that pretends, conditions, and parts of the page."""
import json
import os
import signal
import socket
import subprocess
import sys
import time
import urllib.request

import cdp

HERE = os.path.dirname(os.path.abspath(__file__))


def free_port():
    """One that is free, also while the service is away: the kernel assigns it to no client that connects."""
    for i in range(1000):
        port = 10000 + (os.getpid() * 7 + i) % 20000
        with socket.socket() as s:
            try:
                s.bind(("127.0.0.1", port))
                return port
            except OSError:
                continue
    raise cdp.Failed("no port is free")


class Fake:
    def __init__(self, pictures):
        self.port = free_port()
        self.pictures = pictures
        self.url = f"http://127.0.0.1:{self.port}/"
        self.process = None

    def start(self):
        self.process = subprocess.Popen([sys.executable, f"{HERE}/fake.py", "--pictures", self.pictures, "--port", str(self.port)],
                                        stdout=subprocess.PIPE)
        self.process.stdout.readline()

    def stop(self):
        self.process.send_signal(signal.SIGKILL)
        self.process.wait()
        self.process.stdout.close()

    def set(self, **what):
        request = urllib.request.Request(self.url + "fake", json.dumps(what).encode(), {"Content-Type": "application/json"})
        urllib.request.urlopen(request, timeout=60).read()

    def visits(self, query=""):
        return json.load(urllib.request.urlopen(f"{self.url}api/v1/visits?{query}", timeout=60))["visits"]

    def log(self):
        return json.load(urllib.request.urlopen(self.url + "fake", timeout=60))

    def posts(self, path):
        return [r["body"] for r in self.log() if r["method"] == "POST" and r["path"].startswith(path)]


def expect(what, seconds=60):
    """Until a condition of the fake holds."""
    end = time.time() + seconds
    while time.time() < end:
        value = what()
        if value:
            return value
        time.sleep(0.05)
    return None


def rest(what, seconds):
    """Until a number stays the same for `seconds`. Returns it; None: it does not rest."""
    before, since, end = what(), time.time(), time.time() + 60
    while time.time() < end:
        time.sleep(0.05)
        value = what()
        if value != before:
            before, since = value, time.time()
        elif time.time() > since + seconds:
            return value
    return None


def live(b):
    """What is alive in the page after a collection: nodes, listeners, canvases, also those that have left the document."""
    for _ in range(2):
        b.call("HeapProfiler.collectGarbage")
    counts = b.call("Memory.getDOMCounters")
    kind = b.call("Runtime.evaluate", expression="HTMLCanvasElement.prototype", objectGroup="live")["result"]["objectId"]
    found = b.call("Runtime.queryObjects", prototypeObjectId=kind, objectGroup="live")["objects"]["objectId"]
    canvases = b.call("Runtime.callFunctionOn", objectId=found, functionDeclaration="function() { return this.length; }", returnByValue=True)
    b.call("Runtime.releaseObjectGroup", objectGroup="live")  # else they are alive because they were counted
    return {"nodes": counts["nodes"], "jsEventListeners": counts["jsEventListeners"], "canvases": canvases["result"]["value"]}


def check(ok, sentence):
    if not ok:
        raise cdp.Failed(sentence)


def last(fake, key):
    changes = [b for b in fake.posts("/api/v1/views") if key in b]
    return changes[-1][key] if changes else "never"


def mode(b, name):
    b.click(f"#mode label:has([value={name}])")
    b.wait(f"document.getElementById('viewer').dataset.mode === '{name}'")


def pressed(b, name):
    return b.js(f"document.getElementById('{name}').getAttribute('aria-pressed')") == "true"


def zoomed(b):
    return b.box("#picture")[2] / b.box("#stage")[2]


def fresh(b, fake):
    """The page as if opened for the first time."""
    fake.set(forget_views=True)
    b.js("window.old = true; localStorage.clear()")
    b.call("Page.reload")
    b.wait("!window.old && Number(document.getElementById('stage')?.dataset.pictures) > 1")


def reload(b):
    b.js("window.old = true; location.reload()")
    b.wait("!window.old && Number(document.getElementById('stage')?.dataset.pictures) > 1")
