/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "capture/recording/recorder.h"

#include <string.h>

#include <linux/videodev2.h>

bool sst_recording_format_known(uint32_t fourcc)
{
    switch (fourcc) {
    case V4L2_PIX_FMT_MJPEG:
    case V4L2_PIX_FMT_JPEG:
    case V4L2_PIX_FMT_YUYV:
    case V4L2_PIX_FMT_GREY:
    case V4L2_PIX_FMT_Y16:
    case V4L2_PIX_FMT_RGB24:
    case V4L2_PIX_FMT_SBGGR8:
    case V4L2_PIX_FMT_SGBRG8:
    case V4L2_PIX_FMT_SGRBG8:
    case V4L2_PIX_FMT_SRGGB8:
        return true;
    default:
        return false;
    }
}

void sst_recording_format_name(uint32_t fourcc, char out[5])
{
    for (int i = 0; i < 4; i++) {
        const char c = (char)(fourcc >> (8 * i) & 0xFF);

        out[i] = c >= ' ' && c < 127 && c != '"' && c != '\\' ? c : '?';
    }
    out[4] = 0;
    for (int i = 3; i > 0 && out[i] == ' '; i--)
        out[i] = 0;
}

uint32_t sst_recording_format_parse(const char *name)
{
    const size_t n = strlen(name);

    if (n < 1 || n > 4)
        return 0;
    return v4l2_fourcc((uint32_t)name[0], n > 1 ? (uint32_t)name[1] : ' ', n > 2 ? (uint32_t)name[2] : ' ',
                       n > 3 ? (uint32_t)name[3] : ' ');
}
