/* The shaders `subpixel_fit` and `subpixel_window`: their references by those of kernels, and their self-tests. */
#include "pipeline/gpu/subpixel.h"

#include <assert.h>
#include <errno.h>
#include <math.h>
#include <stdlib.h>

#include "pipeline/gpu/gpu_internal.h"
#include "pipeline/kernels/kernels.h"

#define UNKNOWN 65535 /* SST_DISP_NONE */

/* --- references --------------------------------------------------------------------------------------------------- */

/* A view with a border of one pixel, repeated. @param to  [height + 2][width + 2] */
static struct sst_packed_view pad_view(uint32_t *to, const uint32_t *from, int width, int height)
{
    const struct sst_packed_view view = { to + width + 3, width + 2 };

    for (int y = -1; y <= height; y++) {
        for (int x = -1; x <= width; x++)
            *to++ = from[sst_clamp_int(y, 0, height - 1) * width + sst_clamp_int(x, 0, width - 1)];
    }
    return view;
}

void subpixel_fit_reference(const void *push, void *const *buffer, const uint32_t groups[3] SST_UNUSED)
{
    const struct sst_gpu_subpixel_fit *p = push;
    const struct sst_gpu_subpixel_view *views = buffer[SST_GPU_SUBPIXEL_FIT_VIEWS];
    const uint32_t *pixels = buffer[SST_GPU_SUBPIXEL_FIT_PIXELS], *disp = buffer[SST_GPU_SUBPIXEL_FIT_DISP];
    struct sst_gpu_subpixel_weight *out = buffer[SST_GPU_SUBPIXEL_FIT_OUT];
    const size_t width = (size_t)p->width, padded = (width + 2) * ((size_t)p->height + 2);
    uint32_t *memory = malloc((size_t)(p->views + 1) * padded * sizeof(*memory));
    int32_t *row = malloc(width * sizeof(*row));
    float *weight = malloc(2 * width * sizeof(*weight)), *product = weight + width;
    struct sst_subpixel_fit fit = { .views = p->views,
                                    .width = p->width,
                                    .height = p->height,
                                    .tolerance = p->tolerance,
                                    .inverse_limit = p->inverse_limit };

    assert(memory && row && weight);
    fit.own = pad_view(memory, pixels + p->own, p->width, p->height);
    for (int k = 0; k < p->views; k++) {
        const struct sst_gpu_subpixel_view *v = &views[k];

        fit.view[k] = (struct sst_subpixel_view){ pad_view(memory + (size_t)(k + 1) * padded, pixels + v->first,
                                                           p->width, p->height),
                                                  v->x,
                                                  v->y,
                                                  v->dx,
                                                  v->dy,
                                                  v->bx,
                                                  v->by,
                                                  v->gain,
                                                  v->offset };
    }
    for (int y = 0; y < p->height; y++, disp += width, out += width) {
        for (size_t x = 0; x < width; x++)
            row[x] = (int32_t)(disp[x] & 0xFFFF);
        sst_subpixel_fit_row_ref(weight, product, row, &fit, y, width);
        for (size_t x = 0; x < width; x++)
            out[x] = (struct sst_gpu_subpixel_weight){ weight[x], product[x] };
    }
    free(memory);
    free(row);
    free(weight);
}

/* Planes with a margin of weight 0, as the kernel reads them; pointers to (0, 0). */
struct window_planes {
    void *memory;
    ptrdiff_t stride;
    uint32_t *colour;
    int32_t *disp;
    float *weight, *product;
};

static void set_planes(struct window_planes *to, const struct sst_gpu_subpixel_window *p, void *const *buffer)
{
    const uint32_t *colours = buffer[SST_GPU_SUBPIXEL_WINDOW_COLOURS], *disp = buffer[SST_GPU_SUBPIXEL_WINDOW_DISP];
    const struct sst_gpu_subpixel_weight *weights = buffer[SST_GPU_SUBPIXEL_WINDOW_WEIGHTS];
    const ptrdiff_t margin = 2 * p->step, stride = p->width + 2 * margin;
    const size_t plane = (size_t)stride * (size_t)(p->height + 2 * margin);
    uint32_t *memory = calloc(4 * plane, sizeof(*memory));

    assert(memory);
    to->memory = memory;
    to->stride = stride;
    to->colour = memory + margin * stride + margin;
    to->disp = (int32_t *)to->colour + plane;
    to->weight = (float *)memory + 2 * plane + margin * stride + margin;
    to->product = to->weight + plane;
    for (int y = 0; y < p->height; y++) {
        for (int x = 0; x < p->width; x++) {
            const ptrdiff_t at = y * stride + x;
            const int from = y * p->width + x;

            to->colour[at] = colours[from];
            to->disp[at] = (int32_t)(disp[from] & 0xFFFF);
            to->weight[at] = weights[from].weight;
            to->product[at] = weights[from].product;
        }
    }
}

static uint32_t near_first(const struct sst_gpu_subpixel_window *p, float disp_px, int first)
{
    return (uint32_t)sst_clamp_int((int)floorf(disp_px * 64 + 0.5f), sst_max_int(first - p->reach, 0),
                                   sst_min_int(first + p->reach, p->last));
}

/* What follows from the sums of a pixel's window. */
static void finish_pixel(const struct sst_gpu_subpixel_window *p, void *const *buffer, int at, float weight,
                         float product)
{
    const uint32_t word = ((const uint32_t *)buffer[SST_GPU_SUBPIXEL_WINDOW_DISP])[at], d = word & 0xFFFF;
    const struct sst_gpu_subpixel_weight own =
        ((const struct sst_gpu_subpixel_weight *)buffer[SST_GPU_SUBPIXEL_WINDOW_WEIGHTS])[at];
    struct sst_gpu_subpixel_weight *left = buffer[SST_GPU_SUBPIXEL_WINDOW_LEFT];
    uint32_t *out = buffer[SST_GPU_SUBPIXEL_WINDOW_OUT];
    const int first = (int)(word >> 16);

    if (!p->wide) {
        const float refined = (product + p->few * ((float)d * (1 / 64.0f))) / (weight + p->few);
        const float kept = (weight < p->enough ? weight : p->enough) + p->few;

        left[at] = (struct sst_gpu_subpixel_weight){ kept, kept * refined };
        out[at] = (d < SST_SUBPIXEL_NONE ? near_first(p, refined, first) : d) | (uint32_t)first << 16;
    } else {
        const float share = own.weight < p->enough ? 1 - own.weight / p->enough : 0;
        const float refined = own.product / own.weight, mean = product / weight;
        const float mixed = refined + share * (mean - refined);

        out[at] = (d < SST_SUBPIXEL_NONE ? near_first(p, mixed, first) : UNKNOWN) | (uint32_t)first << 16;
    }
}

void subpixel_window_reference(const void *push, void *const *buffer, const uint32_t groups[3] SST_UNUSED)
{
    const struct sst_gpu_subpixel_window *p = push;
    const size_t width = (size_t)p->width;
    float *weight = malloc(2 * width * sizeof(*weight)), *product = weight + width;
    struct window_planes planes;

    assert(weight);
    set_planes(&planes, p, buffer);
    for (int y = 0; y < p->height; y++) {
        const ptrdiff_t row = y * planes.stride;
        const struct sst_subpixel_window w = { planes.colour + row,  planes.disp + row, planes.weight + row,
                                               planes.product + row, planes.stride,     p->step,
                                               p->similar,           p->apart };

        sst_subpixel_window_row_ref(weight, product, &w, width);
        for (int x = 0; x < p->width; x++)
            finish_pixel(p, buffer, y * p->width + x, weight[x], product[x]);
    }
    free(planes.memory);
    free(weight);
}

/* --- self-tests --------------------------------------------------------------------------------------------------- */

#define TEST_WIDTH  43
#define TEST_HEIGHT 21
#define TEST_PIXELS (TEST_WIDTH * TEST_HEIGHT)
#define TEST_VIEWS  5 /* the first one is compared with the others */
#define TEST_LAST   640

struct test {
    struct sst_gpu_subpixel_view view[TEST_VIEWS - 1];
    uint32_t pixel[TEST_VIEWS * TEST_PIXELS], colour[TEST_PIXELS], disp[TEST_PIXELS], out[TEST_PIXELS];
    struct sst_gpu_subpixel_weight weight[TEST_PIXELS], left[TEST_PIXELS];
};

static float random_float(uint32_t *state, float least, float most)
{
    return least + (float)gpu_random(state) * (1.0f / (1 << 24)) * (most - least);
}

/* Lumas that differ by little between views, some pixels hidden or unknown; weights of all sizes. */
static struct test *make_test(void)
{
    struct test *t = calloc(1, sizeof(*t));
    uint32_t state = 14;

    for (int i = 0; t && i < TEST_VIEWS * TEST_PIXELS; i++) {
        const uint32_t x = (uint32_t)i % TEST_WIDTH, y = (uint32_t)(i % TEST_PIXELS) / TEST_WIDTH;
        const uint32_t luma = (5 * x + 3 * y + gpu_random(&state) % 7) & 0xFF;

        t->pixel[i] = luma | ((luma + gpu_random(&state) % 9) & 0xFF) << 8 |
                      (gpu_random(&state) % 8 ? gpu_random(&state) % 400 : UNKNOWN) << 16;
    }
    for (int k = 0; t && k + 1 < TEST_VIEWS; k++)
        t->view[k] = (struct sst_gpu_subpixel_view){ .x = 30000 - 20000 * k,
                                                     .y = 7000 * k,
                                                     .dx = 1000 - 600 * k,
                                                     .dy = 333 * k,
                                                     .bx = random_float(&state, -1.1f, 1.1f),
                                                     .by = k ? random_float(&state, -1.1f, 1.1f) : 0,
                                                     .gain = random_float(&state, 0.9f, 1.1f),
                                                     .offset = random_float(&state, -3, 3),
                                                     .first = (uint32_t)((k + 1) * TEST_PIXELS) };
    for (int i = 0; t && i < TEST_PIXELS; i++) {
        const uint32_t first = gpu_random(&state) % TEST_LAST, step = gpu_random(&state) % 41;
        const float weight = ldexpf(random_float(&state, 1, 2), (int)(gpu_random(&state) % 20));

        t->colour[i] = 0x304050 + (gpu_random(&state) & 0x1F1F1F);
        t->disp[i] = gpu_random(&state) % 9
                         ? first << 16 | (uint32_t)sst_clamp_int((int)(first + step) - 20, 0, TEST_LAST)
                         : SST_SUBPIXEL_NONE * 65537U;
        t->weight[i] = (struct sst_gpu_subpixel_weight){ weight, weight * random_float(&state, -1, 11) };
    }
    return t;
}

static struct sst_gpu_work work_of(enum sst_gpu_shader shader, const void *push)
{
    return (struct sst_gpu_work){ .shader = shader,
                                  .push = push,
                                  .groups = { gpu_groups(TEST_WIDTH, 32), gpu_groups(TEST_HEIGHT, 8), 1 } };
}

int subpixel_fit_self_test(struct sst_gpu *g)
{
    static const struct sst_gpu_subpixel_fit push = { TEST_WIDTH, TEST_HEIGHT, TEST_VIEWS - 1, 0, 20, 0.1f };
    const struct sst_gpu_work work = work_of(SST_GPU_SUBPIXEL_FIT, &push);
    struct test *t = make_test();
    const int err =
        t ? gpu_compare(g, &work, (const void *const[]){ t->view, t->pixel, t->disp, t->weight },
                        (const size_t[]){ sizeof(t->view), sizeof(t->pixel), sizeof(t->disp), sizeof(t->weight) },
                        SST_GPU_SUBPIXEL_FIT_OUT, NULL)
          : -ENOMEM;

    free(t);
    return err;
}

int subpixel_window_self_test(struct sst_gpu *g)
{
    static const struct sst_gpu_subpixel_window push[2] = {
        { TEST_WIDTH, TEST_HEIGHT, 1, 24, 400, 0, 20, TEST_LAST, 30, 1e5f },
        { TEST_WIDTH, TEST_HEIGHT, 4, 24, 300, 1, 20, TEST_LAST, 30, 1e5f },
    };
    struct test *t = make_test();
    int err = t ? 0 : -ENOMEM;

    for (int wide = 0; wide < 2 && !err; wide++) {
        const struct sst_gpu_work work = work_of(SST_GPU_SUBPIXEL_WINDOW, &push[wide]);

        err = gpu_compare(
            g, &work, (const void *const[]){ t->colour, t->disp, t->weight, t->left, t->out },
            (const size_t[]){ sizeof(t->colour), sizeof(t->disp), sizeof(t->weight), sizeof(t->left), sizeof(t->out) },
            SST_GPU_SUBPIXEL_WINDOW_OUT, NULL);
    }
    free(t);
    return err;
}
