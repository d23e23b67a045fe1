/* Raw frames of a light field, or what corrected pictures were resampled from: samplers for rays, and views that are
 * rectified when the CPU needs them. Shaders make their own from the frames. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "base/thread.h"
#include "pipeline/lightfield/correction.h"
#include "pipeline/method/render/render_internal.h"

struct frames_job {
    struct sst_renderer *r;
    const struct sst_render_plan *plan;
};

enum sst_filter render_frame_filter(const struct sst_lightfield *lf)
{
    return lf->images_raw ? (enum sst_filter)lf->filter : SST_CORRECTION_FILTER;
}

static int report(const struct sst_renderer *r, int view, int err)
{
    char name[16];

    if (!err || err == -EBADMSG) /* logged */
        return err;
    sst_view_name(r->lf, view, name);
    sst_log_error("cannot sample the frame of view %s: %s", name, strerror(-err));
    return err;
}

static int make_map(void *arg, int index, int worker SST_UNUSED)
{
    const struct frames_job *job = arg;
    const struct sst_lightfield *lf = job->r->lf;
    const int view = job->plan->tap[index].view;
    struct sst_raw_view *raw = &job->r->raw[view];
    int err = 0;

    if (raw->map)
        return 0;
    if (lf->images_raw)
        err = sst_rectify_map_create(&raw->map, lf->rectified, lf->calibration, view);
    else if (lf->views[view].original.plane[0])
        err = sst_correction_map(&raw->map, lf, view);
    return report(job->r, view, err);
}

static int make_sampler(struct sst_renderer *r, int view)
{
    const struct sst_lightfield *lf = r->lf;
    const struct sst_view *v = &lf->views[view];
    struct sst_raw_view *raw = &r->raw[view];
    struct sst_image frame = { 0 };
    int err = 0;

    if (raw->sampler || !raw->map)
        return 0;
    if (v->encoded)
        err = sst_lightfield_decode_frame(&frame, lf, view);
    if (!err)
        err = sst_sampler_create(&raw->sampler, raw->map, render_frame_filter(lf),
                                 v->encoded        ? &frame
                                 : !lf->images_raw ? &v->original
                                                   : &v->image);
    sst_image_fini(&frame);
    return err;
}

int render_rectify_frame(struct sst_renderer *r, int view)
{
    struct sst_raw_view *raw = &r->raw[view];
    struct sst_image *out = &raw->rectified;
    int err;

    if (raw->seen.data)
        return 0;
    err = out->plane[0] ? 0 : sst_image_init(out, r->lf->width, r->lf->height);
    err = err ? err : sst_map_u8_init(&raw->seen, out->width, out->height);
    for (int y = 0; !err && y < out->height; y++) {
        for (int x = 0; x < out->width; x += SST_SAMPLE_MAX) {
            uint8_t *const row[3] = { sst_image_row(out, 0, y) + x, sst_image_row(out, 1, y) + x,
                                      sst_image_row(out, 2, y) + x };
            const struct sst_rectified_row at = { x, y, sst_min_int(SST_SAMPLE_MAX, out->width - x) };

            sst_sampler_row(raw->sampler, &at, row, sst_map_u8_row(&raw->seen, y) + x);
        }
    }
    return err;
}

/* What the CPU needs of a view: a sampler, or the rectified view, for which its sampler is not kept. */
static int make_view(struct sst_renderer *r, int view)
{
    struct sst_raw_view *raw = &r->raw[view];
    int err;

    if (r->rectified && r->rectified[view].image.plane[0])
        return 0;
    err = make_sampler(r, view);
    if (!err && r->rectified)
        err = render_rectify_frame(r, view);
    if (!err && r->rectified) {
        r->rectified[view].image = raw->rectified;
        r->rectified[view].valid = raw->seen;
        sst_sampler_destroy(raw->sampler);
        raw->sampler = NULL;
    }
    return report(r, view, err);
}

static int make_tap(void *arg, int index, int worker SST_UNUSED)
{
    const struct frames_job *job = arg;

    return make_view(job->r, job->plan->tap[index].view);
}

/* On all taps of a plan. */
static int for_taps(struct sst_renderer *r, const struct sst_render_plan *p, sst_work_fn *fn)
{
    struct frames_job job = { r, p };
    int err;

    pthread_mutex_lock(&r->lock);
    err = sst_parallel_for(p->count, sst_thread_count(r->threads), fn, &job);
    pthread_mutex_unlock(&r->lock);
    return err;
}

int render_need_frames(struct sst_render_plan *p, struct sst_renderer *r)
{
    const int err = p->pending ? for_taps(r, p, make_tap) : 0;

    if (err || !p->pending)
        return err;
    for (int i = 0; i < p->count && !r->rectified; i++)
        p->tap[i].sampler = r->raw[p->tap[i].view].sampler;
    p->pending = false;
    return 0;
}

int render_need_view(struct sst_renderer *r, int view)
{
    int err;

    pthread_mutex_lock(&r->lock);
    err = make_view(r, view);
    pthread_mutex_unlock(&r->lock);
    return err;
}

int render_plan_frames(struct sst_render_plan *p, struct sst_renderer *r)
{
    const int err = r->raw ? for_taps(r, p, make_map) : 0;

    if (err || !r->raw)
        return err;
    for (int i = 0; i < p->count; i++)
        p->tap[i].frame = r->raw[p->tap[i].view].map ? &r->raw[p->tap[i].view] : NULL;
    p->sampled = !r->rectified;
    p->pending = true;
    return 0;
}

int sst_renderer_use_rectified(struct sst_renderer *r)
{
    const size_t views = (size_t)(r->lf->rows * r->lf->cols);

    if (!r->lf->images_raw) {
        sst_log_error("the light field has no raw frames that could be rectified");
        return -EINVAL;
    }
    if (r->rectified)
        return 0;
    r->rectified = calloc(views, sizeof(*r->rectified));
    if (!r->rectified) {
        sst_log_error("not enough memory for a renderer");
        return -ENOMEM;
    }
    memcpy(r->rectified, r->lf->views, views * sizeof(*r->rectified));
    for (size_t k = 0; k < views; k++) {
        r->rectified[k].image = (struct sst_image){ 0 };
        r->rectified[k].valid = (struct sst_map_u8){ 0 };
        r->rectified[k].encoded = NULL;
    }
    return 0;
}
