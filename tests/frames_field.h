/* tests/frames_field.h - pictures of raw frames that a device rectifies, or samples, against those of the CPU. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_TESTS_FRAMES_FIELD_H
#define SST_TESTS_FRAMES_FIELD_H

#include "pipeline/method/render/device.h"
#include "tests/raw_field.h"
#include "tests/test.h"

#define FRAMES_WIDTH    134 /* no multiple of 4 */
#define FRAMES_HEIGHT   97
#define FRAMES_PICTURES 6
#define FRAMES_CLEAR    5 /* the last one */

/* A slanted plane of disparities and two labels; one view has no labels. */
static inline int frames_add_maps(struct sst_lightfield *lf)
{
    int err = 0;

    for (int k = 0; k < lf->rows * lf->cols && !err; k++) {
        struct sst_view *v = &lf->views[k];

        err = sst_map_u16_init(&v->disp, lf->width, lf->height);
        if (k != 1)
            err = err ? err : sst_map_u8_init(&v->label, lf->width, lf->height);
        for (int y = 0; y < lf->height && !err; y++) {
            for (int x = 0; x < lf->width; x++) {
                sst_map_u16_row(&v->disp, y)[x] = (uint16_t)(64 * 3 + 2 * x);
                if (k != 1)
                    sst_map_u8_row(&v->label, y)[x] = (uint8_t)(1 + (y > lf->height / 2));
            }
        }
    }
    return err;
}

/* 2x3 turned cameras with lenses and uneven light. @return 0 or a negative errno */
static inline int frames_make(struct raw_field *f)
{
    struct sst_sim_settings s;
    int err;

    raw_field_settings(&s, "cd-cases", 2, 3, FRAMES_WIDTH, FRAMES_HEIGHT, 4);
    err = raw_field_make(f, &s);
    err = err ? err : frames_add_maps(&f->raw);
    return err ? err : frames_add_maps(&f->rectified);
}

/* Between pixels, with weights, weights that underflow, verified rays, clear. */
static inline struct sst_render_config frames_config(int i)
{
    struct sst_render_config cfg;

    sst_render_config_defaults(&cfg);
    cfg.threads = 2;
    cfg.verify = SST_VERIFY_OFF;
    cfg.focus_px = 4.37 + 0.21 * i;
    switch (i) {
    case 0:
        cfg.method = SST_RENDER_REFOCUS;
        break;
    case 1:
        cfg.method = SST_RENDER_REFOCUS;
        cfg.aperture_soft = true;
        cfg.aperture = 1.2;
        cfg.view_bx = 0.4;
        break;
    case 3:
        cfg.c1 = cfg.c2 = 0;
        cfg.sigma_px = 0.05;
        break;
    case 4:
        cfg.verify = SST_VERIFY_ON;
        break;
    case FRAMES_CLEAR:
        cfg.method = SST_RENDER_CLEAR;
        cfg.cut_px = 6;
        break;
    default: /* 2: as it comes */
        break;
    }
    return cfg;
}

struct frames_picture {
    struct sst_image image;
    struct sst_map_u8 valid;
};

static inline struct frames_picture frames_render(struct sst_renderer *r, const struct sst_lightfield *lf,
                                                  const struct sst_render_config *cfg)
{
    struct frames_picture p = { 0 };

    assert_int_equal(sst_image_init(&p.image, lf->width, lf->height), 0);
    assert_int_equal(sst_map_u8_init(&p.valid, lf->width, lf->height), 0);
    assert_int_equal(sst_render(r, cfg, &p.image, &p.valid), 0);
    return p;
}

static inline void frames_free(struct frames_picture *p)
{
    sst_image_fini(&p->image);
    sst_map_u8_fini(&p->valid);
}

/* Pixels that differ by more than `levels`, or in their validity. */
static inline int frames_count(const struct frames_picture *a, const struct frames_picture *b, int levels)
{
    int n = 0;

    for (int y = 0; y < a->image.height; y++) {
        for (int x = 0; x < a->image.width; x++) {
            bool differs = sst_map_u8_row(&a->valid, y)[x] != sst_map_u8_row(&b->valid, y)[x];

            for (int c = 0; c < 3; c++)
                differs |= abs(sst_image_row(&a->image, c, y)[x] - sst_image_row(&b->image, c, y)[x]) > levels;
            n += differs;
        }
    }
    return n;
}

/* Render all pictures of raw frames on a device: sampled at the rays, against the CPU's, or rectified, against those of
 * the light field that was rectified before. @return pixels that differ by more than `levels` */
static inline int frames_compare(const struct raw_field *f, bool sampled, const char *device, uint64_t memory_bytes,
                                 int levels, struct sst_render_device_report *report)
{
    const struct sst_lightfield *lf = sampled ? &f->raw : &f->rectified;
    struct sst_renderer *cpu, *gpu;
    int n = 0;

    assert_int_equal(sst_renderer_create(&cpu, lf, 2), 0);
    assert_int_equal(sst_renderer_create(&gpu, &f->raw, 2), 0);
    if (!sampled)
        assert_int_equal(sst_renderer_use_rectified(gpu), 0);
    assert_int_equal(sst_renderer_use_device(gpu, device, memory_bytes), 0);
    for (int i = 0; i < FRAMES_PICTURES; i++) {
        const struct sst_render_config cfg = frames_config(i);
        struct frames_picture a, b;
        int differ;

        if (cfg.verify != SST_VERIFY_OFF && !sampled)
            continue; /* colours are counted in the frames */
        a = frames_render(cpu, lf, &cfg);
        b = frames_render(gpu, &f->raw, &cfg);
        differ = frames_count(&a, &b, levels);
        if (differ)
            print_message("%s, picture %d: %d pixels differ by more than %d\n", device, i, differ, levels);
        n += differ;
        frames_free(&a);
        frames_free(&b);
    }
    assert_true(sst_renderer_device(gpu, report));
    sst_renderer_destroy(cpu);
    sst_renderer_destroy(gpu);
    return n;
}

#endif
