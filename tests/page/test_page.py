"""test_page.py PICTURES: what users do on the page, in a real browser, against tests/page/fake.py."""
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
CONTRAST = """(() => {
  const lum = (c) => { const [r, g, b] = c.map((v) => { v /= 255; return v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4; });
    return 0.2126 * r + 0.7152 * g + 0.0722 * b; };
  const parse = (text) => { const n = text.match(/[\\d.]+/g).map(Number); return text.startsWith("color(srgb")
    ? [n[0] * 255, n[1] * 255, n[2] * 255, n[3] ?? 1] : [n[0], n[1], n[2], n[3] ?? 1]; };
  const under = (node) => { for (; node; node = node.parentElement) { const c = parse(getComputedStyle(node).backgroundColor);
    if (c[3] > 0.6) return c; } return [0, 0, 0, 1]; };
  const bad = [];
  for (const node of document.querySelectorAll("body *")) {
    if (![...node.childNodes].some((n) => n.nodeType === 3 && n.data.trim())) continue;
    if (!node.checkVisibility({visibilityProperty: true}) || node.closest("svg, :disabled, [aria-disabled], .visually-hidden, .skip")) continue;
    const a = lum(parse(getComputedStyle(node).color)), b = lum(under(node));
    const ratio = (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05);
    if (ratio < 4.5) bad.push(`${node.textContent.trim().slice(0, 30)}: ${ratio.toFixed(2)}`);
  }
  return bad; })()"""


def free_port():
    """One that is free, also while the service is away: the kernel gives it to nobody who connects."""
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

    def visits(self):
        return json.load(urllib.request.urlopen(self.url + "api/v1/visits", timeout=60))["visits"]

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


SHIFT = 8


def zoomed(b):
    return b.box("#picture")[2] / b.box("#stage")[2]


# --- what users do ---

def test_picture(b, fake):
    b.wait("Number(document.getElementById('stage').dataset.pictures) > 5")
    b.wait("document.getElementById('explain').hidden && document.getElementById('state-word').textContent === 'Live'")
    check(b.js("document.getElementById('age').hidden"), "the age of a fresh picture is shown beside its delay")
    first = b.js("document.getElementById('canvas').toDataURL()")
    b.wait(f"document.getElementById('canvas').toDataURL() !== {json.dumps(first)}")
    check(len(fake.posts("/api/v1/views")) >= 1, "no view of its own")
    check(fake.posts("/api/v1/views")[0]["method"] == "clear", "the first picture is not the clear one")
    b.wait("document.getElementById('tag-left').textContent === 'Clear · 3 % remembered, up to 4 s old · 1 % filled in'")
    b.click("#hint-close")
    b.wait("document.getElementById('hint').hidden")


def test_cut_slider(b, fake):
    value = "document.getElementById('cut-value').textContent"
    b.wait(f"/^\\d+\\.\\d+ m · \\d+\\.\\d px$/.test({value})")
    check(pressed(b, "cut-auto"), "the cut is not automatic")
    check(b.js("document.getElementById('histogram-path').getAttribute('d').split('L').length") > 60, "no histogram")
    x, y, w, _ = b.box("#cut")
    b.click((x + 0.2 * w, y))
    far = expect(lambda: isinstance(last(fake, "cut_px"), float) and last(fake, "cut_px"))
    check(far and 15 > far > 1, f"the cut is at {far} px")
    check(not pressed(b, "cut-auto"), "still automatic")
    share = b.js("Number(document.getElementById('histogram-removed').getAttribute('width'))")
    check(65 < share < 75, f"{share} % are drawn as removed")
    check(b.js("document.getElementById('cut').getAttribute('aria-valuetext')").endswith(" m"), "no metres")
    b.key("ArrowLeft", 37)
    check(expect(lambda: last(fake, "cut_px") > far), "the left arrow does not go nearer")
    x, y, *_ = b.box("#stage")
    before = last(fake, "cut_px")
    b.mouse("mouseWheel", x, y, deltaX=0, deltaY=-240, modifiers=SHIFT)
    check(expect(lambda: last(fake, "cut_px") > before), "the wheel with Shift does not move the cut")
    b.js("document.getElementById('cut').focus()")
    b.key("Home", 36)
    check(expect(lambda: last(fake, "cut_px") == 9999), "the near end removes something")
    check("nothing is removed" in b.js(value), "the near end is not announced")
    b.click("#cut-auto")
    check(expect(lambda: last(fake, "cut_px") is None), "Auto is not the service's own cut")
    b.wait(f"/ m/.test({value})")
    fake.set(status={"live": {"cut_px": None}})
    b.wait(f"{value}.includes('nothing stands in front')")
    fake.set(status={"live": {"cut_px": 9.0}})
    b.wait(f"{value}.includes('9.0 px')")


def test_remove(b, fake):
    posts = lambda: [r["body"] for r in fake.log() if r["method"] == "POST" and r["path"].endswith("/remove")]
    toasts = "document.getElementById('toasts').textContent"
    b.click("#stage")
    b.wait(f"{toasts}.includes('Removed. Click there again')")
    check([sorted(p) for p in posts()] == [["x", "y"]], f"asked: {posts()}")
    b.wait("document.getElementById('restore').textContent.includes('1 removed')")
    b.click("#stage")
    b.wait(f"{toasts}.includes('It is back in the picture')")
    b.wait("document.getElementById('restore').hidden && document.getElementById('ring').hidden")
    b.js("document.getElementById('stage').focus()")
    b.key("ArrowLeft", 37)
    b.key("Enter", 13, "\r")
    b.wait("!document.getElementById('restore').hidden")
    check(posts()[-1]["x"] < posts()[0]["x"], "the cross-hair is not asked about")
    b.click("#restore")
    b.wait("document.getElementById('restore').hidden")
    check(posts()[-1] == {"clear": True}, "not all are brought back")
    view = [r["path"] for r in fake.log() if r["path"].startswith("/stream/v")][-1].split("/")[-1]
    fake.set(refuse={f"/api/v1/views/{view}/remove": [409, "no disparity is known at this point"]})
    b.click("#stage")
    b.wait(f"{toasts}.includes('No disparity is known')")
    check(b.js("document.getElementById('restore').hidden && document.getElementById('ring').hidden"), "counted as removed")
    fake.set(refuse={})


def test_expired(b, fake):
    """A view that has expired is made again; what was removed from it is not."""
    b.click("#stage")
    b.wait("!document.getElementById('restore').hidden")
    fake.set(forget_views=True)
    b.wait("document.getElementById('toasts').textContent.includes('has a new view') && document.getElementById('restore').hidden")
    check(fake.posts("/api/v1/views")[-1]["method"] == "clear", "it is another picture")


def test_remove_label(b, fake):
    b.wait("document.querySelectorAll('.chip').length > 3")
    check(b.js("document.getElementById('labels-caption').textContent") == "Also remove", "the chips keep labels clear")
    b.click("#chips .chip:nth-child(2)")
    check(expect(lambda: last(fake, "remove_label") == "Building"), "the chip does not remove its label")
    b.wait("document.getElementById('tag-left').textContent.includes('without Building')")
    b.click("#chips .chip:first-child")
    check(expect(lambda: last(fake, "remove_label") == ""), "Nothing does not clear the label")
    check(last(fake, "focus_label") == "never", "see-through's label changed")


def test_marks(b, fake):
    check(fake.posts("/api/v1/views")[0].get("tint"), "what is old is not tinted")
    for name, on in (("outline", True), ("tint", False), ("outline", False), ("tint", True)):
        b.click(f"#{name}")
        check(expect(lambda: last(fake, name) == on), f"{name} is not {on}")
        check(pressed(b, name) == on, f"{name} is shown as something else")


def test_compare_camera(b, fake):
    b.click("#compare")
    check(expect(lambda: any(p.get("cut_px") == 9999 and not p.get("tint") for p in fake.posts("/api/v1/views")[-1:])), "no camera")
    b.wait("!document.getElementById('canvas-plain').hidden")
    check(b.js("document.getElementById('tag-right').textContent") == "Camera", "not called camera")
    count = len(fake.posts("/api/v1/views"))
    b.js("document.getElementById('outline').click()")
    check(expect(lambda: len(fake.posts("/api/v1/views")) == count + 1), "no outline, or one in the camera's picture")
    b.js("document.getElementById('outline').click()")
    mode(b, "sst")
    check(expect(lambda: any(p.get("method") == "refocus" for p in fake.posts("/api/v1/views"))), "see-through is compared with the camera")
    mode(b, "clear")
    b.wait("document.getElementById('tag-right').textContent === 'Camera' && !document.getElementById('canvas-plain').hidden")
    b.click("#compare")
    b.wait("document.getElementById('canvas-plain').hidden")


def fresh(b, fake):
    """The page as if opened for the first time."""
    fake.set(forget_views=True)
    b.js("window.old = true; localStorage.clear()")
    b.call("Page.reload")
    b.wait("!window.old && Number(document.getElementById('stage')?.dataset.pictures) > 1")


def test_unknown(b, fake):
    """Depths that are not known yet, and a service that has no clear picture."""
    live = json.load(urllib.request.urlopen(fake.url + "api/v1/status", timeout=60))["live"]
    known = {key: live[key] for key in ("range_px", "histogram", "cut_px")}
    fake.set(status={"live": dict.fromkeys(known)})
    fresh(b, fake)
    b.wait("document.getElementById('cut').disabled")
    b.wait("document.getElementById('cut-value').textContent.includes('depths are not known yet')")
    fake.set(status={"live": {**known, "histogram": None}})
    b.wait("!document.getElementById('cut').disabled && document.getElementById('histogram').hasAttribute('data-empty')")
    fake.set(status={"live": known})
    b.wait("!document.getElementById('histogram').hasAttribute('data-empty')")
    fake.set(old=True)
    fresh(b, fake)
    b.wait("document.getElementById('viewer').dataset.mode === 'sst' && document.getElementById('tag-left').textContent === 'See-through'")
    fake.set(old=False)
    fresh(b, fake)
    b.wait("document.getElementById('viewer').dataset.mode === 'clear'")


def test_mode(b, fake):
    mode(b, "sst")
    check(expect(lambda: last(fake, "method") == "sst"), "no see-through")
    check("focuses on" in b.js("document.getElementById('stage').getAttribute('aria-label')"), "the keys are not announced")
    check(b.js("document.getElementById('focus').checkVisibility() && !document.getElementById('cut').checkVisibility()"), "controls")
    b.wait("document.getElementById('tag-left').textContent === 'See-through'")
    b.click("#hint-close")


def test_focus(b, fake):
    x, y, w, _ = b.box("#focus")
    b.click((x - 0.4 * w, y))
    near = expect(lambda: isinstance(last(fake, "focus_px"), float) and last(fake, "focus_px"))
    check(near and near > 9, f"the left end of the slider is not near: {near}")
    check("px" in b.js("document.getElementById('focus-value').textContent"), "no figure")
    check(" m" in b.js("document.getElementById('focus').getAttribute('aria-valuetext')"), "no metres")
    b.key("ArrowRight", 39)
    check(expect(lambda: last(fake, "focus_px") < near), "the right arrow does not go farther")
    x, y, *_ = b.box("#stage")
    before = last(fake, "focus_px")
    b.mouse("mouseWheel", x, y, deltaX=0, deltaY=-240, modifiers=SHIFT)
    check(expect(lambda: last(fake, "focus_px") != before), "the wheel with Shift does not change the focus")
    b.click("#auto")
    check(expect(lambda: last(fake, "focus_px") is None), "Auto is not the service's own focus")


def test_pick(b, fake):
    b.wait("document.querySelectorAll('.chip').length > 3")  # labels have names
    x, y, w, h = b.box("#stage")
    b.click((x, y))  # the walker, before the car
    b.wait("!document.getElementById('pick').hidden")
    text = b.js("document.getElementById('pick').textContent")
    check("Car" in text and "In front: Pedestrian" in text, f"the card says: {text}")
    seen = expect(lambda: last(fake, "focus_px"))
    check(any(r["path"].endswith("/pick") for r in fake.log()), "nothing was asked")
    check(not b.js("document.getElementById('ring').hidden"), "no ring")
    b.click("#pick .pick-buttons button:last-child")
    check(expect(lambda: last(fake, "focus_px") > seen * 1.5), "what stands in front is not focused")
    b.click((x, y))
    b.wait("!document.getElementById('pick').hidden")
    b.mouse("mouseWheel", x, y, deltaX=0, deltaY=-240, modifiers=SHIFT)  # the focus moves: what is marked is not what is shown any more
    b.wait("document.getElementById('pick').hidden && document.getElementById('ring').hidden")
    b.js("document.getElementById('stage').focus()")
    b.key("ArrowLeft", 37)
    b.key("Enter", 13, "\r")
    b.wait("document.getElementById('pick').contains(document.activeElement)")
    b.key("Escape", 27)
    b.wait("document.getElementById('pick').hidden && document.activeElement.id === 'stage'")


def test_follow(b, fake):
    """What was picked and moves is followed by focus and ring, and said to be gone when it has gone."""
    x, y, w, h = b.box("#stage")
    size = b.js("[document.getElementById('canvas').width, document.getElementById('canvas').height]")
    walker = {"track": 7, "state": "seen", "label": 10, "name": "Pedestrian", "box": [0, 0, *size], "speed_px_s": [0, 0],
              "disparity_px": 8.5, "distance_m": None, "seconds": 2.0}
    fake.set(tracks=[walker])
    b.click((x, y))
    b.wait("!document.getElementById('pick').hidden")
    b.click("#pick .pick-buttons button:last-child")  # "In front: Pedestrian"
    check(expect(lambda: last(fake, "follow_track") == 7), "what moves is not followed")
    b.wait("document.getElementById('tag-left').textContent.includes('following Pedestrian')")
    left = "document.getElementById('ring').style.left"
    b.wait(f"!document.getElementById('ring').hidden && {left} === '50%'")
    fake.set(tracks=[{**walker, "box": [0.5 * size[0], 0, size[0], size[1]], "state": "covered"}])
    b.wait(f"{left} === '75%' && document.getElementById('ring').dataset.state === 'covered'")
    fake.set(tracks=[])
    b.wait("document.getElementById('toasts').textContent.includes('Pedestrian is gone')")
    b.wait("document.getElementById('ring').hidden && !document.getElementById('tag-left').textContent.includes('following')")
    check(expect(lambda: last(fake, "focus_px") == 8.5), "the focus does not stay where it was last")

    count = lambda: len([b for b in fake.posts("/api/v1/views") if b.get("follow_track") == 7])
    asked = count()
    fake.set(tracks=[walker])  # on a card that is older than what it shows
    b.click((x, y))
    b.wait("!document.getElementById('pick').hidden")
    fake.set(tracks=[])
    b.click("#pick .pick-buttons button:last-child")
    b.wait("document.getElementById('pick').hidden && document.getElementById('toasts').textContent.includes('Pedestrian is gone')")
    check(count() == asked, "what is gone is followed")


def test_label(b, fake):
    b.wait("document.querySelectorAll('.chip').length > 3")
    b.click("#chips .chip:nth-child(2)")
    check(expect(lambda: last(fake, "focus_label") == "Building"), "the chip does not choose its label")
    check(last(fake, "follow") is True, "the focus does not follow it")
    check(b.js("document.querySelector('.chip:nth-child(2)').getAttribute('aria-pressed')") == "true", "not shown as chosen")
    b.wait("document.getElementById('tag-left').textContent.includes('Building')")
    b.click("#chips .chip:first-child")
    check(expect(lambda: last(fake, "focus_label") == ""), "Everything does not clear the label")


def test_compare(b, fake):
    b.click("#compare")
    check(expect(lambda: any(p.get("method") == "refocus" for p in fake.posts("/api/v1/views"))), "no plain view")
    b.wait("!document.getElementById('canvas-plain').hidden")
    x, y, w, _ = b.box("#stage")
    b.drag((x, y), (x - 0.25 * w, y))
    at = b.js("Number(document.getElementById('divider').getAttribute('aria-valuenow'))")
    check(20 <= at <= 30, f"the divider is at {at} %")
    b.js("document.getElementById('divider').focus()")
    b.key("ArrowRight", 39)
    check(b.js("Number(document.getElementById('divider').getAttribute('aria-valuenow'))") == at + 2, "the key does not move it")
    check("25%" not in b.js("document.getElementById('canvas-plain').style.clipPath"), "the picture does not follow")
    b.click("#compare")
    b.wait("document.getElementById('canvas-plain').hidden")


def test_sweep(b, fake):
    b.js("document.getElementById('sweep-speed').value = '4'")
    b.click("#sweep")
    count = len(fake.posts("/api/v1/views"))
    check(expect(lambda: len(fake.posts("/api/v1/views")) > count + 5), "the sweep does not run")
    b.click("#sweep")
    check(rest(lambda: len(fake.posts("/api/v1/views")), 0.5) is not None, "the sweep does not pause")
    b.click("#auto")


def test_overlay(b, fake):
    for kind in ("disparity", "labels"):
        b.js(f"document.querySelector('input[name=overlay][value={kind}]').click()")
        b.wait("!document.getElementById('canvas-overlay').hidden && !document.getElementById('legend').hidden")
        check(any(r["path"] == f"/snapshot/{kind}" for r in fake.log()), f"{kind} was not asked for")
    check("Pedestrian" in b.js("document.getElementById('legend').textContent"), "no legend")
    b.js("document.querySelector('input[name=overlay]').click()")
    b.wait("document.getElementById('canvas-overlay').hidden")


def test_camera_large(b, fake):
    """What a camera sees, in the large place: the one in the middle, or any of the grid."""
    b.js("document.querySelector('input[name=overlay][value=camera]').click()")
    b.wait("!document.getElementById('canvas-camera').hidden && document.getElementById('tag-left').textContent.includes('Camera r2c2')")
    b.click("#tab-overview")
    b.click("[data-name=r0c0]")
    b.js("document.querySelector('#camera .small').click()")
    b.wait("document.getElementById('tag-left').textContent.includes('Camera r0c0')")
    check(expect(lambda: any(r["path"] == "/stream/camera/r0c0" for r in fake.log())), "the camera was not asked for")
    b.wait("!document.getElementById('canvas-camera').hidden")
    b.click("[data-name=r0c0]")
    b.js("document.querySelector('input[name=overlay]').click()")
    b.wait("document.getElementById('canvas-camera').hidden && !document.getElementById('tag-left').textContent.includes('Camera')")
    b.wait("[...document.querySelectorAll('.cell canvas')].filter((c) => c.width > 1).length > 3")  # pictures in the grid


def test_zoom(b, fake):
    """The wheel zooms where the pointer is, dragging moves, keys do both; points stay those of the picture."""
    x, y, w, h = b.box("#stage")
    left, top = x - w / 2, y - h / 2
    for _ in range(3):
        b.mouse("mouseWheel", left + 0.75 * w, y, deltaX=0, deltaY=-200)
    check(expect(lambda: 2 < zoomed(b) < 4), f"zoomed {zoomed(b)} times")
    px, _, pw, _ = b.box("#picture")
    check(abs((left + 0.75 * w - (px - pw / 2)) / pw - 0.75) < 0.01, "the point under the pointer moved")
    b.drag((x, y), (x + 100, y))
    check(expect(lambda: abs(b.box("#picture")[0] - px - 100) < 3), "dragging does not move the picture")
    mode(b, "sst")
    b.click((x, y))
    b.wait("!document.getElementById('pick').hidden")
    at = [r for r in fake.log() if r["path"].endswith("/pick")][-1]["query"]
    px, py, pw, ph = b.box("#picture")
    width, height = b.js("[document.getElementById('canvas').width, document.getElementById('canvas').height]")
    want = [(x - (px - pw / 2)) / pw * width, (y - (py - ph / 2)) / ph * height]
    check(abs(float(at["x"]) - want[0]) < 2 and abs(float(at["y"]) - want[1]) < 2, f"asked about {at}, not {want}")
    rx, ry, *_ = b.box("#ring")
    check(abs(rx - x) < 3 and abs(ry - y) < 3, "the ring is elsewhere")
    b.click("#auto")
    b.js("document.getElementById('stage').focus()")
    b.key("0", 48, "0")
    check(zoomed(b) == 1 and b.js("document.getElementById('zoom-whole').hidden"), "0 does not show the whole picture")
    b.key("z", 90, "z")
    check(zoomed(b) > 1.2, "Z does not zoom")
    b.click("#zoom-whole")
    check(zoomed(b) == 1, "the button does not show the whole picture")


def test_light(b, fake):
    """Brightness and colours of the page stay over a reload."""
    b.click("#light")
    b.wait("!document.getElementById('light-box').hidden")
    b.js("(() => { const r = document.getElementById('brightness'); r.value = 40; r.dispatchEvent(new Event('input')); })()")
    check(b.js("document.querySelector('#tone feFuncR').getAttribute('exponent')") == "0.5", "the tone curve does not follow")
    for theme, colour in (("day", "rgb(243, 245, 247)"), ("night", "rgb(13, 16, 20)")):
        b.js(f"document.querySelector('#theme input[value={theme}]').click()")
        check(b.js("getComputedStyle(document.body).backgroundColor") == colour, f"{theme} is {colour}")
    b.js("window.old = true; location.reload()")
    b.wait("!window.old && Number(document.getElementById('stage')?.dataset.pictures) > 1")
    check(b.js("document.documentElement.dataset.theme") == "night" and pressed(b, "light"), "forgotten on reload")
    b.click("#light")
    b.click("#brightness-reset")
    b.js("document.querySelector('#theme input').click()")
    b.click("#stage")
    b.wait("document.getElementById('light-box').hidden")
    b.js("document.getElementById('auto').click()")
    check(not pressed(b, "light"), "brightness is not reset")


def test_adjust(b, fake):
    b.click("#adjust")
    b.wait("!document.getElementById('drawer').hidden && document.activeElement.id === 'adjust-close'")
    b.js("(() => { const i = document.getElementById('adjust-c1'); i.value = 0.1; i.dispatchEvent(new Event('input')); })()")
    check(expect(lambda: last(fake, "c1") == 0.1), "the setting is not sent")
    b.js("document.getElementById('adjust-reset').click()")
    check(expect(lambda: "c1" not in fake.posts("/api/v1/views")[-1]), "no reset")
    b.key("Escape", 27)
    b.wait("document.getElementById('drawer').hidden && document.activeElement.id === 'adjust'")


def test_cameras(b, fake):
    fake.set(cameras={"r3c2": {"state": "absent", "reason": "Nothing is plugged into port 2-1.9"}},
             status={"state": "degraded", "reason": "35 of 36 cameras: r3c2 is absent", "capture": {"present": 35}},
             events=[{"level": 1, "type": "camera-lost", "message": "Camera r3c2 was unplugged"}])
    b.wait("document.querySelector('[data-name=r3c2]').dataset.kind === 'bad'")
    check(b.js("document.querySelector('[data-name=r3c2] b').textContent") == "×", "told by colour alone")
    check("Nothing is plugged" in b.js("document.querySelector('[data-name=r3c2]').title"), "no reason")
    b.wait("document.getElementById('state-word').textContent === 'Degraded'")  # it may have been asked for just before
    b.wait("document.getElementById('latest').textContent.includes('unplugged')")
    b.click("[data-name=r3c2]")
    b.wait("document.getElementById('camera').textContent.includes('Nothing is plugged')")
    b.click("[data-name=r0c0]")
    b.wait("document.querySelector('#camera .none').hidden")
    check(any(r["path"] == "/snapshot/camera/r0c0" for r in fake.log()), "no thumbnail")
    b.click("[data-name=r0c0]")
    fake.set(cameras={"r1c1": {"lost": 7}})
    b.wait("document.querySelector('[data-name=r1c1]').classList.contains('lossy')")
    fake.set(cameras={"r3c2": {"state": "streaming", "reason": ""}},
             status={"state": "capturing", "reason": "", "capture": {"present": 36}})


def test_events(b, fake):
    b.click("#tab-events")
    b.js("document.querySelector('input[name=level][value=warning]').click()")
    b.wait("document.querySelectorAll('#events li').length === 1")
    fake.set(events=[{"level": 2, "type": "storage", "message": "The disk takes nothing"}])
    b.wait("document.querySelector('#events li').textContent.includes('The disk takes nothing')")
    b.wait("document.getElementById('toasts').textContent.includes('The disk takes nothing')")
    b.js("document.querySelector('input[name=level][value=info]').click()")
    fake.set(events=[{"level": 0, "type": "visit", "message": "Pedestrian came in gate", "data": {"label": "Pedestrian", "zones": ["gate"], "active": False}},
                     {"level": 0, "type": "motion", "message": "motion in street began", "data": {"zone": "street"}, "ago_s": 7200}])
    rows = "document.querySelectorAll('#events li').length"
    choose = lambda name, value: b.js(f"(() => {{ const s = document.getElementById('events-{name}'); s.value = '{value}'; s.dispatchEvent(new Event('change')); }})()")
    b.wait("document.querySelectorAll('#events-zone option').length === 3")
    choose("zone", "street")
    b.wait(f"{rows} === 1 && document.querySelector('#events li').textContent.includes('street')")
    choose("since", "3600")
    b.wait(f"{rows} === 0 && document.getElementById('events-state').textContent !== ''")
    choose("zone", "gate")
    choose("label", "Pedestrian")
    b.wait(f"{rows} === 1")
    for name in ("zone", "label", "since"):
        choose(name, "")
    b.wait(f"{rows} > 3")


def test_recordings(b, fake):
    b.click("#tab-recordings")
    b.click("#record")
    check(expect(lambda: fake.posts("/api/v1/record")) == [{"action": "start"}], "recording does not start")
    b.wait("/Stop 0\\d:\\d\\d/.test(document.getElementById('record-text').textContent)")
    b.wait("document.querySelectorAll('.recording').length === 5")  # nothing moves any more under what is clicked
    b.click("#record")
    check(expect(lambda: len(fake.posts("/api/v1/record")) == 2), "recording does not stop")
    b.wait("document.querySelectorAll('.recording').length === 4")
    b.click(".recording:last-child summary")
    b.wait("document.querySelector('.recording:last-child').open")
    check(b.js("[...document.querySelectorAll('.recording:last-child .take a')].map((a) => a.download.slice(20)).join()") == ".mkv,.tar",
          "a recording cannot be taken away")
    check("without the first 20 s" not in b.js("document.querySelector('.recording:last-child select').textContent")
          and b.js("[...document.querySelectorAll('.recording select')].filter((s) => s.textContent.includes('without the first 20 s')).length") == 2,
          "what a video lacks is not said")
    b.js("const s = document.querySelector('.recording:last-child select'); s.value = '.r2c3'; s.dispatchEvent(new Event('change'))")
    check(b.js("document.querySelector('.recording:last-child .take a').download.endsWith('Z.r2c3.mkv')"), "no camera's video")
    check(b.js("document.querySelectorAll('.moment').length") == 3, "snapshots and exports are not listed")
    b.click(".moment:last-child .danger")
    b.wait("document.getElementById('delete').open && document.getElementById('delete-text').textContent.includes('31 MB')")
    b.click("#delete-no")
    check(not fake.posts("/api/v1/delete"), "deleted without a yes")
    b.click(".moment:last-child .danger")
    b.click("#delete-yes")
    check(expect(lambda: len(fake.posts("/api/v1/delete")) == 1), "not deleted")
    b.wait("document.querySelectorAll('.moment').length === 2")
    b.click(".recording:last-child .export button")
    export = expect(lambda: fake.posts("/api/v1/export"))
    check(export and export[0]["time"].endswith("Z") and export[0]["recording"], f"no export: {export}")
    b.wait("document.querySelector('.made a')?.getAttribute('href').endsWith('.tar')")
    b.click("#snapshot")
    check(expect(lambda: fake.posts("/api/v1/snapshot") == [{}]), "no snapshot")
    check(expect(lambda: any(n.startswith("sst-") and n.endswith(".jpg") for n in os.listdir(b.folder))), "no picture saved")
    fake.set(refuse={"/api/v1/record": [507, "The disk is full: remove recordings or raise storage.quota_gb"]})
    b.click("#record")
    b.wait("document.getElementById('toasts').textContent.includes('The disk is full')")
    fake.set(refuse={})
    b.click("#tab-overview")


def test_visits(b, fake):
    """Cards of who came, filtered; one opens large, and leads to the recording of that moment."""
    b.click("#tab-visits")
    cards = "document.querySelectorAll('#visits .visit')"
    b.wait(f"{cards}.length === 4 && [...document.querySelectorAll('#visits img')].some((i) => i.naturalWidth > 0)")
    text = b.js("document.querySelector('#visits .visit').textContent")
    check("Pedestrian" in text and "left to right" in text and "gate" in text and "6.1 m" in text, f"the card says {text}")
    check("gate, crossed drive forward" in text, f"the card of who crossed a line says {text}")
    check("behind the foreground" in b.js(f"{cards}[3].textContent") and "behind" not in text, "who is hidden is not said to be")
    b.js("(() => { const s = document.getElementById('visits-label'); s.value = 'Car'; s.dispatchEvent(new Event('change')); })()")
    b.wait(f"{cards}.length === 1 && {cards}[0].textContent.includes('Car')")
    b.js("(() => { const s = document.getElementById('visits-label'); s.value = ''; s.dispatchEvent(new Event('change')); })()")
    b.wait(f"{cards}.length === 4")
    b.js("(() => { const s = document.getElementById('visits-zone'); s.value = 'street'; s.dispatchEvent(new Event('change')); })()")
    b.wait(f"{cards}.length === 2")
    b.js("(() => { const s = document.getElementById('visits-zone'); s.value = ''; s.dispatchEvent(new Event('change')); })()")
    b.wait(f"{cards}.length === 4")
    b.click("#visits .visit:nth-child(2)")
    b.wait("document.getElementById('visit').open && document.getElementById('visit-title').textContent.includes('Car')")
    b.click("#visit-play")  # nothing was recorded then
    b.wait("document.getElementById('visit-facts').textContent.includes('no recording')")
    b.key("ArrowRight", 39)
    b.wait("document.getElementById('visit-title').textContent.includes('Pedestrian')")
    check(len(b.js("document.getElementById('visit-way').getAttribute('points')").split()) == 3, "no way")
    b.click("#visit-kind label:nth-of-type(2)")
    b.wait("document.getElementById('visit-image').src.endsWith('/camera')")
    b.click("#visit-keep")
    b.wait("document.getElementById('visit-keep').getAttribute('aria-pressed') === 'true'")
    check("kept" in b.js("document.getElementById('visit-facts').textContent"), "not said to be kept")
    b.click("#visit-export")
    b.wait("document.getElementById('visit-facts').textContent.includes('light field is kept as')")
    b.js("document.querySelector('#mode input[value=clear]').click()")
    b.click("#visit-play")
    b.wait("!document.getElementById('visit').open && !document.getElementById('replay').hidden")
    cuts = lambda path: [p["cut_px"] for p in fake.posts(path) if "cut_px" in p]
    check(expect(lambda: cuts("/replay/api/v1/views")[-1:] == [8.9]), f"the visitor is removed with what stands in front: {cuts('/replay')}")
    b.click("#replay-live")
    b.wait("document.getElementById('replay').hidden")
    check(expect(lambda: cuts("/api/v1/views")[-1:] == [None]), "the live picture has the cut of the visit")
    b.js("document.querySelector('#mode input[value=sst]').click()")
    b.click("#visits .visit:last-child")
    b.wait("document.getElementById('visit').open")
    b.click("#visit-delete")
    check(not any("delete" in (r or {}) for r in fake.posts("/api/v1/visits")), "deleted by one click")
    b.wait("document.getElementById('visit-delete').textContent.includes('Really')")
    b.click("#visit-delete")
    b.wait(f"{cards}.length === 3")
    b.click("#visit-close")
    name = fake.visits()[1]["visit"]
    b.js(f"location.hash = '#visit={name}'")
    b.wait("document.getElementById('visit').open && document.getElementById('visit-title').textContent.includes('Car')")
    b.click("#visit-close")
    b.js("history.replaceState(null, '', '/')")
    b.click("#tab-overview")


def test_timeline(b, fake):
    """A day below the picture: visits and recordings on it; a moment is chosen by keys or a click, and plays."""
    check(b.js("document.getElementById('timeline').hidden"), "a timeline beside the cameras")
    b.click("#tab-visits")
    b.wait("!document.getElementById('timeline').hidden")
    time.sleep(1)
    if not b.js("document.querySelectorAll('.day .visited').length"):
        b.click("#day-before")  # it is shortly after midnight
    b.wait("document.querySelectorAll('.day .visited').length > 0 && document.querySelectorAll('.day .recorded').length > 0")
    b.js("document.getElementById('day').focus()")
    b.key("End", 35)
    b.key("PageUp", 33)
    said = b.js("document.getElementById('day').getAttribute('aria-valuetext')")
    check("Pedestrian" in said and "recorded" in said and "not recorded" not in said, f"the moment is {said}")
    left = b.js("parseFloat(document.querySelector('.day .cursor').style.left)")
    x, y, w, h = b.box("#day")
    for _ in range(4):
        b.mouse("mouseWheel", x - w / 2 + w * left / 100, y, deltaX=0, deltaY=-100)
    b.wait("Number(document.querySelectorAll('#day-ticks span').length) > 2")
    width = b.js("Math.max(...[...document.querySelectorAll('.day .recorded')].map((n) => parseFloat(n.style.width)))")
    check(width > 1.5, f"the wheel does not stretch the day: {width} %")
    b.mouse("mouseMoved", x, y - 300)
    b.js("document.getElementById('day').focus()")
    b.key("End", 35)
    b.key("PageUp", 33)
    b.key("Enter", 13, "\r")
    b.wait("!document.getElementById('replay').hidden && document.querySelector('.day .played') !== null")
    b.click("#replay-live")
    b.wait("document.getElementById('replay').hidden")
    b.click("#tab-overview")
    b.wait("document.getElementById('timeline').hidden")


def test_notify(b, fake):
    """What comes is told by the browser, if it is of the chosen kind, also behind other windows."""
    b.call("Browser.grantPermissions", permissions=["notifications"], origin=fake.url.rstrip("/"))
    b.click("#tab-visits")
    b.js("window.notes = []; window.Notification = class extends EventTarget { constructor(title, more) { super(); notes.push([title, more.tag]); "
         "this.close = () => {}; window.note = this; } static permission = 'granted'; static requestPermission = async () => 'granted'; }")
    b.click("#notify")
    b.wait("document.getElementById('notify').getAttribute('aria-pressed') === 'true'")
    b.js("(() => { const s = document.getElementById('visits-label'); s.value = 'Car'; s.dispatchEvent(new Event('change')); })()")
    expect(lambda: any(r["path"] == "/api/v1/events/stream" for r in fake.log()))
    time.sleep(0.5)  # it listens
    car = fake.visits()[1]["visit"]
    for label, zones, active in (("Pedestrian", ["gate"], True), ("Car", ["street"], True), ("Car", ["street"], False)):
        fake.set(events=[{"level": 0, "type": "visit", "message": f"{label} came", "data":
                          {"visit": car, "active": active, "label": label, "zones": zones}}])
    b.wait("window.notes.length > 0")
    time.sleep(0.5)
    crossing = {"visit": car, "label": "Car", "zone": "drive", "direction": "forward"}
    line = {"level": 0, "type": "line", "message": "Car crossed drive forward", "data": crossing}
    fake.set(events=[line])  # of a visit that was told already
    time.sleep(0.5)
    check(b.js("window.notes.map((n) => n[0]).join()") == "Car in street", b.js("JSON.stringify(window.notes)"))
    b.js("(() => { const s = document.getElementById('visits-zone'); s.add(new Option('drive')); s.value = 'drive'; })()")
    fake.set(events=[line])
    b.wait("window.notes.length === 2 && window.notes[1][0] === 'Car crossed drive forward'")
    b.js("(() => { const s = document.getElementById('visits-zone'); s.value = ''; s.dispatchEvent(new Event('change')); })()")
    b.js("window.tones = 0; AudioContext.prototype.createOscillator = ((make) => function () { tones++; return make.call(this); })"
         "(AudioContext.prototype.createOscillator)")
    b.click("#notify-sound")
    b.wait("window.tones === 1")  # as an example
    pedestrian = fake.visits()[0]["visit"]
    b.js("document.getElementById('visits-label').value = ''")
    fake.set(events=[{"level": 0, "type": "visit", "message": "it came", "data": {"visit": pedestrian, "active": True, "label": "", "zones": []}}])
    b.wait("window.tones === 2 && window.notes.at(-1)[0] === 'Something moves'")
    b.click("#notify-sound")
    b.js("window.note.dispatchEvent(new Event('click'))")
    b.wait("document.getElementById('visit').open && document.getElementById('visit-title').textContent.includes('Pedestrian')")
    b.click("#visit-close")
    b.js("(() => { const s = document.getElementById('visits-label'); s.value = ''; s.dispatchEvent(new Event('change')); })()")
    b.click("#notify")
    b.wait("document.getElementById('notify').getAttribute('aria-pressed') === 'false'")
    b.click("#tab-overview")


def test_replay(b, fake):
    """A recording in the large place, with the controls of the picture of now; then back to that."""
    mode(b, "clear")
    replayed = lambda path: [r for r in fake.log() if r["path"].startswith("/replay/") and path in r["path"]]
    seconds = "(Number(document.getElementById('replay-at').value) / 1000)"
    b.click("#tab-recordings")
    b.wait("document.querySelectorAll('.recording').length === 4")
    if not b.js("document.querySelector('.recording').open"):
        b.click(".recording summary")
    b.click(".recording .take button")
    b.wait("!document.getElementById('replay').hidden")
    check(expect(lambda: replayed("/stream/")), "no moving picture of the recording")
    b.wait("document.getElementById('age').textContent === 'Playback'")
    b.wait(f"{seconds} > 1")  # it plays
    b.click("#replay-play")
    b.wait("document.getElementById('replay-play').getAttribute('aria-label') === 'Play'")
    b.js("(() => { const s = document.getElementById('replay-at'); s.value = 30000; s.dispatchEvent(new Event('input')); s.dispatchEvent(new Event('change')); })()")
    check(expect(lambda: [p for p in fake.posts("/api/v1/replay") if "time" in p]), "no moment is chosen")
    b.wait(f"Math.abs({seconds} - 30) < 0.2")
    b.click("#replay-on")
    b.wait(f"Math.abs({seconds} - 35) < 0.2")
    b.click("#cut-auto")
    b.js("(() => { const s = document.getElementById('cut'); s.value = 600; s.dispatchEvent(new Event('input')); })()")
    check(expect(lambda: [r for r in replayed("/api/v1/views/") if r["method"] == "POST" and "cut_px" in (r["body"] or {})]), "the cut is of another picture")
    b.js("document.querySelector('input[name=overlay][value=disparity]').click()")
    check(expect(lambda: replayed("/snapshot/disparity")), "the depths are of another picture")
    b.click("#overlay label:nth-of-type(1)")
    b.click("#compare")
    b.wait("!document.getElementById('canvas-plain').hidden")
    check(len({r["path"] for r in replayed("/stream/")}) > 1, "the compared picture is of another time")
    b.click("#compare")
    before = len(fake.posts("/api/v1/export"))
    b.click("#snapshot")
    check(expect(lambda: len(fake.posts("/api/v1/export")) > before), "a snapshot of a recording is no export")
    b.js("(() => { const s = document.getElementById('replay-speed'); s.value = 4; s.dispatchEvent(new Event('change')); })()")
    check(expect(lambda: [p for p in fake.posts("/api/v1/replay") if p.get("speed") == 4]), "no speed")
    before = len(replayed(""))
    b.click("#replay-live")
    b.wait("document.getElementById('replay').hidden && document.getElementById('age').textContent !== 'Playback'")
    check(expect(lambda: fake.posts("/api/v1/replay")[-1].get("close")), "the recording stays open")
    check(rest(lambda: len(replayed("")), 3) <= before + 2, "requests about the recording go on")
    mode(b, "sst")
    b.click("#tab-overview")


def test_zones(b, fake):
    """A zone is drawn, changed and deleted: with the mouse, and with keys alone."""
    posts = lambda: fake.posts("/api/v1/zones")
    names = lambda: [z["name"] for z in json.load(urllib.request.urlopen(fake.url + "api/v1/zones", timeout=60))["zones"]]
    shapes = "document.querySelectorAll('#zone-shapes .line').length"
    asked = lambda: len([r for r in fake.log() if r["path"].endswith(("/remove", "/pick"))])
    before = asked()
    b.wait("document.getElementById('explain').hidden")
    b.click("#zones")
    b.wait("document.getElementById('zone-list').textContent === 'gatewatched'")
    check(b.js(shapes) == 1, "the zone is not in the picture")
    b.click("#zone-new")
    b.wait("document.activeElement === document.getElementById('stage')")
    x, y, w, h = b.box("#stage")
    b.mouse("mousePressed", x - 0.2 * w, y - 0.1 * h, button="left", clickCount=1)
    for i in range(5):
        b.mouse("mouseMoved", x - 0.2 * w + 0.06 * i * w, y - 0.1 * h + 0.05 * i * h, button="left", buttons=1)
    b.mouse("mouseReleased", x + 0.04 * w, y + 0.1 * h, button="left", clickCount=1)
    b.wait("document.querySelectorAll('.corner:not(.more)').length === 4 && document.activeElement.id === 'zone-name'")
    b.click("#zone-save")
    b.wait("document.getElementById('zone-error').textContent.includes('needs a name')")
    b.js("document.getElementById('zone-name').focus()")
    b.call("Input.insertText", text="Back door")
    b.wait("document.getElementById('zone-name-note').textContent.includes('back-door')")
    b.js("[...document.querySelectorAll('#zone-labels .chip')].find((n) => n.textContent === 'Building').click()")
    check(b.js("document.querySelector('#zone-labels .chip').textContent") == "Pedestrian", "what moves is not named first")
    nx, ny, nw, _ = b.box("#zone-near")
    b.click((nx - 0.25 * nw, ny))
    b.wait("document.getElementById('zone-near-exact').value !== ''")
    b.js("(() => { const n = document.getElementById('zone-far-exact'); n.value = '40'; n.dispatchEvent(new Event('change')); })()")
    b.click("#zone-save")
    sent = expect(lambda: posts() and posts()[-1]["zones"][-1])
    check(sent["name"] == "back-door" and sent["labels"] == ["Building"] and not sent["mask"], f"sent: {sent}")
    (x0, y0), _, (x1, y1), _ = sent["points"]
    check(abs(x0 - 0.3) < 0.02 and abs(y0 - 0.4) < 0.02 and abs(x1 - 0.54) < 0.03 and abs(y1 - 0.6) < 0.03, f"at {sent['points']}")
    check(sent["near_px"] > sent["far_px"] and abs(sent["far_px"] - 560 * 0.12 / 40) < 0.01, f"depth: {sent}")
    b.wait("document.getElementById('zone-list').children.length === 2 && document.getElementById('zone-one').hidden")
    check("Building" in b.js("document.getElementById('zone-list').textContent"), "its label is not in the list")

    b.js("document.querySelectorAll('.zone')[1].focus()")  # renamed, its first corner moved, ignored: by keys
    b.key("Enter", 13, "\r")
    b.wait("document.activeElement.id === 'zone-name'")
    b.js("document.activeElement.select()")
    b.call("Input.insertText", text="tree")
    b.js("document.querySelector('.corner').focus()")
    b.key("ArrowRight", 39)
    b.key("ArrowRight", 39)
    check(b.js("document.activeElement.className") == "corner", "the corner loses the focus when it moves")
    b.js("document.getElementById('zone-mask').focus()")
    b.key(" ", 32, " ")
    fake.set(refuse={"/api/v1/zones": [400, "the zones are not applied, the old ones stay: sstd.yaml:9:3: unknown zone `back-door`"]})
    b.js("document.getElementById('zone-save').click()")
    b.wait("document.getElementById('zone-error').textContent.includes('unknown zone')")
    fake.set(refuse={})
    check(names() == ["gate", "back-door"], "something has changed")
    b.js("document.getElementById('zone-save').click()")
    b.wait("document.getElementById('zone-one').hidden")
    tree = posts()[-1]["zones"][-1]
    check(tree["name"] == "tree" and tree["mask"] and abs(tree["points"][0][0] - x0 - 0.02) < 0.001, f"sent: {tree}")

    b.js("document.getElementById('zone-new').click()")  # a triangle, corner by corner
    b.wait("document.activeElement === document.getElementById('stage')")
    for keys in (("ArrowLeft", 37, 3), ("ArrowDown", 40, 5), ("ArrowRight", 39, 6)):
        for _ in range(keys[2]):
            b.key(*keys[:2])
        b.key("Enter", 13, "\r")
    b.wait("!document.getElementById('zone-done').disabled")
    b.js("document.getElementById('zone-done').click()")
    b.call("Input.insertText", text="lawn")
    b.js("document.getElementById('zone-save').click()")
    b.wait("document.getElementById('zone-list').children.length === 3")
    check(len(posts()[-1]["zones"][-1]["points"]) == 3, "no triangle")
    check(asked() == before, "corners are clicks on the picture, too")
    b.click("#line-new")  # a line, dragged; then its direction
    b.wait("document.activeElement === document.getElementById('stage')")
    b.wait("!document.getElementById('line-help').hidden && document.getElementById('zone-help').hidden")
    b.drag((x - 0.25 * w, y + 0.2 * h), (x + 0.25 * w, y + 0.2 * h))
    b.wait("document.querySelectorAll('.corner').length === 2 && document.activeElement.id === 'zone-name'")
    check(not b.js("document.getElementById('zone-mask-box').checkVisibility()"), "a line can be ignored")
    arrows = "document.querySelector('#zone-shapes path.line.edited').getAttribute('d').split('M').length"
    both = b.js(arrows)
    b.call("Input.insertText", text="drive")
    b.click("#line-direction label:nth-of-type(2)")
    check(b.js(arrows) < both, "the arrow against the line is still there")
    _, tip = b.js("document.querySelector('#zone-shapes path.line.edited').getAttribute('d').split(' ').at(2).split(',').slice(0, 2).map(parseFloat)")
    check(tip > 0.7, f"forward points to the left of a line that goes to the right: {tip}")
    b.js("document.getElementById('zone-save').click()")
    b.wait("document.getElementById('zone-list').children.length === 4")
    line = posts()[-1]["zones"][-1]
    check(line["line"] and line["direction"] == "forward" and len(line["points"]) == 2 and not line["mask"], f"sent: {line}")
    check("line, forward" in b.js("document.getElementById('zone-list').textContent"), "the list has it as something else")
    b.js("document.querySelectorAll('.zone')[3].click()")
    b.js("document.getElementById('zone-delete').click()")
    b.wait("document.getElementById('zone-list').children.length === 3")
    b.js("document.querySelectorAll('.zone')[2].click()")
    b.js("document.getElementById('zone-delete').click()")
    b.wait("document.getElementById('zone-list').children.length === 2")
    fake.set(role="view")
    b.wait("document.getElementById('zone-new').getAttribute('aria-disabled') === 'true'")
    fake.set(role="control")
    b.wait("!document.getElementById('zone-new').hasAttribute('aria-disabled')")
    b.click("#zones-shown")
    b.click("#zones-close")
    check(b.js(shapes) == 2, "the zones are not shown any more")
    b.click("#zones")
    b.click("#zones-shown")
    b.click("#zones-close")
    check(b.js(shapes) == 0, "the zones are still shown")
    b.js("document.getElementById('toasts').replaceChildren()")


def reload(b):
    b.js("window.old = true; location.reload()")
    b.wait("!window.old && Number(document.getElementById('stage')?.dataset.pictures) > 1")


def test_hints(b, fake):
    """Three hints at the first use: each is shown until it was closed or what it says was done, and never again."""
    shown = lambda name: b.js(f"document.getElementById('{name}').checkVisibility()")
    fresh(b, fake)
    mode(b, "clear")
    b.wait("document.getElementById('hint').checkVisibility()")
    check("remove it" in b.js("document.querySelector('#hint [data-mode=clear]').textContent"), "no word of removing")
    b.click("#stage")  # what it says is done
    b.wait("document.getElementById('hint').hidden")
    mode(b, "sst")
    b.wait("document.getElementById('hint').checkVisibility()")
    b.click("#hint-close")
    b.wait("document.getElementById('hint').hidden")
    b.click("#tab-visits")
    b.wait("document.getElementById('hint-visits').checkVisibility()")
    b.click("#visits .visit")
    b.wait("document.getElementById('visit').open")
    b.click("#visit-close")
    reload(b)
    b.click("#tab-visits")
    b.wait("document.querySelectorAll('#visits .visit').length > 1")
    for name in ("clear", "sst"):
        mode(b, name)
        check(not shown("hint"), f"the hint of {name} is shown again")
    check(not shown("hint-visits"), "the hint of visits is shown again")
    b.click("#tab-overview")


def test_locale(b, fake):
    """Times are those of the browser's locale: 24 hours where these are used."""
    first = "document.querySelector('#latest time').textContent"
    for locale, pattern in (("en-US", r"/^(\w+ \d+ )?\d\d:\d\d:\d\d [AP]M$/"), ("de-DE", r"/\d\d:\d\d:\d\d$/")):
        b.call("Emulation.setLocaleOverride", locale=locale)
        reload(b)
        b.wait(f"document.querySelector('#latest time') && {pattern}.test({first})")
    b.call("Emulation.setLocaleOverride")
    reload(b)


def test_sessions(b, fake):
    """Who is logged in; another one is ended, then one's own."""
    rows = "[...document.querySelectorAll('#session-list li')].map((n) => n.textContent)"
    b.click("#account")
    b.wait("document.getElementById('sessions').open")
    mine, other = b.js(rows)
    check("Chrome on Linux (this one)" in mine and "Control · 127.0.0.1 · since" in mine and not mine.endswith("End"), mine)
    check("Safari on iOS" in other and "View only · 192.168.1.7" in other and "last seen" in other and other.endswith("End"), other)
    b.click("#session-list li:nth-child(2) button")
    b.wait(f"{rows}.length === 1")
    check([r["path"] for r in fake.log() if r["method"] == "POST"][-1] == "/api/v1/sessions/000000000002", "another one is ended")
    b.key("Escape", 27)
    b.wait("!document.getElementById('sessions').open")
    b.click("#account")
    b.wait("document.getElementById('sessions').open")
    b.click("#log-out")
    b.wait("location.pathname === '/login'")
    check(fake.posts("/api/v1/logout") == [{}], "the session is not ended")
    b.go(fake.url)
    b.wait("document.readyState === 'complete' && Number(document.getElementById('stage')?.dataset.pictures) > 1")
    b.wait("document.getElementById('explain').hidden")
    mode(b, "sst")


def test_role(b, fake):
    fake.set(role="view")
    b.wait("document.getElementById('record').getAttribute('aria-disabled') === 'true'")
    check("control" in b.js("document.getElementById('record').title"), "no reason why")
    count = len(fake.posts("/api/v1/record"))
    b.click("#record")
    b.wait("document.getElementById('toasts').textContent.includes('read-only')")
    check(len(fake.posts("/api/v1/record")) == count, "a viewer's click was sent")
    fake.set(role="control")
    b.wait("!document.getElementById('record').hasAttribute('aria-disabled')")


def test_states(b, fake):
    fake.set(status={"state": "armed", "reason": ""})
    b.wait("document.getElementById('explain').textContent.includes('Waiting for the trigger')")
    fake.set(status={"state": "failed", "reason": "gpiochip0 is busy"})
    b.wait("document.getElementById('explain').textContent.includes('gpiochip0 is busy')")
    fake.set(status={"state": "capturing", "reason": ""})
    b.wait("document.getElementById('explain').hidden")
    fake.set(status={"live": {"settling": True}})
    b.wait("!document.getElementById('age').hidden && document.getElementById('age').textContent === 'Settling'")
    fake.set(status={"live": {"settling": False}})
    b.wait("document.getElementById('age').textContent !== 'Settling'")


def test_storage(b, fake):
    """A loop of recordings that fills its quota is no trouble; a disk that fills up is, and so is a loop that stands."""
    free = "document.getElementById('v-free')"
    fake.set(status={"storage": {"state": "LOW", "limit": "quota", "reason": "the oldest are removed"}})
    b.wait(f"{free}.title === '188 GB of 400 GB; the oldest are removed'")
    check(b.js(f"{free}.dataset.kind") == "", "LOW by the quota warns")
    check(b.js(f"{free}.textContent") == "47 %", f"the header says {b.js(f'{free}.textContent')}")
    fake.set(status={"storage": {"limit": "disk"}})
    b.wait(f"{free}.dataset.kind === 'warn'")
    fake.set(status={"storage": {"state": "FULL", "limit": "quota"}})
    b.wait(f"{free}.dataset.kind === 'bad'")
    fake.set(status={"storage": {"state": "OK", "limit": "", "reason": "", "quota_bytes": 0}})
    b.wait(f"{free}.textContent === '412 GB'")
    fake.set(status={"storage": {"quota_bytes": 400 * 10**9}})
    b.wait("document.getElementById('recordings-fit').textContent === "
           "'At the present rate there is room for 12 days of full recordings, 63 days of reduced ones.'")
    fake.set(status={"storage": {"reduced": {"recordings": 0, "fits_days": None}, "full": {"fits_days": 1.5}}})
    b.wait("document.getElementById('recordings-fit').textContent === 'At the present rate there is room for 36 hours of recordings.'")
    badge = "document.getElementById('rec-badge').hidden"
    recording = {"active": True, "name": "x", "why": "reduced", "since": "2026-11-21T18:00:00.000Z"}
    fake.set(status={"storage": {"recording": {**recording, "reduced": False}}})
    b.wait(f"!{badge}")
    fake.set(status={"storage": {"recording": {**recording, "reduced": True}}})  # goes on all the time
    b.wait(badge)
    fake.set(status={"storage": {"recording": {"active": False, "name": "", "why": "", "since": "", "reduced": False}}})


def test_hosts(b, fake):
    """Hosts are named where there are several."""
    card = "document.getElementById('h-health-hosts').parentElement"
    b.js("document.getElementById('tab-health').click()")
    b.wait(f"{card}.hidden")
    nodes = [{"name": "left", "connected": True, "cameras": 18, "clock_ms": 0.4, "slips": 2},
             {"name": "right", "connected": False, "reason": "no connection since 02:10"}]
    fake.set(status={"hosts": {"role": "head", "nodes": nodes, "clock": {"synchronised": True}}})
    b.wait(f"!{card}.hidden && {card}.textContent.includes('18 cameras') && {card}.textContent.includes('since 02:10')")
    fake.set(status={"hosts": None})
    b.wait(f"{card}.hidden")
    b.js("document.getElementById('tab-overview').click()")


def test_device(b, fake):
    """Where the live picture is computed is said, also of a device that fails."""
    card = "document.getElementById('h-health-live').parentElement.textContent"
    b.js("document.getElementById('tab-health').click()")
    b.wait(f"{card}.includes('Computed on') && {card}.includes('the processor')")
    labels = {"failing": False, "runs": 18, "on_cpu": 0, "failures": 0, "reason": ""}
    device = {"name": "NVIDIA H100", "driver": "", "failing": False, "pictures": 70, "on_cpu": 0, "verified_on_cpu": 0, "filled_on_cpu": 0,
              "failures": 0, "reason": "", "labels": labels, "stages_on_cpu": ["decode", "disparity"]}
    fake.set(status={"live": {"device": device}})
    b.wait(f"{card}.includes('NVIDIA H100, 70 pictures') && {card}.includes('18 runs') && {card}.includes('decoding, depth')")
    fake.set(status={"live": {"device": {"failing": True, "on_cpu": 3, "reason": "the device is lost"}}})
    b.wait(f"{card}.includes('Device fails') && {card}.includes('3 on the processor: the device is lost')")
    fake.set(status={"live": {"device": None}})
    b.wait(f"{card}.includes('Computed on')")
    b.js("document.getElementById('tab-overview').click()")


def test_shared(b, fake):
    """No view of one's own is to be had: the main one is shown, and said so."""
    fake.set(views_max=0, forget_views=True)
    b.wait("document.getElementById('tag-left').textContent.includes('shared by all')")
    b.wait("document.getElementById('toasts').textContent.includes('Main view') || "
           "document.getElementById('toasts').textContent.includes('main view')")
    asked = lambda: len([r for r in fake.log() if r["method"] == "POST" and r["path"] == "/api/v1/views"])
    count = asked()
    fake.set(hold=True)
    check(expect(lambda: asked() > count), "a view of its own is not asked for again")
    b.js("document.getElementById('auto').click()")  # while there is none to tell
    fake.set(hold=False)
    check(expect(lambda: any(r["path"] == "/api/v1/views/main" for r in fake.log())), "the main view cannot be told")
    fake.set(role="view")
    x, y, w, _ = b.box("#focus")
    b.click((x - 0.3 * w, y))
    b.wait("document.getElementById('toasts').textContent.includes('main view is for those who control')")
    b.wait("document.getElementById('auto').getAttribute('aria-pressed') === 'true'")  # as the main view is
    fake.set(role="control", views_max=8)  # not before: with room for one the page soon has a view of its own


def test_restart(b, fake):
    fake.stop()
    b.wait("document.getElementById('age').textContent.includes('Reconnecting')")
    b.wait("document.getElementById('explain').textContent.includes('does not answer')")
    check(b.js("document.getElementById('state-word').textContent") == "Reconnecting", "the state is not announced")
    fake.start()
    pictures = b.js("Number(document.getElementById('stage').dataset.pictures)")
    b.wait(f"Number(document.getElementById('stage').dataset.pictures) > {pictures} + 3")
    b.wait("document.getElementById('explain').hidden && document.getElementById('state-word').textContent === 'Live'")
    check(fake.posts("/api/v1/views"), "no new view")


def test_reload(b, fake):
    """A page that is reloaded has the view that it had."""
    x, y, w, _ = b.box("#focus")
    b.click((x - 0.2 * w, y))
    b.click("#chips .chip:nth-child(2)")
    check(expect(lambda: last(fake, "focus_label") == "Building"), "no label")
    shown = b.js("document.getElementById('focus-value').textContent")
    count = len([r for r in fake.log() if r["method"] == "POST" and r["path"] == "/api/v1/views"])
    b.js("window.old = true")
    b.call("Page.reload")
    b.wait("!window.old && Number(document.getElementById('stage')?.dataset.pictures) > 1")
    b.wait("document.getElementById('tag-left').textContent.includes('Building')")
    b.wait(f"document.getElementById('focus-value').textContent === {json.dumps(shown)}")
    again = len([r for r in fake.log() if r["method"] == "POST" and r["path"] == "/api/v1/views"])
    check(again == count, "another view was made")
    check(b.js("sessionStorage.getItem('sst-view')") == "", "a copy of this tab would take its view")
    b.click("#chips .chip:first-child")
    b.click("#auto")


def hide(b, on):
    b.js(("Object.defineProperty(document, 'hidden', {configurable: true, get: () => true});" if on else "delete document.hidden;")
         + "document.dispatchEvent(new Event('visibilitychange'))")


def test_hidden(b, fake):
    """In the background nothing is fetched, whatever is open."""
    b.js("document.querySelector('input[name=overlay][value=labels]').click()")
    b.click("[data-name=r0c0]")
    b.click("#sweep")
    hide(b, True)
    check(rest(lambda: len(fake.log()), 1.5) is not None, f"fetched: {[r['path'] for r in fake.log()[-5:]]}")
    hide(b, False)
    pictures = b.js("Number(document.getElementById('stage').dataset.pictures)")
    b.wait(f"Number(document.getElementById('stage').dataset.pictures) > {pictures} + 2")
    b.click("[data-name=r0c0]")
    b.js("document.querySelector('input[name=overlay]').click()")
    b.click("#auto")


def test_windows(b, fake):
    """More pictures than a browser has connections for."""
    b.js("""Promise.all([0, 1, 2, 3].map((i) => new Promise((held) => navigator.locks.request(`sst-picture-${i}`,
        {steal: true}, () => { held(); return new Promise((free) => { (window.free ??= []).push(free); }); }))))""")
    hide(b, True)
    hide(b, False)
    b.wait("document.getElementById('explain').textContent.includes('other windows of this browser')")
    b.js("window.free.forEach((free) => free())")
    b.wait("document.getElementById('explain').hidden && document.getElementById('age').hidden")


def test_busy(b, fake):
    """A service that is busy with a set is asked again."""
    view = [r["path"] for r in fake.log() if r["path"].startswith("/stream/v")][-1].split("/")[-1]
    path = f"/api/v1/views/{view}/pick"
    fake.set(refuse={path: [409, "the service is busy; ask again", 2]})
    x, y, *_ = b.box("#stage")
    b.click((x, y))
    b.wait("!document.getElementById('pick').hidden")
    fake.set(refuse={})
    check("busy" not in b.js("document.getElementById('toasts').textContent"), "the user is told to ask again")
    b.key("Escape", 27)
    b.click("#auto")


def test_cut(b, fake):
    """The network goes and comes; then something on the way refuses."""
    fake.set(hold=True)
    b.wait("document.getElementById('state-word').textContent === 'Reconnecting'")
    b.wait("document.getElementById('age').dataset.kind === 'late'")
    fake.set(hold=False, refuse={"/api/v1/status": [429, "too many wrong tokens; try again in 60 seconds"]})
    b.wait("document.getElementById('explain').textContent.includes('Too many wrong tokens')")
    check(b.js("document.getElementById('state-word').textContent") == "Refused", "a refusal is told as something else")
    fake.set(refuse={})
    b.wait("document.getElementById('explain').hidden && document.getElementById('state-word').textContent === 'Live'")


def test_update(b, fake):
    """Another version of the service brings another page."""
    b.js("window.old = true")
    fake.set(status={"version": "0.2.0"})
    b.wait("!window.old && Number(document.getElementById('stage')?.dataset.pictures) > 1")
    b.wait("document.getElementById('state-word').textContent === 'Live'")  # it knows the version that it belongs to
    b.js("window.old = true")
    fake.set(status={"version": "0.1.0"})
    b.wait("!window.old && Number(document.getElementById('stage')?.dataset.pictures) > 1")
    b.wait("document.getElementById('state-word').textContent === 'Live'")


def test_phone(b, fake):
    b.size(390, 844, phone=True)
    for tab in ("overview", "health", "events", "recordings", "visits"):
        b.click(f"#tab-{tab}")
        check(b.js("document.documentElement.scrollWidth <= 390"), f"{tab} scrolls sideways")
    b.click("#tab-overview")
    b.js("scrollTo(0, 0)")
    x, y, w, h = b.box("#stage")
    b.touch("touchStart", (x - 30, y), (x + 30, y))
    for i in range(5):
        b.touch("touchMove", (x - 30 - 12 * i, y), (x + 30 + 12 * i, y))
    b.touch("touchEnd")
    check(expect(lambda: zoomed(b) > 1.5), "a pinch does not zoom")
    before = b.box("#picture")
    b.touch("touchStart", (x, y))
    for i in range(5):
        b.touch("touchMove", (x + 12 * i, y))
    b.touch("touchEnd")
    check(expect(lambda: b.box("#picture")[0] > before[0] + 20), "a finger does not move the picture")
    b.click("#zoom-whole")
    check(zoomed(b) == 1, "the whole picture does not come back")
    small = b.js("""[...document.querySelectorAll("button, select, summary, [role=slider]")].filter((n) => n.checkVisibility())
      .filter((n) => n.getBoundingClientRect().height < 28).map((n) => n.id || n.textContent)""")
    check(not small, f"too small for a finger: {small}")
    for width, height in ((844, 390), (667, 375)):
        b.size(width, height, phone=True)
        _, _, w, h = b.box("#canvas")
        check(h > 0.65 * height and w > 0.45 * width, f"sideways the picture has {w:.0f} x {h:.0f} of {width} x {height}")
        check(b.js(f"document.documentElement.scrollWidth <= {width}"), f"{width} x {height} scrolls sideways")
    for width, height in ((360, 640), (320, 568), (740, 360)):
        b.size(width, height, phone=True)
        check(b.js(f"document.documentElement.scrollWidth <= {width}"), f"{width} x {height} scrolls sideways")
        for left, right in (("auto", "sweep"), ("adjust", "record")):
            apart = b.js(f"Math.abs(document.getElementById('{left}').getBoundingClientRect().y - "
                         f"document.getElementById('{right}').getBoundingClientRect().y)")
            check(apart < 10, f"at {width} x {height} {left} and {right} are in different rows")
        mode(b, "clear")
        check(b.js(f"document.documentElement.scrollWidth <= {width}"), f"clear: {width} x {height} scrolls sideways")
        for left, right in (("cut-auto", "outline"), ("snapshot", "record")):
            apart = b.js(f"Math.abs(document.getElementById('{left}').getBoundingClientRect().y - "
                         f"document.getElementById('{right}').getBoundingClientRect().y)")
            check(apart < 10, f"at {width} x {height} {left} and {right} are in different rows")
        mode(b, "sst")
    b.size(1440, 900)


def test_names(b, fake):
    roles = {"button", "slider", "checkbox", "radio", "combobox", "tab", "link", "application", "DisclosureTriangle"}
    for name, own in (("sst", ("auto", "sweep", "sweep-speed", "focus", "adjust")), ("clear", ("cut-auto", "cut", "outline", "tint"))):
        mode(b, name)
        nameless = [n for n in b.tree() if n["role"] in roles and not n["name"].strip()]
        check(not nameless, f"without a name: {nameless}")
        stops = []
        b.js("document.activeElement.blur()")
        for _ in range(40):
            b.key("Tab", 9)
            stops.append(b.js("(() => { const n = document.activeElement; return n.id || n.dataset.name || n.name || n.textContent.trim(); })()"))
        for wanted in ("stage", "mode", "compare", "overlay", "snapshot", "record", "tab-overview", "r0c0", *own):
            check(wanted in stops, f"Tab does not reach {wanted}: {stops}")


def test_contrast(b, fake):
    for light in (True, False):
        b.scheme(light)
        for tab in ("health", "events", "recordings", "visits", "overview"):
            mode(b, "clear" if tab == "events" else "sst")
            b.click(f"#tab-{tab}")
            bad = b.js(CONTRAST)
            check(not bad, f"{'light' if light else 'dark'}, {tab}: too little contrast: {bad[:5]}")


ONLY = os.environ.get("PAGE_ONLY", "").split()
def test_infinity(b, fake):
    """A far end that lies at infinity has no pixels beside metres."""
    far = "document.getElementById('far-end').textContent"
    near = b.js("(async () => (await (await fetch('/api/v1/status')).json()).live.range_px[1])()")
    fake.set(status={"live": {"range_px": [-0.5, near]}})
    b.wait(f"{far}.includes('∞') && !{far}.includes('px')")


TESTS = [test_picture, test_cut_slider, test_remove, test_expired, test_remove_label, test_marks, test_compare_camera, test_unknown, test_mode, test_focus, test_pick, test_follow, test_label, test_compare, test_sweep, test_overlay, test_camera_large, test_zoom, test_light, test_adjust, test_cameras,
         test_events, test_recordings, test_visits, test_timeline, test_notify, test_replay, test_zones, test_hints, test_locale, test_sessions, test_role, test_states, test_storage, test_hosts, test_device, test_shared, test_restart, test_reload, test_hidden,
         test_windows, test_busy, test_cut, test_update, test_phone, test_names, test_contrast, test_infinity]
# Errors that the browser itself writes where a test makes the service refuse or end.
WANTED = ("400", "403", "429", "404", "409", "507", "ERR_CONNECTION_REFUSED", "ERR_INCOMPLETE_CHUNKED_ENCODING", "ERR_CONNECTION_RESET",
          "ERR_EMPTY_RESPONSE", "ERR_SOCKET_NOT_CONNECTED", "ERR_CONNECTION_CLOSED", "ERR_CONTENT_LENGTH_MISMATCH")


def main():
    fake = Fake(sys.argv[1])
    fake.start()
    browser = cdp.Browser()
    failed = 0
    try:
        browser.size(1440, 900)
        browser.go(fake.url)
        browser.wait("document.readyState === 'complete' && !!document.getElementById('stage')")
        for test in [t for t in TESTS if not ONLY or t.__name__ in ONLY]:
            begin = time.time()
            try:
                test(browser, fake)
                print(f"ok {time.time() - begin:4.1f} s {test.__name__}", flush=True)
            except cdp.Failed as e:
                failed += 1
                print(f"FAIL: {test.__name__}: {e}", flush=True)
                if os.environ.get("PAGE_SHOTS"):
                    browser.picture(f"{os.environ['PAGE_SHOTS']}/{test.__name__}.png")
        for _, source, text in browser.problems:
            if not any(w in text for w in WANTED) or source in ("exception", "security"):
                failed += 1
                print(f"FAIL: the console says: {source}: {text}")
    finally:
        browser.close()
        fake.stop()
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
