/* The shaders `support_arms`, `support_sum` and `support_mean`: their references by those of kernels, and their
 * self-tests. */

#include <assert.h>
#include <errno.h>
#include <stdlib.h>

#include "pipeline/gpu/gpu_internal.h"
#include "pipeline/kernels/kernels.h"

/* --- references --------------------------------------------------------------------------------------------------- */

static uint32_t arm_of(const struct sst_gpu_arms *p, const uint32_t *pixel, int x, int y, int dx, int dy)
{
    const uint32_t own = pixel[y * p->width + x];
    int length = 0;

    while (length < p->arm) {
        const int xn = x + (length + 1) * dx, yn = y + (length + 1) * dy;

        if (xn < 0 || yn < 0 || xn >= p->width || yn >= p->height ||
            gpu_colour_step(own, pixel[yn * p->width + xn]) >= p->tau)
            break;
        length++;
    }
    return (uint32_t)length;
}

void support_arms_reference(const void *push, void *const *buffer, const uint32_t groups[3] SST_UNUSED)
{
    const struct sst_gpu_arms *p = push;
    const uint32_t *pixel = buffer[SST_GPU_ARMS_PIXELS];
    uint32_t *out = buffer[SST_GPU_ARMS_OUT];

    for (int y = 0; y < p->height; y++) {
        for (int x = 0; x < p->width; x++)
            out[y * p->width + x] = arm_of(p, pixel, x, y, -1, 0) | arm_of(p, pixel, x, y, 1, 0) << 8 |
                                    arm_of(p, pixel, x, y, 0, -1) << 16 | arm_of(p, pixel, x, y, 0, 1) << 24;
    }
}

/* Columns and rows of a tile's volume that are computed. */
struct part {
    int x0, y0, x1, y1;
};

static struct part part_of(const struct sst_gpu_support *p, const struct sst_gpu_tile *t)
{
    return (struct part){ sst_max_int(t->x0 - p->across - t->left, 0), sst_max_int(t->y0 - p->down - t->top, 0),
                          sst_min_int(t->x0 + t->width + p->across - t->left, t->pitch),
                          sst_min_int(t->y0 + t->height + p->down - t->top, t->rows) };
}

static size_t cell_of(const struct sst_gpu_tile *t, int column, int row)
{
    return 4 * (size_t)t->quad + ((size_t)row * (size_t)t->pitch + (size_t)column) * (size_t)t->nd;
}

/* Sums of the pixels of one row, above which there are none. @param zero  [nd] zeros */
static void sum_row(const struct sst_gpu_support *p, const struct sst_gpu_tile *t, const struct part *part, int row,
                    void *const *buffer, const uint16_t *zero)
{
    const uint32_t *arms = (const uint32_t *)buffer[SST_GPU_SUPPORT_SUM_ARMS] + (t->top + row) * p->width + t->left;
    const uint8_t *cost = buffer[SST_GPU_SUPPORT_SUM_COST];
    uint16_t *sum = buffer[SST_GPU_SUPPORT_SUM_OUT];

    for (int x = part->x0; x < part->x1; x++) {
        const int left = sst_min_int((int)(arms[x] & 0xFF), x);
        const uint8_t none = 0, right = (uint8_t)sst_min_int((int)(arms[x] >> 8 & 0xFF), t->pitch - 1 - x);
        const uint8_t all = (uint8_t)(left + right);

        /* From the region's first pixel on, which has no left arm then. */
        sst_support_sum_row_ref(sum + cell_of(t, x, row), zero, NULL, cost + cell_of(t, x - left, row), &none, &all, 1,
                                (size_t)t->nd);
    }
}

void support_sum_reference(const void *push, void *const *buffer, const uint32_t groups[3])
{
    const struct sst_gpu_support *p = push;
    uint16_t *zero = calloc(SST_GPU_MATCH_STEPS, sizeof(*zero));

    assert(zero);
    for (uint32_t i = 0; i < groups[2]; i++) {
        const struct sst_gpu_tile *t = (const struct sst_gpu_tile *)buffer[SST_GPU_SUPPORT_SUM_TILES] + i;
        const struct part part = part_of(p, t);

        for (int row = part.y0; row < part.y1; row++)
            sum_row(p, t, &part, row, buffer, zero);
    }
    free(zero);
}

/* The mean of one pixel. @param rows  sums of the region's column, [nd] each: none, then all of them */
static void mean_of(const struct sst_gpu_support *p, const struct sst_gpu_tile *t, int column, int row,
                    void *const *buffer, uint16_t *sums)
{
    const uint32_t *arms = (const uint32_t *)buffer[SST_GPU_SUPPORT_MEAN_ARMS];
    const uint16_t *sum = buffer[SST_GPU_SUPPORT_MEAN_SUM];
    const int x = t->left + column, y = t->top + row;
    const uint32_t own = arms[y * p->width + x];
    const size_t nd = (size_t)t->nd;
    const uint16_t *const rows[2] = { sums, sums + nd };
    const uint8_t none = 0;
    uint16_t count = 0;

    for (size_t d = 0; d < nd; d++)
        sums[d] = sums[nd + d] = 0;
    for (int j = -(int)(own >> 16 & 0xFF); j <= (int)(own >> 24); j++) {
        const uint32_t there = arms[(y + j) * p->width + x];
        const uint16_t *from = sum + cell_of(t, column, row + j);

        count = (uint16_t)(count + 1 + (there & 0xFF) + (there >> 8 & 0xFF));
        for (size_t d = 0; d < nd; d++)
            sums[nd + d] = (uint16_t)(sums[nd + d] + from[d]);
    }
    sst_support_mean_row_ref((uint8_t *)buffer[SST_GPU_SUPPORT_MEAN_COST] + cell_of(t, column, row), rows + 1, &none,
                             &none, &count, 1, nd);
}

void support_mean_reference(const void *push, void *const *buffer, const uint32_t groups[3])
{
    const struct sst_gpu_support *p = push;
    uint16_t *sums = malloc(2 * SST_GPU_MATCH_STEPS * sizeof(*sums));

    assert(sums);
    for (uint32_t i = 0; i < groups[2]; i++) {
        const struct sst_gpu_tile *t = (const struct sst_gpu_tile *)buffer[SST_GPU_SUPPORT_MEAN_TILES] + i;
        const struct part part = part_of(p, t);

        for (int row = part.y0; row < part.y1; row++) {
            for (int column = part.x0; column < part.x1; column++)
                mean_of(p, t, column, row, buffer, sums);
        }
    }
    free(sums);
}

/* --- self-tests --------------------------------------------------------------------------------------------------- */

#define TEST_WIDTH  41
#define TEST_HEIGHT 27
#define TEST_PIXELS (TEST_WIDTH * TEST_HEIGHT)
#define TEST_ARM    5
#define TEST_FIRST  ((size_t)TEST_PIXELS * 36) /* cells of the first tile */
#define TEST_CELLS  (TEST_FIRST + (size_t)30 * 20 * 32)

/* A whole view, and a part of it with as much around as an aggregation reaches. */
static const struct sst_gpu_tile test_tiles[2] = {
    { 0, 0, TEST_WIDTH, TEST_HEIGHT, 0, 0, TEST_WIDTH, TEST_HEIGHT, 0, 34, 36, 0 },
    { 8, 7, 20, 10, 3, 2, 30, 20, 9, 31, 32, (uint32_t)(TEST_FIRST / 4) },
};

struct test {
    uint32_t pixel[TEST_PIXELS], arms[TEST_PIXELS];
    uint16_t sum[TEST_CELLS];
    uint8_t cost[TEST_CELLS];
};

static int test_arms(struct sst_gpu *g, struct test *t)
{
    static const struct sst_gpu_arms push = { TEST_WIDTH, TEST_HEIGHT, TEST_ARM, 18 };
    const void *const initial[SST_GPU_BUFFERS] = { t->pixel, t->arms };
    const size_t bytes[SST_GPU_BUFFERS] = { sizeof(t->pixel), sizeof(t->arms) };
    const struct sst_gpu_work work = { .shader = SST_GPU_SUPPORT_ARMS,
                                       .push = &push,
                                       .groups = { gpu_groups(TEST_WIDTH, SST_GPU_PLANE_WIDTH),
                                                   gpu_groups(TEST_HEIGHT, SST_GPU_PLANE_HEIGHT), 1 } };

    return gpu_compare(g, &work, initial, bytes, SST_GPU_ARMS_OUT, t->arms);
}

/* Colours in patches, with noise. */
static struct test *make_test(void)
{
    struct test *t = calloc(1, sizeof(*t));
    uint32_t state = 2;

    for (int i = 0; t && i < TEST_PIXELS; i++)
        t->pixel[i] = (gpu_random(&state) & 0x0F0F0F) + (uint32_t)(i % TEST_WIDTH / 9 + i / TEST_WIDTH / 4) * 0x0B0D07;
    for (size_t i = 0; t && i < TEST_CELLS; i++)
        t->cost[i] = (uint8_t)(gpu_random(&state) % 3 ? 255 : gpu_random(&state));
    return t;
}

int support_arms_self_test(struct sst_gpu *g)
{
    struct test *t = make_test();
    const int err = t ? test_arms(g, t) : -ENOMEM;

    free(t);
    return err;
}

static int test_support(struct sst_gpu *g, struct test *t, enum sst_gpu_shader shader)
{
    static const struct sst_gpu_support mean = { TEST_WIDTH, TEST_HEIGHT, 0, 0 };
    static const struct sst_gpu_support sum = { TEST_WIDTH, TEST_HEIGHT, 0, TEST_ARM };
    const bool sums = shader == SST_GPU_SUPPORT_SUM;
    const void *const initial[SST_GPU_BUFFERS] = { test_tiles, t->arms, sums ? (void *)t->cost : t->sum,
                                                   sums ? t->sum : (void *)t->cost };
    const size_t bytes[SST_GPU_BUFFERS] = { sizeof(test_tiles), sizeof(t->arms),
                                            sums ? sizeof(t->cost) : sizeof(t->sum),
                                            sums ? sizeof(t->sum) : sizeof(t->cost) };
    const struct sst_gpu_work work = { .shader = shader,
                                       .push = sums ? &sum : &mean,
                                       .groups = { gpu_groups(TEST_WIDTH * 36 / 4, SST_GPU_MATCH_QUADS), TEST_HEIGHT,
                                                   ARRAY_LEN(test_tiles) } };

    return gpu_compare(g, &work, initial, bytes, 3, sums ? t->sum : (void *)t->cost);
}

/* Arms and sums come from the references. */
static int run_test(struct sst_gpu *g, enum sst_gpu_shader shader)
{
    static const struct sst_gpu_arms arms = { TEST_WIDTH, TEST_HEIGHT, TEST_ARM, 18 };
    static const struct sst_gpu_support sum = { TEST_WIDTH, TEST_HEIGHT, 0, TEST_ARM };
    static const uint32_t groups[3] = { 1, 1, ARRAY_LEN(test_tiles) };
    struct test *t = make_test();
    int err;

    if (!t)
        return -ENOMEM;
    support_arms_reference(&arms, (void *const[]){ t->pixel, t->arms }, groups);
    if (shader == SST_GPU_SUPPORT_MEAN)
        support_sum_reference(&sum, (void *const[]){ (void *)(uintptr_t)test_tiles, t->arms, t->cost, t->sum }, groups);
    err = test_support(g, t, shader);
    free(t);
    return err;
}

int support_sum_self_test(struct sst_gpu *g)
{
    return run_test(g, SST_GPU_SUPPORT_SUM);
}

int support_mean_self_test(struct sst_gpu *g)
{
    return run_test(g, SST_GPU_SUPPORT_MEAN);
}
