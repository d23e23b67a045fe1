/* tests/gpu_field.h - small light fields with everything in them that a device must render as the CPU does. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_TESTS_GPU_FIELD_H
#define SST_TESTS_GPU_FIELD_H

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "pipeline/method/render/device_internal.h"
#include "simulators/scene/noise.h"
#include "tests/test.h"

#define FIELD_VIEWS  9
#define FIELD_WIDTH  301 /* no multiple of a group's width */
#define FIELD_HEIGHT 50

static struct sst_map_u8 field_masks[FIELD_VIEWS]; /* of what a clear picture removes; the last view has none */

/* 3x3 views with measured offsets: blocks of five labels, each in its depth, with noise; unknown disparities, unlabeled
 * pixels; one view partly invalid, one without labels, one without confidences, one absent. */
static inline void field_init(struct sst_lightfield *lf)
{
    uint64_t seed = 11;

    *lf = (struct sst_lightfield){ .rows = 3, .cols = 3, .width = FIELD_WIDTH, .height = FIELD_HEIGHT, .ref_view = 4 };
    lf->disp_min_px = -3;
    lf->views = calloc(FIELD_VIEWS, sizeof(*lf->views));
    assert_non_null(lf->views);
    for (int i = 0; i < FIELD_VIEWS; i++) {
        struct sst_view *v = &lf->views[i];

        v->bx = i % 3 - 1 + (i % 4 - 2) * 0.013;
        v->by = i / 3 - 1 - (i % 5 - 2) * 0.017;
        if (i == 5)
            continue;
        v->present = true;
        assert_int_equal(sst_image_init(&v->image, FIELD_WIDTH, FIELD_HEIGHT), 0);
        assert_int_equal(sst_map_u16_init(&v->disp, FIELD_WIDTH, FIELD_HEIGHT), 0);
        if (i != 8) {
            assert_int_equal(sst_map_u8_init(&field_masks[i], FIELD_WIDTH, FIELD_HEIGHT), 0);
            for (int y = 10; y < 30; y++)
                memset(sst_map_u8_row(&field_masks[i], y) + 70, 255, 40);
        }
        if (i != 3)
            assert_int_equal(sst_map_u8_init(&v->label, FIELD_WIDTH, FIELD_HEIGHT), 0);
        if (i == 1)
            assert_int_equal(sst_map_u8_init(&v->valid, FIELD_WIDTH, FIELD_HEIGHT), 0);
        if (i != 6)
            assert_int_equal(sst_map_u8_init(&v->confidence, FIELD_WIDTH, FIELD_HEIGHT), 0);
        for (int y = 0; y < FIELD_HEIGHT; y++) {
            for (int x = 0; x < FIELD_WIDTH; x++) {
                const int label = (x / 13 + y / 11 * 3 + i) % 5;
                const double d = label * 2 - 2 + (double)(sst_random_u64(&seed) % 64) / 64;
                const bool known = sst_random_u64(&seed) % 9;

                for (int c = 0; c < 3; c++)
                    sst_image_row(&v->image, c, y)[x] = (uint8_t)(label * 40 + (int)(sst_random_u64(&seed) % 90));
                sst_map_u16_row(&v->disp, y)[x] = (uint16_t)(known ? sst_disp_q6(lf, d) : SST_DISP_NONE);
                if (v->label.data)
                    sst_map_u8_row(&v->label, y)[x] = (uint8_t)label;
                if (v->confidence.data)
                    sst_map_u8_row(&v->confidence, y)[x] = (uint8_t)(x * 7 + y * 13 + i * 5);
                if (v->valid.data)
                    sst_map_u8_row(&v->valid, y)[x] = (x * y) % 17 > 3 ? 255 : 0;
            }
        }
    }
}

static inline void field_fini(struct sst_lightfield *lf)
{
    for (int i = 0; i < FIELD_VIEWS; i++) {
        sst_image_fini(&lf->views[i].image);
        sst_map_u16_fini(&lf->views[i].disp);
        sst_map_u8_fini(&lf->views[i].label);
        sst_map_u8_fini(&lf->views[i].valid);
        sst_map_u8_fini(&lf->views[i].confidence);
        sst_map_u8_fini(&field_masks[i]);
    }
    free(lf->views);
}

#define FIELD_PICTURES 13
#define FIELD_CLEAR    2 /* of them are clear pictures, the last ones */

/* Ways to render that use different parts of the shader, and of the CPU after it. */
static inline struct sst_render_config field_config(int i)
{
    struct sst_render_config cfg = sample_config(i == 10 ? 6 : i == 8 ? 7 : i > 6 ? 4 : i);

    cfg.threads = 2;
    switch (i) {
    case 5:
        cfg.focus_label = 2;
        break;
    case 7: /* verified rays */
    case 10: /* the same, where weights underflow */
        cfg.verify = SST_VERIFY_ON;
        cfg.focus_px = -1.5;
        break;
    case 8:
        cfg.focus_px = 6.5;
        break;
    case 9: /* rays verified where the maps do not explain them */
        cfg.verify = SST_VERIFY_AUTO;
        cfg.focus_px = -1.5;
        break;
    case 11: /* by depth, at the place of a camera */
        cfg.focus_px = 1.37;
        cfg.method = SST_RENDER_CLEAR;
        cfg.cut_px = 5;
        break;
    case 12: /* by label and mask, between the cameras, of few rays */
        cfg.method = SST_RENDER_CLEAR;
        cfg.remove_label = 4;
        cfg.remove = field_masks;
        cfg.view_bx = 0.3;
        cfg.view_by = -0.2;
        cfg.rays = 3;
        break;
    default:
        break;
    }
    return cfg;
}

struct field_picture {
    struct sst_image image;
    struct sst_map_u8 valid;
};

static inline void field_render(struct field_picture *to, struct sst_renderer *r, int picture)
{
    const struct sst_render_config cfg = field_config(picture);

    assert_int_equal(sst_image_init(&to->image, FIELD_WIDTH, FIELD_HEIGHT), 0);
    assert_int_equal(sst_map_u8_init(&to->valid, FIELD_WIDTH, FIELD_HEIGHT), 0);
    assert_int_equal(sst_render(r, &cfg, &to->image, &to->valid), 0);
}

static inline void field_free(struct field_picture *p)
{
    sst_image_fini(&p->image);
    sst_map_u8_fini(&p->valid);
}

/* Largest difference in levels; that of the valid planes counts as 256. */
static inline int field_difference(const struct field_picture *a, const struct field_picture *b)
{
    int most = 0;

    for (int y = 0; y < FIELD_HEIGHT; y++) {
        for (int c = 0; c < 3; c++) {
            for (int x = 0; x < FIELD_WIDTH; x++) {
                const int d = abs(sst_image_row(&a->image, c, y)[x] - sst_image_row(&b->image, c, y)[x]);

                most = sst_max_int(most, d);
            }
        }
        if (memcmp(sst_map_u8_row(&a->valid, y), sst_map_u8_row(&b->valid, y), FIELD_WIDTH))
            most = 256;
    }
    return most;
}

/* Render all pictures on a device and on the CPU. @return the largest difference */
static inline int field_compare(const struct sst_lightfield *lf, const char *device, uint64_t memory_bytes,
                                struct sst_render_device_report *report)
{
    struct sst_renderer *cpu, *gpu;
    int most = 0;

    assert_int_equal(sst_renderer_create(&cpu, lf, 2), 0);
    assert_int_equal(sst_renderer_create(&gpu, lf, 2), 0);
    assert_int_equal(sst_renderer_use_device(gpu, device, memory_bytes), 0);
    for (int i = 0; i < FIELD_PICTURES; i++) {
        struct field_picture a, b;

        field_render(&a, cpu, i);
        field_render(&b, gpu, i);
        most = sst_max_int(most, field_difference(&a, &b));
        field_free(&a);
        field_free(&b);
    }
    assert_true(sst_renderer_device(gpu, report));
    sst_renderer_destroy(cpu);
    sst_renderer_destroy(gpu);
    return most;
}

#endif
