/* Random clear pictures of a small light field, on which steps are compared with the CPU: two surfaces and noise, seen
 * from around a viewpoint that has a camera, or from between cameras; every way to remove a pixel; as a whole and in
 * bands; rays from originals of corrected views. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <math.h>
#include <stdlib.h>

#include "pipeline/lightfield/correction.h"
#include "pipeline/method/render/device_internal.h"

#define GRID     3
#define VIEWS    (GRID * GRID)
#define WIDTH    SST_STEP_SAMPLE_WIDTH
#define HEIGHT   SST_STEP_SAMPLE_HEIGHT
#define PICTURES 4

struct sample {
    struct clear clear[SST_STEP_SAMPLES]; /* first: the job */
    struct sst_render_config cfg[PICTURES];
    struct sst_render_merge merge;
    struct sst_image image[PICTURES];
    struct sst_map_u8 weight[PICTURES], support[PICTURES], masks[VIEWS];
    struct sst_map_u16 surface[PICTURES];
    struct sample_field field;
};

/* Slopes with noise, for places in frames may differ by 1/256 px from places of the CPU; below them rays that agree. */
static void fill_image(struct sst_image *image, uint32_t *state)
{
    for (int i = 0; i < 3 * HEIGHT; i++) {
        for (int x = 0; x < WIDTH; x++) {
            const int wave = (x + i / 3) % 16, slope = (wave < 8 ? wave : 16 - wave) * 24;

            sst_image_row(image, i % 3, i / 3)[x] =
                (uint8_t)(i < 2 * HEIGHT ? slope + (int)(sst_step_random(state) % 32)
                                         : 90 + (int)(sst_step_random(state) % 6));
        }
    }
}

/* Stored disparity of -3 1/8 px. */
static int first_q6(const struct sst_lightfield *lf)
{
    return (int)lrint((-3.125 - lf->disp_min_px) * SST_DISP_SCALE);
}

/* @param first  first_q6() */
static void fill_maps(struct sst_view *v, struct sst_map_u8 *mask, uint32_t first, uint32_t *state)
{
    for (int y = 0; y < HEIGHT; y++) {
        for (int x = 0; x < WIDTH; x++) {
            const uint32_t r = sst_step_random(state), surface = first + (x / 16 % 2 ? 700 : 300);

            sst_map_u16_row(&v->disp, y)[x] = (uint16_t)(r % 29 == 0   ? SST_DISP_NONE
                                                         : r % 31 == 0 ? first + r % 1600
                                                                       : surface + r % 30);
            if (v->label.data)
                sst_map_u8_row(&v->label, y)[x] = sst_step_random(state) % 40 ? 1 : 3;
            if (v->valid.data)
                sst_map_u8_row(&v->valid, y)[x] = sst_step_random(state) % 8 ? 255 : 0;
            if (mask->data)
                sst_map_u8_row(mask, y)[x] = sst_step_random(state) % 12 ? 0 : 255;
        }
    }
}

static int fill_view(struct sample *s, int k, bool framed, uint32_t *state)
{
    struct sst_view *v = &s->field.lf.views[k];
    int err = sample_view_init(v, &s->field.lf, k);

    v->bx = k == 4 ? 0 : (k % GRID - 1) * 0.31 + 0.05;
    v->by = k == 4 ? 0 : (k / GRID - 1) * 0.37;
    err = err || k == 6 ? err : sst_map_u8_init(&s->masks[k], WIDTH, HEIGHT);
    err = err || !framed || k % 3 == 2 ? err : sst_image_init(&v->original, WIDTH, HEIGHT);
    if (err)
        return err;
    fill_image(&v->image, state);
    fill_maps(v, &s->masks[k], (uint32_t)first_q6(&s->field.lf), state);
    if (v->original.plane[0])
        fill_image(&v->original, state);
    return 0;
}

/* Turned and shifted originals of uneven light. */
static int correct(struct sample *s)
{
    s->field.lf.correction = calloc(VIEWS, sizeof(*s->field.lf.correction));
    if (!s->field.lf.correction)
        return -1;
    for (int k = 0; k < VIEWS; k++) {
        s->field.lf.correction[k] = sst_correction_none();
        s->field.lf.correction[k].shift_x_px = 0.7 * k - 2.3;
        s->field.lf.correction[k].shift_y_px = 1.4 - 0.3 * k;
        s->field.lf.correction[k].roll_deg = 0.4 * k;
        s->field.lf.correction[k].gain[0] = k % 2 ? 1.25 : 1;
        s->field.lf.correction[k].falloff = k % 2 ? -0.3 : 0;
    }
    return 0;
}

/* @param seed  odd: stored disparities of 15 bits; even: coarse levels */
static int make_field(struct sample *s, uint32_t seed, bool framed)
{
    uint32_t state = seed * 7919;
    int err = sample_field_init(&s->field, WIDTH, HEIGHT);

    s->field.lf.disp_min_px = (seed % 2 ? -3.125 : -300.125) + 1e-8;
    s->field.lf.range_min_px = seed % 2 ? 0 : s->field.lf.disp_min_px;
    s->field.lf.range_max_px = seed % 2 ? 0 : s->field.lf.disp_min_px + 600;
    for (int k = 0; k < VIEWS && !err; k++)
        err = fill_view(s, k, framed, &state);
    err = err || !framed ? err : correct(s);
    return err ? err : sst_renderer_create(&s->field.renderer, &s->field.lf, 1);
}

/* At the camera; between cameras, of few rays, in bands; without a label; without masks, in many bands. */
static int make_picture(struct sample *s, int i)
{
    struct sst_render_config *cfg = &s->cfg[i];
    struct clear *c = &s->clear[i];
    int err = sst_image_init(&s->image[i], WIDTH, HEIGHT);

    sst_render_config_defaults(cfg);
    cfg->method = SST_RENDER_CLEAR;
    cfg->threads = 1;
    cfg->cut_px = 20;
    cfg->view_bx = i % 2 ? 0.11 : 0;
    cfg->view_by = i % 2 ? -0.07 : 0;
    cfg->rays = i % 2 ? 5 : 0;
    cfg->remove_label = i == 2 ? 3 : 0;
    cfg->remove = i == 3 ? s->masks : NULL;
    cfg->merge = i > 1 ? &s->merge : NULL;
    err = err ? err : sst_map_u8_init(&s->weight[i], WIDTH, HEIGHT);
    err = err ? err : sst_map_u8_init(&s->support[i], WIDTH, HEIGHT);
    err = err ? err : sst_map_u16_init(&s->surface[i], WIDTH, HEIGHT);
    err = err ? err : clear_init(c, s->field.renderer, cfg);
    c->as_others = i == 0;
    c->bins = i == 3 ? first_q6(&s->field.lf) + 720 : c->bins;
    c->runner = &s->field.device;
    c->bands.rows = i == 1 ? 17 : i == 3 ? 6 : HEIGHT;
    c->to = (struct clear_target){ &s->image[i], &s->weight[i], i > 1 ? &s->surface[i] : NULL, &s->support[i] };
    return err;
}

static void *make_sample(uint32_t seed, bool framed)
{
    struct sample *s = calloc(1, sizeof(*s));
    int err = s ? make_field(s, seed, framed) : -1;

    for (int i = 0; i < PICTURES && !err; i++)
        err = make_picture(s, i);
    if (!err)
        return s;
    clear_sample_free(s);
    return NULL;
}

void *clear_sample(uint32_t seed)
{
    return make_sample(seed, false);
}

void *clear_sample_frames(uint32_t seed)
{
    return make_sample(seed, true);
}

/* All weights, and a hole that coarse levels fill; few weights, so that the coarsest one lacks some. */
void *clear_sample_holes(uint32_t seed)
{
    struct sample *s = make_sample(seed, false);
    uint32_t state = seed * 104729;

    for (int i = 0; s && i < PICTURES; i++) {
        fill_image(&s->image[i], &state);
        for (int k = 0; k < WIDTH * HEIGHT; k++)
            sst_map_u8_row(&s->weight[i], k / WIDTH)[k % WIDTH] =
                (uint8_t)(k % WIDTH < 24 + 9 * i || (i == 3 && k % 97) ? 0
                          : k % 3                                      ? sst_step_random(&state) & 0xFF
                                                                       : 255);
    }
    return s;
}

void clear_sample_free(void *job)
{
    struct sample *s = job;

    if (!s)
        return;
    for (int i = 0; i < PICTURES; i++) {
        clear_fini(&s->clear[i]);
        sst_image_fini(&s->image[i]);
        sst_map_u8_fini(&s->weight[i]);
        sst_map_u8_fini(&s->support[i]);
        sst_map_u16_fini(&s->surface[i]);
    }
    for (int k = 0; k < VIEWS; k++)
        sst_map_u8_fini(&s->masks[k]);
    sample_field_fini(&s->field);
    free(s);
}
