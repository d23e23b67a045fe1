/* The shaders `clear_land`, `clear_surface` and `clear_blend`: their references by those of kernels, and their
 * self-tests. */
#include "pipeline/gpu/clear_sample.h"

#include <assert.h>
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "pipeline/gpu/gpu_internal.h"
#include "pipeline/kernels/kernels.h"

_Static_assert(sizeof(struct sst_gpu_clear_view) == 40 && sizeof(struct sst_gpu_clear) <= 128,
               "the layout of clear_land.comp and clear_blend.comp");

/* --- references --------------------------------------------------------------------------------------------------- */

struct given {
    const struct sst_gpu_clear *push;
    const struct sst_gpu_clear_view *view;
    const uint32_t *pixel;
    const uint16_t *disp;
    const uint8_t *valid, *masks;
    uint32_t *landed;
    const struct sst_gpu_clear_state *state;
};

static size_t row_at(const struct given *in, int y)
{
    return (size_t)y * (size_t)in->push->pitch;
}

/* Of view k, which has row y. */
static size_t view_row(const struct given *in, size_t k, int y)
{
    return in->view[k].first + row_at(in, y - in->view[k].top);
}

/* Pixels of row y of view k to be removed; none where there is no such row. @param removed  out [width] */
static void mark_removed(uint8_t *removed, const struct given *in, size_t k, int y)
{
    const struct sst_gpu_clear_view *v = &in->view[k];
    const size_t width = (size_t)in->push->width;
    size_t at;

    memset(removed, 0, width);
    if (y < v->top || y >= v->end)
        return;
    at = view_row(in, k, y);
    sst_clear_removed_ref(removed, in->disp + at, in->push->cut_q6, width);
    for (size_t x = 0; x < width; x++) {
        if (in->push->remove_label && v->flags & SST_GPU_CLEAR_LABELS)
            removed[x] |= in->pixel[at + x] >> 24 == (uint32_t)in->push->remove_label;
        if (v->flags & SST_GPU_CLEAR_MASK)
            removed[x] |= in->masks[at + x] != 0;
        if (v->flags & SST_GPU_CLEAR_VALID)
            removed[x] |= !in->valid[at + x];
    }
}

/* Memory of a reference: the dummy device is for tests. */
static void *reserve(size_t bytes)
{
    void *p = calloc(bytes, 1);

    assert(p);
    return p;
}

static void land_view(const struct given *in, size_t k)
{
    const struct sst_gpu_clear *p = in->push;
    const struct sst_gpu_clear_view *v = &in->view[k];
    const struct sst_clear_view at = { .width = p->width,
                                       .height = p->height,
                                       .x_q6 = v->x_q6,
                                       .x_0 = v->x_0,
                                       .y_q6 = v->y_q6,
                                       .y_0 = v->y_0,
                                       .coarse = p->coarse };
    const size_t width = (size_t)p->width, band = row_at(in, p->rows), first = row_at(in, p->top);
    uint32_t *landed = in->landed + k * band;
    uint16_t *map = reserve(row_at(in, p->height) * sizeof(*map));
    uint8_t *rows = reserve(4 * (width + 2));

    for (size_t i = 0; i < band; i++)
        map[first + i] = (uint16_t)landed[i];
    for (int y = v->top; y < v->end; y++) {
        uint8_t *const row[3] = { rows + 1, rows + width + 3, rows + 2 * width + 5 };
        uint8_t *state = rows + 3 * (width + 2);
        const uint16_t *disp = in->disp + view_row(in, k, y);

        for (int i = 0; i < 3; i++)
            mark_removed(row[i], in, k, y + i - 1);
        sst_clear_state_ref(state, (const uint8_t *const *)row, disp, p->bins, width);
        sst_clear_land_ref(map, (size_t)p->pitch, &at, disp, state, 0, y, at.width);
    }
    for (size_t i = 0; i < band; i++)
        landed[i] = map[first + i];
    free(map);
    free(rows);
}

void clear_land_reference(const void *push, void *const *buffer, const uint32_t groups[3] SST_UNUSED)
{
    const struct given in = { .push = push,
                              .view = buffer[SST_GPU_LAND_VIEWS],
                              .pixel = buffer[SST_GPU_LAND_PIXELS],
                              .disp = buffer[SST_GPU_LAND_DISP],
                              .valid = buffer[SST_GPU_LAND_VALID],
                              .masks = buffer[SST_GPU_LAND_MASKS],
                              .landed = buffer[SST_GPU_LAND_LANDED] };

    if (in.push->zero)
        memset(in.landed, 0, in.push->views * row_at(&in, in.push->rows) * sizeof(*in.landed));
    for (size_t k = 0; k < in.push->views && !in.push->zero; k++)
        land_view(&in, k);
}

/* Rays of a block, and memory for them. */
struct block {
    struct sst_clear_rays rays;
    struct sst_clear_colours out;
    float surface[SST_CLEAR_BLOCK];
    uint16_t landed[SST_GPU_CLEAR_VIEWS][SST_CLEAR_BLOCK];
    float weight[SST_GPU_CLEAR_VIEWS][SST_CLEAR_BLOCK], agree[SST_GPU_CLEAR_VIEWS][SST_CLEAR_BLOCK];
    float colour[3][SST_GPU_CLEAR_VIEWS][SST_CLEAR_BLOCK];
    struct sst_clear_view view[SST_GPU_CLEAR_VIEWS];
};

/* The pixels of a view as planes, with what may be read after them. */
static void unpack_view(struct sst_clear_view *to, const struct given *in, size_t k)
{
    const size_t n = row_at(in, in->push->height), top = row_at(in, in->view[k].top);
    uint8_t *planes = reserve(3 * n + 16);

    *to = (struct sst_clear_view){ .width = in->push->width,
                                   .height = in->push->height,
                                   .stride = (size_t)in->push->pitch,
                                   .bx = in->view[k].bx,
                                   .by = in->view[k].by };
    for (size_t c = 0; c < 3; c++) {
        to->plane[c] = planes + c * n;
        for (size_t i = top; i < row_at(in, in->view[k].end); i++)
            planes[c * n + i] = (uint8_t)(in->pixel[in->view[k].first + i - top] >> (8 * c));
    }
}

/* As clear.c of pipeline/method/render/ does it. */
static void find_surface(struct block *b, const struct sst_gpu_clear *p)
{
    const uint16_t *landed[SST_GPU_CLEAR_VIEWS];
    const double scale = (double)(1 << p->coarse) / 64,
                 disp_min_px = (double)p->disp_min_px + (double)p->disp_min_rest_px;

    for (size_t k = 0; k < p->views; k++)
        landed[k] = b->landed[k];
    sst_clear_surface_ref(b->surface, landed, p->views);
    for (int i = 0; i < SST_CLEAR_BLOCK; i++) {
        const float level = b->surface[i];
        const int whole = (int)level, up = (float)whole < level;

        b->rays.first[i] = (uint16_t)(level > 0 ? sst_max_int(whole + up - SST_CLEAR_TOLERANCE, 1) : 1);
        b->rays.last[i] = (uint16_t)(level > 0 ? sst_min_int(whole + SST_CLEAR_TOLERANCE, UINT16_MAX) : 0);
        b->rays.px[i] = (float)(disp_min_px + (double)(level - 1) * scale);
        b->rays.wanted[i] = (int16_t)(level > 0 ? p->rays : 0);
    }
}

/* What is seen, as clear.c of pipeline/method/render/ notes it. */
static void note_surface(const struct block *b, const struct sst_gpu_clear *p, uint32_t *seen, int n)
{
    const float scale = (float)(1 << p->coarse);

    for (int i = 0; i < n; i++) {
        const bool any = b->out.weight[i] > 0;
        const uint32_t disp = any ? (uint32_t)((b->surface[i] - 1) * scale + 0.5F) : UINT16_MAX;

        seen[i] = disp | (uint32_t)fminf(SST_GPU_CLEAR_SUPPORT * b->out.support[i] + 0.5F, 255) << 16;
    }
}

/* The surfaces of a block of landed rays. */
static void land_block(struct block *b, const struct given *in, int x, int row)
{
    const int n = sst_min_int(in->push->width - x, SST_CLEAR_BLOCK);

    memset(b->landed, 0, sizeof(b->landed));
    for (size_t k = 0; k < in->push->views; k++) {
        for (int i = 0; i < n; i++)
            b->landed[k][i] = (uint16_t)in->landed[k * row_at(in, in->push->rows) + row_at(in, row) + (size_t)(x + i)];
    }
    find_surface(b, in->push);
}

/* Rays that see the surfaces of landed ones. @return the slot of the viewpoint's own camera, or -1 */
static int take_block(struct block *b, const struct given *in, int x, int row)
{
    int own = -1, more = 1;

    land_block(b, in, x, row);
    b->rays.slots = 0;
    for (size_t k = 0; k < in->push->views && more; k++) {
        const struct sst_clear_view *v = &b->view[k];
        const int slot = b->rays.slots;

        more = sst_clear_take_ref(&b->rays, v, b->landed[k], x, in->push->top + row);
        if (b->rays.slots > slot && v->bx * v->bx + v->by * v->by < 1e-12F)
            own = slot;
    }
    return own;
}

/* Colours of rays that are between the pixels of their view, in a slot of its own: of all that are marked in `landed`.
 */
static void take_plain(struct block *b, const struct given *in, int k, int x, int row)
{
    struct sst_clear_rays one = b->rays;
    float weight[1][SST_CLEAR_BLOCK], colour[3][1][SST_CLEAR_BLOCK];

    one.slots = 0;
    one.weight = weight;
    for (int c = 0; c < 3; c++)
        one.colour[c] = colour[c];
    for (int i = 0; i < SST_CLEAR_BLOCK; i++) {
        one.first[i] = one.last[i] = 1; /* the level of a mark */
        one.wanted[i] = 1;
    }
    (void)sst_clear_take_ref(&one, &b->view[k], b->landed[k], x, in->push->top + row);
    for (int i = 0; i < SST_CLEAR_BLOCK; i++) {
        for (int c = 0; c < 3 && b->landed[k][i]; c++)
            b->colour[c][k][i] = colour[c][0][i];
    }
}

/* The same of rays that were sampled: a slot a view. */
static int take_sampled(struct block *b, const struct given *in, int x, int row)
{
    const int n = sst_min_int(in->push->width - x, SST_CLEAR_BLOCK);
    const struct sst_gpu_clear_state *state = in->state + row * in->push->width + x;
    int own = -1;

    for (int i = 0; i < SST_CLEAR_BLOCK; i++) {
        b->surface[i] = i < n ? state[i].level : 0;
        b->rays.px[i] = i < n ? state[i].px : 0;
    }
    b->rays.slots = (int)in->push->views;
    for (size_t k = 0; k < in->push->views; k++) {
        const struct sst_gpu_clear_view *v = &in->view[k];

        if (v->bx * v->bx + v->by * v->by < 1e-12F)
            own = (int)k;
        for (int i = 0; i < SST_CLEAR_BLOCK; i++) {
            const size_t at = k * row_at(in, in->push->rows) + row_at(in, row) + (size_t)(x + i);
            const uint32_t ray = i < n ? in->landed[at] : 0;

            b->weight[k][i] = ray >> 24 & SST_GPU_RAY_FULL ? 1 : ray >> 24 ? SST_CLEAR_RIM : 0;
            for (int c = 0; c < 3; c++)
                b->colour[c][k][i] = (float)(ray >> (8 * c) & 0xFF);
            b->landed[k][i] = ray >> 24 & SST_GPU_RAY_PLAIN ? 3 : 0;
        }
        take_plain(b, in, (int)k, x, row);
    }
    return own;
}

/* @param seen, out  of the pixels from x on of a row of the results */
static void colour_block(struct block *b, const struct given *in, uint32_t *seen, uint32_t *out, int x, int row)
{
    const int n = sst_min_int(in->push->width - x, SST_CLEAR_BLOCK);
    const int own = in->push->sampled ? take_sampled(b, in, x, row) : take_block(b, in, x, row);

    sst_clear_blend_ref(&b->out, &b->rays, in->push->as_others ? -1 : own);
    if (in->push->merged)
        note_surface(b, in->push, seen, n);
    for (int i = 0; i < n; i++) {
        const float t = fminf(b->out.weight[i], 1);

        out[i] = (uint32_t)(255 * t * t + 0.5F) << 24;
        for (int c = 0; c < 3; c++)
            out[i] |= (uint32_t)(b->out.colour[c][i] + 0.5F) << (8 * c);
    }
}

void clear_blend_reference(const void *push, void *const *buffer, const uint32_t groups[3] SST_UNUSED)
{
    const struct given in = { .push = push,
                              .view = buffer[SST_GPU_CLEAR_VIEWS_OF],
                              .pixel = buffer[SST_GPU_CLEAR_PIXELS],
                              .landed = buffer[SST_GPU_CLEAR_LANDED],
                              .state = buffer[SST_GPU_CLEAR_STATE] };
    uint32_t *seen = buffer[SST_GPU_CLEAR_SEEN], *out = buffer[SST_GPU_CLEAR_OUT];
    struct block *b = reserve(sizeof(*b));

    b->rays.weight = b->weight;
    b->rays.agree = b->agree;
    for (int c = 0; c < 3; c++)
        b->rays.colour[c] = b->colour[c];
    for (size_t k = 0; k < in.push->views; k++)
        unpack_view(&b->view[k], &in, k);
    for (int row = 0; row < in.push->rows; row++) {
        for (int x = 0; x < in.push->width; x += SST_CLEAR_BLOCK) {
            const size_t at = (size_t)row * (size_t)in.push->width + (size_t)x;

            colour_block(b, &in, seen + at, out + at, x, row);
        }
    }
    for (size_t k = 0; k < in.push->views; k++)
        free((void *)b->view[k].plane[0]);
    free(b);
}

void clear_surface_reference(const void *push, void *const *buffer, const uint32_t groups[3] SST_UNUSED)
{
    const struct given in = { .push = push, .landed = buffer[SST_GPU_SURFACE_LANDED] };
    struct sst_gpu_clear_state *state = buffer[SST_GPU_SURFACE_STATE];
    struct block *b = reserve(sizeof(*b));

    for (int row = 0; row < in.push->rows; row++) {
        for (int x = 0; x < in.push->width; x += SST_CLEAR_BLOCK) {
            land_block(b, &in, x, row);
            for (int i = 0; i < SST_CLEAR_BLOCK && x + i < in.push->width; i++) {
                const bool any = b->surface[i] > 0;

                state[row * in.push->width + x + i] =
                    (struct sst_gpu_clear_state){ b->surface[i], any ? b->rays.px[i] : 0,
                                                  any ? (uint32_t)in.push->rays : 0 };
            }
        }
    }
    free(b);
}

/* --- self-tests --------------------------------------------------------------------------------------------------- */

#define TEST_WIDTH  45
#define TEST_HEIGHT 13
#define TEST_PITCH  48
#define TEST_PLANE  (TEST_PITCH * TEST_HEIGHT)
#define TEST_VIEWS  9
#define TEST_TOP    4 /* of a band of the picture */
#define TEST_ROWS   5

struct test {
    struct sst_gpu_clear push;
    struct sst_gpu_clear_view view[TEST_VIEWS];
    uint32_t pixel[TEST_VIEWS * TEST_PLANE];
    uint16_t disp[TEST_VIEWS * TEST_PLANE];
    uint8_t valid[TEST_VIEWS * TEST_PLANE], masks[TEST_VIEWS * TEST_PLANE];
    uint32_t landed[TEST_VIEWS * TEST_PLANE];
    uint32_t seen[TEST_WIDTH * TEST_HEIGHT], out[TEST_WIDTH * TEST_HEIGHT];
    struct sst_gpu_clear_state state[TEST_WIDTH * TEST_HEIGHT];
};

static uint32_t next_random(uint32_t *state)
{
    *state = *state * 1664525U + 1013904223U;
    return *state >> 8;
}

/* Two surfaces and noise, seen from around the viewpoint, which has a camera; every way to remove a pixel.
 * @param coarse  also: only a band, and of views that lie nowhere higher or lower the rows that it needs */
static void set_test(struct test *t, bool coarse)
{
    uint32_t state = 5;

    t->push = (struct sst_gpu_clear){ .width = TEST_WIDTH,
                                      .height = TEST_HEIGHT,
                                      .pitch = TEST_PITCH,
                                      .bins = 2000,
                                      .cut_q6 = 1500,
                                      .remove_label = 3,
                                      .rays = 5,
                                      .views = TEST_VIEWS,
                                      .disp_min_px = -3.125F,
                                      .disp_min_rest_px = 1e-8F,
                                      .coarse = coarse,
                                      .merged = 1,
                                      .top = coarse ? TEST_TOP : 0,
                                      .rows = coarse ? TEST_ROWS : TEST_HEIGHT };
    for (int k = 0; k < TEST_VIEWS; k++) {
        struct sst_gpu_clear_view *v = &t->view[k];

        v->bx = k ? (float)(k % 3 - 1) * 0.31F + 0.05F : 0;
        v->by = k ? (float)(k / 3 - 1) * 0.17F : 0;
        v->x_q6 = v->bx / 64;
        v->y_q6 = v->by / 64;
        v->x_0 = t->push.disp_min_px * v->bx + 0.5F;
        v->y_0 = t->push.disp_min_px * v->by + 0.5F;
        v->first = (uint32_t)((TEST_VIEWS - 1 - k) * TEST_PLANE);
        v->flags = (k == 1 ? SST_GPU_CLEAR_VALID : 0U) | (k != 2 ? SST_GPU_CLEAR_LABELS : 0U) |
                   (k == 4 ? SST_GPU_CLEAR_MASK : 0U);
        v->top = coarse && !(v->by * v->by > 0) ? TEST_TOP - 2 : 0;
        v->end = coarse && !(v->by * v->by > 0) ? TEST_TOP + TEST_ROWS + 2 : TEST_HEIGHT;
    }
    for (size_t i = 0; i < TEST_VIEWS * TEST_PLANE; i++) {
        const uint32_t r = next_random(&state), x = (uint32_t)(i % TEST_PITCH);

        t->pixel[i] = (r & 0x1F1F1F) + x % 8 * 0x1C1C1C + (next_random(&state) % 40 ? 0 : 3U << 24);
        t->disp[i] = (uint16_t)(r % 29 == 0 ? 0xFFFF : r % 31 == 0 ? r % 2200 : (x / 16 % 2 ? 700 : 300) + r % 30);
        t->valid[i] = next_random(&state) % 8 ? 255 : 0;
        t->masks[i] = next_random(&state) % 12 ? 0 : 255;
        t->landed[i] = 77; /* to be set to 0 */
    }
}

static const uint32_t groups_of_test[3] = { (TEST_WIDTH + SST_GPU_CLEAR_GROUP_WIDTH - 1) / SST_GPU_CLEAR_GROUP_WIDTH,
                                            (TEST_HEIGHT + SST_GPU_CLEAR_GROUP_HEIGHT - 1) / SST_GPU_CLEAR_GROUP_HEIGHT,
                                            TEST_VIEWS };

static void free_buffers(uint8_t *one[], uint8_t *other[])
{
    for (int i = 0; i < SST_GPU_BUFFERS; i++) {
        free(one[i]);
        free(other[i]);
    }
}

/* Where rays land is compared bit for bit, and kept. */
static int run_land(struct sst_gpu *g, struct test *t)
{
    const void *const initial[SST_GPU_BUFFERS] = { t->view, t->pixel, t->disp, t->valid, t->masks, t->landed };
    const size_t bytes[SST_GPU_BUFFERS] = { sizeof(t->view),  sizeof(t->pixel), sizeof(t->disp),
                                            sizeof(t->valid), sizeof(t->masks), sizeof(t->landed) };
    const struct sst_gpu_work work = { .shader = SST_GPU_CLEAR_LAND,
                                       .push = &t->push,
                                       .groups = { groups_of_test[0], groups_of_test[1], TEST_VIEWS } };
    uint8_t *device[SST_GPU_BUFFERS], *host[SST_GPU_BUFFERS];
    int err = gpu_run_both(g, &work, initial, bytes, device, host);

    if (err)
        return err;
    /* Rows have pixels beyond the picture, which nobody reads. */
    for (size_t row = 0; row < (size_t)TEST_VIEWS * TEST_HEIGHT && !err; row++) {
        const size_t at = row * TEST_PITCH * sizeof(uint32_t);

        if (memcmp(device[SST_GPU_LAND_LANDED] + at, host[SST_GPU_LAND_LANDED] + at, TEST_WIDTH * sizeof(uint32_t)))
            err = -ENOTSUP;
    }
    memcpy(t->landed, host[SST_GPU_LAND_LANDED], sizeof(t->landed));
    free_buffers(device, host);
    return err;
}

int clear_land_self_test(struct sst_gpu *g)
{
    struct test *t = calloc(1, sizeof(*t));
    int err = t ? 0 : -ENOMEM;

    for (int coarse = 0; coarse < 2 && !err; coarse++) {
        set_test(t, coarse);
        t->push.zero = 1;
        err = run_land(g, t);
        t->push.zero = 0;
        if (!err)
            err = run_land(g, t);
    }
    free(t);
    return err;
}

static bool same_pixel(uint32_t a, uint32_t b)
{
    bool same = true;

    for (int c = 0; c < 4; c++)
        same = same && abs((int)(a >> (8 * c) & 0xFF) - (int)(b >> (8 * c) & 0xFF)) <= SST_GPU_CLEAR_LEVELS;
    return same;
}

/* Surfaces are compared bit for bit. */
static bool same_seen(uint32_t a, uint32_t b)
{
    return (a & 0xFFFF) == (b & 0xFFFF) && abs((int)(a >> 16) - (int)(b >> 16)) <= SST_GPU_CLEAR_LEVELS;
}

static int run_blend(struct sst_gpu *g, struct test *t)
{
    const void *const initial[SST_GPU_BUFFERS] = { t->view, t->pixel, t->landed, t->seen, t->state, t->out };
    const size_t bytes[SST_GPU_BUFFERS] = { sizeof(t->view), sizeof(t->pixel), sizeof(t->landed),
                                            sizeof(t->seen), sizeof(t->state), sizeof(t->out) };
    const struct sst_gpu_work work = { .shader = SST_GPU_CLEAR_BLEND,
                                       .push = &t->push,
                                       .groups = { groups_of_test[0], groups_of_test[1], 1 } };
    uint8_t *device[SST_GPU_BUFFERS], *host[SST_GPU_BUFFERS];
    int err = gpu_run_both(g, &work, initial, bytes, device, host);

    if (err)
        return err;
    for (size_t i = 0; i < ARRAY_LEN(t->out) && !err; i++) {
        if (!same_seen(((const uint32_t *)(const void *)device[SST_GPU_CLEAR_SEEN])[i],
                       ((const uint32_t *)(const void *)host[SST_GPU_CLEAR_SEEN])[i]) ||
            !same_pixel(((const uint32_t *)(const void *)device[SST_GPU_CLEAR_OUT])[i],
                        ((const uint32_t *)(const void *)host[SST_GPU_CLEAR_OUT])[i]))
            err = -ENOTSUP;
    }
    free_buffers(device, host);
    return err;
}

/* Have rays landed in the test. */
static void land_test(struct test *t, bool coarse)
{
    void *const buffer[SST_GPU_LAND_BUFFERS] = { t->view, t->pixel, t->disp, t->valid, t->masks, t->landed };

    set_test(t, coarse);
    t->push.zero = 1;
    clear_land_reference(&t->push, buffer, groups_of_test);
    t->push.zero = 0;
    clear_land_reference(&t->push, buffer, groups_of_test);
}

/* Surfaces are compared bit for bit. */
int clear_surface_self_test(struct sst_gpu *g)
{
    struct test *t = calloc(1, sizeof(*t));
    int err = t ? 0 : -ENOMEM;

    for (int coarse = 0; coarse < 2 && !err; coarse++) {
        const void *const initial[SST_GPU_BUFFERS] = { t->landed, t->state };
        const size_t bytes[SST_GPU_BUFFERS] = { sizeof(t->landed), sizeof(t->state) };
        const struct sst_gpu_work work = { .shader = SST_GPU_CLEAR_SURFACE,
                                           .push = &t->push,
                                           .groups = { groups_of_test[0], groups_of_test[1], 1 } };

        land_test(t, coarse);
        err = gpu_compare(g, &work, initial, bytes, 0, NULL);
    }
    free(t);
    return err;
}

/* Rays that were sampled: colours in place of where they came from, but of two views. */
static void sample_test(struct test *t)
{
    const struct given in = { .push = &t->push, .landed = t->landed };

    land_test(t, false);
    clear_surface_reference(&t->push, (void *const[]){ t->landed, t->state }, groups_of_test);
    for (size_t i = 0; i < ARRAY_LEN(t->landed); i++) {
        const uint32_t ray = t->landed[i], view = (uint32_t)(i / row_at(&in, t->push.rows));
        const uint32_t kind = (ray & 1 ? SST_GPU_RAY_FULL : SST_GPU_RAY_RIM) | (view % 4 == 1 ? SST_GPU_RAY_PLAIN : 0U);

        t->landed[i] = ray ? (t->pixel[i] & 0xFFFFFF) | kind << 24 : 0;
    }
    /* Of marked rays only those are there that come from inside the view. */
    for (int k = 1; k < TEST_VIEWS; k += 4) {
        for (int i = 0; i < TEST_WIDTH * TEST_HEIGHT; i++) {
            const float x = (float)(i % TEST_WIDTH) - t->state[i].px * t->view[k].bx;
            const float y = (float)(i / TEST_WIDTH) - t->state[i].px * t->view[k].by;

            if (!(x >= 0) || !(y >= 0) || x > TEST_WIDTH - 1 || y > TEST_HEIGHT - 1)
                t->landed[k * TEST_PLANE + i / TEST_WIDTH * TEST_PITCH + i % TEST_WIDTH] = 0;
        }
    }
    t->push.sampled = 1;
}

int clear_blend_self_test(struct sst_gpu *g)
{
    struct test *t = calloc(1, sizeof(*t));
    int err = t ? 0 : -ENOMEM;

    for (int i = 0; i < 3 && !err; i++) {
        if (i < 2)
            land_test(t, i);
        else
            sample_test(t);
        err = run_blend(g, t);
    }
    free(t);
    return err;
}
