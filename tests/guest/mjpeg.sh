# MJPEG from nodes of a real kernel (v4l2loopback): the bytes arrive as they were fed, damaged pictures are told apart.
. tests/guest/lib.sh

load v4l2loopback devices=4 max_buffers=4
"$bin/feed" 640 480 10 5 /dev/video0 /dev/video1 /dev/video2 /dev/video3 >fed 2>&1 & feed=$!
wait_for 20 grep -q feeding fed || fail "the feeder does not feed: $(cat fed)"
"$bin/grab" -l | tee list
v4l2-ctl -d /dev/video0 --all
mkdir kept
"$bin/grab" -o kept MJPG 640 480 10 8 $(cut -d'|' -f2 list) >out 2>&1 || fail "no capture"
cat out
ls -l kept [0-7]
kill $feed
wait $feed
exit $failed
