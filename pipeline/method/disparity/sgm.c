/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <assert.h>
#include <errno.h>
#include <string.h>

#include "base/mem.h"
#include "pipeline/kernels/kernels.h"
#include "pipeline/method/disparity/stage.h"

/* L <= SST_COST_MAX + p2 along one path (the predecessor's minimum is subtracted), so 8 of them fit 16 bits, and so
 * does the value for "outside" with p1 added. */
static_assert(8 * (SST_COST_MAX + SST_DISPARITY_MAX_PENALTY) <= 65535, "sums of 8 paths fit uint16_t");
static_assert(SST_SGM_FAR + SST_DISPARITY_MAX_PENALTY <= 65535, "the outside mark plus p1 fits uint16_t");
static_assert(SST_SGM_FAR > SST_COST_MAX + SST_DISPARITY_MAX_PENALTY, "the outside mark is never the minimum");

/* Rows of L of one sweep: three directions (from above left, above, above right), each with this and the last row, and
 * SST_SGM_ROWS along rows. */
struct paths {
    const struct sst_volume *v;
    const struct sst_image *img;
    int top; /* row of the image that the volume begins with */
    uint16_t *now[3], *last[3], *line;
    uint8_t *penalty;
    struct sst_disparity_sgm_penalties by_step;
};

void sst_disparity_sgm_penalties_init(struct sst_disparity_sgm_penalties *p, const struct sst_disparity_config *cfg)
{
    for (int step = 0; step < 256; step++) {
        const int weakened = cfg->edge_step > 0 ? cfg->p2 * cfg->edge_step / (cfg->edge_step + step) : cfg->p2;

        p->p1[step] = (uint16_t)cfg->p1;
        p->p2[step] = (uint16_t)sst_max_int(weakened, cfg->p1);
    }
}

/* Colour step from the predecessor (x + dx, y + dy) into (x, y); 0 where that is outside. */
static void penalty_row(uint8_t *out, const struct sst_image *img, int y, int dx, int dy)
{
    const int x0 = sst_max_int(0, -dx), x1 = sst_min_int(img->width, img->width - dx);

    memset(out, 0, (size_t)img->width);
    if (y + dy >= 0 && y + dy < img->height && x1 > x0)
        sst_disparity_colour_step(out + x0, img, (struct sst_pixel){ x0, y }, (struct sst_pixel){ x0 + dx, y + dy },
                                  x1 - x0);
}

/* Paths along rows y0 .. y0 + rows - 1. */
static void sweep_along(const struct paths *p, int y0, int rows, int dir)
{
    const struct sst_volume *v = p->v;
    const size_t n = (size_t)v->width, row_cells = v->width_padded * v->steps_padded, at = (size_t)y0 * row_cells;

    for (int r = 0; r < rows; r++)
        penalty_row(p->penalty + (size_t)r * n, p->img, p->top + y0 + r, -dir, 0);
    sst_kernels_get()->sgm_along_rows(p->line, v->sum + at, v->cost + at, row_cells, p->penalty, n, p->by_step.p1,
                                      p->by_step.p2, dir, dir > 0, (size_t)rows, n, v->steps_padded);
}

/* All paths that come from above (dir 1, rows top down) or below (dir -1, rows bottom up), and one along the row. */
static void sweep(struct paths *p, int slants, int dir)
{
    const struct sst_volume *v = p->v;
    const struct sst_kernels *k = sst_kernels_get();
    const size_t n = (size_t)v->width, nd = v->steps_padded, row_cells = v->width_padded * nd;
    const size_t line = sst_sgm_line(v);

    for (int s = 0; s < slants; s++) {
        memset(p->last[s], 0, line * sizeof(uint16_t));
        memset(p->now[s], 0, line * sizeof(uint16_t));
    }
    memset(p->line, 0, SST_SGM_ROWS * line * sizeof(uint16_t));
    for (int i = 0; i < v->height; i++) {
        const int y = dir > 0 ? i : v->height - 1 - i, rows = sst_min_int(SST_SGM_ROWS, v->height - i);
        uint16_t *sum = v->sum + (size_t)y * row_cells;
        const uint8_t *cost = v->cost + (size_t)y * row_cells;

        if (i % SST_SGM_ROWS == 0)
            sweep_along(p, dir > 0 ? y : y - rows + 1, rows, dir);
        for (int s = 0; s < slants; s++) {
            const int dx = slants == 1 ? 0 : s - 1;
            uint16_t *swap = p->last[s];

            penalty_row(p->penalty, p->img, y, dx, -dir);
            k->sgm_across_row(p->now[s], p->last[s], sum, cost, p->penalty, p->by_step.p1, p->by_step.p2, dx, 0, n, nd);
            p->last[s] = p->now[s];
            p->now[s] = swap;
        }
    }
}

int sst_disparity_sgm(struct sst_volume *v, const struct sst_image *img, const struct sst_disparity_config *cfg)
{
    const size_t line = sst_sgm_line(v);
    const int slants = cfg->paths == 8 ? 3 : 1;
    struct paths p = { .v = v, .img = img };
    const size_t lines = (size_t)(2 * slants + SST_SGM_ROWS) * line;
    uint16_t *rows = sst_mem_keep(&v->lines, lines + (size_t)v->width * SST_SGM_ROWS, sizeof(uint16_t));

    if (!rows)
        return -ENOMEM;
    p.penalty = (uint8_t *)(rows + lines);
    for (int s = 0; s < slants; s++) {
        p.now[s] = rows + (size_t)(2 * s) * line;
        p.last[s] = p.now[s] + line;
    }
    p.line = rows + (size_t)(2 * slants) * line;
    sst_disparity_sgm_penalties_init(&p.by_step, cfg);
    sweep(&p, slants, 1);
    sweep(&p, slants, -1);
    return 0;
}

int sst_disparity_sgm_along(struct sst_volume *v, const struct sst_image *img, int top,
                            const struct sst_disparity_sgm_penalties *penalties)
{
    const size_t line = sst_sgm_line(v), n = (size_t)v->width;
    uint16_t *rows = sst_mem_keep(&v->lines, 2 * SST_SGM_ROWS * line + n * SST_SGM_ROWS, sizeof(uint16_t));
    struct paths p = { .v = v, .img = img, .top = top, .by_step = *penalties };

    if (!rows)
        return -ENOMEM;
    memset(rows, 0, 2 * SST_SGM_ROWS * line * sizeof(*rows));
    p.penalty = (uint8_t *)(rows + 2 * SST_SGM_ROWS * line);
    for (int y = 0; y < v->height; y += SST_SGM_ROWS) {
        const int some = sst_min_int(SST_SGM_ROWS, v->height - y);

        for (int dir = 1; dir >= -1; dir -= 2) {
            p.line = rows + (dir > 0 ? 0 : SST_SGM_ROWS * line);
            sweep_along(&p, y, some, dir);
        }
    }
    return 0;
}

int sst_disparity_sgm_down(const struct sst_volume *v, const struct sst_image *img, struct sst_rect columns,
                           const struct sst_disparity_sgm_penalties *penalties, struct sst_mem_kept *scratch)
{
    const int x0 = columns.x0, n = columns.x1 - columns.x0;
    const size_t nd = v->steps_padded, row_cells = v->width_padded * nd;
    const size_t line = ((size_t)n + 2) * (nd + 2 * SST_SGM_PAD);
    uint16_t *now = sst_mem_keep(scratch, 2 * line + (size_t)n, sizeof(*now)), *last;
    uint8_t *penalty;

    if (!now)
        return -ENOMEM;
    last = now + line;
    penalty = (uint8_t *)(last + line);
    for (int dir = 1; dir >= -1; dir -= 2) {
        memset(last, 0, line * sizeof(*last));
        for (int i = 0; i < v->height; i++) {
            const int y = dir > 0 ? i : v->height - 1 - i;
            const size_t at = (size_t)y * row_cells + (size_t)x0 * nd;
            uint16_t *swap = last;

            if (i)
                sst_disparity_colour_step(penalty, img, (struct sst_pixel){ x0, y }, (struct sst_pixel){ x0, y - dir },
                                          n);
            else
                memset(penalty, 0, (size_t)n);
            sst_kernels_get()->sgm_across_row(now, last, v->sum + at, v->cost + at, penalty, penalties->p1,
                                              penalties->p2, 0, 0, (size_t)n, nd);
            last = now;
            now = swap;
        }
    }
    return 0;
}
