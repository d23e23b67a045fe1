#!/usr/bin/env bash
# Requests to the service on simulated devices: a view of one's own, visits, exports, videos, and what is refused.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
. "$(dirname "$0")/../lib.sh"
need libcurl
. "$root/tests/service_lib.sh"
. "$root/tests/service_array.sh"

sed -i "s,rate_hz: 10,rate_hz: 4," sstd.yaml
begin
until_is 30 live.ready 'v'
[ $failed -eq 0 ] || exit 1
since=$("$sst" record start) || fail "record start: $since"
until_is 10 storage.recording.sets 'v > 5'
"$sst" record stop || fail "record stop"
until_is 20 storage.recording.active 'not v'

# A view of one's own: other focus, the surface under a point, and refusals.
# field NAME: member of the view $id in GET /api/v1/views; shown_percent: all shares together
field() {
  curl -s --unix-socket c.sock http://x/api/v1/views >views
  /usr/bin/python3 -c 'import json, sys
v = [v for v in json.load(open("views"))["views"] if v["id"] == sys.argv[1]][0]
v["shown_percent"] = round(sum(v[k + "_percent"] or 0 for k in ("seen", "remembered", "filled")), 3)
print(v[sys.argv[2]])' "$id" "$1"
}
id=$(ask /api/v1/views '{"focus_px": 5}' | /usr/bin/python3 -c 'import json, sys; print(json.load(sys.stdin)["id"])')
awaits "curl -sf -m 10 --unix-socket c.sock 'http://x/snapshot/$id' >own.jpg" || fail "/snapshot/$id"
picks "$id" || fail "pick: $(cat picked)"
ask "/api/v1/views/$id" '{"focus": 5}' | grep -q 'did you mean .focus_px' || fail "an unknown setting is not refused"
ask "/api/v1/views/$id" '{"remove_label": "Dragon"}' | grep -q 'knows no class' || fail "an unknown label to remove is not refused"
ask "/api/v1/views/$id" '{"method": "magic"}' | grep -q 'method must be' || fail "an unknown method is not refused"

# A view with the settings of the recorded one has its picture, until something is removed from the view.
view=$(ask /api/v1/views '{}' | /usr/bin/python3 -c 'import json, sys; print(json.load(sys.stdin)["id"])')
awaits "curl -sf -m 10 --unix-socket c.sock 'http://x/snapshot/$view' >own.jpg && curl -sf -m 10 --unix-socket c.sock http://x/snapshot/main >main.jpg && cmp -s own.jpg main.jpg" || fail "a view with the settings of main has another picture"

# Clear is the default of views; a thing under a point goes, and comes back.
[ "$(field shown_percent)" = 100.0 ] || fail "the clear picture of a new view: $(cat views)"
removes() { awaits "curl -s -m 10 --unix-socket c.sock -H 'Content-Type: application/json' -d '$1' 'http://x/api/v1/views/$id/remove' >removed; grep -q '$2' removed" || fail "remove $1: $(cat removed)"; }
removes '{"x": 80}' 'give x and y'
removes '{"x": 9999, "y": 1}' 'outside the picture'
removes '{"x": 1, "y": 1, "z": 1}' 'unknown member .z'
removes '{"clear": true}' '"objects": *0'
ask /api/v1/views/nobody/remove '{"x": 1, "y": 1}' | grep -q 'there is no view' || fail "a thing is removed from no view"
ask /api/v1/calibration/check '{"now": true}' | grep -q 'has none' || fail "an unknown member of a check is not refused"
ask "/api/v1/views/$id" '{"focus_label": "Dragon"}' | grep -q 'knows no class' || fail "an unknown label is not refused"
/usr/bin/python3 "$root/tests/openapi.py" "$SST_SOCKET" >out || fail "answers and openapi.json differ: $(cat out)"
until_is 10 storage.recording.active 'not v'

# Visits of another day: a page, days, reviewed and deleted, one and many.
mkdir -p store/visits/2026-11-21
for n in 1 2 3; do
  echo "{\"visit\":\"2026-11-21T18-0$n-00-000Z-$n\",\"active\":false,\"label\":\"\",\"from\":\"2026-11-21T18:0$n:00.000Z\",\"to\":\"2026-11-21T18:0$n:05.000Z\",\"zones\":[]}"
done >store/visits/2026-11-21/visits.jsonl
visit=2026-11-21T18-01-00-000Z-1
visits() { # PATH BODY PATTERN
  ask "/api/v1/visits$1" $2 | grep -q "$3" || fail "visits$1 $2: $(ask "/api/v1/visits$1" $2)"
}
visits "?before=2026-11-22&limit=2" "" '"2026-11-21T18-03.*"more":true}'
visits "?before=2026-11-21T18-02-00-000Z-2" "" "\"visits\":\[{\"visit\":\"$visit\".*\"more\":false}"
visits "" "{\"visits\":[\"$visit\",\"2026-11-21T18-02-00-000Z-2\",\"nobody\"],\"reviewed\":true}" '"changed":2.*there is no visit nobody'
visits "/days?from=2026-11-21&to=2026-11-21" "" '"day":"2026-11-21","visits":3,"reviewed":2'
visits "?reviewed=false&before=2026-11-22" "" '"visits":\[{"visit":"2026-11-21T18-03[^}]*}\]'
visits "" '{"visits":[],"keep":true}' "array of 1 to 1000 names"
visits "/$visit" '{"keep":true,"reviewed":true}' "give keep: true or false, reviewed"
visits "/$visit" '{"reviewed":false}' '"reviewed":false'
visits "/$visit" '{"delete":true}' '"deleted":true'
visits "/$visit" '{"delete":true}' "there is no visit $visit"

# A moment of a recording as a light field.
at=$(ask /api/v1/recordings | /usr/bin/python3 -c 'import json, sys; print(json.load(sys.stdin)["recordings"][0]["from"])')
name=$(ask /api/v1/export "{\"time\": \"$at\"}" | /usr/bin/python3 -c 'import json, sys; print(json.load(sys.stdin).get("name", ""))')
[ -n "$name" ] || fail "export of $at: $(ask /api/v1/export "{\"time\": \"$at\"}")"
curl -s --retry 5 --unix-socket c.sock "http://x/api/v1/download/$name.tar" -o moment.tar; tar -tf moment.tar >out 2>&1 && grep -q lightfield.json out || fail "download: $(head -3 out; head -c 300 moment.tar)"

# A recording as a video, see-through and of a camera, in two parts; then it is deleted.
taken=$("$sst" record start) || fail "record start: $taken"
end=$((SECONDS + 120))
while [ $SECONDS -lt $end ]; do
  ask /api/v1/recordings | /usr/bin/python3 -c "import json, sys
sys.exit(not any(r['name'] == '$taken' and r['view'] for r in json.load(sys.stdin)['recordings']))" && break
  sleep 0.1
done
"$sst" record stop || fail "record stop"
until_is 20 storage.recording.active 'not v'
for video in "$taken.mkv" "$taken.r0c5.mkv"; do
  url=http://x/api/v1/download/$video
  curl -sf --unix-socket c.sock -o whole.mkv "$url" || fail "$video: $(curl -s --unix-socket c.sock "$url" | head -c 300); $(ask /api/v1/recordings)"
  curl -sf --unix-socket c.sock -r 0-999 -o part.mkv "$url" && curl -sf --unix-socket c.sock -C - -o part.mkv "$url" || fail "$video in parts"
  cmp whole.mkv part.mkv || fail "$video: its parts are another file"
  [ "$(head -c 4 whole.mkv | od -An -tx1 | tr -d ' ')" = 1a45dfa3 ] || fail "$video is no Matroska"
done
# Work that takes the disk long is answered before it is done.
"$sst" record delete "$taken" >/dev/null && awaits "[ ! -e 'store/recordings/$taken' ]" || fail "delete $taken"
# Alone in its line's first column: a snapshot of the same second has the same time in its name.
awaits "! '$sst' record list | grep -q '^$taken '" || fail "$taken is still listed: $("$sst" record list)"

kill -TERM "$daemon"
gone "$daemon" 2000
exit $failed
