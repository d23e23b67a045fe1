/* The kernels of the second pass, at every level this CPU has, against their plain references. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <string.h>

#include "pipeline/kernels/kernels.h"
#include "tests/kernels/guard.h"
#include "tests/test.h"

static uint64_t seed = 0xC0FFEE123456789ull;

#define FOR_EACH_LEVEL(k, level)                                                                                       \
    for (int level = SST_CPU_BASE; level < SST_CPU_LEVELS; level++)                                                    \
        if (sst_kernels_at((enum sst_cpu_level)level, &(k)))

enum { W = 37, H = 11, STRIDE = W + 3, ENTRIES = W * SST_HYPOTHESES };

static int below(int n)
{
    return (int)(sst_random_u64(&seed) % (uint64_t)n);
}

/* A view whose readable pixels end at an unmapped page; of few colours, so that windows hold similar pixels. */
static struct sst_packed_view random_view(void)
{
    uint32_t *p = guard_random(STRIDE * (H + 2) * sizeof(*p), &seed);

    for (int i = 0; i < STRIDE * (H + 2); i++)
        p[i] &= below(4) ? 0x0F0F0F0Fu : 0xFFFFFFFFu;
    return (struct sst_packed_view){ p + STRIDE + 1, STRIDE };
}

static struct sst_hypothesis_test random_test(uint8_t code[65536])
{
    struct sst_hypothesis_test t = { .width = W, .height = H, .code = code, .own = random_view() };

    t.views = below(SST_HYPOTHESIS_VIEWS + 1);
    t.tolerance = below(200);
    t.similar = below(40);
    t.settled = (unsigned)below(SST_HYPOTHESIS_LIMIT);
    for (int i = 0; i < t.views; i++) {
        t.view[i] = random_view();
        t.x[i] = below(8 * 65536) - 4 * 65536;
        t.y[i] = below(4 * 65536) - 2 * 65536;
        t.dx[i] = below(64) - 32;
        t.dy[i] = below(64) - 32;
    }
    for (int d = 0; d < 65536; d++)
        code[d] = (uint8_t)(1 + sst_min_int(d, 32768) * 253 / 32768);
    return t;
}

static void costs(void **state SST_UNUSED)
{
    static uint8_t code[65536];
    struct sst_kernels k;

    for (int round = 0; round < 40; round++) {
        const struct sst_hypothesis_test t = random_test(code);
        uint16_t *hypothesis = guard_random(ENTRIES * sizeof(*hypothesis), &seed);
        uint16_t *want = guard_random(ENTRIES * sizeof(*want), &seed);
        uint16_t *got = guard_random(ENTRIES * sizeof(*got), &seed);
        uint8_t *count = guard_random(W, &seed);

        for (int i = 0; i < ENTRIES; i++)
            hypothesis[i] = (uint16_t)(round % 4 ? hypothesis[i] & 4095 : hypothesis[i] < 65535 ? hypothesis[i] : 0);
        for (int x = 0; x < W; x++)
            count[x] %= SST_HYPOTHESES + 1;
        for (int y = 0; y < H; y += H - 1) {
            sst_hypothesis_cost_row_ref(want, hypothesis, count, &t, 0, y, W);
            FOR_EACH_LEVEL(k, level)
            {
                memset(got, 0xA5, ENTRIES * sizeof(*got));
                k.hypothesis_cost_row(got, hypothesis, count, &t, 0, y, W);
                assert_memory_equal(got, want, ENTRIES * sizeof(*got));
            }
        }
        guard_free_all();
    }
}

/* Views of one colour: a view that differs by 10 levels in each channel costs 8 * 30, rounded down to 239. */
static void costs_of_known_views(void **state SST_UNUSED)
{
    enum { SIDE = 8 };
    static uint8_t code[65536];
    static uint32_t pixels[SST_HYPOTHESIS_VIEWS + 1][SIDE * SIDE];
    struct sst_hypothesis_test t = {
        .width = 3, .height = 3, .code = code, .views = 5, .similar = 5, .own = { &pixels[0][3 * SIDE + 3], SIDE }
    };
    const uint16_t hypothesis[SST_HYPOTHESES] = { 0, 64 };
    const uint8_t two = 2, one = 1;
    uint16_t cost[SST_HYPOTHESES];

    memset(code, 100, sizeof(code));
    for (int k = 0; k <= 5; k++) {
        for (int i = 0; i < SIDE * SIDE; i++) /* surfaces of code 100, but nearer in view 5 */
            pixels[k][i] = (k == 5 ? 0xC8000000u : 0x64000000u) | (k < 4 ? 0x202020u : 0x2A2A2Au);
        if (k)
            t.view[k - 1] = (struct sst_packed_view){ &pixels[k][3 * SIDE + 3], SIDE };
    }
    sst_hypothesis_cost_row_ref(cost, hypothesis, &two, &t, 0, 1, 1);
    /* Views 1 to 4 are visible, view 4 differs; the four cheapest are three equal ones and one of the others. */
    assert_int_equal(cost[0], (239 + 239) / (4 + 4));
    assert_int_equal(cost[1], cost[0]);
    assert_int_equal(cost[2], SST_HYPOTHESIS_FAR);
    sst_hypothesis_cost_row_ref(cost, hypothesis, &one, &t, 0, 1, 1);
    assert_int_equal(cost[0], 0);
    assert_int_equal(cost[1], SST_HYPOTHESIS_FAR);
    t.views = 3;
    sst_hypothesis_cost_row_ref(cost, hypothesis, &two, &t, 0, 1, 1);
    assert_int_equal(cost[0], 0); /* too few for a mean: the cheapest */
    t.views = 0;
    sst_hypothesis_cost_row_ref(cost, hypothesis, &two, &t, 0, 1, 1);
    assert_int_equal(cost[0], SST_HYPOTHESIS_LIMIT);
}

static void random_path(struct sst_hypothesis_penalty *p, uint16_t *values, int n, int most)
{
    p->near = (uint16_t)(1 + below(100));
    for (int i = 0; i < 256; i++) {
        p->p1[i] = (uint16_t)below(2000);
        p->p2[i] = (uint16_t)(p->p1[i] + below(2000));
    }
    for (int i = 0; i < n; i++)
        values[i] = (uint16_t)(values[i] % (unsigned)most);
}

static void paths(void **state SST_UNUSED)
{
    struct sst_kernels k;

    for (int round = 0; round < 40; round++) {
        const ptrdiff_t step = round % 2 ? 1 : -1;
        const size_t first = step > 0 ? 0 : W - 1, entry = first * SST_HYPOTHESES, all = ENTRIES * sizeof(uint16_t);
        struct sst_hypothesis_penalty penalty;
        struct sst_hypothesis_before before[W];
        uint16_t *data[5], want[2][ENTRIES], got[2][ENTRIES]; /* sum, cost, hypothesis, path before, its hypotheses */
        const uint8_t *colour = guard_random(W, &seed);

        for (int i = 0; i < 5; i++) {
            data[i] = guard_random(all, &seed);
            random_path(&penalty, data[i], ENTRIES, i == 2 || i == 4 ? 32769 : SST_HYPOTHESIS_FAR);
        }
        for (int x = 0; x < W; x++) {
            for (int i = 0; x % 3 == 1 && i < SST_HYPOTHESES; i++) /* one hypothesis, the last that can be read */
                data[3][x * SST_HYPOTHESES + i] = i ? SST_HYPOTHESIS_FAR : 0;
            before[x] = (struct sst_hypothesis_before){ data[3] + x * SST_HYPOTHESES,
                                                        data[4] + (x % 3 == 1 ? ENTRIES - 1 : x * SST_HYPOTHESES) };
        }
        for (int level = SST_CPU_REF; level < SST_CPU_LEVELS; level++) {
            uint16_t(*to)[ENTRIES] = level == SST_CPU_REF ? want : got;

            if (!sst_kernels_at((enum sst_cpu_level)level, &k))
                continue;
            memcpy(to[1], data[0], all);
            k.hypothesis_path_row(&(struct sst_hypothesis_steps){ to[0] + entry, to[1] + entry, data[1] + entry,
                                                                  data[2] + entry, before + first, colour + first },
                                  &penalty, step, W);
            assert_memory_equal(to, want, 2 * all);
        }
        guard_free_all();
    }
}

/* Along a row a path reads what it has just written: a pixel without an opinion takes its predecessor's surface. */
static void path_along_a_row(void **state SST_UNUSED)
{
    struct sst_hypothesis_penalty penalty = { .near = 32 };
    uint16_t start[SST_HYPOTHESES], path[2 * SST_HYPOTHESES], sum[2 * SST_HYPOTHESES], hypothesis[2 * SST_HYPOTHESES];
    const uint16_t cost[2 * SST_HYPOTHESES] = { 0 };
    const uint8_t colour[2] = { 0 };
    struct sst_kernels k;

    penalty.p1[0] = 10;
    penalty.p2[0] = 100;
    for (int i = 0; i < 2 * SST_HYPOTHESES; i++)
        hypothesis[i] = (uint16_t)(i % SST_HYPOTHESES * 1000);
    for (int i = 0; i < SST_HYPOTHESES; i++)
        start[i] = i == 5 ? 0 : 300;
    for (int level = SST_CPU_REF; level < SST_CPU_LEVELS; level++) {
        const struct sst_hypothesis_before before[2] = { { start, hypothesis }, { path, hypothesis } };

        if (!sst_kernels_at((enum sst_cpu_level)level, &k))
            continue;
        memset(sum, 0, sizeof(sum));
        sum[SST_HYPOTHESES] = 7;
        k.hypothesis_path_row(&(struct sst_hypothesis_steps){ path, sum, cost, hypothesis, before, colour }, &penalty,
                              1, 2);
        for (int i = 0; i < 2 * SST_HYPOTHESES; i++)
            assert_int_equal(path[i], i % SST_HYPOTHESES == 5 ? 0 : 100);
        assert_int_equal(sum[0], 100);
        assert_int_equal(sum[SST_HYPOTHESES], 107);
    }
}

/* Disparity 64 moves by one to the right: whole numbers, a part of 1/2, 2^16 / 64 a step. */
static const struct sst_landing landing_right = {
    .width = W, .height = H, .part = { 32768, 32768 }, .step = { 1024, 0 }, .y = 2, .source = 4
};

static void pixels_land_where_they_are_known_to(void **state SST_UNUSED)
{
    const uint16_t disp[] = { 128, 31, 0, 65535, 96, 64 }; /* to 2, 1, 2, nowhere, 6, 6 */
    const uint8_t rank[] = { 7, 8, 200, 1, 2, 3 };
    uint32_t nearest[W * H] = { 0 }, farthest[W * H];

    for (int i = 0; i < W * H; i++)
        farthest[i] = 0x0001FFFF;
    sst_land_row_ref(nearest, farthest, &landing_right, disp, rank, ARRAY_LEN(disp));
    for (int i = 0; i < W * H; i++) {
        const int x = i - 2 * W;
        const uint32_t want = x == 1 ? 32 << 8 | 8 : x == 2 ? 129 << 8 | 7 : x == 6 ? 97 << 8 | 2 : 0;
        const uint32_t far = x == 1 ? 0x0005001F : x == 2 ? 0x00050000 : x == 6 ? 0x00050040 : 0x0001FFFF;

        assert_int_equal(nearest[i], want);
        assert_int_equal(farthest[i], far);
    }
}

/* Of one value, of a few, of any: pixels that move alike, that cross, and that leave the view. */
static void check_landing(const struct sst_kernels *k, int n, unsigned values)
{
    const size_t bytes = W * H * sizeof(uint32_t);
    uint16_t *disp = guard_random((size_t)n * sizeof(*disp), &seed);
    uint8_t *rank = below(4) ? guard_random((size_t)n, &seed) : NULL;
    uint32_t *want = guard_random(bytes, &seed), *got = guard_random(bytes, &seed);
    uint32_t *want_far = guard_random(bytes, &seed), *got_far = guard_random(bytes, &seed);
    struct sst_landing l = landing_right;
    const bool both = below(4);

    for (int i = 0; i < n; i++)
        disp[i] = (uint16_t)(below(30) ? disp[i] % values : 65535);
    l.step[0] = below(4096) - 2048;
    l.step[1] = below(1024) - 512;
    l.whole[0] = below(5) - 2;
    l.y = below(H);
    for (int i = 0; i < W * H; i++)
        want[i] = below(2) ? want[i] & 0xFFFF : below(4) ? 0 : SST_LANDED_CLOSED;
    memcpy(got, want, bytes);
    memcpy(got_far, want_far, bytes);
    sst_land_row_ref(want, both ? want_far : NULL, &l, disp, rank, (size_t)n);
    k->land_row(got, both ? got_far : NULL, &l, disp, rank, (size_t)n);
    assert_memory_equal(got, want, bytes);
    assert_memory_equal(got_far, want_far, bytes);
    guard_free_all();
}

static void landing(void **state SST_UNUSED)
{
    struct sst_kernels k;

    FOR_EACH_LEVEL(k, level)
    {
        for (int n = 1; n <= W; n++) {
            check_landing(&k, n, 1);
            check_landing(&k, n, 8);
            check_landing(&k, n, 256);
            check_landing(&k, n, 65535);
        }
    }
}

static void the_largest_moves_do_not_overflow(void **state SST_UNUSED)
{
    const uint16_t disp[] = { 65534, 65534 };
    uint32_t nearest[W * H] = { 0 };
    struct sst_landing l = {
        .width = W, .height = H, .whole = { -32766, 32767 }, .part = { 65535, 0 }, .step = { 32768, -32768 }, .y = 1
    };
    struct sst_kernels k;

    FOR_EACH_LEVEL(k, level)
    {
        memset(nearest, 0, sizeof(nearest));
        k.land_row(nearest, NULL, &l, disp, NULL, ARRAY_LEN(disp));
        assert_int_equal(nearest[W + 1], 65535 << 8);
        assert_int_equal(nearest[W + 2], 65535 << 8);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(costs),
        cmocka_unit_test(costs_of_known_views),
        cmocka_unit_test(paths),
        cmocka_unit_test(path_along_a_row),
        cmocka_unit_test(pixels_land_where_they_are_known_to),
        cmocka_unit_test(landing),
        cmocka_unit_test(the_largest_moves_do_not_overflow),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
