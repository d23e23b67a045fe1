/* The shaders `sgm_path` and `winner`: their references by those of kernels, and their self-tests. */

#include <assert.h>
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "pipeline/gpu/gpu_internal.h"
#include "pipeline/kernels/kernels.h"

/* --- references --------------------------------------------------------------------------------------------------- */

/* What the shader is given. */
struct given {
    const struct gpu_sgm *push;
    const uint8_t *cost, *penalty;
    uint16_t *sum, p1[256], p2[256];
    size_t n, nd, row; /* pixels, disparities, cells of a row */
};

/* Paths along the rows. @param lines  zeroed row of L */
static void along(const struct given *in, uint16_t *lines)
{
    for (size_t y = 0; y < (size_t)in->push->height; y++)
        sst_sgm_along_rows_ref(lines, in->sum + y * in->row, in->cost + y * in->row, in->row, in->penalty + y * in->n,
                               in->n, in->p1, in->p2, in->push->dx, in->push->first, 1, in->n, in->nd);
}

/* Paths from row to row. @param lines  two zeroed rows of L, `line` apart */
static void across(const struct given *in, uint16_t *lines, size_t line)
{
    const int height = in->push->height;

    for (int i = 0; i < height; i++) {
        const size_t y = (size_t)(in->push->dy > 0 ? i : height - 1 - i);

        sst_sgm_across_row_ref(lines + (size_t)(i % 2) * line, lines + (size_t)(1 - i % 2) * line,
                               in->sum + y * in->row, in->cost + y * in->row, in->penalty + y * in->n, in->p1, in->p2,
                               -in->push->dx, in->push->first, in->n, in->nd);
    }
}

void sgm_path_reference(const void *push, void *const *buffer, const uint32_t groups[3] SST_UNUSED)
{
    const struct gpu_sgm *p = push;
    const uint32_t *table = buffer[GPU_SGM_TABLE];
    const size_t line = ((size_t)p->width + 2) * ((size_t)p->nd + 2 * SST_SGM_PAD);
    uint16_t *lines = calloc(2 * line, sizeof(*lines));
    struct given in = { .push = p,
                        .cost = buffer[GPU_SGM_COST],
                        .penalty = buffer[GPU_SGM_PENALTY],
                        .sum = buffer[GPU_SGM_SUM],
                        .n = (size_t)p->width,
                        .nd = (size_t)p->nd,
                        .row = (size_t)p->pitch * (size_t)p->nd };

    assert(lines);
    for (int i = 0; i < 256; i++) {
        in.p1[i] = (uint16_t)table[i];
        in.p2[i] = (uint16_t)(table[i] >> 16);
    }
    if (p->dy)
        across(&in, lines, line);
    else
        along(&in, lines);
    free(lines);
}

void winner_reference(const void *push, void *const *buffer, const uint32_t groups[3] SST_UNUSED)
{
    const struct gpu_winner *p = push;
    const size_t width = (size_t)p->width;

    for (size_t y = 0; y < (size_t)p->height; y++) {
        const uint16_t *sum = (const uint16_t *)buffer[GPU_WINNER_SUM] + y * (size_t)p->pitch * (size_t)p->nd;
        uint32_t *out = (uint32_t *)buffer[GPU_WINNER_OUT] + y * width;

        for (size_t x = 0; x < width; x++) {
            uint16_t best, second;

            sst_winner_row_ref(&best, &second, sum + x * (size_t)p->nd, (size_t)p->nd, 1, (size_t)p->count);
            out[x] = best | (uint32_t)second << 16;
        }
    }
}

/* --- self-tests --------------------------------------------------------------------------------------------------- */

#define TEST_WIDTH  21
#define TEST_HEIGHT 9
#define TEST_PITCH  24
#define TEST_STEPS  264 /* more than a group does at once */
#define TEST_CELLS  ((size_t)TEST_HEIGHT * TEST_PITCH * TEST_STEPS)

struct test {
    struct gpu_sgm push;
    uint8_t cost[TEST_CELLS], penalty[TEST_HEIGHT * TEST_WIDTH + 3];
    uint32_t table[256];
    uint16_t sum[TEST_CELLS];
};

static uint32_t next_random(uint32_t *state)
{
    *state = *state * 1664525U + 1013904223U;
    return *state >> 8;
}

/* Costs with a minimum that wanders, noise, and runs of equal ones. */
static void set_test(struct test *t)
{
    uint32_t state = 3;

    t->push = (struct gpu_sgm){ .width = TEST_WIDTH, .height = TEST_HEIGHT, .pitch = TEST_PITCH, .nd = TEST_STEPS };
    for (size_t i = 0; i < TEST_CELLS; i++) {
        const size_t x = i / TEST_STEPS, d = i % TEST_STEPS, wanted = x * 37 % TEST_STEPS;
        const size_t off = d > wanted ? d - wanted : wanted - d;

        t->cost[i] = (uint8_t)(next_random(&state) % 5 ? (off < 50 ? 4 * off : 200) : next_random(&state) % 256);
    }
    for (size_t i = 0; i < sizeof(t->penalty); i++)
        t->penalty[i] = (uint8_t)next_random(&state);
    for (uint32_t i = 0; i < 256; i++)
        t->table[i] = (20 + i % 7) | (400 - i) << 16;
}

static void free_buffers(uint8_t *one[], uint8_t *other[])
{
    for (int i = 0; i < SST_GPU_BUFFERS; i++) {
        free(one[i]);
        free(other[i]);
    }
}

/* One direction; the sums are kept for the next one. */
static int run_direction(struct sst_gpu *g, struct test *t)
{
    const void *const initial[SST_GPU_BUFFERS] = { t->cost, t->penalty, t->table, t->sum };
    const size_t bytes[SST_GPU_BUFFERS] = { sizeof(t->cost), sizeof(t->penalty), sizeof(t->table), sizeof(t->sum) };
    const struct sst_gpu_work work = { .shader = SST_GPU_SGM_PATH,
                                       .push = &t->push,
                                       .groups = { gpu_sgm_paths(&t->push), 1, 1 } };
    uint8_t *device[SST_GPU_BUFFERS], *host[SST_GPU_BUFFERS];
    int err = gpu_run_both(g, &work, initial, bytes, device, host);

    if (err)
        return err;
    err = memcmp(device[GPU_SGM_SUM], host[GPU_SGM_SUM], sizeof(t->sum)) ? -ENOTSUP : 0;
    memcpy(t->sum, host[GPU_SGM_SUM], sizeof(t->sum));
    free_buffers(device, host);
    return err;
}

int sgm_path_self_test(struct sst_gpu *g)
{
    struct test *t = calloc(1, sizeof(*t));
    int err = t ? 0 : -ENOMEM;

    if (!err)
        set_test(t);
    for (int i = 0; i < 9 && !err; i++) {
        t->push.dx = i % 3 - 1;
        t->push.dy = i / 3 - 1;
        t->push.first = !i;
        if (t->push.dx || t->push.dy)
            err = run_direction(g, t);
    }
    free(t);
    return err;
}

int winner_self_test(struct sst_gpu *g)
{
    const struct gpu_winner push = { TEST_WIDTH, TEST_HEIGHT, TEST_PITCH, TEST_STEPS, TEST_STEPS - 3 };
    const struct sst_gpu_work work = {
        .shader = SST_GPU_WINNER,
        .push = &push,
        .groups = { (TEST_WIDTH + GPU_WINNER_GROUP - 1) / GPU_WINNER_GROUP, TEST_HEIGHT, 1 },
    };
    const size_t bytes[SST_GPU_BUFFERS] = { TEST_CELLS * sizeof(uint16_t), (size_t)TEST_WIDTH * TEST_HEIGHT * 4 };
    uint8_t *device[SST_GPU_BUFFERS], *host[SST_GPU_BUFFERS];
    uint16_t *sum = malloc(bytes[GPU_WINNER_SUM]);
    uint8_t *out = calloc(1, bytes[GPU_WINNER_OUT]);
    const void *const initial[SST_GPU_BUFFERS] = { sum, out };
    uint32_t state = 9;
    int err = sum && out ? 0 : -ENOMEM;

    for (size_t i = 0; i < TEST_CELLS && !err; i++) /* many are equal, some the largest there is */
        sum[i] = (uint16_t)(i / TEST_STEPS % 5 ? 100 + next_random(&state) % 50 : 65535 - next_random(&state) % 2);
    if (!err)
        err = gpu_run_both(g, &work, initial, bytes, device, host);
    if (!err) {
        err = memcmp(device[GPU_WINNER_OUT], host[GPU_WINNER_OUT], bytes[GPU_WINNER_OUT]) ? -ENOTSUP : 0;
        free_buffers(device, host);
    }
    free(sum);
    free(out);
    return err;
}
