#!/usr/bin/python3
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
"""Calibration reports of made-up solutions, drawn by a browser. test_report.py TOOL: in the current folder.

Every section is there and no script fails; nothing comes from elsewhere; links and pictures lead somewhere; user text
stays text; page, JSON and expectations agree. Exits with 77 after the checks that need no browser if there is none."""
import base64
import json
import os
import re
import subprocess
import sys
import xml.etree.ElementTree as xml

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import cdp

BEGIN = '<script type="application/json" id="data">'
ALL = "summary array cameras frames worst links spread rig light table"
CASES = {  # settings of the tool, expected figures; lacks: sections that are not there
    "plain": ("frames=100", dict(verdict="good", pictures=3, cameras_known=36, bytes=2e6, lacks="rig")),
    "troubled": ("frames=30 bent=7 moved=12 unsolved=30 hole=5 rig=1",
                 dict(verdict="usable", pictures=3, cameras_missing=1, worst_frame="frame0012", lacks="")),
    "nasty": ("rows=2 cols=3 frames=8 nasty=1 outliers=0.02", dict(cameras_known=6, lacks="rig")),
    "uncrossed": ("rows=2 cols=2 frames=20 cross=nan pictures=0 light=0",
                  dict(verdict="usable", pictures=0, lacks="rig light")),
    "single": ("rows=1 cols=1 frames=12", dict(cameras_known=1, lacks="rig array links")),
    "pair": ("rows=1 cols=2 frames=12 width=640 height=480", dict(cameras_known=2, lacks="rig")),
    "many": ("rows=16 cols=16 frames=6 pictures=0", dict(cameras_known=256, bytes=5e6, lacks="rig")),
    "bare": ("rows=2 cols=2 frames=6 plain=1", dict(cameras_known=4, lacks="rig light")),
    "forgotten": ("rows=2 cols=3 frames=4 forgotten=1 plain=1 hole=1 unsolved=2 rig=1",
                  dict(verdict="do not use", pictures=0, cameras_known=4, lacks="worst light")),
    "upright": ("rows=3 cols=1 frames=500 across=4 down=3 width=480 height=640", dict(cameras_known=3, lacks="rig")),
}


def make(tool, name, settings):
    out = subprocess.run([tool, f"{name}.html", *settings.split()], check=True, capture_output=True).stdout.decode()
    page = open(f"{name}.html", encoding="utf-8").read()
    data = page[page.index(BEGIN) + len(BEGIN):]
    data = json.loads(data[:data.index("</script>")])
    assert data["figures"] == json.loads(out[out.index("\n{") + 1:]), "the page's figures are not those of the JSON"
    assert set(re.findall(r"https?://[^\"' ]*", page)) <= {"http://www.w3.org/2000/svg"}, "a foreign address"
    return page, data["figures"]


def check_expected(page, figures, expect):
    for key, want in expect.items():
        if key == "bytes":
            assert len(page.encode()) < want, len(page.encode())
        elif key not in ("lacks", "pictures"):
            assert figures[key] == want, (key, figures[key], want)


def check_elements(root, figures, expect):
    for e in root.iter():
        e.tag = e.tag.split("}")[-1]
    ids = [e.get("id") for e in root.iter() if e.get("id")]
    assert len(ids) == len(set(ids)), "an id is there twice"
    assert [i for i in ids if i in ALL.split()] == [i for i in ALL.split() if i not in expect["lacks"].split()], ids
    pictures = 0
    for e in root.iter():
        assert e.tag not in ("link", "iframe", "object", "embed", "base", "form"), e.tag
        assert not any(name.startswith("on") for name in e.attrib), e.attrib
        link = e.get("href") or e.get("src")
        if link and link.startswith("data:image/jpeg;base64,"):
            data = base64.b64decode(link.split(",")[1], validate=True)
            assert data[:2] == b"\xff\xd8" and data[-2:] == b"\xff\xd9", "not a whole JPEG"
            pictures += 1
        elif link:
            assert link[0] == "#" and (link[1:] in ids or re.fullmatch(r"#cam\d+", link)), link
        if e.tag == "path":  # only moves and numbers: nothing that a renderer stops at
            assert re.fullmatch(r"[MmLlHhVvQqAaZz0-9. e+-]*", e.get("d")), e.get("d")[:80]
        for name in ("x", "y", "width", "height", "cx", "cy", "r"):
            if e.tag in ("rect", "circle", "text", "image") and e.get(name) is not None:
                value = float(e.get(name))
                assert value == value and abs(value) < 1e7 and (name not in ("width", "height", "r") or value >= 0), e.attrib
    assert pictures == expect.get("pictures", pictures), pictures
    assert sum(e.get("class") == "tile" for e in root.iter()) >= 2 * len(figures["cameras"]), "tiles are missing"


def check_text(text, figures):
    wrong = re.search(r".{0,40}\b(nan|infinity px|undefined|null|\[object)\b", text, re.I)
    assert not wrong, wrong
    assert f"Verdict: {figures['verdict']}" in text, figures["verdict"]
    assert f"{figures['corners']:,} corners" in text
    if figures["rms_px"] is not None:
        assert f"Reprojection error{figures['rms_px']:.3f} px" in text, figures["rms_px"]
    for c in figures["bars"]:
        assert c["definition"] in text
        assert not c["reason"] or " ".join(c["reason"].split()) in text, c["reason"]
    for camera in figures["cameras"]:
        assert " ".join(camera["name"].split()) in text, camera["name"]
    if figures["weakest_link"]:
        assert f"{figures['weakest_link']['corners']:,} corners in" in text


def check_page(browser, name, figures, expect):
    browser.go("about:blank")
    browser.wait("location.href == 'about:blank'")
    browser.go(f"file://{os.getcwd()}/{name}.html")
    browser.wait("document.readyState == 'complete' && location.protocol == 'file:'")
    assert not browser.problems, browser.problems
    assert browser.js("document.body.dataset.drawn"), "the script did not end"
    assert not browser.js("document.documentElement.scrollWidth > innerWidth"), "wider than the window"
    root = xml.fromstring(browser.js("document.querySelectorAll('script, style').forEach((e) => e.remove());"
                                     "new XMLSerializer().serializeToString(document.documentElement)"))
    check_elements(root, figures, expect)
    check_text(" ".join("".join(root.itertext()).split()), figures)


def check_card(browser, figures):
    """A camera's tile opens its card, the keys go on to the next one, closing leaves the address."""
    first, second = figures["cameras"][:2]
    shown = "document.querySelector('dialog[open] h2')?.textContent.startsWith(%s)"
    browser.js("document.querySelector('.tile').click()")
    browser.wait(shown % json.dumps(first["name"]))
    browser.js("document.querySelector('dialog').dispatchEvent(new KeyboardEvent('keydown', {key: 'ArrowRight'}))")
    browser.wait(shown % json.dumps(second["name"]))
    browser.js("document.querySelector('dialog').close()")
    browser.wait("location.hash == ''")
    assert not browser.problems, browser.problems


def main(tool):
    made = {name: make(tool, name, settings) for name, (settings, _) in CASES.items()}
    for name, (page, figures) in made.items():
        check_expected(page, figures, CASES[name][1])
    assert make(tool, "again", CASES["plain"][0])[0] == made["plain"][0], "the same input gave another page"
    if not cdp.program():
        print("skipped: the pages were not drawn: needs chromium")
        return 77
    browser = cdp.Browser(light=True)
    try:
        for number, (name, (_, figures)) in enumerate(made.items()):
            browser.size(*((1300, 900), (390, 800))[number % 2])
            try:
                check_page(browser, name, figures, CASES[name][1])
                if name in ("plain", "nasty"):
                    check_card(browser, figures)
            except (AssertionError, cdp.Failed) as e:
                print(f"FAIL: {name}: {e!r}")
                return 1
    finally:
        browser.close()
    return 0


sys.exit(main(sys.argv[1]))
