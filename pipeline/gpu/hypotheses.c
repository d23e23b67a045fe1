/* The shaders `hypothesis_cost`, `hypothesis_path` and `hypothesis_choice`: their references by those of kernels, and
 * their self-tests. */
#include "pipeline/gpu/hypotheses.h"

#include <assert.h>
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "pipeline/gpu/gpu_internal.h"
#include "pipeline/kernels/kernels.h"

#define MARGIN 2 /* around a view, as its kernel reads it */

/* --- references --------------------------------------------------------------------------------------------------- */

/* A view with its borders repeated. @param to  [height + 2 MARGIN][width + 2 MARGIN] */
static void pad_view(uint32_t *to, const uint32_t *from, int width, int height)
{
    for (int y = -MARGIN; y < height + MARGIN; y++) {
        for (int x = -MARGIN; x < width + MARGIN; x++)
            *to++ = from[sst_clamp_int(y, 0, height - 1) * width + sst_clamp_int(x, 0, width - 1)];
    }
}

size_t gpu_hypothesis_words(const struct sst_gpu_hypothesis_cost *p)
{
    return (size_t)(p->views + 1) * ((size_t)p->width + 2 * MARGIN) * ((size_t)p->height + 2 * MARGIN);
}

void gpu_hypothesis_test(struct sst_hypothesis_test *t, const struct sst_gpu_hypothesis_cost *p,
                         const struct sst_gpu_hypothesis_view *view, const uint32_t *pixels, uint32_t *memory,
                         uint8_t *code)
{
    const size_t stride = (size_t)p->width + 2 * MARGIN, n = stride * ((size_t)p->height + 2 * MARGIN);
    const size_t origin = MARGIN * stride + MARGIN;

    *t = (struct sst_hypothesis_test){ .own = { memory + origin, (ptrdiff_t)stride },
                                       .views = p->views,
                                       .width = p->width,
                                       .height = p->height,
                                       .code = code,
                                       .tolerance = p->tolerance,
                                       .similar = p->similar,
                                       .settled = p->settled };
    pad_view(memory, pixels + p->own, p->width, p->height);
    for (int k = 0; k < p->views; k++) {
        uint32_t *at = memory + (size_t)(k + 1) * n;

        pad_view(at, pixels + view[k].first, p->width, p->height);
        t->view[k] = (struct sst_packed_view){ at + origin, (ptrdiff_t)stride };
        t->x[k] = view[k].x;
        t->y[k] = view[k].y;
        t->dx[k] = view[k].dx;
        t->dy[k] = view[k].dy;
    }
    for (uint32_t d = 0; d < 65536; d++)
        code[d] = (uint8_t)(1 + (d < p->most ? d : p->most) * 253 / p->most);
}

/* What follows from a pixel's costs. @return its entry of the counts */
static uint32_t prefer_own(uint16_t *cost, uint32_t count, const struct sst_gpu_hypothesis_cost *p)
{
    uint32_t best = 0;

    for (uint32_t i = 1; i < count; i++) {
        cost[i] = (uint16_t)(cost[i] + p->change);
        best = cost[i] < cost[best] ? i : best;
    }
    return count | (count > 1 && cost[0] < p->settled ? 1 : count) << 8 | best << 16 |
           (count > 1 && cost[0] > p->change && cost[0] < p->cheap ? 1U << 24 : 0);
}

void hypothesis_cost_reference(const void *push, void *const *buffer, const uint32_t groups[3] SST_UNUSED)
{
    const struct sst_gpu_hypothesis_cost *p = push;
    const size_t width = (size_t)p->width;
    uint32_t *memory = malloc(gpu_hypothesis_words(p) * sizeof(*memory));
    uint32_t *counts = buffer[SST_GPU_HYPOTHESIS_COST_COUNTS];
    const uint16_t *list = buffer[SST_GPU_HYPOTHESIS_COST_LIST];
    uint16_t *cost = buffer[SST_GPU_HYPOTHESIS_COST_OUT];
    uint8_t *code = malloc(65536);
    struct sst_hypothesis_test test;

    assert(memory && code);
    gpu_hypothesis_test(&test, p, buffer[SST_GPU_HYPOTHESIS_COST_VIEWS], buffer[SST_GPU_HYPOTHESIS_COST_PIXELS], memory,
                        code);
    for (size_t i = 0; i < width * (size_t)p->height; i++) {
        const uint8_t count = (uint8_t)counts[i];

        sst_hypothesis_cost_row_ref(cost + i * SST_HYPOTHESES, list + i * SST_HYPOTHESES, &count, &test,
                                    (int)(i % width), (int)(i / width), 1);
        counts[i] = prefer_own(cost + i * SST_HYPOTHESES, count, p);
    }
    free(memory);
    free(code);
}

static void follow(const struct sst_gpu_hypothesis_path *p, void *const *buffer, int x, int y, int dx, int dy,
                   const struct sst_hypothesis_penalty *penalty)
{
    const uint32_t *pixels = (const uint32_t *)buffer[SST_GPU_HYPOTHESIS_PATH_PIXELS] + p->own;
    const uint32_t *counts = buffer[SST_GPU_HYPOTHESIS_PATH_COUNTS];
    const uint16_t *list = buffer[SST_GPU_HYPOTHESIS_PATH_LIST], *cost = buffer[SST_GPU_HYPOTHESIS_PATH_COST];
    uint32_t *sums = buffer[SST_GPU_HYPOTHESIS_PATH_SUM];
    uint16_t path[2][SST_HYPOTHESES];
    int before = -1;

    for (int now = 0; x >= 0 && y >= 0 && x < p->width && y < p->height; x += dx, y += dy, now = 1 - now) {
        const int at = y * p->width + x, entry = at * SST_HYPOTHESES;
        const uint8_t count = (uint8_t)(counts[at] >> 8);
        uint16_t sum[SST_HYPOTHESES];

        for (int i = 0; i < SST_HYPOTHESES; i++)
            sum[i] = (uint16_t)(p->first ? 0 : sums[entry + i]);
        if (before < 0) {
            for (int i = 0; i < SST_HYPOTHESES; i++) {
                path[now][i] = cost[entry + i];
                sum[i] = (uint16_t)(sum[i] + cost[entry + i]);
            }
        } else {
            const uint8_t colour = (uint8_t)gpu_colour_step(pixels[at], pixels[before]);

            sst_hypothesis_path_row_ref(path[now], sum, cost + entry, list + entry, path[1 - now],
                                        list + (ptrdiff_t)before * SST_HYPOTHESES, &colour, &count, penalty,
                                        SST_HYPOTHESES, 1);
        }
        for (int i = 0; i < SST_HYPOTHESES; i++)
            sums[entry + i] = sum[i];
        before = at;
    }
}

void hypothesis_path_reference(const void *push, void *const *buffer, const uint32_t groups[3] SST_UNUSED)
{
    const struct sst_gpu_hypothesis_path *p = push;
    const uint32_t *table = buffer[SST_GPU_HYPOTHESIS_PATH_TABLE];
    struct sst_hypothesis_penalty penalty = { .near = (uint16_t)p->near };

    for (int i = 0; i < 256; i++) {
        penalty.p1[i] = (uint16_t)table[i];
        penalty.p2[i] = (uint16_t)(table[i] >> 16);
    }
    for (int way = p->way; way < p->way + p->ways; way++) {
        int dx, dy;

        sst_gpu_way(way, &dx, &dy);
        for (int i = 0; i < (dy ? p->width : p->height); i++) {
            if (dy)
                follow(p, buffer, i, dy > 0 ? 0 : p->height - 1, dx, dy, &penalty);
            else
                follow(p, buffer, dx > 0 ? 0 : p->width - 1, i, dx, dy, &penalty);
        }
    }
}

void hypothesis_choice_reference(const void *push, void *const *buffer, const uint32_t groups[3] SST_UNUSED)
{
    const struct sst_gpu_hypothesis_choice *p = push;
    const uint16_t *list = buffer[SST_GPU_HYPOTHESIS_CHOICE_LIST];
    const uint32_t *counts = buffer[SST_GPU_HYPOTHESIS_CHOICE_COUNTS], *sums = buffer[SST_GPU_HYPOTHESIS_CHOICE_SUM];
    uint32_t *out = buffer[SST_GPU_HYPOTHESIS_CHOICE_OUT];

    for (size_t at = 0; at < p->pixels; at++) {
        const uint32_t count = counts[at] >> 8 & 0xFF, *sum = sums + at * SST_HYPOTHESES;
        uint32_t best = 0, next = 65535, gap;

        for (uint32_t i = 1; i < count; i++)
            best = sum[i] < sum[best] ? i : best;
        for (uint32_t i = 0; i < count; i++)
            next = i != best && sum[i] < next ? sum[i] : next;
        gap = next - sum[best];
        out[at] = (count ? list[at * SST_HYPOTHESES + best] : 0xFFFFU) |
                  (best ? (255 * gap / (gap + 128)) << 16 | 1U << 24 : 0) | (counts[at] >> 16 & 7) << 25 |
                  (counts[at] >> 24 & 1) << 28 | ((counts[at] - 1) & 7) << 29;
    }
}

/* --- self-tests --------------------------------------------------------------------------------------------------- */

#define TEST_WIDTH  37
#define TEST_HEIGHT 21
#define TEST_PIXELS (TEST_WIDTH * TEST_HEIGHT)
#define TEST_VIEWS  7 /* the first one is tested against the others */
#define TEST_RANGE  (9 * 64)

struct test {
    struct sst_gpu_hypothesis_view view[TEST_VIEWS - 1];
    uint32_t pixel[TEST_VIEWS * TEST_PIXELS], table[256];
    uint16_t list[TEST_PIXELS * SST_HYPOTHESES], cost[TEST_PIXELS * SST_HYPOTHESES];
    uint32_t counts[TEST_PIXELS], sum[TEST_PIXELS * SST_HYPOTHESES], out[TEST_PIXELS];
};

/* Views of one texture with noise, at few disparities that are among the hypotheses; depths at random. */
static struct test *make_test(void)
{
    struct test *t = calloc(1, sizeof(*t));
    uint32_t state = 6;

    for (int i = 0; t && i < TEST_VIEWS * TEST_PIXELS; i++) {
        const int x = i % TEST_WIDTH + 3 * (i / TEST_PIXELS), y = i % TEST_PIXELS / TEST_WIDTH;

        t->pixel[i] = ((uint32_t)(x * x + 40 * (y / 3) + 7 * y) & 0x7F) * 0x010101 + (gpu_random(&state) & 0x070707);
        t->pixel[i] |= (gpu_random(&state) % 11 ? gpu_random(&state) % 254 : SST_DEPTH_OUTSIDE) << 24;
    }
    for (int k = 0; t && k + 1 < TEST_VIEWS; k++)
        t->view[k] = (struct sst_gpu_hypothesis_view){ 32768 + k * 9000, 32768 - k * 5000, -(k + 1) * 900,
                                                       (k - 2) * 300, (uint32_t)((k + 1) * TEST_PIXELS) };
    for (int i = 0; t && i < TEST_PIXELS; i++) {
        t->counts[i] = i % 3 ? gpu_random(&state) % (SST_HYPOTHESES + 1) : SST_HYPOTHESES;
        for (int j = 0; j < SST_HYPOTHESES; j++)
            t->list[i * SST_HYPOTHESES + j] = (uint16_t)(gpu_random(&state) % TEST_RANGE);
    }
    for (uint32_t i = 0; t && i < 256; i++)
        t->table[i] = 30 | (300 * 16 / (16 + i)) << 16;
    return t;
}

static const struct sst_gpu_hypothesis_cost test_cost = { TEST_WIDTH, TEST_HEIGHT, TEST_VIEWS - 1, 0,
                                                          24,         24,          TEST_RANGE + 1, 96,
                                                          40,         96 };

int hypothesis_cost_self_test(struct sst_gpu *g)
{
    struct test *t = make_test();
    struct sst_gpu_hypothesis_cost push = test_cost;
    const struct sst_gpu_work work = { .shader = SST_GPU_HYPOTHESIS_COST,
                                       .push = &push,
                                       .groups = { gpu_groups(TEST_WIDTH, 32), gpu_groups(TEST_HEIGHT, 8), 1 } };
    int err = t ? 0 : -ENOMEM;

    for (push.views = 0; push.views < TEST_VIEWS && !err; push.views += 3) /* none, few, all */
        err = gpu_compare(
            g, &work, (const void *const[]){ t->view, t->pixel, t->list, t->counts, t->cost },
            (const size_t[]){ sizeof(t->view), sizeof(t->pixel), sizeof(t->list), sizeof(t->counts), sizeof(t->cost) },
            SST_GPU_HYPOTHESIS_COST_OUT, NULL);
    free(t);
    return err;
}

/* The results of the shader before, by its reference. */
static void cost_test(struct test *t)
{
    hypothesis_cost_reference(&test_cost, (void *const[]){ t->view, t->pixel, t->list, t->counts, t->cost }, NULL);
}

static int test_paths(struct sst_gpu *g, enum sst_gpu_shader shader)
{
    static const int ways[][2] = { { 0, 1 }, { 1, 1 }, { 2, 1 }, { 3, 1 }, { 0, 1 }, { 1, 3 } }; /* first, how many */
    struct test *t = make_test();
    int err = t ? 0 : -ENOMEM;

    if (!err)
        cost_test(t);
    for (size_t i = 0; i < ARRAY_LEN(ways) && !err; i++) {
        const struct sst_gpu_hypothesis_path push = { TEST_WIDTH, TEST_HEIGHT, 0,          12,
                                                      ways[i][0], ways[i][1],  !ways[i][0] };
        const struct sst_gpu_work work = {
            .shader = shader,
            .push = &push,
            .groups = { (uint32_t)push.ways, gpu_groups(sst_max_int(TEST_WIDTH, TEST_HEIGHT), SST_GPU_HYPOTHESIS_PATHS),
                        1 }
        };

        err = gpu_compare(g, &work, (const void *const[]){ t->pixel, t->table, t->list, t->counts, t->cost, t->sum },
                          (const size_t[]){ sizeof(t->pixel), sizeof(t->table), sizeof(t->list), sizeof(t->counts),
                                            sizeof(t->cost), sizeof(t->sum) },
                          SST_GPU_HYPOTHESIS_PATH_SUM, t->sum);
    }
    free(t);
    return err;
}

int hypothesis_path_self_test(struct sst_gpu *g)
{
    return test_paths(g, SST_GPU_HYPOTHESIS_PATH);
}

int hypothesis_path_subgroup_self_test(struct sst_gpu *g)
{
    return test_paths(g, SST_GPU_HYPOTHESIS_PATH_SUBGROUP);
}

int hypothesis_choice_self_test(struct sst_gpu *g)
{
    static const struct sst_gpu_hypothesis_choice push = { TEST_PIXELS };
    const struct sst_gpu_work work = { .shader = SST_GPU_HYPOTHESIS_CHOICE,
                                       .push = &push,
                                       .groups = { gpu_groups(TEST_PIXELS, SST_GPU_HYPOTHESIS_PIXELS), 1, 1 } };
    struct test *t = make_test();
    uint32_t state = 8;
    int err = t ? 0 : -ENOMEM;

    if (!err)
        cost_test(t);
    for (int i = 0; i < TEST_PIXELS * SST_HYPOTHESES && !err; i++) /* many are equal */
        t->sum[i] = gpu_random(&state) % 40 * 50;
    if (!err)
        err = gpu_compare(g, &work, (const void *const[]){ t->list, t->counts, t->sum, t->out },
                          (const size_t[]){ sizeof(t->list), sizeof(t->counts), sizeof(t->sum), sizeof(t->out) },
                          SST_GPU_HYPOTHESIS_CHOICE_OUT, NULL);
    free(t);
    return err;
}
