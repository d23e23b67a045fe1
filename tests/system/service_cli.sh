#!/usr/bin/env bash
# sst as a client of the service: its output, exit codes, and a service that is away, hangs or answers nonsense.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
. "$(dirname "$0")/../lib.sh"
need libcurl
export SST_SOCKET=$tmp/s
# One sentence at once, whether the service never ran or was stopped.
/usr/bin/python3 -c 'import socket; s = socket.socket(socket.AF_UNIX); s.bind("stale")'
since=$(date +%s%3N)
for socket in nobody stale; do want 5 "no service runs at .*$socket: see .systemctl status sstd" status --socket "$tmp/$socket"; done
quick $(($(date +%s%3N) - since)) 2000 || fail "status of a service that is stopped takes $(($(date +%s%3N) - since)) ms"
[ -z "${SST_TIMING-}" ] || exit $failed # the rest measures nothing

/usr/bin/python3 "$root/tests/fake_service.py" s port 2>fake.err &
fake=$!
trap 'kill $fake; wait $fake; rm -rf "$tmp"' EXIT
for _ in $(seq 1200); do [ -S s ] && [ -s port ] && break; sleep 0.05; done
[ -S s ] || { cat fake.err; exit 1; }

# see ARGS...: succeeds without a word on standard error; the output is in ./out
see() { "$sst" "$@" >out 2>err </dev/null && [ ! -s err ] || fail "sst $*: exit $?: $(head -c 300 err)"; }
# shows WORDS: in ./out
shows() { grep -qF -- "$1" out || fail "no '$1' in: $(head -c 1500 out)"; }
# told PYTHON: about the last request, r
told() { /usr/bin/python3 -c "import json; r = json.loads(open('s.log').readlines()[-1]); assert $1, r" || fail "told: $1"; }

see status
for words in 'degraded: 35 of 36 cameras' 'r0c5 absent (unplugged)' '10.0 Hz' 'p99 180' 'exceeded by 2 sets' 'farthest off: r3c2' \
    '7 corrupt' 'p99 300 ms' '6.1 sets/s' 'LOW' '410 GB free' 'motion in door' '520 MB'; do shows "$words"; done
[ "$(wc -l <out)" -le 20 ] && [ "$(wc -L <out)" -le 160 ] || fail "status is more than a screen"
see status --json
/usr/bin/python3 -c 'import json; assert json.load(open("out"))["capture"]["present"] == 35' || fail "status --json"
echo failed >s.mode
"$sst" status >out 2>err; [ $? -eq 3 ] || fail "status of a failed service: exit $?"
shows 'failed: no camera'
rm s.mode
: >out # the output of an earlier command must not count
"$sst" status --watch --json >out 2>err & watch=$!
for _ in $(seq 600); do [ "$(wc -l <out)" -ge 2 ] && break; sleep 0.1; done
kill $watch && [ "$(wc -l <out)" -ge 2 ] || fail "--watch: $(wc -l <out) lines, $(cat err)"
wait $watch # it writes no more to what others write to

see cameras
shows '35 of 36 cameras stream'
[ "$(grep -c '^r[0-5] .*10\.0' out)" -eq 6 ] || fail "grid: $(cat out)"
grep -q '^r0c5 .*absent.*SIM0005.*unplugged' out || fail "missing camera: $(cat out)"
see cameras --all
[ "$(grep -c '^r[0-5]c[0-5] ' out)" -eq 36 ] || fail "cameras --all"
see cameras --json
/usr/bin/python3 -c 'import json; assert len(json.load(open("out"))["cameras"]) == 36' || fail "cameras --json"

# All pages of stored events, and new ones.
see events
[ "$(wc -l <out)" -eq 30 ] || fail "events: $(wc -l <out) of 30"
see events --after 25 --type camera-lost --json
[ "$(wc -l <out)" -eq 1 ] && shows '"id": 30' || fail "events --after: $(cat out)"
"$sst" events --follow >out 2>err; [ $? -eq 5 ] || fail "events --follow after the end: exit $?"
[ "$(wc -l <out)" -eq 12 ] && shows 'live 32' || fail "events --follow: $(cat out)"

see reload --dry-run
told "r['body'] == {'dry_run': True}"
shows '10 -> 20'
shows 'capturing restarts'
see reload
told "r['body'] == {'dry_run': False}"
echo refuse >s.mode
want 3 'sstd.yaml:7:12' reload
rm s.mode

see record start --duration 60
told "r['body'] == {'action': 'start', 'seconds': 60}"
shows 2026-11-21T18-05-00Z
see record stop
told "r['body'] == {'action': 'stop'}"
see record list
shows 'motion in door'
shows 'snapshot-2026-11-21T18-04-30Z'
see record download 2026-11-21T18-04-00Z -o all.tar
grep -q 'download/2026-11-21T18-04-00Z.tar' all.tar || fail "download: $(cat all.tar)"
see record download 2026-11-21T18-04-00Z --camera r0c5 -o cam.mkv
grep -q 'download/2026-11-21T18-04-00Z.r0c5.mkv' cam.mkv || fail "download of a camera: $(cat cam.mkv)"
see record download 2026-11-21T18-04-00Z -o view.mkv
grep -q 'download/2026-11-21T18-04-00Z.mkv' view.mkv || fail "download of the view: $(cat view.mkv)"
see record delete snapshot-2026-11-21T18-04-30Z
told "r['body'] == {'name': 'snapshot-2026-11-21T18-04-30Z'}"
want 2 'delete needs a NAME' record delete
want 2 'delete needs a NAME' record delete ../token
want 2 'missing -o' record download 2026-11-21T18-04-00Z
want 2 'x.avi ends neither in .mkv' record download 2026-11-21T18-04-00Z -o x.avi
want 2 '.-time and --ago both' record export --time 2026-11-21T18:04:00Z --ago 5
want 2 'needs -o FILE.mkv' record download 2026-11-21T18-04-00Z --camera r0c5 -o bad.tar
want 2 'takes no name' record start now
see record export --time 2026-11-21T18:05:00Z --recording R -o then.tar
grep -q 'download/2026-11-21T18-05-00Z.tar' then.tar || fail "export: $(cat then.tar)"
see record export --ago 5
told "r['body']['time'] == '2026-11-21T18:04:55.123Z'" # by the service's clock, not by this machine's
want 2 'missing the moment' record export
want 2 'belongs to start' record stop --duration 3
want 2 'unknown action pause' record pause

# Videos for others: made by the service, waited for, saved with their manifest.
posted() { /usr/bin/python3 -c "import json; r = [json.loads(l) for l in open('s.log')]; r = [x for x in r if x.get('body')][-1]; assert $1, r" || fail "posted: $1"; }
see record video 2026-11-21T18-05-00-123Z-7 -o clip.mp4
posted "r['body'] == {'visits': ['2026-11-21T18-05-00-123Z-7']}"
grep -q 'Z.mp4' clip.mp4 && grep -q 'Z.json' clip.json || fail "video: $(cat clip.mp4 clip.json)"
see record video --time 2026-11-21T18:05:00.5Z --duration 30 --recording R -o case.zip
posted "r['body'] == {'from': '2026-11-21T18:05:00.500Z', 'to': '2026-11-21T18:05:30.500Z', 'recording': 'R'}"
see record video --ago 60 --duration 5 -o ago.mp4
posted "r['body'] == {'from': '2026-11-21T18:04:00.123Z', 'to': '2026-11-21T18:04:05.123Z'}"
see record key -o key.pem
grep -q 'PUBLIC KEY' key.pem || fail "key: $(cat key.pem)"
echo failed >s.mode
want 3 'no recording has this moment' record video --ago 60 --duration 5 -o none.mp4
rm s.mode
[ -e none.mp4 ] && fail "a video that was not made"
want 2 'missing -o FILE.mp4' record video --ago 60 --duration 5 -o x.mkv
want 2 'missing what to show' record video --ago 60 -o x.mp4
want 2 'missing what to show' record video NAME --ago 60 --duration 5 -o x.mp4
want 2 'is not a time' record video --time yesterday --duration 5 -o x.mp4
want 2 'missing -o FILE.pem' record key
want 3 'does not exist' verify none.mp4
cp clip.mp4 alone.mp4
want 3 'alone.json is missing' verify alone.mp4
"$sst" verify clip.mp4 >out; [ $? -eq 3 ] && grep -q '^clip.mp4: NOT AS SIGNED: its manifest is none of this program' out || fail "verify: $(cat out)"

see snapshot -o now.jpg
[ "$(head -c 2 now.jpg | od -An -tx1 | tr -d ' ')" = ffd8 ] || fail "snapshot"
see snapshot --of r0c5 -o cam.jpg
told "r['path'] == '/snapshot/camera/r0c5'"
see snapshot --keep -o kept.tar
shows 2026-11-21T18-05-00.123Z
want 2 'an output is missing' snapshot
want 2 'is not a view' snapshot --of ../../etc -o bad.jpg
want 4 'no-such' snapshot -o no-such/bad.jpg

# What is not the service, or not well. Files appear whole or not at all, and nobody writes to the terminal but us.
echo garbage >s.mode
want 1 'not JSON' status
want 1 'not image/jpeg' snapshot -o bad.jpg
echo huge >s.mode
want 1 'more than 16 MiB' status
echo cut >s.mode
want 1 'cannot be asked' status
want 1 'cannot be asked' snapshot -o bad.jpg
echo torn >s.mode
"$sst" snapshot --keep -o bad.tar >out 2>err
judge 1 'ended while it sent' $? 'a torn archive'
echo evil >s.mode
want 1 'two?lines and ?' status
rm s.mode
want 5 'no service runs at .*nobody' status --socket "$tmp/nobody"
# A service that hangs: asked for 5 s, not for a client's whole patience.
python3 -c 'import socket, sys, time; s = socket.socket(socket.AF_UNIX); s.bind(sys.argv[1]); s.listen(5); time.sleep(60)' "$tmp/hung" &
hung=$!
for _ in $(seq 100); do [ -S "$tmp/hung" ] && break; sleep 0.1; done
since=$SECONDS
want 1 'does not answer' status --socket "$tmp/hung"
[ $((SECONDS - since)) -lt 12 ] || fail "a service that hangs: status took $((SECONDS - since)) s"
kill $hung
want 2 'at most 107' status --socket "/$(printf 'x%.0s' {1..200})"
want 5 'systemctl status sstd' events --socket "$tmp/stale"
want 5 'no service runs' cameras --socket "$tmp/stale"
want 5 'no service runs' reload --socket "$tmp/stale"

# Without a service the machine's own cameras are listed.
SST_SOCKET=$tmp/stale "$sst" cameras >out 2>err || fail "cameras without a service: $(cat err)"
grep -q stream out && fail "a grid without a service"

# Named tokens: through the service, or in its file where none runs.
see token add guard --rights view,recordings --expires 12h
told "r['body'] == {'name': 'guard', 'rights': ['view', 'recordings'], 'expires_s': 43200}"
shows abcdef
see token list
shows 'guard                view,recordings'
see token revoke guard
told "r['path'] == '/api/v1/tokens/guard' and r['body'] == {'revoke': True}"
see audit --last 5
told "r['path'] == '/api/v1/audit?limit=5'"
grep -q '^2026-11-21T18:00:00.000Z  guard .* 192.0.2.7 .* delete .* old' out || fail "audit: $(cat out)"
want 2 'needs --rights' token add guard
want 2 'view, snapshot, recordings, control' token add guard --rights all
want 2 'like 30d' token add guard --rights view --expires soon
want 2 'needs a NAME' token revoke
want 2 'belongs to add' token list --rights view
want 2 'a name has letters' token revoke ../x
printf 'control: {socket: %s/none, group: ""}\nweb: {token_file: %s/secret}\n' "$tmp" "$tmp" >tokens.yaml
see token add guard --rights snapshot --config tokens.yaml
hash=$(tr -d '\n' <out | sha256sum | cut -c1-64)
grep -q "\"$hash\"" secret.named || fail "hash of the token: $(cat secret.named)"
grep -q "$(cat out)" secret.named && fail "the file has the token itself"
[ "$(stat -c %a secret.named)" = 600 ] || fail "mode of the tokens: $(stat -c %a secret.named)"
want 4 'there is a token guard already' token add guard --rights view --config tokens.yaml
see token list --config tokens.yaml
shows 'guard                snapshot                             never'
chmod 644 secret.named
"$sst" token list --config tokens.yaml >out 2>err && fail "tokens that others can read are listed"
grep -q 'chmod 600' err || fail "mode: $(cat err)"
chmod 600 secret.named
see token revoke guard --config tokens.yaml
see token list --config tokens.yaml
[ ! -s out ] || fail "a revoked token is listed: $(cat out)"
[ "$(wc -l <secret.audit)" -eq 2 ] && grep -q '"object":"revoke guard"' secret.audit || fail "audit: $(cat secret.audit)"
want 5 'no service runs' token list --socket "$tmp/stale"

# TCP, with its token; a proxy of the environment is not asked.
url=http://127.0.0.1:$(cat port)
export http_proxy=http://127.0.0.1:9
echo fake-token >token
see status --url "$url/" --token-file token
want 3 'token' status --url "$url"
echo other-token >token
want 3 'does not accept the token in token: it was revoked, has expired' status --url "$url" --token-file token
printf 'two\nlines\n' >token
want 3 'one line' status --url "$url" --token-file token
want 3 'missing' status --url "$url" --token-file missing
want 2 'http' status --url ftp://x
want 5 'no service runs' status --url http://127.0.0.1:1
# A token that goes to another machine in the clear is warned of, and only then.
echo fake-token >token
"$sst" status --url "$url" --token-file token >out 2>err && ! grep -q unencrypted err || fail "loopback: $(cat err)"
for other in http://sst.invalid http://127.0.0.1.sst.invalid:1/ http://localhost@sst.invalid http://[::1]@sst.invalid; do
  "$sst" status --url "$other" --token-file token >out 2>err && fail "$other: there is a service"
  grep -q 'token goes to another machine unencrypted' err || fail "$other: $(cat err)"
done
"$sst" status --url https://sst.invalid --token-file token >out 2>err && fail "https: there is a service"
grep -q unencrypted err && fail "https: $(cat err)"
exit $failed
