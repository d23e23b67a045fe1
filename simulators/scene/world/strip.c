#include "simulators/scene/world/world_internal.h"

#include <errno.h>
#include <string.h>
#include <zlib.h>

#define GAIN_ONE  64
#define CRC_AT    (SST_STRIP_BITS - 32)
#define DARK      96 /* a cell's mean below is black, above LIGHT white; between: invalid */
#define LIGHT     160
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

static uint64_t get(const uint8_t *bits, int *at, int n)
{
    uint64_t value = 0;

    for (int i = 0; i < n; i++, (*at)++)
        value = value << 1 | (bits[*at / 8] >> (7 - *at % 8) & 1);
    return value;
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

/* Value of a cell: 1, 0, or -1 for neither. Its edges are ignored: scaling and JPEG soften them. */
static int cell_of(const uint8_t *luma, size_t stride)
{
    int sum = 0;

    for (int y = 2; y < 6; y++) {
        for (int x = 2; x < 6; x++)
            sum += luma[(size_t)y * stride + (size_t)x];
    }
    return sum < DARK * 16 ? 0 : sum > LIGHT * 16 ? 1 : -1;
}

int strip_read(const uint8_t *luma, size_t stride, int width, int height, struct sst_sim_exposure *out)
{
    const int cells = width / SST_STRIP_CELL;
    uint8_t bits[SST_STRIP_BYTES] = { 0 };
    struct sst_sim_exposure e = { 0 };
    int at = 0;

    if (cells < 1 || height < strip_height(width))
        return -EBADMSG;
    for (int i = 0; i < SST_STRIP_BITS; i++) {
        const size_t x = (size_t)(i % cells) * SST_STRIP_CELL, y = (size_t)(i / cells) * SST_STRIP_CELL;
        const int bit = cell_of(luma + y * stride + x, stride);

        if (bit < 0)
            return -EBADMSG;
        bits[i / 8] = (uint8_t)(bits[i / 8] | bit << (7 - i % 8));
    }
    e.cam = (int)get(bits, &at, 8);
    e.trigger = get(bits, &at, 40);
    e.t_ns = (int64_t)get(bits, &at, 56);
    e.exposure_us = (int)get(bits, &at, 20);
    e.gain = (double)get(bits, &at, 12) / GAIN_ONE;
    for (int i = 0; i < 3; i++)
        e.pose_um[i] = (int32_t)((uint32_t)get(bits, &at, POSE_BITS) << (32 - POSE_BITS)) >> (32 - POSE_BITS);
    if (get(bits, &at, 32) != crc32_z(0, bits, CRC_AT / 8))
        return -EBADMSG;
    *out = e;
    return 0;
}
