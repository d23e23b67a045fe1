#!/usr/bin/env python3
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
"""Takes the pictures of docs/use/page.md from a running demo: page_pictures.py page|story ADDRESS [OUT]

ADDRESS is the one that the demo prints, with its token.

page, on `sst demo --scene bush`: page.jpg, the clear picture beside the camera's, and page-phone.jpg, after some time, when most of what the
leaves hide has been seen.

story, on `sst demo --scene hedge`: waits for a visit that has ended and was recorded, then does what a guard
does, in a headless Chromium, and saves docs/pictures/story-*.jpg: the cards of the visits, one of them large, the moment played beside
the camera's picture, and that on a phone by day. Prints the seconds and clicks that it took. Fails if the console complains.
"""
import os
import sys
import time

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
sys.path.insert(0, os.path.join(ROOT, "tests/page"))
import cdp  # noqa: E402

SETTLING_S = 40  # by then most of the scene was visible between leaves
READY = "document.querySelector('.bar')?.textContent.includes('Live')"


def ended_visit(b):
    """The newest visit behind leaves with a picture, which has ended and whose recording has, too."""
    return b.wait("""fetch('/api/v1/visits').then((r) => r.json()).then(({visits}) => fetch('/api/v1/recordings').then((r) => r.json()).then(
        ({recordings}) => visits.find((v) => v.hidden && !v.active && v.pictures.includes('seen') && v.direction === 'left to right' && recordings.some(
            (r) => !r.active && r.from <= v.from && r.to >= v.from))?.visit))""", 240)


def moment(b, name):
    """When the visitor was left of the middle, in ms of the recording."""
    return b.js(f"""(async () => {{
        const get = async (what) => (await (await fetch('/api/v1/' + what)).json())[what];
        const visit = (await get('visits')).find((v) => v.visit === '{name}');
        const recording = (await get('recordings')).find((r) => r.from <= visit.from && r.to >= visit.from);
        const at = visit.path.reduce((a, p) => (Math.abs(p[1] - 0.4) < Math.abs(a[1] - 0.4) ? p : a));
        return Date.parse(visit.from) + 1000 * at[0] - Date.parse(recording.from);
    }})()""")


def seek(b, at_ms):
    b.js(f"""const slider = document.querySelector('#replay-at'); slider.value = {at_ms};
        for (const event of ['input', 'change']) slider.dispatchEvent(new Event(event));""")


def play(b, visit):
    """From the card to the moment in the large place: two clicks."""
    b.click(f"#visits .visit:nth-child({visit})")
    b.wait("!document.querySelector('#visit-play').disabled && document.querySelector('#visit-image').naturalWidth > 0")


def close_hints(b):
    b.js("for (const close of document.querySelectorAll('#hint-close, #hint-visits-close')) close.click()")


def compare(b):
    b.click("#compare")
    b.wait("document.querySelector('#tag-right').textContent === 'Camera'")


def page(b, address, out):
    b.size(1360, 850)
    b.go(address)
    b.wait(READY)
    close_hints(b)
    compare(b)
    time.sleep(SETTLING_S)
    b.picture(f"{out}/page.jpg", 82)
    b.click("#compare")
    b.size(390, 844, True)
    time.sleep(5)
    b.picture(f"{out}/page-phone.jpg", 82)


def story(b, address, out):
    b.size(1280, 800)
    b.go(address)
    b.wait(READY)
    name = ended_visit(b)
    b.go(address.split("?")[0])
    start = time.time()
    b.wait(READY)
    b.click("#tab-visits")
    b.wait("document.querySelectorAll('#visits .visit [data-drawn]').length > 0")
    print(f"card after {time.time() - start:.1f} s")
    at = b.js(f"(async () => (await (await fetch('/api/v1/visits')).json()).visits.findIndex((v) => v.visit === '{name}') + 1)()")
    close_hints(b)
    time.sleep(3)
    b.picture(f"{out}/story-visits.jpg", 82)
    play(b, at)
    time.sleep(1)
    b.picture(f"{out}/story-visit.jpg", 82)
    b.click("#visit-play")
    b.wait("!document.querySelector('#replay').hidden")
    b.wait("!document.querySelector('#stage-box').innerText.includes('first picture')")
    time.sleep(1.5)
    b.click("#replay-play")  # a pause
    seek(b, moment(b, name))
    time.sleep(5)
    compare(b)
    time.sleep(3)
    b.js("document.querySelector('#divider').focus()")
    while b.js("document.querySelector('#divider').getAttribute('aria-valuenow') * 1") < 75:
        b.key("ArrowRight", 39)
    time.sleep(2)
    b.picture(f"{out}/story-play.jpg", 82)
    b.scheme(True)
    b.size(390, 844, True)
    time.sleep(3)
    b.js("document.querySelector('#stage-box').scrollIntoView()")
    time.sleep(2)
    b.picture(f"{out}/story-phone.jpg", 82)


def main():
    take = {"page": page, "story": story}[sys.argv[1]]
    address, out = sys.argv[2], sys.argv[3] if len(sys.argv) > 3 else os.path.join(ROOT, "docs/pictures")
    b = cdp.Browser()
    try:
        b.call("Emulation.setLocaleOverride", locale="en-GB")
        take(b, address, out)
        for problem in b.problems:
            print("console:", problem)
        return bool(b.problems)
    finally:
        b.close()


sys.exit(main())
