/* What stays of the views on a device while they are matched: colours, and the maps as
 * steps leave them. Steps read it in words of their own, which the device makes. What does not stay, for lack of room
 * or since the CPU changed it, is uploaded for the view in work. */
#include <errno.h>
#include <string.h>

#include "pipeline/gpu/convert.h"
#include "pipeline/method/disparity/disparity_internal.h"

_Static_assert(SST_MAX_VIEWS <= SST_PLANE_VIEWS, "a place each");

#define PLACES 8 /* views that are needed at once: fewer are a last resort */

static struct sst_step_planes *planes_of(struct sst_disparity_device *d)
{
    return sst_runner_planes(d->shared);
}

void disparity_device_claim(struct sst_disparity_device *d, const struct disparity_run *run)
{
    const size_t matched = (size_t)run->width * (size_t)run->height;
    const size_t pixels[SST_PLANES] = { (size_t)run->lf->width * (size_t)run->lf->height, matched, matched };
    struct sst_step_planes *p;

    if (!d)
        return;
    disparity_device_resume(d);
    p = planes_of(d);
    sst_step_planes_claim(p, d->gpu, run->lf, run->lf->rows * run->lf->cols, run->scale, pixels);
    for (int k = 0; k < p->views; k++)
        sst_step_plane_mark(p, SST_PLANE_MAP, k, false);
    d->lf = run->lf;
    disparity_device_end(d);
}

void disparity_device_adopt(struct sst_disparity_device *d, const struct sst_visible_views *in)
{
    size_t pixels[SST_PLANES] = { 0 };

    if (!d || d->lf)
        return;
    for (int k = 0; k < in->count; k++) {
        if (in->view[k].image)
            pixels[SST_PLANE_MAP] = (size_t)in->view[k].disp->width * (size_t)in->view[k].disp->height;
    }
    pixels[SST_PLANE_COLOUR] = pixels[SST_PLANE_REDUCED] = pixels[SST_PLANE_MAP];
    disparity_device_resume(d);
    sst_step_planes_claim(planes_of(d), d->gpu, in, in->count, 1, pixels);
    for (int k = 0; k < in->count; k++)
        sst_step_plane_mark(planes_of(d), SST_PLANE_MAP, k, false);
    disparity_device_end(d);
}

void disparity_device_unclaim(struct sst_disparity_device *d)
{
    static const size_t none[SST_PLANES];

    sst_step_planes_claim(planes_of(d), d->gpu, NULL, 0, 1, none);
    d->lf = NULL;
}

static void drop_map(struct sst_disparity_device *d, int view)
{
    sst_step_plane_mark(planes_of(d), SST_PLANE_MAP, view, false);
}

void disparity_device_map_changed(struct sst_disparity_device *d, int view)
{
    if (d)
        sst_run_changed(&d->user, view, 1U << SST_PLANE_MAP);
}

bool disparity_device_drop_unused(struct sst_disparity_device *d)
{
    return sst_step_planes_trim(planes_of(d), d->gpu, -1);
}

void disparity_device_next_view(struct sst_disparity_device *d)
{
    planes_of(d)->turn++;
}

struct sst_gpu_range disparity_device_find(struct sst_disparity_device *d, enum sst_step_plane plane, int view)
{
    return planes_of(d)->of == d->lf && d->lf ? sst_step_plane_find(planes_of(d), plane, view) : NO_RANGE;
}

int disparity_device_convert(struct sst_disparity_device *d, struct sst_gpu_convert push, struct sst_gpu_range colours,
                             struct sst_gpu_range map, struct sst_gpu_range from, struct sst_gpu_range to)
{
    const struct sst_gpu_range any = colours.buffer ? colours : map.buffer ? map : from;
    const struct sst_gpu_range range[] = { colours.buffer ? colours : any, map.buffer ? map : any,
                                           from.buffer ? from : any, to };
    struct sst_gpu_work work = { .shader = SST_GPU_CONVERT,
                                 .push = &push,
                                 .groups = { (uint32_t)(push.width + 31) / 32, (uint32_t)(push.height + 7) / 8, 1 } };

    for (size_t i = 0; i < ARRAY_LEN(range); i++) {
        work.buffer[i] = range[i].buffer;
        work.offset[i] = range[i].offset;
    }
    d->report.dispatches++;
    return sst_gpu_dispatch(d->gpu, &work);
}

/* --- colours ------------------------------------------------------------------------------------------------------ */

static int upload_words(struct sst_disparity_device *d, struct sst_gpu_range to, enum sst_step_plane plane,
                        const struct sst_plane_source *from)
{
    const size_t n = from->image ? (size_t)from->image->width * (size_t)from->image->height
                                 : (size_t)from->disp->width * (size_t)from->disp->height;
    uint32_t *words = sst_mem_keep(&d->words, n, sizeof(*words));

    if (!words)
        return -ENOMEM;
    sst_step_plane_pack(words, plane, from, 0, from->image ? from->image->height : from->disp->height);
    d->report.uploads++;
    return disparity_device_upload_at(d, to.buffer, to.offset, words, n * sizeof(*words));
}

/* A place for a view, which has none or an old one. @param room  unused planes make room */
static int make_place(struct sst_disparity_device *d, enum sst_step_plane plane, int view, bool room,
                      struct sst_gpu_range *out)
{
    struct sst_step_planes *p = planes_of(d);
    const int most = sst_min_int(p->views, PLACES);
    int err = 0;

    *out = sst_step_plane_place(p, plane, view);
    if (out->buffer)
        return 0;
    if (sst_step_plane_used(p, plane))
        return -ENOMEM;
    err = sst_step_plane_create(p, d->gpu, plane, most);
    if (err == -ENOMEM && room && !d->borrowed && disparity_device_make_room(d, plane))
        err = sst_step_plane_create(p, d->gpu, plane, most);
    if (err == -ENOMEM)
        err = sst_step_plane_create(p, d->gpu, plane, 1);
    *out = err ? NO_RANGE : sst_step_plane_place(p, plane, view);
    return err;
}

/* Memory for a plane that stays, or for this view alone. @param which  scratch; KEPT: there is none */
static int make_plane(struct sst_disparity_device *d, enum sst_step_plane plane, int view, size_t n,
                      enum device_kept which, struct sst_gpu_range *out)
{
    int err = make_place(d, plane, view, which == KEPT, out);

    if (!err)
        sst_step_plane_mark(planes_of(d), plane, view, true);
    if (err == -ENOMEM && which != KEPT) {
        err = disparity_device_keep(d, which, n, sizeof(uint32_t));
        *out = W(d->kept[which]);
    }
    return err;
}

int disparity_device_colours(struct sst_disparity_device *d, const struct device_view *v, struct sst_gpu_range *out)
{
    const int scale = planes_of(d)->scale;
    const enum sst_step_plane plane = scale == 1 ? SST_PLANE_COLOUR : SST_PLANE_REDUCED;
    const size_t n = (size_t)v->width * (size_t)v->height;
    struct sst_image half = { 0 };
    const struct sst_image *image = v->image;
    int err;

    *out = disparity_device_find(d, plane, v->view);
    if (out->buffer)
        return 0;
    err = make_plane(d, plane, v->view, n, v->stays ? KEPT : KEPT_COLOURS, out);
    if (err)
        return err;
    err = image->width == v->width && image->height == v->height ? 0 : sst_image_halve(&half, image);
    err = err ? err
              : upload_words(d, *out, plane,
                             &(struct sst_plane_source){ .image = half.width ? &half : image, .seen = v->seen });
    sst_image_fini(&half);
    if (err)
        sst_step_plane_mark(planes_of(d), plane, v->view, false);
    return err;
}

/* --- features ----------------------------------------------------------------------------------------------------- */

#define PLENTY 4 /* times the features of a view: less is left to the volume */

/* Use the device on which a network runs. @return false: it is another one, or refuses the shader */
static bool borrow_device(const struct sst_feature_keeper *k, struct sst_gpu *g)
{
    const struct disparity_feature_run *of = k->arg;
    struct sst_disparity_device *d = of->device;

    if (g != sst_runner_device(d->shared) || sst_gpu_prepare(g, SST_GPU_CONVERT))
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
    if (!p->features || p->rows != first ||
        disparity_device_convert(d, push, NO_RANGE, NO_RANGE, W(result), W(p->features)))
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
    struct sst_gpu_range colours;
    int err;

    if (!borrow_device(k, g) || d->lf != of->run->lf ||
        sst_gpu_free_bytes(g) < PLENTY * sizeof(uint32_t) * (size_t)d->lf->width * (size_t)d->lf->height)
        return false;
    d->borrowed = true;
    err = disparity_device_keep(d, KEPT_LEVELS, 256, sizeof(*k->level));
    err = err ? err : disparity_device_colours(d, &v, &colours);
    err = err ? err : disparity_device_upload(d, d->kept[KEPT_LEVELS], k->level, 256 * sizeof(*k->level));
    err = err ? err : disparity_device_convert(d, push, colours, NO_RANGE, W(d->kept[KEPT_LEVELS]), W(input));
    d->borrowed = false;
    return !err;
}

bool disparity_device_has_features(struct sst_disparity_device *d, const struct disparity_run *run, int view)
{
    bool has;

    if (!d)
        return false;
    sst_runner_lock(d->shared);
    has = d->run == run && d->view[view].features && d->view[view].rows == run->height;
    sst_runner_unlock(d->shared);
    return has;
}

/* --- maps --------------------------------------------------------------------------------------------------------- */

int disparity_device_map(struct sst_disparity_device *d, const struct device_view *v, struct sst_gpu_range *out)
{
    const struct sst_plane_source from = { .disp = v->disp, .confidence = v->confidence, .agreed = v->agreed };
    int err;

    *out = disparity_device_find(d, SST_PLANE_MAP, v->view);
    if (out->buffer)
        return 0;
    err = make_plane(d, SST_PLANE_MAP, v->view, (size_t)v->width * (size_t)v->height, KEPT_VIEW_MAP, out);
    err = err ? err : upload_words(d, *out, SST_PLANE_MAP, &from);
    if (err)
        drop_map(d, v->view);
    return err;
}

int disparity_device_store(struct sst_disparity_device *d, int view, struct sst_gpu_convert push,
                           struct sst_gpu_range colours, struct sst_gpu_buffer *from)
{
    struct sst_gpu_range map = disparity_device_find(d, SST_PLANE_MAP, view);
    const bool whole = push.conversion == SST_GPU_FROM_MATCH;
    int err = 0;

    if (!map.buffer && !whole)
        return 0;
    if (!map.buffer) {
        err = make_place(d, SST_PLANE_MAP, view, false, &map);
        sst_step_plane_mark(planes_of(d), SST_PLANE_MAP, view, !err);
    }
    err = err ? err : disparity_device_convert(d, push, colours, NO_RANGE, W(from), map);
    if (err)
        drop_map(d, view);
    return err == -ENOMEM ? 0 : err; /* what does not stay is uploaded again */
}
