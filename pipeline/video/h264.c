/* Loader of h264_libav.c, in the part libsst-video.so: FFmpeg loads slowly, and most runs encode nothing. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/video/h264.h"

#include <errno.h>
#include <pthread.h>
#include <stdio.h>

#include "base/plugin.h"

static const struct sst_h264_part *part; /* fixed after load */
static char missing[256];

static void load(void)
{
    part = sst_plugin_symbol("video", "sst_h264_part", missing);
}

int sst_h264_open(struct sst_h264 **out, const struct sst_h264_config *cfg, char why[256])
{
    static pthread_once_t once = PTHREAD_ONCE_INIT;

    pthread_once(&once, load);
    if (part)
        return part->open(out, cfg, why);
    snprintf(why, 256, "H.264 needs libavcodec: %.200s", missing);
    return -ENOTSUP;
}

const char *sst_h264_name(const struct sst_h264 *h)
{
    return part->name(h);
}

int sst_h264_encode(struct sst_h264 *h, const struct sst_h264_picture *picture, struct sst_h264_unit *out, char why[256])
{
    return part->encode(h, picture, out, why);
}

void sst_h264_close(struct sst_h264 *h)
{
    if (h)
        part->close(h);
}
