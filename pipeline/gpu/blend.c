/* The shader `blend`: its reference by the references of kernels, and its self-test. */
#include "pipeline/gpu/blend.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "pipeline/gpu/gpu_internal.h"
#include "pipeline/kernels/exp_neg.h"
#include "pipeline/kernels/kernels.h"

_Static_assert(sizeof(struct sst_gpu_blend_view) == 64 && sizeof(struct sst_gpu_blend_label) == 8,
               "the layout of blend.comp");
_Static_assert(sizeof(struct sst_gpu_blend) <= 128, "Vulkan guarantees 128 bytes of push constants");

/* --- reference ---------------------------------------------------------------------------------------------------- */

/* What the shader is given. */
struct given {
    const struct sst_gpu_blend *push;
    const struct sst_gpu_blend_label *label;
    const struct sst_gpu_blend_view *view;
    const uint32_t *pixel;
    const uint16_t *disp;
    const uint8_t *valid;
    const float *table;
    struct sst_blend_range range[256];
    uint32_t ends[256];
};

/* Sums of one pixel. */
struct sums {
    float sum[4];
    int32_t whole[3];
    uint8_t support;
};

static bool seen(const struct given *in, const struct sst_gpu_blend_view *v, size_t at, size_t right, size_t below)
{
    return !(v->flags & SST_GPU_VIEW_VALID) ||
           (in->valid[at] && in->valid[at + right] && in->valid[at + below] && in->valid[at + right + below]);
}

/* Colours of the four pixels around a ray, as the kernels read them. */
static void set_colours(struct sst_blend *b, uint8_t colour[2][3][2], const struct given *in,
                        const struct sst_gpu_blend_view *v, size_t at, size_t right, size_t below)
{
    for (int c = 0; c < 3; c++) {
        for (size_t i = 0; i < 2; i++) {
            colour[0][c][i] = (uint8_t)(in->pixel[at + (i ? right : 0)] >> (8 * c));
            colour[1][c][i] = (uint8_t)(in->pixel[at + (i ? right : 0) + below] >> (8 * c));
        }
        b->top[c] = colour[0][c];
        b->bottom[c] = colour[1][c];
    }
    for (int i = 0; i < 4; i++)
        b->tap[i] = (int16_t)v->tap[i];
}

/* The ray of one view at pixel (x, y). */
static void add_ray(struct sums *s, const struct given *in, const struct sst_gpu_blend_view *v, int x, int y)
{
    const struct sst_gpu_blend *push = in->push;
    const size_t pitch = (size_t)push->pitch;
    const size_t at = v->first + (size_t)(y + v->iy) * pitch + (size_t)(x + v->ix);
    const size_t right = (v->flags & SST_GPU_VIEW_RIGHT) != 0, below = v->flags & SST_GPU_VIEW_BELOW ? pitch : 0;
    const size_t nearest = v->first + (size_t)(y + v->ny) * pitch + (size_t)(x + v->nx);
    float *const acc[4] = { &s->sum[0], &s->sum[1], &s->sum[2], &s->sum[3] };
    int32_t *const whole[3] = { &s->whole[0], &s->whole[1], &s->whole[2] };
    struct sst_blend b = { .aperture = v->aperture, .c1 = push->c1, .range = in->range };
    uint8_t colour[2][3][2], label = 0;

    if (!seen(in, v, at, right, below))
        return;
    set_colours(&b, colour, in, v, at, right, below);
    if (push->flags & SST_GPU_BLEND_SUMMED) {
        sst_blend_plain_ref(whole, acc[3], &b, 1);
        s->support = 255;
        return;
    }
    b.focus_whole_q6 = push->focus_whole_q6;
    b.focus_part_q6 = push->focus_part_q6;
    b.scale = push->scale;
    memcpy(b.power, push->power, sizeof(b.power));
    b.first = (uint16_t)push->first;
    b.count = (uint16_t)push->count;
    if (push->flags & SST_GPU_BLEND_WEIGHTED) {
        label = (uint8_t)(in->pixel[nearest] >> 24);
        b.disp = in->disp + nearest;
        b.label = v->flags & SST_GPU_VIEW_LABELS && push->flags & SST_GPU_BLEND_BY_LABEL ? &label : NULL;
        sst_blend_support_ref(&s->support, b.disp, v->flags & SST_GPU_VIEW_LABELS ? &label : NULL, in->ends, 1);
    } else {
        s->support = 255;
    }
    sst_blend_rays_ref(acc, &b, 1);
}

/* Carry on, or begin, and write the result of one pixel; `at` its index of `plane` pixels. */
static void blend_pixel(const struct given *in, uint32_t *sums, uint32_t *out, size_t at, size_t plane, int x, int y)
{
    const uint32_t flags = in->push->flags;
    struct sums s = { 0 };

    if (!(flags & SST_GPU_BLEND_FIRST)) {
        for (size_t c = 0; c < 4; c++)
            memcpy(&s.sum[c], &sums[at + c * plane], sizeof(s.sum[c]));
        for (size_t c = 0; c < 3; c++)
            s.whole[c] = (int32_t)sums[at + c * plane];
        s.support = out[at] >> 24 ? 255 : 0;
    }
    for (uint32_t i = in->push->first_view; i < in->push->first_view + in->push->views; i++) {
        const struct sst_gpu_blend_view *v = &in->view[i];

        if (x >= v->x0 && x < v->x1 && y >= v->y0 && y < v->y1)
            add_ray(&s, in, v, x, y);
    }
    for (size_t c = 0; c < 4 && !(flags & SST_GPU_BLEND_LAST); c++) {
        if (c < 3 && flags & SST_GPU_BLEND_SUMMED)
            sums[at + c * plane] = (uint32_t)s.whole[c];
        else
            memcpy(&sums[at + c * plane], &s.sum[c], sizeof(s.sum[c]));
    }
    out[at] = s.support ? SST_GPU_PIXEL_SUPPORTED << 24 : 0;
    if (!(flags & SST_GPU_BLEND_LAST))
        return;
    for (int c = 0; c < 3; c++) {
        const float sum = flags & SST_GPU_BLEND_SUMMED ? (float)s.whole[c] : s.sum[c];
        uint8_t level;

        sst_blend_finish_ref(&level, &sum, &s.sum[3], 1);
        out[at] |= (uint32_t)level << (8 * c);
    }
    if (s.sum[3] < SST_BLEND_FLOOR)
        out[at] |= (uint32_t)SST_GPU_PIXEL_BELOW << 24;
    if (flags & SST_GPU_BLEND_WEIGHTS)
        memcpy(&sums[at + 3 * plane], &s.sum[3], sizeof(s.sum[3]));
}

void blend_reference(const void *push, void *const *buffer, const uint32_t groups[3] SST_UNUSED)
{
    const struct sst_gpu_blend *p = push;
    struct given in = { .push = p,
                        .label = buffer[SST_GPU_BLEND_PARAMS],
                        .pixel = buffer[SST_GPU_BLEND_PIXELS],
                        .disp = buffer[SST_GPU_BLEND_DISP],
                        .valid = buffer[SST_GPU_BLEND_VALID],
                        .table = buffer[SST_GPU_BLEND_TABLE] };

    in.view = (const void *)(in.label + 256);
    for (int i = 0; i < 256; i++) {
        in.range[i].weight = in.table + (size_t)in.label[i].row * SST_BLEND_COLUMNS;
        in.ends[i] = in.label[i].ends;
    }
    for (int row = 0; row < p->rows; row++) {
        for (int x = 0; x < p->width; x++)
            blend_pixel(&in, buffer[SST_GPU_BLEND_SUMS], buffer[SST_GPU_BLEND_OUT],
                        (size_t)row * (size_t)p->width + (size_t)x, (size_t)p->rows * (size_t)p->width, x,
                        p->top + row);
    }
}

/* --- self-test ---------------------------------------------------------------------------------------------------- */

#define TEST_WIDTH  45
#define TEST_HEIGHT 13
#define TEST_PITCH  48
#define TEST_VIEWS  5
#define TEST_PIXELS (TEST_VIEWS * TEST_PITCH * TEST_HEIGHT)
#define TEST_LABELS 3
#define TEST_TOP    2 /* first row of the part that is rendered */
#define TEST_ROWS   9

struct test {
    struct sst_gpu_blend push;
    struct params {
        struct sst_gpu_blend_label label[256];
        struct sst_gpu_blend_view view[TEST_VIEWS];
    } params;
    uint32_t pixel[TEST_PIXELS];
    uint16_t disp[TEST_PIXELS];
    uint8_t valid[TEST_PIXELS];
    float table[TEST_LABELS * SST_BLEND_COLUMNS];
    uint32_t sums[4 * TEST_ROWS * TEST_WIDTH];
    uint32_t out[TEST_ROWS * TEST_WIDTH];
};

static uint32_t next_random(uint32_t *state)
{
    *state = *state * 1664525U + 1013904223U;
    return *state >> 8;
}

/* Views shifted by fractions of pixels, some whole, one partly invalid, one without labels. */
static void set_test_views(struct test *t)
{
    static const double shift[TEST_VIEWS][2] = { { 0, 0 }, { 1.25, -0.5 }, { -2.75, 1 }, { 0, 0.4375 }, { 3, -1.9 } };

    for (int i = 0; i < TEST_VIEWS; i++) {
        struct sst_gpu_blend_view *v = &t->params.view[i];
        const double fx = shift[i][0] - floor(shift[i][0]), fy = shift[i][1] - floor(shift[i][1]);
        int16_t tap[4];

        sst_blend_set_taps(tap, fx, fy);
        v->ix = (int32_t)floor(shift[i][0]);
        v->iy = (int32_t)floor(shift[i][1]);
        v->nx = v->ix + (fx >= 0.5);
        v->ny = v->iy + (fy >= 0.5);
        v->x0 = sst_clamp_int(-v->ix, 0, TEST_WIDTH);
        v->x1 = sst_clamp_int(TEST_WIDTH - v->ix - (fx > 0), 0, TEST_WIDTH);
        v->y0 = sst_clamp_int(-v->iy, 0, TEST_HEIGHT);
        v->y1 = sst_clamp_int(TEST_HEIGHT - v->iy - (fy > 0), 0, TEST_HEIGHT);
        for (int k = 0; k < 4; k++)
            v->tap[k] = tap[k];
        v->aperture = 1 - 0.125F * (float)i;
        v->first = (uint32_t)(i * TEST_PITCH * TEST_HEIGHT);
        v->flags = (fx > 0 ? SST_GPU_VIEW_RIGHT : 0U) | (fy > 0 ? SST_GPU_VIEW_BELOW : 0U) |
                   (i == 1 ? SST_GPU_VIEW_VALID : 0U) | (i != 3 ? SST_GPU_VIEW_LABELS : 0U);
    }
}

/* Disparities around the focus, far from it and unknown; labels that weigh differently. */
static void set_test(struct test *t)
{
    static const float power[SST_EXP2_POWERS] = SST_EXP2_POWER;
    uint32_t state = 1;

    set_test_views(t);
    t->push = (struct sst_gpu_blend){ .width = TEST_WIDTH,
                                      .pitch = TEST_PITCH,
                                      .top = TEST_TOP,
                                      .rows = TEST_ROWS,
                                      .views = TEST_VIEWS,
                                      .focus_whole_q6 = 700,
                                      .focus_part_q6 = 0.25F,
                                      .scale = 0.0002F,
                                      .c1 = 0.005F,
                                      .first = 300,
                                      .count = 900 };
    for (int i = 0; i < SST_EXP2_POWERS; i++)
        t->push.power[i] = (1 - t->push.c1) * power[i];
    for (size_t i = 0; i < TEST_PIXELS; i++) {
        const uint32_t r = next_random(&state);

        t->pixel[i] = (r & 0xFFFFFF) | (next_random(&state) % TEST_LABELS) << 24;
        t->disp[i] = (uint16_t)(r % 11 == 0 ? 0xFFFF : r % 7 == 0 ? r % 4000 : 600 + r % 200);
        t->valid[i] = next_random(&state) % 8 ? 255 : 0;
    }
    for (uint32_t i = 0; i < TEST_LABELS * SST_BLEND_COLUMNS; i++)
        t->table[i] = 0.02F + (float)(next_random(&state) & 0xFF) / 256;
    for (uint32_t i = 0; i < 256; i++)
        t->params.label[i] =
            (struct sst_gpu_blend_label){ i % TEST_LABELS, (650 + i % 3 * 20) | (700 + i % 3 * 20) << 16 };
}

static bool near(float a, float b)
{
    return fabsf(a - b) <= SST_GPU_BLEND_WEIGHT * fmaxf(fabsf(a), fabsf(b));
}

static bool same_pixel(uint32_t a, uint32_t b)
{
    bool same = a >> 24 == b >> 24;

    for (int c = 0; c < 3; c++)
        same = same && abs((int)(a >> (8 * c) & 0xFF) - (int)(b >> (8 * c) & 0xFF)) <= SST_GPU_BLEND_LEVELS;
    return same;
}

static bool same_results(const struct test *t, uint8_t *const device[], uint8_t *const host[])
{
    const size_t plane = (size_t)TEST_ROWS * TEST_WIDTH;
    const uint32_t *a = (const void *)device[SST_GPU_BLEND_OUT], *b = (const void *)host[SST_GPU_BLEND_OUT];
    const float *p = (const void *)device[SST_GPU_BLEND_SUMS], *q = (const void *)host[SST_GPU_BLEND_SUMS];
    bool same = true;

    for (size_t i = 0; i < plane && same; i++)
        same = same_pixel(a[i], b[i]);
    if (t->push.flags & SST_GPU_BLEND_SUMMED) /* whole numbers, and a count of rays */
        return same && !memcmp(p, q, 4 * plane * sizeof(*p));
    for (size_t i = 0; i < 4 * plane && same; i++)
        same = near(p[i], q[i]);
    return same;
}

static int run_test(struct sst_gpu *g, struct test *t, uint32_t flags)
{
    const void *const initial[SST_GPU_BUFFERS] = { &t->params, t->pixel, t->disp, t->valid, t->table, t->sums, t->out };
    const size_t bytes[SST_GPU_BUFFERS] = { sizeof(t->params), sizeof(t->pixel), sizeof(t->disp), sizeof(t->valid),
                                            sizeof(t->table),  sizeof(t->sums),  sizeof(t->out) };
    const struct sst_gpu_work work = {
        .shader = SST_GPU_BLEND,
        .push = &t->push,
        .groups = { (TEST_WIDTH + SST_GPU_BLEND_GROUP_WIDTH - 1) / SST_GPU_BLEND_GROUP_WIDTH,
                    (TEST_ROWS + SST_GPU_BLEND_GROUP_HEIGHT - 1) / SST_GPU_BLEND_GROUP_HEIGHT, 1 },
    };
    uint8_t *device[SST_GPU_BUFFERS], *host[SST_GPU_BUFFERS];
    int err;

    t->push.flags = flags;
    err = gpu_run_both(g, &work, initial, bytes, device, host);
    if (err)
        return err;
    err = same_results(t, device, host) ? 0 : -ENOTSUP;
    memcpy(t->sums, host[SST_GPU_BLEND_SUMS], sizeof(t->sums)); /* which the next test may carry on */
    memcpy(t->out, host[SST_GPU_BLEND_OUT], sizeof(t->out));
    for (int i = 0; i < SST_GPU_BUFFERS; i++) {
        free(device[i]);
        free(host[i]);
    }
    return err;
}

int blend_self_test(struct sst_gpu *g)
{
    static const uint32_t kinds[] = { SST_GPU_BLEND_SUMMED, 0, SST_GPU_BLEND_WEIGHTED,
                                      SST_GPU_BLEND_WEIGHTED | SST_GPU_BLEND_BY_LABEL };
    struct test *t = calloc(1, sizeof(*t));
    int err = t ? 0 : -ENOMEM;

    if (!err)
        set_test(t);
    for (size_t i = 0; i < ARRAY_LEN(kinds) && !err; i++) {
        t->push.views = TEST_VIEWS;
        err = run_test(g, t, kinds[i] | SST_GPU_BLEND_FIRST | SST_GPU_BLEND_LAST | SST_GPU_BLEND_WEIGHTS);
        t->push.views = 2; /* in two dispatches */
        if (!err)
            err = run_test(g, t, kinds[i] | SST_GPU_BLEND_FIRST);
        t->push.first_view = 2;
        t->push.views = TEST_VIEWS - 2;
        if (!err)
            err = run_test(g, t, kinds[i] | SST_GPU_BLEND_LAST);
        t->push.first_view = 0;
    }
    free(t);
    return err;
}
