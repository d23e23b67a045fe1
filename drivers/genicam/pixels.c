/* Formats of PFNC as V4L2 formats, and samples of 10 and 12 bits as 16 bits. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <linux/videodev2.h>
#include <string.h>

#include "drivers/genicam/genicam_internal.h"

/* Best first: whole words need no unpacking, packed ones less of the network. */
static const struct genicam_pixels formats[] = {
    { "Mono8", 0x01080001, V4L2_PIX_FMT_GREY, GENICAM_AS_IS, 8 },
    { "Mono16", 0x01100007, V4L2_PIX_FMT_Y16, GENICAM_AS_IS, 16 },
    { "Mono14", 0x01100025, V4L2_PIX_FMT_Y16, GENICAM_SHIFT, 14 },
    { "Mono12", 0x01100005, V4L2_PIX_FMT_Y16, GENICAM_SHIFT, 12 },
    { "Mono12p", 0x010C0047, V4L2_PIX_FMT_Y16, GENICAM_P12, 12 },
    { "Mono12Packed", 0x010C0006, V4L2_PIX_FMT_Y16, GENICAM_PACKED12, 12 },
    { "Mono10", 0x01100003, V4L2_PIX_FMT_Y16, GENICAM_SHIFT, 10 },
    { "Mono10p", 0x010A0046, V4L2_PIX_FMT_Y16, GENICAM_P10, 10 },
    { "Mono10Packed", 0x010C0004, V4L2_PIX_FMT_Y16, GENICAM_PACKED10, 10 },
    { "BayerRG8", 0x01080009, V4L2_PIX_FMT_SRGGB8, GENICAM_AS_IS, 8 },
    { "BayerGR8", 0x01080008, V4L2_PIX_FMT_SGRBG8, GENICAM_AS_IS, 8 },
    { "BayerGB8", 0x0108000A, V4L2_PIX_FMT_SGBRG8, GENICAM_AS_IS, 8 },
    { "BayerBG8", 0x0108000B, V4L2_PIX_FMT_SBGGR8, GENICAM_AS_IS, 8 },
    { "RGB8", 0x02180014, V4L2_PIX_FMT_RGB24, GENICAM_AS_IS, 24 },
    { "RGB8Packed", 0x02180014, V4L2_PIX_FMT_RGB24, GENICAM_AS_IS, 24 },
};

const struct genicam_pixels *genicam_pixels_next(uint32_t fourcc, int *at)
{
    while (*at < (int)ARRAY_LEN(formats)) {
        const struct genicam_pixels *p = &formats[(*at)++];

        if (p->fourcc == fourcc)
            return p;
    }
    return NULL;
}

const struct genicam_pixels *genicam_pixels_named(const char *name)
{
    for (size_t i = 0; i < ARRAY_LEN(formats); i++)
        if (!strcmp(formats[i].name, name))
            return &formats[i];
    return NULL;
}

bool sst_genicam_has_format(uint32_t fourcc)
{
    int at = 0;

    return genicam_pixels_next(fourcc, &at) != NULL;
}

/* The number of bits that a pixel takes is a part of the code. */
size_t genicam_bytes(const struct genicam_pixels *p, int width, int height)
{
    return ((size_t)width * (size_t)height * (p->code >> 16 & 0xff) + 7) / 8;
}

size_t genicam_frame_bytes(const struct genicam_pixels *p, int width, int height)
{
    return (size_t)width * (size_t)height * (p->fourcc == V4L2_PIX_FMT_Y16 ? 2 : p->fourcc == V4L2_PIX_FMT_RGB24 ? 3 : 1);
}

static unsigned packed_sample(const uint8_t *data, size_t i, const struct genicam_pixels *p)
{
    const uint8_t *pair = data + i / 2 * 3;
    const int low = p->bits - 8;

    if (p->packing == GENICAM_P12 || p->packing == GENICAM_P10) {
        const size_t bit = i * (size_t)p->bits;
        const unsigned word = data[bit / 8] | (unsigned)data[bit / 8 + 1] << 8;

        return word >> bit % 8 & ((1u << p->bits) - 1); /* at most 6 + 10 or 4 + 12 bits */
    }
    return i % 2 ? (unsigned)pair[2] << low | (pair[1] >> 4 & ((1u << low) - 1))
                 : (unsigned)pair[0] << low | (pair[1] & ((1u << low) - 1));
}

/* From the last sample to the first, as the packed ones lie below: sample i is written at byte 2 i, and none after it
 * is read. One sample of a pair lies above the other's place, so pairs (quadruples of 10 bits) are read first. */
void genicam_unpack(uint8_t *data, size_t count, const struct genicam_pixels *p)
{
    const int up = 16 - p->bits;
    unsigned sample[4];

    if (p->packing == GENICAM_AS_IS)
        return;
    if (p->packing == GENICAM_SHIFT) {
        for (size_t i = 0; i < count; i++) {
            const unsigned v = (data[2 * i] | (unsigned)data[2 * i + 1] << 8) << up;

            data[2 * i] = (uint8_t)v;
            data[2 * i + 1] = (uint8_t)(v >> 8);
        }
        return;
    }
    for (size_t group = (count + 3) / 4; group-- > 0;) {
        const size_t n = count - 4 * group < 4 ? count - 4 * group : 4;

        for (size_t k = 0; k < n; k++)
            sample[k] = packed_sample(data, 4 * group + k, p) << up;
        for (size_t k = 0; k < n; k++) {
            data[8 * group + 2 * k] = (uint8_t)sample[k];
            data[8 * group + 2 * k + 1] = (uint8_t)(sample[k] >> 8);
        }
    }
}
