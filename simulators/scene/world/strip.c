/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "simulators/scene/world/world_internal.h"

#include <string.h>
#include <zlib.h>

#define GAIN_ONE  64
#define CRC_AT    (SST_STRIP_BITS - 32)
#define POSE_BITS 24

int strip_height(int width)
{
    const int cells = sst_max_int(width / SST_STRIP_CELL, 1);

    return (SST_STRIP_BITS + cells - 1) / cells * SST_STRIP_CELL;
}

/* All fields are multiples of four bits, so at most two share a byte. */
static void put(uint8_t *bits, int *at, int n, uint64_t value)
{
    for (int i = n - 1; i >= 0; i--, (*at)++)
        bits[*at / 8] = (uint8_t)(bits[*at / 8] | (value >> i & 1) << (7 - *at % 8));
}

static uint64_t clamped(int64_t value, int n)
{
    const int64_t most = ((int64_t)1 << n) - 1;

    return (uint64_t)(value < 0 ? 0 : value > most ? most : value);
}

void strip_pack(const struct sst_sim_exposure *e, uint8_t bits[SST_STRIP_BYTES])
{
    int at = 0;

    memset(bits, 0, SST_STRIP_BYTES);
    put(bits, &at, 8, clamped(e->cam, 8));
    put(bits, &at, 40, clamped((int64_t)(e->trigger & INT64_MAX), 40));
    put(bits, &at, 56, clamped(e->t_ns, 56));
    put(bits, &at, 20, clamped(e->exposure_us, 20));
    put(bits, &at, 12, clamped((int64_t)sst_clamp_double(e->gain * GAIN_ONE + 0.5, 0, 1e6), 12));
    for (int i = 0; i < 3; i++) {
        const int half = 1 << (POSE_BITS - 1);

        put(bits, &at, POSE_BITS, (uint64_t)sst_clamp_int(e->pose_um[i], -half, half - 1));
    }
    put(bits, &at, 32, crc32_z(0, bits, CRC_AT / 8));
}

void strip_draw(uint8_t *luma, size_t stride, int width, const struct sst_sim_exposure *e)
{
    const int cells = sst_max_int(width / SST_STRIP_CELL, 1), height = strip_height(width);
    uint8_t bits[SST_STRIP_BYTES];

    strip_pack(e, bits);
    for (int y = 0; y < height; y++) {
        for (int x = 0; x < width; x++) {
            const int column = x / SST_STRIP_CELL;
            const bool white = column < cells && strip_cell(bits, y / SST_STRIP_CELL * cells + column);

            luma[(size_t)y * stride + (size_t)x] = white ? SST_STRIP_WHITE : SST_STRIP_BLACK;
        }
    }
}
