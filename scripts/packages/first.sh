#!/usr/bin/env bash
# Time from the built packages to the first live picture on a bare root of Debian: first.sh DIST. Two commands, `apt install ./*.deb` and
# `sst demo`; the picture is fetched from the service's page. Needs root and an archive; the download is timed by itself first.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
set -eu
cd "$(dirname "$0")/../.."
dist=$1 arch=$(dpkg --print-architecture)
limit=${FIRST_LIMIT_S-60}
out=$PWD/build/packages/$dist
root=$(scripts/packages/root.sh "$dist" bare)
mkdir -p "$out/first"
rm -rf "$out/first"/*
cp "$out/$arch"/sst_*.deb "$out/$arch"/sstd_*.deb "$out/$arch"/sst-sim_*.deb "$out/$arch"/sst-models_*.deb "$out/first/"
scripts/packages/enter.sh --network --bind "$out/first:/packages" "$root" bash -c '
  set -eu
  now() { cut -d" " -f1 /proc/uptime; }
  since() { awk -v a="$1" -v b="$2" "BEGIN { printf \"%.1f\", b - a }"; }
  # Processor seconds of all ended children.
  spent() { tail -n 1 /tmp/times | sed "s/m/ /g; s/s//g" | awk "{ printf \"%.1f\", 60 * \$1 + \$2 + 60 * \$3 + \$4 }"; }
  apt-get -qq update
  t0=$(now)
  apt-get -qq install -y --download-only /packages/*.deb >/dev/null
  times >/tmp/times
  t1=$(now) c1=$(spent)
  # --- the two commands ---
  apt-get -qq install -y /packages/*.deb >/packages/apt.log 2>&1
  times >/tmp/times
  t2=$(now) c2=$(spent)
  cd /root
  # A network of its own: port 8090 of this machine may be in use.
  unshare --net sh -c "ip link set lo up && exec sst demo" >/packages/demo.log 2>&1 &
  demo=$!
  until [ -S sst-demo/pedestrian.sock ] && sst snapshot --socket sst-demo/pedestrian.sock -o now.jpg >/dev/null 2>&1 && [ -s now.jpg ]; do
    kill -0 $demo 2>/dev/null || { cat /packages/demo.log >&2; exit 1; }
    sleep 0.2
  done
  t3=$(now)
  kill -INT $demo
  wait $demo || true
  times >/tmp/times
  c3=$(spent)
  cp now.jpg /packages/
  echo "$(grep -c "^Setting up" /packages/apt.log) packages; download $(since $t0 $t1) s; install $(since $t1 $t2) s ($(since $c1 $c2) s of a processor), demo to" \
    "the first live picture $(since $t2 $t3) s ($(since $c2 $c3) s); the two commands $(since $t1 $t3) s, load $(cut -d" " -f1 /proc/loadavg) on $(nproc) processors"
  awk -v t="$(since $t1 $t3)" -v limit='"$limit"' "BEGIN { exit t > limit }" || { echo "longer than '"$limit"' s" >&2; exit 1; }'
