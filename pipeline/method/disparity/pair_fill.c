/* Before the holes of a pair's map are filled: surfaces too small to be believed are dropped, and the margin that the
 * other image does not show continues the plane beside it. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>

#include "base/mem.h"
#include "base/thread.h"
#include "pipeline/method/disparity/pair_internal.h"

#define JOINED_Q6 64 /* neighbours of one surface differ by a pixel at most */
#define BAND      32 /* rows that one thread labels or extends at a time */

static int bands(const struct sst_map_u16 *disp)
{
    return (disp->height + BAND - 1) / BAND;
}

static int band_end(const struct sst_map_u16 *disp, int band)
{
    return sst_min_int((band + 1) * BAND, disp->height);
}

/* --- specks ------------------------------------------------------------------------------------------------------- */

/* Surfaces, numbered band by band, each band from its first pixel's number on: in bands at first, then joined. */
struct surfaces {
    struct sst_map_u8 *status;
    const struct sst_map_u16 *disp;
    uint32_t least;
    uint32_t *label;         /* [pixel] its surface, where it is confirmed */
    uint32_t *parent, *size; /* [surface] one that it is part of, or itself; pixels */
    uint32_t *end;           /* [band] the number after its last surface */
};

/* Pixels that the plane of a margin is fitted to, beside the row's first confirmed one. */
#define PLANE_COLUMNS  48
#define PLANE_ROWS     8          /* to both sides */
#define PLANE_NEAR_Q6  (4 * 64)   /* others are not of that surface */
#define PLANE_LEAST    40         /* fewer carry no slope */
#define PLANE_ERROR_Q6 (0.3 * 64) /* RMS; more is no plane */
#define PLANE_SLOPE_Q6 (0.2 * 64) /* per column; steeper surfaces end before the margin does */

static uint32_t find_root(uint32_t *parent, uint32_t i)
{
    while (parent[i] != i) {
        parent[i] = parent[parent[i]];
        i = parent[i];
    }
    return i;
}

static void join(uint32_t *parent, uint32_t a, uint32_t b)
{
    a = find_root(parent, a);
    b = find_root(parent, b);
    if (a < b)
        parent[b] = a;
    else
        parent[a] = b;
}

static bool one_surface(const struct surfaces *s, int y, int x, int other_y, int other_x)
{
    return sst_map_u8_row(s->status, y)[x] == SST_DISPARITY_CORRECT &&
           sst_map_u8_row(s->status, other_y)[other_x] == SST_DISPARITY_CORRECT &&
           abs(sst_map_u16_row(s->disp, y)[x] - sst_map_u16_row(s->disp, other_y)[other_x]) <= JOINED_Q6;
}

/* Label row y: every pixel gets the surface of its left or upper neighbour in the band, or a new one, `count`.
 * @return the next one */
static uint32_t label_row(const struct surfaces *s, uint32_t count, int y, bool first)
{
    const int w = s->disp->width;
    uint32_t *own = s->label + (size_t)y * (size_t)w;

    for (int x = 0; x < w; x++) {
        bool upper;

        if (sst_map_u8_row(s->status, y)[x] != SST_DISPARITY_CORRECT)
            continue;
        upper = !first && one_surface(s, y, x, y - 1, x);
        if (x > 0 && one_surface(s, y, x, y, x - 1)) {
            own[x] = own[x - 1];
            if (upper && own[x] != own[x - w])
                join(s->parent, own[x], own[x - w]);
        } else if (upper) {
            own[x] = own[x - w];
        } else {
            s->parent[count] = count;
            s->size[count] = 0;
            own[x] = count++;
        }
        s->size[own[x]]++;
    }
    return count;
}

static int label_job(void *arg, int index, int worker)
{
    const struct surfaces *s = arg;
    uint32_t count = (uint32_t)(index * BAND) * (uint32_t)s->disp->width;

    (void)worker;
    for (int y = index * BAND; y < band_end(s->disp, index); y++)
        count = label_row(s, count, y, y == index * BAND);
    s->end[index] = count;
    return 0;
}

/* Join surfaces across the bands' borders, and sum their sizes: the smallest number of a surface has them all. */
static void join_bands(const struct surfaces *s)
{
    const int w = s->disp->width;

    for (int y = BAND; y < s->disp->height; y += BAND) {
        const uint32_t *own = s->label + (size_t)y * (size_t)w;

        for (int x = 0; x < w; x++) {
            if (one_surface(s, y, x, y - 1, x))
                join(s->parent, own[x], own[x - w]);
        }
    }
    for (int band = 0; band < bands(s->disp); band++) {
        for (uint32_t i = (uint32_t)(band * BAND) * (uint32_t)w; i < s->end[band]; i++) {
            const uint32_t root = find_root(s->parent, i);

            s->parent[i] = root;
            if (root != i)
                s->size[root] += s->size[i];
        }
    }
}

static int drop_job(void *arg, int index, int worker)
{
    const struct surfaces *s = arg;
    const size_t w = (size_t)s->disp->width;

    (void)worker;
    for (int y = index * BAND; y < band_end(s->disp, index); y++) {
        uint8_t *status = sst_map_u8_row(s->status, y);
        const uint32_t *own = s->label + (size_t)y * w;

        for (size_t x = 0; x < w; x++) {
            if (status[x] == SST_DISPARITY_CORRECT && s->size[s->parent[own[x]]] < s->least)
                status[x] = SST_DISPARITY_OCCLUSION;
        }
    }
    return 0;
}

int pair_drop_specks(struct sst_map_u8 *status, const struct sst_map_u16 *disp_q6, int least, int threads)
{
    const size_t pixels = (size_t)disp_q6->width * (size_t)disp_q6->height;
    uint32_t *memory = sst_mem_alloc_raw(3 * pixels + (size_t)bands(disp_q6), sizeof(*memory));
    struct surfaces s = { status, disp_q6, (uint32_t)least, memory, NULL, NULL, NULL };
    int err;

    if (!memory)
        return -ENOMEM;
    s.parent = memory + pixels;
    s.size = s.parent + pixels;
    s.end = s.size + pixels;
    err = sst_parallel_for(bands(disp_q6), threads, label_job, &s);
    if (!err) {
        join_bands(&s);
        err = sst_parallel_for(bands(disp_q6), threads, drop_job, &s);
    }
    sst_mem_free(memory);
    return err;
}

/* --- margins ------------------------------------------------------------------------------------------------------ */

/* Sums over the points of a plane: across, down, and the disparity above the anchor's. */
struct sums {
    int64_t n, x, y, z, xx, xy, yy, xz, yz, zz;
};

/* Of row y's anchor at column x0 and the pixels beside it, in direction dir. */
static struct sums sum_points(const struct sst_map_u16 *disp, const struct sst_map_u8 *status, int x0, int y, int dir)
{
    const int anchor = sst_map_u16_row(disp, y)[x0], end = sst_min_int(y + PLANE_ROWS, disp->height - 1);
    const int columns = sst_min_int(PLANE_COLUMNS, dir > 0 ? disp->width - x0 : x0 + 1);
    struct sums s = { 0 };

    for (int j = sst_max_int(y - PLANE_ROWS, 0); j <= end; j++) {
        const uint16_t *d = sst_map_u16_row(disp, j) + x0;
        const uint8_t *ok = sst_map_u8_row(status, j) + x0;
        int n = 0, x = 0, z = 0, xx = 0, xz = 0, zz = 0; /* of the row: 48 points, |z| <= 256 */

        for (int i = 0; i < columns; i++) {
            const int at = d[i * dir] - anchor;

            if (ok[i * dir] != SST_DISPARITY_CORRECT || abs(at) > PLANE_NEAR_Q6)
                continue;
            n++;
            x += i;
            z += at;
            xx += i * i;
            xz += i * at;
            zz += at * at;
        }
        s.n += n;
        s.x += x;
        s.y += (j - y) * n;
        s.z += z;
        s.xx += xx;
        s.xy += (j - y) * x;
        s.yy += (j - y) * (j - y) * n;
        s.xz += xz;
        s.yz += (j - y) * z;
        s.zz += zz;
    }
    return s;
}

/* Slope of the plane along the row, 1/64 px per column away from the margin; 0 where the points are none. */
static double plane_slope(const struct sums *s)
{
    /* Moments about the mean, times n; whole numbers, so exact. */
    const int64_t xx = s->n * s->xx - s->x * s->x, xy = s->n * s->xy - s->x * s->y, yy = s->n * s->yy - s->y * s->y;
    const int64_t xz = s->n * s->xz - s->x * s->z, yz = s->n * s->yz - s->y * s->z, zz = s->n * s->zz - s->z * s->z;
    const double det = (double)xx * (double)yy - (double)xy * (double)xy, n = (double)s->n;
    double across, down, error;

    if (s->n < PLANE_LEAST || det <= 0)
        return 0;
    across = ((double)xz * (double)yy - (double)yz * (double)xy) / det;
    down = ((double)yz * (double)xx - (double)xz * (double)xy) / det;
    error = ((double)zz - across * (double)xz - down * (double)yz) / (n * n);
    return error <= PLANE_ERROR_Q6 * PLANE_ERROR_Q6 && fabs(across) <= PLANE_SLOPE_Q6 ? across : 0;
}

struct margins {
    struct sst_map_u16 *disp;
    struct sst_map_u8 *status;
    int left, right, range; /* the widest margins to both sides, px */
};

/* Columns x0 - dir, x0 - 2 dir ... to the border continue the plane beside x0, the first confirmed one. */
static void extend(const struct margins *m, int x0, int y, int dir)
{
    struct sst_map_u16 *disp = m->disp;
    const struct sums s = sum_points(disp, m->status, x0, y, dir);
    const double slope = plane_slope(&s);
    uint16_t *d = sst_map_u16_row(disp, y);

    for (int i = 1, x = x0 - dir; x >= 0 && x < disp->width; i++, x -= dir)
        d[x] = (uint16_t)sst_clamp_int(d[x0] - (int)lrint(slope * i), 0, 64 * m->range);
}

/* Confirmed columns of a row. @param first, last  out; beyond the widest margin where there is none */
static void confirmed_columns(const struct margins *m, int y, int *first, int *last)
{
    const uint8_t *ok = sst_map_u8_row(m->status, y);
    const int w = m->disp->width;

    *first = 0;
    *last = w - 1;
    while (*first <= m->left && ok[*first] != SST_DISPARITY_CORRECT)
        ++*first;
    while (*last >= w - 1 - m->right && ok[*last] != SST_DISPARITY_CORRECT)
        --*last;
}

static int extend_job(void *arg, int index, int worker)
{
    const struct margins *m = arg;
    const int w = m->disp->width;

    (void)worker;
    for (int y = index * BAND; y < band_end(m->disp, index); y++) {
        int first, last;

        confirmed_columns(m, y, &first, &last);
        if (first > 0 && first <= m->left)
            extend(m, first, y, 1);
        if (last < w - 1 && last >= w - 1 - m->right)
            extend(m, last, y, -1);
    }
    return 0;
}

int pair_extend_margins(struct sst_map_u16 *disp_q6, struct sst_map_u8 *status, int disp_min, int range, int threads)
{
    const int w = disp_q6->width;
    struct margins m = { disp_q6, status, sst_clamp_int(disp_min + range, 0, w - 1), sst_clamp_int(-disp_min, 0, w - 1),
                         range };
    const int err = sst_parallel_for(bands(disp_q6), threads, extend_job, &m);

    /* Only now: what was extended must not support the planes of other rows. */
    for (int y = 0; !err && y < disp_q6->height; y++) {
        uint8_t *s = sst_map_u8_row(status, y);
        int first, last;

        confirmed_columns(&m, y, &first, &last);
        for (int x = 0; first <= m.left && x < first; x++)
            s[x] = SST_DISPARITY_CORRECT;
        for (int x = w - 1; last >= w - 1 - m.right && x > last; x--)
            s[x] = SST_DISPARITY_CORRECT;
    }
    return err;
}
