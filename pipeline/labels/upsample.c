#include "pipeline/labels/upsample.h"

#include <errno.h>
#include <string.h>

#include "base/mem.h"
#include "base/thread.h"
#include "pipeline/kernels/kernels.h"
#include "pipeline/labels/classes.h"

#define BLOCK SST_CLASS_ROW_MAX

/* Scratch of one worker. */
struct scratch {
    float prob[SST_MAX_CLASSES * BLOCK], entropy[BLOCK];
    uint8_t top[BLOCK];
};

struct job {
    const struct sst_kernels *kernels;
    const struct sst_class_grid *grid;
    struct sst_map_u8 *label;
    struct sst_map_f32 *entropy; /* or NULL */
    float *prob;                 /* or NULL */
    int32_t *left;               /* [width] cell at or before a pixel */
    float *part;                 /* [width] and the way to the next */
    uint8_t *winner;             /* [height of the grid][width of the grid] label */
    float *rows;                 /* [worker][count][width of the grid + 1] */
    uint8_t *sure;               /* [worker][width of the grid]: label of all pixels between two columns, or 0 */
    struct scratch *scratch;     /* [worker] */
};

/* Half-pixel centres: cell at or before output i, and the way to the next. */
static int place(int i, int from, int to, float *part)
{
    const double at = sst_clamp_double((i + 0.5) * from / to - 0.5, 0, from - 1);

    *part = (float)(at - (int)at);
    return (int)at;
}

/* The grid's rows around an output row, blended. A column that repeats the last one stands at its right. */
static void blend_rows(float *row, const struct sst_class_grid *g, int y, float part)
{
    const size_t n = (size_t)g->width;

    for (size_t c = 0; c < (size_t)g->count; c++) {
        const float *a = g->prob + ((size_t)y * (size_t)g->count + c) * n;
        const float *b = y + 1 < g->height ? a + (size_t)g->count * n : a;
        float *out = row + c * (n + 1);

        for (size_t x = 0; x < n; x++)
            out[x] = a[x] + part * (b[x] - a[x]);
        out[n] = out[n - 1];
    }
}

static void find_sure(uint8_t *sure, const struct job *j, int y)
{
    const int w = j->grid->width;
    const uint8_t *a = j->winner + (size_t)y * (size_t)w, *b = y + 1 < j->grid->height ? a + w : a;

    for (int x = 0; x < w; x++) {
        const int r = sst_min_int(x + 1, w - 1);

        sure[x] = a[x] == a[r] && a[x] == b[x] && a[x] == b[r] ? a[x] : 0;
    }
}

/* Classes and entropies of n pixels of row y from column x on. */
static void finish_block(const struct job *j, struct scratch *s, const float *row, const uint8_t *sure, int y, int x, int n)
{
    const int32_t *left = j->left + x;
    const size_t count = (size_t)j->grid->count, cells = (size_t)j->grid->width + 1;
    uint8_t *label = sst_map_u8_row(j->label, y) + x;
    bool all_sure = true;

    for (int i = 0; i < n; i++) {
        label[i] = sure[left[i]];
        all_sure &= label[i] != 0;
    }
    if (all_sure && !j->entropy && !j->prob)
        return;
    for (size_t c = 0; c < count; c++)
        j->kernels->stretch_row(s->prob + c * BLOCK, row + c * cells, left, j->part + x, (size_t)n);
    j->kernels->class_row(s->top, j->entropy ? s->entropy : NULL, s->prob, BLOCK, count, (size_t)n);
    for (int i = 0; i < n; i++)
        label[i] = label[i] ? label[i] : (uint8_t)(s->top[i] + 1);
    if (j->entropy)
        memcpy(sst_map_f32_row(j->entropy, y) + x, s->entropy, (size_t)n * sizeof(float));
    for (size_t c = 0; j->prob && c < count; c++)
        memcpy(j->prob + (c * (size_t)j->label->height + (size_t)y) * (size_t)j->label->width + (size_t)x,
               s->prob + c * BLOCK, (size_t)n * sizeof(float));
}

static int finish_row(void *arg, int y, int worker)
{
    const struct job *j = arg;
    const struct sst_class_grid *g = j->grid;
    float *row = j->rows + (size_t)worker * (size_t)g->count * ((size_t)g->width + 1), part;
    uint8_t *sure = j->sure + (size_t)worker * (size_t)g->width;
    const int at = place(y, g->height, j->label->height, &part);

    blend_rows(row, g, at, part);
    find_sure(sure, j, at);
    for (int x = 0; x < j->label->width; x += BLOCK)
        finish_block(j, &j->scratch[worker], row, sure, y, x, sst_min_int(BLOCK, j->label->width - x));
    return 0;
}

/* Winners of a row of the grid. */
static int find_winners(void *arg, int y, int worker SST_UNUSED)
{
    const struct job *j = arg;
    const size_t n = (size_t)j->grid->width;
    const float *p = j->grid->prob + (size_t)y * (size_t)j->grid->count * n;
    uint8_t *out = j->winner + (size_t)y * n;

    for (size_t x = 0; x < n; x += BLOCK)
        j->kernels->class_row(out + x, NULL, p + x, n, (size_t)j->grid->count, n - x < BLOCK ? n - x : BLOCK);
    for (size_t x = 0; x < n; x++)
        out[x]++;
    return 0;
}

int sst_upsample(struct sst_map_u8 *label, struct sst_map_f32 *entropy, float *prob, const struct sst_class_grid *grid,
                 int threads)
{
    const size_t workers = (size_t)sst_thread_count(threads), cells = (size_t)grid->width;
    struct job j = { .kernels = sst_kernels_get(), .grid = grid, .label = label, .entropy = entropy, .prob = prob };
    int err = -ENOMEM;

    j.left = sst_mem_alloc_raw((size_t)label->width, sizeof(*j.left));
    j.part = sst_mem_alloc_raw((size_t)label->width, sizeof(*j.part));
    j.winner = sst_mem_alloc_raw(cells * (size_t)grid->height, 1);
    j.rows = sst_mem_alloc_raw(workers * (size_t)grid->count * (cells + 1), sizeof(*j.rows));
    j.sure = sst_mem_alloc_raw(workers * cells, 1);
    j.scratch = sst_mem_alloc_raw(workers, sizeof(*j.scratch));
    if (j.left && j.part && j.winner && j.rows && j.sure && j.scratch) {
        for (int x = 0; x < label->width; x++)
            j.left[x] = place(x, grid->width, label->width, &j.part[x]);
        err = sst_parallel_for(grid->height, threads, find_winners, &j);
        err = err ? err : sst_parallel_for(label->height, threads, finish_row, &j);
    }
    sst_mem_free(j.left);
    sst_mem_free(j.part);
    sst_mem_free(j.winner);
    sst_mem_free(j.rows);
    sst_mem_free(j.sure);
    sst_mem_free(j.scratch);
    return err;
}
