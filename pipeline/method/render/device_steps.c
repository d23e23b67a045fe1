/* Steps of pictures that are rendered on a device: definitions on the CPU, work on the device, and samples. */
#include "pipeline/method/render/clear_internal.h"
#include "pipeline/method/render/device_internal.h"

/* --- pictures of rays --------------------------------------------------------------------------------------------- */

/* Samples have fewer pictures than items. */
static bool is_there(const void *job, int item)
{
    return ((const struct render_picture *)job + item)->plan;
}

static void picture_dispatch(struct sst_run *r, void *job, int item)
{
    struct render_picture *p = (struct render_picture *)job + item;

    device_picture(r, p);
    if (!sst_run_failed(r))
        p->err = device_picture_finish(p);
}

static void picture_maps(void *job, int item, struct sst_share_maps *out)
{
    struct render_picture *p = (struct render_picture *)job + item;

    sst_share_add_image(out, p->out);
    if (p->valid)
        sst_share_add_u8(out, p->valid);
}

#define PICTURES                                                                                                       \
    .wants = is_there, .cpu = render_picture_on_cpu, .dispatch = picture_dispatch, .writes = picture_maps,              \
    .sample_free = render_sample_free

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

#define CLEAR .wants = is_picture, .writes = clear_maps, .sample_free = clear_sample_free

/* --- table -------------------------------------------------------------------------------------------------------- */

static const struct sst_step steps[SST_RENDER_STEPS] = {
    [RENDER_STEP_PICTURE] = { .name = "blending",
                              PICTURES,
                              .sample = render_picture_sample,
                              .levels = SST_GPU_BLEND_LEVELS },
    [RENDER_STEP_VERIFY] = { .name = "verification",
                             PICTURES,
                             .sample = render_verify_sample,
                             .levels = SST_GPU_BLEND_LEVELS },
    [RENDER_STEP_CLEAR] = { .name = "clear picture",
                            CLEAR,
                            .cpu = clear_colour,
                            .dispatch = clear_on_device,
                            .levels = SST_GPU_CLEAR_LEVELS,
                            .sample = clear_sample },
    [RENDER_STEP_HOLES] = { .name = "holes",
                            CLEAR,
                            .cpu = clear_fill_picture,
                            .dispatch = clear_holes_on_device,
                            .sample = clear_sample_holes },
    [RENDER_STEP_CLEAR_SAMPLED] = { .name = "clear picture of frames",
                                    CLEAR,
                                    .cpu = clear_colour,
                                    .dispatch = clear_on_device,
                                    .levels = SST_GPU_CLEAR_LEVELS,
                                    .sample = clear_sample_frames },
    [RENDER_STEP_FRAMES] = { .name = "rectification", PICTURES, .sample = render_frames_sample, .seeds = 3 },
    [RENDER_STEP_SAMPLED] = { .name = "sampling of frames",
                              PICTURES,
                              .sample = render_sampled_sample,
                              .seeds = 3,
                              .levels = SST_GPU_BLEND_LEVELS },
    [RENDER_STEP_JPEG] = { .name = "colours of JPEG frames", PICTURES, .sample = render_jpeg_sample },
};

const struct sst_step *const sst_render_steps[SST_RENDER_STEPS] = { &steps[0], &steps[1], &steps[2], &steps[3],
                                                                    &steps[4], &steps[5], &steps[6], &steps[7] };
