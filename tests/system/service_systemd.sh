#!/usr/bin/env bash
# sstd as systemd runs it, and sst as its client, on simulated cameras: readiness, status, watchdog, reload, stop, a kill, a
# faulty configuration, a socket that is there before it. This script is the systemd.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
. "$(dirname "$0")/../lib.sh"
build=$root/${SST_BUILD:-build}
[ -x "$build/sst-sim" ] || skip "sst-sim is not built: no simulated cameras"
need libcurl
ldd "$build/sstd" | grep -q libsystemd || skip "built without libsystemd: nobody is notified"
ldd "$build/sstd" | grep -q libmicrohttpd || skip "built without libmicrohttpd: the service cannot be asked"

cat >sstd.yaml <<Y
array: { rows: 6, cols: 6 }
cameras: { width: 160, height: 128 }
control: { socket: $tmp/control.sock, group: "" }
web: { enabled: false }
rtsp: { enabled: false }
storage: { dir: $tmp/store, ring_mb: 48, min_free_gb: 0 }
Y
cat >run.py <<'PY'
"""Everything under one simulated session, which takes a moment to start."""
import json, os, re, signal, socket, subprocess, sys, threading, time

build, tmp, tests = sys.argv[1:]
# A question without an answer within a minute ends this process with the service's stacks.
os.environ.update(SST_TEST_PID=str(os.getpid()), SST_TEST_OUT="stacks")
signal.signal(signal.SIGTERM, lambda *_: (print(open("stacks").read(), flush=True), os._exit(1)))
sst = [tests + "/ask.sh", build + "/sst"]
patience = 0 if os.environ.get("SST_TIMING") else 30
note = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
note.bind("notify")
heard = []  # what systemd was told, and did not look at yet
failed = 0


def listen():
    while True:
        heard.append(note.recv(4096).decode())


threading.Thread(target=listen, daemon=True).start()


def fail(text):
    global failed
    failed = 1
    print("FAIL:", text, open("log").read()[-1500:] if os.path.exists("log") else "")


def start(listener=None, notify="notify"):
    """As the unit does; `listener`: a socket handed over as descriptor 3."""
    heard.clear()
    env = {**os.environ, "NOTIFY_SOCKET": f"{tmp}/{notify}", "WATCHDOG_USEC": "2000000"}

    command = [build + "/sstd", "--config", "sstd.yaml"]
    if listener:  # LISTEN_PID is the service's own: a shell becomes the service
        env["LISTEN_FDS"] = "1"
        command = ["sh", "-c", "exec 3<&$0; LISTEN_PID=$$ exec \"$@\"", str(listener.fileno()), *command]
    return subprocess.Popen(command, env=env, stderr=open("log", "a"), pass_fds=(listener.fileno(),) if listener else ())


def in_time(begin, seconds, what, until=None):
    if (until or time.monotonic()) - begin > seconds + patience:
        fail(f"{what}: not within {seconds} s")


def told(pattern, seconds):
    """Wait until systemd is told so. Returns all that it was told until then."""
    seen, begin = [], time.monotonic()
    while time.monotonic() < begin + seconds + 60:
        while heard:
            seen.append(heard.pop(0))
            if re.search(pattern, seen[-1], re.M):
                in_time(begin, seconds, f"systemd is told {pattern}")
                return seen
        time.sleep(0.02)
    fail(f"systemd is not told {pattern}, but {seen[-5:]}")
    return seen


def ask(*args, code=0):
    r = subprocess.run([*sst, *args], capture_output=True, text=True, timeout=120,
                       env={**os.environ, "SST_SOCKET": tmp + "/control.sock"})
    if r.returncode != code:
        fail(f"sst {' '.join(args)}: exit {r.returncode}, not {code}: {r.stderr}")
    return r.stdout + r.stderr


def wait(seconds, what, condition):
    begin = otherwise = look = time.monotonic()
    while not condition():
        if time.monotonic() > begin + seconds + 30:
            fail(f"{what}: not at all")
            os.system(f"{tests}/../scripts/stacks.sh {service.pid}")
            sys.exit(1)
        otherwise = look  # when a look began that did not find it: how long looking takes is not the service's time
        time.sleep(0.1)
        look = time.monotonic()
    in_time(begin, seconds, what, otherwise)


def state():
    r = subprocess.run([*sst, "status", "--json", "--socket", "control.sock"], capture_output=True, text=True)
    return json.loads(r.stdout)["state"] if r.returncode in (0, 3) else ""


def end(service, seconds=2.0):
    begin = time.monotonic()
    service.send_signal(signal.SIGTERM)
    code = service.wait(120)
    print(f"ended after {1000 * (time.monotonic() - begin):.0f} ms")
    in_time(begin, seconds, "the end")
    if code:
        fail(f"the end: exit {code}")


service = start()
told("^READY=1", 20)
wait(30, "capturing", lambda: state() == "capturing")
if not re.search("STATUS=.*36 of 36 cameras", "\n".join(told("^WATCHDOG=1", 3) + told("STATUS=capturing", 5))):
    fail("the status line")


def says_all():
    text = ask("status")
    return all(word in text for word in ("capturing", "36 of 36 cameras", "skew", "live", "storage", "recording"))


def clients():
    wait(10, "a status with all that there is", says_all)
    wait(10, "a full grid of rates", lambda: len(re.findall(r" (9|10)\.\d", ask("cameras"))) == 36)
    if "started" not in ask("events", "--type", "start"):
        fail("events")
    wait(30, "a live picture", lambda: subprocess.run([*sst, "snapshot", "-o", "now.jpg", "--socket", "control.sock"],
                                                       capture_output=True).returncode == 0)
    wait(10, "a picture of a camera", lambda: subprocess.run([*sst, "snapshot", "--of", "r2c3", "-o", "camera.jpg", "--socket",
                                                             "control.sock"], capture_output=True).returncode == 0)
    for name in ("now.jpg", "camera.jpg"):
        if open(name, "rb").read(2) != b"\xff\xd8":
            fail(f"{name} is no JPEG")
    ask("snapshot", "--of", "r9c9", "-o", "bad.jpg", code=3)
    ask("snapshot", "--keep", "-o", "kept.tar")
    names = subprocess.run(["tar", "tf", "kept.tar"], capture_output=True, text=True).stdout
    if "lightfield.json" not in names:
        fail(f"kept.tar: {names}")
    ask("record", "start", "--duration", "1")
    wait(10, "the end of a recording", lambda: "on demand" in ask("record", "list") and "now" not in ask("record", "list"))
    ask("record", "stop", code=3)


if patience:  # not once more where time is measured
    clients()

# Reload: by the signal, with its two notices, and by the client, which prints refusals.
yaml = open("sstd.yaml").read()
open("sstd.yaml", "w").write(yaml + "live: { focus_px: 5 }\n")
if "live.focus_px" not in ask("reload", "--dry-run"):
    fail("what a reload would change")
begin = time.monotonic()
service.send_signal(signal.SIGHUP)
seen = told(r"^RELOADING=1\nMONOTONIC_USEC=\d+$", 5)
told("^READY=1", 5)
if not begin <= int(re.search(r"USEC=(\d+)", seen[-1])[1]) * 1e-6 + 1e-6 <= time.monotonic() + 1e-6:
    fail(f"the moment of the reload: {seen[-1]}")
if "nothing would change" not in ask("reload", "--dry-run"):
    fail("the signal did not reload")
open("sstd.yaml", "w").write(yaml.replace("rows: 6", "rows: six"))
if "sstd.yaml:1:" not in ask("reload", code=3):
    fail("a refused reload")
wait(5, "capturing after a refused reload", lambda: state() == "capturing")
end(service)
told("^STOPPING=1", 1)

# A faulty configuration: the status that systemd does not try again.
if subprocess.run([build + "/sstd", "--config", "sstd.yaml"], capture_output=True, timeout=120).returncode != 78:
    fail("a faulty configuration does not end it with 78")
open("sstd.yaml", "w").write(yaml)
ask("status", code=5)

# Killed, and started again: its socket is replaced.
service = start()
told("^READY=1", 20)
service.kill()
service.wait()
begin = time.monotonic()
service = start()
wait(20, "capturing after a kill", lambda: state() == "capturing")
print(f"capturing again {time.monotonic() - begin:.1f} s after a kill")
end(service)

# A socket that systemd made: a question waits for the service, and the socket stays when it ends.
listener = socket.socket(socket.AF_UNIX)
if os.path.exists("control.sock"):
    os.unlink("control.sock")
listener.bind("control.sock")
listener.listen(8)
early = subprocess.Popen([*sst, "status", "--socket", "control.sock"], stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
time.sleep(0.3)
service = start(listener)
if early.wait(120) or b"sst 0" not in early.communicate()[0]:
    fail("an early question was not answered")
end(service)
if not os.path.exists("control.sock"):
    fail("the socket of systemd was removed")

# A systemd that hangs holds the main thread up, which then does not even begin to stop: the process ends in time all the
# same, with status 0, and of the recording at work all is there that was said to be.
silent = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
silent.bind("silent")
probe = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)


def is_full():
    try:
        return not probe.sendto(b"x", socket.MSG_DONTWAIT, "silent")
    except BlockingIOError:
        return True


def heeded(condition):
    """Until the service is ready for it, systemd hears it: without its main thread it would not come to capture."""
    try:
        while True:
            silent.recv(4096, socket.MSG_DONTWAIT)
    except BlockingIOError:
        return condition()


def recorded():
    return json.loads(ask("status", "--json"))["storage"]["recording"]["sets"]


listener.close()
service = start(notify="silent")
wait(20, "capturing", lambda: heeded(lambda: state() == "capturing"))
name = ask("record", "start").split()[0]
wait(20, "a recording", lambda: heeded(lambda: recorded() > 5))
wait(20, "no room for what systemd is told", is_full)
sets = recorded()
end(service)
if "something hangs; the process ends without it" not in open("log").read():
    fail("the main thread did not hang")
folder = f"store/recordings/{name}"


def verified():
    r = subprocess.run([*sst, "recording", folder, "--verify", "--json"], capture_output=True, text=True, timeout=120)
    return r.returncode == 0 and json.loads(r.stdout)["sets"] >= sets


if not verified():
    fail(f"{folder} lost some of its {sets} sets")
service = start()
told("^READY=1", 20)
wait(20, "mending", lambda: '"finished": true' in open(folder + "/storage.json").read())
if not verified():
    fail(f"{folder} is mended, but lost some of its {sets} sets")
end(service)
sys.exit(failed)
PY
export XDG_CACHE_HOME="${XDG_CACHE_HOME:-$HOME/.cache}"
timeout 600 "$build/sst-sim" --quiet --world "$root/simulators/scene/world/worlds/quick.yaml" -- /usr/bin/python3 run.py "$build" "$tmp" "$root/tests" 2>&1 || fail "exit $?"
exit $failed
