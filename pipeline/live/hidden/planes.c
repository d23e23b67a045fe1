/* Planes of equal disparity, on which the scores of all views are summed: differences on a plane add up there,
 * differences elsewhere are spread over it. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <string.h>

#include "base/mem.h"
#include "base/thread.h"
#include "pipeline/live/hidden/hidden_internal.h"

#define STEP_CELLS 1.5  /* by which the outermost view moves from plane to plane */
#define BEFORE     2.5  /* planes: a surface nearer by this occludes a plane */
#define FOLLOW     0.05 /* update rate of the usual occluders, in a set */
#define COVERED    0.3  /* of a box */
#define SLACK      2.0  /* planes: a range that moves by less stays */

int hidden_planes_init(struct hidden_planes *p, int width, int height)
{
    size_t blocks;

    *p = (struct hidden_planes){ .width = width,
                                 .height = height,
                                 .cols = (width + HIDDEN_BLOCK - 1) / HIDDEN_BLOCK,
                                 .rows = (height + HIDDEN_BLOCK - 1) / HIDDEN_BLOCK };
    blocks = (size_t)p->cols * (size_t)p->rows;
    p->mean = sst_mem_alloc(HIDDEN_PLANES * blocks, sizeof(*p->mean));
    p->nearer =
        sst_mem_alloc((size_t)HIDDEN_PLANES * (size_t)(p->cols + 1) * (size_t)(p->rows + 1), sizeof(*p->nearer));
    p->usually = sst_mem_alloc(HIDDEN_PLANES * blocks, sizeof(*p->usually));
    return p->mean && p->nearer && p->usually ? 0 : -ENOMEM;
}

void hidden_planes_fini(struct hidden_planes *p)
{
    sst_mem_free(p->mean);
    sst_mem_free(p->nearer);
    sst_mem_free(p->usually);
    *p = (struct hidden_planes){ 0 };
}

bool hidden_planes_choose(struct hidden_planes *p, const struct sst_hidden_input *in, double reach)
{
    const double range = fmax(in->near_px - in->far_px, 0);
    const double step = fmax(STEP_CELLS / fmax(reach, 1e-6), range / (HIDDEN_PLANES - 2));

    const bool same =
        p->count && fabs(in->far_px - p->far_px) < SLACK * step && fabs(in->near_px - p->near_px) < SLACK * step;

    if (!same) {
        p->far_px = in->far_px;
        p->near_px = in->near_px;
        p->covered = false;
        p->step_px = reach > 0 ? step : 1;
        p->count = 0;
        p->disp_px[0] = in->far_px;
        p->count = reach > 0 ? 0 : 1; /* one view: no depth */
        while (reach > 0 && p->count < HIDDEN_PLANES && in->far_px + (p->count - 1) * step <= in->near_px + step / 2) {
            p->disp_px[p->count] = in->far_px + (p->count - 1) * step;
            p->count++;
        }
    }
    return !same;
}

/* --- occluders of planes -------------------------------------------------------------------------------------------
 */

/* Part of a block that is nearer than a plane, of four pixels. Passing objects in front do not count, only the usual
 * occluders. */
static float nearer_part(const struct sst_map_u16 *disp, int col, int row, int step, int least)
{
    const int side = HIDDEN_BLOCK * step;
    int n = 0;

    for (int i = 0; i < 4; i++) {
        const int x = sst_min_int(col * side + side / 4 + i % 2 * side / 2, disp->width - 1);
        const int y = sst_min_int(row * side + side / 4 + i / 2 * side / 2, disp->height - 1);
        const int d = sst_map_u16_row(disp, y)[x];

        n += d != SST_DISP_NONE && d > least;
    }
    return (float)n / 4;
}

struct cover {
    struct hidden_planes *p;
    const struct sst_hidden_input *in;
    int step;
};

static int cover_plane(void *arg, int plane, int worker SST_UNUSED)
{
    const struct cover *c = arg;
    const struct hidden_planes *p = c->p;
    const struct sst_hidden_input *in = c->in;
    const size_t w = (size_t)p->cols + 1;
    float *sums = p->nearer + (size_t)plane * w * ((size_t)p->rows + 1);
    const double front_px = p->disp_px[plane] + BEFORE * p->step_px;
    const int least = (int)lround((front_px - in->disp_min_px) * SST_DISP_SCALE);
    float *usually = p->usually + (size_t)plane * (size_t)p->rows * (size_t)p->cols;

    for (int row = 0; row < p->rows; row++) {
        float sum = 0;

        for (int col = 0; col < p->cols; col++) {
            const float now =
                in->disp ? nearer_part(in->disp, col, row, c->step, least) : (float)(front_px <= in->front_px);
            float *before = &usually[row * p->cols + col];

            *before += p->covered ? (float)FOLLOW * (now - *before) : now - *before;
            sum += now < *before ? now : *before;
            sums[(size_t)(row + 1) * w + (size_t)col + 1] = sums[(size_t)row * w + (size_t)col + 1] + sum;
        }
    }
    return 0;
}

int hidden_planes_cover(struct hidden_planes *p, const struct sst_hidden_input *in, int step, int threads)
{
    struct cover c = { p, in, step };
    const int err = sst_parallel_for(p->count, threads, cover_plane, &c);

    p->covered = true;
    return err;
}

bool hidden_planes_is_behind(const struct hidden_planes *p, int plane, const struct sst_rect *r)
{
    const int w = p->cols + 1;
    const float *sums = p->nearer + (size_t)plane * (size_t)w * ((size_t)p->rows + 1);
    const float part =
        sums[r->y1 * w + r->x1] - sums[r->y1 * w + r->x0] - sums[r->y0 * w + r->x1] + sums[r->y0 * w + r->x0];

    return part >= (float)COVERED * (float)((r->x1 - r->x0) * (r->y1 - r->y0));
}

/* --- sums -----------------------------------------------------------------------------------------------------------
 */

struct job {
    struct hidden_planes *p;
    const struct hidden_model *const *model;
    int views;
};

/* Cells of row y of a view that may have scores, the ones in hot tiles. @return false: none */
static bool scored(const struct hidden_model *m, int y, int *x0, int *x1)
{
    const uint8_t *hot = m->hot + (size_t)(y / m->tile) * (size_t)m->tiles_x;

    *x0 = 0;
    *x1 = m->tiles_x;
    while (*x0 < *x1 && !hot[*x0])
        ++*x0;
    while (*x1 > *x0 && !hot[*x1 - 1])
        --*x1;
    *x0 *= m->tile;
    *x1 = sst_min_int(*x1 * m->tile, m->score.width);
    return *x0 < *x1;
}

/* Sums of four rows of cells over all views on a plane; then means of blocks. */
static void sum_blocks(const struct job *j, int plane, int block)
{
    const struct hidden_planes *p = j->p;
    const struct sst_kernels *kernels = sst_kernels_get();
    const int rows = sst_min_int(HIDDEN_BLOCK, p->height - block * HIDDEN_BLOCK);
    float *mean = p->mean + ((size_t)plane * (size_t)p->rows + (size_t)block) * (size_t)p->cols;
    uint16_t sum[HIDDEN_WIDTH + HIDDEN_BLOCK] = { 0 };

    for (int k = 0; k < j->views; k++) {
        const int sx = p->shift[plane][k][0], sy = p->shift[plane][k][1];

        for (int y = 0; y < rows && j->model[k]; y++) {
            const int from = block * HIDDEN_BLOCK + y - sy;
            int x0, x1;

            if (from < 0 || from >= p->height || !scored(j->model[k], from, &x0, &x1))
                continue;
            x0 = sst_max_int(x0, -sx);
            x1 = sst_min_int(x1, p->width - sx);
            if (x0 < x1)
                kernels->score_add(sum + x0 + sx, sst_map_u8_row(&j->model[k]->score, from) + x0, (size_t)(x1 - x0));
        }
    }
    for (int col = 0; col < p->cols; col++) {
        const uint16_t *s = sum + (size_t)col * HIDDEN_BLOCK;

        mean[col] = (float)(s[0] + s[1] + s[2] + s[3]) / (HIDDEN_BLOCK * HIDDEN_BLOCK);
    }
}

/* All planes of a row of blocks, so that the rows read of the views stay in cache. */
static int sum_row(void *arg, int block, int worker SST_UNUSED)
{
    const struct job *j = arg;

    _Static_assert(HIDDEN_BLOCK == 4, "sums of four cells");
    _Static_assert((long)SST_MAX_VIEWS * HIDDEN_BLOCK * SST_SCORE_CAP <= UINT16_MAX, "sums fit");
    for (int plane = 0; plane < j->p->count; plane++)
        sum_blocks(j, plane, block);
    return 0;
}

int hidden_planes_sum(struct hidden_planes *p, const struct hidden_views *v, int threads)
{
    struct job j = { p, v->model, v->views };

    for (int plane = 0; plane < p->count; plane++) {
        for (int k = 0; k < v->views; k++) {
            p->shift[plane][k][0] = (int)lround(p->disp_px[plane] * v->dx[k]);
            p->shift[plane][k][1] = (int)lround(p->disp_px[plane] * v->dy[k]);
        }
    }
    return sst_parallel_for(p->rows, threads, sum_row, &j);
}
