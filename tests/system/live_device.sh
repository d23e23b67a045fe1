#!/usr/bin/env bash
# live: device in the service: pictures on Mesa's software device, a device that is lost again and again, one that is not
# there: the live picture goes on, and the status, metrics, events and journal say so. Without lavapipe it fails.
. "$(dirname "$0")/../lib.sh"
"$sst" version | grep -q 'libcurl *yes' || { echo "built without libcurl: sst cannot ask the service"; exit 77; }
"$sst" version --json | grep -q '"vulkan": true' || { echo "built without Vulkan"; exit 77; }
driver=$(compgen -G '/usr/share/vulkan/icd.d/lvp_icd*.json' | head -n 1)
[ -n "$driver" ] || { fail "no lavapipe: install mesa-vulkan-drivers"; exit 1; }
export VK_DRIVER_FILES=$driver VK_ICD_FILENAMES=$driver XDG_CACHE_HOME=$tmp/cache
. "$root/tests/service_lib.sh"
log=sstd.log
sim=
viewer=
trap 'kill $viewer $sim 2>/dev/null; wait $sim; rm -rf "$tmp"' EXIT

# begin DEVICE METHOD: the service on its array, with a viewer
begin() {
  cat >sstd.yaml <<YAML
array: {rows: 6, cols: 6}
cameras:
  width: 160
  height: 128
  check_frozen: false
  controls: {trigger_mode: 1, auto_exposure: 1, exposure_time_absolute: 50}
trigger: {source: gpio, chip: sst-trigger, lines: [TRIG0, TRIG1, TRIG2, TRIG3, TRIG4, TRIG5], loopback: LOOP0, rate_hz: 10}
control: {socket: $tmp/c.sock, group: ""}
web: {port: 0, token_file: $tmp/token}
storage: {dir: $tmp/store, ring_mb: 16, min_free_gb: 0}
live: {device: "$1", method: $2, skip_change: false}
YAML
  rm -f pid
  "$build/sst-sim" --quiet --world "$root/simulators/scene/world/worlds/quick.yaml" -- sh -c 'echo $$ >pid; exec "$0" "$@"' "$build/sstd" -v --config sstd.yaml >sstd.log 2>&1 &
  sim=$!
  written pid
  daemon=$(cat pid)
  until_is 60 live.ready 'v'
  timeout 300 curl -s -m 300 --unix-socket c.sock http://x/stream >/dev/null & viewer=$!
}
end() {
  kill $viewer
  kill $daemon
  wait $sim
  sim= viewer=
}

# --- a software device, named: every method there ---
begin lavapipe clear
until_is 60 live.device.pictures 'v > 5'
[ "$(value live.device.failures)" = 0 ] && [ "$(value live.device.on_cpu)" = 0 ] || fail "lavapipe fails: $("$sst" status --json)"
"$sst" status | grep -q 'device .*llvmpipe' || fail "sst status: $("$sst" status)"
curl -sf -m 10 --unix-socket c.sock http://x/metrics >metrics
grep -q '^sst_live_device_up 1$' metrics || fail "metrics: $(grep device metrics)"
end

# --- lost at every twentieth picture or so: no set lost, an event each time ---
begin dummy:lost=40 sst
until_is 120 live.device.failures 'v >= 3'
until_is 60 live.device.failing 'not v'
/usr/bin/python3 - "$("$sst" status --json)" <<'END' || fail "pictures on a device that is lost: $("$sst" status)"
import json, sys
live = json.loads(sys.argv[1])["live"]
d = live["device"]
print("pictures", live["pictures"], d)
sys.exit(not (d["pictures"] > 3 and d["on_cpu"] >= 3 and "lost" in d["reason"] and live["rate_hz"] > 0))
END
curl -sf -m 10 --unix-socket c.sock 'http://x/api/v1/events?limit=200' >events
[ "$(grep -c '"device-lost"' events)" -ge 3 ] && [ "$(grep -c '"device-found"' events)" -ge 2 ] || fail "events: $(cat events)"
grep -q 'live pictures are rendered on the CPU' sstd.log || fail "nothing in the journal"
end

# --- not there ---
begin "no such device" sst
until_is 60 live.device.on_cpu 'v > 3'
[ "$(value live.device.failing)" = true ] || fail "a device that is not there: $("$sst" status --json)"
end
exit $failed
