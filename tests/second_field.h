/* tests/second_field.h - views whose maps lack a surface, for the second pass and the carrying of maps on a device. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_TESTS_SECOND_FIELD_H
#define SST_TESTS_SECOND_FIELD_H

#include <stdlib.h>

#include "pipeline/method/disparity/device.h"
#include "pipeline/method/disparity/visible.h"
#include "simulators/scene/noise.h"
#include "tests/test.h"

enum {
    SECOND_W = 111,
    SECOND_H = 67,
    SECOND_SIDE = 3,
    SECOND_VIEWS = SECOND_SIDE * SECOND_SIDE,
    SECOND_FRONT = 12,
    SECOND_BACK = 4,
};

/* A plane behind vertical bars and a slanted board, every point of its own colour. Maps have the bars in front
 * everywhere, with noise, unknown pixels and the board; one view is partly invalid, one absent. */
struct second_field {
    struct sst_image image[SECOND_VIEWS];
    struct sst_map_u16 disp[SECOND_VIEWS];
    struct sst_map_u8 confidence[SECOND_VIEWS], seen[SECOND_VIEWS], agreed[SECOND_VIEWS], status[SECOND_VIEWS];
    struct sst_visible_view view[SECOND_VIEWS];
    struct sst_visible_views all;
    struct sst_disparity_report report;
};

static inline uint8_t second_colour(int x, int y, int surface, int channel)
{
    uint64_t seed =
        (uint64_t)(x + 4096) * 8191 + (uint64_t)(y + 4096) * 131 + (uint64_t)surface * 7 + (uint64_t)channel;

    return (uint8_t)(30 + 50 * surface + (int)(sst_random_u64(&seed) % 90));
}

static inline void second_draw(struct second_field *f, int k, uint64_t *seed)
{
    const int bx = k % SECOND_SIDE - 1, by = k / SECOND_SIDE - 1;

    for (int y = 0; y < SECOND_H; y++) {
        for (int x = 0; x < SECOND_W; x++) {
            const bool bar = (x + SECOND_FRONT * bx + 80) % 8 < 3;
            const int d = y > 48 ? 6 + x / 20 : bar ? SECOND_FRONT : SECOND_BACK;
            const int map = y > 48 ? 64 * 6 + 64 * x / 20 : 64 * SECOND_FRONT + (int)(sst_random_u64(seed) % 40) - 20;

            for (int c = 0; c < 3; c++)
                sst_image_row(&f->image[k], c, y)[x] = second_colour(x + d * bx, y + d * by, y > 48 ? 2 : bar, c);
            sst_map_u16_row(&f->disp[k], y)[x] = sst_random_u64(seed) % 50 ? (uint16_t)map : (uint16_t)SST_DISP_NONE;
            sst_map_u8_row(&f->confidence[k], y)[x] = (uint8_t)(sst_random_u64(seed) % 256);
            sst_map_u8_row(&f->status[k], y)[x] = (uint8_t)(sst_random_u64(seed) % 3);
            sst_map_u8_row(&f->seen[k], y)[x] = k == 1 && x > 90 ? 0 : 255;
        }
    }
}

static inline struct second_field *second_new(void)
{
    struct second_field *f = calloc(1, sizeof(*f));
    uint64_t seed = 9;

    assert_non_null(f);
    f->all = (struct sst_visible_views){ .view = f->view, .count = SECOND_VIEWS, .scale = 1, .range = 16 };
    f->all.report = &f->report;
    for (int k = 0; k < SECOND_VIEWS; k++) {
        assert_int_equal(sst_image_init(&f->image[k], SECOND_W, SECOND_H), 0);
        assert_int_equal(sst_map_u16_init(&f->disp[k], SECOND_W, SECOND_H), 0);
        assert_int_equal(sst_map_u8_init(&f->confidence[k], SECOND_W, SECOND_H), 0);
        assert_int_equal(sst_map_u8_init(&f->seen[k], SECOND_W, SECOND_H), 0);
        assert_int_equal(sst_map_u8_init(&f->status[k], SECOND_W, SECOND_H), 0);
        second_draw(f, k, &seed);
        f->view[k] = (struct sst_visible_view){ .image = k == SECOND_VIEWS - 1 ? NULL : &f->image[k],
                                                .seen = k == 1 ? &f->seen[k] : NULL,
                                                .disp = &f->disp[k],
                                                .confidence = &f->confidence[k],
                                                .bx = k % SECOND_SIDE - 1 + (k % 4 - 2) * 0.011,
                                                .by = k / SECOND_SIDE - 1 - (k % 5 - 2) * 0.013,
                                                .carried = k == 4 || k == 6 };
    }
    return f;
}

static inline void second_free(struct second_field *f)
{
    for (int k = 0; k < SECOND_VIEWS; k++) {
        sst_image_fini(&f->image[k]);
        sst_map_u16_fini(&f->disp[k]);
        sst_map_u8_fini(&f->confidence[k]);
        sst_map_u8_fini(&f->seen[k]);
        sst_map_u8_fini(&f->agreed[k]);
        sst_map_u8_fini(&f->status[k]);
    }
    free(f);
}

static inline void second_assert_map(const struct sst_map_u8 *a, const struct sst_map_u8 *b)
{
    assert_int_equal(a->data != NULL, b->data != NULL);
    for (int y = 0; a->data && y < SECOND_H; y++)
        assert_memory_equal(sst_map_u8_row(a, y), sst_map_u8_row(b, y), SECOND_W);
}

static inline void second_assert_equal(const struct second_field *a, const struct second_field *b)
{
    for (int k = 0; k < SECOND_VIEWS; k++) {
        for (int y = 0; y < SECOND_H; y++)
            assert_memory_equal(sst_map_u16_row(&a->disp[k], y), sst_map_u16_row(&b->disp[k], y),
                                SECOND_W * sizeof(uint16_t));
        second_assert_map(&a->confidence[k], &b->confidence[k]);
        second_assert_map(&a->status[k], &b->status[k]);
        second_assert_map(&a->agreed[k], &b->agreed[k]);
    }
    assert_memory_equal(&a->report, &b->report, sizeof(a->report));
}

/* Pixels of a view with the surface that no map has. */
static inline int second_behind(const struct second_field *f, int k)
{
    int n = 0;

    for (int i = 0; i < SECOND_W * SECOND_H; i++)
        n += abs(sst_map_u16_row(&f->disp[k], i / SECOND_W)[i % SECOND_W] - 64 * SECOND_BACK) < 32;
    return n;
}

/* All that follows the first pass: maps are carried, the matched views get a second pass, maps are carried again, where
 * sources agree, then the carried views get theirs. */
static inline void second_run(struct second_field *f, struct sst_runner_user *device, bool skip)
{
    double percent[2];

    f->all.runner = device;
    f->all.skip_hypotheses = f->all.smooth = skip;
    assert_int_equal(sst_disparity_carry_error(&f->all, NULL, 3, &percent[0]), 0);
    assert_int_equal(sst_disparity_carry(&f->all, f->status, 2), 0);
    assert_int_equal(sst_disparity_repair(&f->all, f->agreed, true, 2, 2), 0);
    assert_int_equal(sst_disparity_carry_error(&f->all, f->status, 3, &percent[1]), 0);
    f->report.views_error = percent[0] + 1000 * percent[1];
}

/* The same on a device and on the CPU, there once. @param report  out: since the last one */
static inline void second_compare(struct sst_runner_user *device, bool skip, struct sst_step_report *report)
{
    static struct second_field *on_cpu[2]; /* by skip */
    struct second_field *on_device = second_new();

    if (!on_cpu[skip]) {
        on_cpu[skip] = second_new();
        second_run(on_cpu[skip], NULL, skip);
        assert_true(second_behind(on_cpu[skip], 3) > 1000);
    }
    second_run(on_device, device, skip);
    sst_disparity_device_report(device, report);
    second_assert_equal(on_device, on_cpu[skip]);
    second_free(on_device);
}

#define SECOND_TESTED 16 /* views whose hypotheses are tested, by round: 6 matched ones and 2 carried ones, twice */

#endif
