# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
"""What users do with cameras, events, recordings, visits and zones: tests of test_page.py."""
import datetime
import json
import os
import time
import urllib.request

from page_bench import check, expect, live, mode, reload, rest


def test_cameras(b, fake):
    check(b.js("document.querySelector('[role=tab]').id") == "tab-visits", "visits are not the first tab")
    b.click("#tab-overview")
    fake.set(cameras={"r3c2": {"state": "absent", "reason": "Nothing is plugged into port 2-1.9"}},
             status={"state": "degraded", "reason": "35 of 36 cameras: r3c2 is absent", "capture": {"present": 35}},
             events=[{"level": 1, "type": "camera-lost", "message": "Camera r3c2 was unplugged"}])
    b.wait("document.querySelector('[data-name=r3c2]')?.dataset.kind === 'bad'")
    check(b.js("document.querySelector('[data-name=r3c2] b').textContent") == "×", "the state is shown by colour alone")
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
    visit = fake.visits()[1]["visit"]
    fake.set(events=[{"level": 0, "type": "visit", "message": "Car came", "data": {"visit": visit, "label": "Car", "zones": [], "active": True}},
                     {"level": 0, "type": "visit", "message": "somebody came long ago", "data": {"visit": "2020-01-01T00-00-00-000Z-1", "label": "", "zones": [], "active": True}},
                     {"level": 0, "type": "record-stop", "message": "Recording ended", "data": {"recording": "2020-01-01T00-00-00Z"}}])
    link = "[...document.querySelectorAll('#events li')].find((n) => n.textContent.includes('Car came'))"
    b.wait(f"{link}?.querySelector('[data-drawn]') instanceof Node")
    check(b.js("[...document.querySelectorAll('#events li')].find((n) => n.textContent.includes('long ago')).querySelector('a, canvas') === null"), "a visit that is gone has a link")
    fake.set(late_s=1)  # a busy machine
    b.js(f"{link}.querySelector('span a').click()")
    b.wait("document.getElementById('visit').open && document.getElementById('visit-title').textContent.includes('Car')")
    places = lambda: [b.box(f"#visit-{name}") for name in ("close", "delete")]
    before, early = places(), not b.js("document.getElementById('visit-image').complete")
    b.wait("document.getElementById('visit-image').complete && document.getElementById('visit-image').naturalWidth > 0")
    check(early and before == places(), f"buttons move below the pointer when the picture comes: {before}, {places()}")
    fake.set(late_s=0)
    b.click("#visit-close")
    b.wait("location.hash === ''")
    b.click("#tab-events")
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
    b.wait("document.querySelectorAll('.recording summary [data-drawn]').length > 1")
    check("1 min 12 s" in b.js("document.querySelector('.recording summary').textContent") and "sets" not in b.js("document.getElementById('recordings').textContent"), "no length")
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
    b.wait(f"{cards}.length === 4 && document.querySelector('#visits [data-drawn=seen]') !== null")
    text = b.js("document.querySelector('#visits .visit').textContent")
    check("Pedestrian" in text and "left to right" in text and "gate" in text and "12 s" in text and "6.1\u00a0m" in text, f"the card says {text}")
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
    b.js("document.getElementById('toasts').replaceChildren()")
    fake.set(events=[{"level": 2, "type": "storage", "message": "The cellar is wet"}])
    b.wait("document.getElementById('toasts').textContent.includes('The cellar is wet')")
    b.click("#toasts .toast:last-child .icon")  # over the dialog, which covers all else
    b.wait("document.getElementById('toasts').children.length === 0 && document.getElementById('visit').open")
    b.js("document.getElementById('visit-close').focus()")
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
    for _ in range(3):  # a key that is held is one press
        b.call("Input.dispatchKeyEvent", type="rawKeyDown", key="Delete", windowsVirtualKeyCode=46, autoRepeat=True)
    b.call("Input.dispatchKeyEvent", type="keyUp", key="Delete", windowsVirtualKeyCode=46)
    check(not any("delete" in (r or {}) for r in fake.posts("/api/v1/visits")), "deleted by a key that is held")
    fake.set(late_s=1)  # a busy machine: the counts come after the reader has closed the picture
    b.click("#visit-delete")
    b.wait(f"{cards}.length === 3")
    b.click("#visit-close")
    b.wait("!document.getElementById('visit').open")
    time.sleep(1.5)
    check(not b.js("document.getElementById('visit').open"), "the picture opens again after it was closed")
    fake.set(late_s=0)
    name = fake.visits()[1]["visit"]
    b.js(f"location.hash = '#visit={name}'")
    b.wait("document.getElementById('visit').open && document.getElementById('visit-title').textContent.includes('Car')")
    b.click("#visit-close")
    b.js("history.replaceState(null, '', '/')")
    b.click("#tab-overview")


def test_timeline(b, fake):
    """A day below the picture: visits and recordings on it; a moment is chosen by keys or a click, and plays."""
    b.wait("document.getElementById('timeline').hidden")  # beside the cameras
    b.click("#tab-visits")
    b.wait("!document.getElementById('timeline').hidden && document.querySelectorAll('#day-ticks span').length > 2")
    check(b.js("new Set([...document.querySelectorAll('#day-ticks span')].map((n) => n.textContent.replace(/:.*/, ''))).size") <= 2, "it does not open on an hour")
    for _ in range(5):
        if not b.js("document.getElementById('day-farther').disabled"):
            b.click("#day-farther")
    check(b.js("document.getElementById('day-farther').disabled"), "the day does not become whole")
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
    b.mouse("mouseMoved", x - w / 2 + w * left / 100 + 1, y)
    b.wait("document.querySelector('#day-cursor-picture [data-drawn]') && !document.getElementById('day-cursor').hidden")
    check("Pedestrian" in b.js("document.getElementById('day-cursor-text').textContent"), "the pointer names no visit")
    before = b.js("document.getElementById('day').getAttribute('aria-valuetext')")
    b.key("+", 107, "+")
    check(b.js("!document.getElementById('day-farther').disabled"), f"the key does not stretch the day: {before}")
    b.key("-", 109, "-")
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


def test_review(b, fake):
    """A night of many visits is reviewed with keys alone; many are chosen and deleted at once; the page holds few of the cards."""
    cards = "document.querySelectorAll('#visits .visit').length"
    counts = "['all', 'new', 'done'].map((n) => document.getElementById('visits-' + n).textContent).join()"
    at = "document.activeElement.closest('.visit')?.ariaPosInSet"
    posts = lambda: fake.posts("/api/v1/visits")
    fake.set(many=300)
    b.click("#tab-visits")
    total = len(fake.visits("limit=1000"))
    b.js("document.activeElement.blur()")
    b.wait(f"{counts} === '{total},{total},0'")
    b.key("Home", 36)
    b.wait(f"{at} === '1'")
    b.key("j", 74, "j")
    b.wait(f"{at} === '2'")
    b.key("k", 75, "k")
    b.wait(f"{at} === '1'")
    for _ in range(3):
        b.key("r", 82, "r")
    b.wait(f"{counts} === '{total},{total - 3},3' && {at} === '4'")
    check(len(sum((p["visits"] for p in posts() if p.get("reviewed")), [])) == 3, f"sent: {posts()[-3:]}")
    b.key("u", 85, "u")  # to review
    b.wait(f"document.querySelector('#visits .visit')?.ariaSetSize === '60'")
    loaded = "Number(document.querySelector('#visits .visit')?.ariaSetSize ?? 0)"
    check(expect(lambda: b.key("End", 35) or b.js(loaded) >= 180), f"{b.js(loaded)} cards are loaded")
    b.wait(f"{at} && {loaded} - {at} <= 60")
    check(b.js(cards) < 60, f"{b.js(cards)} cards are in the page")
    place = int(b.js(at))
    b.key("k", 75, "k")
    b.wait(f"{at} === '{place - 1}'")
    b.key("x", 88, "x")
    b.wait("document.getElementById('selection-count').textContent === '1 selected'")
    b.call("Input.dispatchKeyEvent", type="rawKeyDown", key="ArrowUp", windowsVirtualKeyCode=38, modifiers=8)
    b.wait("document.getElementById('selection-count').textContent === '3 selected'")
    b.key("Delete", 46)
    b.wait("document.getElementById('delete').open && document.getElementById('delete-text').textContent.includes('3 visits')")
    b.key("Escape", 27)
    b.wait("!document.getElementById('delete').open")
    check(not any("delete" in p for p in posts()[-1:]), "deleted without a yes")
    b.key("Delete", 46)
    b.wait("document.getElementById('delete').open")
    b.key("Delete", 46)
    b.wait(f"document.getElementById('selection').hidden && {counts} === '{total - 3},{total - 6},3'")
    check(len(posts()[-1]["visits"]) == 3 and posts()[-1]["delete"] is True, f"sent: {posts()[-1]}")
    b.key("u", 85, "u")
    b.wait(f"{cards} === 3")  # reviewed
    b.key("Home", 36)
    b.key("Enter", 13, "\r")
    b.wait("!document.getElementById('replay').hidden")
    b.key("l", 76, "l")
    b.wait("document.getElementById('replay').hidden")
    b.key("j", 74, "j")
    b.key("Enter", 13, "\r")  # nothing was recorded then
    b.wait("document.getElementById('toasts').textContent.includes('not recorded')")
    check(b.js("[...document.querySelectorAll('.visit-flag')].map((n) => n.textContent).join()") == ",No recording,No recording", "a card does not say that its recording is gone")
    b.key("?", 191, "?")
    b.wait("document.getElementById('keys').open && document.getElementById('key-list').textContent.includes('reviewed, and to the next')")
    b.key("Escape", 27)
    b.key("u", 85, "u")
    b.js("document.getElementById('panel-visits').scrollTop = 0; document.getElementById('toasts').replaceChildren()")
    b.wait(f"document.querySelector('#visits .visit')?.ariaPosInSet === '1' && {cards} > 8")
    click = lambda n, **more: [b.mouse(kind, *b.at_rest(f"#visits .visit:nth-child({n}) .visit-picture")[:2], button="left", clickCount=1, **more) for kind in ("mousePressed", "mouseReleased")]
    click(2, modifiers=2)
    click(4, modifiers=8)
    b.wait("document.getElementById('selection-count').textContent === '3 selected'")
    b.click("#selection [data-action=reviewed]")
    check(expect(lambda: posts()[-1].get("reviewed") is True and len(posts()[-1]["visits"]) == 3), f"sent: {posts()[-1]}")
    b.click("#selection-clear")
    b.wait("document.getElementById('selection').hidden")
    b.mouse("mouseMoved", *b.at_rest("#visits .visit:nth-child(2) .visit-picture")[:2])
    b.wait("[...document.querySelectorAll('#visits .visit-other')].some((n) => n.checkVisibility())")
    b.mouse("mouseMoved", 5, 5)
    b.wait("document.querySelector('#visits .visit-other') === null")
    fake.set(role="view")  # viewers review
    b.wait("document.querySelector('#visits [data-action=keep]').getAttribute('aria-disabled') === 'true'")
    count = len(posts())
    b.click("#visits .visit:nth-child(6) [data-action=keep]")
    b.click("#visits .visit:nth-child(6) [data-action=reviewed]")
    check(expect(lambda: len(posts()) == count + 1 and posts()[-1].get("reviewed") is True), f"sent: {posts()[count:]}")
    fake.set(role="control", many=0)
    b.wait("!document.querySelector('#visits [data-action=keep]').hasAttribute('aria-disabled')")
    b.js("document.getElementById('toasts').replaceChildren()")
    fake.set(forget_reviews=True)
    b.click("#tab-overview")


def test_review_keeps(b, fake):
    """Visits that were reviewed leave nothing behind in the page, once the browser has collected what is unused."""
    left = "Number(document.getElementById('visits-new').textContent)"
    fake.set(many=150)
    b.click("#tab-visits")
    b.js("document.querySelector('#visits-reviewed [value=false]').click()")
    b.wait("document.querySelector('#visits .visit')?.ariaSetSize === '60'")
    total = len(fake.visits("reviewed=false&limit=1000"))
    b.wait(f"{left} === {total}")
    b.js("document.querySelector('#visits .visit-open').focus()")

    sent = lambda: [p["visits"] for p in fake.posts("/api/v1/visits") if p.get("reviewed")]
    count = len(sent())
    b.js("""for (let n = 0; n < 6; n++)
      document.activeElement.dispatchEvent(new KeyboardEvent("keydown", { key: "r", bubbles: true, cancelable: true }));""")
    b.wait(f"{left} === {total - 6}")
    check([len(visits) for visits in sent()[count:]] == [1, 5] and len(set(sum(sent()[count:], []))) == 6, f"six presses in a frame sent: {sent()[count:]}")

    count = len(fake.posts("/api/v1/visits"))
    b.js("""for (const key of ["r", "k", "r"])
      document.activeElement.dispatchEvent(new KeyboardEvent("keydown", { key, bubbles: true, cancelable: true }));""")
    b.wait(f"{left} === {total - 7}")
    time.sleep(0.3)
    check(not any(p.get("reviewed") is False for p in fake.posts("/api/v1/visits")[count:]), "pressed again before the answer, the review is taken back")

    def kept(goal):
        for _ in range(200):  # a press while the next page is on its way is of the same visit
            b.key("r", 82, "r")
            b.js("new Promise(requestAnimationFrame)")
            if b.js(left) <= goal:
                return live(b)
        check(False, f"{b.js(left)} are left to review, not {goal}")

    before, after = kept(total - 40), kept(total - 120)
    check(after["nodes"] < before["nodes"] + 400 and after["jsEventListeners"] < before["jsEventListeners"] + 80 and after["canvases"] < before["canvases"] + 20,
          f"80 reviewed visits leave {before} -> {after}")
    b.js("document.querySelector('#visits-reviewed [value=\"\"]').click()")
    fake.set(many=0, forget_reviews=True)
    b.js("document.getElementById('toasts').replaceChildren()")
    b.click("#tab-overview")


def test_calendar(b, fake):
    """A month with dots on days with visits; a day is chosen by keys, for the list and the strip below the picture."""
    b.js("document.getElementById('toasts').replaceChildren()")  # one may lie over the button
    b.click("#tab-visits")
    b.click("#calendar-open")
    b.wait("document.activeElement.dataset.day")
    if b.js("document.activeElement.dataset.day.slice(0, 7)") > fake.visits()[0]["visit"][:7]:  # a month has begun just now
        b.click("#calendar-before")
    b.wait("document.getElementById('calendar').matches(':popover-open') && document.querySelector('#calendar [data-dot=new]') !== null")
    b.js("document.querySelector('#calendar [data-day][tabindex=\"0\"]').focus()")
    day = fake.visits()[0]["visit"][:10]
    check(b.js(f"document.querySelector('#calendar [data-day=\"{day}\"]')?.ariaLabel.includes('to review')") in (True, None), "a day does not say what is to be reviewed")
    today = b.js("document.activeElement.dataset.day")
    b.key("ArrowLeft", 37)
    b.wait(f"document.activeElement.dataset.day && document.activeElement.dataset.day < '{today}'")
    chosen = b.js("document.activeElement.dataset.day")
    name = "document.getElementById('day-name').textContent"
    before = b.js(name)
    b.key("Enter", 13, "\r")
    b.wait(f"document.getElementById('visits-day').value === '{chosen}' && !document.getElementById('calendar').matches(':popover-open') && {name} !== {json.dumps(before)}")
    check(expect(lambda: [r for r in fake.log() if r["path"] == "/api/v1/visits" and "from" in r["query"] and "to" in r["query"]]), "the list is of other days")
    before = b.js(name)
    b.click("#day-name")
    b.wait("document.getElementById('calendar').matches(':popover-open')")
    b.click("#calendar-all")
    b.wait(f"document.getElementById('visits-day').value === '' && {name} !== {json.dumps(before)}")
    b.call("Emulation.setTimezoneOverride", timezoneId="Europe/Berlin")  # where a day of last October had 25 hours
    today = datetime.date.today()
    month = datetime.date(today.year - (today.month < 11), 10, 31)
    long = month - datetime.timedelta(days=(month.weekday() + 1) % 7)
    b.click("#day-name")
    b.wait("document.activeElement.dataset.day")
    for _ in range(13):
        if b.js("document.activeElement.dataset.day") > f"{month}":
            b.key("PageUp", 33)
    b.js(f"document.querySelector('#calendar [data-day=\"{long}\"]').click()")
    b.wait("Number(document.getElementById('day').ariaValueMax) === 25 * 3600")
    span = [r["query"] for r in fake.log() if r["path"] == "/api/v1/visits" and r["query"].get("limit") == "1000" and "to" in r["query"]][-1]
    check(span["from"].endswith("T22:00:00.000Z") and span["to"].endswith("T22:59:59.999Z"), f"the day of 25 hours is {span}")
    b.call("Emulation.setTimezoneOverride", timezoneId="")
    b.click("#day-name")
    b.click("#calendar-all")
    b.wait("Number(document.getElementById('day').ariaValueMax) === 24 * 3600")
    b.click("#tab-overview")


def test_notify(b, fake):
    """The browser notifies of events of the chosen kind, also behind other windows."""
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
    fake.set(events=[line])  # of a visit that was notified already
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
    check(expect(lambda: len({r["path"] for r in replayed("/stream/")}) > 1), "the compared picture is of another time")
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


def test_replay_waits(b, fake):
    """A picture of a recording is never shown under the time of another."""
    mode(b, "clear")
    seconds = "(Number(document.getElementById('replay-at').value) / 1000)"
    label = lambda: b.js("document.getElementById('replay-time').textContent")
    age = "document.getElementById('age').textContent"
    pictures = lambda: b.js("Number(document.getElementById('stage').dataset.pictures)")
    played = lambda: json.load(urllib.request.urlopen(fake.url + "api/v1/replay", timeout=60))
    told = lambda state: b.js("new Date('%s').toLocaleString(undefined, { weekday: 'short', day: 'numeric', month: 'short', hour: '2-digit', minute: '2-digit', "
                              "second: '2-digit' })" % state["time"])

    def resumes():
        before = pictures()
        check(expect(lambda: pictures() != before), "no more pictures")

    def choose(s):
        b.js(f"(() => {{ const s = document.getElementById('replay-at'); s.value = {1000 * s}; s.dispatchEvent(new Event('input')); "
             "s.dispatchEvent(new Event('change')); })()")

    b.click("#tab-recordings")
    b.wait("document.querySelectorAll('.recording').length === 4")
    if not b.js("document.querySelector('.recording').open"):
        b.click(".recording summary")
    fake.set(computing=True)
    b.click(".recording .take button")
    b.wait("!document.getElementById('replay').hidden && document.getElementById('explain').textContent.includes('Computing the picture of')")
    time.sleep(1.5)
    check(label() == "–" and b.js(seconds) < 0.1, f"{label()} without a picture of the recording, {b.js(seconds)} s after its beginning")
    fake.set(computing=False)
    b.wait(f"{seconds} > 0.5 && document.getElementById('explain').hidden")
    check(label() != "–", "a picture without a time")

    fake.set(stall=True)  # it plays on, and no picture comes
    time.sleep(1)
    before, at = label(), b.js(seconds)
    check(expect(lambda: told(played()) not in (before, told({"time": played()["from"]}))), "it does not play")
    time.sleep(1.5)
    check(label() == before and b.js(seconds) == at, f"{label()}, {b.js(seconds)} s, over the picture of {before}, {at} s")
    choose(40)  # the picture is still the one before
    b.wait(f"{age}.startsWith('Computing') && {seconds} === 40")
    time.sleep(1)
    check(label() == before and b.js(f"{age}.startsWith('Computing')"), f"{label()}, {b.js(age)}, over the picture of {before}")
    fake.set(stall=False)
    b.wait(f"{age} === 'Playback' && {seconds} >= 40")
    b.click("#replay-play")
    b.wait("document.getElementById('replay-play').getAttribute('aria-label') === 'Play'")
    resumes()
    check(expect(lambda: label() == told(played())), f"{label()}, paused at {told(played())}")

    fake.set(computing=True)  # paused, backwards
    before = label()
    choose(10)
    b.wait(f"{age}.startsWith('Computing')")
    check(label() == before, f"{label()} over the picture of {before}")
    fake.set(preview=True)  # a recorded picture of the moment
    b.wait(f"{age} === 'Recorded, computing' && document.getElementById('explain').hidden")
    check(label() == told(played()), f"{label()}, recorded at {told(played())}")
    check(not b.js("document.querySelector('.frame').classList.contains('stale')"), "a picture of that moment is greyed")
    fake.set(computing=False, preview=False)
    b.wait(f"{age} === 'Playback' && Math.abs({seconds} - 10) < 0.2")
    check(label() == told(played()), f"{label()}, paused at {told(played())}")
    b.click("#replay-live")
    b.wait("document.getElementById('replay').hidden")
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
    b.wait("document.querySelectorAll('#zone-marks .corner:not(.more, .mover)').length === 4 && document.activeElement.id === 'zone-name'")
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

    b.js("document.querySelectorAll('.zone')[1].click()")  # another client deletes the zone before it meanwhile
    b.wait("!document.getElementById('zone-one').hidden")
    both = posts()[-1]["zones"]
    fake.set(zones=[tree])
    b.click("#zone-delete")
    b.wait("document.getElementById('zone-error').textContent.includes('another client')")
    b.js("document.getElementById('zone-cancel').click()")
    b.wait("document.getElementById('zone-list').children.length === 1 && document.querySelector('#zone-list').textContent.includes('tree')")
    fake.set(zones=both)
    b.click("#zones")
    b.click("#zones")
    b.wait("document.getElementById('zone-list').children.length === 2")
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
    b.wait("document.querySelectorAll('.corner:not(.mover)').length === 2 && document.activeElement.id === 'zone-name'")
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


def test_masks(b, fake):
    """A mask of a camera is drawn by the mouse and by keys, moved, deleted; a place has a distance; the lines for the configuration are whole."""
    shown = "[...document.querySelectorAll('#mask-marks .zone-name')].map((n) => n.textContent).join()"
    text = "document.getElementById('mask-lines').value"

    asks = "!dispatchEvent(new Event('beforeunload', {cancelable: true}))"

    def open_masks():
        b.click("#tab-overview")
        b.wait("document.querySelector('.cell[data-name=r0c1]')?.checkVisibility()")
        b.js("document.querySelector('.cell[data-name=r0c1]').click()")
        b.wait("!document.getElementById('camera').hidden")
        b.js("[...document.querySelectorAll('#camera button')].find((n) => n.textContent === 'Masks').click()")
        b.wait("document.getElementById('mask-of').value === 'r0c1' && document.getElementById('tag-left').textContent.startsWith('Camera r0c1')")

    open_masks()
    b.wait(f"{shown} === 'window' && document.getElementById('mask-changes').hidden")
    b.click("#mask-new")
    b.wait("document.activeElement === document.getElementById('stage')")
    x, y, w, h = b.box("#stage")
    b.drag((x - 0.2 * w, y - 0.1 * h), (x + 0.1 * w, y + 0.2 * h))
    b.wait("document.querySelectorAll('#mask-marks .corner:not(.more, .mover)').length === 4 && document.activeElement.id === 'mask-name'")
    b.click("#mask-keep")
    b.wait("document.getElementById('mask-error').textContent.includes('needs a name')")
    b.js("document.getElementById('mask-name').focus()")
    b.call("Input.insertText", text="Back door")
    b.js("document.querySelector('#mask-marks .corner').focus()")
    b.key("ArrowLeft", 37)
    mx, my, _, _ = b.box("#mask-marks .mover")  # the whole by a tenth to the right, by the mouse and by keys
    b.drag((mx, my), (mx + 0.08 * w, my))
    b.js("document.querySelector('#mask-marks .mover').focus()")
    b.key("ArrowRight", 39)
    b.key("ArrowRight", 39)
    check(b.js("document.activeElement.classList.contains('mover')"), "the handle loses the focus when it moves")
    b.click("#mask-keep")
    b.wait("!document.getElementById('mask-changes').hidden")
    window, door = b.js(text).splitlines()[2:]
    check(window == '    - { name: window, row: 0, col: 1, points: "0.7,0 1,0 1,0.3 0.7,0.3" }', f"another mask changed: {window}")
    check(door.startswith('    - { name: back-door, row: 0, col: 1, points: "0.3') and abs(float(door.split('"')[1].split(",")[0]) - 0.39) < 0.01, f"lines: {door}")
    check("not in force" in b.js("document.getElementById('mask-list').textContent"), "the new mask looks as if it were in force")
    b.key("Escape", 27)
    b.wait("document.getElementById('toasts').textContent.includes('Not in force: back-door')")
    check(b.js(shown) == "window,back-door, not in force", f"outlines are named {b.js(shown)}")
    check(b.js("[...document.querySelectorAll('#mask-shapes .line')].map((n) => getComputedStyle(n).strokeDasharray).join()") == "none,6px, 4px", "outlines look alike")
    check(not b.dialogs, "the page asks before it is needed")
    reload(b)  # the page asks before it goes, with the tab perhaps, and finds the drawn mask again
    check(b.dialogs == ["beforeunload"], f"asked by {b.dialogs}")
    b.wait(asks)
    b.js("document.getElementById('mask-copy').click()")
    check(not b.js(asks), "the page asks although the lines were copied")
    open_masks()
    b.wait(f"{text}.includes('back-door') && !document.getElementById('mask-changes').hidden")
    check(b.js("document.getElementById('mask-list').textContent").count("not in force") == 1, "a mask in force looks as if it were drawn")
    b.js("document.getElementById('mask-of').value = ''; document.getElementById('mask-of').dispatchEvent(new Event('change'))")
    b.wait(f"{shown} === '' && !document.getElementById('tag-left').textContent.startsWith('Camera')")
    b.js("document.getElementById('mask-new').click()")  # a place, by keys alone
    b.wait("document.activeElement === document.getElementById('stage')")
    for name, code, times in (("ArrowLeft", 37, 3), ("ArrowDown", 40, 5), ("ArrowRight", 39, 6)):
        for _ in range(times):
            b.key(name, code)
        b.key("Enter", 13, "\r")
    b.js("document.getElementById('mask-done').click()")
    b.call("Input.insertText", text="garden")
    b.js("document.getElementById('mask-keep').click()")
    b.wait("document.getElementById('mask-error').textContent.includes('how near')")
    b.js("(() => { const n = document.getElementById('mask-near-exact'); n.value = '5'; n.dispatchEvent(new Event('change')); })()")
    b.js("document.getElementById('mask-keep').click()")
    b.wait(f"{text}.includes('garden')")
    near = float(b.js(text).splitlines()[-1].split("near_px: ")[1].split(",")[0])
    check(abs(near - 560 * 0.12 / 5) < 0.01, f"5 m are {near} px")
    b.js("document.querySelectorAll('#mask-list .zone')[1].click()")  # its camera is shown again
    b.wait("document.getElementById('tag-left').textContent.startsWith('Camera r0c1')")
    b.js("document.getElementById('mask-delete').click()")
    b.wait(f"document.getElementById('mask-list').children.length === 2 && !{text}.includes('back-door')")
    fake.set(masks=[{"name": "window", "row": 0, "col": 1, "points": [[0.7, 0], [1, 0], [1, 0.3], [0.7, 0.3]], "near_px": None, "far_px": None},
                    {"name": "garden", "row": None, "col": None, "far_px": 0.0, "near_px": near,
                     "points": json.loads("[[" + b.js(text).split('points: "')[2].split('"')[0].replace(" ", "],[") + "]]")}])
    b.wait("document.getElementById('mask-changes').hidden")  # they are in force by now
    fake.set(role="view")
    b.wait("document.getElementById('mask-new').getAttribute('aria-disabled') === 'true'")
    fake.set(role="control")
    b.wait("!document.getElementById('mask-new').hasAttribute('aria-disabled')")
    b.key("Escape", 27)
    b.wait("document.getElementById('masks-drawer').hidden")
    check(b.js(shown) == "window", "the masks of the camera that is shown are not outlined")
    b.js("document.querySelector('#overlay input[value=\"\"]').click()")
    b.wait(f"{shown} === ''")
    b.js("document.querySelector('#camera .card-head .icon').click(); document.getElementById('toasts').replaceChildren()")


def test_video(b, fake):
    """Videos for others: two clicks from a card to a file; a span of what is played; cancelled ones are not saved."""
    saved = lambda: [r["path"] for r in fake.log() if r["method"] == "GET" and ".mp4" in r["path"]]
    b.click("#tab-visits")
    b.wait("document.querySelectorAll('#visits .visit').length > 1")
    b.click("#visits .visit:nth-child(1)")
    b.wait("document.getElementById('visit').open")
    name = b.js("document.getElementById('visit-title').textContent") and fake.visits()[0]["visit"]
    b.click("#visit-video")
    check(expect(lambda: fake.posts("/api/v1/videos")) == [{"visits": [name]}], "another visit than the card's")
    b.wait("/\\d+ %, \\d+ s left/.test(document.getElementById('visit-videos').textContent)")
    b.wait("document.querySelectorAll('#visit-videos a').length === 3")
    check(len(expect(saved)) == 1, f"saved: {saved()}")
    played = b.js("""(async () => { const v = document.createElement('video'); v.muted = true; v.src = document.querySelector('#visit-videos a').href;
      await new Promise((done, fail) => { v.onloadeddata = done; v.onerror = () => fail(new Error(v.error.message)); }); return v.videoWidth; })()""")
    check(played == 160, f"the browser plays it {played} px wide")
    b.click("#visit-close")
    b.wait("document.querySelectorAll('#visit-videos > *').length === 0")
    # A span of a recording, cancelled while it is made.
    fake.set(hold_videos=True)
    b.click("#tab-recordings")
    b.wait("document.querySelectorAll('#videos .card').length === 1 && !document.getElementById('signing-key').hidden")
    b.wait("document.querySelectorAll('.recording').length === 4")
    if not b.js("document.querySelector('.recording').open"):
        b.click(".recording summary")
    b.click(".recording .take button")
    b.wait("!document.getElementById('replay').hidden && document.getElementById('replay-time').textContent !== '–'")
    b.click("#replay-video")
    b.wait("document.getElementById('replay-video').getAttribute('aria-pressed') === 'true'")
    b.click("#replay-on")
    b.wait("document.getElementById('replay-video-text').textContent.includes('to here')")
    drawn = b.js("document.getElementById('replay-time').textContent")
    b.wait(f"document.getElementById('replay-time').textContent !== {drawn!r}")
    b.click("#replay-video")
    posts = expect(lambda: fake.posts("/api/v1/videos")[1:])
    check(posts[0]["from"] < posts[0]["to"] and posts[0]["recording"], f"the span is {posts}")
    b.click("#replay-live")
    b.wait("document.getElementById('replay').hidden")
    b.wait("document.querySelector('#videos .card progress')?.hidden === false")
    b.click("#videos .card button")
    b.wait("document.querySelectorAll('#videos .card').length === 1")
    b.click("#videos .card button")
    b.wait("document.querySelectorAll('#videos .card').length === 0 && document.getElementById('h-videos').hidden")
    fake.set(hold_videos=False)
    b.js("document.getElementById('toasts').replaceChildren()")
    b.click("#tab-overview")


def test_push(b, fake):
    """Notifications without a page: the browser subscribes with the filters of the panel; the service worker shows what comes."""
    b.call("Browser.grantPermissions", permissions=["notifications"], origin=fake.url.rstrip("/"))
    b.js("""PushManager.prototype.getSubscription = async () => window.pushed ?? null;
      PushManager.prototype.subscribe = async function (options) {
        window.pushed = { endpoint: "https://fcm.googleapis.com/x", options, toJSON: () => ({ endpoint: "https://fcm.googleapis.com/x", keys: { p256dh: "B", auth: "C" } }),
          unsubscribe: async () => { window.pushed = null; } };
        return window.pushed; }""")
    b.click("#tab-visits")
    b.js("(() => { const s = document.getElementById('visits-label'); s.add(new Option('Pedestrian')); s.value = 'Pedestrian'; })()")
    b.click("#notify-push")
    posts = expect(lambda: len(fake.posts("/api/v1/push")) == 2 and fake.posts("/api/v1/push"))
    check(posts[0] == {"endpoint": "https://fcm.googleapis.com/x", "p256dh": "B", "auth": "C", "labels": ["Pedestrian"], "zones": []}, f"it sends {posts}")
    check(posts[1].get("test") is True, "no example")
    check(b.js("window.pushed.options.applicationServerKey[0]") == 4, "the key is no point")
    b.js("(() => { const s = document.getElementById('visits-label'); s.value = ''; s.dispatchEvent(new Event('change')); })()")
    check(expect(lambda: fake.posts("/api/v1/push")[-1].get("labels") == []), "another filter is not sent")
    # A message of the push service, as the worker shows it.
    visit = fake.visits()[0]["visit"]
    message = {"title": "Pedestrian in gate", "body": "Yard: Pedestrian came", "tag": visit, "url": f"/#visit={visit}", "picture": f"/api/v1/visits/{visit}/seen", "time": ""}
    b.js("navigator.serviceWorker.ready.then(() => true)")
    deliver = lambda: b.call("ServiceWorker.deliverPushMessage", origin=fake.url.rstrip("/"), registrationId=b.worker(), data=json.dumps(message))
    notes = "navigator.serviceWorker.ready.then((r) => r.getNotifications()).then((all) => all.map((n) => [n.title, n.body, n.tag, (n.image ?? '').slice(0, 15), n.data.url]))"
    for _ in range(6):  # of one in many, a browser on a busy machine shows nothing
        deliver()
        shown = expect(lambda: b.js(notes), 10)
        if shown:
            break
    check(shown == [[message["title"], message["body"], visit, "data:image/jpeg", message["url"]]], f"the worker shows {shown}")
    b.js("window.dispatchEvent(new Event('focus'))")
    b.click("#notify-push")
    check(expect(lambda: fake.posts("/api/v1/push")[-1].get("delete") is True), "the subscription is not ended")
    b.wait("window.pushed === null")
    b.js("navigator.serviceWorker.getRegistration('/').then((r) => r.unregister())")
    b.js("document.getElementById('toasts').replaceChildren()")
    b.click("#tab-overview")


TESTS = [test_cameras, test_events, test_recordings, test_visits, test_review, test_review_keeps, test_calendar, test_video, test_timeline, test_notify, test_push, test_replay, test_replay_waits, test_zones, test_masks]
