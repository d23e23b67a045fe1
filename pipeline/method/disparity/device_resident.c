/* What stays of the views on a device while they are matched, and for the labels afterwards: colours, and the maps as
 * steps leave them. Steps read it in words of their own, which the device makes. What does not stay, for lack of room
 * or since the CPU changed it, is uploaded for the view in work. */
#include <errno.h>
#include <string.h>

#include "pipeline/gpu/convert.h"
#include "pipeline/method/disparity/disparity_internal.h"

_Static_assert(SST_MAX_VIEWS <= SST_GPU_RESIDENT_VIEWS, "a plane each");

static struct sst_gpu_residents *residents_of(struct sst_disparity_device *d)
{
    return sst_gpu_shared_residents(d->shared);
}

void disparity_device_claim(struct sst_disparity_device *d, const struct disparity_run *run)
{
    struct sst_gpu_residents *r;

    if (!d)
        return;
    disparity_device_resume(d);
    r = residents_of(d);
    sst_gpu_resident_claim(r, d->gpu, run->lf);
    for (int k = 0; k < SST_MAX_VIEWS; k++) {
        if (r->scale != run->scale)
            sst_gpu_resident_drop(r, d->gpu, SST_GPU_RESIDENT_REDUCED, k);
        sst_gpu_resident_drop(r, d->gpu, SST_GPU_RESIDENT_MAPS, k);
    }
    r->scale = run->scale;
    d->lf = run->lf;
    d->stays = run->cfg->stays;
    disparity_device_end(d);
}

void sst_disparity_device_forget(struct sst_disparity_device *d)
{
    if (!d)
        return;
    disparity_device_resume(d);
    sst_gpu_resident_claim(residents_of(d), d->gpu, NULL);
    d->lf = NULL;
    disparity_device_end(d);
}

static void drop_map(struct sst_disparity_device *d, int view)
{
    sst_gpu_resident_drop(residents_of(d), d->gpu, SST_GPU_RESIDENT_MAPS, view);
}

void disparity_device_map_changed(struct sst_disparity_device *d, int view)
{
    if (!d)
        return;
    disparity_device_resume(d);
    drop_map(d, view);
    disparity_device_end(d);
}

bool disparity_device_drop_unused(struct sst_disparity_device *d)
{
    return sst_gpu_resident_drop_unused(residents_of(d), d->gpu);
}

void disparity_device_next_view(struct sst_disparity_device *d)
{
    residents_of(d)->turn++;
}

struct sst_gpu_buffer *disparity_device_find(struct sst_disparity_device *d, enum sst_gpu_resident which, int view)
{
    return sst_gpu_resident_find(residents_of(d), d->lf, which, view);
}

int disparity_device_convert(struct sst_disparity_device *d, struct sst_gpu_convert push,
                             struct sst_gpu_buffer *colours, struct sst_gpu_buffer *map, struct sst_gpu_buffer *from,
                             struct sst_gpu_buffer *to)
{
    struct sst_gpu_buffer *any = colours ? colours : map ? map : from;
    const struct sst_gpu_work work = { .shader = SST_GPU_CONVERT,
                                       .push = &push,
                                       .buffer = { colours ? colours : any, map ? map : any, from ? from : any, to },
                                       .groups = { (uint32_t)(push.width + 31) / 32, (uint32_t)(push.height + 7) / 8,
                                                   1 } };

    d->report.dispatches++;
    return sst_gpu_dispatch(d->gpu, &work);
}

/* --- colours ------------------------------------------------------------------------------------------------------ */

static int upload_colours(struct sst_disparity_device *d, struct sst_gpu_buffer *to, const struct sst_image *image,
                          const struct sst_map_u8 *mask)
{
    const size_t n = (size_t)image->width * (size_t)image->height;
    uint32_t *words = sst_mem_keep(&d->words, n, sizeof(*words));

    if (!words)
        return -ENOMEM;
    for (int y = 0; y < image->height; y++) {
        const uint8_t *r = sst_image_row(image, 0, y), *g = sst_image_row(image, 1, y);
        const uint8_t *b = sst_image_row(image, 2, y);
        const uint8_t *seen = mask && mask->data ? sst_map_u8_row(mask, y) : NULL;
        uint32_t *row = words + (size_t)y * (size_t)image->width;

        for (int x = 0; x < image->width; x++)
            row[x] = (uint32_t)(r[x] | g[x] << 8 | b[x] << 16) | (!seen || seen[x] ? 0xFF000000U : 0);
    }
    d->report.uploads++;
    return disparity_device_upload(d, to, words, n * sizeof(*words));
}

/* Memory for a plane that stays, or for this view alone. @param which  scratch; KEPT: there is none, and views that are
 * not in use make room */
static int make_plane(struct sst_disparity_device *d, enum sst_gpu_resident plane, int view, size_t n,
                      enum device_kept which, struct sst_gpu_buffer **out)
{
    int err = which == KEPT ? disparity_device_create_buffer(d, out, n * sizeof(uint32_t), NULL)
                            : sst_gpu_buffer_create(d->gpu, out, n * sizeof(uint32_t));

    if (!err)
        sst_gpu_resident_put(residents_of(d), d->gpu, plane, view, *out);
    if (err == -ENOMEM && which != KEPT) {
        err = disparity_device_keep(d, which, n, sizeof(uint32_t));
        *out = d->kept[which];
    }
    return err;
}

/* Half of the colours that stay for the labels, where there is room for both. @return -ENOMEM: there is none */
static int halve_colours(struct sst_disparity_device *d, int view, int width, int height, struct sst_gpu_buffer *to)
{
    const struct sst_view *v = &d->lf->views[view];
    const struct sst_gpu_convert push = {
        .width = width, .height = height, .full_width = d->lf->width, .full_height = d->lf->height
    };
    struct sst_gpu_buffer *full = disparity_device_find(d, SST_GPU_RESIDENT_COLOURS, view);
    int err = 0;

    if (!full) {
        const size_t n = (size_t)d->lf->width * (size_t)d->lf->height;

        err = sst_gpu_buffer_create(d->gpu, &full, n * sizeof(uint32_t));
        if (err)
            return err;
        sst_gpu_resident_put(residents_of(d), d->gpu, SST_GPU_RESIDENT_COLOURS, view, full);
        err = upload_colours(d, full, &v->image, &v->valid);
        if (err)
            sst_gpu_resident_drop(residents_of(d), d->gpu, SST_GPU_RESIDENT_COLOURS, view);
    }
    return err ? err : disparity_device_convert(d, push, full, NULL, NULL, to);
}

int disparity_device_colours(struct sst_disparity_device *d, const struct device_view *v, struct sst_gpu_buffer **out)
{
    const int scale = residents_of(d)->scale;
    const enum sst_gpu_resident which = scale == 1 ? SST_GPU_RESIDENT_COLOURS : SST_GPU_RESIDENT_REDUCED;
    const size_t n = (size_t)v->width * (size_t)v->height;
    struct sst_image half = { 0 };
    const struct sst_image *image = v->image;
    int err;

    *out = disparity_device_find(d, which, v->view);
    if (*out)
        return 0;
    err = make_plane(d, which, v->view, n, v->stays ? KEPT : KEPT_COLOURS, out);
    if (err)
        return err;
    err = scale == 1 || !d->stays ? -ENOMEM : halve_colours(d, v->view, v->width, v->height, *out);
    if (err == -ENOMEM) {
        err = image->width == v->width && image->height == v->height ? 0 : sst_image_halve(&half, image);
        err = err ? err : upload_colours(d, *out, half.width ? &half : image, v->seen);
        sst_image_fini(&half);
    }
    if (err)
        sst_gpu_resident_drop(residents_of(d), d->gpu, which, v->view);
    return err;
}

/* --- features ----------------------------------------------------------------------------------------------------- */

#define PLENTY 4 /* times the features of a view: less is left to the volume */

/* Use the device on which a network runs. @return false: it is another one, or refuses the shader */
static bool borrow_device(const struct sst_feature_keeper *k, struct sst_gpu *g)
{
    const struct disparity_feature_run *of = k->arg;
    struct sst_disparity_device *d = of->device;

    if (g != sst_gpu_shared_device(d->shared) || sst_gpu_prepare(g, SST_GPU_CONVERT))
        return false;
    d->gpu = g;
    if (d->run != of->run)
        disparity_device_drop_views(d);
    d->run = of->run;
    return true;
}

/* True if there is room for the features of all views that have none yet, beside the volume and what else there is. */
static bool all_fit(const struct sst_disparity_device *d, size_t bytes)
{
    const struct disparity_run *run = d->run;
    const size_t pixels = (size_t)run->width * (size_t)run->height;
    size_t left = PLENTY;

    for (int k = 0; k < run->lf->rows * run->lf->cols; k++)
        left += run->lf->views[k].present && !d->view[k].features;
    return sst_gpu_free_bytes(d->gpu) >= left * bytes + 4 * pixels * (size_t)(run->shape.steps + 64);
}

bool disparity_device_keep_features(void *keeper, struct sst_gpu *g, struct sst_gpu_buffer *result, size_t at)
{
    struct sst_feature_keeper *k = keeper;
    const struct disparity_feature_run *of = k->arg;
    struct sst_disparity_device *d = of->device;
    struct device_pixels *p = &d->view[k->view];
    const int words = k->width * SST_GPU_FEATURE_WORDS, first = k->band.first, rows = k->band.end - first;
    const size_t bytes = (size_t)words * (size_t)k->height * sizeof(uint32_t);
    const struct sst_gpu_convert push = { .width = words,
                                          .height = rows,
                                          .full_width = k->width,
                                          .conversion = SST_GPU_TO_FEATURES,
                                          .from = (uint32_t)(at + (size_t)(first - k->band.start) * (size_t)words),
                                          .to = (uint32_t)((size_t)first * (size_t)words) };

    if (!borrow_device(k, g))
        return false;
    if (!first) {
        p->rows = 0;
        p->only = all_fit(d, bytes);
    }
    if (!first && !p->features &&
        (sst_gpu_free_bytes(g) < PLENTY * bytes || sst_gpu_buffer_create(g, &p->features, bytes)))
        p->features = NULL;
    if (!p->features || p->rows != first || disparity_device_convert(d, push, NULL, NULL, result, p->features))
        return false;
    p->rows = k->band.end;
    k->kept = p->only;
    return p->only;
}

bool disparity_device_feed(void *keeper, struct sst_gpu *g, struct sst_gpu_buffer *input, size_t at)
{
    const struct sst_feature_keeper *k = keeper;
    const struct disparity_feature_run *of = k->arg;
    struct sst_disparity_device *d = of->device;
    const struct sst_descriptor *desc = &of->run->desc[k->view];
    const struct device_view v = {
        .view = k->view, .width = k->width, .height = k->height, .image = &desc->image, .seen = &desc->seen
    };
    const struct sst_gpu_convert push = { .width = k->width,
                                          .height = k->rows,
                                          .conversion = SST_GPU_TO_LEVELS,
                                          .colours = (uint32_t)k->band.start * (uint32_t)k->width,
                                          .to = (uint32_t)at };
    struct sst_gpu_buffer *colours;
    int err;

    if (!borrow_device(k, g) || d->lf != of->run->lf ||
        sst_gpu_free_bytes(g) < PLENTY * sizeof(uint32_t) * (size_t)d->lf->width * (size_t)d->lf->height)
        return false;
    d->borrowed = true;
    err = disparity_device_keep(d, KEPT_LEVELS, 256, sizeof(*k->level));
    err = err ? err : disparity_device_colours(d, &v, &colours);
    err = err ? err : disparity_device_upload(d, d->kept[KEPT_LEVELS], k->level, 256 * sizeof(*k->level));
    err = err ? err : disparity_device_convert(d, push, colours, NULL, d->kept[KEPT_LEVELS], input);
    d->borrowed = false;
    return !err;
}

bool disparity_device_has_features(struct sst_disparity_device *d, const struct disparity_run *run, int view)
{
    bool has;

    if (!d)
        return false;
    sst_gpu_shared_lock(d->shared);
    has = d->run == run && d->view[view].features && d->view[view].rows == run->height;
    sst_gpu_shared_unlock(d->shared);
    return has;
}

/* --- maps --------------------------------------------------------------------------------------------------------- */

static int upload_map(struct sst_disparity_device *d, struct sst_gpu_buffer *to, const struct device_view *v)
{
    const size_t n = (size_t)v->width * (size_t)v->height;
    uint32_t *words = sst_mem_keep(&d->words, n, sizeof(*words)), *word = words;

    if (!words)
        return -ENOMEM;
    for (int y = 0; y < v->height; y++) {
        const uint16_t *disp = sst_map_u16_row(v->disp, y);
        const uint8_t *confidence = sst_map_u8_row(v->confidence, y);
        const uint8_t *agreed = v->agreed && v->agreed->data ? sst_map_u8_row(v->agreed, y) : NULL;

        for (int x = 0; x < v->width; x++)
            *word++ =
                disp[x] | (uint32_t)confidence[x] << 16 | (agreed && agreed[x] ? (uint32_t)SST_GPU_MAP_AGREED : 0);
    }
    d->report.uploads++;
    return disparity_device_upload(d, to, words, n * sizeof(*words));
}

int disparity_device_map(struct sst_disparity_device *d, const struct device_view *v, struct sst_gpu_buffer **out)
{
    int err;

    *out = disparity_device_find(d, SST_GPU_RESIDENT_MAPS, v->view);
    if (*out)
        return 0;
    err = make_plane(d, SST_GPU_RESIDENT_MAPS, v->view, (size_t)v->width * (size_t)v->height, KEPT_VIEW_MAP, out);
    err = err ? err : upload_map(d, *out, v);
    if (err)
        drop_map(d, v->view);
    return err;
}

int disparity_device_store(struct sst_disparity_device *d, int view, struct sst_gpu_convert push,
                           struct sst_gpu_buffer *colours, struct sst_gpu_buffer *from)
{
    struct sst_gpu_buffer *map = disparity_device_find(d, SST_GPU_RESIDENT_MAPS, view);
    const bool whole = push.conversion == SST_GPU_FROM_MATCH || push.conversion == SST_GPU_FROM_SOURCES;
    int err = 0;

    if (!map && !whole)
        return 0;
    if (!map) {
        err = sst_gpu_buffer_create(d->gpu, &map, (size_t)push.width * (size_t)push.height * sizeof(uint32_t));
        if (!err)
            sst_gpu_resident_put(residents_of(d), d->gpu, SST_GPU_RESIDENT_MAPS, view, map);
    }
    err = err ? err : disparity_device_convert(d, push, colours, NULL, from, map);
    if (err)
        drop_map(d, view);
    return err == -ENOMEM ? 0 : err; /* what does not stay is uploaded again */
}

static int fill_background(struct sst_disparity_device *d, int view, int width, int height, bool last)
{
    const size_t n = (size_t)width * (size_t)height;
    const struct sst_gpu_background push = { width, height };
    const struct sst_gpu_convert plain = { .width = width, .height = height, .conversion = SST_GPU_TO_PLAIN };
    const struct sst_gpu_convert filled = { .width = width,
                                            .height = height,
                                            .conversion = last ? SST_GPU_FROM_FILLED : SST_GPU_FROM_PLAIN };
    struct sst_gpu_buffer *map = disparity_device_find(d, SST_GPU_RESIDENT_MAPS, view);
    struct sst_gpu_work work = { .shader = SST_GPU_FILL_ALONG,
                                 .push = &push,
                                 .groups = { (uint32_t)(width + 31) / 32, (uint32_t)(height + 7) / 8, 1 } };
    int err;

    if (!map)
        return 0;
    err = disparity_device_keep(d, KEPT_MAP, n, sizeof(uint32_t));
    err = err ? err : disparity_device_keep(d, KEPT_FILTERED, n, sizeof(uint32_t));
    err = err ? err : disparity_device_convert(d, plain, NULL, map, NULL, d->kept[KEPT_MAP]);
    for (int i = 0; i < 2 && !err; i++) {
        work.buffer[SST_GPU_BACKGROUND_FROM] = d->kept[i ? KEPT_FILTERED : KEPT_MAP];
        work.buffer[SST_GPU_BACKGROUND_TO] = d->kept[i ? KEPT_MAP : KEPT_FILTERED];
        d->report.dispatches++;
        err = sst_gpu_dispatch(d->gpu, &work);
        work.shader = SST_GPU_FILL_DOWN;
    }
    return err ? err : disparity_device_store(d, view, filled, NULL, d->kept[KEPT_MAP]);
}

int disparity_device_background(struct sst_disparity_device *d, int view, int width, int height)
{
    const int err = fill_background(d, view, width, height, false);

    if (err)
        drop_map(d, view);
    return err == -ENOMEM ? 0 : err;
}

void disparity_device_fill_all(struct sst_disparity_device *d, const struct disparity_run *run)
{
    const int views = run->lf->rows * run->lf->cols;
    int err = 0;

    if (!d)
        return;
    disparity_device_resume(d);
    for (int k = 0; k < views && !err && d->gpu; k++) {
        disparity_device_next_view(d);
        err = fill_background(d, k, run->width, run->height, true);
        if (err)
            drop_map(d, k);
        err = err == -ENOMEM ? 0 : err;
    }
    if (err)
        disparity_device_fail(d, err);
    disparity_device_end(d);
}
