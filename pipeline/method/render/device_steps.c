/* Steps of pictures that are rendered on a device: definitions on the CPU, work on the device, and samples. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/method/render/clear_internal.h"
#include "pipeline/method/render/device_internal.h"

/* --- pictures of rays --------------------------------------------------------------------------------------------- */

/* Samples have fewer pictures than items. */
static bool is_there(const void *job, int item)
{
    return ((const struct render_picture *)job + item)->plan;
}

/* Pixels of a row. Without a verifier, weights matter only where they are too small. */
static void unpack_run(const struct render_picture *pic, float *weight, uint8_t *support, int x, int n, int y)
{
    const size_t at = (size_t)y * (size_t)pic->out->width + (size_t)x;
    const uint32_t *word = pic->words + at;
    uint8_t *const to[3] = { sst_image_row(pic->out, 0, y) + x, sst_image_row(pic->out, 1, y) + x,
                             sst_image_row(pic->out, 2, y) + x };

    for (int i = 0; i < n; i++) {
        for (int c = 0; c < 3; c++)
            to[c][i] = (uint8_t)(word[i] >> (8 * c));
        weight[i] = word[i] >> 24 & SST_GPU_PIXEL_BELOW ? 0 : pic->weights ? pic->weights[at + (size_t)i] : 1;
    }
    for (int i = 0; support && i < n; i++)
        support[i] = word[i] >> 24 & SST_GPU_PIXEL_SUPPORTED ? 255 : 0;
    render_mend_row(pic->plan, pic->out, weight, x, n, y);
}

static void unpack_rows(const struct render_picture *pic, float (*weight)[SST_BLEND_MAX],
                        uint8_t (*support)[SST_BLEND_MAX], int x, int n, int y, int rows)
{
    for (int i = 0; i < rows; i++)
        unpack_run(pic, weight[i], support ? support[i] : NULL, x, n, y + i);
}

/* True if the CPU has to recompute pixels that a device has blended. */
static bool has_weak_pixels(const struct render_picture *pic)
{
    const size_t n = (size_t)pic->out->width * (size_t)pic->out->height;
    bool weak = false;

    for (size_t i = 0; i < n && !weak; i++)
        weak = pic->words[i] >> 24 & SST_GPU_PIXEL_BELOW;
    return weak;
}

/* Make the picture of its words: weak pixels, and rays to be verified, are the CPU's. */
static int finish(struct render_picture *pic)
{
    int err = 0;

    pic->pixels = unpack_rows;
    pic->voted = !pic->weights;
    if (pic->own && pic->own->pending && (pic->weights || has_weak_pixels(pic)))
        err = render_need_frames(pic->own, pic->renderer);
    return err ? err : render_picture_bands(pic);
}

static void picture_dispatch(struct sst_run *r, void *job, int item)
{
    struct render_picture *p = (struct render_picture *)job + item;

    device_picture(r, p);
    if (!sst_run_failed(r))
        p->err = finish(p);
}

static void picture_maps(void *job, int item, struct sst_share_maps *out)
{
    struct render_picture *p = (struct render_picture *)job + item;

    sst_share_add_image(out, p->out);
    if (p->valid)
        sst_share_add_u8(out, p->valid);
}

#define PICTURES(title, ...)                                                                                           \
    {                                                                                                                  \
        &(const struct sst_step){ .name = title,                                                                       \
                                  .wants = is_there,                                                                   \
                                  .cpu = render_picture_on_cpu,                                                        \
                                  .writes = picture_maps,                                                              \
                                  .sample_free = render_sample_free,                                                   \
                                  __VA_ARGS__ },                                                                       \
            picture_dispatch, NULL, NULL                                                                               \
    }

/* --- clear pictures ----------------------------------------------------------------------------------------------- */

static bool is_picture(const void *job, int item)
{
    return ((const struct clear *)job)[item].lf;
}

static void clear_maps(void *job, int item, struct sst_share_maps *out)
{
    const struct clear_target *to = &((struct clear *)job)[item].to;

    sst_share_add_image(out, to->image);
    sst_share_add_u8(out, to->weight);
    if (to->surface) {
        sst_share_add_u16(out, to->surface);
        sst_share_add_u8(out, to->support);
    }
}

#define CLEAR(title, on_cpu, shaders, ...)                                                                             \
    {                                                                                                                  \
        &(const struct sst_step){ .name = title,                                                                       \
                                  .wants = is_picture,                                                                 \
                                  .cpu = on_cpu,                                                                       \
                                  .writes = clear_maps,                                                                \
                                  .sample_free = clear_sample_free,                                                    \
                                  __VA_ARGS__ },                                                                       \
            shaders, NULL, NULL                                                                                        \
    }

/* --- table -------------------------------------------------------------------------------------------------------- */

#define BLENDED  .levels = SST_GPU_BLEND_LEVELS
#define COLOURED .levels = SST_GPU_CLEAR_LEVELS

const struct sst_step_shaders sst_render_steps[SST_RENDER_STEPS + 1] = {
    [RENDER_STEP_PICTURE] = PICTURES("blending", BLENDED, .sample = render_picture_sample),
    [RENDER_STEP_VERIFY] = PICTURES("verification", BLENDED, .sample = render_verify_sample),
    [RENDER_STEP_CLEAR] = CLEAR("clear picture", clear_colour, clear_on_device, COLOURED, .sample = clear_sample),
    [RENDER_STEP_HOLES] = CLEAR("holes", clear_fill_picture, clear_holes_on_device, .sample = clear_sample_holes),
    [RENDER_STEP_CLEAR_SAMPLED] =
        CLEAR("clear picture of frames", clear_colour, clear_on_device, COLOURED, .sample = clear_sample_frames),
    [RENDER_STEP_FRAMES] = PICTURES("rectification", .sample = render_frames_sample, .seeds = 3),
    [RENDER_STEP_SAMPLED] = PICTURES("sampling of frames", BLENDED, .sample = render_sampled_sample, .seeds = 3),
    [RENDER_STEP_JPEG] = PICTURES("colours of JPEG frames", .sample = render_jpeg_sample),
};

/* --- opening ------------------------------------------------------------------------------------------------------ */

/* @param runner  NULL: none @param owned  it is closed with the renderer, and after a failure */
static int use(struct sst_renderer *r, struct sst_runner *runner, bool owned, const struct sst_render_live *live)
{
    const int err = runner ? device_create(&r->runner, r->lf, runner, sst_render_steps, live) : 0;

    if (runner && !err)
        r->runner->user.owns_runner = owned;
    if (err && owned)
        sst_runner_destroy(runner);
    return err;
}

static void leave(struct sst_renderer *r)
{
    render_runner_destroy(r->runner);
    r->runner = NULL;
}

int sst_renderer_share_device(struct sst_renderer *r, struct sst_runner *runner)
{
    leave(r);
    return use(r, runner, false, NULL);
}

int sst_renderer_use_device(struct sst_renderer *r, const char *name, uint64_t memory_bytes)
{
    struct sst_runner *runner;
    int err;

    leave(r);
    err = sst_runner_create(&runner, name, memory_bytes);
    return err ? err : use(r, runner, true, NULL);
}

int sst_renderer_use_live_device(struct sst_renderer *r, const char *name, uint64_t memory_bytes,
                                 const struct sst_render_live *live)
{
    struct sst_runner *runner;
    int err;

    leave(r);
    err = sst_runner_create_live(&runner, name, memory_bytes, SST_GPU_PICTURES_PERCENT);
    return err ? err : use(r, runner, true, live);
}
