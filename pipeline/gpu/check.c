/* The shaders `check`, `fill_start`, `fill_project`, `fill_take`, `fill_along` and `fill_down`: their references and
 * self-tests. */
#include "pipeline/gpu/check.h"

#include <errno.h>
#include <stdlib.h>

#include "pipeline/gpu/gpu_internal.h"

#define NONE  65535
#define AGREE 64 /* 1/64 px */

enum status { CORRECT = 0, MISMATCH = 1, OCCLUSION = 2 };

/* --- references --------------------------------------------------------------------------------------------------- */

static int shifted(int x, int whole, int part, int step, int d)
{
    return x + whole + ((part + d * step) >> 16);
}

static bool agrees(const struct sst_gpu_check *p, void *const *buffer, int x, int y, int d)
{
    const struct sst_gpu_check_other *other = buffer[SST_GPU_CHECK_OTHERS];
    const uint32_t *maps = buffer[SST_GPU_CHECK_MAPS];

    for (int i = 0; i < p->count; i++) {
        const struct sst_gpu_shift *s = &other[i].shift;
        const int xn = shifted(x, s->across, s->across_part, s->across_step, d);
        const int yn = shifted(y, s->down, s->down_part, s->down_step, d);
        int there;

        if (xn < 0 || yn < 0 || xn >= p->width || yn >= p->height)
            continue;
        there = (int)(maps[other[i].first + (uint32_t)(yn * p->width + xn)] & 0xFFFF);
        if (there != NONE && abs(there - d) <= AGREE)
            return true;
    }
    return false;
}

void check_reference(const void *push, void *const *buffer, const uint32_t groups[3] SST_UNUSED)
{
    const struct sst_gpu_check *p = push;
    uint32_t *own = (uint32_t *)buffer[SST_GPU_CHECK_MAPS] + p->own;

    for (int i = 0; i < p->width * p->height; i++) {
        const int d = (int)(own[i] & 0xFFFF), x = i % p->width, y = i / p->width;
        enum status status = d != NONE && agrees(p, buffer, x, y, d) ? CORRECT : OCCLUSION;

        for (int step = 0; status == OCCLUSION && step < p->steps; step++)
            status = agrees(p, buffer, x, y, step * 64) ? MISMATCH : OCCLUSION;
        own[i] = (uint32_t)d | (uint32_t)status << 16;
    }
}

/* Median of the nearest correct pixels in 16 directions, the lower one of an even number. */
static uint32_t median_around(const struct sst_gpu_fill *p, const uint32_t *own, int x, int y)
{
    static const int8_t way[16][2] = { { 2, 0 },  { 2, 1 },  { 2, 2 },  { 1, 2 },   { 0, 2 },   { -1, 2 },
                                       { -2, 2 }, { -2, 1 }, { -2, 0 }, { -2, -1 }, { -2, -2 }, { -1, -2 },
                                       { 0, -2 }, { 1, -2 }, { 2, -2 }, { 2, -1 } };
    uint32_t v[16];
    int n = 0;

    for (int k = 0; k < 16; k++) {
        for (int r = 1;; r++) {
            const int i = x + way[k][0] * r / 2, j = y + way[k][1] * r / 2;
            uint32_t there;
            int at;

            if (i < 0 || j < 0 || i >= p->width || j >= p->height)
                break;
            there = own[j * p->width + i];
            if (there >> 16 != CORRECT)
                continue;
            for (at = n++; at > 0 && v[at - 1] > (there & 0xFFFF); at--)
                v[at] = v[at - 1];
            v[at] = there & 0xFFFF;
            break;
        }
    }
    return n ? v[(n - 1) / 2] : NONE;
}

void fill_start_reference(const void *push, void *const *buffer, const uint32_t groups[3] SST_UNUSED)
{
    const struct sst_gpu_fill *p = push;
    const uint32_t *own = (const uint32_t *)buffer[SST_GPU_FILL_START_MAPS] + p->own;
    uint32_t *out = buffer[SST_GPU_FILL_START_OUT], *arrived = buffer[SST_GPU_FILL_START_ARRIVED];

    for (int i = 0; i < p->width * p->height; i++) {
        const uint32_t status = own[i] >> 16;

        arrived[i] = 0;
        out[i] = status == CORRECT    ? own[i] & 0xFFFF
                 : status == MISMATCH ? median_around(p, own, i % p->width, i / p->width)
                                      : NONE;
    }
}

void fill_project_reference(const void *push, void *const *buffer, const uint32_t groups[3] SST_UNUSED)
{
    const struct sst_gpu_project *p = push;
    const uint32_t *from = (const uint32_t *)buffer[SST_GPU_FILL_PROJECT_MAPS] + p->first;
    uint32_t *arrived = buffer[SST_GPU_FILL_PROJECT_ARRIVED];

    for (int i = 0; i < p->width * p->height; i++) {
        const int d = (int)(from[i] & 0xFFFF);
        const int x = shifted(i % p->width, p->shift.across, p->shift.across_part, p->shift.across_step, d);
        const int y = shifted(i / p->width, p->shift.down, p->shift.down_part, p->shift.down_step, d);
        uint32_t *at = arrived + y * p->width + x;

        if (from[i] >> 16 == CORRECT && x >= 0 && y >= 0 && x < p->width && y < p->height)
            *at = *at > (uint32_t)d + 1 ? *at : (uint32_t)d + 1;
    }
}

void fill_take_reference(const void *push, void *const *buffer, const uint32_t groups[3] SST_UNUSED)
{
    const struct sst_gpu_fill *p = push;
    const uint32_t *own = (const uint32_t *)buffer[SST_GPU_FILL_TAKE_MAPS] + p->own;
    uint32_t *arrived = buffer[SST_GPU_FILL_TAKE_ARRIVED], *out = buffer[SST_GPU_FILL_TAKE_OUT];

    for (int i = 0; i < p->width * p->height; i++) {
        if (own[i] >> 16 == OCCLUSION && out[i] == NONE && arrived[i])
            out[i] = arrived[i] - 1;
        arrived[i] = 0;
    }
}

/* The nearest known disparity of a row from x on, in steps of `way`. */
static uint32_t nearest_along(const uint32_t *row, int width, int x, int way)
{
    for (; x >= 0 && x < width; x += way) {
        if (row[x] != NONE)
            return row[x];
    }
    return NONE;
}

void fill_along_reference(const void *push, void *const *buffer, const uint32_t groups[3] SST_UNUSED)
{
    const struct sst_gpu_background *p = push;
    const uint32_t *from = buffer[SST_GPU_BACKGROUND_FROM];
    uint32_t *to = buffer[SST_GPU_BACKGROUND_TO];

    for (int y = 0; y < p->height; y++, from += p->width, to += p->width) {
        for (int x = 0; x < p->width; x++) {
            const uint32_t left = nearest_along(from, p->width, x, -1), right = nearest_along(from, p->width, x, 1);

            to[x] = left < right ? left : right;
        }
    }
}

void fill_down_reference(const void *push, void *const *buffer, const uint32_t groups[3] SST_UNUSED)
{
    const struct sst_gpu_background *p = push;
    const uint32_t *from = buffer[SST_GPU_BACKGROUND_FROM];
    uint32_t *to = buffer[SST_GPU_BACKGROUND_TO];

    for (int y = 0; y < p->height; y++) {
        int row = y;

        while (row >= 0 && from[row * p->width] == NONE)
            row--;
        for (row = row < 0 ? y : row; row < p->height && from[row * p->width] == NONE;)
            row++;
        for (int x = 0; x < p->width; x++)
            to[y * p->width + x] = row < p->height ? from[row * p->width + x] : NONE;
    }
}

/* --- self-tests --------------------------------------------------------------------------------------------------- */

#define TEST_WIDTH  43
#define TEST_HEIGHT 21
#define TEST_PIXELS (TEST_WIDTH * TEST_HEIGHT)
#define TEST_VIEWS  3
#define TEST_OWN    TEST_PIXELS /* the second view */

struct test {
    struct sst_gpu_check_other other[TEST_VIEWS - 1];
    uint32_t maps[TEST_VIEWS * TEST_PIXELS], out[TEST_PIXELS], arrived[TEST_PIXELS];
};

/* Two surfaces that the views show where they should, with noise; pixels that are not known; statuses at random. */
static struct test *make_test(void)
{
    struct test *t = calloc(1, sizeof(*t));
    uint32_t state = 12;

    for (int i = 0; t && i < TEST_VIEWS * TEST_PIXELS; i++) {
        const int x = i % TEST_WIDTH + 3 * (i / TEST_PIXELS);
        const uint32_t d = (x / 12 % 2 ? 200U : 500U) + gpu_random(&state) % 50;

        t->maps[i] = (gpu_random(&state) % 9 ? d : NONE) | gpu_random(&state) % 3 << 16;
        if ((t->maps[i] & 0xFFFF) == NONE)
            t->maps[i] = NONE | OCCLUSION << 16;
    }
    for (int i = 0; t && i < TEST_PIXELS; i++) {
        t->out[i] = i % 3 ? NONE : 77;
        t->arrived[i] = gpu_random(&state) % 4 ? gpu_random(&state) % 600 : 0;
    }
    for (int i = 0; t && i < TEST_VIEWS - 1; i++)
        t->other[i] = (struct sst_gpu_check_other){
            (uint32_t)(2 * i * TEST_PIXELS),
            { i ? -1 : 0, 40000 - 5000 * i, i ? -1010 : 1030, -i, 32768, 20 - 30 * i },
        };
    return t;
}

static const uint32_t all[3] = { (TEST_WIDTH + 31) / 32, (TEST_HEIGHT + 7) / 8, 1 };

static struct sst_gpu_work work_of(enum sst_gpu_shader shader, const void *push)
{
    return (struct sst_gpu_work){ .shader = shader, .push = push, .groups = { all[0], all[1], all[2] } };
}

int check_self_test(struct sst_gpu *g)
{
    static const struct sst_gpu_check push = { TEST_WIDTH, TEST_HEIGHT, TEST_OWN, TEST_VIEWS - 1, 10 };
    const struct sst_gpu_work work = work_of(SST_GPU_CHECK, &push);
    struct test *t = make_test();
    const int err = t ? gpu_compare(g, &work, (const void *const[]){ t->other, t->maps },
                                    (const size_t[]){ sizeof(t->other), sizeof(t->maps) }, SST_GPU_CHECK_MAPS, NULL)
                      : -ENOMEM;

    free(t);
    return err;
}

static const struct sst_gpu_fill test_fill = { TEST_WIDTH, TEST_HEIGHT, TEST_OWN };

int fill_start_self_test(struct sst_gpu *g)
{
    const struct sst_gpu_work work = work_of(SST_GPU_FILL_START, &test_fill);
    struct test *t = make_test();
    const int err = t ? gpu_compare(g, &work, (const void *const[]){ t->maps, t->out, t->arrived },
                                    (const size_t[]){ sizeof(t->maps), sizeof(t->out), sizeof(t->arrived) },
                                    SST_GPU_FILL_START_OUT, NULL)
                      : -ENOMEM;

    free(t);
    return err;
}

int fill_project_self_test(struct sst_gpu *g)
{
    struct test *t = make_test();
    struct sst_gpu_project push = { TEST_WIDTH, TEST_HEIGHT, 0, { 0 } };
    const struct sst_gpu_work work = work_of(SST_GPU_FILL_PROJECT, &push);
    int err = t ? 0 : -ENOMEM;

    for (int i = 0; i < TEST_VIEWS - 1 && !err; i++) {
        push.first = t->other[i].first;
        push.shift = t->other[i].shift;
        err = gpu_compare(g, &work, (const void *const[]){ t->maps, t->arrived },
                          (const size_t[]){ sizeof(t->maps), sizeof(t->arrived) }, SST_GPU_FILL_PROJECT_ARRIVED,
                          t->arrived);
    }
    free(t);
    return err;
}

int fill_take_self_test(struct sst_gpu *g)
{
    const struct sst_gpu_work work = work_of(SST_GPU_FILL_TAKE, &test_fill);
    struct test *t = make_test();
    const int err = t ? gpu_compare(g, &work, (const void *const[]){ t->maps, t->arrived, t->out },
                                    (const size_t[]){ sizeof(t->maps), sizeof(t->arrived), sizeof(t->out) },
                                    SST_GPU_FILL_TAKE_OUT, NULL)
                      : -ENOMEM;

    free(t);
    return err;
}

/* @param known  of the rows: bits */
static int compare_background(struct sst_gpu *g, enum sst_gpu_shader shader, uint32_t known, bool dense)
{
    static const struct sst_gpu_background push = { TEST_WIDTH, TEST_HEIGHT };
    const struct sst_gpu_work work = work_of(shader, &push);
    struct test *t = make_test();
    uint32_t state = 4;
    int err;

    if (!t)
        return -ENOMEM;
    for (int i = 0; i < TEST_PIXELS; i++) {
        const uint32_t any = gpu_random(&state);

        t->out[i] = known >> i / TEST_WIDTH & 1 && (dense || any % 7 == 0) ? any % 900 : NONE;
    }
    err = gpu_compare(g, &work, (const void *const[]){ t->out, t->arrived },
                      (const size_t[]){ sizeof(t->out), sizeof(t->arrived) }, SST_GPU_BACKGROUND_TO, NULL);
    free(t);
    return err;
}

int fill_along_self_test(struct sst_gpu *g)
{
    return compare_background(g, SST_GPU_FILL_ALONG, 0xFFFF9F, false);
}

int fill_down_self_test(struct sst_gpu *g)
{
    const int err =
        compare_background(g, SST_GPU_FILL_DOWN, 0x0F9FC, true); /* the last rows and the first ones are not */

    return err ? err : compare_background(g, SST_GPU_FILL_DOWN, 0, true);
}
