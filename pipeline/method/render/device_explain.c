/* What the maps explain, on a device (SST_VERIFY_AUTO): colours of views are compared with those around them, which the
 * shaders read from one buffer. Where the views lie in several, it is a buffer with rows of all views: those that some
 * rows of the picture need.
 *
 *      view                          view around it
 *      from + ny                     from + ny + least        a ray of disparity px moves by px * by rows,
 *         .   rays of the rows          .                     between those of the smallest and of the largest
 *      end + ny                      end + ny + most          disparity that is compared
 *
 * So pictures whose views do not fit are verified in parts of their rows, each with an upload of its own. */
#include <errno.h>
#include <math.h>
#include <stdlib.h>

#include "pipeline/method/render/device_internal.h"

/* Stored disparities that pictures may have. */
static size_t disp_values(const struct render_device *d, const struct device_batch *b)
{
    return d->changes ? SST_DISP_NONE : (size_t)explainer_bins(b->p->explainer);
}

/* Rows of the views, top .. end - 1. */
struct reach {
    int top[SST_MAX_VIEWS], end[SST_MAX_VIEWS];
};

/* --- rows that a part of the picture needs ------------------------------------------------------------------------*/

/* Add the rows top .. end - 1 of a view. */
static void widen(struct reach *r, int k, double top, double end, int height)
{
    const int first = (int)sst_clamp_double(floor(top), 0, height), last = (int)sst_clamp_double(ceil(end), 0, height);

    if (first >= last)
        return;
    r->top[k] = r->top[k] < r->end[k] ? sst_min_int(r->top[k], first) : first;
    r->end[k] = sst_max_int(r->end[k], last);
}

/* What the rows from .. end - 1 of the picture need: rays between two rows, and around them places between two. */
static void find_reach(struct reach *r, const struct render_device *d, const struct device_batch *b, int from, int end)
{
    const struct sst_render_plan *p = b->p;
    double least_px, most_px;
    const bool any = explainer_reach(p->explainer, p->numbers.nearest_end, &least_px, &most_px);

    *r = (struct reach){ .end = { 0 } };
    for (int k = 0; k < p->count; k++) {
        const struct sst_render_tap *t = &p->tap[k];
        const int y0 = sst_max_int(from, t->y0), y1 = sst_min_int(end, t->y1);
        struct sst_gpu_verify_near near[SST_GPU_VERIFY_AROUND];
        const int around = any ? explainer_around(p->explainer, k, near) : 0;

        if (t->x0 >= t->x1 || y0 >= y1)
            continue;
        widen(r, k, y0 + sst_min_int(t->iy, t->ny), y1 + sst_max_int(t->iy, t->ny) + 1, d->lf->height);
        for (int i = 0; i < around; i++) {
            const double moves[2] = { least_px * (double)near[i].by, most_px * (double)near[i].by };

            widen(r, (int)near[i].view, y0 + t->ny + fmin(moves[0], moves[1]) - 1,
                  y1 + t->ny + fmax(moves[0], moves[1]) + 2, d->lf->height);
        }
    }
}

static size_t pixels_of(const struct reach *r, const struct render_device *d, int count)
{
    size_t rows = 0;

    for (int k = 0; k < count; k++)
        rows += (size_t)(r->end[k] - r->top[k]);
    return rows * (size_t)d->pitch;
}

/* --- room --------------------------------------------------------------------------------------------------------- */

/* Pixels that any 8 rows of the picture need. */
static size_t least_pixels(const struct render_device *d, const struct device_batch *b)
{
    size_t least = 0;

    for (int y = 0; y < d->lf->height; y += SST_RENDER_CELL_HEIGHT) {
        struct reach r;
        size_t n;

        find_reach(&r, d, b, y, sst_min_int(y + SST_RENDER_CELL_HEIGHT, d->lf->height));
        n = pixels_of(&r, d, b->p->count);
        least = n > least ? n : least;
    }
    return least;
}

/* A buffer for rows of all views: a quarter of the free memory, or twice the rows that one part of the picture needs if
 * that is more, so that at most half of them are uploaded again for the next part. One view has to fit beside it.
 * @return -ENOMEM: views are in the way; -EOVERFLOW: there is no room */
static int make_near(struct render_device *d, const struct device_batch *b)
{
    const double all = (double)b->p->count * (double)device_view_pixels(d);
    const double room = (double)sst_gpu_free_bytes(d->gpu) / (DEVICE_PIXEL_BYTES + 1);
    const double largest = fmin((double)(sst_gpu_get_info(d->gpu)->buffer_bytes / 4), all);
    struct device_verify *v = &d->verify;
    double least;
    int err;

    if (v->near_views.pixels)
        return 0;
    if (d->slots)
        return -ENOMEM; /* they may use all the memory */
    least = (double)least_pixels(d, b);
    v->near_pixels = (size_t)fmin(fmax(room / 4, fmin(2 * least, room - (double)device_view_pixels(d))), largest);
    if ((double)v->near_pixels < least)
        return -EOVERFLOW;
    err = device_create_chunk(d, &v->near_views, v->near_pixels, false);
    return err == -ENOMEM ? -EOVERFLOW : err;
}

int device_make_explained(struct render_device *d, const struct device_batch *b)
{
    const uint64_t pixels = (uint64_t)b->p->count * device_view_pixels(d);
    struct device_verify *v = &d->verify;
    int err = 0;

    v->split =
        v->split || 4 * pixels > sst_gpu_get_info(d->gpu)->buffer_bytes || DEVICE_PIXEL_BYTES * pixels > d->limit_bytes;
    if (!v->views)
        err = sst_gpu_buffer_create(d->gpu, &v->views, SST_MAX_VIEWS * sizeof(struct sst_gpu_verify_view));
    if (!err && !v->disp_px) {
        err = sst_gpu_buffer_create(d->gpu, &v->disp_px, disp_values(d, b) * sizeof(float));
        v->disp_min_px = NAN;
    }
    if (err == -ENOMEM && !d->slots)
        return -EOVERFLOW;
    return err || !v->split ? err : make_near(d, b);
}

/* Disparities in pixels by what is stored, as explainer_contradicts() has them. */
static int upload_disp_px(struct render_device *d, const struct device_batch *b)
{
    const size_t n = disp_values(d, b);
    float *px;
    int err;

    if (!isnan(d->verify.disp_min_px) && !(fabs(d->verify.disp_min_px - d->lf->disp_min_px) > 0))
        return 0;
    px = malloc(n * sizeof(*px));
    if (!px)
        return -ENOMEM;
    for (size_t i = 0; i < n; i++)
        px[i] = (float)sst_disp_px(d->lf, (uint16_t)i);
    err = sst_gpu_upload(d->gpu, d->verify.disp_px, 0, px, n * sizeof(*px));
    free(px);
    if (!err)
        d->verify.disp_min_px = d->lf->disp_min_px;
    return err;
}

/* --- all views in one chunk --------------------------------------------------------------------------------------- */

/* Only have the views there. */
static int send_nothing(struct render_device *d, struct device_batch *b, bool last SST_UNUSED)
{
    device_batch_sent(d, b);
    return 0;
}

/* Have all views in one buffer. @return -EXDEV: they do not fit */
static int gather_views(struct render_device *d, struct device_batch *b)
{
    int chunk = -1, err = 0;

    b->send = send_nothing;
    b->begun = false;
    for (int k = 0; k < b->p->count && !err; k++)
        err = device_add_tap(d, b, k);
    device_batch_sent(d, b);
    for (int k = 0; k < b->p->count && !err; k++) {
        const struct device_slot *s = device_find_slot(d, b->p->tap[k].view);

        if (!s || (chunk >= 0 && s->chunk != chunk))
            err = -EXDEV;
        else
            chunk = s->chunk;
    }
    return err;
}

/* Upload where the views are and those around them. @param first  pixel (0, 0) of each */
static int upload_around(struct render_device *d, const struct device_batch *b, const uint32_t *first)
{
    struct sst_gpu_verify_view *view = calloc((size_t)b->p->count, sizeof(*view));
    int err = view ? 0 : -ENOMEM;

    for (int k = 0; k < b->p->count && !err; k++) {
        view[k].at = device_describe_tap(d, b, k, first[k]);
        view[k].around = (uint32_t)explainer_around(b->p->explainer, k, view[k].near);
    }
    if (!err)
        err = sst_gpu_upload(d->gpu, d->verify.views, 0, view, (size_t)b->p->count * sizeof(*view));
    free(view);
    return err;
}

static int place_whole(struct render_device *d, struct device_batch *b)
{
    uint32_t first[SST_MAX_VIEWS];
    int err = gather_views(d, b);

    for (int k = 0; k < b->p->count && !err; k++)
        first[k] = device_slot_first(d, device_find_slot(d, b->p->tap[k].view));
    return err ? err : upload_around(d, b, first);
}

/* --- rows of all views -------------------------------------------------------------------------------------------- */

/* Upload these rows, one view behind the other. */
static int upload_reach(struct render_device *d, const struct device_batch *b, const struct reach *r)
{
    uint32_t first[SST_MAX_VIEWS];
    size_t at = 0;
    int err = 0;

    for (int k = 0; k < b->p->count && !err; k++) {
        const struct device_rows rows = {
            .v = b->p->tap[k].v, .top = r->top[k], .end = r->end[k], .colours = true, .labels = true
        };

        first[k] = (uint32_t)at - (uint32_t)(r->top[k] * d->pitch); /* modulo 2^32: rows before `top` are not read */
        if (rows.top == rows.end)
            continue;
        err = device_upload_rows(d, &d->verify.near_views, at, &rows, b->taps.threads);
        at += (size_t)(r->end[k] - r->top[k]) * (size_t)d->pitch;
        d->report.uploads++;
    }
    return err ? err : upload_around(d, b, first);
}

/* Have there what the rows from - beside .. to - 1 + beside need, and lower b->push.to to as many as there is room for,
 * some multiple of `step` rows. @return -EOVERFLOW: there is no room for one of these */
static int place_part(struct render_device *d, struct device_batch *b, int step, int beside)
{
    const int from = b->push.from;
    struct reach r;

    for (int to = b->push.to; to > from; to = from + (to - from - 1) / step * step) {
        find_reach(&r, d, b, from - beside, to + beside);
        if (pixels_of(&r, d, b->p->count) <= d->verify.near_pixels) {
            b->push.to = to;
            return upload_reach(d, b, &r);
        }
    }
    return -EOVERFLOW;
}

/* --- dispatches --------------------------------------------------------------------------------------------------- */

/* @param last  the last buffer of the shader */
static int dispatch_explained(struct render_device *d, const struct device_batch *b, enum sst_gpu_shader shader,
                              struct sst_gpu_buffer *last, int rows)
{
    const struct device_verify *v = &d->verify;
    const struct device_chunk *c = v->split ? &v->near_views : &d->chunk[device_find_slot(d, b->p->tap[0].view)->chunk];
    struct sst_gpu_verify push = b->push;

    push.nearest = b->p->numbers.nearest_end;
    push.levels = explainer_levels(b->p->explainer);
    return device_dispatch_verify(
        d, shader, &push,
        (struct sst_gpu_buffer *[]){ v->views, c->pixels, c->disp, c->valid, v->disp_px, v->share, last },
        SST_GPU_SCREEN_BUFFERS, rows);
}

int device_screen(struct render_device *d, struct device_batch *b)
{
    const int from = b->push.from, end = b->push.to;
    struct device_verify *v = &d->verify;
    int err = v->split ? 0 : place_whole(d, b);

    v->split = v->split || err == -EXDEV;
    if (!err)
        err = explainer_prepare(b->p->explainer);
    if (!err)
        err = upload_disp_px(d, b);
    while (!err && b->push.from < end) {
        b->push.to = end;
        if (v->split)
            err = place_part(d, b, SST_RENDER_CELL_HEIGHT, 0);
        if (!err)
            err = dispatch_explained(d, b, SST_GPU_VERIFY_SCREEN, v->cells, b->push.to - b->push.from);
        b->push.from = b->push.to;
    }
    b->push.from = from;
    b->push.to = end;
    return err;
}

int device_place_explained(struct render_device *d, struct device_batch *b)
{
    return d->verify.split ? place_part(d, b, 1, 1) : 0;
}

int device_find_unexplained(struct render_device *d, const struct device_batch *b, int rows)
{
    return dispatch_explained(d, b, SST_GPU_VERIFY_UNEXPLAINED, d->verify.totals, rows);
}
