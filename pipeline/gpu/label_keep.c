/* The shader `label_keep`: its reference and self-test. */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "pipeline/gpu/gpu_internal.h"
#include "pipeline/gpu/label.h"

_Static_assert(sizeof(struct sst_gpu_label_keep) == 24, "the layout of label_keep.comp");

#define DISP  0xFFFFU
#define BELOW 0xFFFFFFU /* the label that was elected */

static uint32_t kept(const struct sst_gpu_label_keep *p, const uint32_t *view, const uint32_t *from, size_t n, size_t i)
{
    const size_t width = (size_t)p->width;
    const uint32_t word = view[i];
    float entropy;

    switch (p->way) {
    case SST_GPU_KEEP_WORDS:
        return (word & DISP) | (from[i] & view[n + i] >> 24) << 16;
    case SST_GPU_KEEP_BYTES:
        return (word & DISP) | (uint32_t)((const uint8_t *)from)[i / width * p->pitch + i % width] << 16;
    case SST_GPU_KEEP_SURE:
        memcpy(&entropy, &view[2 * n + i], sizeof(entropy));
        return isless(entropy, p->limit) ? word : word & DISP;
    case SST_GPU_KEEP_ELECTED:
        return (word & BELOW) | from[i] << 24;
    default:
        return (word & DISP) | word >> 24 << 16;
    }
}

void label_keep_reference(const void *push, void *const *buffer, const uint32_t groups[3] SST_UNUSED)
{
    const struct sst_gpu_label_keep *p = push;
    const size_t n = (size_t)p->width * (size_t)p->height;
    uint32_t *view = buffer[SST_GPU_LABEL_KEEP_VIEW];
    const uint32_t *from = buffer[SST_GPU_LABEL_KEEP_FROM];

    for (size_t i = 0; i < n; i++) {
        const uint32_t word = kept(p, view, from, n, i);

        if (p->way == SST_GPU_KEEP_WORDS && p->entropies)
            view[2 * n + i] = from[n + i];
        view[i] = word;
    }
}

#define TEST_WIDTH  37
#define TEST_HEIGHT 19
#define TEST_PIXELS (TEST_WIDTH * TEST_HEIGHT)

struct test {
    uint32_t view[3][TEST_PIXELS], from[2][TEST_PIXELS];
};

/* Pixels that do not count, and entropies of which some are infinite, are not numbers or equal the limit. */
static void fill(struct test *t, float limit)
{
    uint32_t state = 3;

    for (int i = 0; i < TEST_PIXELS; i++) {
        const float entropy = (float)(gpu_random(&state) % 200) / 100;

        t->view[SST_GPU_PLANE_LABELS][i] = gpu_random(&state) << 8 | gpu_random(&state);
        t->view[SST_GPU_PLANE_COLOURS][i] = gpu_random(&state) | (gpu_random(&state) % 9 ? 255U << 24 : 0);
        memcpy(&t->view[SST_GPU_PLANE_ENTROPIES][i], i % 5 ? &entropy : &limit, sizeof(entropy));
        if (i % 11 < 2)
            t->view[SST_GPU_PLANE_ENTROPIES][i] = i % 11 ? 0x7F800000U : 0x7FC00000U;
        t->from[0][i] = gpu_random(&state) & 0xFF;
        t->from[1][i] = gpu_random(&state);
    }
}

int label_keep_self_test(struct sst_gpu *g)
{
    struct sst_gpu_label_keep push = {
        .width = TEST_WIDTH, .height = TEST_HEIGHT, .pitch = (TEST_WIDTH + 3) / 4 * 4, .limit = 0.75f
    };
    const struct sst_gpu_work work = { .shader = SST_GPU_LABEL_KEEP,
                                       .push = &push,
                                       .groups = { gpu_groups(TEST_WIDTH, 32), gpu_groups(TEST_HEIGHT, 8), 1 } };
    struct test *t = calloc(1, sizeof(*t));
    int err = t ? 0 : -ENOMEM;

    if (!err)
        fill(t, push.limit);
    for (int i = 0; i <= SST_GPU_KEEP_TAKEN + 1 && !err; i++) {
        push.way = i ? (uint32_t)i - 1 : SST_GPU_KEEP_WORDS; /* twice, with entropies and without */
        push.entropies = !i;
        err = gpu_compare(g, &work, (const void *const[]){ t->view, t->from },
                          (const size_t[]){ sizeof(t->view), sizeof(t->from) }, SST_GPU_LABEL_KEEP_VIEW, NULL);
    }
    free(t);
    return err;
}
