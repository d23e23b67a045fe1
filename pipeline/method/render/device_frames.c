/* Views that a device makes from raw frames: a frame is written to mapped memory, copied, and resampled into the view's
 * slot by the shader `rectify`. Of a JPEG file the CPU decodes the samples; the shader `jpeg_rgb` makes colours of
 * them.
 *
 * The CPU decodes several frames at once, one in each span, and computes the places of their pixels: cubics along
 * pieces of rows, in double, as on the CPU. Where rays are sampled from frames, a view's pixels are made for each
 * picture, as far from whole positions as its rays are; the frames then stay on the device as far as they fit. */
#include <assert.h>
#include <errno.h>
#include <math.h>
#include <string.h>

#include "base/clock.h"
#include "base/log.h"
#include "base/thread.h"
#include "pipeline/gpu/jpeg_rgb.h"
#include "pipeline/gpu/rectify.h"
#include "pipeline/kernels/place_patch.h"
#include "pipeline/method/render/device_internal.h"

static size_t most(size_t a, size_t b)
{
    return a > b ? a : b;
}

/* --- buffers ------------------------------------------------------------------------------------------------------ */

void device_drop_kept(struct render_device *d)
{
    for (int k = 0; k < d->lf->rows * d->lf->cols; k++) {
        sst_gpu_buffer_destroy(d->gpu, d->frames.kept[k]);
        d->frames.kept[k] = NULL;
    }
}

void device_drop_frames(struct render_device *d)
{
    struct device_frames *f = &d->frames;

    sst_gpu_buffer_destroy(d->gpu, f->frame);
    sst_gpu_buffer_destroy(d->gpu, f->samples);
    sst_gpu_buffer_destroy(d->gpu, f->places);
    sst_gpu_buffer_destroy(d->gpu, f->list);
    sst_gpu_buffer_destroy(d->gpu, f->light);
    sst_gpu_buffer_destroy(d->gpu, f->labels);
    sst_gpu_buffer_destroy(d->gpu, f->weights);
    f->frame = f->samples = f->places = f->list = f->light = f->labels = f->weights = NULL;
    device_drop_kept(d);
    for (int i = 0; i < f->spans; i++) {
        sst_gpu_span_destroy(d->gpu, f->ready[i].span);
        f->ready[i].span = NULL;
        f->ready[i].tap = NULL;
    }
    f->spans = 0;
    f->frame_bytes = f->places_bytes = f->light_bytes = f->list_bytes = 0;
}

/* What all views share: weights of the filter, and the table of light. */
static int upload_constants(struct render_device *d, const struct sst_rectify_tables *t)
{
    const size_t n = (size_t)SST_RESAMPLE_PHASES * (size_t)t->taps;
    float *light = sst_mem_keep(&d->packed, most(SST_GPU_RECTIFY_LIGHT_FLOATS, n), 4);
    int32_t *weight = (int32_t *)(void *)light;
    int err;

    if (!light)
        return -ENOMEM;
    sst_gpu_rectify_light(light);
    err = sst_gpu_upload(d->gpu, d->frames.light, 0, light, SST_GPU_RECTIFY_LIGHT_FLOATS * sizeof(*light));
    for (size_t i = 0; i < n; i++)
        weight[i] = t->weight[i];
    return err ? err : sst_gpu_upload(d->gpu, d->frames.weights, 0, weight, n * sizeof(*weight));
}

static int create_buffers(struct render_device *d, size_t frame, size_t places, size_t light, int taps)
{
    struct device_frames *f = &d->frames;
    int err = sst_gpu_buffer_create(d->gpu, &f->frame, frame);

    if (!err && f->decodes)
        err = sst_gpu_buffer_create(d->gpu, &f->samples, frame);
    if (!err)
        err = sst_gpu_buffer_create(d->gpu, &f->places, places);
    if (!err)
        err = sst_gpu_buffer_create(d->gpu, &f->light, light);
    if (!err)
        err = sst_gpu_buffer_create(d->gpu, &f->labels, device_view_pixels(d));
    if (!err)
        err = sst_gpu_buffer_create(d->gpu, &f->list, 8);
    if (!err)
        err = sst_gpu_buffer_create(d->gpu, &f->weights, sizeof(int32_t) * SST_RESAMPLE_PHASES * (size_t)taps);
    f->list_bytes = 8;
    return err;
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

/* Whether frames are JPEG files of which the device can make colours; where it refuses, the CPU does. */
static int prepare_jpeg(struct render_device *d, const struct device_taps *taps)
{
    bool any = false;
    int err;

    for (int k = 0; k < taps->count; k++)
        any |= d->lf->views[taps->tap[k]->view].encoded != NULL;
    err = any ? device_prepare(d, RENDER_STEP_JPEG) : 0;
    d->frames.decodes = any && !err;
    return err == -ENOTSUP ? 0 : err;
}

int device_make_frames(struct render_device *d, const struct device_taps *taps)
{
    struct device_frames *f = &d->frames;
    struct sst_rectify_tables t = { 0 };
    size_t frame = 0, places = 0, light = 0;
    int err;

    for (int i = 0; i < DEVICE_SPANS; i++)
        f->ready[i].tap = NULL; /* of another plan */
    for (int k = 0; k < taps->count; k++) {
        if (!taps->tap[k]->frame)
            continue;
        sst_rectify_map_tables(&t, taps->tap[k]->frame->map, render_frame_filter(d->lf));
        frame = most(frame, frame_bytes(&t));
        places = most(places, most(places_bytes(&t), patches_bytes(&t)));
        light = most(light, (SST_GPU_RECTIFY_LIGHT_FLOATS + 2 * light_nodes(&t)) * sizeof(float));
    }
    if (frame <= f->frame_bytes && places <= f->places_bytes && light <= f->light_bytes)
        return 0;
    err = device_prepare(d, RENDER_STEP_FRAMES);
    err = err ? err : device_prepare(d, RENDER_STEP_SAMPLED);
    err = err ? err : prepare_jpeg(d, taps);
    if (err)
        return err;
    device_drop(d);
    err = create_buffers(d, frame, places, light, t.taps);
    if (!err)
        err = upload_constants(d, &t);
    if (err)
        return err;
    f->frame_bytes = frame;
    f->places_bytes = places;
    f->light_bytes = light;
    return 0;
}

/* --- frames in mapped memory -------------------------------------------------------------------------------------- */

static double part_x(const struct sst_render_tap *t, bool sampled)
{
    return sampled ? t->fx : 0;
}

static double part_y(const struct sst_render_tap *t, bool sampled)
{
    return sampled ? t->fy : 0;
}

/* True if the pixels of a slot are those of the tap. */
static bool holds(const struct device_slot *s, const struct sst_render_tap *t, bool sampled)
{
    return s->view == t->view && !(fabs(s->part_x - part_x(t, sampled)) > 0) &&
           !(fabs(s->part_y - part_y(t, sampled)) > 0);
}

static bool is_placed(struct render_device *d, const struct sst_render_tap *t, bool sampled)
{
    const struct device_slot *s = device_find_slot(d, t->view);

    return s && holds(s, t, sampled);
}

struct device_frame *device_find_frame(struct render_device *d, const struct sst_render_tap *t)
{
    for (int i = 0; i < d->frames.spans; i++) {
        if (d->frames.ready[i].tap == t)
            return &d->frames.ready[i];
    }
    return NULL;
}

/* Where the parts of a span begin: frame, places, labels, disparities. */
static size_t labels_at(const struct render_device *d)
{
    return d->frames.frame_bytes + d->frames.places_bytes;
}

static size_t disp_at(const struct render_device *d)
{
    return labels_at(d) + device_view_pixels(d);
}

/* At least one, and as many as fit up to n. */
static int make_spans(struct render_device *d, int n)
{
    struct device_frames *f = &d->frames;
    const size_t bytes = disp_at(d) + 2 * device_view_pixels(d);
    int err = 0;

    for (; f->spans < n && !err; f->spans += !err)
        err = sst_gpu_span_create(d->gpu, &f->ready[f->spans].span, bytes);
    return err == -ENOMEM && f->spans ? 0 : err;
}

static void write_maps(const struct render_device *d, struct device_frame *f)
{
    const struct sst_view *v = f->tap->v;
    uint8_t *span = sst_gpu_span_data(f->span);
    const size_t width = (size_t)d->lf->width, pitch = (size_t)d->pitch;

    for (int y = 0; y < d->lf->height; y++) {
        if (v->label.data)
            memcpy(span + labels_at(d) + (size_t)y * pitch, sst_map_u8_row(&v->label, y), width);
        if (v->disp.data)
            memcpy(span + disp_at(d) + 2 * (size_t)y * pitch, sst_map_u16_row(&v->disp, y), 2 * width);
    }
    f->with_maps = true;
}

/* Write a frame to its span: the samples of a JPEG, if the device makes colours of such, else colours. */
static int load_frame(const struct render_device *d, struct device_frame *f, const struct sst_rectify_tables *t)
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
    struct render_device *d = arg;
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
    if (!err && f->with_maps)
        write_maps(d, f);
    return err;
}

int device_ready_frames(struct render_device *d, const struct device_taps *taps, int from)
{
    struct device_frames *f = &d->frames;
    const int64_t start_ns = sst_clock_now_ns();
    char text[SST_LOG_MAX] = "", *before;
    int n = 0, err;

    if (!taps->tap[from]->frame || (!taps->rays && is_placed(d, taps->tap[from], taps->sampled)) ||
        device_find_frame(d, taps->tap[from]))
        return 0;
    err = make_spans(d, sst_min_int(sst_min_int(taps->threads, DEVICE_SPANS), taps->count - from));
    if (!err)
        err = sst_gpu_wait(d->gpu); /* spans may be read until then */
    if (err)
        return err;
    for (int k = from; k < taps->count && n < f->spans; k++) {
        const struct sst_render_tap *t = taps->tap[k];

        if (!t->frame || (!taps->rays && is_placed(d, t, taps->sampled)) ||
            (k > from && (t->x0 >= t->x1 || t->y0 >= t->y1)))
            continue;
        f->ready[n].tap = t;
        f->ready[n].part_x = part_x(t, taps->sampled);
        f->ready[n].part_y = part_y(t, taps->sampled);
        f->ready[n].loaded = !f->kept[t->view];
        f->ready[n].rays = taps->rays;
        f->ready[n++].with_maps = !taps->rays && !device_find_slot(d, t->view);
    }
    for (int i = n; i < f->spans; i++)
        f->ready[i].tap = NULL;
    before = sst_log_hold_errors(text); /* the CPU meets the same error, and logs it */
    err = sst_parallel_for(n, taps->threads, ready_frame, d);
    sst_log_hold_errors(before);
    for (int i = 0; i < n && err; i++)
        f->ready[i].tap = NULL;
    d->report.frames_ns += sst_clock_now_ns() - start_ns;
    d->report.upload_ns += sst_clock_now_ns() - start_ns;
    return err;
}

/* --- a view ------------------------------------------------------------------------------------------------------- */

/* The pixels of a frame from the samples of a JPEG. */
static int make_colours(struct render_device *d, const struct sst_jpeg_planes *p, struct sst_gpu_buffer *frame)
{
    struct sst_gpu_jpeg push = { .width = p->width,
                                 .height = p->height,
                                 .count = p->count,
                                 .across = p->across,
                                 .down = p->down,
                                 .chroma_width = p->chroma_width,
                                 .chroma_height = p->chroma_height };
    const struct sst_gpu_work work = {
        .shader = SST_GPU_JPEG_RGB,
        .push = &push,
        .buffer = { d->frames.samples, frame },
        .groups = { (uint32_t)(p->width + SST_GPU_JPEG_GROUP_WIDTH - 1) / SST_GPU_JPEG_GROUP_WIDTH,
                    (uint32_t)(p->height + SST_GPU_JPEG_GROUP_HEIGHT - 1) / SST_GPU_JPEG_GROUP_HEIGHT, 1 },
    };

    for (int i = 0; i < p->count; i++) {
        push.at[i] = (uint32_t)p->at[i];
        push.stride[i] = (uint32_t)p->stride[i];
    }
    d->report.dispatches++;
    return sst_gpu_dispatch(d->gpu, &work);
}

/* Copy a frame to the device: to stay there, if other pictures may need it and there is room, else to where the next
 * one goes too. @param keep  views have the room that they need */
static int upload_frame(struct render_device *d, const struct device_frame *f, const struct sst_rectify_tables *t,
                        bool keep, struct sst_gpu_buffer **source)
{
    struct sst_gpu_buffer **kept = &d->frames.kept[f->tap->view];
    int err;

    *source = *kept ? *kept : d->frames.frame;
    if (!f->loaded)
        return 0;
    if (keep && !*kept && sst_gpu_free_bytes(d->gpu) / 2 > frame_bytes(t)) {
        err = sst_gpu_buffer_create(d->gpu, kept, frame_bytes(t));
        if (err && err != -ENOMEM)
            return err;
        if (err)
            *kept = NULL;
        else
            *source = *kept;
    }
    d->report.uploads++;
    d->report.upload_bytes += (int64_t)(f->encoded ? f->layout.bytes : frame_bytes(t));
    if (!f->encoded)
        return sst_gpu_upload_span(d->gpu, *source, 0, f->span, 0, frame_bytes(t));
    err = sst_gpu_upload_span(d->gpu, d->frames.samples, 0, f->span, 0, f->layout.bytes);
    return err ? err : make_colours(d, &f->layout, *source);
}

/* Places of the pixels, and factors of light. */
static int upload_tables(struct render_device *d, const struct device_frame *f, const struct sst_rectify_tables *t)
{
    struct device_frames *to = &d->frames;
    const size_t listed = f->list.count * 2 * sizeof(*f->list.xy), nodes = light_nodes(t) * sizeof(*t->falloff);
    const size_t light = SST_GPU_RECTIFY_LIGHT_FLOATS * sizeof(*t->falloff);
    const size_t places = f->rays ? patches_bytes(t) : places_bytes(t);
    int err = 0;

    if (listed > to->list_bytes) {
        sst_gpu_buffer_destroy(d->gpu, to->list);
        to->list = NULL;
        to->list_bytes = 0;
        err = sst_gpu_buffer_create(d->gpu, &to->list, listed);
        to->list_bytes = err ? 0 : listed;
    }
    if (!err)
        err = sst_gpu_upload_span(d->gpu, to->places, 0, f->span, to->frame_bytes, places);
    if (!err && listed)
        err = sst_gpu_upload(d->gpu, to->list, 0, f->list.xy, listed);
    if (!err && nodes)
        err = sst_gpu_upload(d->gpu, to->light, light, t->falloff, nodes);
    if (!err && nodes)
        err = sst_gpu_upload(d->gpu, to->light, light + nodes, t->falloff_root, nodes);
    d->report.upload_bytes += (int64_t)(places + listed + 2 * nodes);
    return err;
}

static int upload_maps(struct render_device *d, const struct device_slot *s, const struct device_frame *f)
{
    const struct sst_view *v = f->tap->v;
    const size_t pixels = device_view_pixels(d), at = (size_t)s->index * pixels;
    int err = 0;

    if (v->label.data)
        err = sst_gpu_upload_span(d->gpu, d->frames.labels, 0, f->span, labels_at(d), pixels);
    if (!err && v->disp.data)
        err = sst_gpu_upload_span(d->gpu, d->chunk[s->chunk].disp, 2 * at, f->span, disp_at(d), 2 * pixels);
    d->report.upload_bytes += (int64_t)(pixels * ((v->label.data ? 1U : 0) + (v->disp.data ? 2U : 0)));
    return err;
}

/* @param keep  labels are in the slot */
static int dispatch(struct render_device *d, const struct device_slot *s, const struct device_frame *f,
                    const struct sst_rectify_tables *t, struct sst_gpu_buffer *source, bool keep)
{
    const struct device_chunk *c = &d->chunk[s->chunk];
    struct sst_gpu_rectify push = {
        .width = t->width,
        .height = t->height,
        .pitch = d->pitch,
        .raw_width = t->raw_width,
        .raw_height = t->raw_height,
        .taps = t->taps,
        .cell_shift = t->cell_shift,
        .cells = t->cells,
        .first = (uint32_t)((size_t)s->index * device_view_pixels(d)),
        .flags = (t->falloff ? SST_GPU_RECTIFY_LIT : 0U) | (keep                    ? SST_GPU_RECTIFY_KEEP
                                                            : f->tap->v->label.data ? SST_GPU_RECTIFY_LABELLED
                                                                                    : 0U),
        .light_shift = t->light_shift,
        .light_cols = t->light_cols,
        .light_rows = t->light_rows,
        .part_x = (float)f->part_x,
        .part_y = (float)f->part_y,
    };
    const struct sst_gpu_work work = {
        .shader = SST_GPU_RECTIFY,
        .push = &push,
        .buffer = { d->frames.weights, source, d->frames.places, d->frames.list, d->frames.light, d->frames.labels,
                    c->valid, c->pixels },
        .groups = { (uint32_t)(t->width + SST_GPU_RECTIFY_GROUP_WIDTH - 1) / SST_GPU_RECTIFY_GROUP_WIDTH,
                    (uint32_t)(t->height + SST_GPU_RECTIFY_GROUP_HEIGHT - 1) / SST_GPU_RECTIFY_GROUP_HEIGHT, 1 },
    };

    memcpy(push.gain, t->gain, sizeof(push.gain));
    memcpy(push.gain_root, t->gain_root, sizeof(push.gain_root));
    d->report.dispatches++;
    return sst_gpu_dispatch(d->gpu, &work);
}

int device_upload_rays(struct render_device *d, const struct device_frame *f, const struct sst_rectify_tables *t,
                       struct sst_gpu_buffer **source)
{
    const int64_t start_ns = sst_clock_now_ns();
    int err = upload_frame(d, f, t, !d->slots || d->slots == d->lf->rows * d->lf->cols, source);

    if (!err)
        err = upload_tables(d, f, t);
    d->report.upload_ns += sst_clock_now_ns() - start_ns;
    return err;
}

int device_place_frame(struct render_device *d, struct device_slot *s, const struct sst_render_tap *t, bool sampled)
{
    const bool keep = s->view == t->view;
    struct device_frame *f = device_find_frame(d, t);
    const int64_t start_ns = sst_clock_now_ns();
    struct sst_rectify_tables tables;
    struct sst_gpu_buffer *source;
    int err;

    if (holds(s, t, sampled))
        return 0;
    assert(f);
    s->view = DEVICE_NO_VIEW; /* half a view is none */
    sst_rectify_map_tables(&tables, t->frame->map, render_frame_filter(d->lf));
    if (!keep && !f->with_maps) /* it was there, and gave way to another one */
        write_maps(d, f);
    err = upload_frame(d, f, &tables, sampled && d->slots == d->lf->rows * d->lf->cols, &source);
    if (!err)
        err = upload_tables(d, f, &tables);
    if (!err && !keep)
        err = upload_maps(d, s, f);
    if (!err)
        err = dispatch(d, s, f, &tables, source, keep);
    if (err)
        return err;
    s->view = t->view;
    s->part_x = f->part_x;
    s->part_y = f->part_y;
    d->report.rectified++;
    d->report.upload_ns += sst_clock_now_ns() - start_ns;
    return 0;
}
