/* The shaders `sweep_points`, `sweep_gather` and `sweep_peaks`: their references and self-tests. */
#include "pipeline/gpu/sweep.h"

#include <assert.h>
#include <errno.h>
#include <stdlib.h>

#include "pipeline/gpu/gpu_internal.h"
#include "pipeline/kernels/kernels.h"

#define NONE   65535
#define AROUND 2 /* cells */

/* --- references --------------------------------------------------------------------------------------------------- */

static unsigned cost_of(const struct sst_hypothesis_test *t, int x, int y, uint32_t d)
{
    const uint16_t hypothesis[SST_HYPOTHESES] = { (uint16_t)d, (uint16_t)d };
    const uint8_t two = 2; /* one alone would cost nothing */
    uint16_t cost[SST_HYPOTHESES];

    sst_hypothesis_cost_row_ref(cost, hypothesis, &two, t, x, y, 1);
    return cost[0];
}

/* Entry of a pixel: the level that alone explains it, and its weight; 0: none does. */
static uint32_t find_point(const struct sst_gpu_sweep *p, const struct sst_hypothesis_test *t, int x, int y)
{
    unsigned cost[SST_GPU_SWEEP_LEVELS] = { 0 }, next = SST_HYPOTHESIS_FAR;
    int best = 0, weight;

    for (int l = 0; l < p->levels; l++) {
        cost[l] = cost_of(t, x, y, (uint32_t)(l * p->level));
        best = cost[l] < cost[best] ? l : best;
    }
    for (int l = 0; l < p->levels; l++)
        next = abs(l - best) > p->apart && cost[l] < next ? cost[l] : next;
    weight = (int)(next - cost[best]);
    return weight < p->distinct ? 0 : (uint32_t)best | (uint32_t)sst_min_int(weight, p->weight_most) << 16;
}

void sweep_points_reference(const void *push, void *const *buffer, const uint32_t groups[3])
{
    const struct sst_gpu_sweep *p = push;
    const uint32_t *own = (const uint32_t *)buffer[SST_GPU_SWEEP_POINTS_MAPS] + p->test.own;
    uint32_t *memory = malloc(gpu_hypothesis_words(&p->test) * sizeof(*memory));
    uint32_t *out = buffer[SST_GPU_SWEEP_POINTS_OUT];
    uint8_t *code = malloc(65536);
    struct sst_hypothesis_test test;

    assert(memory && code);
    gpu_hypothesis_test(&test, &p->test, buffer[SST_GPU_SWEEP_POINTS_VIEWS], buffer[SST_GPU_SWEEP_POINTS_PIXELS],
                        memory, code);
    for (uint32_t i = 0; i < groups[0] * groups[1]; i++) {
        const int x = p->stride / 2 + (int)(i % groups[0]) * p->stride;
        const int y = p->stride / 2 + (int)(i / groups[0]) * p->stride;
        const uint32_t there = own[y * p->test.width + x], d = there & 0xFFFF;

        out[i] = there & SST_GPU_SURFACE_UNSEEN || (d != NONE && cost_of(&test, x, y, d) < p->test.settled)
                     ? 0
                     : find_point(p, &test, x, y);
    }
    free(memory);
    free(code);
}

void sweep_gather_reference(const void *push, void *const *buffer, const uint32_t groups[3] SST_UNUSED)
{
    const struct sst_gpu_sweep_gather *p = push;
    const struct sst_gpu_sweep_point *point = buffer[SST_GPU_SWEEP_GATHER_POINTS];
    const int32_t *shifts = buffer[SST_GPU_SWEEP_GATHER_SHIFTS];
    uint32_t *weights = buffer[SST_GPU_SWEEP_GATHER_WEIGHTS];

    for (uint32_t i = 0; i < p->points; i++) {
        const int level = (int)(point[i].found & 0xFF), sweep = (int)(point[i].found >> 16);
        const int32_t *shift = shifts + 2 * (ptrdiff_t)(sweep * p->levels + level);
        const int x = (int)(point[i].at & 0xFFFF) - shift[0], y = (int)(point[i].at >> 16) - shift[1];

        if (x >= 0 && y >= 0 && x / p->cell < p->cols && y / p->cell < p->rows)
            weights[(y / p->cell * p->cols + x / p->cell) * p->levels + level] += point[i].found >> 8 & 0xFF;
    }
}

/* What is around a cell, by level. */
struct cell {
    uint32_t weight[SST_GPU_SWEEP_LEVELS], mapped[SST_GPU_SWEEP_LEVELS];
};

static void add_cell(struct cell *sum, const struct sst_gpu_sweep_peaks *p, void *const *buffer, int col, int row)
{
    const uint32_t *weights = buffer[SST_GPU_SWEEP_PEAKS_WEIGHTS];
    const uint32_t *own = (const uint32_t *)buffer[SST_GPU_SWEEP_PEAKS_MAPS] + p->own;
    const int each = p->cell / p->stride;

    for (int l = 0; l < p->levels; l++)
        sum->weight[l] += weights[(row * p->cols + col) * p->levels + l];
    for (int i = 0; i < each * each; i++) {
        const int x = (col * each + i % each) * p->stride + p->stride / 2;
        const int y = (row * each + i / each) * p->stride + p->stride / 2;
        int l;

        if (x >= p->width || y >= p->height)
            continue;
        l = ((int)(own[y * p->width + x] & 0xFFFF) + p->level / 2) / p->level;
        if (l < p->levels)
            sum->mapped[l]++;
    }
}

/* Neighbouring levels count half. */
static void blur(uint32_t *sum, int levels)
{
    uint32_t before = 0;

    for (int l = 0; l < levels; l++) {
        const uint32_t at = sum[l];

        sum[l] = before + 2 * at + (l + 1 < levels ? sum[l + 1] : 0);
        before = at;
    }
}

static void pick_peaks(uint32_t *peak, struct cell *sum, const struct sst_gpu_sweep_peaks *p)
{
    for (int i = 0; i < SST_GPU_CELL_PEAKS; i++)
        peak[i] = NONE;
    for (int i = 0; i < SST_GPU_CELL_PEAKS; i++) {
        int best = 0;

        for (int l = 1; l < p->levels; l++)
            best = sum->weight[l] > sum->weight[best] ? l : best;
        if (sum->weight[best] < p->gathered)
            return;
        peak[i] = (uint32_t)(best * p->level) | (sum->mapped[best] <= p->mapped ? SST_GPU_SWEEP_ABSENT : 0);
        for (int l = sst_max_int(best - p->apart, 0); l <= sst_min_int(best + p->apart, p->levels - 1); l++)
            sum->weight[l] = 0;
    }
}

void sweep_peaks_reference(const void *push, void *const *buffer, const uint32_t groups[3] SST_UNUSED)
{
    const struct sst_gpu_sweep_peaks *p = push;
    uint32_t *out = buffer[SST_GPU_SWEEP_PEAKS_OUT];

    for (int i = 0; i < p->cols * p->rows; i++) {
        const int col = i % p->cols, row = i / p->cols;
        struct cell sum = { { 0 }, { 0 } };

        for (int y = sst_max_int(row - AROUND, 0); y <= sst_min_int(row + AROUND, p->rows - 1); y++) {
            for (int x = sst_max_int(col - AROUND, 0); x <= sst_min_int(col + AROUND, p->cols - 1); x++)
                add_cell(&sum, p, buffer, x, y);
        }
        blur(sum.weight, p->levels);
        blur(sum.mapped, p->levels);
        pick_peaks(out + i * SST_GPU_CELL_PEAKS, &sum, p);
    }
}

/* --- self-tests --------------------------------------------------------------------------------------------------- */

#define TEST_WIDTH   75
#define TEST_HEIGHT  45
#define TEST_PIXELS  (TEST_WIDTH * TEST_HEIGHT)
#define TEST_VIEWS   6 /* the first one is tested against the others */
#define TEST_LEVEL   8
#define TEST_LEVELS  70 /* more than a group has invocations */
#define TEST_STRIDE  4
#define TEST_COLUMNS 19 /* sparse pixels */
#define TEST_ROWS    11
#define TEST_CELL    16
#define TEST_COLS    5
#define TEST_CELLS   (TEST_COLS * 3)
#define TEST_POINTS  900
#define TEST_SWEEPS  2
#define TEST_MOVED   (-8 * 200) /* 2^-16 px a view and unit of disparity */

struct test {
    struct sst_gpu_hypothesis_view view[TEST_VIEWS - 1];
    uint32_t pixel[TEST_VIEWS * TEST_PIXELS], maps[TEST_VIEWS * TEST_PIXELS], out[TEST_COLUMNS * TEST_ROWS];
    struct sst_gpu_sweep_point point[TEST_POINTS];
    int32_t shifts[TEST_SWEEPS * TEST_LEVELS * 2];
    uint32_t weights[TEST_CELLS * TEST_LEVELS], peaks[TEST_CELLS * SST_GPU_CELL_PEAKS];
};

/* A brightness per place, without any pattern. */
static uint32_t texture(int x, int y)
{
    uint32_t state = (uint32_t)(x + 100) * 40503U + (uint32_t)(y + 100) * 2654435U;

    gpu_random(&state);
    return gpu_random(&state) & 0xFF;
}

/* Views of a texture at disparity 320, half of it plain, with maps that have it, have another one or none; points
 * around few levels. */
static struct test *make_test(void)
{
    struct test *t = calloc(1, sizeof(*t));
    uint32_t state = 4;

    for (int i = 0; t && i < TEST_VIEWS * TEST_PIXELS; i++) {
        const int k = i / TEST_PIXELS, x = i % TEST_WIDTH, y = i % TEST_PIXELS / TEST_WIDTH;
        const int moved = (32768 + 320 * k * TEST_MOVED) >> 16;
        const uint32_t d = x < 20 ? 320 : y % 3 ? 100 : NONE;

        t->pixel[i] = (y < 30 ? texture(x - moved, y) : 80) * 0x010101 | 1U << 24;
        t->maps[i] = d | (gpu_random(&state) % 30 ? 0 : SST_GPU_SURFACE_UNSEEN);
    }
    for (int k = 0; t && k + 1 < TEST_VIEWS; k++)
        t->view[k] = (struct sst_gpu_hypothesis_view){ 32768, 32768, (k + 1) * TEST_MOVED, 0,
                                                       (uint32_t)((k + 1) * TEST_PIXELS) };
    for (int i = 0; t && i < TEST_POINTS; i++) {
        const uint32_t level = i % 3 ? 20 + 30 * (gpu_random(&state) % 2) : gpu_random(&state) % TEST_LEVELS;

        t->point[i].at = gpu_random(&state) % TEST_WIDTH | gpu_random(&state) % TEST_HEIGHT << 16;
        t->point[i].found = level | (20 + gpu_random(&state) % 80) << 8 | gpu_random(&state) % TEST_SWEEPS << 16;
    }
    for (int i = 0; t && i < TEST_SWEEPS * TEST_LEVELS * 2; i++)
        t->shifts[i] = i / 7 % 40 - 20;
    return t;
}

static const struct sst_gpu_sweep_gather test_gather = { TEST_POINTS, TEST_LEVELS, TEST_CELL, TEST_COLS, 3 };

int sweep_points_self_test(struct sst_gpu *g)
{
    static const struct sst_gpu_sweep push = {
        .test = { TEST_WIDTH, TEST_HEIGHT, TEST_VIEWS - 1, 0, 24, 24, TEST_LEVEL * TEST_LEVELS, 41, 0, 0 },
        .stride = TEST_STRIDE,
        .level = TEST_LEVEL,
        .levels = TEST_LEVELS,
        .apart = 3,
        .distinct = 15,
        .weight_most = 100,
    };
    const struct sst_gpu_work work = { .shader = SST_GPU_SWEEP_POINTS,
                                       .push = &push,
                                       .groups = { TEST_COLUMNS, TEST_ROWS, 1 } };
    struct test *t = make_test();
    const int err =
        t ? gpu_compare(g, &work, (const void *const[]){ t->view, t->pixel, t->maps, t->out },
                        (const size_t[]){ sizeof(t->view), sizeof(t->pixel), sizeof(t->maps), sizeof(t->out) },
                        SST_GPU_SWEEP_POINTS_OUT, NULL)
          : -ENOMEM;

    free(t);
    return err;
}

int sweep_gather_self_test(struct sst_gpu *g)
{
    const struct sst_gpu_work work = { .shader = SST_GPU_SWEEP_GATHER,
                                       .push = &test_gather,
                                       .groups = { gpu_groups(TEST_POINTS, SST_GPU_HYPOTHESIS_PIXELS), 1, 1 } };
    struct test *t = make_test();
    const int err = t ? gpu_compare(g, &work, (const void *const[]){ t->point, t->shifts, t->weights },
                                    (const size_t[]){ sizeof(t->point), sizeof(t->shifts), sizeof(t->weights) },
                                    SST_GPU_SWEEP_GATHER_WEIGHTS, NULL)
                      : -ENOMEM;

    free(t);
    return err;
}

int sweep_peaks_self_test(struct sst_gpu *g)
{
    struct sst_gpu_sweep_peaks push = { TEST_WIDTH, TEST_HEIGHT, 0,          TEST_STRIDE, TEST_CELL, TEST_COLS,
                                        3,          TEST_LEVELS, TEST_LEVEL, 4,           600,       8 };
    struct sst_gpu_work work = { .shader = SST_GPU_SWEEP_PEAKS, .push = &push, .groups = { TEST_COLS, 3, 1 } };
    struct test *t = make_test();
    int err = t ? 0 : -ENOMEM;

    if (!err)
        sweep_gather_reference(&test_gather, (void *const[]){ t->point, t->shifts, t->weights }, NULL);
    for (int unit = 1; unit <= 2 && !err; unit++) { /* large pictures have larger cells */
        push.stride = unit * TEST_STRIDE;
        push.cell = unit * TEST_CELL;
        work.groups[0] = gpu_groups(TEST_WIDTH, push.cell);
        work.groups[1] = gpu_groups(TEST_HEIGHT, push.cell);
        push.cols = (int32_t)work.groups[0];
        push.rows = (int32_t)work.groups[1];
        err = gpu_compare(g, &work, (const void *const[]){ t->maps, t->weights, t->peaks },
                          (const size_t[]){ sizeof(t->maps), sizeof(t->weights), sizeof(t->peaks) },
                          SST_GPU_SWEEP_PEAKS_OUT, NULL);
    }
    free(t);
    return err;
}
