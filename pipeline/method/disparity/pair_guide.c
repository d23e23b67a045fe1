/* A pair's filled map improved by the image: edges of surfaces lie where colours change, and hidden pixels belong to a
 * farther surface of similar colour. Both are weighted medians of the disparities around a pixel, by
 * colour and distance (see sst_median_votes_row_fn). */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "base/mem.h"
#include "pipeline/kernels/kernels.h"
#include "pipeline/method/disparity/pair_internal.h"

#define BIN_Q6    32 /* disparities are ranked in steps of half a pixel */
#define BINS      (65536 / BIN_Q6)
#define LEVEL_Q6  (4 * 64) /* a hole between surfaces that differ by more is one of the farther one, else of both */
#define HOLE      24       /* columns and rows around a hidden pixel ... */
#define HOLE_STEP 2        /* ... of which every second one votes */
#define LEAST     8        /* fewer tell nothing */

/* Disparities with weights; all weights are 0 between two medians. */
struct votes {
    uint32_t weight[BINS], total;
    int first, last; /* bins in use */
    int count;
};

static void votes_clear(struct votes *v)
{
    for (int i = v->first; i <= v->last; i++)
        v->weight[i] = 0;
    v->total = 0;
    v->first = BINS;
    v->last = -1;
    v->count = 0;
}

static void votes_add(struct votes *v, unsigned disp_q6, uint32_t w)
{
    const int bin = (int)(disp_q6 / BIN_Q6);

    v->weight[bin] += w;
    v->total += w;
    v->first = sst_min_int(v->first, bin);
    v->last = sst_max_int(v->last, bin);
    v->count++;
}

/* Bin of the weighted median; -1 without votes. */
static int votes_median(const struct votes *v)
{
    uint32_t below = 0;

    for (int i = v->first; i <= v->last; i++) {
        below += v->weight[i];
        if (2 * below >= v->total && v->total)
            return i;
    }
    return -1;
}

/* --- edges -------------------------------------------------------------------------------------------------------- */

/* Rows around one, with columns repeated beyond both ends. */
struct window {
    const uint16_t *disp[SST_MEDIAN_SIDE];
    const uint8_t *colour[3][SST_MEDIAN_SIDE];
};

static int contrast_at(const struct window *rows, int x, int j, int i)
{
    int sum = 0;

    for (int c = 0; c < 3; c++)
        sum += abs(rows->colour[c][j][x + i - SST_MEDIAN_REACH] - rows->colour[c][SST_MEDIAN_REACH][x]);
    return sum;
}

/* Mean of the disparities in the weighted median's bin around x. */
static unsigned median_at(struct votes *v, const struct window *rows, int x)
{
    uint64_t sum = 0, total = 0;
    int bin;

    votes_clear(v);
    for (int j = 0; j < SST_MEDIAN_SIDE; j++) {
        for (int i = 0; i < SST_MEDIAN_SIDE; i++) {
            const unsigned d = rows->disp[j][x + i - SST_MEDIAN_REACH];

            if (d != SST_DISP_NONE)
                votes_add(v, d, sst_median_near[j][i] * sst_median_alike(contrast_at(rows, x, j, i)));
        }
    }
    bin = votes_median(v);
    for (int j = 0; j < SST_MEDIAN_SIDE; j++) {
        for (int i = 0; i < SST_MEDIAN_SIDE; i++) {
            const unsigned d = rows->disp[j][x + i - SST_MEDIAN_REACH];

            if (d != SST_DISP_NONE && (int)(d / BIN_Q6) == bin) {
                const uint32_t w = sst_median_near[j][i] * sst_median_alike(contrast_at(rows, x, j, i));

                sum += (uint64_t)w * d;
                total += w;
            }
        }
    }
    return (unsigned)((sum + total / 2) / total); /* the pixel itself has a weight, so total > 0 */
}

/* Do all disparities around a block of pixels lie within SST_MEDIAN_STEP_Q6 of each other? Then each has all votes. */
static bool is_flat(const struct window *rows, int x0)
{
    unsigned least = 65535, most = 0;

    for (int j = 0; j < SST_MEDIAN_SIDE; j++) {
        const uint16_t *d = rows->disp[j] + x0 - SST_MEDIAN_REACH;
        uint16_t low = 65535, high = 0;

        for (int x = 0; x < SST_MEDIAN_BLOCK + 2 * SST_MEDIAN_REACH; x++) {
            low = d[x] < low ? d[x] : low;
            high = d[x] > high ? d[x] : high;
        }
        least = low < least ? low : least;
        most = high > most ? high : most;
    }
    return most - least <= SST_MEDIAN_STEP_Q6;
}

static void median_row(uint16_t *out, const struct window *rows, int width, struct votes *v)
{
    const uint16_t *own = rows->disp[SST_MEDIAN_REACH];
    uint32_t near[SST_MEDIAN_BLOCK], all[SST_MEDIAN_BLOCK];

    for (int x0 = 0; x0 < width; x0 += SST_MEDIAN_BLOCK) {
        const int n = sst_min_int(SST_MEDIAN_BLOCK, width - x0);
        struct window at;

        memcpy(out + x0, own + x0, (size_t)n * sizeof(*out));
        if (is_flat(rows, x0))
            continue;
        for (int j = 0; j < SST_MEDIAN_SIDE; j++) {
            at.disp[j] = rows->disp[j] + x0;
            for (int c = 0; c < 3; c++)
                at.colour[c][j] = rows->colour[c][j] + x0;
        }
        sst_kernels_get()->median_votes_row(near, all, at.disp, at.colour, SST_MEDIAN_BLOCK);
        for (int x = 0; x < n; x++) {
            if (2 * near[x] < all[x] && own[x0 + x] != SST_DISP_NONE) {
                const unsigned d = median_at(v, rows, x0 + x);

                out[x0 + x] = abs((int)d - own[x0 + x]) > SST_MEDIAN_STEP_Q6 ? (uint16_t)d : own[x0 + x];
            }
        }
    }
}

/* Elements of a row with its repeated columns. */
static size_t padded_width(int width)
{
    return (size_t)(width + SST_MEDIAN_BLOCK - 1) / SST_MEDIAN_BLOCK * SST_MEDIAN_BLOCK + 2 * SST_MEDIAN_REACH;
}

/* Copy a row of elements of `size` bytes, its ends repeated. */
static void pad_row(void *to, const void *from, int width, size_t size)
{
    const size_t padded = padded_width(width);
    uint8_t *out = to;
    const uint8_t *in = from;

    memcpy(out + SST_MEDIAN_REACH * size, in, (size_t)width * size);
    for (size_t x = 0; x < SST_MEDIAN_REACH; x++)
        memcpy(out + x * size, in, size);
    for (size_t x = SST_MEDIAN_REACH + (size_t)width; x < padded; x++)
        memcpy(out + x * size, in + (size_t)(width - 1) * size, size);
}

int pair_guided_median(struct sst_map_u16 *out, const struct sst_map_u16 *in, const struct sst_image *img,
                       struct sst_rows part, struct sst_mem_kept *scratch)
{
    const size_t padded = padded_width(in->width), rows = (size_t)(part.y1 - part.y0) + 2 * SST_MEDIAN_REACH;
    const size_t pixels = rows * padded;
    struct votes *v = sst_mem_keep(scratch, sizeof(*v) + pixels * (sizeof(uint16_t) + 3), 1);
    uint16_t *disp = v ? (uint16_t *)(void *)(v + 1) : NULL;
    uint8_t *colour = (uint8_t *)(disp + pixels);

    if (!v)
        return -ENOMEM;
    memset(v, 0, sizeof(*v));
    for (size_t i = 0; i < rows; i++) {
        const int y = sst_clamp_int(part.y0 - SST_MEDIAN_REACH + (int)i, 0, in->height - 1);

        pad_row(disp + i * padded, sst_map_u16_row(in, y), in->width, sizeof(*disp));
        for (int c = 0; c < 3; c++)
            pad_row(colour + ((size_t)c * rows + i) * padded, sst_image_row(img, c, y), in->width, 1);
    }
    for (int y = part.y0; y < part.y1; y++) {
        struct window at;

        for (size_t j = 0; j < SST_MEDIAN_SIDE; j++) {
            const size_t i = (size_t)(y - part.y0) + j;

            at.disp[j] = disp + i * padded + SST_MEDIAN_REACH;
            for (size_t c = 0; c < 3; c++)
                at.colour[c][j] = colour + (c * rows + i) * padded + SST_MEDIAN_REACH;
        }
        median_row(sst_map_u16_row(out, y), &at, in->width, v);
    }
    return 0;
}

/* --- holes -------------------------------------------------------------------------------------------------------- */

/* Shares of pixels by their distance along both axes: 64 exp(-distance / 10 px). */
static const uint8_t hole_share[2 * HOLE + 1] = {
    64, 58, 52, 47, 43, 39, 35, 32, 29, 26, 24, 21, 19, 17, 16, 14, 13, 12, 11, 10, 9, 8, 7, 6, 6,
    5,  5,  4,  4,  4,  3,  3,  3,  2,  2,  2,  2,  2,  1,  1,  1,  1,  1,  1,  1,  1, 1, 1, 1,
};

struct holes {
    const struct sst_map_u16 *disp;
    const struct sst_map_u8 *status;
    const struct sst_image *img;
};

/* Confirmed disparities around (x, y) that are not nearer than the pixel's own, by colour and distance. */
static void hole_votes(struct votes *v, const struct holes *h, int x, int y)
{
    const struct sst_map_u16 *disp = h->disp;
    const int most = sst_map_u16_row(disp, y)[x] + SST_MEDIAN_STEP_Q6;
    int own[3];

    for (int c = 0; c < 3; c++)
        own[c] = sst_image_row(h->img, c, y)[x];
    votes_clear(v);
    for (int j = -HOLE; j <= HOLE; j += HOLE_STEP) {
        const int from = sst_max_int(x - HOLE, (x - HOLE) & (HOLE_STEP - 1)),
                  end = sst_min_int(x + HOLE, disp->width - 1);
        const uint16_t *d;
        const uint8_t *ok, *row[3];

        if (y + j < 0 || y + j >= disp->height)
            continue;
        d = sst_map_u16_row(disp, y + j);
        ok = sst_map_u8_row(h->status, y + j);
        for (int c = 0; c < 3; c++)
            row[c] = sst_image_row(h->img, c, y + j);
        for (int i = from; i <= end; i += HOLE_STEP) {
            int contrast;

            if (ok[i] != SST_DISPARITY_CORRECT || d[i] > most)
                continue;
            contrast = abs(row[0][i] - own[0]) + abs(row[1][i] - own[1]) + abs(row[2][i] - own[2]);
            votes_add(v, d[i], hole_share[abs(i - x) + abs(j)] * sst_median_alike(contrast));
        }
    }
}

/* Nearest confirmed disparity from x on in direction dir; -1: none. */
static int confirmed(const uint16_t *d, const uint8_t *ok, int x, int dir, int width)
{
    while (x >= 0 && x < width && ok[x] != SST_DISPARITY_CORRECT)
        x += dir;
    return x >= 0 && x < width ? d[x] : -1;
}

int pair_fill_alike(struct sst_map_u16 *disp_q6, const struct sst_map_u8 *status, const struct sst_image *img,
                    struct sst_rows rows, struct sst_mem_kept *scratch)
{
    const struct holes holes = { disp_q6, status, img };
    struct votes *v = sst_mem_keep(scratch, sizeof(*v), 1);

    if (!v)
        return -ENOMEM;
    memset(v, 0, sizeof(*v));
    for (int y = rows.y0; y < rows.y1; y++) {
        const uint8_t *ok = sst_map_u8_row(status, y);
        uint16_t *d = sst_map_u16_row(disp_q6, y);
        bool level = false;

        for (int x = 0; x < disp_q6->width; x++) {
            if (ok[x] == SST_DISPARITY_CORRECT || d[x] == SST_DISP_NONE)
                continue;
            if (!x || ok[x - 1] == SST_DISPARITY_CORRECT) { /* a hole begins */
                const int left = confirmed(d, ok, x, -1, disp_q6->width),
                          right = confirmed(d, ok, x, 1, disp_q6->width);

                level = left < 0 || right < 0 || abs(left - right) <= LEVEL_Q6;
            }
            if (level)
                continue;
            hole_votes(v, &holes, x, y);
            if (v->count >= LEAST && v->total)
                d[x] = (uint16_t)(votes_median(v) * BIN_Q6 + BIN_Q6 / 2);
        }
    }
    return 0;
}
