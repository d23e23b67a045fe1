/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/method/labels/labels_internal.h"

#include <errno.h>
#include <math.h>
#include <string.h>

#include "base/mem.h"
#include "base/thread.h"
#include "pipeline/image/classes.h"
#include "pipeline/kernels/kernels.h"

#define BLOCK SST_CLASS_ROW_MAX
#define SPREAD                                                                                                         \
    0.7 /* in cells: deviation of the distance weight; with SST_GUIDE_SIGMA the best of docs/design/method.md */

/* Scratch of one worker. */
struct scratch {
    float cells[BLOCK * (SST_MAX_CLASSES + SST_GUIDE_VALUES)]; /* [pixel][values] */
    float prob[SST_MAX_CLASSES * BLOCK], entropy[BLOCK];       /* [class][pixel] */
    uint8_t top[BLOCK];
};

struct job {
    const struct sst_kernels *kernels;
    const struct class_grid *grid;
    const struct sst_image *img;
    struct upsampled out;
    float *colour;   /* [3][height of the grid][width of the grid] */
    int32_t *left;   /* [width] column of the grid at or before a pixel */
    float *across;   /* [width][16] weights of the columns, the same in every row of four */
    uint8_t *winner; /* [height of the grid][width of the grid] label */
    uint8_t *single; /* [worker][width of the grid]: the only label of the pixels from a column to the next, or 0 */
    struct scratch *scratch; /* [worker] */
};

/* A row of pixels in work. */
struct row {
    const struct job *job;
    struct scratch *scratch;
    const uint8_t *single; /* of the row; see struct job */
    int y, cell_y;         /* cell_y: row of the grid at or before it */
    struct sst_guide guide;
};

size_t class_grid_values(int count)
{
    return ((size_t)count + SST_GUIDE_VALUES) / SST_GUIDE_VALUES * SST_GUIDE_VALUES;
}

/* Half-pixel centres: cell at or before output i, and the weights of it, the one before it and the two after it. */
static int place(int i, int from, int to, float weight[4])
{
    const double at = sst_clamp_double((i + 0.5) * from / to - 0.5, 0, from - 1);
    const int lo = (int)at;

    for (int k = 0; k < 4; k++) {
        const double d = at - (lo - 1 + k);

        weight[k] = (float)exp(-d * d / (2 * SPREAD * SPREAD));
    }
    return lo;
}

/* Cells outside the grid repeat the nearest ones inside. */
static size_t cell_at(const struct class_grid *g, int x, int y)
{
    return (size_t)sst_clamp_int(y, 0, g->height - 1) * (size_t)g->width + (size_t)sst_clamp_int(x, 0, g->width - 1);
}

static void find_single(uint8_t *single, const struct job *j, int y)
{
    for (int x = 0; x < j->grid->width; x++) {
        single[x] = j->winner[cell_at(j->grid, x, y)];
        for (int k = 0; k < 16; k++)
            single[x] = j->winner[cell_at(j->grid, x - 1 + k % 4, y - 1 + k / 4)] == single[x] ? single[x] : 0;
    }
}

/* The cells around the pixels between column x, row y of the grid and the next. */
static void set_cells(struct sst_guide *g, const struct job *j, int x, int y)
{
    const size_t plane = (size_t)j->grid->width * (size_t)j->grid->height;

    for (int k = 0; k < 16; k++) {
        const size_t at = cell_at(j->grid, x - 1 + k % 4, y - 1 + k / 4);

        g->cell[k] = j->grid->cell + at * g->values;
        for (size_t c = 0; c < 3; c++)
            g->colour[c][k] = j->colour[c * plane + at];
    }
}

/* Distributions of n pixels of a row from column x on, into its scratch. */
static void mix_cells(struct row *r, int x, int n)
{
    const struct job *j = r->job;
    struct scratch *s = r->scratch;
    struct sst_guide *g = &r->guide;
    const size_t count = (size_t)j->grid->count;

    for (int i = 0, run; i < n; i += run) {
        for (run = 1; i + run < n && j->left[x + i + run] == j->left[x + i];)
            run++;
        set_cells(g, j, j->left[x + i], r->cell_y);
        g->across = j->across + 16 * (size_t)(x + i);
        for (int c = 0; c < 3; c++)
            g->pixel[c] = sst_image_row(j->img, c, r->y) + x + i;
        j->kernels->guide_cells(s->cells + (size_t)i * g->values, g, (size_t)run);
    }
    for (int i = 0; i < n; i++) {
        const float *cell = s->cells + (size_t)i * g->values, scale = 1 / cell[count]; /* weights are above 0 */

        for (size_t c = 0; c < count; c++)
            s->prob[c * BLOCK + (size_t)i] = cell[c] * scale;
    }
}

/* Classes and entropies of n pixels of a row from column x on. */
static void finish_block(struct row *r, int x, int n)
{
    const struct job *j = r->job;
    struct scratch *s = r->scratch;
    uint8_t *label = sst_map_u8_row(j->out.label, r->y) + x;
    const size_t count = (size_t)j->grid->count, width = (size_t)j->out.label->width;
    bool all_sure = true;

    for (int i = 0; i < n; i++) {
        label[i] = r->single[j->left[x + i]];
        all_sure &= label[i] != 0;
    }
    if (all_sure && !j->out.entropy && !j->out.prob)
        return;
    mix_cells(r, x, n);
    j->kernels->class_row(s->top, j->out.entropy ? s->entropy : NULL, s->prob, BLOCK, count, (size_t)n);
    for (int i = 0; i < n; i++)
        label[i] = label[i] ? label[i] : (uint8_t)(s->top[i] + 1);
    if (j->out.entropy)
        memcpy(sst_map_f32_row(j->out.entropy, r->y) + x, s->entropy, (size_t)n * sizeof(float));
    for (size_t c = 0; j->out.prob && c < count; c++)
        memcpy(j->out.prob + (c * (size_t)j->out.label->height + (size_t)r->y) * width + (size_t)x, s->prob + c * BLOCK,
               (size_t)n * sizeof(float));
}

/* Pixels from column x on that one step processes; if only labels are requested, either all or none of them have a
 * single winner. */
static int run_length(const struct job *j, const uint8_t *single, int x)
{
    const int most = sst_min_int(BLOCK, j->out.label->width - x);
    int n = 1;

    if (j->out.entropy || j->out.prob)
        return most;
    while (n < most && !single[j->left[x + n]] == !single[j->left[x]])
        n++;
    return n;
}

static int finish_row(void *arg, int y, int worker)
{
    const struct job *j = arg;
    uint8_t *single = j->single + (size_t)worker * (size_t)j->grid->width;
    struct row r = { .job = j,
                     .scratch = &j->scratch[worker],
                     .single = single,
                     .y = y,
                     .guide = { .cells = SST_GUIDE_CELLS, .values = j->grid->values } };
    float down[4];

    r.cell_y = place(y, j->grid->height, j->out.label->height, down);
    for (int k = 0; k < 16; k++)
        r.guide.down[k] = down[k / 4];
    find_single(single, j, r.cell_y);
    for (int x = 0, n; x < j->out.label->width; x += n) {
        n = run_length(j, single, x);
        finish_block(&r, x, n);
    }
    return 0;
}

static uint8_t winner_of(const float *cell, int count)
{
    int top = 0;

    for (int c = 1; c < count; c++)
        top = cell[c] > cell[top] ? c : top;
    return (uint8_t)(top + 1);
}

/* Winners of the cells; the sum of weights is computed like a class of probability 1. */
static void prepare_cells(const struct job *j)
{
    const struct class_grid *g = j->grid;

    for (size_t i = 0; i < (size_t)g->width * (size_t)g->height; i++) {
        float *cell = g->cell + i * g->values;

        j->winner[i] = winner_of(cell, g->count);
        for (size_t v = (size_t)g->count; v < g->values; v++)
            cell[v] = 1;
    }
}

static void prepare_columns(const struct job *j)
{
    for (int x = 0; x < j->out.label->width; x++) {
        float *across = j->across + 16 * (size_t)x;

        j->left[x] = place(x, j->grid->width, j->out.label->width, across);
        for (int k = 4; k < 16; k++)
            across[k] = across[k % 4];
    }
}

void upsample_memory_fini(struct upsample_memory *m)
{
    sst_mem_kept_fini(&m->own);
    sst_mem_kept_fini(&m->resample);
}

/* @param at  start of the next part, advanced past it; NULL: only count the bytes */
static void *part(uint8_t *base, size_t *at, size_t count, size_t size)
{
    void *p = base ? base + *at : NULL;

    *at += sst_mem_stride(count, size);
    return p;
}

/* @return bytes */
static size_t lay_out(struct job *j, uint8_t *base, size_t workers)
{
    const size_t cells = (size_t)j->grid->width * (size_t)j->grid->height, width = (size_t)j->out.label->width;
    size_t at = 0;

    j->scratch = part(base, &at, workers, sizeof(*j->scratch));
    j->colour = part(base, &at, 3 * cells, sizeof(*j->colour));
    j->left = part(base, &at, width, sizeof(*j->left));
    j->across = part(base, &at, 16 * width, sizeof(*j->across));
    j->winner = part(base, &at, cells, 1);
    j->single = part(base, &at, workers * (size_t)j->grid->width, 1);
    return at;
}

/* Mean colours of the image under the cells. */
static int find_colours(float *colour, const struct class_grid *grid, const struct sst_image *img, int threads,
                        struct upsample_memory *memory)
{
    const struct resampled to = { colour, grid->width, grid->height, { 0, 0, 0 }, { 1 / 255.0, 1 / 255.0, 1 / 255.0 } };

    return resample_planes(&to, img, threads, &memory->resample);
}

int labels_upsample(const struct upsampled *out, struct class_grid *grid, const struct sst_image *img, int threads,
                    struct upsample_memory *memory)
{
    const size_t workers = (size_t)sst_thread_count(threads);
    struct job j = { .kernels = sst_kernels_get(), .grid = grid, .img = img, .out = *out };
    uint8_t *base = sst_mem_keep(&memory->own, lay_out(&j, NULL, workers), 1);
    int err;

    if (!base)
        return -ENOMEM;
    lay_out(&j, base, workers);
    err = find_colours(j.colour, grid, img, threads, memory);
    if (err)
        return err;
    prepare_cells(&j);
    prepare_columns(&j);
    return sst_parallel_for(out->label->height, threads, finish_row, &j);
}
