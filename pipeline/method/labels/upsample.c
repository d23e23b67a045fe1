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
/* Entropy below which cells of one winner have mixtures that are below it, too, nearly: the share of the other classes
 * is at most the largest of theirs. */
#define SURE 0.25f

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
    float *part;     /* [width] way from it to the next one */
    float *across;   /* [width][16] weights of the columns, the same in every row of four */
    uint8_t *winner; /* [height of the grid][width of the grid] label */
    float *unsure;   /* [height of the grid][width of the grid] entropy, where it is requested and no probabilities */
    uint8_t *single; /* [height of the grid][width of the grid] the only label of the pixels from a cell to the next, or
                        0 */
    uint8_t *sure;   /* the same, 0 also where some cell's entropy is not below SURE */
    float *between;  /* [worker][width of the grid] entropies of cells at a row of pixels */
    struct scratch *scratch; /* [worker] */
};

/* A row of pixels in work. */
struct row {
    const struct job *job;
    struct scratch *scratch;
    const uint8_t *single, *known; /* of the row; known: pixels that need no mixture, single or sure of struct job */
    const float *between;
    int y, cell_y; /* cell_y: row of the grid at or before it */
    struct sst_guide guide;
};

size_t class_grid_values(int count)
{
    return ((size_t)count + SST_GUIDE_VALUES) / SST_GUIDE_VALUES * SST_GUIDE_VALUES;
}

/* Half-pixel centres: cell at or before output i, the way to the next one, and the weights of it, the one before it and
 * the two after it. */
static int place(int i, int from, int to, float *part, float weight[4])
{
    const double at = sst_clamp_double((i + 0.5) * from / to - 0.5, 0, from - 1);
    const int lo = (int)at;

    *part = (float)(at - lo);
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

static bool only_labels(const struct job *j)
{
    return !j->out.entropy && !j->out.prob;
}

/* Winner and certainty that all 16 cells around a place share. */
static int find_single(void *arg, int y, int worker SST_UNUSED)
{
    const struct job *j = arg;
    const struct class_grid *g = j->grid;
    const bool entropies = j->out.entropy && !j->out.prob;

    for (int x = 0; x < g->width; x++) {
        const size_t own = cell_at(g, x, y);
        bool same = true, sure = entropies;

        for (int k = 0; k < 16; k++) {
            const size_t at = cell_at(g, x - 1 + k % 4, y - 1 + k / 4);

            same &= j->winner[at] == j->winner[own];
            sure = sure && j->unsure[at] < SURE;
        }
        j->single[own] = same ? j->winner[own] : 0;
        j->sure[own] = sure ? j->single[own] : 0;
    }
    return 0;
}

/* Entropies of the cells at a row of pixels, `part` of the way from row y of the grid to the next. */
static void find_between(float *between, const struct job *j, int y, float part)
{
    const float *above = j->unsure + cell_at(j->grid, 0, y), *below = j->unsure + cell_at(j->grid, 0, y + 1);

    for (int x = 0; x < j->grid->width; x++)
        between[x] = above[x] + part * (below[x] - above[x]);
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

/* Entropies of n sure pixels of a row from column x on, between the cells' and without the image. */
static void between_cells(const struct row *r, int x, int n)
{
    const struct job *j = r->job;
    float *entropy = sst_map_f32_row(j->out.entropy, r->y);

    for (int i = x; i < x + n; i++) {
        const int left = j->left[i];
        const float a = r->between[left], b = r->between[sst_min_int(left + 1, j->grid->width - 1)];

        entropy[i] = a + j->part[i] * (b - a);
    }
}

/* Classes and entropies of n pixels of a row from column x on. */
static void finish_block(struct row *r, int x, int n)
{
    const struct job *j = r->job;
    struct scratch *s = r->scratch;
    uint8_t *label = sst_map_u8_row(j->out.label, r->y) + x;
    const size_t count = (size_t)j->grid->count, width = (size_t)j->out.label->width;

    for (int i = 0; i < n; i++)
        label[i] = r->single[j->left[x + i]];
    if (r->known && r->known[j->left[x]]) {
        if (j->out.entropy)
            between_cells(r, x, n);
        return;
    }
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

/* Pixels from column x on that one step processes: all known, or none. */
static int run_length(const struct row *r, int x)
{
    const struct job *j = r->job;
    const int most = sst_min_int(BLOCK, j->out.label->width - x);
    int n = 1;

    if (!r->known)
        return most;
    while (n < most && !r->known[j->left[x + n]] == !r->known[j->left[x]])
        n++;
    return n;
}

static int finish_row(void *arg, int y, int worker)
{
    const struct job *j = arg;
    float *between = j->between + (size_t)worker * (size_t)j->grid->width, part, down[4];
    struct row r = { .job = j,
                     .scratch = &j->scratch[worker],
                     .between = between,
                     .y = y,
                     .guide = { .cells = SST_GUIDE_CELLS, .values = j->grid->values } };

    r.cell_y = place(y, j->grid->height, j->out.label->height, &part, down);
    for (int k = 0; k < 16; k++)
        r.guide.down[k] = down[k / 4];
    r.single = j->single + cell_at(j->grid, 0, r.cell_y);
    if (only_labels(j))
        r.known = r.single;
    if (j->out.entropy && !j->out.prob) {
        r.known = j->sure + cell_at(j->grid, 0, r.cell_y);
        find_between(between, j, r.cell_y, part);
    }
    for (int x = 0, n; x < j->out.label->width; x += n) {
        n = run_length(&r, x);
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

/* Entropies of the cells of a row. */
static int find_unsure(void *arg, int y, int worker)
{
    const struct job *j = arg;
    const struct class_grid *g = j->grid;
    struct scratch *s = &j->scratch[worker];

    for (int x = 0, n; x < g->width; x += n) {
        const size_t at = cell_at(g, x, y);

        n = sst_min_int(BLOCK, g->width - x);
        for (int i = 0; i < n; i++) {
            for (size_t c = 0; c < (size_t)g->count; c++)
                s->prob[c * BLOCK + (size_t)i] = g->cell[(at + (size_t)i) * g->values + c];
        }
        j->kernels->class_row(s->top, j->unsure + at, s->prob, BLOCK, (size_t)g->count, (size_t)n);
    }
    return 0;
}

static void prepare_columns(const struct job *j)
{
    for (int x = 0; x < j->out.label->width; x++) {
        float *across = j->across + 16 * (size_t)x;

        j->left[x] = place(x, j->grid->width, j->out.label->width, &j->part[x], across);
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
    j->part = part(base, &at, width, sizeof(*j->part));
    j->across = part(base, &at, 16 * width, sizeof(*j->across));
    j->winner = part(base, &at, cells, 1);
    j->unsure = part(base, &at, cells, sizeof(*j->unsure));
    j->single = part(base, &at, cells, 1);
    j->sure = part(base, &at, cells, 1);
    j->between = part(base, &at, workers * (size_t)j->grid->width, sizeof(*j->between));
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
    if (out->entropy && !out->prob)
        err = sst_parallel_for(grid->height, threads, find_unsure, &j);
    err = err ? err : sst_parallel_for(grid->height, threads, find_single, &j);
    return err ? err : sst_parallel_for(out->label->height, threads, finish_row, &j);
}
