/* Kernels of the sweep in scene space: every level against the reference, buffers ending at an unmapped page. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <string.h>

#include "pipeline/kernels/kernels.h"
#include "tests/kernels/guard.h"
#include "tests/test.h"

#define BLOCK SST_CONSENSUS_BLOCK

static uint64_t seed = 1;

static unsigned below(unsigned n)
{
    return (unsigned)(sst_random_u64(&seed) % n);
}

/* Bytes, each within `near` of a common one of its place or anywhere. */
static uint8_t *bytes_near(const uint8_t *common, size_t n, int near)
{
    uint8_t *p = malloc(n);

    assert_non_null(p);
    for (size_t i = 0; i < n; i++)
        p[i] = (uint8_t)(near && below(3) ? sst_clamp_int(common[i] + (int)below(2 * (unsigned)near + 1) - near, 0, 255)
                                          : (int)below(256));
    return p;
}

struct block {
    struct sst_consensus_view view[SST_CONSENSUS_VIEWS];
    uint8_t *owned[5 * SST_CONSENSUS_VIEWS];
    int views;
};

static void make_block(struct block *b, int views, int near)
{
    uint8_t common[3][BLOCK], planes[BLOCK];

    for (int x = 0; x < BLOCK; x++) {
        planes[x] = (uint8_t)below(256);
        for (int c = 0; c < 3; c++)
            common[c][x] = (uint8_t)below(256);
    }
    b->views = views;
    for (int k = 0; k < views; k++) {
        uint8_t **own = b->owned + 5 * k;

        for (int c = 0; c < 3; c++)
            b->view[k].colour[c] = own[c] = bytes_near(common[c], BLOCK, near);
        b->view[k].plane = own[4] = bytes_near(planes, BLOCK, near);
        b->view[k].seen = own[3] = bytes_near(planes, BLOCK, 0);
        for (int x = 0; x < BLOCK; x++)
            own[3][x] = own[3][x] < 60 ? 0 : 255;
    }
}

static void free_block(struct block *b)
{
    for (int i = 0; i < 5 * b->views; i++)
        free(b->owned[i]);
}

static void same(const uint8_t *want, const uint8_t *got, size_t n, const char *what, const char *level)
{
    for (size_t i = 0; i < n; i++) {
        if (want[i] != got[i])
            fail_msg("%s on %s: %d at %zu of %zu, not %d", what, level, got[i], i, n, want[i]);
    }
}

static void check_block(const struct sst_kernels *k, int views, int near, const char *level)
{
    const struct sst_consensus_test test = { (uint8_t)below(200), (uint8_t)(200 + below(56)), (uint8_t)below(60),
                                             (uint8_t)(40 + below(60)), (uint8_t)below(9) };
    uint8_t *want[4], *got[4];
    struct block b;
    int claimed;

    make_block(&b, views, near);
    for (int c = 0; c < 4; c++) {
        want[c] = guard_random(BLOCK, &seed);
        got[c] = guard_random(BLOCK, &seed);
    }
    sst_consensus_first_ref(want, b.view, views);
    k->consensus_first(got, b.view, views);
    for (int c = 0; c < 4; c++)
        same(want[c], got[c], BLOCK, "first consensus", level);
    claimed = sst_consensus_again_ref(want, b.view, views, &test);
    assert_int_equal(k->consensus_again(got, b.view, views, &test), claimed);
    for (int i = 0; i < 3 * BLOCK; i++) /* of no cost: any colour */
        got[i / BLOCK][i % BLOCK] = want[3][i % BLOCK] < 255 ? got[i / BLOCK][i % BLOCK] : want[i / BLOCK][i % BLOCK];
    for (int c = 0; c < 4; c++)
        same(want[c], got[c], BLOCK, "consensus of claims", level);
    guard_free_all();
    free_block(&b);
}

static void check_cost(const struct sst_kernels *k, size_t n, const char *level)
{
    uint8_t *in[7], *want = guard_random(n, &seed), *got = guard_random(n, &seed);

    for (int i = 0; i < 7; i++)
        in[i] = guard_random(n, &seed);
    for (int most = 20; most < 256; most += 117) {
        sst_consensus_cost_row_ref(want, (const uint8_t *const *)in, (const uint8_t *const *)in + 3, (uint8_t)most, n);
        k->consensus_cost_row(got, (const uint8_t *const *)in, (const uint8_t *const *)in + 3, (uint8_t)most, n);
        same(want, got, n, "costs", level);
    }
    guard_free_all();
}

static void check_steps(const struct sst_kernels *k, size_t n, const char *level)
{
    uint8_t *in[6], *want = guard_random(n, &seed), *got = guard_random(n, &seed);

    for (int i = 0; i < 6; i++)
        in[i] = guard_random(n, &seed);
    sst_colour_step_row_ref(want, (const uint8_t *const *)in, (const uint8_t *const *)in + 3, n);
    k->colour_step_row(got, (const uint8_t *const *)in, (const uint8_t *const *)in + 3, n);
    same(want, got, n, "colour steps", level);
    guard_free_all();
}

/* Costs of pixels. */
static const uint8_t *random_costs(size_t n)
{
    uint8_t *p = guard_random(n, &seed);

    for (size_t i = 0; i < n; i++)
        p[i] %= SST_CONSENSUS_MOST + 1;
    return p;
}

/* Random planes of each block, at least one. */
static struct sst_consensus_listed random_planes(size_t n, int planes)
{
    const size_t blocks = n / BLOCK;
    uint8_t *plane = guard_random(blocks * (size_t)planes, &seed), *count = guard_random(blocks, &seed);

    for (size_t b = 0; b < blocks; b++) {
        count[b] = 0;
        for (int i = 0; i < planes; i++) {
            if (below(3) || i == planes - 1)
                plane[b * (size_t)planes + count[b]++] = (uint8_t)i;
        }
    }
    return (struct sst_consensus_listed){ plane, count };
}

static void check_rows(const struct sst_kernels *k, size_t n, int planes, const char *level)
{
    const size_t stride = n + 2, bytes = stride * (size_t)planes;
    struct sst_consensus_rows rows = { .alike = (uint8_t)below(255), .planes = planes, .stride = stride };
    uint8_t *step[8];
    uint8_t *want = guard_random(n * (size_t)planes, &seed);
    uint8_t *got = memcpy(guard_random(n * (size_t)planes, &seed), want, n * (size_t)planes);
    uint8_t *const least[2] = { guard_random(n, &seed), guard_random(n, &seed) };
    uint8_t *const found[2] = { guard_random(n, &seed), guard_random(n, &seed) };

    rows.listed = random_planes(n, planes);
    rows.above = random_costs(bytes) + 1;
    rows.own = random_costs(bytes) + 1;
    rows.below = random_costs(bytes) + 1;
    rows.flat = (uint8_t)below(rows.alike + 1);
    rows.dearer = (uint16_t)below(below(2) ? 256 : 65536);
    rows.farther = (uint16_t)below(below(2) ? 256 : 65536);
    for (int i = 0; i < 8; i++)
        rows.step[i] = step[i] = guard_random(n, &seed);
    for (size_t x = 0; x < n; x += 2) { /* flat but for one pixel in three */
        for (int i = 0; i < 8; i++)
            step[i][x] = (uint8_t)below(rows.flat + 1 + (x % 3 == 0));
    }
    sst_consensus_mean_row_ref(want, &rows, n);
    k->consensus_mean_row(got, &rows, n);
    same(want, got, n * (size_t)planes, "means", level);
    sst_consensus_least_row_ref(least, &rows, n);
    k->consensus_least_row(found, &rows, n);
    same(least[0], found[0], n, "planes of the least means", level);
    same(least[1], found[1], n, "least means", level);
    guard_free_all();
}

static void check_paths(const struct sst_kernels *k, size_t n, int planes, const char *level)
{
    const size_t stride = n + 2, bytes = stride * (size_t)planes, packed = n * (size_t)planes;
    struct sst_consensus_paths want = { .p1 = (uint8_t)below(30),
                                        .p2 = (uint8_t)below(256),
                                        .edge = (uint8_t)below(256),
                                        .p2_edge = (uint8_t)below(256),
                                        .planes = planes,
                                        .stride = stride },
                               got;

    want.listed = random_planes(n, planes);
    want.cost = guard_random(packed, &seed);
    for (int t = 0; t < 2; t++) {
        want.from[t] = (uint8_t *)guard_random(bytes, &seed) + 1;
        want.from_least[t] = (uint8_t *)guard_random(stride, &seed) + 1;
        want.step[t] = guard_random(n, &seed);
    }
    got = want;
    for (int t = 0; t < 2; t++) {
        want.to[t] = guard_random(bytes, &seed);
        got.to[t] = memcpy(guard_random(bytes, &seed), want.to[t], bytes);
        want.least[t] = guard_random(n, &seed);
        got.least[t] = guard_random(n, &seed);
    }
    want.mean = guard_random(packed, &seed);
    got.mean = memcpy(guard_random(packed, &seed), want.mean, packed);
    sst_consensus_path_row_ref(&want, n);
    k->consensus_path_row(&got, n);
    for (int t = 0; t < 2; t++) {
        same(want.least[t], got.least[t], n, "least of a path", level);
        for (int p = 0; p < planes; p++) {
            const size_t at = (size_t)p * stride;

            same(want.to[t] + at, got.to[t] + at, n, "path", level);
        }
    }
    same(want.mean, got.mean, packed, "mean of paths", level);
    guard_free_all();
}

static void check_choice(const struct sst_kernels *k, size_t n, int planes, const char *level)
{
    const size_t bytes = n * (size_t)planes;
    struct sst_consensus_choice want = { .planes = planes }, got;

    for (int few = 0; few < 2; few++) {
        uint8_t *sum[2] = { guard_random(bytes, &seed), guard_random(bytes, &seed) };

        for (size_t i = 0; i < bytes && few; i++) { /* equal ones, too */
            sum[0][i] /= 32;
            sum[1][i] /= 32;
        }
        want.sum[0] = sum[0];
        want.sum[1] = sum[1];
        want.listed = random_planes(n, planes);
        want.cost = guard_random(bytes, &seed);
        got = want;
        want.plane = guard_random(n, &seed), got.plane = guard_random(n, &seed);
        want.costs = guard_random(n, &seed), got.costs = guard_random(n, &seed);
        want.before = guard_random(n, &seed), got.before = guard_random(n, &seed);
        want.sums = guard_random(n, &seed), got.sums = guard_random(n, &seed);
        want.after = guard_random(n, &seed), got.after = guard_random(n, &seed);
        sst_consensus_choose_row_ref(&want, n);
        k->consensus_choose_row(&got, n);
        same(want.plane, got.plane, n, "planes", level);
        same(want.costs, got.costs, n, "their costs", level);
        same(want.before, got.before, n, "sums before", level);
        same(want.sums, got.sums, n, "sums", level);
        same(want.after, got.after, n, "sums after", level);
        guard_free_all();
    }
}

static void all_levels_equal_the_reference(void **state SST_UNUSED)
{
    for (int level = SST_CPU_REF; level < SST_CPU_LEVELS; level++) {
        const char *name = sst_cpu_level_name((enum sst_cpu_level)level);
        struct sst_kernels k;

        if (!sst_kernels_at((enum sst_cpu_level)level, &k))
            continue;
        for (int views = 0; views <= SST_CONSENSUS_VIEWS; views += 1 + views / 3) {
            for (int near = 0; near < 12; near += 4)
                check_block(&k, views, near, name);
        }
        check_block(&k, SST_CONSENSUS_VIEWS, 1, name);
        for (size_t n = 1; n < 150; n++)
            check_steps(&k, n, name);
        for (size_t n = BLOCK; n <= 3 * BLOCK; n += BLOCK) {
            check_cost(&k, n, name);
            for (int planes = 1; planes < 256; planes += 1 + 3 * planes) {
                check_rows(&k, n, planes, name);
                check_paths(&k, n, planes, name);
                check_choice(&k, n, planes, name);
            }
            check_choice(&k, n, 255, name);
        }
    }
}

/* Three views show one colour, one another: the three win, and the lone one has no say. */
static void most_views_decide(void **state SST_UNUSED)
{
    uint8_t colour[4][BLOCK], seen[BLOCK], plane[4][BLOCK], out[4][BLOCK];
    uint8_t *const to[4] = { out[0], out[1], out[2], out[3] };
    struct sst_consensus_view view[4];

    memset(seen, 255, sizeof(seen));
    for (int k = 0; k < 4; k++) {
        memset(colour[k], k ? 100 : 200, BLOCK);
        memset(plane[k], k ? 7 : 30, BLOCK);
        view[k] = (struct sst_consensus_view){ { colour[k], colour[k], colour[k] }, seen, plane[k] };
    }
    sst_kernels_get()->consensus_first(to, view, 4);
    assert_int_equal(out[0][0], 99); /* quotients are rounded down */
    assert_in_range(out[3][0], 1, SST_CONSENSUS_SPARE);
    sst_kernels_get()->consensus_again(to, view, 4, &(struct sst_consensus_test){ 6, 8, 28, 60, 1 });
    assert_int_equal(out[1][63], 99);
    /* One that is nearer hides the plane; two are missing of five that agree. */
    assert_in_range(out[3][63], 2 * SST_CONSENSUS_ALONE / 7, 2 * SST_CONSENSUS_ALONE / 7 + 3);
    assert_int_equal(sst_kernels_get()->consensus_again(to, view, 4, &(struct sst_consensus_test){ 9, 11, 28, 60, 0 }),
                     15);
    assert_int_equal(out[3][0], 255);
    /* Three claim it where four are wanted, the fourth one at one pixel. */
    assert_int_equal(sst_kernels_get()->consensus_again(to, view, 4, &(struct sst_consensus_test){ 6, 8, 28, 60, 4 }),
                     0);
    assert_int_equal(out[3][63], 255);
    plane[0][20] = 6;
    assert_int_equal(sst_kernels_get()->consensus_again(to, view, 4, &(struct sst_consensus_test){ 6, 8, 28, 60, 4 }),
                     2);
}

/* Of planes that cost alike, a flat surface takes the farthest and a textured one the nearest; their costs lack the
 * price. A fit that is better by more than the price wins. */
static void prices_decide_between_equal_planes(void **state SST_UNUSED)
{
    enum { PLANES = 5, STRIDE = BLOCK + 2 };
    uint8_t cost[PLANES][STRIDE], step[BLOCK], plane[PLANES] = { 0, 1, 2, 3, 4 }, count[1] = { PLANES };
    uint8_t out[2][BLOCK], *const to[2] = { out[0], out[1] };
    struct sst_consensus_rows rows = { .above = cost[0] + 1,
                                       .own = cost[0] + 1,
                                       .below = cost[0] + 1,
                                       .alike = 40,
                                       .flat = 4,
                                       .dearer = 2 * 256,
                                       .farther = 256,
                                       .listed = { plane, count },
                                       .planes = PLANES,
                                       .stride = STRIDE };

    memset(cost, 20, sizeof(cost));
    memset(step, 0, sizeof(step));
    memset(step + 32, 10, 32); /* textured */
    for (int i = 0; i < 8; i++)
        rows.step[i] = step;
    sst_kernels_get()->consensus_least_row(to, &rows, BLOCK);
    assert_int_equal(out[0][0], 0);
    assert_int_equal(out[0][32], PLANES - 1);
    assert_int_equal(out[1][0], out[1][32]);
    assert_in_range(out[1][32], 19, 20);
    memset(cost[1], 20 - 2, STRIDE); /* three planes behind the nearest: 3 levels dearer */
    sst_kernels_get()->consensus_least_row(to, &rows, BLOCK);
    assert_int_equal(out[0][40], PLANES - 1);
    memset(cost[1], 20 - 4, STRIDE);
    sst_kernels_get()->consensus_least_row(to, &rows, BLOCK);
    assert_int_equal(out[0][40], 1);
    assert_in_range(out[1][40], 15, 16);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(all_levels_equal_the_reference),
        cmocka_unit_test(most_views_decide),
        cmocka_unit_test(prices_decide_between_equal_planes),
    };

    return cmocka_run_group_tests_name("kernels/consensus", tests, NULL, NULL);
}
