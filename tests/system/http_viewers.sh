#!/usr/bin/env bash
# Ten viewers at ten pictures a second, by a client that is not ours: each gets them all, and they cost little.
. "$(dirname "$0")/../lib.sh"
tool=$root/${SST_BUILD:-build}/tests/tools/http_pictures
command -v curl >/dev/null || { echo "curl is not installed"; exit 77; }

mkfifo said
timeout 600 "$tool" . 10 3 10 100000 >said 2>err &
server=$!
exec 3<said
read -r -t 60 port <&3 || { echo "no server: $(cat err)"; grep -q "no HTTP" err && exit 77; exit 1; }
viewers=()
for i in 1 2 3 4 5 6 7 8 9 10; do
  curl -s -m 120 -H "Authorization: Bearer $(cat token.view)" "http://127.0.0.1:$port/stream" >"stream$i" &
  viewers+=($!)
done
read -r -t 120 cost <&3 || fail "no end: $(cat err)"
wait "$server" || fail "server: exit $?: $(cat err)"
for v in "${viewers[@]}"; do wait "$v" || fail "a viewer: curl exit $?"; done

for i in 1 2 3 4 5 6 7 8 9 10; do
  n=$(grep -ac '^Content-Length: 100000' "stream$i")
  # a busy machine may be late for some
  [ "$n" -ge 25 ] || fail "viewer $i got $n of 30 pictures"
done
echo "$cost"
percent=${cost#cpu }
percent=${percent%%.*}
case ${SST_BUILD:-build} in
  *address*|*thread*) ;;
  *) [ "$percent" -lt 20 ] || fail "ten viewers cost $percent % of a core";;
esac
exit $failed
