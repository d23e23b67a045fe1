#!/usr/bin/env bash
# Aravis 0.8.26: a program that may open packet sockets (root) receives GigE Vision frames through one by default. It is open before its
# filter is set, so packets of other cameras of that network that come in between are in its queue: their frames are delivered as this
# camera's, mostly incomplete, and its own frames are discarded as late where the others' numbers are higher, for seconds.
# ARV_GV_STREAM_OPTION_PACKET_SOCKET_DISABLED avoids it.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
. "$(dirname "$0")/../scripts/finding.sh"
[ "$(id -u)" -eq 0 ] || { echo "network namespaces and packet sockets need root"; exit 2; }
unpack libaravis-0.8-0=0.8.26-1 libaravis-dev=0.8.26-1 aravis-tools=0.8.26-1
array=sst$$a a=sst$$b b=sst$$c
trap 'kill $(jobs -p) 2>/dev/null || true; for n in $array $a $b; do ip netns del $n 2>/dev/null; done; rm -rf "$tmp"' EXIT
for n in $array $a $b; do ip netns add $n; done
ip -n $array link add br0 type bridge
ip -n $array addr add 10.87.0.1/24 brd + dev br0
ip -n $array link set br0 up
i=2
for n in $a $b; do
  ip link add $n netns $array type veth peer name eth0 netns $n
  ip -n $array link set $n master br0 up
  ip -n $n addr add 10.87.0.$i/24 brd + dev eth0
  ip -n $n link set eth0 up
  ip netns exec $n arv-fake-gv-camera-0.8 -i eth0 -s F$i &
  i=$((i + 1))
done
cat >foreign.c <<'C'
#include <arv.h>
#include <stdio.h>

static ArvStream *start(ArvCamera *c, double hz, ArvGvStreamOption option)
{
    ArvStream *s;

    arv_camera_gv_set_stream_options(c, option);
    arv_camera_set_region(c, 0, 0, 320, 240, NULL);
    arv_camera_set_frame_rate(c, hz, NULL);
    s = arv_camera_create_stream(c, NULL, NULL, NULL);
    for (int i = 0; i < 10; i++)
        arv_stream_push_buffer(s, arv_buffer_new(320 * 240, NULL));
    arv_camera_start_acquisition(c, NULL);
    return s;
}

/* Frames of the other camera, which counts from 1 by now, among the first ones of this one, which is near 65400. */
static int foreign(ArvCamera *c, ArvGvStreamOption option)
{
    int n = 0;

    for (int turn = 0; turn < 20; turn++) {
        ArvStream *s = start(c, 50, option);

        for (int i = 0; i < 3; i++) {
            ArvBuffer *b = arv_stream_timeout_pop_buffer(s, 300000);

            if (b) {
                n += arv_buffer_get_frame_id(b) > 0 && arv_buffer_get_frame_id(b) < 60000;
                g_object_unref(b);
            }
        }
        arv_camera_stop_acquisition(c, NULL);
        g_object_unref(s);
    }
    return n;
}

int main(void)
{
    ArvCamera *a = arv_camera_new("10.87.0.2", NULL), *b = arv_camera_new("10.87.0.3", NULL);
    int with, without;

    start(a, 500, ARV_GV_STREAM_OPTION_PACKET_SOCKET_DISABLED);
    g_usleep(2000000);
    without = foreign(b, ARV_GV_STREAM_OPTION_PACKET_SOCKET_DISABLED);
    with = foreign(b, ARV_GV_STREAM_OPTION_NONE);
    printf("frames of another camera: %d without the packet socket, %s with it\n", without, with ? "some" : "0");
    return !(without == 0 && with > 0);
}
C
compile foreign -I"$root/usr/include/aravis-0.8" $(pkg-config --cflags gobject-2.0 gio-2.0) -laravis-0.8 -lgio-2.0 -lgobject-2.0 -lglib-2.0
holds "the packet socket delivers frames of other cameras" ip netns exec $array env LD_LIBRARY_PATH="$lib" ./foreign
# Seen: frames of another camera: 0 without the packet socket, some with it
