#!/usr/bin/env python3
"""Films the page on a running `sst demo --scene bush`: page_pictures.py ADDRESS [OUT]

ADDRESS is the one that the demo prints, with its token. Saves docs/pictures/page.jpg, the clear picture beside the camera's, and
page-phone.jpg, when most of what leaves hide has been seen. Fails if the console complains.
"""
import os
import sys
import time

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
sys.path.insert(0, os.path.join(ROOT, "tests/page"))
import cdp  # noqa: E402

READY = "document.querySelector('.bar')?.textContent.includes('Live')"
SETTLING_S = 40  # gaps in front of each part of the scene open and close many times


def main():
    address, out = sys.argv[1], sys.argv[2] if len(sys.argv) > 2 else os.path.join(ROOT, "docs/pictures")
    b = cdp.Browser()
    try:
        b.call("Emulation.setLocaleOverride", locale="en-GB")
        b.size(1360, 850)
        b.go(address)
        b.wait(READY)
        b.js("for (const close of document.querySelectorAll('#hint-close, #hint-visits-close')) close.click()")  # read long ago
        b.click("#compare")
        b.wait("document.querySelector('#tag-right').textContent === 'Camera'")
        time.sleep(SETTLING_S)
        b.picture(f"{out}/page.jpg", 82)
        b.click("#compare")
        b.size(390, 844, True)
        time.sleep(5)
        b.picture(f"{out}/page-phone.jpg", 82)
        for problem in b.problems:
            print("console:", problem)
        return bool(b.problems)
    finally:
        b.close()


sys.exit(main())
