#!/usr/bin/env bash
# A certificate that is renewed while the service runs: by sst reload, by SIGHUP; a stream that is open stays.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
. "$(dirname "$0")/../lib.sh"
need libcurl
command -v openssl >/dev/null || skip "no openssl to make certificates with"
command -v ss >/dev/null || skip "no ss to tell the port"
build=$root/${SST_BUILD:-build}
export SST_SOCKET=$tmp/c.sock
curl() { command curl -m 60 "$@"; }

# pair NAME DAYS
pair() {
  openssl req -x509 -newkey ec -pkeyopt ec_paramgen_curve:P-256 -nodes -days "$2" -subj "/O=$1/CN=localhost" -addext subjectAltName=DNS:localhost \
    -keyout "$1.key" -out "$1.pem" 2>/dev/null
}
# place NAME: it becomes the pair of the service
place() { cp "$1.key" k && cp "$1.pem" c && mv k tls.key && mv c tls.pem; }
# given: owner of the certificate that a new connection gets
given() { timeout 60 openssl s_client -connect "127.0.0.1:$port" </dev/null 2>/dev/null | openssl x509 -noout -subject; }
# until_given NAME SECONDS
until_given() {
  for _ in $(seq $(($2 * 10))); do given | grep -q "O = $1" && return; sleep 0.1; done
  fail "no certificate of $1: $(given); $(cat sstd.log)"
}

pair First 90; pair Second 180; pair Third 270
place First
cat >sstd.yaml <<YAML
control: {socket: $tmp/c.sock, group: ""}
web: {port: 0, token_file: $tmp/token, tls_certificate: $tmp/tls.pem, tls_key: $tmp/tls.key}
storage: {dir: $tmp/store, ring_mb: 4, preroll_s: 0, min_free_gb: 0}
live: {enabled: false}
YAML
"$build/sstd" --config sstd.yaml >sstd.log 2>&1 &
daemon=$! stream=
trap 'kill -9 $daemon $stream 2>/dev/null; wait 2>/dev/null; rm -rf "$tmp"' EXIT
for _ in $(seq 600); do curl -sf --unix-socket c.sock http://x/api/v1/status >/dev/null && break; sleep 0.1; done # no cameras: failed
for _ in $(seq 600); do # it listens there after it listens on the socket
  port=$(ss -ltnpH 2>/dev/null | grep "pid=$daemon," | grep -o '127.0.0.1:[0-9]*' | head -n 1 | cut -d: -f2)
  [ -n "$port" ] && break
  sleep 0.1
done
[ -n "$port" ] || { echo "FAIL: no port: $(cat sstd.log)"; exit 1; }
until_given First 5
"$sst" status | grep -q 'TLS *certificate until .*, \(89\|90\) days' || fail "status: $("$sst" status)"
curl -s --unix-socket c.sock http://x/metrics | grep -Eq '^sst_certificate_days (89|90)' || fail "metrics"
command curl -skN -m 600 -H "Authorization: Bearer $(cat token)" -H 'Accept: application/x-ndjson' \
  "https://127.0.0.1:$port/api/v1/events/stream?after=0" >stream &
stream=$!

# The client of Python: the service's own certificate by cafile alone, and for the host that is in it.
PYTHONDONTWRITEBYTECODE=1 PYTHONPATH=$root/python /usr/bin/python3 - "$port" <<'PY' >out 2>&1 || fail "Python over TLS: $(tail -n 3 out)"
import sys
try:
    import numpy  # of the package
except ImportError:
    sys.exit(0)
import sst
port = sys.argv[1]


def refused(words, host="localhost", **how):
    try:
        sst.Client(f"https://{host}:{port}", token_file="token", **how).status()
    except sst.ServiceError as e:
        assert words in str(e) and e.status is None, e
    else:
        raise AssertionError(words)


client = sst.Client(f"https://localhost:{port}", token_file="token", cafile="First.pem")
assert client.status()["certificate"]["days"] > 88 and client.events()
refused("not trusted (self-signed certificate); name the file of its authority by cafile")
refused("not trusted", cafile="Second.pem")
refused("for another host", host="127.0.0.1", cafile="First.pem")
assert sst.Client(f"https://127.0.0.1:{port}", token_file="token", verify=False).status()
try:
    sst.Client(f"http://localhost:{port}", token_file="token").status()
    raise AssertionError("plain text to a port of TLS")
except sst.ServiceError as e:
    assert "does not answer" in str(e), e
PY

# Old protocols and ones without forward secrecy are refused; HSTS.
handshake() { timeout 60 openssl s_client -connect "127.0.0.1:$port" "$@" </dev/null 2>/dev/null | grep -q 'Cipher is [A-Z]'; }
for how in -tls1_2 -tls1_3 '-tls1_2 -cipher ECDHE-ECDSA-AES128-GCM-SHA256'; do handshake $how || fail "TLS: no connection with $how"; done
for how in '-tls1 -cipher ALL:@SECLEVEL=0' '-tls1_1 -cipher ALL:@SECLEVEL=0' '-tls1_2 -cipher ECDHE-ECDSA-AES256-SHA384' \
  '-tls1_2 -cipher ECDHE-ECDSA-AES128-SHA' '-tls1_2 -cipher AES128-GCM-SHA256:AES256-SHA'; do handshake $how && fail "TLS: a connection with $how"; done
curl -ski "https://127.0.0.1:$port/login" | grep -qi '^strict-transport-security: max-age=31536000' || fail "no HSTS over TLS"
curl -si --unix-socket c.sock http://x/healthz | grep -qi strict-transport && fail "HSTS on the socket"

place Second
"$sst" reload --dry-run >out || fail "reload --dry-run"
grep -q 'certificate until .* -> .*applies at once' out || fail "dry run: $(cat out)"
until_given First 1
"$sst" reload >/dev/null || fail "reload"
until_given Second 1
"$sst" reload | grep -q 'nothing changed' || fail "the same once more"

# Not the key of it: refused as a whole, and told once.
cp First.key tls.key
"$sst" reload >out 2>err; judge 3 'is not the key of the certificate' $? 'a pair that does not fit'
until_given Second 1

place Third
kill -HUP "$daemon"
until_given Third 10
kill -0 "$stream" || fail "the open stream ended"
for _ in $(seq 600); do [ "$(grep -c '"state":"renewed"' stream)" -eq 2 ] && break; sleep 0.1; done
[ "$(grep -c '"state":"renewed"' stream)" -eq 2 ] || fail "events: $(cat stream)"
kill -TERM "$daemon"
ended "$daemon" "the service" || fail "the service ended with $?"
exit $failed
