/* tests/strip_read.h - what the strip of a simulated frame says. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_TESTS_STRIP_READ_H
#define SST_TESTS_STRIP_READ_H

#include <errno.h>
#include <zlib.h>

#include "simulators/scene/world/world_internal.h"

static inline uint64_t strip_bits(const uint8_t *bits, int *at, int n)
{
    uint64_t value = 0;

    for (int i = 0; i < n; i++, (*at)++)
        value = value << 1 | (bits[*at / 8] >> (7 - *at % 8) & 1);
    return value;
}

/* Value of a cell by its mean: 1, 0, or -1 for neither. Its edges are ignored: scaling and JPEG soften them. */
static inline int strip_cell_at(const uint8_t *luma, size_t stride)
{
    int sum = 0;

    for (int y = 2; y < 6; y++) {
        for (int x = 2; x < 6; x++)
            sum += luma[(size_t)y * stride + (size_t)x];
    }
    return sum < 96 * 16 ? 0 : sum > 160 * 16 ? 1 : -1;
}

/**
 * Read a strip from decoded luma; the height may be the strip's alone.
 *
 * @return 0 or -EBADMSG (no strip, a cell neither black nor white, or the checksum is wrong)
 */
static inline int strip_read(const uint8_t *luma, size_t stride, int width, int height, struct sst_sim_exposure *out)
{
    const int cells = width / SST_STRIP_CELL;
    uint8_t bits[SST_STRIP_BYTES] = { 0 };
    struct sst_sim_exposure e = { 0 };
    int at = 0;

    if (cells < 1 || height < strip_height(width))
        return -EBADMSG;
    for (int i = 0; i < SST_STRIP_BITS; i++) {
        const size_t x = (size_t)(i % cells) * SST_STRIP_CELL, y = (size_t)(i / cells) * SST_STRIP_CELL;
        const int bit = strip_cell_at(luma + y * stride + x, stride);

        if (bit < 0)
            return -EBADMSG;
        bits[i / 8] = (uint8_t)(bits[i / 8] | bit << (7 - i % 8));
    }
    e.cam = (int)strip_bits(bits, &at, 8);
    e.trigger = strip_bits(bits, &at, 40);
    e.t_ns = (int64_t)strip_bits(bits, &at, 56);
    e.exposure_us = (int)strip_bits(bits, &at, 20);
    e.gain = (double)strip_bits(bits, &at, 12) / 64;
    for (int i = 0; i < 3; i++)
        e.pose_um[i] = (int32_t)((uint32_t)strip_bits(bits, &at, 24) << 8) >> 8;
    if (strip_bits(bits, &at, 32) != crc32_z(0, bits, SST_STRIP_BYTES - 4))
        return -EBADMSG;
    *out = e;
    return 0;
}

#endif
