/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/mem.h"
#include "pipeline/kernels/kernels.h"
#include "pipeline/method/disparity/stage.h"

#define MARGIN           4 /* repeated columns of the median's rows */
#define BILATERAL_RADIUS 3 /* the standard normal density is below 0.005 of its peak beyond it */
#define FILTER_HALO      5 /* rows beyond a band that the median (2) and the bilateral filter (3) read */

int sst_disparity_median5(struct sst_map_u16 *map, struct sst_mem_kept *lines)
{
    const struct sst_kernels *k = sst_kernels_get();
    const size_t w = (size_t)map->width, padded = w + 2 * MARGIN;
    uint16_t *ring = sst_mem_keep(lines, 5 * padded, sizeof(uint16_t));

    if (!ring)
        return -ENOMEM;
    for (int y = 0, next = -2; y < map->height; y++) {
        const uint16_t *rows[5];

        /* Rows are copied before the result overwrites them; those above the image repeat row 0. */
        for (; next <= y + 2; next++) {
            const uint16_t *from = sst_map_u16_row(map, sst_clamp_int(next, 0, map->height - 1));
            uint16_t *to = ring + (size_t)((next + 5) % 5) * padded;

            if (next >= map->height) { /* the last row may be overwritten already: use its copy */
                memcpy(to, ring + (size_t)((map->height - 1 + 5) % 5) * padded, padded * sizeof(*to));
                continue;
            }
            for (size_t x = 0; x < MARGIN; x++) {
                to[x] = from[0];
                to[MARGIN + w + x] = from[w - 1];
            }
            memcpy(to + MARGIN, from, w * sizeof(*to));
        }
        for (int j = 0; j < 5; j++)
            rows[j] = ring + (size_t)((y + j - 2 + 5) % 5) * padded + MARGIN;
        k->median5_row(sst_map_u16_row(map, y), rows, w);
    }
    return 0;
}

/* Copy row y of the map and luma into padded rows; columns and rows outside are marked unknown. */
static void pad_rows(uint16_t *disp, uint8_t *luma_row, const struct sst_map_u16 *map, const struct sst_map_u8 *luma,
                     int y)
{
    const size_t w = (size_t)map->width;

    memset(disp, 0xFF, (w + 2 * MARGIN) * sizeof(*disp));
    memset(luma_row, 0, w + 2 * MARGIN);
    if (y < 0 || y >= map->height)
        return;
    memcpy(disp + MARGIN, sst_map_u16_row(map, y), w * sizeof(*disp));
    memcpy(luma_row + MARGIN, sst_map_u8_row(luma, y), w);
}

int sst_disparity_bilateral_weight(int dx, int dy)
{
    /* Integer weights (peak 4096) make the sums exact: the same bytes everywhere. */
    return (int)floor(4096.0 * exp(-0.5 * (dx * dx + dy * dy)) + 0.5);
}

int sst_disparity_bilateral(struct sst_map_u16 *map, const struct sst_map_u8 *luma, int tau)
{
    enum { R = BILATERAL_RADIUS, SIDE = 2 * R + 1 };
    const struct sst_kernels *k = sst_kernels_get();
    const size_t w = (size_t)map->width, padded = w + 2 * MARGIN;
    int16_t weight[SIDE * SIDE];
    uint16_t *disp_ring;
    uint8_t *luma_ring;

    if (tau <= 0)
        return 0;
    disp_ring = sst_mem_alloc_raw(SIDE * padded, sizeof(uint16_t));
    luma_ring = sst_mem_alloc_raw(SIDE * padded, 1);
    if (!disp_ring || !luma_ring) {
        sst_mem_free(disp_ring);
        sst_mem_free(luma_ring);
        return -ENOMEM;
    }
    for (int i = 0; i < SIDE * SIDE; i++) {
        const int dx = i % SIDE - R, dy = i / SIDE - R;

        weight[i] = (int16_t)sst_disparity_bilateral_weight(dx, dy);
    }
    for (int y = 0, next = -R; y < map->height; y++) {
        const uint16_t *disp[SIDE];
        const uint8_t *luma_rows[SIDE];

        for (; next <= y + R; next++) {
            const size_t slot = (size_t)((next + SIDE) % SIDE) * padded;

            pad_rows(disp_ring + slot, luma_ring + slot, map, luma, next);
        }
        for (int j = 0; j < SIDE; j++) {
            const size_t slot = (size_t)((y + j - R + SIDE) % SIDE) * padded + MARGIN;

            disp[j] = disp_ring + slot;
            luma_rows[j] = luma_ring + slot;
        }
        k->bilateral_row(sst_map_u16_row(map, y), disp, luma_rows, weight, tau, w);
    }
    sst_mem_free(disp_ring);
    sst_mem_free(luma_ring);
    return 0;
}

int sst_disparity_smooth_rows(struct sst_map_u16 *out, const struct sst_smoothing *in, struct sst_rows rows,
                              struct sst_mem_kept *copy, struct sst_mem_kept *lines)
{
    const struct sst_map_u16 *raw = in->raw;
    const int top = sst_max_int(rows.y0 - FILTER_HALO, 0), end = sst_min_int(rows.y1 + FILTER_HALO, raw->height);
    const struct sst_map_u8 part = sst_map_u8_rows(in->luma, top, end - top);
    struct sst_map_u16 own = { .width = raw->width, .height = end - top, .stride = raw->stride };
    int err;

    own.data = sst_mem_keep(copy, (size_t)own.height, own.stride);
    if (!own.data)
        return -ENOMEM;
    memcpy(own.data, sst_map_u16_row(raw, top), (size_t)own.height * own.stride);
    err = in->median ? sst_disparity_median5(&own, lines) : 0;
    err = err ? err : sst_disparity_bilateral(&own, &part, in->tau);
    if (!err)
        memcpy(sst_map_u16_row(out, rows.y0), sst_map_u16_row(&own, rows.y0 - top),
               (size_t)(rows.y1 - rows.y0) * own.stride);
    return err;
}

void sst_fuse(struct sst_map_u16 *disp, struct sst_map_u8 *confidence, const struct sst_map_u16 *other_disp,
              const struct sst_map_u8 *other_confidence)
{
    for (int y = 0; y < disp->height; y++) {
        uint16_t *d = sst_map_u16_row(disp, y);
        uint8_t *c = sst_map_u8_row(confidence, y);
        const uint16_t *d2 = sst_map_u16_row(other_disp, y);
        const uint8_t *c2 = sst_map_u8_row(other_confidence, y);

        for (int x = 0; x < disp->width; x++) {
            if (abs(d[x] - d2[x]) <= 64) {
                /* 1 is added to both so that two zeros still average. */
                const int wa = c[x] + 1, wb = c2[x] + 1;

                d[x] = (uint16_t)((d[x] * wa + d2[x] * wb + (wa + wb) / 2) / (wa + wb));
                c[x] = (uint8_t)sst_max_int(c[x], c2[x]);
            } else if (c2[x] > c[x]) {
                d[x] = d2[x];
                c[x] = (uint8_t)(c2[x] - c[x]);
            } else {
                c[x] = (uint8_t)(c[x] - c2[x]);
            }
        }
    }
}
