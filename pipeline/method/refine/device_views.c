/* Views on a device, for all stages of labels: colours are uploaded once a light field, labels and disparities once a
 * stage. Where not all views fit, the one that was used least recently gives way. */
#include <errno.h>
#include <string.h>

#include "base/clock.h"
#include "pipeline/method/refine/refine_internal.h"

static void drop_view(struct sst_refine_device *d, int view)
{
    sst_gpu_buffer_destroy(sst_gpu_shared_device(d->shared), d->view[view].buffer);
    d->view[view] = (struct refine_pixels){ 0 };
}

void refine_drop_views(struct sst_refine_device *d)
{
    for (int i = 0; i < SST_MAX_VIEWS; i++)
        drop_view(d, i);
}

void sst_refine_device_labels_changed(struct sst_refine_device *d)
{
    if (!d)
        return;
    sst_gpu_shared_lock(d->shared);
    d->stage++;
    d->band_rows = 0; /* another stage needs less, or others have given memory back */
    sst_gpu_shared_unlock(d->shared);
}

void sst_refine_device_forget(struct sst_refine_device *d)
{
    if (!d)
        return;
    sst_gpu_shared_lock(d->shared);
    refine_drop_views(d);
    d->band_rows = 0;
    sst_gpu_shared_unlock(d->shared);
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

    if (err == -ENOMEM && (refine_device_drop_kept(d) || sst_gpu_shared_make_room(d->shared, &d->user)))
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
                        const struct sst_map_f32 *entropies, enum sst_gpu_label_plane plane, int width, int top, int end)
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

/* @param planes  those that are wanted @return those that are to be uploaded */
static unsigned missing(const struct sst_refine_device *d, const struct refine_pixels *v, unsigned planes)
{
    planes &= ~(v->labels == d->stage ? 1U << SST_GPU_PLANE_LABELS : 0U);
    planes &= ~(v->colours ? 1U << SST_GPU_PLANE_COLOURS : 0U);
    return planes & ~(v->entropies == d->stage ? 1U << SST_GPU_PLANE_ENTROPIES : 0U);
}

int refine_device_view(struct sst_refine_device *d, const struct sst_lightfield *lf, int view, unsigned planes,
                       const struct sst_map_f32 *entropies)
{
    const size_t plane = (size_t)lf->width * (size_t)lf->height * sizeof(uint32_t), bytes = (entropies ? 3 : 2) * plane;
    struct refine_pixels *v = &d->view[view];
    const int64_t start_ns = sst_clock_now_ns();
    int err = 0;

    if (v->buffer && v->bytes != 3 * plane && v->bytes != bytes) /* of another size, or lacks the entropies */
        drop_view(d, view);
    if (!v->buffer)
        err = create_view(d, v, bytes);
    v->used = d->turn;
    planes = missing(d, v, planes | (entropies ? 1U << SST_GPU_PLANE_ENTROPIES : 0U));
    d->report.uploads += planes != 0;
    err = err ? err : upload_rows(d, v->buffer, &lf->views[view], entropies, planes, lf->width, 0, lf->height);
    if (err) {
        drop_view(d, view);
    } else {
        v->labels = planes >> SST_GPU_PLANE_LABELS & 1 ? d->stage : v->labels;
        v->colours = v->colours || planes >> SST_GPU_PLANE_COLOURS & 1;
        v->entropies = planes >> SST_GPU_PLANE_ENTROPIES & 1 ? d->stage : v->entropies;
    }
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
