/* Random pictures of a small light field, on which steps are compared with the CPU: blocks of surfaces with labels,
 * with noise, unknown disparities and unlabeled pixels; a view that is partly invalid, views without labels or
 * confidences, and a view that is absent; raw frames of turned cameras with lenses and uneven light. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <limits.h>
#include <math.h>
#include <stdlib.h>

#include "pipeline/image/codec.h"
#include "pipeline/lightfield/calibrated.h"
#include "pipeline/method/render/device_internal.h"

#define GRID  3
#define VIEWS (GRID * GRID)
#define MOST  SST_STEP_SAMPLES

enum frames { FRAMES_NONE, FRAMES_SAMPLED, FRAMES_RECTIFIED, FRAMES_JPEG };

struct kind {
    int width, height, pictures;
    struct sst_render_config (*config)(int);
    enum frames frames;
    int chunk_views; /* that lie in one buffer; 0: all */
};

struct sample {
    struct render_picture picture[MOST]; /* first: the job of the step */
    struct sample_field field;
    bool split; /* pictures are made in bands, of rows of the views */
    int count;  /* of pictures with a plan */
    struct sst_render_plan plan[MOST];
    struct sst_image image[MOST];
    struct sst_map_u8 valid[MOST];
};

/* --- light fields ------------------------------------------------------------------------------------------------- */

int sample_field_init(struct sample_field *f, int width, int height)
{
    int err = sst_lightfield_init(&f->lf, GRID, GRID);

    f->lf.width = width;
    f->lf.height = height;
    f->device.tested = UINT_MAX;
    return err ? err : device_init(&f->device, &f->lf, NULL);
}

void sample_field_fini(struct sample_field *f)
{
    if (f->device.gpu)
        device_drop(&f->device);
    device_fini(&f->device);
    sst_renderer_destroy(f->renderer);
    sst_lightfield_fini(&f->lf);
}

int sample_view_init(struct sst_view *v, const struct sst_lightfield *lf, int k)
{
    int err = sst_image_init(&v->image, lf->width, lf->height);

    v->present = true;
    err = err ? err : sst_map_u16_init(&v->disp, lf->width, lf->height);
    err = err || k == 3 ? err : sst_map_u8_init(&v->label, lf->width, lf->height);
    return err || k != 1 ? err : sst_map_u8_init(&v->valid, lf->width, lf->height);
}

static void set_pixel(struct sst_view *v, const struct sst_lightfield *lf, int x, int y, uint32_t *state)
{
    const int block = (x / 7 + y / 5 * 2) % 3;
    const double disp_px = block * 3 - 2 + (double)(sst_step_random(state) % 64) / 64;

    for (int c = 0; c < 3; c++)
        sst_image_row(&v->image, c, y)[x] = (uint8_t)(block * 80 + (int)(sst_step_random(state) % 90));
    sst_map_u16_row(&v->disp, y)[x] = (uint16_t)(sst_step_random(state) % 9 ? sst_disp_q6(lf, disp_px) : SST_DISP_NONE);
    if (v->label.data)
        sst_map_u8_row(&v->label, y)[x] = block > 0; /* a device has room for few weights by label */
    if (v->valid.data)
        sst_map_u8_row(&v->valid, y)[x] = sst_step_random(state) % 17 > 3 ? 255 : 0;
    if (v->confidence.data)
        sst_map_u8_row(&v->confidence, y)[x] = (uint8_t)sst_step_random(state);
}

static int fill_view(struct sst_lightfield *lf, int k, uint32_t *state)
{
    struct sst_view *v = &lf->views[k];
    int err;

    v->bx = k % GRID - 1 + (k % 4 - 2) * 0.013;
    v->by = k / GRID - 1 - (k % 5 - 2) * 0.017;
    if (k == 5)
        return 0;
    err = sample_view_init(v, lf, k);
    err = err || k == 6 ? err : sst_map_u8_init(&v->confidence, lf->width, lf->height);
    for (int y = 0; y < lf->height && !err; y++) {
        for (int x = 0; x < lf->width; x++)
            set_pixel(v, lf, x, y, state);
    }
    return err;
}

/* --- pictures ----------------------------------------------------------------------------------------------------- */

struct sst_render_config sample_config(int i)
{
    struct sst_render_config cfg;

    sst_render_config_defaults(&cfg);
    cfg.threads = 1;
    cfg.verify = SST_VERIFY_OFF;
    cfg.focus_px = i % 2 ? 1.37 : 4;
    switch (i) {
    case 0: /* whole sums */
        cfg.method = SST_RENDER_REFOCUS;
        break;
    case 1: /* apertures alone; views of a part of the array, from beside it */
        cfg.method = SST_RENDER_REFOCUS;
        cfg.aperture_soft = true;
        cfg.aperture = 1.3;
        cfg.view_bx = 0.4;
        break;
    case 2: /* depth alone */
        cfg.c2 = 1;
        break;
    case 3: /* labels alone */
        cfg.sigma_px = INFINITY;
        break;
    case 5:
        cfg.focus_label = 1;
        cfg.range = SST_RANGE_MINMAX;
        cfg.unsupported = SST_UNSUPPORTED_INVALID;
        break;
    case 6: /* weights that underflow: single pixels are made on the CPU */
        cfg.c1 = cfg.c2 = 0;
        cfg.sigma_px = 0.05;
        break;
    case 7: /* most rays outside their views */
        cfg.focus_px = 5.5;
        cfg.max_views = 5;
        break;
    default: /* see-through by all defaults */
        break;
    }
    return cfg;
}

/* Rays that all vote, or where maps do not explain them. */
static struct sst_render_config verify_config(int i)
{
    struct sst_render_config cfg;

    sst_render_config_defaults(&cfg);
    cfg.threads = 1;
    cfg.verify = i % 2 ? SST_VERIFY_AUTO : SST_VERIFY_ON;
    cfg.focus_px = i < 2 ? -1.5 : -0.6;
    cfg.c2 = i == 2 ? 1 : cfg.c2; /* without labels */
    return cfg;
}

/* Between pixels, with and without weights. */
static struct sst_render_config sampled_config(int i)
{
    struct sst_render_config cfg;

    sst_render_config_defaults(&cfg);
    cfg.threads = 1;
    cfg.verify = SST_VERIFY_OFF;
    cfg.method = i % 2 ? SST_RENDER_SST : SST_RENDER_REFOCUS;
    cfg.focus_px = 1.37 + i;
    return cfg;
}

/* One rectified view each. */
static struct sst_render_config rectified_config(int i)
{
    struct sst_render_config cfg = sampled_config(0);

    cfg.focus_px = 0;
    cfg.max_views = 1;
    cfg.view_bx = i % GRID - 1;
    cfg.view_by = i / GRID - 1;
    return cfg;
}

/* Places between pixels may differ by 1/256 px from those of the CPU: frames have slopes, and little noise. */
static int make_frame(struct sst_view *v, enum frames frames, int k, uint32_t *state)
{
    for (int i = 0; i < 3 * v->image.height; i++) {
        for (int x = 0; x < v->image.width; x++) {
            const int wave = (x + i / 3) % 32;

            sst_image_row(&v->image, i % 3, i / 3)[x] =
                (uint8_t)((wave < 16 ? wave : 32 - wave) * 12 + i % 3 * 20 + (int)(sst_step_random(state) % 20));
        }
    }
    if (frames != FRAMES_JPEG)
        return 0;
    if (sst_image_encode_jpeg_as(&v->image, 95, (enum sst_jpeg_chroma)(k % 4), &v->encoded, &v->encoded_bytes))
        return -1;
    sst_image_fini(&v->image);
    return 0;
}

/* One lens folds inside its picture: no cubics give its places. @param seed  chooses the filter of the frames */
static int calibrate(struct sst_lightfield *lf, uint32_t seed)
{
    struct sst_use_calibration use;
    int err;

    sst_use_calibration_defaults(&use);
    use.filter = (enum sst_filter)(seed % 3);
    err = sst_calib_init(&use.calib, GRID, GRID);
    use.calib.width = lf->width;
    use.calib.height = lf->height;
    for (int k = 0; k < VIEWS && !err; k++) {
        const double turn = 0.01 * (k % 4 - 1.5);
        struct sst_calib_camera cam = { .known = k != 5,
                                        .name = "",
                                        .fx = 90 + k % 3,
                                        .fy = 90 + k % 2,
                                        .cx = lf->width / 2 + k % 4 - 1,
                                        .cy = lf->height / 2 - k % 3,
                                        .lens = 5,
                                        .k = { k == 6 ? -2.7 : -0.15, 0.04 },
                                        .rotation = { cos(turn), -sin(turn), 0, sin(turn), cos(turn), 0, 0, 0, 1 },
                                        .position_mm = { 20.0 * (k % GRID - 1), 20.0 * (k / GRID - 1), 0 },
                                        .gain = { k % 2 ? 1.1 : 1, 1, k % 2 ? 0.95 : 1 },
                                        .falloff = { k % 2 ? -0.2 : 0 } };

        use.calib.camera[k] = cam;
    }
    err = err ? err : sst_lightfield_calibrate(lf, &use);
    lf->images_raw = true;
    sst_use_calibration_fini(&use);
    return err;
}

static int add_picture(struct sample *s, int i, const struct sst_render_config *cfg)
{
    int err = sst_image_init(&s->image[i], s->field.lf.width, s->field.lf.height);

    err = err ? err : sst_map_u8_init(&s->valid[i], s->field.lf.width, s->field.lf.height);
    err = err ? err : sst_render_plan_init(&s->plan[i], s->field.renderer, cfg);
    if (err)
        return err;
    s->count++;
    s->picture[i] = (struct render_picture){ .renderer = s->field.renderer,
                                             .plan = &s->plan[i],
                                             .out = &s->image[i],
                                             .valid = &s->valid[i],
                                             .runner = &s->field.device,
                                             .end = s->field.lf.height,
                                             .verify = cfg->verify != SST_VERIFY_OFF,
                                             .bands = { s->split ? 8 : s->field.lf.height, s->split } };
    return 0;
}

void render_sample_free(void *job)
{
    struct sample *s = job;

    if (!s)
        return;
    for (int i = 0; i < MOST; i++) {
        if (i < s->count)
            sst_render_plan_fini(&s->plan[i]);
        sst_image_fini(&s->image[i]);
        sst_map_u8_fini(&s->valid[i]);
    }
    sample_field_fini(&s->field);
    free(s);
}

static void *make(uint32_t seed, struct kind kind)
{
    struct sample *s = calloc(1, sizeof(*s));
    uint32_t state = seed * 7919;
    int err = s ? sample_field_init(&s->field, kind.width, kind.height) : -1; /* no multiple of a cell or a group */

    if (!s)
        return NULL;
    s->field.lf.ref_view = VIEWS / 2;
    s->field.lf.disp_min_px = -3;
    for (int k = 0; k < VIEWS && !err; k++)
        err = fill_view(&s->field.lf, k, &state);
    err = err || !kind.frames ? err : calibrate(&s->field.lf, seed);
    for (int k = 0; k < VIEWS && kind.frames && !err; k++)
        err = s->field.lf.views[k].present ? make_frame(&s->field.lf.views[k], kind.frames, k, &state) : 0;
    err = err ? err : sst_renderer_create(&s->field.renderer, &s->field.lf, 1);
    if (!err && kind.frames > FRAMES_SAMPLED)
        err = sst_renderer_use_rectified(s->field.renderer);
    s->split = seed % 2 == 0;
    s->field.device.limit_bytes = s->split ? 0 : UINT64_MAX;
    s->field.device.chunk_views = kind.chunk_views;
    for (int i = 0; i < kind.pictures && !err; i++) {
        const struct sst_render_config cfg = kind.config(i);

        err = add_picture(s, i, &cfg);
    }
    if (err) {
        render_sample_free(s);
        return NULL;
    }
    return s;
}

void *render_picture_sample(uint32_t seed)
{
    return make(seed, (struct kind){ 45, 13, 8, sample_config, FRAMES_NONE, 4 });
}

void *render_verify_sample(uint32_t seed)
{
    return make(seed, (struct kind){ 77, 21, 4, verify_config, FRAMES_NONE, 0 });
}

void *render_frames_sample(uint32_t seed)
{
    return make(seed, (struct kind){ 61, 35, VIEWS, rectified_config, FRAMES_RECTIFIED, 0 });
}

void *render_sampled_sample(uint32_t seed)
{
    return make(seed, (struct kind){ 61, 35, 2, sampled_config, FRAMES_SAMPLED, 0 });
}

void *render_jpeg_sample(uint32_t seed)
{
    return make(seed, (struct kind){ 61, 35, VIEWS, rectified_config, FRAMES_JPEG, 0 });
}
