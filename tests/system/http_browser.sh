#!/usr/bin/env bash
# A real browser, which sends origins and keeps cookies as it thinks right: logging in, and moving pictures as H.264 and as JPEG.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
. "$(dirname "$0")/../lib.sh"
tool=$root/${SST_BUILD:-build}/tests/tools/http_pictures
/usr/bin/python3 -c "import sys; sys.path.insert(0, '$root/tests/page'); import cdp; sys.exit(cdp.program() is None)" ||
  skip "chromium is not installed"

mkfifo said
timeout 600 "$tool" . 0 600 10 0 >said 2>err &
server=$!
exec 3<said
read -r -t 60 port <&3 || { grep -q "no HTTP" err && skip "$(cat err)"; fail "no server: $(cat err)"; exit 1; }
cat >login.py <<'PYTHON'
import os
import sys
sys.path.insert(0, sys.argv[1])
import cdp

browser = cdp.Browser()
whole = "document.readyState == 'complete' && "  # not while it comes
send = "document.querySelector('#token').value = '%s'; document.forms[0].submit(); 1"
reload = "fetch('/api/v1/reload', {method: 'POST', headers: {'Content-Type': 'application/json'}, body: '{}'}).then(r => r.status)"


def show():
    browser.js("""Promise.all([import('/web/stream.js'), import('/web/h264.js')]).then(([{Stream}, {video}]) => {
      window.kept = video;
      window.shown = new Stream(document.createElement('canvas'), async () => '/stream', (what) => { if (what === 'picture') window.delay_ms = shown.age_ms(); });
      shown.start();
    })""")
    browser.wait("shown.pictures > 5")


def again(script):
    added = browser.call("Page.addScriptToEvaluateOnNewDocument", source=script)["identifier"]
    browser.js("window.old = true")
    browser.call("Page.reload")
    browser.wait(whole + "!window.old")
    show()
    browser.call("Page.removeScriptToEvaluateOnNewDocument", identifier=added)


pixel = """(() => { const {data} = shown.canvas.getContext('2d').getImageData(0, 0, 320, 240);
  const at = (x, y) => [...data.slice(4 * (320 * y + x), 4 * (320 * y + x) + 3)];
  let x = 0; while (x < shown.canvas.width - 20 && at(x, 72)[2] < 200) x += 8; // the square
  return [...at(4, 8), ...at(150, 230), ...at(x + 12, 72)]; })()"""


def videos(browser):
    """The pictures of the page's own stream: H.264, and JPEG with the reason where that fails."""
    show()
    assert browser.js("kept.words()").startswith("H.264, by "), browser.js("kept.words()")
    assert browser.js("shown.shown === null && shown.canvas.width === 320")
    colours = browser.js(pixel)
    first = browser.js("shown.canvas.toDataURL()")
    browser.wait(f"shown.canvas.toDataURL() !== {first!r}")
    assert browser.js("shown.picture().then((blob) => blob.type)") == "image/jpeg"
    print(f"delay {browser.js('delay_ms'):.0f} ms", flush=True)
    open("small", "w").close()
    browser.wait("shown.canvas.width === 160")
    open("past", "w").close()  # as playback goes back
    browser.wait("shown.age_ms() > 3000000")
    os.unlink("past")
    browser.wait("shown.age_ms() < 3000000 && shown.shown === null")
    browser.js("shown.stop()")
    again("delete window.VideoDecoder")
    assert browser.js("shown.shown instanceof Blob") and browser.js("kept.words()") == "JPEG: this browser has no VideoDecoder"
    same = browser.js(pixel)
    assert all(abs(a - b) < 5 for a, b in zip(colours, same)), f"colours {colours} as H.264, {same} as JPEG"
    again("VideoDecoder.prototype.decode = function() { throw new Error('out of order'); }")
    assert browser.js("shown.shown instanceof Blob") and "the decoder failed: out of order" in browser.js("kept.words()"), browser.js("kept.words()")
    again("window.WebSocket = class { constructor() { setTimeout(() => this.onclose({ code: 1006 }), 10); } close() {} };")
    assert "a proxy" in browser.js("kept.words()"), browser.js("kept.words()")


try:
    browser.go(f"http://localhost:{sys.argv[2]}/")
    browser.wait(whole + "location.pathname == '/login' && document.querySelector('#token') !== null")
    browser.js(send % "wrong")
    browser.wait(whole + "document.querySelector('.error') !== null")
    assert "not the token" in browser.js("document.querySelector('.error').textContent")
    browser.js(send % open("token.view").read().strip())
    browser.wait(whole + "location.pathname == '/'")
    assert browser.js("document.cookie") == "", "a script can read the token"
    assert browser.js(reload) == 403, "the token for looking controls"
    browser.js("window.old = true")
    browser.go(f"http://localhost:{sys.argv[2]}/?token={open('token').read().strip()}")
    browser.wait(whole + "!window.old && location.pathname == '/' && location.search == ''")
    assert browser.js(reload) == 501, "the page may not POST"
    if sys.argv[3] == "video":
        videos(browser)
finally:
    browser.close()
PYTHON
"$sst" version --json | grep -q '"libavformat": true' && parts=video || parts=none
timeout 600 /usr/bin/python3 login.py "$root/tests/page" "$port" "$parts" || fail "logging in, or pictures"
kill "$server"
wait "$server"
exit $failed
