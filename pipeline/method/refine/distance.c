/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/method/refine/parts.h"

#include <math.h>
#include <string.h>

#define FAR (1u << 20) /* larger than any distance: no pixel of the region in this column */

/* One sweep down, one up. */
bool sst_distance_columns(uint32_t *dist, const struct sst_map_u8 *label, int value)
{
    const size_t width = (size_t)label->width;
    bool any = memchr(sst_map_u8_row(label, 0), value, width) != NULL;

    for (int y = 0; y < label->height && !any; y++)
        any = memchr(sst_map_u8_row(label, y), value, width) != NULL;
    if (!any)
        return false;
    for (int y = 0; y < label->height; y++) {
        const uint8_t *restrict row = sst_map_u8_row(label, y);
        uint32_t *restrict d = dist + (size_t)y * width;
        const uint32_t *restrict above = y ? d - width : NULL;

        for (size_t x = 0; x < width; x++) {
            const uint32_t farther = above ? above[x] + 1 : FAR;

            d[x] = row[x] == value ? 0 : farther < FAR ? farther : FAR;
        }
    }
    for (int y = label->height - 2; y >= 0; y--) {
        uint32_t *restrict d = dist + (size_t)y * width;
        const uint32_t *restrict below = d + width;

        for (size_t x = 0; x < width; x++)
            d[x] = below[x] + 1 < d[x] ? below[x] + 1 : d[x];
    }
    return true;
}

/*
 * Lower envelope of the parabolas of one row. Two of them cross at s = ((g_q + q^2) - (g_v + v^2)) / 2 (q - v);
 * numerator and denominator are integers below 2^33 and 2^17, so the rounded s lies on the same side of every integer
 * as the true one.
 */
void sst_distance_row(uint32_t *d, int width, struct sst_distance_scratch *scratch)
{
    uint32_t *g = scratch->row;
    double *start = scratch->start;
    int32_t *vertex = scratch->vertex;
    int n = 0, at = 0;

    for (int q = 0; q < width; q++) {
        double s = -INFINITY;

        if (d[q] == FAR)
            continue;
        g[q] = d[q] * d[q];
        while (n > 0) {
            const int v = vertex[n - 1];

            s = ((double)g[q] + (double)q * q - ((double)g[v] + (double)v * v)) / (2.0 * (q - v));
            if (s > start[n - 1])
                break;
            n--;
            s = -INFINITY;
        }
        start[n] = s;
        vertex[n++] = q;
    }
    for (int x = 0; x < width; x++) {
        while (at + 1 < n && start[at + 1] <= x)
            at++;
        d[x] = (uint32_t)((x - vertex[at]) * (x - vertex[at])) + g[vertex[at]];
    }
}

/* Twice the area of the triangle of the chain's last two points and (x, y). */
static int64_t turn(const struct sst_hull *h, int x, int y)
{
    const int64_t ax = h->x[h->count - 1] - h->x[h->count - 2], ay = h->y[h->count - 1] - h->y[h->count - 2];

    return ax * (y - h->y[h->count - 2]) - ay * (x - h->x[h->count - 2]);
}

/* Append a point to the chain that began at index `first`; sign is the direction in which it must turn. */
static void chain_append(struct sst_hull *h, int first, int sign, int x, int y)
{
    if (h->count > first && h->x[h->count - 1] == x && h->y[h->count - 1] == y)
        return;
    while (h->count - first >= 2 && turn(h, x, y) * sign <= 0)
        h->count--;
    h->x[h->count] = x;
    h->y[h->count++] = y;
}

void sst_region_extents(uint32_t *extents, const struct sst_map_u8 *label, int value)
{
    for (int y = 0; y < label->height; y++) {
        const uint8_t *row = sst_map_u8_row(label, y);
        const uint8_t *first = memchr(row, value, (size_t)label->width);
        int last = label->width - 1;

        while (first && row[last] != value)
            last--;
        extents[y] = first ? (uint32_t)(first - row) | (uint32_t)last << 16 : SST_EXTENT_NONE;
    }
}

/* Two chains from the top row to the bottom one; a region one pixel wide appears in both, which is harmless. */
void sst_hull_build(struct sst_hull *hull, const uint32_t *extents, int height)
{
    int left_count;

    hull->count = 0;
    for (int y = 0; y < height; y++) {
        if (extents[y] != SST_EXTENT_NONE)
            chain_append(hull, 0, -1, (int)(extents[y] & 0xFFFF), y);
    }
    left_count = hull->count;
    for (int y = 0; y < height; y++) {
        if (extents[y] != SST_EXTENT_NONE)
            chain_append(hull, left_count, 1, (int)(extents[y] >> 16), y);
    }
}

uint32_t sst_hull_farthest(const struct sst_hull *hull, int x, int y)
{
    int32_t best = 0; /* 2 * (SST_IMAGE_MAX_SIDE - 1)^2 < 2^31 */

    for (int i = 0; i < hull->count; i++) {
        const int32_t dx = hull->x[i] - x, dy = hull->y[i] - y, d2 = dx * dx + dy * dy;

        best = d2 > best ? d2 : best;
    }
    return (uint32_t)best;
}
