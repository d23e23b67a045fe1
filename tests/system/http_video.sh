#!/usr/bin/env bash
# H.264 over WebSocket, by a client that is not ours: pictures, key pictures, slow and hostile viewers, limits, TLS.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
. "$(dirname "$0")/../lib.sh"
tool=$root/${SST_BUILD:-build}/tests/tools/http_pictures
need libavformat
mkfifo said
export SST=$sst
printf 'control: {socket: %s/none, group: ""}\nweb: {token_file: %s/token}\n' "$tmp" "$tmp" >sstd.yaml

cat >watch.py <<'PYTHON'
import os, ssl, struct, subprocess, sys, time
sys.path.insert(0, sys.argv[1] + "/tests")
from websocket import BINARY, CLOSE, PING, PONG, TEXT, Closed, Refused, Socket

port, tls = int(sys.argv[2]), len(sys.argv) > 3
bearer = {"Authorization": "Bearer " + open("token.view").read().strip()}
insecure = ssl.create_default_context()
insecure.check_hostname, insecure.verify_mode = False, ssl.CERT_NONE


def watch(path="/video", more=None, **how):
    return Socket(port, path, {**bearer, **(more or {})}, wrap=insecure.wrap_socket if tls else lambda s: s, **how)


def refused(status, path="/video", **more):
    try:
        watch(path, more.pop("headers", None), **more)
    except Refused as e:
        assert e.args[0] == status, e.args
        return
    raise AssertionError(f"{path} is not refused with {status}")


def closed(code, reason, path):
    s = watch(path)
    try:
        s.message()
    except Closed as e:
        assert e.args[0] == code and reason in e.args[1], e.args
        return
    raise AssertionError(f"{path} is not closed")


def pictures():
    s = watch()
    all_ = [s.picture() for _ in range(12)]
    first = all_[0]
    assert first["key"] and first["codec"].startswith("avc1.") and (first["width"], first["height"]) == (320, 240), first
    assert not all(p["key"] for p in all_), "all are key pictures"
    assert [p["set"] for p in all_] == sorted(p["set"] for p in all_)
    assert abs(time.time() - all_[-1]["us"] / 1e6) < 60
    stream = b"".join(p["data"] for p in all_)
    done = subprocess.run(["ffmpeg", "-v", "error", "-f", "h264", "-i", "-", "-f", "rawvideo", "-pix_fmt", "gray", "-"], input=stream,
                          capture_output=True, check=True)
    frames = [done.stdout[i:i + 320 * 240] for i in range(0, len(done.stdout), 320 * 240)]
    assert len(frames) == 12 and not done.stderr, (len(frames), done.stderr)
    assert frames[0] != frames[-1], "nothing moves"
    return s


def keys(s):
    other = watch()  # of the same encoder
    assert other.picture()["key"], "a new viewer gets no key picture"
    assert any(s.picture()["key"] for _ in range(30)), "they do not share an encoder"
    for _ in range(3):
        s.picture()
    s.send(TEXT, b"key")
    while not s.picture()["key"]:
        pass
    other.send(CLOSE, struct.pack(">H", 1000))
    assert other.close_code() == 1000
    open("small", "w").close()
    while s.picture()["width"] != 160:
        pass
    os.unlink("small")
    while True:
        p = s.picture()
        if p["width"] == 320:
            break
    assert p["key"], "the first one of another size is no key picture"


def silence(s):
    """Data of the ping after which nothing comes for a while."""
    ping = None
    s.sock.settimeout(1.5)
    while True:
        try:
            op, data = s.frame()
            ping = data if op == PING else ping
        except TimeoutError:
            if ping:
                s.sock.settimeout(60)
                return ping


def slow():
    """Pings that are not answered hold pictures back, and the next one after the answer is a key picture."""
    for attempt in range(1, 6):
        s = watch()
        s.pong = False
        s.picture()
        ping = silence(s)
        s.pong = True
        s.send(PONG, ping)
        if s.picture()["key"]:
            return
        print(f"attempt {attempt}: the server stood still, not its viewer", flush=True)
    raise AssertionError("after a gap comes no key picture")


def hostile():
    cases = {"no mask": (1002, lambda s: s.send(TEXT, b"key", mask=None)), "reserved bit": (1002, lambda s: s.send(TEXT, b"key", 0xc0)),
             "reserved opcode": (1002, lambda s: s.send(3)), "a ping in pieces": (1002, lambda s: s.send(PING, b"x", 0)),
             "a continuation": (1002, lambda s: s.send(0, b"x")), "binary": (1003, lambda s: s.send(BINARY, b"x")),
             "not UTF-8": (1007, lambda s: s.send(TEXT, b"\xff")), "another word": (1008, lambda s: s.send(TEXT, b"hello")),
             "too big": (1009, lambda s: s.send(TEXT, b"", length=126)), "pings": (1008, lambda s: s.sock.sendall(b"\x89\x80\0\0\0\0" * 500)),
             "pieces": (1009, lambda s: [s.send(TEXT if i == 0 else 0, b"x" * 50, 0) for i in range(3)])}
    for what, (code, act) in cases.items():
        s = watch()
        s.picture()
        act(s)
        got = s.close_code()
        assert got == code, f"{what}: closed with {got}, not {code}"
        s.close()
    s = watch()
    s.send(PING, b"hi")
    while s.frame() != (PONG, b"hi"):
        pass


def place(path):
    """A viewer, as soon as those before have gone."""
    while True:
        s = watch(path)
        try:
            s.picture()
            return s
        except Closed as e:
            assert e.args[0] == 4503, e.args
            time.sleep(0.05)


def limits():
    several = [watch() for _ in range(33)]  # they go with this function
    for s in several:
        try:
            s.picture()
        except Closed as e:
            assert e.args[0] == 4503 and "web.streams" in e.args[1], e.args
            return
    raise AssertionError("more viewers than web.streams")


def revoked():
    """The viewer of a named token goes with it."""
    def token(*words):
        return subprocess.run([os.environ["SST"], "token", *words, "--config", "sstd.yaml"], capture_output=True, check=True, text=True).stdout.strip()

    named = {"Authorization": "Bearer " + token("add", "porch", "--rights", "snapshot")}
    refused(403, headers=named)
    token("revoke", "porch")
    refused(401, headers=named)
    s = watch("/video", {"Authorization": "Bearer " + token("add", "porch", "--rights", "view")})
    s.picture()
    token("revoke", "porch")
    try:
        while True:
            s.picture()
    except Closed as e:
        assert e.args[0] == 4401, e.args


refused(401, headers={"Authorization": None})
refused(426, headers={"Upgrade": None})
refused(426, headers={"Sec-WebSocket-Version": "8"})
refused(403, headers={"Origin": "http://evil.example"})
refused(400, key="c2hvcnQ=")
watch("/video", {"Origin": f"http{'s' if tls else ''}://127.0.0.1:{port}"}).close()
closed(4404, "no view none", "/video/none")
s = pictures()
if not tls:
    keys(s)
    revoked()
    slow()
    hostile()
    limits()
    s = place("/video/camera/r0c0")
s.picture()
os.kill(int(open("server.pid").read()), 15)
assert s.close_code() == 1001
PYTHON

# serve: the server at $port, until watch.py ends it
serve() {
  timeout 600 "$tool" . 0 600 10 0 >said 2>err &
  server=$!
  exec 3<said
  read -r -t 60 port <&3 || { grep -q "no HTTP" err && skip "$(cat err)"; fail "no server: $(cat err)"; exit 1; }
  pgrep -P "$server" >server.pid
}
serve
timeout 300 /usr/bin/python3 watch.py "$root" "$port" >out 2>&1 || { fail "watching: $(tail -n 4 out)"; kill "$server"; }
ended "$server" "the server" || fail "server: $(cat err)"
grep '^attempt' out
exec 3<&- # its costs

openssl req -x509 -newkey ec -pkeyopt ec_paramgen_curve:P-256 -nodes -keyout key.pem -out cert.pem -days 2 -subj /CN=localhost 2>/dev/null ||
  skip "openssl is not installed"
serve
timeout 300 /usr/bin/python3 watch.py "$root" "$port" tls >out 2>&1 || { fail "over TLS: $(tail -n 4 out)"; kill "$server"; }
ended "$server" "the server" || fail "server: $(cat err)"
exit $failed
