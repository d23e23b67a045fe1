# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
"""The page as a whole: hints, who may do what, states of the service, other tabs and screens: tests of test_page.py."""
import json
import time

from page_bench import check, expect, fresh, last, mode, reload, rest, zoomed

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


def make_token(b, fake, tokens):
    """A token is made; its secret is on the page once, and in the window also where that is low."""
    made = "document.getElementById('token-made')"
    b.size(1440, 420)
    b.js("document.getElementById('token-name').value = 'porch'")
    b.click("#token-make")
    b.wait(f"{made}.textContent === 'Token: there is a token porch already.'")
    b.js("document.getElementById('token-name').value = 'not a name'")
    b.click("#token-make")  # the browser itself refuses it
    b.js("document.getElementById('token-name').value = 'display'")
    b.click("#token-rights input[value=view]")
    b.click("#token-make")
    b.wait(f"{made}.textContent === 'A token needs a right: choose one.'")
    b.click("#token-rights input[value=snapshot]")
    b.js("document.getElementById('token-expires').value = '31536000'")
    b.click("#token-make")
    b.wait(f"{made}.querySelector('input')?.value === 'secret-of-display'")
    b.wait(f"{made}.querySelector('input').getBoundingClientRect().bottom <= document.getElementById('sessions').getBoundingClientRect().bottom")
    b.size(1440, 900)
    year = "new Date(Date.now() + 31536000000).getFullYear()"
    b.wait(f"{tokens}.some((text) => text.startsWith('displaysnapshot · expires') && text.includes({year}))")
    made_by = [body for body in fake.posts("/api/v1/tokens") if "name" in body]
    check(made_by == [{"name": "porch", "rights": ["view"], "expires_s": 2592000},
                      {"name": "display", "rights": ["snapshot"], "expires_s": 31536000}], made_by)
    b.key("Escape", 27)
    b.wait("!document.getElementById('sessions').open")
    check(not b.js("document.body.innerHTML.includes('secret-of-display')"), "the secret stays on the page")
    b.click("#account")
    b.wait("document.getElementById('sessions').open")
    check(b.js(f"{made}.childNodes.length") == 0, "the secret comes back")


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
    tokens = "[...document.querySelectorAll('#token-list li')].map((n) => n.textContent)"
    b.wait(f"{tokens}.length === 2")
    check(b.js(tokens) == ["guardview, recordings · never expiresRevoke", "porchview, recordings · never expiresRevoke"], b.js(tokens))
    b.click("#token-list li:first-child button")
    b.wait(f"{tokens}.length === 1")
    check(fake.posts("/api/v1/tokens/guard") == [{"revoke": True}], "the token is not revoked")
    make_token(b, fake, tokens)
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
    fake.set(status={"live": {"too_slow": True, "rate_hz": 0.3, "due_hz": 5.0},
                     "noticed": [{"what": "too-slow", "text": "too slow: 0.3 of 5.0 sets a second are processed"}]})
    b.wait("document.getElementById('state-word').textContent === 'Too slow' && document.getElementById('state').dataset.kind === 'warn'")
    b.wait("document.getElementById('v-rate').textContent === '0.3 of 5.0 /s' && document.getElementById('v-rate').dataset.kind === 'warn'")
    fake.set(status={"live": {"too_slow": False, "rate_hz": 5.0}, "noticed": []})
    b.wait("document.getElementById('state-word').textContent === 'Live' && document.getElementById('v-rate').dataset.kind === ''")


def test_storage(b, fake):
    """A loop of recordings that fills its quota is no trouble; a disk that fills up is, and so is a loop that stands."""
    free = "document.getElementById('v-free')"
    fake.set(status={"storage": {"state": "LOW", "limit": "quota", "reason": "the oldest are removed"}})
    b.wait(f"{free}.title === '188 GB of 400 GB; the oldest are removed'")
    check(b.js(f"{free}.dataset.kind") == "", "LOW by the quota warns")
    check(b.js(f"{free}.textContent") == "47 %" and b.js("document.getElementById('v-free-name').textContent") == "Disk used", f"the header says {b.js(f'{free}.textContent')}")
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
    b.wait(f"{card}.includes('JPEG: this service only pretends')")
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
    check(expect(lambda: any(r["path"] == "/api/v1/views/main" for r in fake.log())), "the main view cannot be set")
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
    b.click("#tab-overview")
    b.click("[data-name=r0c0]")
    b.wait("!document.getElementById('camera').hidden")
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


def check_rows(b, pairs, width, height):
    """The two elements of each pair stand beside each other."""
    for left, right in pairs:
        apart = b.js(f"Math.abs(document.getElementById('{left}').getBoundingClientRect().y - "
                     f"document.getElementById('{right}').getBoundingClientRect().y)")
        check(apart < 10, f"at {width} x {height} {left} and {right} are in different rows")


def test_phone(b, fake):
    b.size(390, 844, phone=True)
    for tab in ("overview", "health", "events", "recordings", "visits"):
        b.click(f"#tab-{tab}")
        check(b.js("document.documentElement.scrollWidth <= 390"), f"{tab} scrolls sideways")
    cut_off = b.js("[...document.querySelectorAll('#visits .facts-line')].filter((n) => n.scrollHeight > n.clientHeight + 1).map((n) => n.textContent)")
    check(not cut_off, f"cards whose text does not fit: {cut_off}")
    plain = b.box(".bar")[3]
    recording = b.js("""(() => {
        const [badge, text] = ['rec-badge', 'rec-badge-text'].map((id) => document.getElementById(id));
        badge.hidden = false;
        text.textContent = 'REC 00:31';
        const height = document.querySelector('.bar').getBoundingClientRect().height;
        badge.hidden = true;
        return height;
    })()""")
    check(recording <= plain + 1, "the badge of a recording takes a line of its own, and moves the picture")
    b.js("document.getElementById('replay').hidden = false")
    check_rows(b, (("replay-play", "replay-speed"), ("replay-at", "replay-video")), 390, 844)
    b.js("document.getElementById('replay').hidden = true")
    hold = lambda n, s: [b.touch("touchStart", b.at_rest(f"#visits .visit:nth-child({n}) .visit-picture")[:2]), time.sleep(s), b.touch("touchEnd")]
    b.js("document.querySelector('#visits .visit').scrollIntoView({block: 'end'})")
    hold(1, 0.8)  # a finger that stays selects, then others do by a tap
    b.wait("document.getElementById('selection-count').textContent === '1 selected' && !document.getElementById('visit').open")
    hold(2, 0)
    b.wait("document.getElementById('selection-count').textContent === '2 selected' && !document.getElementById('visit').open")
    b.js("document.querySelector('#selection-clear').click()")
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
        check_rows(b, (("auto", "sweep"), ("adjust", "record")), width, height)
        mode(b, "clear")
        check(b.js(f"document.documentElement.scrollWidth <= {width}"), f"clear: {width} x {height} scrolls sideways")
        check_rows(b, (("cut-auto", "outline"), ("snapshot", "record")), width, height)
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


def test_silent(b, fake):
    """H.264 is not given up while the service sends nothing, but when nothing of what it sends is decoded."""
    timers, why = b.js("""(async () => {
        const { watch } = await import('/web/h264.js');
        const real = [WebSocket, setTimeout];
        const timers = [], made = [];
        globalThis.WebSocket = class { static OPEN = 1; readyState = 1; constructor() { made.push(this); } close() {} send() {} };
        globalThis.setTimeout = (run) => timers.push(run);
        const ended = watch('/video', new AbortController().signal, { show() {}, alive() {} }).then(() => 'ended', (error) => error.message);
        timers[0]();
        const before = timers.length;
        made[0].onmessage({ data: '{"codec":"avc1.42c01f","width":640,"height":480,"encoder":"none"}' });
        timers.at(-1)();
        [globalThis.WebSocket, globalThis.setTimeout] = real;
        return [before, await ended];
    })()""")
    check(timers == 2 and why == "no picture was decoded in time", f"{timers} timers, then: {why}")


def test_contrast(b, fake):
    for light in (True, False):
        b.scheme(light)
        for tab in ("health", "events", "recordings", "visits", "overview"):
            mode(b, "clear" if tab == "events" else "sst")
            b.click(f"#tab-{tab}")
            bad = b.js(CONTRAST)
            check(not bad, f"{'light' if light else 'dark'}, {tab}: too little contrast: {bad[:5]}")


def test_infinity(b, fake):
    """A far end that lies at infinity has no pixels beside metres."""
    far = "document.getElementById('far-end').textContent"
    near = b.js("(async () => (await (await fetch('/api/v1/status')).json()).live.range_px[1])()")
    fake.set(status={"live": {"range_px": [-0.5, near]}})
    b.wait(f"{far}.includes('∞') && !{far}.includes('px')")


TESTS = [test_hints, test_locale, test_sessions, test_role, test_states, test_storage, test_hosts, test_device,
         test_shared, test_restart, test_reload, test_hidden, test_windows, test_busy, test_cut, test_silent, test_update,
         test_phone, test_names, test_contrast, test_infinity]
