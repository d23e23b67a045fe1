/* Scores of all views summed on planes of equal disparity: what differs on a plane adds up there, what differs
 * elsewhere is spread over it. */
#include <errno.h>
#include <string.h>

#include "base/mem.h"
#include "base/thread.h"
#include "pipeline/live/hidden/hidden_internal.h"

#define STEP_CELLS 1.5  /* by which the outermost view moves from plane to plane */
#define BEFORE     2.5  /* planes: what is nearer by this stands before a plane */
#define FOLLOW     0.05 /* of what usually stands there, in a set */
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

/* --- what stands before them ---------------------------------------------------------------------------------------
 */

/* The part of a block that is nearer than a plane: of four pixels. What passes in front of the views does not count,
 * only what usually stands there. */
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

void hidden_planes_cover(struct hidden_planes *p, const struct sst_hidden_input *in, int step)
{
    const size_t w = (size_t)p->cols + 1;

    for (int plane = 0; plane < p->count; plane++) {
        float *sums = p->nearer + (size_t)plane * w * ((size_t)p->rows + 1);
        const double front_px = p->disp_px[plane] + BEFORE * p->step_px;
        const int least = (int)lround((front_px - in->disp_min_px) * SST_DISP_SCALE);
        float *usually = p->usually + (size_t)plane * (size_t)p->rows * (size_t)p->cols;

        for (int row = 0; row < p->rows; row++) {
            float sum = 0;

            for (int col = 0; col < p->cols; col++) {
                const float now =
                    in->disp ? nearer_part(in->disp, col, row, step, least) : (float)(front_px <= in->front_px);
                float *before = &usually[row * p->cols + col];

                *before += p->covered ? (float)FOLLOW * (now - *before) : now - *before;
                sum += now < *before ? now : *before;
                sums[(size_t)(row + 1) * w + (size_t)col + 1] = sums[(size_t)row * w + (size_t)col + 1] + sum;
            }
        }
    }
    p->covered = true;
}

bool hidden_planes_is_behind(const struct hidden_planes *p, int plane, const struct hidden_rect *r)
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
    const struct sst_map_u8 *const *score;
    const double *dx, *dy;
    int views;
};

static void add_row(uint16_t *restrict sum, const uint8_t *restrict score, int n)
{
    for (int x = 0; x < n; x++)
        sum[x] = (uint16_t)(sum[x] + score[x]);
}

/* Means of the blocks of a row of blocks, from its sums. */
static void reduce(float *mean, const uint16_t *sum, int width, int rows, int cols)
{
    for (int col = 0; col < cols; col++) {
        const int x1 = sst_min_int((col + 1) * HIDDEN_BLOCK, width);
        uint32_t all = 0;

        for (int y = 0; y < rows; y++)
            for (int x = col * HIDDEN_BLOCK; x < x1; x++)
                all += sum[y * width + x];
        mean[col] = (float)all / (HIDDEN_BLOCK * HIDDEN_BLOCK);
    }
}

static int sum_plane(void *arg, int plane, int worker SST_UNUSED)
{
    const struct job *j = arg;
    struct hidden_planes *p = j->p;
    uint16_t sum[HIDDEN_BLOCK * (HIDDEN_WIDTH + HIDDEN_BLOCK)];
    const double disp_px = p->disp_px[plane];

    for (int block = 0; block < p->rows; block++) {
        const size_t at = ((size_t)plane * (size_t)p->rows + (size_t)block) * (size_t)p->cols;
        const int rows = sst_min_int(HIDDEN_BLOCK, p->height - block * HIDDEN_BLOCK);

        memset(sum, 0, sizeof(sum));
        for (int k = 0; k < j->views; k++) {
            const int sx = (int)lround(disp_px * j->dx[k]), sy = (int)lround(disp_px * j->dy[k]);
            const int x0 = sst_max_int(0, sx), x1 = sst_min_int(p->width, p->width + sx);

            for (int y = 0; y < rows && j->score[k] && x0 < x1; y++) {
                const int from = block * HIDDEN_BLOCK + y - sy;

                if (from >= 0 && from < p->height)
                    add_row(sum + (size_t)y * (size_t)p->width + x0, sst_map_u8_row(j->score[k], from) + (x0 - sx),
                            x1 - x0);
            }
        }
        reduce(p->mean + at, sum, p->width, rows, p->cols);
    }
    return 0;
}

int hidden_planes_sum(struct hidden_planes *p, const struct sst_map_u8 *const *score, int views, const double *dx,
                      const double *dy, int threads)
{
    struct job j = { p, score, dx, dy, views };

    return sst_parallel_for(p->count, threads, sum_plane, &j);
}
