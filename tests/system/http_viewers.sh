#!/usr/bin/env bash
# Ten viewers at ten pictures a second, by a client that is not ours: each gets them all, and they cost little.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
. "$(dirname "$0")/../lib.sh"
tool=$root/${SST_BUILD:-build}/tests/tools/http_pictures
command -v curl >/dev/null || skip "curl is not installed"
mkfifo said

# measure: how many pictures each of ten viewers got, to ./got; what they cost, to $cost
measure() {
  local viewers=() server port v i
  timeout 600 "$tool" . 10 3 10 100000 >said 2>err &
  server=$!
  exec 3<said
  read -r -t 60 port <&3 || { grep -q "no HTTP" err && skip "$(cat err)"; fail "no server: $(cat err)"; exit 1; }
  for i in 1 2 3 4 5 6 7 8 9 10; do
    curl -s -m 120 -H "Authorization: Bearer $(cat token.view)" "http://127.0.0.1:$port/stream" >"stream$i" &
    viewers+=($!)
  done
  read -r -t 120 cost <&3 || fail "no end: $(cat err)"
  exec 3<&-
  wait "$server" || fail "server: exit $?: $(cat err)"
  for v in "${viewers[@]}"; do wait "$v" || fail "a viewer: curl exit $?"; done
  for i in 1 2 3 4 5 6 7 8 9 10; do grep -ac '^Content-Length: 100000' "stream$i"; done >got
  echo "$cost; pictures of each: $(paste -sd ' ' got)"
}

# judged: the fault, in a sentence
judged() {
  local percent=${cost#cpu }
  percent=${percent%%.*}
  [ "$(sort -n got | head -n 1)" -ge 25 ] || echo "a viewer got $(sort -n got | head -n 1) of 30 pictures"
  case ${SST_BUILD:-build} in
    *address*|*thread*) ;;
    *) [ "$percent" -lt 20 ] || echo "ten viewers cost $percent % of a core";;
  esac
}

# A viewer whom the machine does not let run for a second misses pictures, which is what streams are for: then it is
# measured again. What the server loses or costs by itself, it loses each time.
for n in 1 2 3 4 5; do
  measure
  wrong=$(judged)
  [ -n "$wrong" ] || break
  repeats $n "$wrong"
done
[ -z "$wrong" ] || fail "$wrong"
exit $failed
