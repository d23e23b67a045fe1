/* The second pass: gaps between bars whose maps closed them, thin bars that the maps lost. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "pipeline/method/disparity/visible.h"
#include "simulators/scene/noise.h"
#include "tests/small.h"
#include "tests/test.h"

enum { W = 96, H = 48, SIDE = 3, VIEWS = SIDE * SIDE, FRONT = 12, BACK = 4, BAR = 3, PITCH = 8 };

/* A picture behind vertical bars, seen by 3x3 cameras; every point of a surface has its own colour. */
struct scene {
    struct sst_image image[VIEWS];
    struct sst_map_u16 disp[VIEWS], truth[VIEWS];
    struct sst_map_u8 confidence[VIEWS], seen[VIEWS];
    struct sst_visible_view view[VIEWS];
    struct sst_visible_views all;
};

static uint8_t colour_of(int x, int y, int surface, int channel)
{
    uint64_t seed =
        (uint64_t)(x + 4096) * 8191 + (uint64_t)(y + 4096) * 131 + (uint64_t)surface * 7 + (uint64_t)channel;

    return (uint8_t)(40 + (surface ? 100 : 0) + (int)(sst_random_u64(&seed) % 80));
}

static bool is_bar(int x)
{
    return (x + 10 * PITCH) % PITCH < BAR;
}

static void draw(struct scene *s, int k)
{
    const int bx = k % SIDE - 1, by = k / SIDE - 1;

    for (int y = 0; y < H; y++) {
        for (int x = 0; x < W; x++) {
            const bool front = is_bar(x + FRONT * bx);
            const int d = front ? FRONT : BACK;

            for (int c = 0; c < 3; c++)
                sst_image_row(&s->image[k], c, y)[x] = colour_of(x + d * bx, y + d * by, front, c);
            sst_map_u16_row(&s->truth[k], y)[x] = (uint16_t)(64 * d);
        }
    }
}

static void scene_init(struct scene *s)
{
    *s = (struct scene){ .all = { .view = s->view, .count = VIEWS, .scale = 1, .range = 16 } };
    for (int k = 0; k < VIEWS; k++) {
        assert_int_equal(sst_image_init(&s->image[k], W, H), 0);
        assert_int_equal(sst_map_u16_init(&s->disp[k], W, H), 0);
        assert_int_equal(sst_map_u16_init(&s->truth[k], W, H), 0);
        assert_int_equal(sst_map_u8_init(&s->confidence[k], W, H), 0);
        draw(s, k);
        s->view[k] =
            (struct sst_visible_view){ &s->image[k], NULL, &s->disp[k], &s->confidence[k], k % SIDE - 1, k / SIDE - 1 };
    }
}

static void scene_fini(struct scene *s)
{
    for (int k = 0; k < VIEWS; k++) {
        sst_image_fini(&s->image[k]);
        sst_map_u16_fini(&s->disp[k]);
        sst_map_u16_fini(&s->truth[k]);
        sst_map_u8_fini(&s->confidence[k]);
        sst_map_u8_fini(&s->seen[k]);
    }
}

/* Maps that closed all gaps, but for a strip. */
static void close_gaps(struct scene *s, int d)
{
    for (int k = 0; k < VIEWS; k++) {
        for (int i = 0; i < W * H; i++)
            sst_map_u16_row(&s->disp[k], i / W)[i % W] =
                i / W % 16 < 2 ? sst_map_u16_row(&s->truth[k], i / W)[i % W] : (uint16_t)(64 * d);
    }
}

/* Percent of the middle view's pixels that are off by over a pixel, a border of two spacings left out. */
static double bad(const struct scene *s)
{
    const int k = VIEWS / 2;
    int wrong = 0, n = 0;

    for (int y = 2 * FRONT; y < H - FRONT; y++) {
        for (int x = 2 * FRONT; x < W - 2 * FRONT; x++, n++)
            wrong += abs(sst_map_u16_row(&s->disp[k], y)[x] - sst_map_u16_row(&s->truth[k], y)[x]) > 64;
    }
    return 100.0 * wrong / n;
}

/* Maps of one disparity everywhere become right. @param wrong  percent of their pixels that are wrong, at least */
static void recovers(int d, double wrong)
{
    struct scene s;

    scene_init(&s);
    close_gaps(&s, d);
    assert_true(bad(&s) > wrong);
    assert_int_equal(sst_disparity_visible(&s.all, 2, 1), 0);
    assert_true(bad(&s) < 2);
    scene_fini(&s);
}

static void closed_gaps_open(void **state SST_UNUSED)
{
    recovers(FRONT, 40);
}

static void lost_bars_return(void **state SST_UNUSED)
{
    recovers(BACK, 30);
}

static void right_maps_stay(void **state SST_UNUSED)
{
    struct scene s;

    scene_init(&s);
    for (int k = 0; k < VIEWS; k++)
        memcpy(s.disp[k].data, s.truth[k].data, s.truth[k].stride * H);
    assert_int_equal(sst_disparity_visible(&s.all, 1, 1), 0);
    assert_true(bad(&s) < 0.2);
    scene_fini(&s);
}

static void same_bytes_for_any_threads(void **state SST_UNUSED)
{
    struct scene one, four;

    scene_init(&one);
    scene_init(&four);
    close_gaps(&one, FRONT);
    close_gaps(&four, FRONT);
    assert_int_equal(sst_disparity_visible(&one.all, 2, 1), 0);
    assert_int_equal(sst_disparity_visible(&four.all, 2, 4), 0);
    for (int k = 0; k < VIEWS; k++) {
        assert_memory_equal(one.disp[k].data, four.disp[k].data, one.disp[k].stride * H);
        assert_memory_equal(one.confidence[k].data, four.confidence[k].data, one.confidence[k].stride * H);
    }
    scene_fini(&one);
    scene_fini(&four);
}

/* Pixels that must not be matched get no disparity, and those without hypotheses keep none; absent views are left out.
 */
static void unknown_pixels(void **state SST_UNUSED)
{
    struct scene s;

    scene_init(&s);
    close_gaps(&s, FRONT);
    s.view[0].image = NULL;
    for (int k = 1; k < VIEWS; k++) {
        assert_int_equal(sst_map_u8_init(&s.seen[k], W, H), 0);
        memset(s.seen[k].data, 255, s.seen[k].stride * H);
        memset(sst_map_u8_row(&s.seen[k], 5), 0, W);
        s.view[k].seen = &s.seen[k];
    }
    assert_int_equal(sst_disparity_visible(&s.all, 1, 2), 0);
    for (int x = 0; x < W; x++)
        assert_int_equal(sst_map_u16_row(&s.disp[4], 5)[x], SST_DISP_NONE);
    for (int k = 0; k < VIEWS; k++) { /* unknown everywhere, and nothing in the picture that could change it */
        memset(s.disp[k].data, 0xFF, s.disp[k].stride * H);
        for (int i = 0; i < 3 * H; i++)
            memset(sst_image_row(&s.image[k], i / H, i % H), 128, W);
    }
    assert_int_equal(sst_disparity_visible(&s.all, 1, 2), 0);
    for (int i = 0; i < W * H; i++)
        assert_int_equal(sst_map_u16_row(&s.disp[4], i / W)[i % W], SST_DISP_NONE);
    scene_fini(&s);
}

/* One pixel wide, one pixel high: no path has a neighbour. */
static void smallest_views(void **state SST_UNUSED)
{
    struct scene s;

    scene_init(&s);
    close_gaps(&s, FRONT);
    for (int side = 0; side < 2; side++) {
        for (int k = 0; k < VIEWS; k++) {
            s.image[k].width = s.disp[k].width = s.confidence[k].width = side ? W : 1;
            s.image[k].height = s.disp[k].height = s.confidence[k].height = side ? 1 : H;
        }
        assert_int_equal(sst_disparity_visible(&s.all, 2, 1), 0);
    }
    scene_fini(&s);
}

static void cancelled(void **state SST_UNUSED)
{
    SST_ATOMIC(bool) cancel = true;
    struct scene s;

    scene_init(&s);
    s.all.cancel = &cancel;
    assert_int_equal(sst_disparity_visible(&s.all, 1, 1), -ECANCELED);
    scene_fini(&s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(closed_gaps_open), cmocka_unit_test(lost_bars_return),
        cmocka_unit_test(right_maps_stay),  thread_test(same_bytes_for_any_threads),
        cmocka_unit_test(unknown_pixels),   cmocka_unit_test(smallest_views),
        cmocka_unit_test(cancelled),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
