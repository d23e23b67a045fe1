/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "base/mem.h"
#include "base/thread.h"
#include "pipeline/kernels/kernels.h"
#include "pipeline/method/disparity/stage.h"

/* Rows of column sums in the ring: one above the highest arm, the row itself, and those of the lowest arm. */
#define RING (2 * SST_SUPPORT_MAX_ARM + 2)
#define BAND 48 /* rows of a job */

void sst_disparity_colour_step(uint8_t *out, const struct sst_image *img, struct sst_pixel a, struct sst_pixel b, int n)
{
    const uint8_t *p[3], *q[3];

    for (int c = 0; c < 3; c++) {
        p[c] = sst_image_row(img, c, a.y) + a.x;
        q[c] = sst_image_row(img, c, b.y) + b.x;
    }
    sst_kernels_get()->colour_step_row(out, p, q, (size_t)n);
}

/* Arms, or pixels, of all rows. */
struct all_rows {
    struct sst_support *s;
    const struct sst_image *img;
    int arm, tau;
};

/*
 * Arm lengths of one row towards (dx, dy): an arm stops at the border, at `arm`, and before a pixel that differs by tau
 * or more. One step at a time over the whole row, so that compilers vectorise it.
 */
static void arm_row(uint8_t *length, const struct all_rows *a, int y, int dx, int dy)
{
    const int w = a->img->width, tau = a->tau;
    uint8_t *alive = (uint8_t *)sst_map_u16_row(&a->s->count, y); /* unused until the counts are computed */
    uint8_t *step_size = alive + w;

    memset(length, 0, (size_t)w);
    memset(alive, 1, (size_t)w);
    for (int step = 1; step <= a->arm; step++) {
        const int j = y + step * dy, x0 = sst_max_int(0, -step * dx), x1 = sst_min_int(w, w - step * dx);

        if (j < 0 || j >= a->img->height || x1 <= x0)
            return;
        sst_disparity_colour_step(step_size, a->img, (struct sst_pixel){ x0, y },
                                  (struct sst_pixel){ x0 + step * dx, j }, x1 - x0);
        for (int x = x0; x < x1; x++) {
            alive[x] = (uint8_t)(step_size[x - x0] < tau ? alive[x] : 0);
            length[x] = (uint8_t)(length[x] + alive[x]);
        }
    }
}

/* Add a row's part to the counts of n regions whose arms towards it are given. Not inlined: inside the caller compilers
 * lose the restrict information and use the scalar path. */
static SST_NOINLINE void add_counts(uint16_t *restrict count, const uint8_t *restrict arm, uint8_t needed,
                                    const uint8_t *restrict left, const uint8_t *restrict right, int n)
{
    for (int x = 0; x < n; x++) {
        const uint8_t there = (uint8_t)(arm[x] >= needed ? 255 : 0), pixels = (uint8_t)(1 + left[x] + right[x]);

        count[x] = (uint16_t)(count[x] + (pixels & there));
    }
}

/* Pixels of the regions of row y. */
static void count_row(struct sst_support *s, int y)
{
    const int w = s->count.width, last = sst_min_int(y + SST_SUPPORT_MAX_ARM, s->count.height - 1);
    uint16_t *count = sst_map_u16_row(&s->count, y);

    memset(count, 0, (size_t)w * sizeof(*count));
    for (int j = sst_max_int(y - SST_SUPPORT_MAX_ARM, 0); j <= last; j++)
        add_counts(count, sst_map_u8_row(j < y ? &s->up : &s->down, y), (uint8_t)abs(j - y),
                   sst_map_u8_row(&s->left, j), sst_map_u8_row(&s->right, j), w);
}

static int arms_job(void *arg, int band, int worker SST_UNUSED)
{
    const struct all_rows *a = arg;
    struct sst_support *s = a->s;

    for (int y = band * BAND; y < sst_min_int((band + 1) * BAND, a->img->height); y++) {
        arm_row(sst_map_u8_row(&s->left, y), a, y, -1, 0);
        arm_row(sst_map_u8_row(&s->right, y), a, y, 1, 0);
        arm_row(sst_map_u8_row(&s->up, y), a, y, 0, -1);
        arm_row(sst_map_u8_row(&s->down, y), a, y, 0, 1);
    }
    return 0;
}

static int counts_job(void *arg, int band, int worker SST_UNUSED)
{
    const struct all_rows *a = arg;

    for (int y = band * BAND; y < sst_min_int((band + 1) * BAND, a->img->height); y++)
        count_row(a->s, y);
    return 0;
}

int sst_disparity_support_init(struct sst_support *s, const struct sst_image *img, int arm, int tau, int threads)
{
    const int w = img->width, h = img->height, bands = (h + BAND - 1) / BAND;
    struct sst_support made = { 0 };
    struct all_rows all = { &made, img, arm, tau };
    int err = sst_map_u8_init(&made.left, w, h);

    err = err ? err : sst_map_u8_init(&made.right, w, h);
    err = err ? err : sst_map_u8_init(&made.up, w, h);
    err = err ? err : sst_map_u8_init(&made.down, w, h);
    err = err ? err : sst_map_u16_init(&made.count, w, h);
    err = err ? err : sst_parallel_for(bands, threads, arms_job, &all);
    err = err ? err : sst_parallel_for(bands, threads, counts_job, &all);
    if (err)
        sst_disparity_support_fini(&made);
    else
        *s = made;
    return err;
}

void sst_disparity_support_fini(struct sst_support *s)
{
    sst_map_u8_fini(&s->left);
    sst_map_u8_fini(&s->right);
    sst_map_u8_fini(&s->up);
    sst_map_u8_fini(&s->down);
    sst_map_u16_fini(&s->count);
}

/* Arms of row y of a volume, at most to its borders. */
static void clip_arms(uint8_t *left, uint8_t *right, const struct sst_volume *v, const struct sst_support *s, int y)
{
    const uint8_t *l = sst_map_u8_row(&s->left, v->y0 + y) + v->x0, *r = sst_map_u8_row(&s->right, v->y0 + y) + v->x0;

    for (int x = 0; x < v->width; x++) {
        left[x] = (uint8_t)sst_min_int(l[x], x);
        right[x] = (uint8_t)sst_min_int(r[x], v->width - 1 - x);
    }
}

/* Costs of row y of a band: of the volume, or of the rows beside it as they were. */
static const uint8_t *costs_of(const struct sst_volume *v, int y, const uint8_t *above, const uint8_t *below)
{
    const size_t row_cells = v->width_padded * v->steps_padded;

    if (y < 0)
        return above + (size_t)(y + SST_SUPPORT_MAX_ARM) * row_cells;
    return y < v->height ? v->cost + (size_t)y * row_cells : below + (size_t)(y - v->height) * row_cells;
}

int sst_disparity_support_band(struct sst_volume *v, const struct sst_support *s, const uint8_t *above,
                               const uint8_t *below)
{
    const struct sst_kernels *k = sst_kernels_get();
    const size_t n = (size_t)v->width, nd = v->steps_padded, row_cells = v->width_padded * nd;
    const int arm = SST_SUPPORT_MAX_ARM, first = above ? -arm : 0, end = v->height + (below ? arm : 0);
    uint16_t *ring = sst_mem_keep(&v->lines, RING * row_cells + (n + 1) * nd + n, sizeof(uint16_t)), *prefix;
    uint8_t *left, *right;

    if (!ring)
        return -ENOMEM;
    prefix = ring + RING * row_cells;
    left = (uint8_t *)(prefix + (n + 1) * nd);
    right = left + n;
    /* the row above the first */
    memset(ring + (size_t)((first - 1 + 2 * RING) % RING) * row_cells, 0, row_cells * sizeof(*ring));
    for (int next = first, y = 0; y < v->height; y++) {
        const uint16_t *rows[RING], *const *at = rows + arm + 1;

        for (; next < end && next <= y + arm; next++) {
            clip_arms(left, right, v, s, next);
            k->support_sum_row(ring + (size_t)((next + RING) % RING) * row_cells,
                               ring + (size_t)((next + 2 * RING - 1) % RING) * row_cells, prefix,
                               costs_of(v, next, above, below), left, right, n, nd);
        }
        for (int j = -arm - 1; j <= arm; j++)
            rows[j + arm + 1] = ring + (size_t)((y + j + 2 * RING) % RING) * row_cells;
        k->support_mean_row(v->cost + (size_t)y * row_cells, at, sst_map_u8_row(&s->up, v->y0 + y) + v->x0,
                            sst_map_u8_row(&s->down, v->y0 + y) + v->x0, sst_map_u16_row(&s->count, v->y0 + y) + v->x0,
                            n, nd);
    }
    return 0;
}

int sst_disparity_support_aggregate(struct sst_volume *v, const struct sst_support *s, int rounds)
{
    int err = 0;

    for (int round = 0; !err && round < rounds; round++)
        err = sst_disparity_support_band(v, s, NULL, NULL);
    return err;
}
