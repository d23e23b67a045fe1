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
 * one along the row. */
struct paths {
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
        sst_colour_step_row(out + x0, img, y, x0, y + dy, x0 + dx, x1 - x0);
}

/* All paths that come from above (dir 1, rows top down) or below (dir -1, rows bottom up), and one along the row. */
static void sweep(struct sst_volume *v, const struct sst_image *img, int slants, int dir, struct paths *p)
{
    const struct sst_kernels *k = sst_kernels_get();
    const size_t n = (size_t)v->width, nd = v->steps_padded, row_cells = v->width_padded * nd;
    const size_t line_bytes = (n + 2) * (nd + 2 * SST_SGM_PAD) * sizeof(uint16_t);

    for (int s = 0; s < slants; s++) {
        memset(p->last[s], 0, line_bytes);
        memset(p->now[s], 0, line_bytes);
    }
    memset(p->line, 0, line_bytes);
    for (int i = 0; i < v->height; i++) {
        const int y = dir > 0 ? i : v->height - 1 - i;
        uint16_t *sum = v->sum + (size_t)y * row_cells;
        const uint8_t *cost = v->cost + (size_t)y * row_cells;

        penalty_row(p->penalty, img, y, -dir, 0);
        k->sgm_along_row(p->line, sum, cost, p->penalty, p->by_step.p1, p->by_step.p2, dir, dir > 0, n, nd);
        for (int s = 0; s < slants; s++) {
            const int dx = slants == 1 ? 0 : s - 1;
            uint16_t *swap = p->last[s];

            penalty_row(p->penalty, img, y, dx, -dir);
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
    struct paths p;
    const size_t lines = (size_t)(2 * slants + 1) * line;
    uint16_t *rows = sst_mem_keep(&v->lines, lines + (size_t)v->width, sizeof(uint16_t));

    if (!rows)
        return -ENOMEM;
    p.penalty = (uint8_t *)(rows + lines);
    for (int s = 0; s < slants; s++) {
        p.now[s] = rows + (size_t)(2 * s) * line;
        p.last[s] = p.now[s] + line;
    }
    p.line = rows + (size_t)(2 * slants) * line;
    sst_disparity_sgm_penalties_init(&p.by_step, cfg);
    sweep(v, img, slants, 1, &p);
    sweep(v, img, slants, -1, &p);
    return 0;
}

int sst_disparity_sgm_row(struct sst_volume *v, const struct sst_image *img,
                          const struct sst_disparity_sgm_penalties *p, int y, struct sst_mem_kept *lines)
{
    const struct sst_kernels *k = sst_kernels_get();
    const size_t n = (size_t)v->width, nd = v->steps_padded, cells = (size_t)y * v->width_padded * nd;
    const size_t line = sst_sgm_line(v), entry = nd + 2 * SST_SGM_PAD;
    uint16_t *paths = sst_mem_keep(lines, line + n, sizeof(*paths));
    uint8_t *penalty = (uint8_t *)(paths + line);

    if (!paths)
        return -ENOMEM;
    for (int dir = 1; dir >= -1; dir -= 2) {
        /* Only the entries before the first and behind the last pixel are read before they are written. */
        memset(paths, 0, entry * sizeof(*paths));
        memset(paths + line - entry, 0, entry * sizeof(*paths));
        penalty_row(penalty, img, y, -dir, 0);
        k->sgm_along_row(paths, v->sum + cells, v->cost + cells, penalty, p->p1, p->p2, dir, dir > 0, n, nd);
    }
    return 0;
}

int sst_disparity_sgm_columns(struct sst_volume *v, const struct sst_image *img,
                              const struct sst_disparity_sgm_penalties *p, int x0, int x1, struct sst_mem_kept *lines)
{
    const struct sst_kernels *k = sst_kernels_get();
    const size_t n = (size_t)(x1 - x0), nd = v->steps_padded, line = (n + 2) * (nd + 2 * SST_SGM_PAD);
    uint16_t *paths = sst_mem_keep(lines, 2 * line + n, sizeof(*paths));
    uint8_t *penalty = (uint8_t *)(paths + 2 * line);

    if (!paths)
        return -ENOMEM;
    for (int dir = 1; dir >= -1; dir -= 2) {
        memset(paths, 0, 2 * line * sizeof(*paths));
        for (int i = 0; i < v->height; i++) {
            const int y = dir > 0 ? i : v->height - 1 - i;
            const size_t cells = ((size_t)y * v->width_padded + (size_t)x0) * nd;

            memset(penalty, 0, n);
            if (i > 0)
                sst_colour_step_row(penalty, img, y, x0, y - dir, x0, (int)n);
            k->sgm_across_row(paths + (size_t)(i % 2) * line, paths + (size_t)((i + 1) % 2) * line, v->sum + cells,
                              v->cost + cells, penalty, p->p1, p->p2, 0, 0, n, nd);
        }
    }
    return 0;
}

int sst_disparity_sgm_slanted(struct sst_volume *v, const struct sst_image *img,
                              const struct sst_disparity_sgm_penalties *p, int dir, int first,
                              struct sst_mem_kept *lines)
{
    const struct sst_kernels *k = sst_kernels_get();
    const size_t n = (size_t)v->width, nd = v->steps_padded, row_cells = v->width_padded * nd, line = sst_sgm_line(v);
    uint16_t *paths = sst_mem_keep(lines, 6 * line + n, sizeof(*paths));
    uint8_t *penalty = (uint8_t *)(paths + 6 * line);

    if (!paths)
        return -ENOMEM;
    memset(paths, 0, 6 * line * sizeof(*paths));
    for (int i = 0; i < v->height; i++) {
        const int y = dir > 0 ? i : v->height - 1 - i;

        for (int s = 0; s < 3; s++) {
            uint16_t *now = paths + (size_t)(2 * s + i % 2) * line, *last = paths + (size_t)(2 * s + 1 - i % 2) * line;

            penalty_row(penalty, img, y, s - 1, -dir);
            k->sgm_across_row(now, last, v->sum + (size_t)y * row_cells, v->cost + (size_t)y * row_cells, penalty,
                              p->p1, p->p2, s - 1, first && s == 0, n, nd);
        }
    }
    return 0;
}
