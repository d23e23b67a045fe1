#!/usr/bin/env bash
# GStreamer 1.22 (appsrc): a live appsrc asks once for a buffer and waits. From PLAYING to PAUSED it goes on waiting, and from PAUSED to
# PLAYING it does not ask again: a need-data callback that returns without a buffer because of the pause is never called
# again, and the pipeline is PLAYING and silent.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
. "$(dirname "$0")/../scripts/finding.sh"
unpack libgstreamer-plugins-base1.0-0=1.22.0-3+deb12u7 libgstreamer-plugins-base1.0-dev=1.22.0-3+deb12u7
cat >pause.c <<'C'
#include <gst/app/gstappsrc.h>
#include <gst/gst.h>

static int asked, pushed;
static GstClockTime at;

static void need(GstAppSrc *src, guint length, gpointer arg)
{
    asked++;
    g_usleep(50000); /* the next picture is 50 ms away */
    if (GST_STATE_TARGET(src) == GST_STATE_PLAYING) {
        GstBuffer *b = gst_buffer_new_allocate(NULL, 100, NULL);

        GST_BUFFER_PTS(b) = at += 50000000;
        gst_app_src_push_buffer(src, b);
        pushed++;
    }
}

int main(int argc, char **argv)
{
    GstAppSrcCallbacks callbacks = { .need_data = need };
    GstElement *p, *s;

    gst_init(&argc, &argv);
    p = gst_parse_launch("appsrc name=s is-live=true format=time ! fakesink sync=false", NULL);
    s = gst_bin_get_by_name(GST_BIN(p), "s");
    gst_app_src_set_callbacks(GST_APP_SRC(s), &callbacks, NULL, NULL);
    gst_element_set_state(p, GST_STATE_PLAYING);
    g_usleep(2000000);
    printf("playing: %s\n", asked > 1 && pushed > 1 ? "asked again and again" : "silent");
    gst_element_set_state(p, GST_STATE_PAUSED);
    g_usleep(1000000);
    asked = pushed = 0;
    gst_element_set_state(p, GST_STATE_PLAYING);
    g_usleep(4000000);
    printf("playing again, 4 s: asked %d times, %d buffers\n", asked, pushed);
    return 0;
}
C
gcc -O1 -w pause.c -o pause $(pkg-config --cflags --libs gstreamer-app-1.0)
./pause | tee seen
printf '%s\n' 'playing: asked again and again' 'playing again, 4 s: asked 0 times, 0 buffers' >expected
holds "appsrc does not ask again after a pause" cmp -s seen expected
# Seen: these two lines
