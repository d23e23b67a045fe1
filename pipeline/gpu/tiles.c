/* The shader `tiles`: its reference and self-test. */
#include "pipeline/gpu/tiles.h"

#include <errno.h>
#include <stdlib.h>

#include "pipeline/gpu/gpu_internal.h"

_Static_assert(sizeof(struct sst_gpu_rectangle) == 16, "the layout of tiles.comp");

static void copy_tile(const struct sst_gpu_tiles *p, void *const *buffer, const struct sst_gpu_rectangle *t)
{
    uint32_t *to = (uint32_t *)buffer[SST_GPU_TILES_TO] + t->to;

    for (uint32_t y = 0; y < t->height; y++) {
        for (uint32_t x = 0; x < t->width; x++) {
            const size_t from = t->from + (size_t)y * (size_t)p->from_pitch + x;
            uint32_t *pixel = to + (size_t)y * (size_t)p->to_pitch + x;

            if (p->flags & SST_GPU_TILES_LABELS)
                *pixel = (*pixel & 0xFFFFFFU) | (uint32_t)((const uint8_t *)buffer[SST_GPU_TILES_FROM])[from] << 24;
            else
                *pixel = ((const uint32_t *)buffer[SST_GPU_TILES_FROM])[from];
        }
    }
}

void tiles_reference(const void *push, void *const *buffer, const uint32_t groups[3])
{
    const struct sst_gpu_tiles *p = push;
    const struct sst_gpu_rectangle *tile = buffer[SST_GPU_TILES_LIST];

    for (uint32_t i = 0; i < groups[0]; i++)
        copy_tile(p, buffer, &tile[p->first + i]);
}

/* --- self-test ---------------------------------------------------------------------------------------------------- */

#define TEST_FROM  100 /* pitches */
#define TEST_TO    72
#define TEST_ROWS  80
#define TEST_TILES 4

struct test {
    struct sst_gpu_rectangle tile[TEST_TILES];
    uint32_t from[TEST_FROM * TEST_ROWS], to[TEST_TO * TEST_ROWS];
};

/* Whole rectangles and parts; the first one is not copied. */
int tiles_self_test(struct sst_gpu *g)
{
    static const uint32_t boxes[TEST_TILES][6] = {
        { 0, 0, 0, 0, 32, 32 }, { 33, 3, 1, 0, 32, 32 }, { 66, 40, 40, 7, 31, 33 }, { 5, 70, 0, 50, 70, 9 }
    }; /* from, to, size */
    struct test *t = calloc(1, sizeof(*t));
    uint32_t state = 9;
    int err = t ? 0 : -ENOMEM;

    for (int i = 0; i < TEST_TILES && !err; i++)
        t->tile[i] = (struct sst_gpu_rectangle){ boxes[i][0] + boxes[i][1] * TEST_FROM,
                                                 boxes[i][2] + boxes[i][3] * TEST_TO, boxes[i][4], boxes[i][5] };
    for (size_t i = 0; i < ARRAY_LEN(t->from) && !err; i++)
        t->from[i] = gpu_random(&state) << 8 | (gpu_random(&state) & 0xFF);
    for (size_t i = 0; i < ARRAY_LEN(t->to) && !err; i++)
        t->to[i] = gpu_random(&state) << 8;
    for (uint32_t flags = 0; flags <= SST_GPU_TILES_LABELS && !err; flags++) {
        const struct sst_gpu_tiles push = { TEST_FROM, TEST_TO, 1, flags };
        const struct sst_gpu_work work = { .shader = SST_GPU_TILES, .push = &push, .groups = { TEST_TILES - 1, 1, 1 } };
        const void *const initial[] = { t->tile, t->from, t->to };
        const size_t bytes[] = { sizeof(t->tile), sizeof(t->from), sizeof(t->to) };

        err = gpu_compare(g, &work, initial, bytes, SST_GPU_TILES_TO, NULL);
    }
    free(t);
    return err;
}
