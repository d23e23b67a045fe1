/* The shaders `carry_start`, `carry_project` and `carry_close`: their references and self-tests. */
#include "pipeline/gpu/carry.h"

#include <errno.h>
#include <stdlib.h>

#include "pipeline/gpu/gpu_internal.h"

#define NONE  65535
#define STEP  64 /* 1/64 px: neighbours with a larger difference are on two surfaces */
#define AGREE 3  /* sources */

/* --- references --------------------------------------------------------------------------------------------------- */

void carry_start_reference(const void *push, void *const *buffer, const uint32_t groups[3] SST_UNUSED)
{
    const struct sst_gpu_carry *p = push;
    uint32_t *arrived = buffer[SST_GPU_CARRY_START_ARRIVED];
    const int n = p->width * p->height;

    for (int i = 0; i < n; i++) {
        arrived[i] = 0;
        if (!p->agreed)
            continue;
        arrived[n + i] = NONE;
        arrived[2 * n + i] = 0;
    }
}

void carry_project_reference(const void *push, void *const *buffer, const uint32_t groups[3])
{
    const struct sst_gpu_carry *p = push;
    const struct sst_gpu_check_other *source = buffer[SST_GPU_CARRY_PROJECT_SOURCES];
    uint32_t *arrived = buffer[SST_GPU_CARRY_PROJECT_ARRIVED];
    const int n = p->width * p->height;

    for (uint32_t k = 0; k < groups[2]; k++) {
        const uint32_t *from = (const uint32_t *)buffer[SST_GPU_CARRY_PROJECT_MAPS] + source[k].first;
        const struct sst_gpu_shift *s = &source[k].shift;

        for (int i = 0; i < n; i++) {
            const uint32_t d = from[i] & 0xFFFF, value = (d + 1) << 8 | from[i] >> 16;
            const int x = i % p->width + s->across + ((s->across_part + (int)d * s->across_step) >> 16);
            const int y = i / p->width + s->down + ((s->down_part + (int)d * s->down_step) >> 16);
            uint32_t *at = arrived + y * p->width + x;

            if (d == NONE || x < 0 || y < 0 || x >= p->width || y >= p->height)
                continue;
            *at = value > *at ? value : *at;
            if (!p->agreed)
                continue;
            at[n] = d < at[n] ? d : at[n];
            at[2 * n] |= 1U << k;
        }
    }
}

static int disparity(uint32_t value)
{
    return (int)(value >> 8) - 1;
}

/* A pixel between a and b of one nearer surface gets the farther one of them. */
static uint32_t between(uint32_t at, uint32_t a, uint32_t b)
{
    const int d = disparity(at), da = disparity(a), db = disparity(b), least = sst_min_int(da, db);

    return least >= 0 && abs(da - db) < STEP && (d < 0 || least > d + STEP) ? (da < db ? a : b) : at;
}

void carry_close_reference(const void *push, void *const *buffer, const uint32_t groups[3] SST_UNUSED)
{
    const struct sst_gpu_carry *p = push;
    const uint32_t *arrived = buffer[SST_GPU_CARRY_CLOSE_ARRIVED];
    uint32_t *out = buffer[SST_GPU_CARRY_CLOSE_OUT];
    const int w = p->width, n = w * p->height;

    for (int i = 0; i < n; i++)
        out[i] = arrived[i];
    for (int y = 0; y < p->height; y++) {
        uint32_t *at = out + y * w;

        for (int x = 1; x + 1 < w; x++)
            at[x] = between(at[x], at[x - 1], at[x + 1]);
        for (int x = 0; y > 0 && y + 1 < p->height && x < w; x++)
            at[x] = between(at[x], at[x - w], at[x + w]);
    }
    for (int i = 0; p->agreed && i < n; i++) {
        if (__builtin_popcount(arrived[2 * n + i]) >= AGREE && disparity(out[i]) - (int)arrived[n + i] < STEP)
            out[i] |= SST_GPU_CARRY_AGREED;
    }
}

/* --- self-tests --------------------------------------------------------------------------------------------------- */

#define TEST_WIDTH   53
#define TEST_HEIGHT  29
#define TEST_PIXELS  (TEST_WIDTH * TEST_HEIGHT)
#define TEST_SOURCES 4

struct test {
    struct sst_gpu_check_other source[TEST_SOURCES];
    uint32_t maps[TEST_SOURCES * TEST_PIXELS], arrived[3 * TEST_PIXELS], out[TEST_PIXELS];
};

/* Surfaces on both sides of an edge, a slanted one in front; confidences and results of the check at random. */
static struct test *make_test(void)
{
    struct test *t = calloc(1, sizeof(*t));
    uint32_t state = 31;

    for (int i = 0; t && i < TEST_SOURCES * TEST_PIXELS; i++) {
        const uint32_t x = i % TEST_WIDTH, y = (uint32_t)(i % TEST_PIXELS / TEST_WIDTH);
        const uint32_t d = y > 20 ? 900 - 12 * x : (x < 25 ? 200 : 460) + gpu_random(&state) % (x < 10 ? 90 : 3);

        t->maps[i] = (gpu_random(&state) % 12 ? d : NONE) | gpu_random(&state) % 256 << 16;
    }
    for (int i = 0; t && i < TEST_SOURCES; i++)
        t->source[i] = (struct sst_gpu_check_other){
            (uint32_t)(i * TEST_PIXELS),
            { i == 1 ? -1 : 0, 40000 - 5000 * i, i % 2 ? -1010 : 1030, 0, 32768, i < 2 ? 20 : 30 - 20 * i },
        };
    return t;
}

static struct sst_gpu_work work_of(enum sst_gpu_shader shader, const struct sst_gpu_carry *push, uint32_t layers)
{
    return (struct sst_gpu_work){ .shader = shader,
                                  .push = push,
                                  .groups = { gpu_groups(TEST_WIDTH, 32), gpu_groups(TEST_HEIGHT, 8), layers } };
}

static const struct sst_gpu_carry test_carry = { TEST_WIDTH, TEST_HEIGHT, 1 },
                                  test_plain = { TEST_WIDTH, TEST_HEIGHT, 0 };

static void start_test(struct test *t)
{
    carry_start_reference(&test_carry, (void *const[]){ t->arrived }, NULL);
}

int carry_start_self_test(struct sst_gpu *g)
{
    const struct sst_gpu_work work = work_of(SST_GPU_CARRY_START, &test_carry, 1);
    struct test *t = make_test();
    int err = t ? 0 : -ENOMEM;

    for (int i = 0; t && i < 3 * TEST_PIXELS; i++)
        t->arrived[i] = 7;
    if (!err)
        err = gpu_compare(g, &work, (const void *const[]){ t->arrived }, (const size_t[]){ sizeof(t->arrived) },
                          SST_GPU_CARRY_START_ARRIVED, NULL);
    free(t);
    return err;
}

int carry_project_self_test(struct sst_gpu *g)
{
    const struct sst_gpu_work work = work_of(SST_GPU_CARRY_PROJECT, &test_carry, TEST_SOURCES);
    struct test *t = make_test();
    int err = t ? 0 : -ENOMEM;

    if (!err)
        start_test(t);
    if (!err)
        err = gpu_compare(g, &work, (const void *const[]){ t->source, t->maps, t->arrived },
                          (const size_t[]){ sizeof(t->source), sizeof(t->maps), sizeof(t->arrived) },
                          SST_GPU_CARRY_PROJECT_ARRIVED, NULL);
    free(t);
    return err;
}

int carry_close_self_test(struct sst_gpu *g)
{
    const struct sst_gpu_carry *const push[2] = { &test_plain, &test_carry };
    struct test *t = make_test();
    int err = t ? 0 : -ENOMEM;

    if (!err) {
        start_test(t);
        carry_project_reference(&test_carry, (void *const[]){ t->source, t->maps, t->arrived },
                                (const uint32_t[]){ 1, 1, TEST_SOURCES });
    }
    for (int i = 0; i < 2 && !err; i++) {
        const struct sst_gpu_work work = work_of(SST_GPU_CARRY_CLOSE, push[i], 1);

        err = gpu_compare(g, &work, (const void *const[]){ t->arrived, t->out },
                          (const size_t[]){ sizeof(t->arrived), sizeof(t->out) }, SST_GPU_CARRY_CLOSE_OUT, NULL);
    }
    free(t);
    return err;
}
