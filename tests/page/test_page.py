# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
"""test_page.py PICTURES: what users do on the page, in a real browser, against tests/page/fake.py."""
import os
import sys
import time

import cdp
import page_lists
import page_picture
import page_whole
from page_bench import Fake

TESTS = page_picture.TESTS + page_lists.TESTS + page_whole.TESTS  # one after the other, in one tab
ONLY = os.environ.get("PAGE_ONLY", "").split()
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
                print(f"FAIL: {test.__name__}: {e}\n  {browser.state()}", flush=True)
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
