/* The shader `convert`: its reference and self-test. */
#include "pipeline/gpu/convert.h"

#include <errno.h>
#include <stdlib.h>

#include "pipeline/gpu/gpu_internal.h"
#include "pipeline/kernels/kernels.h"

_Static_assert(sizeof(struct sst_gpu_convert) == 32, "the layout of convert.comp");

#define NONE    0xFFFFU    /* SST_DISP_NONE */
#define CODES   253        /* depth codes but the first one */
#define CHANGED (1U << 24) /* struct sst_gpu_hypothesis_choice */
#define UPPER   0xFFFF0000U

/* A dispatch. */
struct words {
    const struct sst_gpu_convert *p;
    const uint32_t *pixel, *map, *from;
    uint32_t *to;
};

static bool counts(const struct words *w, size_t i)
{
    return w->pixel[i] >> 24;
}

static uint32_t luma(uint32_t p)
{
    return (77 * (p & 0xFF) + 150 * (p >> 8 & 0xFF) + 29 * (p >> 16 & 0xFF) + 128) >> 8;
}

static uint32_t hypotheses(const struct words *w, size_t i)
{
    const uint32_t d = w->map[i] & NONE, most = w->p->value;
    const uint32_t code = !counts(w, i) ? SST_DEPTH_OUTSIDE : d == NONE ? 0 : 1 + (d < most ? d : most) * CODES / most;

    return (w->pixel[i] & 0xFFFFFF) | code << 24;
}

static uint32_t lumas(const struct words *w, int x, size_t i)
{
    const size_t next = x + 1 < w->p->width ? i + 1 : i;
    const uint32_t a = w->map[i] & NONE, b = w->map[next] & NONE;

    return luma(w->pixel[i]) | luma(w->pixel[next]) << 8 | (a > b ? a : b) << 16;
}

static uint32_t steps(uint32_t word)
{
    return ((word & NONE) < SST_SUBPIXEL_NONE ? word & NONE : SST_SUBPIXEL_NONE) * 65537U;
}

static uint32_t chosen(uint32_t word, uint32_t old)
{
    return (word & NONE) | ((word & CHANGED ? word : old) & 0xFF0000) | (old & 0xFF000000U);
}

static uint32_t features(const struct words *w, int x, int y)
{
    const int pixel = x % w->p->full_width, group = x / w->p->full_width;

    return w->from[y * w->p->width + pixel * SST_GPU_FEATURE_WORDS + group] ^ 0x80808080U;
}

static uint32_t converted(const struct words *w, int x, int y, size_t i)
{
    const uint32_t old = w->to[i];

    switch (w->p->conversion) {
    case SST_GPU_TO_HYPOTHESES:
        return hypotheses(w, i);
    case SST_GPU_TO_LUMA:
        return lumas(w, x, i);
    case SST_GPU_TO_STEPS:
        return steps(w->map[i]);
    case SST_GPU_FROM_MATCH:
        return (w->from[i] & 0xFFFFFF) | (counts(w, i) ? 0 : NONE);
    case SST_GPU_FROM_CHOICE:
        return chosen(w->from[i], old);
    case SST_GPU_FROM_PLAIN:
        return (old & UPPER) | (w->from[i] & NONE);
    case SST_GPU_TO_LEVELS:
        return w->from[luma(w->pixel[i])];
    default:
        return features(w, x, y);
    }
}

void convert_reference(const void *push, void *const *buffer, const uint32_t groups[3])
{
    const struct sst_gpu_convert *p = push;
    const struct words w = { p, (const uint32_t *)buffer[SST_GPU_CONVERT_COLOURS] + p->colours,
                             buffer[SST_GPU_CONVERT_MAP], (const uint32_t *)buffer[SST_GPU_CONVERT_FROM] + p->from,
                             (uint32_t *)buffer[SST_GPU_CONVERT_TO] + p->to };

    (void)groups;
    for (int y = 0; y < p->height; y++) {
        for (int x = 0; x < p->width; x++) {
            const size_t i = (size_t)y * (size_t)p->width + (size_t)x;

            w.to[i] = converted(&w, x, y, i);
        }
    }
}

/* --- self-test ---------------------------------------------------------------------------------------------------- */

#define TEST_WIDTH  37
#define TEST_HEIGHT 21
#define TEST_WORDS  (4 * TEST_WIDTH * TEST_HEIGHT + 64)

struct test {
    uint32_t pixel[TEST_WORDS], map[TEST_WORDS], from[TEST_WORDS], to[TEST_WORDS];
};

/* Some pixels do not count, some disparities are unknown, some upper halves are 0. */
static void fill(struct test *t)
{
    uint32_t state = 11;

    for (size_t i = 0; i < TEST_WORDS; i++) {
        t->pixel[i] = gpu_random(&state) | (gpu_random(&state) % 8 ? 0xFF000000U : 0);
        t->map[i] = gpu_random(&state) << 1 | (gpu_random(&state) % 5 ? 0 : NONE);
        t->from[i] = gpu_random(&state) << 2 | (gpu_random(&state) % 5 ? 0 : NONE);
        t->from[i] &= gpu_random(&state) % 3 ? ~0U : NONE;
        t->to[i] = gpu_random(&state) << 8;
    }
}

int convert_self_test(struct sst_gpu *g)
{
    struct test *t = calloc(1, sizeof(*t));
    int err = t ? 0 : -ENOMEM;

    if (!err)
        fill(t);
    for (uint32_t i = 0; i <= 2 * SST_GPU_TO_LEVELS + 1 && !err; i++) {
        const bool wide = i / 2 == SST_GPU_TO_FEATURES;
        struct sst_gpu_convert push = { .width = TEST_WIDTH,
                                        .height = TEST_HEIGHT,
                                        .full_width = TEST_WIDTH,
                                        .conversion = i / 2,
                                        .value = i / 2 == SST_GPU_TO_HYPOTHESES ? 1000 + 30000 * (i % 2) : i % 2,
                                        .colours = 3,
                                        .from = 5,
                                        .to = 7 };
        const struct sst_gpu_work work = { .shader = SST_GPU_CONVERT,
                                           .push = &push,
                                           .groups = { gpu_groups(4 * TEST_WIDTH, 32), gpu_groups(TEST_HEIGHT, 8),
                                                       1 } };
        const void *const initial[] = { t->pixel, t->map, t->from, t->to };
        const size_t bytes[] = { sizeof(t->pixel), sizeof(t->map), sizeof(t->from), sizeof(t->to) };

        if (wide) { /* as many words of fewer pixels */
            push.full_width = 9;
            push.width = 9 * SST_GPU_FEATURE_WORDS;
        }
        err = gpu_compare(g, &work, initial, bytes, SST_GPU_CONVERT_TO, NULL);
    }
    free(t);
    return err;
}
