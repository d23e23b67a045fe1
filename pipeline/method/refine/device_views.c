/* Views on a device, for all stages of labels: colours and disparities are those that the matching left there, labels
 * those of the last stage; what is not there is uploaded. Where not all views fit, the one that was used least recently
 * gives way. */
#include <errno.h>
#include <string.h>

#include "base/clock.h"
#include "pipeline/gpu/convert.h"
#include "pipeline/method/refine/refine_internal.h"

static void drop_view(struct sst_refine_device *d, int view)
{
    sst_gpu_buffer_destroy(sst_runner_device(d->shared), d->view[view].buffer);
    d->view[view] = (struct refine_pixels){ 0 };
}

void refine_drop_views(struct sst_refine_device *d)
{
    for (int i = 0; i < SST_MAX_VIEWS; i++)
        drop_view(d, i);
}

void sst_refine_device_next_stage(struct sst_refine_device *d)
{
    if (!d)
        return;
    sst_runner_lock(d->shared);
    d->band_rows = 0; /* another stage needs less, or others have given memory back */
    sst_runner_unlock(d->shared);
}

void sst_refine_device_changed(struct sst_refine_device *d, int view)
{
    if (!d)
        return;
    sst_runner_lock(d->shared);
    d->view[view].labels = d->view[view].entropies = d->view[view].elected = false;
    sst_runner_unlock(d->shared);
}

void sst_refine_device_forget(struct sst_refine_device *d)
{
    if (!d)
        return;
    sst_runner_lock(d->shared);
    refine_drop_views(d);
    d->band_rows = 0;
    sst_runner_unlock(d->shared);
}

bool refine_drop_oldest(struct sst_refine_device *d)
{
    int oldest = -1;

    for (int i = 0; i < SST_MAX_VIEWS; i++) {
        if (d->view[i].buffer && d->view[i].used != d->turn && (oldest < 0 || d->view[i].used < d->view[oldest].used))
            oldest = i;
    }
    if (oldest >= 0)
        drop_view(d, oldest);
    return oldest >= 0;
}

static int create_view(struct sst_refine_device *d, struct refine_pixels *v, size_t bytes)
{
    int err = sst_gpu_buffer_create(d->gpu, &v->buffer, bytes);

    if (err == -ENOMEM && d->borrowed)
        return err;
    if (err == -ENOMEM && (refine_device_drop_kept(d) || sst_runner_make_room(d->shared, &d->user)))
        err = sst_gpu_buffer_create(d->gpu, &v->buffer, bytes);
    while (err == -ENOMEM && refine_drop_oldest(d))
        err = sst_gpu_buffer_create(d->gpu, &v->buffer, bytes);
    v->bytes = err ? 0 : bytes;
    return err;
}

/* Rows top .. end - 1 of a plane. */
static void pack_labels(uint32_t *to, const struct sst_view *v, int width, int top, int end)
{
    for (int y = top; y < end; y++, to += width) {
        const uint16_t *disp = sst_map_u16_row(&v->disp, y);
        const uint8_t *label = v->label.data ? sst_map_u8_row(&v->label, y) : NULL;

        for (int x = 0; x < width; x++)
            to[x] = disp[x] | (label ? (uint32_t)label[x] << 16 : 0);
    }
}

static void pack_colours(uint32_t *to, const struct sst_view *v, int width, int top, int end)
{
    for (int y = top; y < end; y++, to += width) {
        const uint8_t *r = sst_image_row(&v->image, 0, y), *g = sst_image_row(&v->image, 1, y);
        const uint8_t *b = sst_image_row(&v->image, 2, y);
        const uint8_t *valid = v->valid.data ? sst_map_u8_row(&v->valid, y) : NULL;

        for (int x = 0; x < width; x++)
            to[x] = (uint32_t)(r[x] | g[x] << 8 | b[x] << 16) | (!valid || valid[x] ? 0xFF000000U : 0);
    }
}

static void pack_entropies(uint32_t *to, const struct sst_map_f32 *e, int width, int top, int end)
{
    for (int y = top; y < end; y++, to += width)
        memcpy(to, sst_map_f32_row(e, y), (size_t)width * sizeof(*to));
}

/* A plane of some rows, by way of d->words. */
static int upload_plane(struct sst_refine_device *d, struct sst_gpu_buffer *to, const struct sst_view *v,
                        const struct sst_map_f32 *entropies, enum sst_gpu_label_plane plane, int width, int top,
                        int end)
{
    const size_t bytes = (size_t)width * (size_t)(end - top) * sizeof(uint32_t);
    uint32_t *words = sst_mem_keep(&d->words, bytes, 1);

    if (!words)
        return -ENOMEM;
    if (plane == SST_GPU_PLANE_LABELS)
        pack_labels(words, v, width, top, end);
    else if (plane == SST_GPU_PLANE_COLOURS)
        pack_colours(words, v, width, top, end);
    else
        pack_entropies(words, entropies, width, top, end);
    d->report.upload_bytes += (int64_t)bytes;
    return sst_gpu_upload(d->gpu, to, (size_t)plane * bytes, words, bytes);
}

/* @param planes  bits */
static int upload_rows(struct sst_refine_device *d, struct sst_gpu_buffer *to, const struct sst_view *v,
                       const struct sst_map_f32 *entropies, unsigned planes, int width, int top, int end)
{
    int err = 0;

    for (int i = SST_GPU_PLANE_LABELS; i <= SST_GPU_PLANE_ENTROPIES && !err; i++) {
        if (planes >> i & 1)
            err = upload_plane(d, to, v, entropies, (enum sst_gpu_label_plane)i, width, top, end);
    }
    return err;
}

/* --- what stays of the matching ----------------------------------------------------------------------------------- */

static struct sst_gpu_range find(struct sst_refine_device *d, const struct sst_lightfield *lf,
                                 enum sst_step_plane plane, int view)
{
    struct sst_step_planes *p = sst_runner_planes(d->shared);

    return p->of == lf ? sst_step_plane_find(p, plane, view) : (struct sst_gpu_range){ 0 };
}

/* The colours are copied to the view. @param taken  out: there are any */
static int take_colours(struct sst_refine_device *d, const struct sst_lightfield *lf, int view, bool *taken)
{
    const size_t plane = (size_t)lf->width * (size_t)lf->height * sizeof(uint32_t);
    const struct sst_gpu_range from = find(d, lf, SST_PLANE_COLOUR, view);

    *taken = from.buffer;
    return from.buffer ? sst_gpu_copy(d->gpu, d->view[view].buffer, SST_GPU_PLANE_COLOURS * plane, from.buffer,
                                      from.offset, plane)
                       : 0;
}

/* So are the disparities; colours that matter are there. */
static int take_disparities(struct sst_refine_device *d, const struct sst_lightfield *lf, int view, bool *taken)
{
    const int scale = sst_runner_planes(d->shared)->scale;
    const struct sst_gpu_range map = find(d, lf, SST_PLANE_MAP, view);
    const struct sst_gpu_convert push = { .width = lf->width,
                                          .height = lf->height,
                                          .full_width = (lf->width + scale - 1) / scale,
                                          .conversion = SST_GPU_TO_LABELS,
                                          .value = (uint32_t)scale,
                                          .colours = (uint32_t)((size_t)lf->width * (size_t)lf->height) };
    struct sst_gpu_buffer *to = d->view[view].buffer;
    struct sst_gpu_work work = { .shader = SST_GPU_CONVERT, .push = &push };

    *taken = map.buffer;
    if (!map.buffer)
        return 0;
    work.buffer[SST_GPU_CONVERT_COLOURS] = to;
    work.buffer[SST_GPU_CONVERT_MAP] = work.buffer[SST_GPU_CONVERT_FROM] = map.buffer;
    work.offset[SST_GPU_CONVERT_MAP] = work.offset[SST_GPU_CONVERT_FROM] = map.offset;
    work.buffer[SST_GPU_CONVERT_TO] = to;
    return refine_device_dispatch(d, &work, lf->width, lf->height);
}

/* --- a view ------------------------------------------------------------------------------------------------------- */

static int upload_whole(struct sst_refine_device *d, const struct sst_lightfield *lf, int view,
                        enum sst_gpu_label_plane plane, const struct sst_map_f32 *entropies, bool *uploaded)
{
    *uploaded = true;
    return upload_plane(d, d->view[view].buffer, &lf->views[view], entropies, plane, lf->width, 0, lf->height);
}

static int need_colours(struct sst_refine_device *d, const struct sst_lightfield *lf, int view, bool *uploaded)
{
    struct refine_pixels *v = &d->view[view];
    int err = v->colours ? 0 : take_colours(d, lf, view, &v->colours);

    if (err || v->colours)
        return err;
    err = upload_whole(d, lf, view, SST_GPU_PLANE_COLOURS, NULL, uploaded);
    v->colours = !err;
    return err;
}

/* Disparities, with labels or without. */
static int need_labels(struct sst_refine_device *d, const struct sst_lightfield *lf, int view, bool labels,
                       bool *uploaded)
{
    struct refine_pixels *v = &d->view[view];
    int err = 0;

    if (!v->disparities && (v->labels || !labels) && find(d, lf, SST_PLANE_MAP, view).buffer) {
        err = need_colours(d, lf, view, uploaded);
        err = err ? err : take_disparities(d, lf, view, &v->disparities);
    }
    if (err || (v->disparities && (v->labels || !labels)))
        return err;
    err = upload_whole(d, lf, view, SST_GPU_PLANE_LABELS, NULL, uploaded);
    v->disparities = !err;
    v->labels = !err && (v->labels || labels); /* else they are about to change */
    v->elected = false;
    return err;
}

static int need_entropies(struct sst_refine_device *d, const struct sst_lightfield *lf, int view,
                          const struct sst_map_f32 *entropies, bool *uploaded)
{
    struct refine_pixels *v = &d->view[view];
    int err;

    if (v->entropies)
        return 0;
    err = upload_whole(d, lf, view, SST_GPU_PLANE_ENTROPIES, entropies, uploaded);
    v->entropies = !err;
    return err;
}

void refine_device_reserve(struct sst_refine_device *d, const struct sst_lightfield *lf, int view, int planes)
{
    const size_t bytes = (size_t)planes * (size_t)lf->width * (size_t)lf->height * sizeof(uint32_t);
    struct refine_pixels *v = &d->view[view];

    if (v->buffer && v->bytes < bytes)
        drop_view(d, view);
    if (v->buffer)
        return;
    if (sst_gpu_buffer_create(d->gpu, &v->buffer, bytes))
        v->buffer = NULL;
    else
        v->bytes = bytes;
    v->used = d->turn;
}

int refine_device_view(struct sst_refine_device *d, const struct sst_lightfield *lf, int view, unsigned planes,
                       const struct sst_map_f32 *entropies)
{
    const size_t plane = (size_t)lf->width * (size_t)lf->height * sizeof(uint32_t), bytes = (entropies ? 3 : 2) * plane;
    const bool labels = planes >> SST_GPU_PLANE_LABELS & 1;
    struct refine_pixels *v = &d->view[view];
    const int64_t start_ns = sst_clock_now_ns();
    bool uploaded = false;
    int err = 0;

    for (int i = 0; i < SST_PLANES; i++) /* they make no room for its own buffer */
        (void)find(d, lf, (enum sst_step_plane)i, view);
    if (v->buffer && v->bytes != 3 * plane && v->bytes != bytes) /* of another size, or lacks the entropies */
        drop_view(d, view);
    if (!v->buffer)
        err = create_view(d, v, bytes);
    v->used = d->turn;
    if (planes >> SST_GPU_PLANE_COLOURS & 1)
        err = err ? err : need_colours(d, lf, view, &uploaded);
    if (labels || planes & REFINE_DISPARITIES)
        err = err ? err : need_labels(d, lf, view, labels, &uploaded);
    if (entropies)
        err = err ? err : need_entropies(d, lf, view, entropies, &uploaded);
    d->report.uploads += uploaded;
    if (err)
        drop_view(d, view);
    d->report.upload_ns += sst_clock_now_ns() - start_ns;
    return err;
}

int refine_device_rows(struct sst_refine_device *d, enum refine_kept which, const struct sst_lightfield *lf, int view,
                       unsigned planes, const struct sst_map_f32 *entropies, int top, int end)
{
    const size_t plane = (size_t)lf->width * (size_t)(end - top) * sizeof(uint32_t);
    const int64_t start_ns = sst_clock_now_ns();
    int err = refine_device_keep(d, which, (entropies ? 3 : 2) * plane);

    planes |= entropies ? 1U << SST_GPU_PLANE_ENTROPIES : 0U;
    err = err ? err : upload_rows(d, d->kept[which], &lf->views[view], entropies, planes, lf->width, top, end);
    d->report.uploads++;
    d->report.upload_ns += sst_clock_now_ns() - start_ns;
    return err;
}

/* --- labels that steps leave -------------------------------------------------------------------------------------- */

int refine_device_keep_labels(struct sst_refine_device *d, const struct sst_lightfield *lf, int view,
                              struct sst_gpu_label_keep way, struct sst_gpu_buffer *from)
{
    const size_t plane = (size_t)lf->width * (size_t)lf->height * sizeof(uint32_t);
    struct refine_pixels *v = &d->view[view];
    struct sst_gpu_work work = { .shader = SST_GPU_LABEL_KEEP, .push = &way };
    int err;

    way.width = lf->width;
    way.height = lf->height;
    way.entropies = way.entropies && v->bytes >= 3 * plane;
    work.buffer[SST_GPU_LABEL_KEEP_VIEW] = v->buffer;
    work.buffer[SST_GPU_LABEL_KEEP_FROM] = from ? from : v->buffer;
    err = refine_device_dispatch(d, &work, lf->width, lf->height);
    v->elected = !err && way.way == SST_GPU_KEEP_ELECTED;
    v->labels = !err && (v->labels || way.way != SST_GPU_KEEP_ELECTED);
    if (way.way == SST_GPU_KEEP_WORDS)
        v->entropies = !err && way.entropies;
    return err;
}

/* Begin to change what is there. */
static void resume(struct sst_refine_device *d)
{
    sst_runner_lock(d->shared);
    d->gpu = sst_runner_device(d->shared);
}

void sst_refine_device_threshold(struct sst_refine_device *d, const struct sst_lightfield *lf, double eps_h)
{
    const struct sst_gpu_label_keep sure = { .way = SST_GPU_KEEP_SURE, .limit = refine_limit_of(eps_h) };
    int err = 0;

    if (!d)
        return;
    resume(d);
    for (int k = 0; k < lf->rows * lf->cols && !err; k++) {
        struct refine_pixels *v = &d->view[k];

        if (v->labels && v->entropies)
            err = refine_device_keep_labels(d, lf, k, sure, NULL);
        else
            v->labels = false;
    }
    refine_device_end(d, err, "labels are dropped");
}

void sst_refine_device_take_vote(struct sst_refine_device *d, const struct sst_lightfield *lf, int view)
{
    const struct sst_gpu_label_keep taken = { .way = SST_GPU_KEEP_TAKEN };
    int err = 0;

    if (!d)
        return;
    resume(d);
    if (d->view[view].elected)
        err = refine_device_keep_labels(d, lf, view, taken, NULL);
    else
        d->view[view].labels = false;
    refine_device_end(d, err, "views vote");
}
