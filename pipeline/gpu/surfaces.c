/* The shaders `surface_start`, `surface_project` and `surface_list`: their references and self-tests. */
#include "pipeline/gpu/surfaces.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "pipeline/gpu/gpu_internal.h"
#include "pipeline/gpu/sweep.h"
#include "pipeline/kernels/kernels.h"

#define NONE 65535

static const int radii[SST_GPU_SURFACE_WINDOWS] = { 2, 6, 16 };

/* --- references --------------------------------------------------------------------------------------------------- */

/* Is the pixel without a step to the one on the right and to the one below? */
static bool is_flat(const struct sst_gpu_surface_start *p, const uint32_t *own, int x, int y)
{
    const int d = (int)(own[y * p->width + x] & 0xFFFF);
    const int right = (int)(own[y * p->width + sst_min_int(x + 1, p->width - 1)] & 0xFFFF);
    const int below = (int)(own[sst_min_int(y + 1, p->height - 1) * p->width + x] & 0xFFFF);

    return abs(d - right) <= p->step && abs(d - below) <= p->step;
}

void surface_start_reference(const void *push, void *const *buffer, const uint32_t groups[3] SST_UNUSED)
{
    const struct sst_gpu_surface_start *p = push;
    const uint32_t *own = (const uint32_t *)buffer[SST_GPU_SURFACE_START_MAPS] + p->own;
    uint32_t *rows = buffer[SST_GPU_SURFACE_START_ROWS], *projected = buffer[SST_GPU_SURFACE_START_PROJECTED];
    const int n = p->width * p->height;

    for (int at = 0; at < n; at++) {
        const int x = at % p->width, y = at / p->width;

        rows[3 * n + at] = 0;
        for (int w = 0; w < SST_GPU_SURFACE_WINDOWS; w++) {
            uint32_t farthest = NONE, nearest = 0, flat = 1;

            for (int i = sst_max_int(x - radii[w], 0); i <= sst_min_int(x + radii[w], p->width - 1); i++) {
                const uint32_t d = own[y * p->width + i] & 0xFFFF;

                farthest = d < farthest ? d : farthest;
                nearest = d != NONE && d > nearest ? d : nearest;
                flat = flat && is_flat(p, own, i, y);
            }
            rows[w * n + at] = farthest | nearest << 16;
            rows[3 * n + at] |= flat << w;
        }
        projected[at] = NONE;
        projected[n + at] = 0;
    }
    memset(buffer[SST_GPU_SURFACE_START_WEIGHTS], 0, p->words * sizeof(uint32_t));
}

void surface_project_reference(const void *push, void *const *buffer, const uint32_t groups[3])
{
    const struct sst_gpu_surface_project *p = push;
    const struct sst_gpu_check_other *other = buffer[SST_GPU_SURFACE_PROJECT_OTHERS];
    uint32_t *projected = buffer[SST_GPU_SURFACE_PROJECT_PROJECTED];
    const int n = p->width * p->height;

    for (uint32_t k = 0; k < groups[2]; k++) {
        const uint32_t *from = (const uint32_t *)buffer[SST_GPU_SURFACE_PROJECT_MAPS] + other[k].first;
        const struct sst_gpu_shift *s = &other[k].shift;

        for (int i = 0; i < n; i++) {
            const uint32_t d = from[i] & 0xFFFF;
            const int x = i % p->width + s->across + ((s->across_part + (int)d * s->across_step) >> 16);
            const int y = i / p->width + s->down + ((s->down_part + (int)d * s->down_step) >> 16);
            uint32_t *far = projected + y * p->width + x, *near = far + n;

            if (d == NONE || x < 0 || y < 0 || x >= p->width || y >= p->height)
                continue;
            *far = d < *far ? d : *far;
            *near = d > *near ? d : *near;
        }
    }
}

/* What is around a pixel, and its list. */
struct around {
    uint32_t farthest[SST_GPU_SURFACE_WINDOWS], nearest[SST_GPU_SURFACE_WINDOWS];
    bool flat[SST_GPU_SURFACE_WINDOWS];
    const uint32_t *peak;
    uint16_t apart, *list;
    uint32_t count;
};

static void find_windows(struct around *a, const struct sst_gpu_surface_list *p, const uint32_t *rows, int x, int y)
{
    const int n = p->width * p->height;

    for (int w = 0; w < SST_GPU_SURFACE_WINDOWS; w++) {
        a->farthest[w] = NONE;
        a->nearest[w] = 0;
        a->flat[w] = true;
        for (int j = sst_max_int(y - radii[w], 0); j <= sst_min_int(y + radii[w], p->height - 1); j++) {
            const int at = j * p->width + x;
            const uint32_t farthest = rows[w * n + at] & 0xFFFF, nearest = rows[w * n + at] >> 16;

            a->farthest[w] = farthest < a->farthest[w] ? farthest : a->farthest[w];
            a->nearest[w] = nearest > a->nearest[w] ? nearest : a->nearest[w];
            a->flat[w] = a->flat[w] && rows[3 * n + at] >> w & 1;
        }
        if (a->farthest[w] == NONE)
            a->nearest[w] = NONE;
    }
}

/* Unless it is unknown or closer to another one than `apart`; numbers of 16 bits wrap around. */
static void add(struct around *a, uint32_t d)
{
    if (d == NONE || a->count == SST_HYPOTHESES)
        return;
    for (uint32_t i = 0; i < a->count; i++) {
        if ((uint16_t)(a->list[i] - d) < a->apart || (uint16_t)(d - a->list[i]) < a->apart)
            return;
    }
    a->count++;
    for (uint32_t i = a->count - 1; i < SST_HYPOTHESES; i++)
        a->list[i] = (uint16_t)d;
}

static void add_extremes(struct around *a, int w)
{
    if (a->flat[w])
        return;
    add(a, a->farthest[w]);
    add(a, a->nearest[w]);
}

static bool is_absent(uint32_t peak)
{
    return (peak & 0xFFFF) != NONE && peak & SST_GPU_SWEEP_ABSENT;
}

static bool is_near(uint32_t a, uint32_t b, int apart)
{
    return abs((int)a - (int)b) < apart;
}

/* Has a pixel inside a surface no other hypothesis than its own disparity? */
static bool is_alone(const struct around *a, uint32_t own, uint32_t far, uint32_t near)
{
    bool absent = false;

    for (int i = 0; i < SST_GPU_CELL_PEAKS; i++)
        absent = absent || is_absent(a->peak[i]);
    return own != NONE && a->flat[SST_GPU_SURFACE_WINDOWS - 1] && !absent &&
           (far == NONE || is_near(far, own, a->apart)) && (!near || is_near(near, own, a->apart));
}

static void list_all(struct around *a, uint32_t there, uint32_t far, uint32_t near)
{
    const uint32_t own = there & 0xFFFF;

    memset(a->list, 0, SST_HYPOTHESES * sizeof(*a->list));
    a->count = 0;
    if (there & SST_GPU_SURFACE_UNSEEN)
        return;
    add(a, own);
    if (is_alone(a, own, far, near) || (a->count && there & SST_GPU_SURFACE_AGREED))
        return;
    add_extremes(a, 0);
    add(a, far);
    add(a, near ? near : NONE);
    for (int i = 0; i < SST_GPU_CELL_PEAKS && (a->peak[i] & 0xFFFF) != NONE; i++) {
        if (!a->flat[SST_GPU_SURFACE_WINDOWS - 1] || is_absent(a->peak[i]))
            add(a, a->peak[i] & 0xFFFF);
    }
    for (int w = 1; w < SST_GPU_SURFACE_WINDOWS; w++)
        add_extremes(a, w);
}

void surface_list_reference(const void *push, void *const *buffer, const uint32_t groups[3] SST_UNUSED)
{
    const struct sst_gpu_surface_list *p = push;
    const uint32_t *own = (const uint32_t *)buffer[SST_GPU_SURFACE_LIST_MAPS] + p->own;
    const uint32_t *projected = buffer[SST_GPU_SURFACE_LIST_PROJECTED], *peaks = buffer[SST_GPU_SURFACE_LIST_PEAKS];
    uint32_t *counts = buffer[SST_GPU_SURFACE_LIST_COUNTS];
    const int n = p->width * p->height;

    for (int at = 0; at < n; at++) {
        const int x = at % p->width, y = at / p->width, cell = y / p->cell * p->cols + x / p->cell;
        struct around a = { .peak = peaks + cell * SST_GPU_CELL_PEAKS,
                            .apart = (uint16_t)p->apart,
                            .list = (uint16_t *)buffer[SST_GPU_SURFACE_LIST_OUT] + (ptrdiff_t)at * SST_HYPOTHESES };

        find_windows(&a, p, buffer[SST_GPU_SURFACE_LIST_ROWS], x, y);
        list_all(&a, own[at], projected[at], projected[n + at]);
        counts[at] = a.count;
    }
}

/* --- self-tests --------------------------------------------------------------------------------------------------- */

#define TEST_WIDTH  51
#define TEST_HEIGHT 43
#define TEST_PIXELS (TEST_WIDTH * TEST_HEIGHT)
#define TEST_VIEWS  3
#define TEST_OWN    TEST_PIXELS /* the second view */
#define TEST_CELL   16
#define TEST_COLS   4
#define TEST_CELLS  (TEST_COLS * 3)
#define TEST_STEP   24

struct test {
    struct sst_gpu_check_other other[TEST_VIEWS - 1];
    uint32_t maps[TEST_VIEWS * TEST_PIXELS], rows[4 * TEST_PIXELS], projected[2 * TEST_PIXELS], weights[999];
    uint32_t peaks[TEST_CELLS * SST_GPU_CELL_PEAKS], counts[TEST_PIXELS];
    uint16_t list[TEST_PIXELS * SST_HYPOTHESES];
};

/* Surfaces on both sides of an edge, a thin one in front of them, without noise on the right; flags and peaks at
 * random.
 */
static struct test *make_test(void)
{
    struct test *t = calloc(1, sizeof(*t));
    uint32_t state = 21;

    for (int i = 0; t && i < TEST_VIEWS * TEST_PIXELS; i++) {
        const int x = i % TEST_WIDTH + 2 * (i / TEST_PIXELS), y = i % TEST_PIXELS / TEST_WIDTH;
        const uint32_t d = (x < 11 ? 200U : 420U) + (x < 20 ? gpu_random(&state) % 60 : 0) + (y == 5 ? 300U : 0);

        t->maps[i] = gpu_random(&state) % (x < 30 ? 7 : 900) ? d : NONE;
        t->maps[i] |= gpu_random(&state) % 40 ? 0 : SST_GPU_SURFACE_UNSEEN;
        t->maps[i] |= gpu_random(&state) % 5 ? 0 : SST_GPU_SURFACE_AGREED;
    }
    for (int i = 0; t && i < TEST_VIEWS - 1; i++)
        t->other[i] = (struct sst_gpu_check_other){
            (uint32_t)(2 * i * TEST_PIXELS),
            { i ? -1 : 0, 40000 - 5000 * i, i ? -1010 : 1030, -i, 32768, 20 - 30 * i },
        };
    for (int i = 0; t && i < TEST_CELLS * SST_GPU_CELL_PEAKS; i++)
        t->peaks[i] = gpu_random(&state) % 4 && (i % SST_GPU_CELL_PEAKS == 0 || (t->peaks[i - 1] & 0xFFFF) != NONE)
                          ? gpu_random(&state) % 60 * 12 | gpu_random(&state) % 2 << 16
                          : NONE;
    for (int i = 0; t && i < 999; i++)
        t->weights[i] = 5;
    return t;
}

static struct sst_gpu_work work_of(enum sst_gpu_shader shader, const void *push, uint32_t layers)
{
    return (struct sst_gpu_work){ .shader = shader,
                                  .push = push,
                                  .groups = { gpu_groups(TEST_WIDTH, 32), gpu_groups(TEST_HEIGHT, 8), layers } };
}

static const struct sst_gpu_surface_start test_start = { TEST_WIDTH, TEST_HEIGHT, TEST_OWN, TEST_STEP * 3 / 2, 999 };
static const struct sst_gpu_surface_project test_project = { TEST_WIDTH, TEST_HEIGHT };

int surface_start_self_test(struct sst_gpu *g)
{
    const struct sst_gpu_work work = work_of(SST_GPU_SURFACE_START, &test_start, 1);
    struct test *t = make_test();
    const int err =
        t ? gpu_compare(g, &work, (const void *const[]){ t->maps, t->rows, t->projected, t->weights },
                        (const size_t[]){ sizeof(t->maps), sizeof(t->rows), sizeof(t->projected), sizeof(t->weights) },
                        SST_GPU_SURFACE_START_ROWS, NULL)
          : -ENOMEM;

    free(t);
    return err;
}

static void start_test(struct test *t)
{
    surface_start_reference(&test_start, (void *const[]){ t->maps, t->rows, t->projected, t->weights }, NULL);
}

int surface_project_self_test(struct sst_gpu *g)
{
    const struct sst_gpu_work work = work_of(SST_GPU_SURFACE_PROJECT, &test_project, TEST_VIEWS - 1);
    struct test *t = make_test();
    int err = t ? 0 : -ENOMEM;

    if (!err)
        start_test(t);
    if (!err)
        err = gpu_compare(g, &work, (const void *const[]){ t->other, t->maps, t->projected },
                          (const size_t[]){ sizeof(t->other), sizeof(t->maps), sizeof(t->projected) },
                          SST_GPU_SURFACE_PROJECT_PROJECTED, NULL);
    free(t);
    return err;
}

int surface_list_self_test(struct sst_gpu *g)
{
    static const struct sst_gpu_surface_list push = {
        TEST_WIDTH, TEST_HEIGHT, TEST_OWN, TEST_STEP, TEST_CELL, TEST_COLS
    };
    const struct sst_gpu_work work = work_of(SST_GPU_SURFACE_LIST, &push, 1);
    struct test *t = make_test();
    int err = t ? 0 : -ENOMEM;

    if (!err) {
        start_test(t);
        surface_project_reference(&test_project, (void *const[]){ t->other, t->maps, t->projected },
                                  (const uint32_t[]){ 1, 1, TEST_VIEWS - 1 });
        err =
            gpu_compare(g, &work, (const void *const[]){ t->maps, t->rows, t->projected, t->peaks, t->list, t->counts },
                        (const size_t[]){ sizeof(t->maps), sizeof(t->rows), sizeof(t->projected), sizeof(t->peaks),
                                          sizeof(t->list), sizeof(t->counts) },
                        SST_GPU_SURFACE_LIST_OUT, NULL);
    }
    free(t);
    return err;
}
