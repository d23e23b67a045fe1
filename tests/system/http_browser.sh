#!/usr/bin/env bash
# Logging in with a real browser, which sends origins and keeps cookies as it thinks right.
. "$(dirname "$0")/../lib.sh"
tool=$root/${SST_BUILD:-build}/tests/tools/http_pictures
/usr/bin/python3 -c "import sys; sys.path.insert(0, '$root/tests/page'); import cdp; sys.exit(cdp.program() is None)" ||
  skip "chromium is not installed"

mkfifo said
timeout 600 "$tool" . 1000 1 10 1000 >said 2>err &
server=$!
exec 3<said
read -r -t 60 port <&3 || { grep -q "no HTTP" err && skip "$(cat err)"; fail "no server: $(cat err)"; exit 1; }
cat >login.py <<'PYTHON'
import sys
sys.path.insert(0, sys.argv[1])
import cdp

browser = cdp.Browser()
whole = "document.readyState == 'complete' && "  # not while it comes
send = "document.querySelector('#token').value = '%s'; document.forms[0].submit(); 1"
reload = "fetch('/api/v1/reload', {method: 'POST', headers: {'Content-Type': 'application/json'}, body: '{}'}).then(r => r.status)"
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
finally:
    browser.close()
PYTHON
timeout 600 /usr/bin/python3 login.py "$root/tests/page" "$port" || fail "logging in"
kill "$server"
wait "$server"
exit $failed
