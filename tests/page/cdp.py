# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
"""Drives a headless Chromium over its debugging pipe, with the standard library alone."""
import base64
import json
import os
import queue
import shutil
import signal
import subprocess
import tempfile
import threading
import time

PROGRAMS = ("chromium", "chromium-browser", "google-chrome")


def program():
    return next(filter(None, map(shutil.which, PROGRAMS)), None)


class Failed(Exception):
    pass


class Gone(Failed):
    """The page was left before it answered, or the next one is not there yet."""


GONE = ("Inspected target navigated or closed", "Cannot find default execution context", "Cannot find context with specified id",
        "Execution context was destroyed")
TAP_S = 0.05  # from press to release, as the page sees it


class Browser:
    """One browser with one page. `problems` collects what its console complains about, with the time; `dialogs` the kinds of
    its own dialogs, which are accepted."""

    def __init__(self, light=False):
        self.folder = tempfile.mkdtemp(prefix="sst-page-")
        down_r, down_w = os.pipe()
        up_r, up_w = os.pipe()

        def pipes():  # the browser reads 3 and writes 4
            os.dup2(down_r, 13)
            os.dup2(up_w, 14)
            os.dup2(13, 3)
            os.dup2(14, 4)

        self.process = subprocess.Popen(
            [program(), "--headless=new", "--no-sandbox", "--disable-gpu", "--remote-debugging-pipe", "--no-first-run",
             "--disable-extensions", "--disable-background-networking", "--disable-dev-shm-usage", "--mute-audio",
             "--force-color-profile=srgb", f"--user-data-dir={self.folder}", "about:blank"],
            preexec_fn=pipes, close_fds=False, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True)
        os.close(down_r)
        os.close(up_w)
        self.out = os.fdopen(down_w, "wb", buffering=0)
        self.inp = os.fdopen(up_r, "rb")
        self.answers, self.problems, self.next, self.session = {}, [], 0, None
        self.workers, self.dialogs = [], []
        self.lock = threading.Lock()
        threading.Thread(target=self.listen, daemon=True).start()
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        self.session = self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Log", "DOM", "Accessibility"):
            self.call(f"{domain}.enable")
        self.call("Browser.setDownloadBehavior", behavior="allow", downloadPath=self.folder)
        self.scheme(light)

    def listen(self):
        data = b""
        while True:
            try:
                more = os.read(self.inp.fileno(), 1 << 16)
            except OSError:
                return
            if not more:
                return
            data += more
            *whole, data = data.split(b"\0")
            for message in map(json.loads, whole):
                self.take(message)

    def take(self, message):
        if "id" in message:
            with self.lock:
                waiting = self.answers.get(message["id"])
            if waiting:
                waiting.put(message)
            return
        kind, what = message["method"], message.get("params", {})
        if kind == "ServiceWorker.workerRegistrationUpdated":
            self.workers = [r["registrationId"] for r in what["registrations"] if not r["isDeleted"]]
        if kind == "Page.javascriptDialogOpening":
            self.dialogs.append(what["type"])
            self.send(0, "Page.handleJavaScriptDialog", {"accept": True})
        if kind == "Runtime.exceptionThrown":
            details = what["exceptionDetails"]
            self.problems.append((time.time(), "exception", details.get("exception", {}).get("description", details["text"])))
        elif kind == "Runtime.consoleAPICalled" and what["type"] in ("error", "assert"):
            self.problems.append((time.time(), "console", " ".join(str(a.get("value", "")) for a in what["args"])))
        elif kind == "Log.entryAdded" and what["entry"]["level"] == "error":
            entry = what["entry"]
            self.problems.append((time.time(), entry["source"], f"{entry['text']} {entry.get('url', '')}"))

    def send(self, number, method, params):
        message = {"id": number, "method": method, "params": params}
        if self.session and not method.startswith(("Browser.", "Target.")):
            message["sessionId"] = self.session
        self.out.write(json.dumps(message).encode() + b"\0")

    def call(self, method, **params):
        with self.lock:
            self.next += 1
            number = self.next
            waiting = self.answers[number] = queue.Queue()
        self.send(number, method, params)
        try:
            answer = waiting.get(timeout=60)
        except queue.Empty:
            raise Failed(f"{method}: the browser does not answer") from None
        finally:
            with self.lock:
                del self.answers[number]
        if "error" in answer:
            text = answer["error"]["message"]
            raise (Gone if text.startswith(GONE) else Failed)(f"{method}: {text}")
        return answer["result"]

    def worker(self, seconds=60):
        """Id of the registered service worker."""
        self.call("ServiceWorker.enable")
        end = time.time() + seconds
        while not self.workers and time.time() < end:
            time.sleep(0.02)
        if not self.workers:
            raise Failed("no service worker is registered")
        return self.workers[-1]

    def scheme(self, light):
        self.call("Emulation.setEmulatedMedia",
                  features=[{"name": "prefers-color-scheme", "value": "light" if light else "dark"}])

    def size(self, width, height, phone=False):
        self.call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=2 if phone else 1,
                  mobile=phone)
        self.call("Emulation.setTouchEmulationEnabled", enabled=phone)
        self.wait(f"matchMedia('(width: {width}px) and (height: {height}px)').matches")

    def go(self, url):
        self.call("Page.navigate", url=url)

    def js(self, text):
        """Value of an expression; promises are waited for."""
        answer = self.call("Runtime.evaluate", expression=text, returnByValue=True, awaitPromise=True)
        if "exceptionDetails" in answer:
            raise Failed(f"{text}: {answer['exceptionDetails'].get('exception', {}).get('description')}")
        return answer["result"].get("value")

    def wait(self, text, seconds=60):
        """Until an expression is true."""
        end = time.time() + seconds
        while time.time() < end:
            try:
                value = self.js(text)
                if value:
                    return value
            except Gone:
                pass  # the page was just being replaced by another
            time.sleep(0.05)
        raise Failed(f"not within {seconds} s: {text}")

    def box(self, selector):
        """x, y of the middle, width, height, as shown."""
        return self.js(f"""(() => {{ const b = document.querySelector({json.dumps(selector)}).getBoundingClientRect();
            return [b.x + b.width / 2, b.y + b.height / 2, b.width, b.height]; }})()""")

    def mouse(self, kind, x, y, **more):
        self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, **more)

    def at_rest(self, where):
        """The box of an element that no list above it is moving any more: a click beside it is a click on nothing."""
        box = self.box(where)
        for _ in range(100):
            time.sleep(0.02)
            last, box = box, self.box(where)
            if last == box:
                break
        return box

    def click(self, where):
        """A selector, whose middle is clicked, or (x, y)."""
        if isinstance(where, str):
            self.js(f"document.querySelector({json.dumps(where)}).scrollIntoView({{block: 'nearest'}})")
            where = self.uncovered(where)
        x, y = where[:2]
        at = time.time()  # told to the page: between two calls the machine may stand still, and a press that lasts is no tap
        self.mouse("mousePressed", x, y, button="left", clickCount=1, timestamp=at)
        self.mouse("mouseReleased", x, y, button="left", clickCount=1, timestamp=at + TAP_S)

    def uncovered(self, where):
        """The box of an element at rest, once nothing lies over its middle: messages of earlier actions leave by themselves."""
        end = time.time() + 60
        while time.time() < end:
            box = self.at_rest(where)
            over = self.js(f"""(() => {{ const n = document.querySelector({json.dumps(where)}), top = document.elementFromPoint({box[0]}, {box[1]});
                return !top || n.contains(top) || top.contains(n) || n.closest("label")?.contains(top) || [...n.labels ?? []].some((l) => l.contains(top)) ? "" : top.outerHTML.slice(0, 200); }})()""")
            if not over:
                return box
            self.js(f"document.querySelector({json.dumps(where)}).scrollIntoView({{block: 'center'}})")  # a bar that stays lies over the edge
        raise Failed(f"{where} lies under {over}")

    def state(self):
        """What lies over the page, in words."""
        return self.js("""JSON.stringify({dialogs: [...document.querySelectorAll("dialog[open]")].map((d) => `${d.id} ${d.querySelector("h1, h2, h3")?.textContent}`),
            toasts: document.getElementById("toasts")?.textContent, focus: document.activeElement?.outerHTML.slice(0, 200), tab: location.hash})""")

    def drag(self, start, end, steps=6):
        self.mouse("mousePressed", *start, button="left", clickCount=1)
        for i in range(1, steps + 1):
            self.mouse("mouseMoved", *(a + (b - a) * i / steps for a, b in zip(start, end)), button="left", buttons=1)
        self.mouse("mouseReleased", *end, button="left", clickCount=1)

    def key(self, name, code=0, text=""):
        more = {"windowsVirtualKeyCode": code, **({"text": text} if text else {})}
        self.call("Input.dispatchKeyEvent", type="keyDown" if text else "rawKeyDown", key=name, **more)
        self.call("Input.dispatchKeyEvent", type="keyUp", key=name, **more)

    def touch(self, kind, *points):
        self.call("Input.dispatchTouchEvent", type=kind, touchPoints=[{"x": x, "y": y, "id": i} for i, (x, y) in enumerate(points)])

    def picture(self, path, quality=None):
        form = {"format": "jpeg", "quality": quality} if quality else {"format": "png"}
        with open(path, "wb") as f:
            f.write(base64.b64decode(self.call("Page.captureScreenshot", **form)["data"]))

    def tree(self):
        """The accessibility tree: [{role, name, ...}] of what is not ignored."""
        nodes = self.call("Accessibility.getFullAXTree")["nodes"]
        return [{"role": n.get("role", {}).get("value", ""), "name": n.get("name", {}).get("value", ""),
                 "focusable": any(p["name"] == "focusable" and p["value"].get("value") for p in n.get("properties", []))}
                for n in nodes if not n.get("ignored")]

    def close(self):
        try:
            os.killpg(self.process.pid, signal.SIGKILL)  # the group that was started here
        except ProcessLookupError:
            pass
        self.process.wait()
        shutil.rmtree(self.folder, ignore_errors=True)
