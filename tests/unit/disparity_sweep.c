/* The sweep: points of a surface that no map has, and the candidates that they make. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "pipeline/method/disparity/visible.h"
#include "simulators/scene/noise.h"
#include "tests/test.h"

enum { W = 160, H = 96, SIDE = 3, VIEWS = SIDE * SIDE, BACK = 4, FRONT = 12, RANGE = 16, MARGIN = 2, STEP = 64 };
enum { STRIDE = W + 2 * MARGIN, LEVEL = STEP / 2 };

/* Views of a plane of random colours at BACK, whose maps say FRONT. */
struct scene {
    struct sst_sweep_plan plan;
    uint32_t pixels[VIEWS][STRIDE * (H + 2 * MARGIN)];
    uint8_t code[65536];
    struct sst_hypothesis_test test; /* of the middle view */
    struct sst_map_u16 disp;
};

static uint32_t colour_at(int x, int y)
{
    uint64_t seed = (uint64_t)(x + 4096) * 8191 + (uint64_t)(y + 4096) * 131;

    return (uint32_t)sst_random_u64(&seed) & 0xFFFFFF;
}

static struct scene *scene_new(bool plain)
{
    struct scene *s = calloc(1, sizeof(*s));

    assert_non_null(s);
    for (int d = 0; d < 65536; d++)
        s->code[d] = (uint8_t)(1 + sst_min_int(d / 16, 253));
    sst_sweep_plan_init(&s->plan, W, H, RANGE * 64, STEP);
    s->test = (struct sst_hypothesis_test){ .width = W, .height = H, .code = s->code, .tolerance = STEP };
    s->test.similar = 24;
    s->test.settled = 41;
    for (int k = 0; k < VIEWS; k++) {
        const int bx = k % SIDE - 1, by = k / SIDE - 1;
        uint32_t *origin = s->pixels[k] + MARGIN * STRIDE + MARGIN;

        for (int y = -MARGIN; y < H + MARGIN; y++) {
            for (int x = -MARGIN; x < W + MARGIN; x++)
                origin[y * STRIDE + x] =
                    (plain ? 0x808080 : colour_at(x + BACK * bx, y + BACK * by)) | (uint32_t)s->code[64 * FRONT] << 24;
        }
        if (k == VIEWS / 2) {
            s->test.own = (struct sst_packed_view){ origin, STRIDE };
            continue;
        }
        s->test.view[s->test.views] = (struct sst_packed_view){ origin, STRIDE };
        s->test.x[s->test.views] = s->test.y[s->test.views] = 32768;
        s->test.dx[s->test.views] = -bx * 1024;
        s->test.dy[s->test.views++] = -by * 1024;
    }
    assert_int_equal(sst_map_u16_init(&s->disp, W, H), 0);
    for (int i = 0; i < W * H; i++)
        sst_map_u16_row(&s->disp, i / W)[i % W] = 64 * FRONT;
    return s;
}

static void scene_free(struct scene *s)
{
    sst_map_u16_fini(&s->disp);
    free(s);
}

static void finds_what_the_map_lacks(void **state SST_UNUSED)
{
    struct scene *s = scene_new(false);
    struct sst_sweep sweep = { 0 };
    size_t right = 0;

    assert_int_equal(sst_sweep_view(&sweep, &s->plan, &s->test, &s->disp, NULL), 0);
    assert_true(sweep.count > 600); /* of 40 x 24 samples, those near the border are seen by too few views */
    for (size_t i = 0; i < sweep.count; i++)
        right += sweep.point[i].level * LEVEL == 64 * BACK;
    assert_true(100 * right > 99 * sweep.count);
    sst_sweep_fini(&sweep);
    scene_free(s);
}

/* A right map and a plain picture leave nothing to find; neither does a mask. */
static void finds_nothing_else(void **state SST_UNUSED)
{
    struct scene *s = scene_new(false), *plain = scene_new(true);
    struct sst_map_u8 seen = { 0 };
    struct sst_sweep sweep = { 0 };

    assert_int_equal(sst_map_u8_init(&seen, W, H), 0);
    assert_int_equal(sst_sweep_view(&sweep, &s->plan, &s->test, &s->disp, &seen), 0);
    assert_int_equal(sweep.count, 0);
    sst_sweep_fini(&sweep);
    for (int i = 0; i < W * H; i++)
        sst_map_u16_row(&s->disp, i / W)[i % W] = 64 * BACK;
    assert_int_equal(sst_sweep_view(&sweep, &s->plan, &s->test, &s->disp, NULL), 0);
    assert_true(sweep.count < 20); /* at the border */
    sst_sweep_fini(&sweep);
    for (int i = 0; i < W * H; i++)
        sst_map_u16_row(&plain->disp, i / W)[i % W] = SST_DISP_NONE;
    assert_int_equal(sst_sweep_view(&sweep, &plain->plan, &plain->test, &plain->disp, NULL), 0);
    assert_int_equal(sweep.count, 0);
    sst_sweep_fini(&sweep);
    sst_map_u8_fini(&seen);
    scene_free(plain);
    scene_free(s);
}

/* Points of one view are candidates in another, where they are seen from there, heaviest first. */
static void candidates_of_another_view(void **state SST_UNUSED)
{
    struct sst_sweep_point point[400];
    struct sst_sweep sweep = { .point = point, .count = 400, .bx = 1 };
    struct sst_sweeps sweeps = { .sweep = &sweep, .count = 1 };
    struct sst_sweep_candidates c = { 0 };
    const struct sst_sweep_peak *at;
    struct sst_map_u16 map;
    const struct sst_visible_view view = { .disp = &map };

    assert_int_equal(sst_map_u16_init(&map, 320, 96), 0);
    for (int i = 0; i < 320 * 96; i++)
        sst_map_u16_row(&map, i / 320)[i % 320] = 24 * LEVEL;
    for (int i = 0; i < 400; i++)
        point[i] = (struct sst_sweep_point){ (uint16_t)(100 + i % 20), (uint16_t)(40 + i / 20 % 20),
                                             (uint16_t)(i % 4 ? 8 : 24), 100 };
    sst_sweep_plan_init(&sweeps.plan, map.width, map.height, RANGE * 64, STEP);
    /* Disparities 14 and 22 px, seen from (0, 0): at x + 14 and x + 22. The map has the second one alone. */
    assert_int_equal(sst_sweep_candidates(&c, &sweeps, &view, 10), 0);
    at = sst_sweep_candidates_at(&c, 120, 48);
    assert_int_equal(at[0].disp, 8 * LEVEL);
    assert_true(at[0].absent);
    assert_int_equal(at[1].disp, 24 * LEVEL);
    assert_false(at[1].absent);
    for (int i = 2; i < SST_SWEEP_PEAKS; i++)
        assert_int_equal(at[i].disp, SST_DISP_NONE);
    assert_int_equal(sst_sweep_candidates_at(&c, 300, 48)->disp, SST_DISP_NONE);
    sst_sweep_candidates_fini(&c);
    map.width = map.height = 1;
    sweeps.count = 0;
    sst_sweep_plan_init(&sweeps.plan, 1, 1, RANGE * 64, STEP);
    assert_int_equal(sst_sweep_candidates(&c, &sweeps, &view, 10), 0);
    assert_int_equal(sst_sweep_candidates_at(&c, 0, 0)->disp, SST_DISP_NONE);
    sst_sweep_candidates_fini(&c);
    sst_map_u16_fini(&map);
}

/* However wide the range, levels are few; however narrow, they differ. */
static void levels(void **state SST_UNUSED)
{
    struct sst_sweep_plan plan;

    sst_sweep_plan_init(&plan, 320, 240, 64, 8);
    assert_int_equal(plan.level, 4);
    assert_int_equal(plan.levels, 17);
    sst_sweep_plan_init(&plan, 320, 240, 64, 1);
    assert_int_equal(plan.level, 1);
    for (int range = 1; range <= 65534; range += 97) {
        sst_sweep_plan_init(&plan, 2000, 1500, range, 96);
        assert_true(plan.level >= 48 && range / plan.level < SST_SWEEP_LEVELS);
        assert_int_equal(plan.cell % plan.stride, 0);
    }
}

static int floor_of(int a, int b)
{
    return a >= 0 ? a / b : -((-a + b - 1) / b);
}

/* Whole shifts find the cells that fractions do. */
static void whole_shifts(void **state SST_UNUSED)
{
    static const double offsets[] = { 0, 1, -1, 2.013, -0.987, 0.3, 1.013 - 0.013, 3.1 - 0.1 };
    int32_t shift[SST_SWEEP_LEVELS][2];
    struct sst_sweep_plan plan;

    sst_sweep_plan_init(&plan, 1000, 750, 40 * 64, 24);
    for (size_t i = 0; i < ARRAY_LEN(offsets); i++) {
        sst_sweep_shifts(shift, &plan, offsets[i], -offsets[i], -7);
        for (int l = 0; l < plan.levels; l++) {
            const double d = -7 + l * plan.level / 64.0;

            for (int x = 0; x < 100; x++) {
                /* A number that is whole but for rounding counts as whole. */
                assert_int_equal(floor_of(x - shift[l][0], plan.cell),
                                 (int)floor((x - d * offsets[i] + 1e-9) / plan.cell));
                assert_int_equal(floor_of(x - shift[l][1], plan.cell),
                                 (int)floor((x + d * offsets[i] + 1e-9) / plan.cell));
            }
        }
    }
    sst_sweep_shifts(shift, &plan, 1e9, -1e9, -7);
    assert_true(shift[0][0] < -(1 << 20) && shift[0][1] > 1 << 20);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(finds_what_the_map_lacks),
        cmocka_unit_test(finds_nothing_else),
        cmocka_unit_test(candidates_of_another_view),
        cmocka_unit_test(levels),
        cmocka_unit_test(whole_shifts),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
