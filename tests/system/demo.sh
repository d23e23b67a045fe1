#!/usr/bin/env bash
# sst demo: a service on one simulated array, calibrated; the user's edits in its folder stay.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
. "$(dirname "$0")/../lib.sh"
need libcurl
build=$root/${SST_BUILD:-build}
export XDG_CACHE_HOME=$tmp/cache
demo=
trap 'kill $demo 2>/dev/null && ended $demo "the demo"; rm -rf "$tmp"' EXIT
port=$(/usr/bin/python3 -c 'import socket; s = socket.create_server(("127.0.0.1", 0)); print(s.getsockname()[1])')

# begin ARGS: until the demo shows a picture; its output is in ./out
begin() {
  : >out
  "$sst" demo -o site --scene cat "$@" >out 2>err &
  demo=$!
  for _ in $(seq 1200); do
    grep -q "Ctrl-C" out && return
    kill -0 $demo 2>/dev/null || break
    sleep 0.1
  done
  fail "no demo: $(cat out err)"
  cat site/*.log
  exit 1
}
end() { kill -INT $demo; ended $demo "the demo" || fail "the demo ends with $?"; demo=; }

# Pictures of an earlier run are replaced.
mkdir -p once/why
echo '{}' >once/why/explain.json
"$sst" demo --once --scene cell --size 96x72 --preset preview -o once >out 2>err || fail "a second run: $(cat err)"
[ -s once/side-by-side.png ] && grep -q disparity_px once/why/explain.json || fail "the pictures of the second run: $(cat out)"

echo precious >once/why/mine
want 4 "once/why is replaced, and mine in it is not of the demo" demo --once --scene cell --size 96x72 --preset preview -o once
[ -s once/why/mine ] && [ -s once/why/explain.json ] || fail "a file of the user's, or what was there, is gone"

# A session ends with its program, also while its world is prepared.
printf 'scene: hedge\ngrid: [1, 2]\nsize: [160, 192]\n' >new.yaml
timeout 120 "$build/sst-sim" --at-once --quiet --cache new --world new.yaml -- true 2>err || fail "a world that is prepared keeps its session: $(cat err)"

# An edited world stays, as small ones do here for speed.
mkdir site
cp "$root/simulators/scene/world/worlds/quick.yaml" site/cat-world.yaml
cp site/cat-world.yaml world
begin --port "$port"
cmp -s world site/cat-world.yaml || fail "the world was overwritten"
grep -q "cat-world.yaml: kept" out || fail "the kept world is not named: $(cat out)"
grep -q "http://127.0.0.1:$port/?token=[0-9a-f]*$" out || fail "no address: $(cat out)"
grep -q "$tmp/cache/sst-sim, [0-9]* MB" out || fail "the cache is not named: $(cat out)"
grep -q "sst demo --scene .*pedestrian" out || fail "no other scenes are named: $(cat out)"
grep -q "does not settle" out && fail "the picture has not settled: $(cat out)"
[ "$(grep -c '  page' out)" -eq 1 ] || fail "more than one scene: $(cat out)"
"$sst" status --socket site/cat.sock --json | /usr/bin/python3 -c '
import json, sys
live = json.load(sys.stdin)["live"]
sys.exit(not (live["focal_px"] > 0 and live["spacing_mm"] > 0))' || fail "the array is not calibrated: no metres"
end

sed -i 's/rate_hz: 10/rate_hz: 5/' site/cat.yaml
cp site/cat.yaml mine
begin
cmp -s mine site/cat.yaml || fail "the edited configuration was overwritten"
grep -q "cat.yaml: kept" out || fail "the kept configuration is not named: $(cat out)"
grep -q ":$port/" out || fail "another port than in the configuration: $(cat out)"
end
want 2 "has web.port $port" demo -o site --scene cat --port $((port == 9000 ? 9001 : 9000))
exit $failed
