/* tests/match_field.h - small light fields that a device must match as the CPU does. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_TESTS_MATCH_FIELD_H
#define SST_TESTS_MATCH_FIELD_H

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "base/log.h"
#include "pipeline/method/disparity/device.h"
#include "pipeline/method/disparity/disparity_internal.h"
#include "simulators/scene/noise.h"
#include "tests/self_tests.h"
#include "tests/test.h"

/* Brightness of a surface at a place: patches, whose edges the support regions keep to, with a fine pattern. */
static inline double match_texture(double x, double y, int c)
{
    const int patch = (int)floor(x / 17) * 7 + (int)floor(y / 11) * 5;

    return 128 + 30 * sin(x * 0.9 + c) + 30 * sin(y * 1.3 + x * 0.21 + 2 * c) + 12 * (patch % 5 - 2);
}

/* Views of a plane and a nearer square in front of it, with measured offsets and noise; the last view is absent, the
 * one before it partly invalid. `near`: disparity of the square, that of the plane is a third of it. */
static inline void match_init(struct sst_lightfield *lf, int rows, int cols, int width, int height, double near)
{
    uint64_t seed = 5;

    assert_int_equal(sst_lightfield_init(lf, rows, cols), 0);
    lf->width = width;
    lf->height = height;
    for (int i = 0; i < rows * cols; i++) {
        struct sst_view *v = &lf->views[i];
        const int row = i / cols, col = i % cols;

        v->bx = col - lf->ref_view % cols + (i % 4 - 2) * 0.013;
        v->by = row - lf->ref_view / cols - (i % 5 - 2) * 0.017;
        v->present = rows * cols < 4 || i + 1 < rows * cols;
        if (!v->present)
            continue;
        assert_int_equal(sst_image_init(&v->image, width, height), 0);
        if (rows * cols >= 4 && i + 2 == rows * cols) {
            assert_int_equal(sst_map_u8_init(&v->valid, width, height), 0);
            for (int y = 0; y < height; y++)
                memset(sst_map_u8_row(&v->valid, y) + y % 7, 255, (size_t)(width - 9 - y % 7));
        }
        for (int y = 0; y < height; y++) {
            for (int x = 0; x < width; x++) {
                const double xs = x + near * v->bx, ys = y + near * v->by;
                const bool front = fabs(xs - width / 2.0) < width / 5.0 && fabs(ys - height / 2.0) < height / 4.0;
                const double d = front ? near : near / 3;

                for (int c = 0; c < 3; c++)
                    sst_image_row(&v->image, c, y)[x] =
                        (uint8_t)(match_texture(x + d * v->bx + 50 * front, y + d * v->by, c) +
                                  (double)(sst_random_u64(&seed) % 7));
            }
        }
    }
}

/* Ways to match that use different parts of the device. @return false: there is none of this number */
static inline bool match_config(struct sst_disparity_config *cfg, int i)
{
    static const char *const presets[] = { "preview", "balanced", "accurate" };

    assert_int_equal(sst_disparity_preset(cfg, i < 3 ? presets[i] : "balanced"), 0);
    cfg->disp_min_px = -1;
    cfg->disp_max_px = 9;
    cfg->cost = SST_COST_CENSUS; /* accurate without enough views needs a network */
    cfg->threads = 2;
    switch (i) {
    case 0: /* the presets */
    case 1:
        break;
    case 2: /* of accurate as of scenes with flat surfaces */
        cfg->key_spacing = 1;
        break;
    case 3: /* costs alone */
        cfg->raw = true;
        break;
    case 4: /* paths of 8 directions, without support, whole pixels, few neighbours */
        cfg->paths = 8;
        cfg->support_arm = 0;
        cfg->whole_steps = true;
        cfg->neighbours = 4;
        break;
    case 5: /* two rounds of aggregation, in half pixels; descriptors one by one */
        cfg->support_before = 2;
        cfg->phase_step = 2;
        cfg->frugal = true;
        break;
    default:
        return false;
    }
    return true;
}

/* Are the maps of two light fields equal? */
static inline void match_assert_equal(const struct sst_lightfield *a, const struct sst_lightfield *b)
{
    for (int k = 0; k < a->rows * a->cols; k++) {
        for (int y = 0; a->views[k].present && y < a->height; y++) {
            assert_memory_equal(sst_map_u16_row(&a->views[k].disp, y), sst_map_u16_row(&b->views[k].disp, y),
                                2 * (size_t)a->width);
            assert_memory_equal(sst_map_u8_row(&a->views[k].confidence, y), sst_map_u8_row(&b->views[k].confidence, y),
                                (size_t)a->width);
        }
    }
}

/* Maps that the CPU finds. */
struct match_reference {
    struct sst_lightfield lf; /* whose images are borrowed */
    struct sst_disparity_report skipped;
};

static inline void match_on_cpu(struct match_reference *ref, const struct sst_lightfield *lf,
                                const struct sst_disparity_config *cfg)
{
    const size_t views = (size_t)(lf->rows * lf->cols);
    struct sst_disparity_config cpu = *cfg;

    *ref = (struct match_reference){ .lf = *lf };
    ref->lf.views = calloc(views, sizeof(*ref->lf.views));
    assert_non_null(ref->lf.views);
    for (size_t i = 0; i < views; i++) {
        ref->lf.views[i] = lf->views[i];
        ref->lf.views[i].disp = (struct sst_map_u16){ 0 };
        ref->lf.views[i].confidence = (struct sst_map_u8){ 0 };
    }
    cpu.runner = NULL;
    cpu.report = &ref->skipped;
    assert_int_equal(sst_disparity_lightfield(&ref->lf, &cpu, NULL, NULL), 0);
}

static inline void match_reference_fini(struct match_reference *ref)
{
    for (int i = 0; i < ref->lf.rows * ref->lf.cols; i++) {
        sst_map_u16_fini(&ref->lf.views[i].disp);
        sst_map_u8_fini(&ref->lf.views[i].confidence);
    }
    free(ref->lf.views);
}

/* Match on a device, which must give the bytes of the CPU in the same way of matching. @param device  cfg->runner */
static inline void match_compare_to(const struct match_reference *ref, struct sst_lightfield *lf,
                                    const struct sst_disparity_config *cfg, struct sst_step_report *report)
{
    struct sst_disparity_report skipped;
    struct sst_disparity_config gpu = *cfg;

    gpu.report = &skipped;
    assert_int_equal(sst_disparity_lightfield(lf, &gpu, NULL, NULL), 0);
    assert_memory_equal(&ref->skipped, &skipped, sizeof(skipped));
    if (cfg->report)
        *cfg->report = skipped;
    sst_disparity_device_report(cfg->runner, report);
    match_assert_equal(lf, &ref->lf);
}

/* Match on a device and on the CPU. */
static inline void match_compare(struct sst_lightfield *lf, const struct sst_disparity_config *cfg,
                                 struct sst_step_report *report)
{
    struct match_reference ref;

    match_on_cpu(&ref, lf, cfg);
    match_compare_to(&ref, lf, cfg, report);
    match_reference_fini(&ref);
}

/* Windows of disparities, tile by tile. */
static inline void match_config_tiles(struct sst_disparity_config *cfg)
{
    assert_int_equal(sst_disparity_preset(cfg, "balanced"), 0);
    cfg->disp_min_px = -4;
    cfg->disp_max_px = 36;
    cfg->cost = SST_COST_CENSUS;
    cfg->threads = 2;
    cfg->whole_steps = true;
    cfg->range_bytes = 0;
    cfg->range_error = 100;
}

/* A device for matching alone; match_device_destroy() follows. @param memory_bytes  0: three quarters of what it has */
static inline int match_device_create(struct sst_runner_user **out, const char *name, uint64_t memory_bytes)
{
    struct sst_runner *shared;
    int err = sst_runner_create(&shared, name, memory_bytes);

    *out = NULL;
    if (err)
        return err;
    err = sst_disparity_device_create(out, shared);
    if (err)
        sst_runner_destroy(shared);
    return err;
}

static inline void match_device_destroy(struct sst_runner_user *d)
{
    struct sst_runner *shared = d ? d->runner : NULL;

    sst_disparity_device_destroy(d);
    sst_runner_destroy(shared);
}

static inline bool match_opens(const char *name)
{
    struct sst_runner_user *d;
    const bool opened = !match_device_create(&d, name, 0);

    match_device_destroy(d);
    return opened;
}

static inline int match_self_tests(void)
{
    static int dispatches;

    if (!dispatches)
        dispatches = self_tests(match_opens);
    return dispatches;
}

#endif
