/* The steps of the disparity stage, each formula with values worked by hand. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "pipeline/lightfield/shift.h"
#include "pipeline/method/disparity/visible.h"
#include "simulators/scene/noise.h"
#include "tests/test.h"

#define NONE      ((int)SST_DISP_NONE)
#define MAX_CELLS 4096

static struct sst_map_u16 map16(int width, int height, const uint16_t *values)
{
    struct sst_map_u16 map;

    assert_int_equal(sst_map_u16_init(&map, width, height), 0);
    for (int i = 0; i < width * height; i++)
        sst_map_u16_row(&map, i / width)[i % width] = values ? values[i] : (uint16_t)NONE;
    return map;
}

static struct sst_map_u8 map8(int width, int height, const uint8_t *values, uint8_t fill)
{
    struct sst_map_u8 map;

    assert_int_equal(sst_map_u8_init(&map, width, height), 0);
    for (int i = 0; i < width * height; i++)
        sst_map_u8_row(&map, i / width)[i % width] = values ? values[i] : fill;
    return map;
}

static void holds(const struct sst_map_u16 *map, const uint16_t *want)
{
    for (int i = 0; i < map->width * map->height; i++) {
        if (sst_map_u16_row(map, i / map->width)[i % map->width] != want[i])
            fail_msg("pixel %d is %d, not %d", i, sst_map_u16_row(map, i / map->width)[i % map->width], want[i]);
    }
}

static struct sst_image grey_image(int width, int height, int level)
{
    struct sst_image img;

    assert_int_equal(sst_image_init(&img, width, height), 0);
    for (int c = 0; c < 3; c++)
        memset(img.plane[c], level, img.stride * (size_t)height);
    return img;
}

static uint8_t *cost_at(const struct sst_volume *v, int x, int y)
{
    return v->cost + ((size_t)y * v->width_padded + (size_t)x) * v->steps_padded;
}

static uint16_t *sum_at(const struct sst_volume *v, int x, int y)
{
    return v->sum + ((size_t)y * v->width_padded + (size_t)x) * v->steps_padded;
}

/* --- winner ------------------------------------------------------------------------------------------------------- */

/* 64 * 0.5 (before - after) / (before - 2 at + after), to the nearest. */
static void parabola(void **state SST_UNUSED)
{
    assert_int_equal(sst_parabola_q6(5, 5, 5), 0);   /* flat */
    assert_int_equal(sst_parabola_q6(0, 5, 0), 0);   /* no minimum */
    assert_int_equal(sst_parabola_q6(10, 0, 10), 0); /* symmetric */
    assert_int_equal(sst_parabola_q6(4, 0, 8), -11); /* 32 * -4 / 12 = -10.67 */
    assert_int_equal(sst_parabola_q6(8, 0, 4), 11);
    assert_int_equal(sst_parabola_q6(0, 0, 8), -32); /* half a step at most */
    assert_int_equal(sst_parabola_q6(8, 0, 0), 32);
    assert_int_equal(sst_parabola_q6(101, 100, 103), -16); /* 32 * -2 / 4 */
    assert_int_equal(sst_parabola_q6(65535, 0, 0), 32);    /* the largest sums do not overflow */
    assert_int_equal(sst_parabola_q6(0, 0, 65535), -32);
}

static void winner_keeps_the_integer_at_the_border(void **state SST_UNUSED)
{
    static const uint8_t costs[4][5] = { { 1, 5, 9, 9, 9 }, { 9, 9, 9, 5, 1 }, { 9, 8, 0, 4, 9 }, { 3, 1, 9, 1, 3 } };
    /* The third: 2 steps and 11/64; the fourth: a tie goes to step 1, and 32 * (3 - 9) / 10 = -19.2 of 64. */
    static const uint16_t want[4] = { 0, 256, 128 + 11, 64 - 19 };
    /* 255 gap / (gap + 128), gap to the least cost two or more steps away: 8, 8, 9, 0. */
    static const uint8_t sure[4] = { 15, 15, 16, 0 };
    struct sst_map_u16 disp = map16(4, 1, NULL);
    struct sst_map_u8 confidence = map8(4, 1, NULL, 7);
    struct sst_volume v;

    assert_int_equal(sst_volume_init(&v, 4, 1, 0, 5), 0);
    memset(v.cost, SST_COST_MAX, v.width_padded * v.steps_padded);
    for (int from_cost = 0; from_cost < 2; from_cost++) {
        for (int i = 0; i < 20; i++) {
            cost_at(&v, i / 5, 0)[i % 5] = from_cost ? costs[i / 5][i % 5] : 99;
            sum_at(&v, i / 5, 0)[i % 5] = from_cost ? 99 : costs[i / 5][i % 5];
        }
        assert_int_equal(sst_volume_winner(&v, from_cost, &disp, &confidence), 0);
        holds(&disp, want);
        assert_memory_equal(confidence.data, sure, sizeof(sure));
    }
    sst_volume_fini(&v);
    sst_map_u16_fini(&disp);
    sst_map_u8_fini(&confidence);
}

/* --- costs -------------------------------------------------------------------------------------------------------- */

static void luma_is_bt601(void **state SST_UNUSED)
{
    struct sst_image img = grey_image(2, 1, 255);
    struct sst_map_u8 luma;

    for (int c = 0; c < 3; c++)
        img.plane[c][0] = (uint8_t)(10 * (c + 1));
    assert_int_equal(sst_luma(&luma, &img), 0);
    assert_int_equal(luma.data[0], 18); /* (770 + 3000 + 870 + 128) / 256 = 18.6 */
    assert_int_equal(luma.data[1], 255);
    sst_map_u8_fini(&luma);
    sst_image_fini(&img);
}

enum { ONE_PIXEL_STRIDE = 320, ONE_PIXEL_BYTES = 18 * ONE_PIXEL_STRIDE };

/* Views of one pixel whose features are `value` in channel `channel`: the costs between them are known. */
static struct sst_descriptor one_pixel(uint8_t memory[ONE_PIXEL_BYTES], int channel, int value)
{
    uint8_t *features = memory + ONE_PIXEL_STRIDE;

    memset(memory, SST_FEATURE_ZERO, ONE_PIXEL_BYTES);
    features[channel / 4 * ONE_PIXEL_STRIDE + channel % 4] = (uint8_t)(SST_FEATURE_ZERO + value);
    return (struct sst_descriptor){ .width = 1, .height = 1, .features = features, .feature_stride = ONE_PIXEL_STRIDE };
}

static int merged_cost(const struct sst_descriptor *ref, const struct sst_neighbour *n, int count)
{
    struct sst_volume v;
    int cost;

    assert_int_equal(sst_volume_init(&v, 1, 1, 0, 1), 0);
    sst_volume_fill(&v, ref, n, count);
    cost = v.cost[0];
    assert_int_equal(v.cost[1], SST_COST_MAX); /* padding */
    sst_volume_fini(&v);
    return cost;
}

static void costs_of_several_neighbours(void **state SST_UNUSED)
{
    static uint8_t memory[4][ONE_PIXEL_BYTES];
    const struct sst_descriptor ref = one_pixel(memory[0], 0, 127), same = one_pixel(memory[1], 0, 127),
                                other = one_pixel(memory[2], 63, 127), opposite = one_pixel(memory[3], 0, -127);
    const struct sst_neighbour near = { &same, 1, 0 }, far = { &other, -1, 0 }, worst = { &opposite, 0, 1 };
    const struct sst_neighbour list[3] = { far, near, worst };

    assert_int_equal(merged_cost(&ref, &near, 1), 0);
    assert_int_equal(merged_cost(&ref, &far, 1), 128);   /* 127^2 / 64 = 252, cut */
    assert_int_equal(merged_cost(&ref, &worst, 1), 128); /* as wrong as unrelated */
    assert_int_equal(merged_cost(&ref, list, 2), 32);    /* (3 * 0 + 128) / 4 */
    assert_int_equal(merged_cost(&ref, list, 3), 64);    /* (0 + 128) / 2 */
}

/*
 * Three rows and a neighbour below: at disparities 0, 0.5, 1, 1.5 row y meets y, y - 0.5, y - 1, y - 1.5, whose
 * features are those of the nearest rows y, y, y - 1, y - 1. Features lie along one axis: 127 in the view, 127, 0, -127
 * in the rows of the neighbour, which cost 0, 252, 254. What begins above row 0 is unseen: 96.
 */
static void learned_costs_between_pixels(void **state SST_UNUSED)
{
    enum { W = 3, H = 3, GROUPS = SST_FEATURE_CHANNELS / 4, BYTES = (H * GROUPS + 2) * ONE_PIXEL_STRIDE };
    static const int value[H] = { 127, 0, -127 };
    static uint8_t memory[2][BYTES];
    struct sst_descriptor view[2];
    struct sst_neighbour below = { &view[1], 0, 1 };
    struct sst_volume v;

    for (int i = 0; i < 2; i++) {
        uint8_t *features = memory[i] + ONE_PIXEL_STRIDE;

        memset(memory[i], SST_FEATURE_ZERO, BYTES);
        for (int y = 0; y < H; y++) {
            for (int x = 0; x < W; x++)
                features[(y * GROUPS + 9) * ONE_PIXEL_STRIDE + 4 * x + 2] =
                    (uint8_t)(SST_FEATURE_ZERO + (i ? value[y] : 127));
        }
        view[i] = (struct sst_descriptor){
            .width = W, .height = H, .features = features, .feature_stride = ONE_PIXEL_STRIDE
        };
    }
    assert_int_equal(sst_volume_init(&v, W, H, 0, 4), 0);
    v.divisor = 2;
    v.phase_step = 1;
    sst_volume_fill(&v, &view[0], &below, 1);
    for (int x = 0; x < W; x++) {
        static const uint8_t want[H][4] = { { 0, 96, 96, 96 }, { 128, 128, 0, 96 }, { 128, 128, 128, 128 } };

        for (int y = 0; y < H; y++)
            assert_memory_equal(cost_at(&v, x, y), want[y], 4);
    }
    sst_volume_fini(&v);
}

/* Right view of a pair shifted by 2: the cost at 2 is 0 where both see; what the neighbour does not see costs 96. */
static void random_image(struct sst_image *img, uint64_t *seed, int x0, int y0, int x1, int y1)
{
    for (int c = 0; c < 3; c++)
        for (int y = y0; y < y1; y++)
            for (int x = x0; x < x1; x++)
                sst_image_row(img, c, y)[x] = (uint8_t)sst_random_u64(seed);
}

/* What an update computes is what the whole new image gives, wherever the change lies. */
static void updated_descriptors(void **state SST_UNUSED)
{
    static const int parts[][4] = {
        { 0, 0, 16, 16 }, { 80, 16, 96, 48 }, { 96, 32, 111, 53 }, { 32, 48, 64, 53 }, { 0, 0, 111, 53 }
    };
    const unsigned phases = 1U << 2 | 1U << 8 | 1U << 10;
    struct sst_descriptor kept = { 0 }, fresh = { 0 };
    struct sst_image img = { 0 };
    uint64_t seed = 7;

    assert_int_equal(sst_image_init(&img, 221, 105), 0);
    random_image(&img, &seed, 0, 0, 221, 105);
    assert_int_equal(sst_descriptor_init(&kept, &img, 2, SST_COST_CENSUS, NULL), 0);
    assert_int_equal(sst_descriptor_add_phases(&kept, phases), 0);
    for (size_t i = 0; i < ARRAY_LEN(parts); i++) {
        const int *p = parts[i];

        random_image(&img, &seed, 2 * p[0], 2 * p[1], sst_min_int(2 * p[2], 221), sst_min_int(2 * p[3], 105));
        assert_int_equal(sst_descriptor_update(&kept, &img, (struct sst_rect){ p[0], p[1], p[2], p[3] }), 0);
        assert_int_equal(sst_descriptor_init(&fresh, &img, 2, SST_COST_CENSUS, NULL), 0);
        assert_int_equal(sst_descriptor_add_phases(&fresh, phases), 0);
        for (int y = 0; y < 53; y++) {
            assert_memory_equal(sst_map_u8_row(&kept.luma, y), sst_map_u8_row(&fresh.luma, y), 111);
            assert_memory_equal(sst_image_row(&kept.image, 2, y), sst_image_row(&fresh.image, 2, y), 111);
            for (int phase = 0; phase < SST_PHASES; phase++) {
                if (fresh.census[phase])
                    assert_memory_equal(kept.census[phase] + (size_t)y * kept.census_stride,
                                        fresh.census[phase] + (size_t)y * fresh.census_stride, 111 * sizeof(uint64_t));
            }
        }
        sst_descriptor_fini(&fresh);
    }
    sst_descriptor_fini(&kept);
    sst_image_fini(&img);
}

static void census_costs_of_a_shifted_pair(void **state SST_UNUSED)
{
    enum { W = 40, H = 9, SHIFT = 2 };
    struct sst_image left = grey_image(W, H, 0), right = grey_image(W, H, 0);
    struct sst_descriptor a, b;
    struct sst_neighbour n = { &b, 1, 0 };
    struct sst_volume v;
    uint64_t seed = 5;

    for (int i = 0; i < 3 * W * H; i++) {
        const int x = i % W, y = i / W % H, c = i / W / H;
        const uint8_t value = (uint8_t)sst_random_u64(&seed);

        sst_image_row(&left, c, y)[x] = value;
        if (x >= SHIFT)
            sst_image_row(&right, c, y)[x - SHIFT] = value;
    }
    assert_int_equal(sst_descriptor_init(&a, &left, 1, SST_COST_CENSUS, NULL), 0);
    assert_int_equal(sst_descriptor_init(&b, &right, 1, SST_COST_CENSUS, NULL), 0);
    assert_int_equal(sst_volume_init(&v, W, H, -1, 5), 0);
    sst_volume_fill(&v, &a, &n, 1);
    for (int x = SHIFT + 4; x < W - SHIFT - 4; x++) {
        assert_int_equal(cost_at(&v, x, 4)[SHIFT + 1], 0);
        assert_true(cost_at(&v, x, 4)[SHIFT] > 40);
    }
    assert_int_equal(cost_at(&v, 1, 4)[3], 96);     /* x - 2 is outside */
    assert_int_equal(cost_at(&v, W - 1, 4)[0], 96); /* x + 1 is outside */
    assert_int_equal(cost_at(&v, 9, 4)[5], SST_COST_MAX);
    sst_volume_fini(&v);
    sst_descriptor_fini(&a);
    sst_descriptor_fini(&b);
    sst_image_fini(&left);
    sst_image_fini(&right);
}

/* --- support ------------------------------------------------------------------------------------------------------ */

static void row_is(const struct sst_map_u8 *map, int y, const char *digits)
{
    for (int x = 0; x < map->width; x++)
        assert_int_equal(sst_map_u8_row(map, y)[x], digits[x] - '0');
}

/* Three columns of 100 and two of red 120, three rows, arms of at most 2: at tau 21 the step passes, at 20 it stops. */
static void support_arms(void **state SST_UNUSED)
{
    struct sst_image img = grey_image(5, 3, 100);
    struct sst_support s;

    for (int y = 0; y < 3; y++)
        sst_image_row(&img, 0, y)[3] = sst_image_row(&img, 0, y)[4] = 120;
    assert_int_equal(sst_disparity_support_init(&s, &img, 2, 20, 1), 0);
    row_is(&s.left, 1, "01201");
    row_is(&s.right, 1, "21010");
    for (int y = 0; y < 3; y++) {
        assert_int_equal(sst_map_u8_row(&s.up, y)[3], y);
        assert_int_equal(sst_map_u8_row(&s.down, y)[3], 2 - y);
        assert_int_equal(sst_map_u16_row(&s.count, y)[0], 9); /* three rows of 1 + 0 + 2 */
        assert_int_equal(sst_map_u16_row(&s.count, y)[4], 6); /* three rows of 1 + 1 + 0 */
    }
    sst_disparity_support_fini(&s);
    assert_int_equal(sst_disparity_support_init(&s, &img, 2, 21, 1), 0);
    row_is(&s.left, 0, "01222");
    row_is(&s.right, 2, "22210");
    sst_disparity_support_fini(&s);
    /* An arm that was stopped does not go on behind the obstacle. */
    for (int y = 0; y < 3; y++)
        sst_image_row(&img, 0, y)[4] = 100;
    assert_int_equal(sst_disparity_support_init(&s, &img, 2, 20, 1), 0);
    row_is(&s.left, 0, "01200");
    row_is(&s.right, 0, "21000");
    sst_disparity_support_fini(&s);
    sst_image_fini(&img);
}

static void aggregation_of_three_pixels(void **state SST_UNUSED)
{
    static const uint8_t costs[3] = { 10, 21, 60 }, once[3] = { 16, 30, 41 }, twice[3] = { 23, 29, 36 };
    struct sst_image img = grey_image(3, 1, 9);
    struct sst_support s;
    struct sst_volume v;

    /* Halves go up: (10 + 21) / 2 = 15.5, 91 / 3 = 30.3, 81 / 2 = 40.5; then 46 / 2, 87 / 3, 71 / 2. */
    assert_int_equal(sst_disparity_support_init(&s, &img, 1, 5, 1), 0);
    assert_int_equal(sst_volume_init(&v, 3, 1, 0, 2), 0);
    memset(v.cost, SST_COST_MAX, v.width_padded * v.steps_padded);
    for (int rounds = 0; rounds < 3; rounds++) {
        for (int x = 0; x < 3; x++)
            cost_at(&v, x, 0)[1] = costs[x];
        assert_int_equal(sst_disparity_support_aggregate(&v, &s, rounds), 0);
        for (int x = 0; x < 3; x++) {
            assert_int_equal(cost_at(&v, x, 0)[1], (rounds == 0 ? costs : rounds == 1 ? once : twice)[x]);
            assert_int_equal(cost_at(&v, x, 0)[2], SST_COST_MAX);
        }
    }
    sst_volume_fini(&v);
    sst_disparity_support_fini(&s);
    sst_image_fini(&img);
}

/* Equal costs stay what they are in the largest region there can be, 255 too; rows far down use the ring again. */
static void aggregation_of_equal_costs(void **state SST_UNUSED)
{
    struct sst_image img = grey_image(13, 40, 9);
    struct sst_support s;
    struct sst_volume v;

    assert_int_equal(sst_disparity_support_init(&s, &img, SST_SUPPORT_MAX_ARM, 5, 1), 0);
    assert_int_equal(sst_volume_init(&v, 13, 40, 0, 32), 0);
    for (int base = 0; base < 256; base += 32) {
        for (size_t i = 0; i < v.width_padded * 40 * 32; i++)
            v.cost[i] = (uint8_t)(base + (int)(i % 32));
        assert_int_equal(sst_disparity_support_aggregate(&v, &s, 1), 0);
        for (int i = 0; i < 13 * 40 * 32; i++) {
            if (cost_at(&v, i / 32 % 13, i / 32 / 13)[i % 32] != base + i % 32)
                fail_msg("a mean of %d is %d", base + i % 32, cost_at(&v, i / 32 % 13, i / 32 / 13)[i % 32]);
        }
    }
    sst_volume_fini(&v);
    sst_disparity_support_fini(&s);
    sst_image_fini(&img);
}

/* --- semi-global optimisation ------------------------------------------------------------------------------------- */

static void sgm_of_two_pixels(void **state SST_UNUSED)
{
    static const uint8_t costs[2][3] = { { 0, 9, 9 }, { 9, 9, 0 } };
    /* To the right: {0 9 9}, then 9 + 0, 9 + 2, 0 + 5. To the left: {9 9 0}, then 0 + 5, 9 + 2, 9 + 0. All other
     * paths come from outside and are the costs: two of them with 4 paths, six with 8. */
    static const uint16_t turns[2][3] = { { 0 + 5, 9 + 11, 9 + 9 }, { 9 + 9, 11 + 9, 5 + 0 } };
    struct sst_disparity_config cfg = { .p1 = 2, .p2 = 5 };
    struct sst_image img = grey_image(2, 1, 50);
    struct sst_volume v;

    assert_int_equal(sst_volume_init(&v, 2, 1, 0, 3), 0);
    memset(v.cost, SST_COST_MAX, v.width_padded * v.steps_padded);
    for (int i = 0; i < 6; i++)
        cost_at(&v, i / 3, 0)[i % 3] = costs[i / 3][i % 3];
    for (cfg.paths = 4; cfg.paths <= 8; cfg.paths += 4) {
        assert_int_equal(sst_disparity_sgm(&v, &img, &cfg), 0);
        for (int i = 0; i < 6; i++)
            assert_int_equal(sum_at(&v, i / 3, 0)[i % 3], turns[i / 3][i % 3] + (cfg.paths - 2) * costs[i / 3][i % 3]);
    }
    /* sum less its minimum, cut at 255 */
    sum_at(&v, 0, 0)[0] = 300;
    sum_at(&v, 0, 0)[1] = 310;
    sum_at(&v, 0, 0)[2] = 1000;
    for (int d = 3; d < 32; d++)
        sum_at(&v, 0, 0)[d] = 555;
    sst_volume_requantise(&v);
    assert_int_equal(cost_at(&v, 0, 0)[0], 0);
    assert_int_equal(cost_at(&v, 0, 0)[1], 10);
    assert_int_equal(cost_at(&v, 0, 0)[2], 255);
    assert_int_equal(cost_at(&v, 0, 0)[3], 255);
    sst_volume_fini(&v);
    sst_image_fini(&img);
}

/* Colours whose step weakens p2 as set_penalties() says. */
static int naive_p2(const struct sst_image *img, const struct sst_disparity_config *cfg, int x, int y, int px, int py)
{
    int step = 0;

    for (int c = 0; c < 3; c++)
        step = sst_max_int(step, abs(sst_image_row(img, c, y)[x] - sst_image_row(img, c, py)[px]));
    return sst_max_int(cfg->p1, cfg->edge_step > 0 ? cfg->p2 * cfg->edge_step / (cfg->edge_step + step) : cfg->p2);
}

/* L of one path in 32 bits, straight from the recurrence: pixels in the order in which the path meets them. */
static void naive_path(int *sum, const struct sst_volume *v, const struct sst_image *img,
                       const struct sst_disparity_config *cfg, int dx, int dy)
{
    static int l[MAX_CELLS];
    const int w = v->width, n = v->width * v->height, steps = v->steps;
    const bool forward = dy > 0 || (dy == 0 && dx > 0);

    for (int i = 0; i < n; i++) {
        const int at = forward ? i : n - 1 - i, x = at % w, y = at / w, px = x - dx, py = y - dy;
        const bool outside = px < 0 || py < 0 || px >= w || py >= v->height;
        const int *p = outside ? NULL : l + (py * w + px) * steps;
        int lowest = p ? p[0] : 0, p2 = p ? naive_p2(img, cfg, x, y, px, py) : 0;

        for (int d = 0; p && d < steps; d++)
            lowest = sst_min_int(lowest, p[d]);
        for (int d = 0; d < steps; d++) {
            int best = p ? sst_min_int(p[d], lowest + p2) : 0;

            if (p && d > 0)
                best = sst_min_int(best, p[d - 1] + cfg->p1);
            if (p && d + 1 < steps)
                best = sst_min_int(best, p[d + 1] + cfg->p1);
            l[at * steps + d] = cost_at(v, x, y)[d] + best - lowest;
            sum[at * steps + d] += l[at * steps + d];
        }
    }
}

static void same_as_naive(struct sst_volume *v, const struct sst_image *img, const struct sst_disparity_config *cfg)
{
    static const int ways[8][2] = {
        { 1, 0 }, { -1, 0 }, { 0, 1 }, { 0, -1 }, { 1, 1 }, { -1, 1 }, { 1, -1 }, { -1, -1 }
    };
    static int want[MAX_CELLS];
    const int cells = v->width * v->height * v->steps;

    assert_true(cells <= MAX_CELLS);
    memset(want, 0, sizeof(want));
    for (int i = 0; i < cfg->paths; i++)
        naive_path(want, v, img, cfg, ways[i][0], ways[i][1]);
    assert_int_equal(sst_disparity_sgm(v, img, cfg), 0);
    for (int i = 0; i < cells; i++) {
        const int p = i / v->steps;

        if (sum_at(v, p % v->width, p / v->width)[i % v->steps] != want[i])
            fail_msg("%d paths, p1 %d, p2 %d: cell %d is %d, not %d", cfg->paths, cfg->p1, cfg->p2, i,
                     sum_at(v, p % v->width, p / v->width)[i % v->steps], want[i]);
    }
}

static void sgm_equals_a_naive_one_in_32_bits(void **state SST_UNUSED)
{
    static const int penalties[][3] = { { 14, 90, 24 },
                                        { 1, 1, 0 },
                                        { 3, 700, 5 },
                                        { SST_DISPARITY_MAX_PENALTY, SST_DISPARITY_MAX_PENALTY, 0 },
                                        { 1, SST_DISPARITY_MAX_PENALTY, 0 } };
    static const int sizes[][3] = { { 7, 5, 9 }, { 1, 1, 1 }, { 1, 6, 33 }, { 9, 1, 64 }, { 5, 5, 32 } };
    uint64_t seed = 11;

    for (int s = 0; s < (int)ARRAY_LEN(sizes); s++) {
        struct sst_image img = grey_image(sizes[s][0], sizes[s][1], 0);
        struct sst_volume v;

        for (int i = 0; i < 3 * img.height * img.width; i++)
            sst_image_row(&img, i % 3, i / 3 / img.width)[i / 3 % img.width] = (uint8_t)(sst_random_u64(&seed) % 60);
        assert_int_equal(sst_volume_init(&v, sizes[s][0], sizes[s][1], 0, sizes[s][2]), 0);
        /* Random costs, all at their largest, and 0 against 255 by turns: along x, along d, as a chessboard. */
        for (int kind = 0; kind < 5; kind++) {
            for (int i = 0; i < v.height * v.width * (int)v.steps_padded; i++) {
                const int d = i % (int)v.steps_padded, x = i / (int)v.steps_padded % v.width,
                          y = i / (int)v.steps_padded / v.width;
                const int odd = kind == 2 ? x : kind == 3 ? d : x + y + d;

                cost_at(&v, x, y)[d] = (uint8_t)(d >= v.steps || kind == 1 ? 255
                                                 : kind == 0               ? sst_random_u64(&seed) % 256
                                                                           : 255u * (odd % 2u));
            }
            for (size_t p = 0; p < ARRAY_LEN(penalties); p++) {
                for (int paths = 4; paths <= 8; paths += 4)
                    same_as_naive(&v, &img,
                                  &(struct sst_disparity_config){ .paths = paths,
                                                                  .p1 = penalties[p][0],
                                                                  .p2 = penalties[p][1],
                                                                  .edge_step = penalties[p][2] });
            }
        }
        sst_volume_fini(&v);
        sst_image_fini(&img);
    }
}

/* --- smoothing and fusion ----------------------------------------------------------------------------------------- */

static void median_of_small_maps(void **state SST_UNUSED)
{
    static const uint16_t row[3] = { 10, 20, 90 }, single[1] = { 77 };
    /* Borders are repeated: at the ends three of five values are the end's own. Each window below is a sorted column of
     * five: 50 50 50 0 0 -> 50; 50 50 0 0 0 -> 0; ...; the last 0 50 50 50 50 -> 50. */
    static const uint16_t column[7] = { 50, 0, 0, 0, 0, 50, 50 };
    uint16_t peak[25], holes[25];
    struct sst_mem_kept lines = { 0 };
    struct sst_map_u16 map;

    for (int i = 0; i < 25; i++) {
        peak[i] = i == 12 ? 60000 : 5;
        holes[i] = (uint16_t)(i % 2 ? NONE : 100 + i); /* 12 unknown: the centre's median is the largest known value */
    }
    map = map16(3, 1, row);
    assert_int_equal(sst_disparity_median5(&map, &lines), 0);
    holds(&map, row);
    sst_map_u16_fini(&map);
    map = map16(1, 1, single);
    assert_int_equal(sst_disparity_median5(&map, &lines), 0);
    holds(&map, single);
    sst_map_u16_fini(&map);
    map = map16(1, 7, column);
    assert_int_equal(sst_disparity_median5(&map, &lines), 0);
    holds(&map, column);
    sst_map_u16_fini(&map);
    map = map16(5, 5, peak);
    assert_int_equal(sst_disparity_median5(&map, &lines), 0);
    peak[12] = 5;
    holds(&map, peak);
    sst_map_u16_fini(&map);
    map = map16(5, 5, holes);
    assert_int_equal(sst_disparity_median5(&map, &lines), 0);
    assert_int_equal(sst_map_u16_row(&map, 2)[2], 124);
    sst_map_u16_fini(&map);
    sst_mem_kept_fini(&lines);
}

static void filtered(int width, int height, const uint16_t *in, const uint8_t *levels, int tau, const uint16_t *want)
{
    struct sst_map_u16 map = map16(width, height, in);
    struct sst_map_u8 luma = map8(width, height, levels, 0);

    assert_int_equal(sst_disparity_bilateral(&map, &luma, tau), 0);
    holds(&map, want);
    sst_map_u16_fini(&map);
    sst_map_u8_fini(&luma);
}

/* Weights in 1/4096: centre 4096, next exp(-1/2) = 2484, two away exp(-2) = 554. */
static void bilateral_of_small_maps(void **state SST_UNUSED)
{
    static const uint16_t near[2] = { 100, 120 }, met[2] = { 108, 112 }; /* 20 * 2484 / 6580 = 7.55 */
    static const uint16_t edge[2] = { 100, 197 }, touch[2] = { 100, 196 }, touched[2] = { 136, 160 }; /* 96 * 0.3775 */
    static const uint16_t hole[3] = { 100, NONE, 120 }, kept[3] = { 102, NONE, 118 }; /* 20 * 554 / 4650 = 2.38 */
    static const uint16_t low[2] = { 0, 65438 };                                      /* the largest that may occur */
    static const uint8_t levels[3] = { 50, 55, 50 };

    filtered(2, 1, near, levels, 6, met);
    filtered(1, 2, near, levels, 6, met);
    filtered(2, 1, near, levels, 5, near); /* a contrast of tau does not count */
    filtered(2, 1, near, levels, 0, near); /* off */
    filtered(2, 1, edge, levels, 255, edge);
    filtered(2, 1, touch, levels, 255, touched);
    filtered(3, 1, hole, levels, 255, kept);
    filtered(2, 1, low, levels, 255, low);
}

static void fusion(void **state SST_UNUSED)
{
    /* Agreement within 64: weights 3 + 1 and 1 + 1: (64 * 4 + 128 * 2) / 6 = 85.3. Else the surer one, the first at a
     * tie. */
    static const uint16_t one[7] = { 64, 64, 64, 64, NONE, NONE, 0 }, two[7] = { 128, 129, 129, 129, 640, NONE, 64 };
    static const uint8_t sure1[7] = { 3, 3, 9, 4, 0, 0, 0 }, sure2[7] = { 1, 5, 4, 4, 5, 0, 0 };
    static const uint16_t want[7] = { 85, 129, 64, 64, 640, NONE, 32 };
    static const uint8_t sure[7] = { 3, 2, 5, 0, 5, 0, 0 };
    struct sst_map_u16 a = map16(7, 1, one), b = map16(7, 1, two);
    struct sst_map_u8 ca = map8(7, 1, sure1, 0), cb = map8(7, 1, sure2, 0);

    sst_fuse(&a, &ca, &b, &cb);
    holds(&a, want);
    assert_memory_equal(ca.data, sure, sizeof(sure));
    sst_map_u16_fini(&a);
    sst_map_u16_fini(&b);
    sst_map_u8_fini(&ca);
    sst_map_u8_fini(&cb);
}

/* --- multi-view check --------------------------------------------------------------------------------------------- */

enum { LONG = 8 };

/* One pixel p with disparity d, one neighbour that knows D at q only; both in 1/64 px above disp_min. */
struct check_case {
    int p, d, q, dn;
    double disp_min, b;
    enum sst_disparity_check want;
};

static const struct check_case check_cases[] = {
    /* b = -1 is the view on the left: p = 2 with disparity 2 is at 2 + 2 = 4 there. */
    { 2, 128, 4, 128, 0, -1, SST_DISPARITY_CORRECT },
    { 2, 128, 4, 192, 0, -1, SST_DISPARITY_CORRECT },   /* one pixel apart still agrees */
    { 2, 128, 4, 193, 0, -1, SST_DISPARITY_OCCLUSION }, /* more does not, and no other d reaches 4 */
    { 2, 192, 4, 128, 0, -1, SST_DISPARITY_MISMATCH },  /* 3 is wrong (nothing at 5), 2 would have been right */
    { 2, NONE, 4, 128, 0, -1, SST_DISPARITY_MISMATCH },
    { 2, 192, 4, 320, 0, -1, SST_DISPARITY_OCCLUSION }, /* what is at 4 has disparity 5: it comes from elsewhere */
    { 7, 128, 6, 64, 0, -1, SST_DISPARITY_OCCLUSION },  /* 7 + 2 is outside */
    { 2, 128, 0, 128, 0, 1, SST_DISPARITY_CORRECT },    /* the view on the right: 2 - 2 = 0 */
    { 2, 128, 6, 128, 0, -2, SST_DISPARITY_CORRECT },   /* two spacings away: 2 + 2 * 2 = 6 */
    { 2, 128, 4, 128, 0, -2, SST_DISPARITY_MISMATCH },  /* not without the factor: 4 = 2 + 2 * 1, and |1 - 2| <= 1 */
    { 2, 192, 4, 192, 0, -0.5, SST_DISPARITY_CORRECT }, /* 2 + 1.5 = 3.5, nearest is floor(x + 0.5) */
    { 2, 64, 0, 64, -3, -1, SST_DISPARITY_CORRECT },    /* disparity -2: 2 - 2 = 0 */
    { 2, 0, 2, 0, 0, -1, SST_DISPARITY_CORRECT },
};

static void multi_view_check(void **state SST_UNUSED)
{
    for (size_t i = 0; i < ARRAY_LEN(check_cases); i++) {
        const struct check_case *c = &check_cases[i];

        /* Along the row, then down a column. */
        for (int down = 0; down < 2; down++) {
            const int w = down ? 1 : LONG, h = down ? LONG : 1;
            struct sst_map_u16 own = map16(w, h, NULL), other = map16(w, h, NULL), empty = map16(w, h, NULL);
            struct sst_map_u8 status = map8(w, h, NULL, 9);
            const double bx = down ? 0 : c->b, by = down ? c->b : 0;
            /* A view that knows nothing changes nothing, before or after. */
            struct sst_checked_views from = {
                { { &empty, NULL, -bx, -by }, { &other, NULL, bx, by }, { &empty, NULL, bx, by } }, 3, 3, c->disp_min
            };

            sst_map_u16_row(&own, down ? c->p : 0)[down ? 0 : c->p] = (uint16_t)c->d;
            sst_map_u16_row(&other, down ? c->q : 0)[down ? 0 : c->q] = (uint16_t)c->dn;
            sst_disparity_check_views(&status, &own, &from, 8);
            if (sst_map_u8_row(&status, down ? c->p : 0)[down ? 0 : c->p] != c->want)
                fail_msg("case %zu, %s: %d, not %d", i, down ? "down" : "across",
                         sst_map_u8_row(&status, down ? c->p : 0)[down ? 0 : c->p], c->want);
            from.count = 0;
            sst_disparity_check_views(&status, &own, &from, 8);
            assert_int_equal(sst_map_u8_row(&status, 0)[0], SST_DISPARITY_OCCLUSION);
            sst_map_u16_fini(&own);
            sst_map_u16_fini(&other);
            sst_map_u16_fini(&empty);
            sst_map_u8_fini(&status);
        }
    }
}

/* Is there a disparity within a pixel of d where d, 1/64 px, puts a pixel of the view under check? */
static bool shows(const struct sst_checked_view *v, double disp_min, int x, int y, int d)
{
    const int xn = sst_shifted(x, sst_shift_by(-v->bx, disp_min), d),
              yn = sst_shifted(y, sst_shift_by(-v->by, disp_min), d);

    return xn >= 0 && yn >= 0 && xn < v->disp_q6->width && yn < v->disp_q6->height &&
           sst_map_u16_row(v->disp_q6, yn)[xn] != NONE && abs(sst_map_u16_row(v->disp_q6, yn)[xn] - d) <= 64;
}

static int plain_check(const struct sst_checked_views *from, const struct sst_map_u16 *own, int i, int steps)
{
    const int x = i % own->width, y = i / own->width, d = sst_map_u16_row(own, y)[x];

    for (int k = 0; k < from->count && d != NONE; k++) {
        if (shows(&from->view[k], from->disp_min_px, x, y, d))
            return SST_DISPARITY_CORRECT;
    }
    for (int k = 0; k < from->count * steps; k++) {
        if (shows(&from->view[k / steps], from->disp_min_px, x, y, k % steps * 64))
            return SST_DISPARITY_MISMATCH;
    }
    return SST_DISPARITY_OCCLUSION;
}

/* Few disparities, so that some agree, of which one in six is not known. */
static struct sst_map_u16 few_disparities(int width, int height, uint64_t *seed)
{
    struct sst_map_u16 map = map16(width, height, NULL);

    for (int i = 0; i < width * height; i++) {
        if (sst_random(seed) < 0.83)
            sst_map_u16_row(&map, i / width)[i % width] = (uint16_t)(64 * (int)(7 * sst_random(seed)) + (i & 31));
    }
    return map;
}

static void checks_equal_plain_ones(void **state SST_UNUSED)
{
    static const int sizes[][3] = { { 1, 1, 8 }, { 3, 5, 8 }, { 17, 9, 0 }, { 33, 21, 8 }, { 130, 3, 5 } };
    int counts[3] = { 0 };
    uint64_t seed = 7;

    for (size_t n = 0; n < ARRAY_LEN(sizes); n++) {
        const int w = sizes[n][0], h = sizes[n][1], steps = sizes[n][2];
        struct sst_checked_views from = { .count = 3, .disp_min_px = (int)n - 2 };
        struct sst_map_u16 own = few_disparities(w, h, &seed), other[3];
        struct sst_map_u8 status = map8(w, h, NULL, 9);

        for (int k = 0; k < 3; k++) {
            other[k] = few_disparities(w, h, &seed);
            from.view[k] = (struct sst_checked_view){ &other[k], NULL, 4 * sst_random(&seed) - 2,
                                                      k ? 4 * sst_random(&seed) - 2 : 0 };
        }
        sst_disparity_check_views(&status, &own, &from, steps);
        for (int i = 0; i < w * h; i++) {
            const int got = sst_map_u8_row(&status, i / w)[i % w];

            assert_int_equal(got, plain_check(&from, &own, i, steps));
            counts[got]++;
        }
        sst_map_u16_fini(&own);
        sst_map_u8_fini(&status);
        for (int k = 0; k < 3; k++)
            sst_map_u16_fini(&other[k]);
    }
    assert_true(counts[0] > 20 && counts[1] > 20 && counts[2] > 20);
}

/* --- filling ------------------------------------------------------------------------------------------------------ */

/* A correct pixel of a neighbour. */
struct known {
    int q, d;
};

/*
 * Fill a row in which pixel 3 is an occlusion between 64 on its left and 320 on its right. Correct pixels of the view
 * one spacing to the left land at q - D, those two spacings to the left at q - 2 D.
 */
static int filled_at_3(const struct known *near, int near_n, const struct known *far, int far_n, double near_b)
{
    static const uint16_t values[LONG] = { 64, 64, 64, 777, 320, 320, 320, 320 };
    static const uint8_t own[LONG] = { 0, 0, 0, SST_DISPARITY_OCCLUSION, 0, 0, 0, 0 };
    struct sst_map_u16 d = map16(LONG, 1, values), near_d = map16(LONG, 1, NULL), far_d = map16(LONG, 1, NULL);
    uint32_t scratch[LONG];
    struct sst_map_u8 status = map8(LONG, 1, own, 0), near_s = map8(LONG, 1, NULL, SST_DISPARITY_MISMATCH),
                      far_s = map8(LONG, 1, NULL, SST_DISPARITY_MISMATCH);
    const struct sst_checked_views from = {
        { { &near_d, &near_s, near_b, 0 }, { &far_d, &far_s, 2 * near_b, 0 } }, 2, 1, 0
    };
    int got;

    for (int i = 0; i < near_n; i++) {
        near_d.data[near[i].q] = (uint16_t)near[i].d;
        near_s.data[near[i].q] = SST_DISPARITY_CORRECT;
    }
    for (int i = 0; i < far_n; i++) {
        far_d.data[far[i].q] = (uint16_t)far[i].d;
        far_s.data[far[i].q] = SST_DISPARITY_CORRECT;
    }
    near_d.data[7] = 256; /* not correct: would land at 3 */
    sst_fill_views(&d, &status, &from, scratch);
    got = d.data[3];
    for (int x = 0; x < LONG; x++)
        assert_true(x == 3 || d.data[x] == values[x]);
    sst_map_u16_fini(&d);
    sst_map_u16_fini(&near_d);
    sst_map_u16_fini(&far_d);
    sst_map_u8_fini(&status);
    sst_map_u8_fini(&near_s);
    sst_map_u8_fini(&far_s);
    return got;
}

static void occlusions(void **state SST_UNUSED)
{
    static const struct known two[1] = { { 5, 128 } }, both[2] = { { 5, 128 }, { 6, 192 } }, far[1] = { { 7, 128 } },
                              no_factor[1] = { { 5, 128 } }, half[1] = { { 4, 192 } }, back[1] = { { 4, 64 } };

    assert_int_equal(filled_at_3(two, 1, NULL, 0, -1), 128);      /* 5 - 2 */
    assert_int_equal(filled_at_3(both, 2, NULL, 0, -1), 192);     /* 5 - 2 and 6 - 3: the foremost */
    assert_int_equal(filled_at_3(NULL, 0, far, 1, -1), 128);      /* 7 - 2 * 2 */
    assert_int_equal(filled_at_3(NULL, 0, no_factor, 1, -1), 64); /* 5 - 2 * 2 = 1: not here; the background */
    assert_int_equal(filled_at_3(back, 1, far, 1, -1), 64);       /* the near view first, though farther */
    assert_int_equal(filled_at_3(half, 1, NULL, 0, -0.5), 192);   /* 4 - 1.5 = 2.5, nearest 3 */
    assert_int_equal(filled_at_3(NULL, 0, NULL, 0, -1), 64);      /* the farther side */
}

/* Fill a map that has no neighbours; in and out [height][width]. */
static void fill_alone(int width, int height, const uint16_t *in, const uint8_t *status_in, const uint16_t *want)
{
    struct sst_map_u16 d = map16(width, height, in);
    struct sst_map_u8 status = map8(width, height, status_in, SST_DISPARITY_OCCLUSION);

    sst_fill_views(&d, &status, &(struct sst_checked_views){ .count = 0 }, NULL);
    holds(&d, want);
    sst_map_u16_fini(&d);
    sst_map_u8_fini(&status);
}

static void mismatches_and_the_rest(void **state SST_UNUSED)
{
    enum { C = SST_DISPARITY_CORRECT, M = SST_DISPARITY_MISMATCH, O = SST_DISPARITY_OCCLUSION, N = NONE };
    /* From the centre of 3x3 each side is the first pixel of three directions, each corner of one:
     * 10 10 10 20 20 20 30 [30] 30 40 40 40 50 50 50 50, the eighth. */
    static const uint16_t ring[9] = { 50, 40, 50, 30, 999, 10, 50, 20, 50 },
                          ring_want[9] = { 50, 40, 50, 30, 30, 10, 50, 20, 50 };
    static const uint8_t ring_status[9] = { C, C, C, C, M, C, C, C, C };
    /* The only correct pixel is two right, one down of the centre: the second step in that direction. */
    uint16_t lone[25] = { 0 }, lone_want[25];
    uint8_t lone_status[25];
    /* Background: leading and trailing holes take the only side, others the smaller one. */
    static const uint16_t row[6] = { 9, 70, 9, 9, 30, 9 }, row_want[6] = { 70, 70, 30, 30, 30, 30 };
    static const uint8_t row_status[6] = { O, C, O, O, C, O };
    /* Empty rows: above the first known row it, below the last one the last, between the one above. */
    static const uint16_t column[5] = { 9, 7, 9, 8, 9 }, column_want[5] = { 7, 7, 7, 8, 8 };
    static const uint8_t column_status[5] = { O, C, O, C, O };
    static const uint16_t none[4] = { 1, 2, 3, 4 }, none_want[4] = { N, N, N, N };
    static const uint8_t all_occluded[4] = { O, O, O, O }, all_wrong[4] = { M, M, M, M };

    fill_alone(3, 3, ring, ring_status, ring_want);
    memset(lone_status, M, sizeof(lone_status));
    lone_status[3 * 5 + 4] = C;
    lone[3 * 5 + 4] = 123;
    for (int i = 0; i < 25; i++)
        lone_want[i] = 123;
    fill_alone(5, 5, lone, lone_status, lone_want);
    fill_alone(6, 1, row, row_status, row_want);
    fill_alone(1, 5, column, column_status, column_want);
    fill_alone(2, 2, none, all_occluded, none_want);
    fill_alone(4, 1, none, all_wrong, none_want);
}

static int by_value(const void *a, const void *b)
{
    return *(const uint16_t *)a - *(const uint16_t *)b;
}

/* The lower median of the nearest correct pixels in 16 directions. */
static int plain_median(const uint16_t *d, const uint8_t *status, const int size[2], int i)
{
    static const int way[16][2] = { { 2, 0 },  { 2, 1 },  { 2, 2 },  { 1, 2 },   { 0, 2 },   { -1, 2 },
                                    { -2, 2 }, { -2, 1 }, { -2, 0 }, { -2, -1 }, { -2, -2 }, { -1, -2 },
                                    { 0, -2 }, { 1, -2 }, { 2, -2 }, { 2, -1 } };
    uint16_t found[16];
    int n = 0;

    for (int k = 0; k < 16; k++) {
        for (int r = 1;; r++) {
            const int x = i % size[0] + way[k][0] * r / 2, y = i / size[0] + way[k][1] * r / 2;

            if (x < 0 || y < 0 || x >= size[0] || y >= size[1])
                break;
            if (status[y * size[0] + x] == SST_DISPARITY_CORRECT) {
                found[n++] = d[y * size[0] + x];
                break;
            }
        }
    }
    qsort(found, (size_t)n, sizeof(*found), by_value);
    return n ? found[(n - 1) / 2] : NONE;
}

static void medians_equal_plain_ones(void **state SST_UNUSED)
{
    static const int sizes[][2] = { { 1, 7 }, { 9, 1 }, { 5, 6 }, { 31, 17 } };
    uint64_t seed = 5;

    for (size_t n = 0; n < ARRAY_LEN(sizes); n++) {
        const int pixels = sizes[n][0] * sizes[n][1];
        uint16_t in[MAX_CELLS], want[MAX_CELLS];
        uint8_t status[MAX_CELLS];

        for (int i = 0; i < pixels; i++) {
            in[i] = (uint16_t)(1000 * sst_random(&seed));
            status[i] = !i || sst_random(&seed) < 0.2 ? SST_DISPARITY_CORRECT : SST_DISPARITY_MISMATCH;
        }
        for (int i = 0; i < pixels; i++) {
            want[i] = status[i] == SST_DISPARITY_CORRECT ? in[i] : (uint16_t)plain_median(in, status, sizes[n], i);
            assert_int_not_equal(want[i], NONE);
        }
        fill_alone(sizes[n][0], sizes[n][1], in, status, want);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(parabola),
        cmocka_unit_test(winner_keeps_the_integer_at_the_border),
        cmocka_unit_test(luma_is_bt601),
        cmocka_unit_test(costs_of_several_neighbours),
        cmocka_unit_test(learned_costs_between_pixels),
        cmocka_unit_test(census_costs_of_a_shifted_pair),
        cmocka_unit_test(updated_descriptors),
        cmocka_unit_test(support_arms),
        cmocka_unit_test(aggregation_of_three_pixels),
        cmocka_unit_test(aggregation_of_equal_costs),
        cmocka_unit_test(sgm_of_two_pixels),
        cmocka_unit_test(sgm_equals_a_naive_one_in_32_bits),
        cmocka_unit_test(median_of_small_maps),
        cmocka_unit_test(bilateral_of_small_maps),
        cmocka_unit_test(fusion),
        cmocka_unit_test(multi_view_check),
        cmocka_unit_test(checks_equal_plain_ones),
        cmocka_unit_test(occlusions),
        cmocka_unit_test(mismatches_and_the_rest),
        cmocka_unit_test(medians_equal_plain_ones),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
