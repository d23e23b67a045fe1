# 36 capture nodes of a real kernel (vivid): all are listed, stream together, and what its error injection does to one of
# them is counted and named while the others go on.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
. tests/guest/lib.sh

load vivid n_devs=36 $(python3 -c '
for name, value in ("node_types", "0x1"), ("multiplanar", "1"), ("num_inputs", "1"), ("input_types", "0x0"):
    print(name + "=" + ",".join([value] * 36))')
wait_for 30 test -e /dev/video35 || fail "36 nodes do not appear"
is "nodes by v4l2-ctl" "$(v4l2-ctl --list-devices | grep -c /dev/video)" 36

"$bin/grab" -l >list || fail "cameras are not listed"
is "cameras listed" "$(wc -l <list)" 36
is "the first and the last" "$(sed -n '1p;$p' list | tr '\n' ' ')" \
  "/dev/video0|platform:vivid-000||vivid|vivid|0 /dev/video35|platform:vivid-035||vivid|vivid|0 "

"$sst" cameras --json >cameras.json 2>err || fail "sst cameras: $(cat err)"
is "cameras by sst cameras" "$(json cameras.json 'len(j["cameras"])')" 36
is "their ports" "$(json cameras.json 'sum(c["port"] == "platform:vivid-%03d" % i for i, c in enumerate(j["cameras"]))')" 36
head -c 600 cameras.json

ports=$(cut -d'|' -f2 list)
# The webcam input has fixed sizes and rates; 320x180 YUYV is its smallest. GREY is half of that.
"$bin/grab" GREY 320 180 5 10 $ports >all 2>&1 || fail "36 cameras do not stream: $(tail -n 3 all)"
grep -v ^sum all
is "started" "$(grep ^started all)" "started 36"
# No frame may be lost that the machine itself did not lose: while a processor does not run in time, vivid skips frames.
awk '$1 == "stalled" { stalled = $2 }
$1 == "sum" { n++; frames[$2] = $4; bad[$2] = $6; lost[$2] = $8 }
END {
  for (c in frames) {
    if (frames[c] + stalled < 40 || frames[c] > 60) print "FAIL: camera " c " gave " frames[c] " frames in 10 s at 5 Hz"
    if (bad[c]) print "FAIL: camera " c " gave " bad[c] " bad frames"
    if (lost[c] > stalled) print "FAIL: camera " c " lost " lost[c] " frames, the machine at most " stalled
    all += frames[c]; gaps += lost[c]
  }
  if (n != 36) print "FAIL: " n " cameras summed"
  print all " frames of 36 cameras, " gaps + 0 " lost in the driver, at most " stalled " of each by the machine"
}' all | tee judged
! grep -q FAIL judged || failed=1

# Faults of camera 1 of three while all stream.
set_control() { v4l2-ctl -d /dev/video1 -c "$1" || fail "v4l2-ctl $1"; }
run() { # NAME SECONDS FAULTS...: the faults as commands, one after the other
  local name=$1 seconds=$2 grab f
  shift 2
  "$bin/grab" GREY 320 180 5 "$seconds" $(head -n 3 <<<"$ports") >"$name" 2>&1 & grab=$!
  wait_for 20 grep -q ^started "$name" || fail "$name: nothing started"
  sleep 1
  for f in "$@"; do $f; done
  wait $grab || fail "$name: grab failed"
  echo "--- $name"
  cat "$name"
  is "$name: state of camera 1 at the end" "$(grep '^1 ' "$name" | tail -n 1 | cut -d: -f1)" "1 streaming"
  for c in 0 2; do
    [ "$(sum $c bad) $(sum $c gone) $(sum $c restream)" = "0 0 0" ] || fail "$name: camera $c suffers"
    [ "$(sum $c lost)" -le "$(stalled)" ] || fail "$name: camera $c lost $(sum $c lost) frames, the machine at most $(stalled)"
    [ $(($(sum $c frames) + $(stalled))) -gt $((seconds * 3)) ] || fail "$name: camera $c gave $(sum $c frames) frames in $seconds s"
  done
}
sum() { awk -v c="$1" -v w="$2" '$1 == "sum" && $2 == c { for (i = 3; i < NF; i += 2) if ($i == w) print $(i + 1) }' $now; }
stalled() { awk '$1 == "stalled" { print $2 }' $now; }

now=flag run flag 4 "set_control inject_v4l2_buf_flag_error=1"
now=flag
is "frames that the driver flagged" "$(sum 1 flagged) $(sum 1 bad)" "1 1"

now=drops run drops 8 "set_control percentage_of_dropped_buffers=50" "sleep 5" \
  "set_control percentage_of_dropped_buffers=0"
now=drops
lost=$(sum 1 lost)
[ "$lost" -ge 5 ] && [ "$lost" -le $((20 + $(stalled))) ] || fail "drops: $lost of about 25 frames lost, not about 12"

now=gone run gone 8 "set_control disconnect=1"
now=gone
is "times gone and found" "$(sum 1 gone) $(sum 1 found)" "1 2"
is "logged once" "$(grep -c 'sst: warning: .*unplugged' gone)" 1

now=fatal run fatal 8 "set_control inject_fatal_streaming_error=1"
now=fatal
[ "$(sum 1 restream)" -ge 1 ] || fail "fatal: the stream was not restarted"

now=streamon run streamon 12 "set_control inject_vidioc_streamon_error=1" "set_control inject_fatal_streaming_error=1"
now=streamon
[ "$(sum 1 reopen)" -ge 1 ] || fail "streamon: the node was not opened again"

refuse_buffers() { for _ in 1 2 3 4 5; do set_control inject_vidioc_qbuf_error=1; sleep 0.3; done; }
now=qbuf run qbuf 16 refuse_buffers
now=qbuf
# A buffer that was refused is offered again; else five refusals take all four from it, and it is mute for good.
[ $(($(sum 1 frames) + $(stalled))) -gt 48 ] || fail "qbuf: $(sum 1 frames) frames in 16 s at 5 Hz"
exit $failed
