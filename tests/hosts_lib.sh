# Sourced after tests/lib.sh by tests of several hosts: simulated nodes and a head on this machine. Names are of nodes, or head.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
build=$root/${SST_BUILD:-build}
port=${port:-$((22000 + $$ % 1000))} # below those that the system gives; of several tests at once
rows=${rows:-2} cols=${cols:-2} size=${size:-[320, 240]} width=${width:-320} height=${height:-240} rate=${rate:-10}
scene=${scene:-cat} nodes=${nodes:-left right}
head_address=${head_address:-127.0.0.1}
queue=${queue:-4}
live=${live:-false} # of the head
declare -A at            # NAME: command before a program of this host
declare -A address_of    # NODE: of the head, as it sees it; else $head_address
declare -A pid           # NAME: its sstd
declare -A clock         # NAME: "OFFSET_MS DRIFT_PPM" of its wall clock

# certificates: those of the page, as it says
certificates() {
  mkdir -p pki
  (cd pki && sed -n '/<!-- tests\/system\/nodes.sh/,/^```$/p' "$root/docs/use/hosts.md" | sed '1,2d;$d' |
    sed "s/for host in .*; do/for host in head $nodes other; do/" | sh -e) >/dev/null 2>&1 || fail "certificates"
}

# bind FROM TO: lines of cameras: bind for the columns FROM .. TO-1
bind() {
  local r c
  for ((r = 0; r < rows; r++)); do
    for ((c = $1; c < $2; c++)); do
      printf '    - {row: %d, col: %d, serial: SIM%04d}\n' "$r" "$c" $((r * cols + c))
    done
  done
}

# configure: files of all hosts, each node with its share of the columns
configure() {
  local n i=0 count
  count=$(echo $nodes | wc -w)
  for n in $nodes; do
    read -r offset drift <<<"${clock[$n]-0 0}"
    mkdir -p "$n"
    cat >"$n/world.yaml" <<YAML
scene: $scene
grid: [$rows, $cols]
size: $size
jpeg_quality: ${quality:-75}
host: {generator_hz: $rate, clock_offset_ms: $offset, clock_drift_ppm: $drift}
YAML
    cat >"$n/sstd.yaml" <<YAML
role: node
array: {rows: $rows, cols: $cols}
cameras:
  width: $width
  height: $height
  check_frozen: false
  controls: {trigger_mode: 1, auto_exposure: 1, exposure_time_absolute: 50}
  bind:
$(bind $((i * cols / count)) $(((i + 1) * cols / count)))
trigger: {source: external, chip: sst-trigger, loopback: LOOP0, rate_hz: $rate}
hosts: {head: ${address_of[$n]-$head_address}, port: $port, queue: $queue, datagrams: ${datagrams:-true}, parity: ${parity:-10}, ca: $tmp/pki/ca.pem, certificate: $tmp/pki/$n.pem, key: $tmp/pki/$n.key}
live: {enabled: false}
$(common "$n")
YAML
    i=$((i + 1))
  done
  mkdir -p head
  cat >head/sstd.yaml <<YAML
role: head
array: {rows: $rows, cols: $cols}
cameras: {width: $width, height: $height, check_frozen: false}
trigger: {rate_hz: $rate}
hosts:
  address: $head_address
  port: $port
  nodes: [$(echo $nodes | sed 's/ /, /g')]
  ca: $tmp/pki/ca.pem
  certificate: $tmp/pki/head.pem
  key: $tmp/pki/head.key
live: {enabled: $live}
$(common head)
YAML
}

common() {
  cat <<YAML
control: {socket: $tmp/$1.sock, group: ""}
web: {enabled: false, token_file: $tmp/$1/token, zones_file: ""}
storage: {dir: $tmp/$1/store, ring_mb: ${ring:-64}, min_free_gb: 0, preroll_s: 0, visits_days: 0, record_view: false}
YAML
}

# session NAME: the devices of a node
session() {
  ${at[$1]-} "$build/sst-sim" --quiet --world "$1/world.yaml" --cache "${cache:-$tmp/cache}" --serve "$tmp/$1.session" >"$1.sim.log" 2>&1 &
  sessions+=" $!"
  for _ in $(seq 1200); do [ -S "$tmp/$1.session/control.sock" ] && return; sleep 0.05; done
  fail "session of $1: $(cat "$1.sim.log")"
}

# start NAME: its sstd; the process in ${pid[NAME]}. A head has devices where $tmp/head.session is
start() {
  local join=
  [ ! -e "$1.session" ] || join="$build/sst-sim --quiet --join $tmp/$1.session --"
  rm -f "$1.pid"
  mkdir -p "$1/store"
  ${at[$1]-} $join sh -c 'echo $$ >"$0.pid"; exec "$@"' "$1" "$build/sstd" -v --config "$1/sstd.yaml" >>"$1.log" 2>&1 &
  for _ in $(seq 1200); do [ -s "$1.pid" ] && break; sleep 0.02; done
  pid[$1]=$(cat "$1.pid")
}

status_of() { SST_SOCKET=$tmp/$1.sock timeout 60 "$sst" status --json 2>/dev/null; }
# value_of NAME PYTHON: an expression of its status, s; node("left") is what a head says of it
value_of() {
  status_of "$1" | /usr/bin/python3 -c "
import json, sys
s = json.load(sys.stdin)
def node(name): return next(n for n in s['hosts']['nodes'] if n['name'] == name)
def ended(f): return sum(f[k] for k in ('set', 'late', 'duplicate', 'stray', 'corrupt', 'flagged', 'dropped'))
print(json.dumps($2))" 2>/dev/null
}
# await NAME PYTHON: until it is true; fails after a minute. How long it took in $took, ms. $look: seconds between two looks, which
# take processors
await() {
  local start=$(date +%s%N) v
  while v=$(value_of "$1" "$2"); [ "$v" != true ]; do
    took=$((($(date +%s%N) - start) / 1000000))
    [ $took -lt 60000 ] || { fail "$1: not $2: $(value_of "$1" '[s["state"], s["reason"], s.get("hosts")]') $(tail -n 3 "$1.log")"; return 1; }
    sleep "${look:-0.05}"
  done
  took=$((($(date +%s%N) - start) / 1000000))
}

# end_hosts: all that was started
end_hosts() {
  local n
  for n in "${!pid[@]}"; do kill "${pid[$n]}" 2>/dev/null; done
  for n in $sessions; do kill "$n" 2>/dev/null; done
  wait
}
sessions=
