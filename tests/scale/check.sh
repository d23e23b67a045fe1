#!/usr/bin/env bash
# A hundred simulated cameras of 640x480 on four nodes and a head, each host in a network namespace of its own: nodes record, the head
# assembles sets, and every frame is in one place. The product's cost of a camera is measured apart from the simulation.
# MINUTES=10, RATE=30 (sets/s), ROWS=5, COLS=20, NODES=4, SCENE=cat, QUALITY=50 (of the cameras' JPEGs), LIVE=false (of the head),
# SKIP=false (hosts: skip_unchanged), QUOTA=4 (GB of each node's recordings), DISK=/tmp (where they lie), OUT=FILE (table for docs/measured/scale.md).
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
set -u
disk=$(mktemp -d -p "${DISK:-${TMPDIR:-/tmp}}") # recordings; a hundred simulated devices have thousands of small files, which belong into memory
export TMPDIR=/dev/shm
. "$(dirname "$0")/../lib.sh"
[ "$(id -u)" -eq 0 ] || { echo "network namespaces need root"; exit 77; }
ip netns list >/dev/null 2>&1 || { echo "no ip netns (package iproute2)"; exit 77; }
minutes=${MINUTES:-10} rate=${RATE:-30} rows=${ROWS:-5} cols=${COLS:-20} count=${NODES:-4} scene=${SCENE:-cat} quality=${QUALITY:-50}
size="[640, 480]" width=640 height=480 head_address=0.0.0.0 live=${LIVE:-false} ring=${RING:-256}
cache=${XDG_CACHE_HOME:-$HOME/.cache}/sst-sim # preparing the world once takes minutes
nodes=$(seq -f 'n%g' "$count") nodes=${nodes//$'\n'/ }
. "$root/tests/hosts_lib.sh"
cameras=$((rows * cols)) share=$((cols / count * rows))
[ $((cols % count)) = 0 ] || { echo "COLS must be a multiple of NODES"; exit 2; }
space() { echo "sst$$-$1"; }
end_all() {
  end_hosts 2>/dev/null
  for n in head $nodes; do ip netns del "$(space "$n")" 2>/dev/null; done
  rm -rf "$tmp" "$disk"
}
trap end_all EXIT

# --- the hosts: a cable from each node to the head ------------------------------------------------------------------------------
ip netns add "$(space head)"
ip -n "$(space head)" link set lo up
at[head]="ip netns exec $(space head)"
i=0
for n in $nodes; do
  i=$((i + 1))
  ip netns add "$(space "$n")"
  ip -n "$(space "$n")" link set lo up
  ip -n "$(space "$n")" link add cable type veth peer name "$n" netns "$(space head)" || { echo "no veth (kernel module veth)"; exit 77; }
  ip -n "$(space "$n")" addr add "10.78.$i.2/24" dev cable
  ip -n "$(space head)" addr add "10.78.$i.1/24" dev "$n"
  ip -n "$(space "$n")" link set cable up
  ip -n "$(space head)" link set "$n" up
  at[$n]="ip netns exec $(space "$n")"
  address_of[$n]=10.78.$i.1
done
certificates
configure
for n in head $nodes; do
  mkdir -p "$disk/$n"
  sed -i "s,dir: $tmp/$n/store,dir: $disk/$n," "$n/sstd.yaml"
done
for n in $nodes; do
  sed -i "s/^live: .*/live: {enabled: $live}/" head/sstd.yaml
  # The cameras' own rate; recordings within a quota.
  sed -i "s/^  check_frozen: false/&\n  rate_hz: 30\n  buffers: ${BUFFERS:-8}/; s/skip_unchanged: [a-z]*//; s/^hosts: {/hosts: {skip_unchanged: ${SKIP:-false}, /; s/preroll_s: 0/&, mode: continuous, quota_gb: ${QUOTA:-4}, segment_s: 20/" "$n/sstd.yaml"
done

# --- figures of processes -------------------------------------------------------------------------------------------------------
# cpu PID: seconds of user and system; memory PID: "PSS_KB PEAK_KB FILES"
cpu() { awk -v hz="$(getconf CLK_TCK)" '{ sub(/.*\) /, ""); printf "%.2f", ($12 + $13) / hz }' "/proc/$1/stat"; }
memory() {
  echo "$(awk '/^Pss:/ { print $2 }' "/proc/$1/smaps_rollup") $(awk '/^VmHWM:/ { print $2 }' "/proc/$1/status") $(find "/proc/$1/fd" -type l | wc -l)"
}
threads() { # PID: seconds of each kind of its threads, most first
  local t
  for t in "/proc/$1/task/"*; do
    awk -v hz="$(getconf CLK_TCK)" '{ name = $0; sub(/^[^(]*\(/, "", name); sub(/\).*/, "", name); sub(/.*\) /, ""); print name, ($12 + $13) / hz }' "$t/stat" 2>/dev/null
  done | awk '{ s[$1] += $2 } END { for (n in s) printf "%.1f %s\n", s[n], n }' | sort -rn | head -n 6 | awk '{ printf "%s%s %s s", (NR > 1 ? ", " : ""), $2, $1 }'
}
sim_pid() { pgrep -f "sst-sim .*--serve $tmp/$1.session" | head -n 1; }

"$build/sst-sim" --quiet --world n1/world.yaml --cache "$cache" -- true || { echo "the world cannot be prepared"; exit 1; }
for n in $nodes; do session "$n"; start "$n"; done
start head
await head "s['capture']['present'] == $cameras and s['capture']['complete'] > 5" || exit 1
echo "$cameras cameras on $count nodes deliver; measuring for $minutes minutes at $rate sets/s; load $(/usr/bin/cut -d' ' -f1-3 /proc/loadavg)"
declare -A cpu_before sim_before set_before
for n in head $nodes; do cpu_before[$n]=$(cpu "${pid[$n]}"); done
for n in $nodes; do sim_before[$n]=$(cpu "$(sim_pid "$n")") set_before[$n]=$(value_of "$n" 's["capture"]["sets"]'); done
counts_of_head() { value_of head '"%d %d %d" % (s["capture"]["trigger"]["edges"], s["capture"]["sets"], s["capture"]["complete"])' | tr -d '"'; }
before_ns=$(date +%s%N)
read -r edges_before sets_before whole_before <<<"$(counts_of_head)"
bytes_before=$(value_of head 'sum(n["received_bytes"] for n in s["hosts"]["nodes"])')
end=$((SECONDS + minutes * 60))
while [ $SECONDS -lt $end ]; do
  sleep 15
  kill -0 "${pid[head]}" 2>/dev/null || { fail "the head has ended: $(tail -n 5 head.log)"; break; }
  echo "$(date +%T) $(value_of head '[s["state"], s["capture"]["present"], s["capture"]["rate_hz"], s["capture"]["sets"], s["capture"]["complete"], s["hosts"]["datagrams_no_room"]]') load $(/usr/bin/cut -d' ' -f1 /proc/loadavg)"
done
read -r edges sets whole <<<"$(counts_of_head)"
edges=$((edges - edges_before)) sets=$((sets - sets_before)) whole=$((whole - whole_before))
seconds=$(/usr/bin/python3 -c "print('%.1f' % (($(date +%s%N) - $before_ns) / 1e9))")

# --- the figures, before anything is stopped ------------------------------------------------------------------------------------
{
  echo "host|CPU s|threads|PSS MB|peak MB|files"
  for n in head $nodes; do
    read -r pss peak files <<<"$(memory "${pid[$n]}")"
    echo "$n|$(/usr/bin/python3 -c "print('%.1f' % ($(cpu "${pid[$n]}") - ${cpu_before[$n]}))")|$(threads "${pid[$n]}")|$((pss / 1024))|$((peak / 1024))|$files"
  done
} >hosts.table
for n in $nodes; do /usr/bin/python3 -c "print($(cpu "$(sim_pid "$n")") - ${sim_before[$n]})"; done >sim.cpu
bytes=$(($(value_of head 'sum(n["received_bytes"] for n in s["hosts"]["nodes"])') - bytes_before))
node_sets=0
for n in $nodes; do node_sets=$((node_sets + $(value_of "$n" 's["capture"]["sets"]') - set_before[$n])); done
delays=$(value_of head '" / ".join("%.0f" % s["capture"]["delay_ms"][k] for k in ("p50", "p99", "max"))')

# --- every frame in one place: cameras stop, nothing waits ----------------------------------------------------------------------
for n in $nodes; do "$build/sst-sim" fault --dir "$n.session" 'camera.*.stall=5'; done
: >accounts
for n in $nodes; do
  await "$n" 's["hosts"]["frames"]["waiting"] == 0 and s["capture"]["present"] == 0'
  await head "node('$n')['frames']['waiting'] == 0 and node('$n')['frames']['passed'] == ended(node('$n')['frames'])"
  "$build/sst-sim" status --json --dir "$n.session" >"$n.sim"
  status_of "$n" >"$n.json"
done
status_of head >head.json
/usr/bin/python3 - "$tmp" "$nodes" >accounts <<'PY'
import json, sys
tmp, nodes = sys.argv[1], sys.argv[2].split()
head = json.load(open(f"{tmp}/head.json"))
kinds = ("set", "late", "duplicate", "stray", "corrupt", "flagged", "dropped")
total, bad = {}, 0
def add(where, **what):
    for k, v in what.items():
        total.setdefault(where, {}).setdefault(k, 0)
        total[where][k] += v
for n in nodes:
    s = json.load(open(f"{tmp}/{n}.json"))
    sim = json.load(open(f"{tmp}/{n}.sim"))["cameras"]
    c, link = s["capture"]["frames"], s["hosts"]["frames"]
    peer = next(p for p in head["hosts"]["nodes"] if p["name"] == n)["frames"]
    add("cameras", exposed=sum(x["exposures"] for x in sim), filled=sum(x["frames"] for x in sim), no_buffer_or_stalled=sum(x["lost"] for x in sim))
    add("nodes", delivered=c["delivered"], lost_by_drivers=c["lost_by_drivers"], **{k: c[k] for k in kinds})
    add("links", captured=link["captured"], **{k: link[k] for k in ("sent", "unchanged", "dropped", "away", "lost", "missed")})
    add("head", received=peer["received"], **{k: peer[k] for k in kinds + ("missed", "no_room", "unnamed")})
    checks = {
        "unexplained": c["unexplained"] + link["unexplained"] + peer["unexplained"],
        "filled is delivered": sum(x["frames"] for x in sim) - c["delivered"],
        "delivered in one bucket": c["delivered"] - sum(c[k] for k in kinds),
        "captured in one bucket": link["captured"] - sum(link[k] for k in ("sent", "unchanged", "dropped", "away", "lost", "missed")),
        "in a set is captured": c["set"] - link["captured"],
        "sent is received": link["sent"] + link["unchanged"] - peer["received"],
        "received in one bucket": peer["received"] - sum(peer[k] for k in kinds + ("missed", "no_room", "unnamed")),
    }
    for k, v in checks.items():
        if v:
            print(f"FAULT {n}: {k}: {v}")
            bad = 1
if head["capture"]["frames"]["unexplained"]:
    print(f"FAULT head: unexplained {head['capture']['frames']['unexplained']}")
    bad = 1
for where, what in total.items():
    print(f"{where}|" + ", ".join(f"{v} {k}" for k, v in what.items() if v))
sys.exit(bad)
PY
[ $? = 0 ] || fail "frames are not in one place: $(grep FAULT accounts)"

# --- the recordings ---------------------------------------------------------------------------------------------------------------
for n in $nodes; do kill -TERM "${pid[$n]}"; ended "${pid[$n]}" "$n"; done
: >recorded
for n in $nodes; do
  "$sst" import recording "$disk/$n"/recordings/*/ --sets 0 -o "$n.lf" >/dev/null 2>"$n.err" || fail "$n: import: $(cat "$n.err")"
  du -sm "$disk/$n/recordings" | awk -v n="$n" '{ printf "%s %d MB ", n, $1 }' >>recorded
  wc -l "$disk/$n"/recordings/*/sets.jsonl | tail -n 1 | awk '{ printf "%d lines of sets\n", $1 }' >>recorded
done

# --- the report ---------------------------------------------------------------------------------------------------------------------
/usr/bin/python3 - "$tmp" "$nodes" "$cameras" "$rate" "$seconds" "$edges" "$sets" "$whole" "$node_sets" "$bytes" "${delays//\"/}" >report <<'PY'
import os, sys
tmp, nodes, cameras, rate, seconds, edges, sets, whole, node_sets, size, delays = sys.argv[1:]
nodes = nodes.split()
cameras, rate, seconds = int(cameras), float(rate), float(seconds)
edges, sets, whole, node_sets, size = (int(x) for x in (edges, sets, whole, node_sets, size))
rows = [l.rstrip("\n").split("|") for l in open(f"{tmp}/hosts.table")][1:]
sim = sum(float(l) for l in open(f"{tmp}/sim.cpu"))
share = cameras / len(nodes)
node_s = sum(float(r[1]) for r in rows if r[0] != "head")
head_s = float(next(r[1] for r in rows if r[0] == "head"))
frames = node_sets * share
out = [f"{cameras} cameras of 640x480, {len(nodes)} nodes and a head, {rate:g} sets/s for {seconds:.0f} s: the head has {sets} sets of "
       f"{edges} triggers, {whole} of them complete ({100 * whole / max(1, sets):.2f} %); "
       f"{size / max(1, sets * cameras):.0f} bytes a frame on the wire; a set is there {delays} ms after its trigger (p50 / p99 / max)", ""]
out += ["| | CPU of the run, s | of it by threads | us a frame | memory, MB (peak) | a camera, MB | open files |", "|---|---|---|---|---|---|---|"]
for r in rows:
    n = cameras if r[0] == "head" else share
    f = sets * cameras if r[0] == "head" else frames / len(nodes)
    out.append(f"| {r[0]} | {r[1]} | {r[2]} | {1e6 * float(r[1]) / max(1, f):.0f} | {r[3]} ({r[4]}) | {float(r[3]) / n:.1f} | {r[5]} |")
node_us, head_us = 1e6 * node_s / max(1, frames), 1e6 * head_s / max(1, sets * cameras)
out += ["", f"The simulation itself: {sim:.0f} s of CPU, {1e6 * sim / max(1, frames):.0f} us a frame.", ""]
# Pictures of all cameras go through one thread for the network: it is at its end before eight cores are.
def busiest(row): return max(float(t.split()[1]) for t in row[2].split(", "))
node_thread = 1e6 * sum(busiest(r) for r in rows if r[0] != "head") / max(1, frames)
head_thread = 1e6 * next(busiest(r) for r in rows if r[0] == "head") / max(1, sets * cameras)
out += ["| by these costs, at 75 % | CPU of a camera, % of a core | busiest thread, us a frame | cameras by 8 cores | cameras by that thread |", "|---|---|---|---|---|"]
for hz in (10, 30):
    for what, us, thread in ("node that records", node_us, node_thread), ("head without a live picture", head_us, head_thread):
        out.append(f"| {what}, {hz} Hz | {us * hz / 1e4:.2f} | {thread:.0f} | {8 * 0.75 / (us * hz * 1e-6):.0f} | {0.75 / (thread * hz * 1e-6):.0f} |")
out += ["", "| frames | where they ended |", "|---|---|"]
out += ["| " + l.strip().replace("|", " | ") + " |" for l in open(f"{tmp}/accounts") if not l.startswith("FAULT")]
print("\n".join(out))
PY
echo "recorded: $(tr '\n' ';' <recorded)"
echo "load of the machine at the end: $(/usr/bin/cut -d' ' -f1-3 /proc/loadavg) on $(nproc) cores"
cat report
[ -z "${OUT-}" ] || cp report "$OUT"
exit $failed
