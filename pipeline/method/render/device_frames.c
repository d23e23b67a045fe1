/* Views that a device makes from raw frames: a frame is written to mapped memory, copied, and resampled into the view's
 * place by the shader `rectify`. Of a JPEG file the CPU decodes the samples; the shader `jpeg_rgb` makes colours of
 * them.
 *
 * The CPU decodes several frames at once, one in each span, and computes the places of their pixels: cubics along
 * pieces of rows, in double, as on the CPU. Where rays are sampled from frames, a view's pixels are made for each
 * picture, as far from whole positions as its rays are; the frames then stay on the device as far as they fit. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <assert.h>
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/log.h"
#include "base/thread.h"
#include "pipeline/gpu/rectify.h"
#include "pipeline/kernels/light_code.h"
#include "pipeline/kernels/place_patch.h"
#include "pipeline/method/render/device_internal.h"

static size_t most(size_t a, size_t b)
{
    return a > b ? a : b;
}

/* --- memory ------------------------------------------------------------------------------------------------------- */

void device_drop_kept(struct render_runner *d)
{
    for (int k = 0; k < d->lf->rows * d->lf->cols; k++) {
        sst_gpu_buffer_destroy(d->gpu, d->frames.kept[k]);
        d->frames.kept[k] = NULL;
    }
}

static void drop_spans(struct render_runner *d)
{
    struct device_frames *f = &d->frames;

    while (f->spans)
        sst_gpu_span_destroy(d->gpu, f->ready[--f->spans].span);
}

void device_drop_frames(struct render_runner *d)
{
    device_drop_kept(d);
    drop_spans(d);
}

static size_t places_bytes(const struct sst_rectify_tables *t)
{
    return (size_t)t->cells * (size_t)t->height * sizeof(struct sst_places);
}

/* Of a table that takes their place where rays are sampled: smaller, as pieces have 4 rows and more. */
static size_t patches_bytes(const struct sst_rectify_tables *t)
{
    return (size_t)t->cells * (size_t)t->cell_rows * sizeof(struct sst_place_patch);
}

static size_t frame_bytes(const struct sst_rectify_tables *t)
{
    return (size_t)t->raw_width * (size_t)t->raw_height * 4;
}

static size_t light_nodes(const struct sst_rectify_tables *t)
{
    return t->falloff ? (size_t)t->light_cols * (size_t)t->light_rows : 0;
}

/* Tables that all views share: weights of the filter, and light. @param nodes  of a view's fall-off at most */
static void upload_constants(struct render_runner *d, const struct sst_rectify_tables *t, size_t nodes)
{
    const size_t n = (size_t)SST_RESAMPLE_PHASES * (size_t)t->taps,
                 light = SST_GPU_RECTIFY_LIGHT_FLOATS * sizeof(float);
    struct device_frames *f = &d->frames;
    int32_t *weight = (int32_t *)(void *)sst_run_words(d->run, n);

    for (size_t i = 0; weight && i < n; i++)
        weight[i] = t->weight[i];
    f->weights = sst_run_upload(d->run, DEVICE_SCRATCH_WEIGHTS, weight, n * sizeof(*weight));
    f->light = sst_run_scratch(d->run, DEVICE_SCRATCH_LIGHT, light + 2 * nodes * sizeof(float));
    if (!nodes)
        return;
    if (!f->lit) {
        f->lit = malloc(light);
        for (int i = 0; f->lit && i <= SST_LIGHT_WHITE; i++)
            sst_light_parts((float)i * (1.0f / (1 << SST_LIGHT_SHIFT)), &f->lit[i], &f->lit[SST_LIGHT_WHITE + 1 + i]);
    }
    sst_run_fail(d->run, f->lit ? 0 : -ENOMEM);
    sst_run_write(d->run, f->light, f->lit, light);
}

void device_reserve_frames(struct render_runner *d, const struct device_taps *taps)
{
    struct device_frames *f = &d->frames;
    struct sst_rectify_tables t = { 0 };
    size_t frame = 0, places = 0, nodes = 0;

    f->decodes = false;
    for (int i = 0; i < DEVICE_SPANS; i++)
        f->ready[i].tap = NULL; /* of another plan */
    for (int k = 0; k < taps->count; k++) {
        if (!taps->tap[k]->frame)
            continue;
        sst_rectify_map_tables(&t, taps->tap[k]->frame->map, render_frame_filter(d->lf));
        frame = most(frame, frame_bytes(&t));
        places = most(places, taps->rays ? patches_bytes(&t) : places_bytes(&t));
        nodes = most(nodes, light_nodes(&t));
        f->decodes |= d->lf->views[taps->tap[k]->view].encoded && !(d->refused >> RENDER_STEP_JPEG & 1);
    }
    if (!frame)
        return;
    if (frame + places > f->span_bytes) {
        drop_spans(d);
        f->span_bytes = frame + places;
    }
    f->frame_bytes = frame;
    f->places_bytes = places;
    f->frame = sst_run_scratch(d->run, DEVICE_SCRATCH_FRAME, frame);
    if (f->decodes)
        f->samples = sst_run_scratch(d->run, DEVICE_SCRATCH_SAMPLES, frame);
    f->places = sst_run_scratch(d->run, DEVICE_SCRATCH_PLACES, places);
    f->list = sst_run_scratch(d->run, DEVICE_SCRATCH_LIST, 8);
    upload_constants(d, &t, nodes);
}

/* --- frames in mapped memory -------------------------------------------------------------------------------------- */

/* True if a frame has to be there for the view of a tap. */
static bool needs_frame(const struct render_runner *d, const struct device_taps *taps, int k)
{
    return taps->tap[k]->frame && taps->wanted[k] && !device_holds(d, taps, k);
}

struct device_frame *device_find_frame(struct render_runner *d, const struct sst_render_tap *t)
{
    for (int i = 0; i < d->frames.spans; i++) {
        if (d->frames.ready[i].tap == t)
            return &d->frames.ready[i];
    }
    return NULL;
}

/* At least one, and as many as fit up to n. */
static void make_spans(struct render_runner *d, int n)
{
    struct device_frames *f = &d->frames;
    int err = 0;

    for (; f->spans < n && !err; f->spans += !err)
        err = sst_gpu_span_create(d->gpu, &f->ready[f->spans].span, f->span_bytes);
    sst_run_fail(d->run, err == -ENOMEM && f->spans ? 0 : err);
}

/* Write a frame to its span: the samples of a JPEG, if the device makes colours of such, else colours. */
static int load_frame(const struct render_runner *d, struct device_frame *f, const struct sst_rectify_tables *t)
{
    const struct sst_view *v = &d->lf->views[f->tap->view];
    uint8_t *span = sst_gpu_span_data(f->span);

    f->encoded = d->frames.decodes && v->encoded &&
                 !sst_jpeg_planes_read(&f->layout, v->encoded, v->encoded_bytes, "frame") &&
                 f->layout.width == t->raw_width && f->layout.height == t->raw_height &&
                 f->layout.bytes <= d->frames.frame_bytes;
    return f->encoded ? sst_jpeg_planes_decode(span, &f->layout, v->encoded, v->encoded_bytes, "frame")
                      : sst_lightfield_put_frame(span, (size_t)t->raw_width * 4, d->lf, f->tap->view);
}

static int ready_frame(void *arg, int index, int worker SST_UNUSED)
{
    struct render_runner *d = arg;
    struct device_frame *f = &d->frames.ready[index];
    const struct sst_rectify_map *map = f->tap->frame->map;
    uint8_t *span = sst_gpu_span_data(f->span);
    struct sst_places *places = (struct sst_places *)(void *)(span + d->frames.frame_bytes);
    struct sst_rectify_tables t;
    int err = 0;

    sst_rectify_map_tables(&t, map, render_frame_filter(d->lf));
    if (f->loaded)
        err = load_frame(d, f, &t);
    f->list.count = 0;
    if (f->rays)
        return err ? err : sst_rectify_map_patches(map, (struct sst_place_patch *)(void *)places, &f->list);
    for (int y = 0; y < t.height && !err; y++)
        err = sst_rectify_map_cells(map, f->part_x, y + f->part_y, places + (size_t)y * (size_t)t.cells, &f->list);
    return err;
}

void device_ready_frames(struct render_runner *d, const struct device_taps *taps, int k)
{
    struct device_frames *f = &d->frames;
    const int64_t start_ns = sst_clock_now_ns();
    char text[SST_LOG_MAX] = "", *before;
    int n = 0, err;

    if (sst_run_failed(d->run) || !needs_frame(d, taps, k) || device_find_frame(d, taps->tap[k]))
        return;
    make_spans(d, sst_min_int(sst_min_int(taps->threads, DEVICE_SPANS), taps->count - k));
    if (!sst_run_failed(d->run))
        sst_run_fail(d->run, sst_gpu_wait(d->gpu)); /* spans may be read until then */
    if (sst_run_failed(d->run))
        return;
    for (; k < taps->count && n < f->spans; k++) {
        const struct sst_render_tap *t = taps->tap[k];

        if (!needs_frame(d, taps, k))
            continue;
        f->ready[n].tap = t;
        f->ready[n].part_x = taps->sampled ? t->fx : 0;
        f->ready[n].part_y = taps->sampled ? t->fy : 0;
        f->ready[n].loaded = !f->kept[t->view];
        f->ready[n++].rays = taps->rays;
    }
    for (int i = n; i < f->spans; i++)
        f->ready[i].tap = NULL;
    before = sst_log_hold_errors(text); /* the CPU meets the same error, and logs it */
    err = sst_parallel_for(n, taps->threads, ready_frame, d);
    sst_log_hold_errors(before);
    sst_run_fail(d->run, err);
    d->report.frames_ns += sst_clock_now_ns() - start_ns;
    d->report.upload_ns += sst_clock_now_ns() - start_ns;
}

/* --- a view ------------------------------------------------------------------------------------------------------- */

/* Copy from a span. */
static void upload_span(struct render_runner *d, struct sst_gpu_range to, const struct device_frame *f, size_t from,
                        size_t bytes)
{
    if (!sst_run_failed(d->run))
        sst_run_fail(d->run, sst_gpu_upload_span(d->gpu, to.buffer, to.offset, f->span, from, bytes));
    d->report.upload_bytes += (int64_t)bytes;
}

static uint32_t groups(int n, int of)
{
    return (uint32_t)((n + of - 1) / of);
}

/* Constants of jpeg_rgb (std430): chroma is enlarged with the weights 3/4 and 1/4 (9/16, 3/16, 3/16, 1/16 in both
 * directions), then colours as of BT.601 in full range, in 1/65536: whole numbers, with the bytes of
 * libjpeg-turbo, by definition. */
struct jpeg_rgb {
    int32_t width, height;
    int32_t count;        /* of planes: 3, or 1: grey */
    int32_t across, down; /* pixels for one sample of chroma: 1 x 1, 2 x 1, 2 x 2 */
    int32_t chroma_width, chroma_height;
    uint32_t at[3], stride[3]; /* of the planes; bytes */
};

/* Pixels of a group. */
#define JPEG_GROUP_WIDTH  32
#define JPEG_GROUP_HEIGHT 8

/* The pixels of a frame from the samples of a JPEG. */
static void make_colours(struct render_runner *d, const struct sst_jpeg_planes *p, struct sst_gpu_range frame)
{
    struct jpeg_rgb push = { .width = p->width,
                                 .height = p->height,
                                 .count = p->count,
                                 .across = p->across,
                                 .down = p->down,
                                 .chroma_width = p->chroma_width,
                                 .chroma_height = p->chroma_height };

    for (int i = 0; i < p->count; i++) {
        push.at[i] = (uint32_t)p->at[i];
        push.stride[i] = (uint32_t)p->stride[i];
    }
    SST_RUN_GROUPS(d->run, SST_GPU_JPEG_RGB, &push, groups(p->width, JPEG_GROUP_WIDTH),
                   groups(p->height, JPEG_GROUP_HEIGHT), 1, d->frames.samples, frame);
}

/* Copy a frame to the device: to stay there, if other pictures may need it and there is room, else to where the next
 * one goes too. @param keep  views have the room that they need @return where it is */
static struct sst_gpu_range upload_frame(struct render_runner *d, const struct device_frame *f,
                                         const struct sst_rectify_tables *t, bool keep)
{
    struct sst_gpu_buffer **kept = &d->frames.kept[f->tap->view];
    struct sst_gpu_range to = { *kept, 0 };

    if (!f->loaded)
        return to;
    if (keep && !*kept && sst_gpu_free_bytes(d->gpu) / 2 > frame_bytes(t)) {
        const int err = sst_gpu_buffer_create(d->gpu, kept, frame_bytes(t));

        if (err)
            *kept = NULL;
        sst_run_fail(d->run, err == -ENOMEM ? 0 : err);
    }
    to = *kept ? (struct sst_gpu_range){ *kept, 0 } : d->frames.frame;
    d->report.uploads++;
    upload_span(d, f->encoded ? d->frames.samples : to, f, 0, f->encoded ? f->layout.bytes : frame_bytes(t));
    if (f->encoded)
        make_colours(d, &f->layout, to);
    return to;
}

/* Places of the pixels, and factors of light. */
static void upload_tables(struct render_runner *d, const struct device_frame *f, const struct sst_rectify_tables *t)
{
    const size_t listed = f->list.count * 2 * sizeof(*f->list.xy), nodes = light_nodes(t) * sizeof(*t->falloff);
    struct sst_gpu_range light = d->frames.light;

    upload_span(d, d->frames.places, f, d->frames.frame_bytes, f->rays ? patches_bytes(t) : places_bytes(t));
    if (listed)
        d->frames.list = sst_run_upload(d->run, DEVICE_SCRATCH_LIST, f->list.xy, listed);
    if (!nodes)
        return;
    light.offset = SST_GPU_RECTIFY_LIGHT_FLOATS * sizeof(*t->falloff);
    sst_run_write(d->run, light, t->falloff, nodes);
    light.offset += nodes;
    sst_run_write(d->run, light, t->falloff_root, nodes);
}

struct sst_gpu_range device_upload_rays(struct render_runner *d, const struct device_frame *f,
                                        const struct sst_rectify_tables *t)
{
    const struct sst_gpu_range source = upload_frame(d, f, t, !d->slots || d->slots == d->lf->rows * d->lf->cols);

    upload_tables(d, f, t);
    return source;
}

struct sst_gpu_rectify device_describe_frame(const struct render_runner *d, const struct sst_rectify_tables *t)
{
    struct sst_gpu_rectify push = { .width = t->width,
                                    .height = t->height,
                                    .pitch = d->pitch,
                                    .raw_width = t->raw_width,
                                    .raw_height = t->raw_height,
                                    .taps = t->taps,
                                    .cell_shift = t->cell_shift,
                                    .cells = t->cells,
                                    .flags = t->falloff ? SST_GPU_RECTIFY_LIT : 0U,
                                    .light_shift = t->light_shift,
                                    .light_cols = t->light_cols,
                                    .light_rows = t->light_rows };

    memcpy(push.gain, t->gain, sizeof(push.gain));
    memcpy(push.gain_root, t->gain_root, sizeof(push.gain_root));
    return push;
}

void device_make_rows(struct render_runner *d, const struct device_taps *taps, int k, const struct device_place *to,
                      bool mapped)
{
    const struct sst_render_tap *tap = taps->tap[k];
    const struct device_frame *f = device_find_frame(d, tap);
    const struct device_chunk *c = to->chunk;
    const bool labelled = tap->v->label.data;
    struct sst_gpu_rectify push;
    struct sst_rectify_tables t;
    struct sst_gpu_range source;

    if (sst_run_failed(d->run))
        return;
    assert(f);
    sst_rectify_map_tables(&t, tap->frame->map, render_frame_filter(d->lf));
    if (!mapped)
        device_upload_rows(d, to, tap->v, labelled ? DEVICE_LABELS : 0, taps->threads);
    source = upload_frame(d, f, &t, taps->sampled && taps->slots == d->lf->rows * d->lf->cols);
    upload_tables(d, f, &t);
    push = device_describe_frame(d, &t);
    push.first = to->first;
    push.top = to->top;
    push.flags |= labelled ? SST_GPU_RECTIFY_KEEP : 0U;
    push.part_x = (float)f->part_x;
    push.part_y = (float)f->part_y;
    SST_RUN_GROUPS(d->run, SST_GPU_RECTIFY, &push, groups(t.width, SST_GPU_RECTIFY_GROUP_WIDTH),
                   groups(to->end - to->top, SST_GPU_RECTIFY_GROUP_HEIGHT), 1, d->frames.weights, source,
                   d->frames.places, d->frames.list, d->frames.light, c->plane[DEVICE_VALID], c->plane[DEVICE_PIXELS]);
    d->report.rectified++;
}
