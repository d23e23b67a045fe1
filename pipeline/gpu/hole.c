/* The shaders `hole_pull` and `hole_push`: their references by pyramid_ref.h, and their self-tests. */
#include "pipeline/gpu/hole.h"

#include <errno.h>
#include <stdlib.h>

#include "pipeline/gpu/gpu_internal.h"
#include "pipeline/kernels/pyramid_ref.h"

_Static_assert(sizeof(struct sst_gpu_hole) == 28, "the layout of hole.glsl");

/* --- references --------------------------------------------------------------------------------------------------- */

struct given {
    const struct sst_gpu_hole *push;
    float (*level)[4];
    uint32_t *picture;
};

static struct given given_of(const void *push, void *const *buffer)
{
    return (struct given){ push, buffer[SST_GPU_HOLE_LEVELS], buffer[SST_GPU_HOLE_PICTURE] };
}

static size_t pixel_at(const struct sst_gpu_hole *p, int x, int y)
{
    return (size_t)(y - p->top) * (size_t)p->width + (size_t)x;
}

static size_t finer_at(const struct sst_gpu_hole *p, int x, int y)
{
    return p->finer + (size_t)y * (size_t)p->width + (size_t)x;
}

/* Add a pixel of the finer level. */
static void add(float sum[4], const struct given *in, int x, int y)
{
    if (in->push->from_picture) {
        const uint32_t word = in->picture[pixel_at(in->push, x, y)];
        const float w = sst_pyramid_weight((uint8_t)(word >> 24));

        for (int c = 0; c < 3; c++)
            sum[c] += w * (float)(word >> (8 * c) & 0xFF);
        sum[3] += w;
        return;
    }
    for (int c = 0; c < 4; c++)
        sum[c] += in->level[finer_at(in->push, x, y)][c];
}

void hole_pull_reference(const void *push, void *const *buffer, const uint32_t groups[3] SST_UNUSED)
{
    const struct given in = given_of(push, buffer);
    const struct sst_gpu_hole *p = in.push;
    const int width = sst_pyramid_half(p->width), height = sst_pyramid_half(p->height);

    for (int y = p->top / 2; 2 * y < p->top + p->rows; y++) {
        for (int x = 0; x < width; x++) {
            float *to = in.level[p->coarser + (size_t)y * (size_t)width + (size_t)x], sum[4] = { 0 };

            for (int sy = 2 * y; sy < sst_min_int(2 * y + 2, p->height); sy++) {
                for (int sx = 2 * x; sx < sst_min_int(2 * x + 2, p->width); sx++)
                    add(sum, &in, sx, sy);
            }
            for (int c = 0; c < 4; c++)
                to[c] = sst_pyramid_pull(sum[c], sum[3]);
            for (int c = 0; c < 3 && width == 1 && height == 1 && to[3] > 0; c++)
                to[c] /= to[3];
        }
    }
}

/* The coarser level at pixel (x, y) of the finer one. */
static float between(const struct given *in, int c, int x, int y)
{
    const int width = sst_pyramid_half(in->push->width), height = sst_pyramid_half(in->push->height);
    const int x0 = x / 2, x1 = sst_pyramid_beside(x, width), y1 = sst_pyramid_beside(y, height);
    float(*const near)[4] = in->level + in->push->coarser + (size_t)(y / 2) * (size_t)width;
    float(*const far)[4] = in->level + in->push->coarser + (size_t)y1 * (size_t)width;

    return sst_pyramid_between(near[x0][c], near[x1][c], far[x0][c], far[x1][c]);
}

static void push_level(const struct given *in, int x, int y)
{
    float *to = in->level[finer_at(in->push, x, y)];
    const float lack = 1 - to[3];

    for (int c = 0; c < 3 && lack > 0; c++)
        to[c] += lack * between(in, c, x, y);
}

static void push_picture(const struct given *in, int x, int y)
{
    uint32_t *at = &in->picture[pixel_at(in->push, x, y)], word = *at;
    const uint8_t weight = (uint8_t)(word >> 24);

    if (weight == 255)
        return;
    *at = word & 0xFF000000U;
    for (int c = 0; c < 3; c++) {
        const uint8_t colour = (uint8_t)(word >> (8 * c));

        *at |= (uint32_t)sst_pyramid_mix(colour, sst_pyramid_weight(weight), between(in, c, x, y)) << (8 * c);
    }
}

void hole_push_reference(const void *push, void *const *buffer, const uint32_t groups[3] SST_UNUSED)
{
    const struct given in = given_of(push, buffer);

    for (int y = in.push->top; y < in.push->top + in.push->rows; y++) {
        for (int x = 0; x < in.push->width; x++) {
            if (in.push->from_picture)
                push_picture(&in, x, y);
            else
                push_level(&in, x, y);
        }
    }
}

/* --- self-tests --------------------------------------------------------------------------------------------------- */

#define TEST_WIDTH  45
#define TEST_HEIGHT 13
#define TEST_HALF   (23 * 7) /* pixels of the first level */
#define TEST_LEVELS (TEST_HALF + 12 * 4 + 4)
#define TEST_TOP    4 /* of rows of the picture that are there */
#define TEST_ROWS   9

struct test {
    float level[TEST_LEVELS][4];
    uint32_t picture[TEST_ROWS * TEST_WIDTH];
};

/* All weights, and a hole that coarse levels fill. */
static struct test *make_test(void)
{
    struct test *t = calloc(1, sizeof(*t));
    uint32_t state = 9;

    for (int i = 0; t && i < TEST_ROWS * TEST_WIDTH; i++) {
        const uint32_t weight = i % TEST_WIDTH < 24 ? 0 : i % 3 ? gpu_random(&state) & 0xFF : 255;

        t->picture[i] = (gpu_random(&state) & 0xFFFFFF) | weight << 24;
    }
    for (int i = 0; t && i < TEST_LEVELS; i++) {
        const float w = i % 5 ? (float)(gpu_random(&state) % 1024) / 1023 : (float)(i % 2);

        for (int c = 0; c < 3; c++)
            t->level[i][c] = w * (float)(gpu_random(&state) % 65536) / 257;
        t->level[i][3] = w;
    }
    return t;
}

/* Between the picture and the first level, this and the second one, and of the last three pixels one. */
static int test_shader(struct sst_gpu *g, enum sst_gpu_shader shader)
{
    static const struct sst_gpu_hole cases[] = {
        { TEST_WIDTH, TEST_HEIGHT, TEST_TOP, TEST_ROWS, 0, 0, 1 },
        { 23, 7, 0, 7, 0, TEST_HALF, 0 },
        { 2, 1, 0, 1, TEST_HALF, TEST_HALF + 2, 0 },
    };
    struct test *t = make_test();
    int err = t ? 0 : -ENOMEM;

    for (size_t i = 0; i < ARRAY_LEN(cases) && !err; i++) {
        const int of = shader == SST_GPU_HOLE_PULL ? 2 : 1;
        const struct sst_gpu_work work = {
            .shader = shader,
            .push = &cases[i],
            .groups = { gpu_groups((cases[i].width + of - 1) / of, SST_GPU_HOLE_GROUP_WIDTH),
                        gpu_groups((cases[i].rows + of - 1) / of, SST_GPU_HOLE_GROUP_HEIGHT), 1 },
        };
        const void *const initial[] = { t->level, t->picture };
        const size_t bytes[] = { sizeof(t->level), sizeof(t->picture) };

        err = gpu_compare(g, &work, initial, bytes, 0, NULL);
    }
    free(t);
    return err;
}

int hole_pull_self_test(struct sst_gpu *g)
{
    return test_shader(g, SST_GPU_HOLE_PULL);
}

int hole_push_self_test(struct sst_gpu *g)
{
    return test_shader(g, SST_GPU_HOLE_PUSH);
}
