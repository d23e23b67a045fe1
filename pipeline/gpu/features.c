/* The shader `feature_cost`: its reference by that of the kernel, and its self-test. */
#include <errno.h>
#include <stdlib.h>

#include "pipeline/gpu/gpu_internal.h"
#include "pipeline/kernels/kernels.h"

/* --- reference ---------------------------------------------------------------------------------------------------- */

_Static_assert(4 * SST_GPU_FEATURE_WORDS == SST_FEATURE_CHANNELS, "features of a pixel");

static const uint8_t *features_at(const uint8_t *features, int width, int x, int y)
{
    return features + 4 * ((size_t)y * SST_GPU_FEATURE_WORDS * (size_t)width + (size_t)x);
}

/* Costs of a pixel at all of a tile's disparities. */
static void cost_pixel(uint8_t *out, const struct sst_gpu_features *p, const struct sst_gpu_tile *t,
                       void *const *buffer, int x, int y)
{
    const struct sst_gpu_step *step = (const struct sst_gpu_step *)buffer[SST_GPU_FEATURE_STEPS] + t->first;
    const uint8_t *own = features_at(buffer[SST_GPU_FEATURE_OWN], p->width, x, y);

    for (int d = 0; d < t->nd; d++) {
        const bool counts = d < t->steps;
        const int xn = counts ? x + step[d].near_x : -1, yn = counts ? y + step[d].near_y : -1;
        const uint8_t *other;

        out[d] = SST_COST_ABSENT;
        if (xn < 0 || yn < 0 || xn >= p->width || yn >= p->height)
            continue;
        other = features_at(buffer[SST_GPU_FEATURE_OTHER], p->width, xn, yn);
        sst_feature_cost_rows_ref(out + d, 1, own, &other, 1, 4 * (size_t)p->width, 1);
    }
}

void feature_cost_reference(const void *push, void *const *buffer, const uint32_t groups[3])
{
    const struct sst_gpu_features *p = push;

    for (uint32_t i = 0; i < groups[2]; i++) {
        const struct sst_gpu_tile *t = (const struct sst_gpu_tile *)buffer[SST_GPU_FEATURE_TILES] + i;
        uint8_t *out = (uint8_t *)buffer[SST_GPU_FEATURE_OUT] + 4 * (size_t)t->quad;

        for (int row = 0; row < t->rows; row++) {
            for (int column = 0; column < t->pitch; column++, out += t->nd)
                cost_pixel(out, p, t, buffer, t->left + column, t->top + row);
        }
    }
}

/* --- self-test ---------------------------------------------------------------------------------------------------- */

#define TEST_WIDTH  37 /* no multiple of a group's */
#define TEST_HEIGHT 13
#define TEST_BYTES  ((size_t)TEST_WIDTH * TEST_HEIGHT * SST_FEATURE_CHANNELS)
#define TEST_LEFT   5 /* column of the second tile's first cost */
#define TEST_STEPS  40
#define TEST_CELLS  ((size_t)TEST_HEIGHT * TEST_WIDTH * (36 + 32))

/* A tile with all steps, and one with a window of them over a part of the view. */
static const struct sst_gpu_tile test_tiles[2] = {
    { 0, 0, TEST_WIDTH, TEST_HEIGHT, 0, 0, TEST_WIDTH, TEST_HEIGHT, 0, 34, 36, 0 },
    { 9, 4, 20, 6, TEST_LEFT, 2, TEST_WIDTH - TEST_LEFT, TEST_HEIGHT - 2, 9, 31, 32, TEST_WIDTH *TEST_HEIGHT * 36 / 4 },
};

struct test {
    struct sst_gpu_step step[TEST_STEPS];
    uint8_t own[TEST_BYTES], other[TEST_BYTES], cost[TEST_CELLS];
};

/* Vectors that are more or less alike, some with the largest components; steps that share pixels. */
static void set_test(struct test *t)
{
    uint32_t state = 3;

    for (int i = 0; i < TEST_STEPS; i++)
        t->step[i] = (struct sst_gpu_step){ 15 - i, i / 4 - 5, 0, 15 - i + i % 3, i / 4 - 5 + i % 2 };
    for (size_t i = 0; i < 2 * TEST_BYTES; i++) {
        const size_t at = i % TEST_BYTES, channel = at / 4 / TEST_WIDTH % SST_GPU_FEATURE_WORDS * 4 + at % 4;
        const uint32_t any = gpu_random(&state), size = at / 4 % TEST_WIDTH % 9 ? 8 + any % 12 : 127 + any % 2;

        (i < TEST_BYTES ? t->own : t->other)[at] =
            (uint8_t)(channel % 3 ? SST_FEATURE_ZERO + sst_min_int((int)size, SST_FEATURE_ONE)
                                  : SST_FEATURE_ZERO - (int)size);
    }
}

static int test_costs(struct sst_gpu *g, enum sst_gpu_shader shader)
{
    static const struct sst_gpu_features push = { TEST_WIDTH, TEST_HEIGHT };
    const struct sst_gpu_work work = { .shader = shader,
                                       .push = &push,
                                       .groups = { sst_gpu_match_blocks(TEST_WIDTH, 36), TEST_HEIGHT,
                                                   ARRAY_LEN(test_tiles) } };
    struct test *t = calloc(1, sizeof(*t));
    int err = t ? 0 : -ENOMEM;

    if (!err) {
        set_test(t);
        err = gpu_compare(
            g, &work, (const void *const[]){ test_tiles, t->step, t->own, t->other, t->cost },
            (const size_t[]){ sizeof(test_tiles), sizeof(t->step), sizeof(t->own), sizeof(t->other), sizeof(t->cost) },
            SST_GPU_FEATURE_OUT, NULL);
    }
    free(t);
    return err;
}

int feature_cost_self_test(struct sst_gpu *g)
{
    return test_costs(g, SST_GPU_FEATURE_COST);
}

int feature_cost_dot_self_test(struct sst_gpu *g)
{
    return test_costs(g, SST_GPU_FEATURE_COST_DOT);
}
