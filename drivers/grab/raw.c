/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "drivers/grab/grab_internal.h"

#include <linux/videodev2.h>
#include <string.h>

/* Bits per pixel in the first plane, and the size of the other planes in 1/8 of the first plane. */
struct raw_format {
    uint32_t fourcc;
    int bits, more_q3;
};

static const struct raw_format formats[] = {
    { V4L2_PIX_FMT_GREY, 8, 0 },      { V4L2_PIX_FMT_SBGGR8, 8, 0 },    { V4L2_PIX_FMT_SGBRG8, 8, 0 },
    { V4L2_PIX_FMT_SGRBG8, 8, 0 },    { V4L2_PIX_FMT_SRGGB8, 8, 0 },    { V4L2_PIX_FMT_Y10, 16, 0 },
    { V4L2_PIX_FMT_Y12, 16, 0 },      { V4L2_PIX_FMT_Y16, 16, 0 },      { V4L2_PIX_FMT_SBGGR10, 16, 0 },
    { V4L2_PIX_FMT_SGBRG10, 16, 0 },  { V4L2_PIX_FMT_SGRBG10, 16, 0 },  { V4L2_PIX_FMT_SRGGB10, 16, 0 },
    { V4L2_PIX_FMT_SBGGR12, 16, 0 },  { V4L2_PIX_FMT_SGBRG12, 16, 0 },  { V4L2_PIX_FMT_SGRBG12, 16, 0 },
    { V4L2_PIX_FMT_SRGGB12, 16, 0 },  { V4L2_PIX_FMT_SBGGR16, 16, 0 },  { V4L2_PIX_FMT_SGBRG16, 16, 0 },
    { V4L2_PIX_FMT_SGRBG16, 16, 0 },  { V4L2_PIX_FMT_SRGGB16, 16, 0 },  { V4L2_PIX_FMT_Y10P, 10, 0 },
    { V4L2_PIX_FMT_SBGGR10P, 10, 0 }, { V4L2_PIX_FMT_SGBRG10P, 10, 0 }, { V4L2_PIX_FMT_SGRBG10P, 10, 0 },
    { V4L2_PIX_FMT_SRGGB10P, 10, 0 }, { V4L2_PIX_FMT_SBGGR12P, 12, 0 }, { V4L2_PIX_FMT_SGBRG12P, 12, 0 },
    { V4L2_PIX_FMT_SGRBG12P, 12, 0 }, { V4L2_PIX_FMT_SRGGB12P, 12, 0 }, { V4L2_PIX_FMT_YUYV, 16, 0 },
    { V4L2_PIX_FMT_YVYU, 16, 0 },     { V4L2_PIX_FMT_UYVY, 16, 0 },     { V4L2_PIX_FMT_VYUY, 16, 0 },
    { V4L2_PIX_FMT_RGB565, 16, 0 },   { V4L2_PIX_FMT_RGB24, 24, 0 },    { V4L2_PIX_FMT_BGR24, 24, 0 },
    { V4L2_PIX_FMT_XBGR32, 32, 0 },   { V4L2_PIX_FMT_ABGR32, 32, 0 },   { V4L2_PIX_FMT_XRGB32, 32, 0 },
    { V4L2_PIX_FMT_NV12, 8, 4 },      { V4L2_PIX_FMT_NV21, 8, 4 },      { V4L2_PIX_FMT_YUV420, 8, 4 },
    { V4L2_PIX_FMT_YVU420, 8, 4 },    { V4L2_PIX_FMT_NV16, 8, 8 },      { V4L2_PIX_FMT_YUV422P, 8, 8 },
};

size_t raw_bytes(uint32_t fourcc, int width, int height, size_t stride)
{
    for (size_t i = 0; i < ARRAY_LEN(formats); i++) {
        const size_t row = ((size_t)width * (size_t)formats[i].bits + 7) / 8, rows = (size_t)height;

        if (formats[i].fourcc != fourcc)
            continue;
        if (stride < row)
            stride = row;
        /* Planes follow each other at full stride; of a single plane the last row needs no padding. */
        if (formats[i].more_q3)
            return stride * rows + stride * rows * (size_t)formats[i].more_q3 / 8;
        return rows ? stride * (rows - 1) + row : 0;
    }
    return 0;
}

size_t raw_pixel_bytes(uint32_t fourcc)
{
    for (size_t i = 0; i < ARRAY_LEN(formats); i++)
        if (formats[i].fourcc == fourcc && !formats[i].more_q3 && formats[i].bits % 8 == 0)
            return (size_t)formats[i].bits / 8;
    return 0;
}

void fourcc_name(char out[5], uint32_t fourcc)
{
    for (int i = 0; i < 4; i++) {
        const char c = (char)(fourcc >> (8 * i) & 0x7f);

        out[i] = c >= ' ' && c < 127 ? c : '.';
    }
    for (int i = 3; i > 0 && out[i] == ' '; i--)
        out[i] = 0;
    out[4] = 0;
}

/* Each lane is a chain of bijections of its words: frames that differ in one word never have the same hash. */
#define LANES 4

uint64_t sst_grab_hash(const uint8_t *data, size_t bytes)
{
    const uint64_t k = UINT64_C(0x9e3779b97f4a7c15);
    uint64_t lane[LANES] = { 1, 2, 3, 4 }, last[LANES] = { 0 }, hash = bytes;
    size_t at = 0;

    for (; bytes - at >= sizeof(lane); at += sizeof(lane)) {
        uint64_t word[LANES];

        memcpy(word, data + at, sizeof(word));
        for (int i = 0; i < LANES; i++) {
            lane[i] = (lane[i] ^ word[i]) * k;
            lane[i] ^= lane[i] >> 29;
        }
    }
    memcpy(last, data + at, bytes - at);
    for (int i = 0; i < LANES; i++) {
        lane[i] = (lane[i] ^ last[i]) * k;
        hash = ((hash << 25 | hash >> 39) ^ lane[i] ^ lane[i] >> 32) * k;
    }
    return hash;
}
