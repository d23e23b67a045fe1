# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
"""What users do with the picture: tests of test_page.py."""
import datetime
import json
import urllib.request

from page_bench import check, expect, fresh, last, mode, pressed, rest, zoomed

SHIFT = 8


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
    b.wait("!document.getElementById('canvas-plain').hidden && document.getElementById('tag-right').textContent === 'Camera'")
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
    fake.set(status={"live": {"levels": [7000, 7400]}})  # of cameras of 16 bits
    b.wait("document.getElementById('tag-left').textContent.endsWith(' · levels 7000 to 7400')")
    fake.set(status={"live": {"levels": None}})
    b.wait("!document.getElementById('tag-left').textContent.includes('levels')")
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


def test_boxes(b, fake):
    """What moves has a box with label and distance in every mode; who is removed is said, and comes back by one click."""
    size = b.js("[document.getElementById('canvas').width, document.getElementById('canvas').height]")
    walker = {"track": 9, "state": "seen", "hidden": False, "label": 10, "name": "Pedestrian", "label_by": "network", "removed": True,
              "box": [0.2 * size[0], 0, 0.4 * size[0], size[1]], "at": [0.25 * size[0], 0.5 * size[1], 0.5 * size[0], size[1]],
              "speed_px_s": [0, 0], "disparity_px": 8.5, "distance_m": 4.44, "height_m": 1.7, "speed_m_s": 1.2, "seconds": 2.0}
    other = {**walker, "track": 11, "hidden": True, "label": 0, "name": "", "removed": False, "distance_m": 7.71, "disparity_px": 4.0}
    said = "[...document.querySelectorAll('.box:not([hidden]) span')].map((n) => n.textContent).join()"
    badge = "document.getElementById('removed')"
    fake.set(tracks=[walker, other])
    b.wait(f"{said} === 'Person · 4.4 m,Moving thing · 7.7 m'")  # see-through: nothing is removed by a cut
    check(b.js(f"{badge}.hidden"), "see-through removes somebody")
    check(b.js("(({left, top, width, height}) => [left, top, width, height].join())(document.querySelector('.box').style)") ==
          "25%,50%,25%,50%", "the box is elsewhere")
    mode(b, "clear")
    b.wait(f"{said} === 'Person · 4.4 m · removed,Moving thing · 7.7 m'")
    b.wait(f"!{badge}.hidden && {badge}.firstElementChild.textContent === '1 person removed, 4.4 m'")
    b.click("#removed")
    check(expect(lambda: last(fake, "keep_moving") is True), "nobody is brought back")
    b.wait(f"{badge}.textContent.includes('1 person brought back, 4.4 m') && {badge}.getAttribute('aria-pressed') === 'true'")
    b.wait(f"{said} === 'Person · 4.4 m,Moving thing · 7.7 m'")
    b.click("#removed")
    check(expect(lambda: last(fake, "keep_moving") is False), "nobody is removed again")
    b.wait(f"{badge}.firstElementChild.textContent === '1 person removed, 4.4 m'")
    b.js("document.querySelector('#overlay [value=camera]').click()")
    b.wait(f"{badge}.hidden && {said} === 'Person · 4.4 m,Moving thing · 7.7 m'")  # the camera removes nobody
    fake.set(tracks_late_s=1.5)  # a slow machine: the camera's pictures go on, their tracks come later
    b.wait(f"/^Person · 4.4 m · [12].. s ago,Moving thing · 7.7 m · [12].. s ago$/.test({said}) && document.querySelector('.box').dataset.state === 'covered'")
    fake.set(tracks_at=datetime.datetime.now(datetime.timezone.utc).isoformat())  # nothing is processed
    b.wait(f"{said} === ''")
    fake.set(tracks_late_s=0, tracks_at=None)
    b.wait(f"{said} === 'Person · 4.4 m,Moving thing · 7.7 m'")
    b.js("document.querySelector('#overlay [value=\"\"]').click()")
    b.click("#boxes-on")
    b.wait("document.getElementById('boxes').hidden && document.getElementById('boxes-on').getAttribute('aria-pressed') === 'false'")
    check(b.js("localStorage.getItem('sst-boxes')") == "off", "not remembered")
    b.wait(f"!{badge}.hidden")  # the badge does not depend on boxes
    b.click("#boxes-on")
    lost = {**walker, "state": "covered", "unseen_s": 2}
    fake.set(tracks=[lost, {**other, "state": "covered", "unseen_s": 0.3}])
    b.wait(f"{said} === 'Moving thing · 7.7 m' && {badge}.hidden")  # where it was is lawn by now
    fake.set(tracks=[{**lost, "unseen_s": 0}])
    b.wait(f"{said} === 'Person · 4.4 m · removed' && !{badge}.hidden")
    fake.set(tracks=[])
    b.wait(f"{badge}.hidden && document.querySelectorAll('.box').length === 0")
    come = {"id": 1, "track": 0, "box": [0.5 * size[0], 0.25 * size[1], 0.75 * size[0], size[1]], "disparity_px": 8.5, "distance_m": 7.71}
    fake.set(unconfirmed=[come])  # no track yet: a box, and no badge
    b.wait(f"{said} === 'Something moves · 7.7 m' && document.querySelector('.box').dataset.state === 'unconfirmed' && {badge}.hidden")
    check(b.js("document.querySelector('.box').style.left") == "50%", "the box of what came is elsewhere")
    fake.set(unconfirmed=[{**come, "distance_m": None}])
    b.wait(f"{said} === 'Something moves'")
    fake.set(unconfirmed=[], tracks=[other])
    b.wait(f"{said} === 'Moving thing · 7.7 m' && document.querySelector('.box').dataset.state === 'hidden'")
    check(b.js("document.querySelector('.box').style.left") == "25%", "the box of the track is elsewhere")
    fake.set(unconfirmed=[{**come, "track": other["track"]}])  # the track is older than the picture
    b.wait(f"{said} === 'Moving thing · 7.7 m' && document.querySelector('.box').style.left === '50%'")
    fake.set(unconfirmed=[])
    fake.set(tracks=[])
    b.wait("document.querySelectorAll('.box').length === 0")
    mode(b, "sst")


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
    """What a camera sees, in the large place: the one in the middle, or any of the grid. Its age is shown, not that of the picture behind it."""
    fake.set(pause=True)
    b.wait("!document.getElementById('age').hidden")
    b.js("document.querySelector('input[name=overlay][value=camera]').click()")
    b.wait("!document.getElementById('canvas-camera').hidden && document.getElementById('tag-left').textContent.includes('Camera r2c2')")
    b.wait("document.getElementById('age').hidden && document.getElementById('v-delay').textContent.endsWith('ms')")
    fake.set(pause=False)
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


TESTS = [test_picture, test_cut_slider, test_remove, test_expired, test_remove_label, test_marks, test_compare_camera,
         test_unknown, test_mode, test_focus, test_pick, test_follow, test_boxes, test_label, test_compare, test_sweep,
         test_overlay, test_camera_large, test_zoom, test_light, test_adjust]
