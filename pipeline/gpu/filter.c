/* The shaders `median` and `bilateral`: their references by those of kernels, and their self-tests. */

#include <assert.h>
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "pipeline/gpu/gpu_internal.h"
#include "pipeline/kernels/kernels.h"

#define NONE 65535

/* --- references --------------------------------------------------------------------------------------------------- */

void median_reference(const void *push, void *const *buffer, const uint32_t groups[3] SST_UNUSED)
{
    const struct sst_gpu_median *p = push;
    const uint32_t *map = buffer[SST_GPU_MEDIAN_MAP];
    uint32_t *out = buffer[SST_GPU_MEDIAN_OUT];
    const size_t padded = (size_t)p->width + 4;
    uint16_t *memory = malloc(6 * padded * sizeof(*memory)), *row = memory;

    assert(memory);
    for (int y = 0; y < p->height; y++) {
        const uint16_t *rows[5];

        for (int j = 0; j < 5; j++) {
            const uint32_t *from = map + (size_t)sst_clamp_int(y + j - 2, 0, p->height - 1) * (size_t)p->width;
            uint16_t *to = memory + (size_t)(j + 1) * padded + 2;

            for (int x = -2; x < p->width + 2; x++)
                to[x] = (uint16_t)from[sst_clamp_int(x, 0, p->width - 1)];
            rows[j] = to;
        }
        sst_median5_row_ref(row, rows, (size_t)p->width);
        for (int x = 0; x < p->width; x++)
            out[y * p->width + x] = (map[y * p->width + x] & 0xFFFF0000) | row[x];
    }
    free(memory);
}

/* Disparity and luma of a pixel; outside nothing is known. */
static void known(uint16_t *disp, uint8_t *luma, const struct sst_gpu_bilateral *p, void *const *buffer, int x, int y)
{
    const int at = y * p->width + x;
    uint32_t c;

    *disp = NONE;
    *luma = 0;
    if (x < 0 || y < 0 || x >= p->width || y >= p->height)
        return;
    c = ((const uint32_t *)buffer[SST_GPU_BILATERAL_PIXELS])[at];
    *disp = (uint16_t)((const uint32_t *)buffer[SST_GPU_BILATERAL_MAP])[at];
    *luma = (uint8_t)((77 * (c & 0xFF) + 150 * (c >> 8 & 0xFF) + 29 * (c >> 16 & 0xFF) + 128) >> 8);
}

void bilateral_reference(const void *push, void *const *buffer, const uint32_t groups[3] SST_UNUSED)
{
    const struct sst_gpu_bilateral *p = push;
    const uint32_t *map = buffer[SST_GPU_BILATERAL_MAP];
    uint32_t *out = buffer[SST_GPU_BILATERAL_OUT];
    const size_t padded = (size_t)p->width + 6;
    uint16_t *memory = malloc(8 * padded * sizeof(*memory));
    uint8_t *luma_memory = malloc(7 * padded);
    int16_t weight[49];

    assert(memory && luma_memory);
    for (int i = 0; i < 49; i++)
        weight[i] = (int16_t)p->weight[4 * abs(i / 7 - 3) + abs(i % 7 - 3)];
    for (int y = 0; y < p->height; y++) {
        const uint16_t *disp[7];
        const uint8_t *luma[7];

        for (int j = 0; j < 7; j++) {
            uint16_t *d = memory + (size_t)(j + 1) * padded;
            uint8_t *l = luma_memory + (size_t)j * padded;

            for (int x = 0; x < (int)padded; x++)
                known(&d[x], &l[x], p, buffer, x - 3, y + j - 3);
            disp[j] = d + 3;
            luma[j] = l + 3;
        }
        sst_bilateral_row_ref(memory, disp, luma, weight, p->tau, (size_t)p->width);
        for (int x = 0; x < p->width; x++)
            out[y * p->width + x] = (map[y * p->width + x] & 0xFFFF0000) | memory[x];
    }
    free(memory);
    free(luma_memory);
}

/* --- self-tests --------------------------------------------------------------------------------------------------- */

#define TEST_WIDTH  43
#define TEST_HEIGHT 21
#define TEST_PIXELS (TEST_WIDTH * TEST_HEIGHT)

struct test {
    uint32_t map[TEST_PIXELS], pixel[TEST_PIXELS], out[TEST_PIXELS];
};

/* Surfaces with noise, single pixels that are not known. */
static struct test *make_test(void)
{
    struct test *t = calloc(1, sizeof(*t));
    uint32_t state = 4;

    for (int i = 0; t && i < TEST_PIXELS; i++) {
        const uint32_t surface = (uint32_t)(i % TEST_WIDTH / 11 * 70 + i / TEST_WIDTH / 6 * 640);

        t->map[i] = (gpu_random(&state) % 13 ? surface + gpu_random(&state) % 90 : NONE) | gpu_random(&state) << 16;
        t->pixel[i] = gpu_random(&state) & 0x1F1F1F;
    }
    return t;
}

int median_self_test(struct sst_gpu *g)
{
    static const struct sst_gpu_median push = { TEST_WIDTH, TEST_HEIGHT };
    const struct sst_gpu_work work = { .shader = SST_GPU_MEDIAN,
                                       .push = &push,
                                       .groups = { gpu_groups(TEST_WIDTH, SST_GPU_PLANE_WIDTH),
                                                   gpu_groups(TEST_HEIGHT, SST_GPU_PLANE_HEIGHT), 1 } };
    struct test *t = make_test();
    int err = t ? 0 : -ENOMEM;

    if (!err)
        err = gpu_compare(g, &work, (const void *const[SST_GPU_BUFFERS]){ t->map, t->out },
                          (const size_t[SST_GPU_BUFFERS]){ sizeof(t->map), sizeof(t->out) }, SST_GPU_MEDIAN_OUT, NULL);
    free(t);
    return err;
}

int bilateral_self_test(struct sst_gpu *g)
{
    static const struct sst_gpu_bilateral push = {
        TEST_WIDTH,
        TEST_HEIGHT,
        8,
        { 4096, 2484, 554, 46, 2484, 1507, 336, 28, 554, 336, 75, 6, 46, 28, 6, 1 },
    };
    const struct sst_gpu_work work = { .shader = SST_GPU_BILATERAL,
                                       .push = &push,
                                       .groups = { gpu_groups(TEST_WIDTH, SST_GPU_PLANE_WIDTH),
                                                   gpu_groups(TEST_HEIGHT, SST_GPU_PLANE_HEIGHT), 1 } };
    struct test *t = make_test();
    int err = t ? 0 : -ENOMEM;

    if (!err)
        err = gpu_compare(g, &work, (const void *const[SST_GPU_BUFFERS]){ t->map, t->pixel, t->out },
                          (const size_t[SST_GPU_BUFFERS]){ sizeof(t->map), sizeof(t->pixel), sizeof(t->out) },
                          SST_GPU_BILATERAL_OUT, NULL);
    free(t);
    return err;
}
