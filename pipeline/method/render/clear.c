/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/method/render/clear_internal.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "base/mem.h"
#include "base/thread.h"
#include "pipeline/kernels/kernels.h"

#define BAND  16  /* rows of a job: each one reads what the one above has fetched ... */
#define STRIP 512 /* ... in columns of all views that stay in the second level of cache meanwhile */
#define NOISY 7   /* levels: the mean of the rays is nearer to the truth than the pixel of one camera */

/* --- rays of one block -------------------------------------------------------------------------------------------- */

/* Colours of the rays in the slot that a view with a raw frame has taken. Returns whether a ray was dropped, because
 * its position is outside the frame. */
static int sample_slot(struct sst_clear_rays *rays, int slot, const struct clear_view *v, int x, int y)
{
    int dropped = 0;

    for (int i = 0; i < SST_CLEAR_BLOCK; i++) {
        const float at_x = (float)(x + i) - rays->px[i] * v->at.bx, at_y = (float)y - rays->px[i] * v->at.by;
        uint8_t rgb[3], seen;

        if (!(rays->weight[slot][i] > 0))
            continue;
        sst_sampler_row(v->tap->sampler, &(struct sst_rectified_row){ (double)at_x, (double)at_y, 1 },
                        (uint8_t *const[3]){ rgb, rgb + 1, rgb + 2 }, &seen);
        for (int k = 0; k < 3; k++)
            rays->colour[k][slot][i] = rgb[k];
        if (!seen) {
            rays->wanted[i] = (int16_t)(rays->wanted[i] + (rays->weight[slot][i] >= 1));
            rays->weight[slot][i] = 0;
            dropped = 1;
        }
    }
    return dropped;
}

/* The surface of each pixel of a block: its disparity and the levels of its rays. */
static void find_surface(const struct clear *c, struct scratch *s)
{
    const double scale = (double)(1 << c->coarse) / SST_DISP_SCALE;
    const int enough = c->cfg->rays ? c->cfg->rays : CLEAR_ENOUGH;
    struct sst_clear_rays *rays = &s->rays;

    c->kernels->clear_surface(s->surface, s->landed, (size_t)c->count);
    for (int i = 0; i < SST_CLEAR_BLOCK; i++) {
        const float level = s->surface[i];
        const int whole = (int)level, up = (float)whole<level, found = level> 0;

        rays->first[i] = (uint16_t)(found ? sst_max_int(whole + up - SST_CLEAR_TOLERANCE, 1) : 1);
        rays->last[i] = (uint16_t)(found ? sst_min_int(whole + SST_CLEAR_TOLERANCE, UINT16_MAX) : 0);
        rays->px[i] = (float)(c->lf->disp_min_px + (double)(level - 1) * scale);
        rays->wanted[i] = (int16_t)(found ? enough : 0);
    }
}

/* Where a plane of a view has what the block one row below reads first: the rows of all views are too many streams for
 * the processor to follow. */
static size_t below(const struct clear_view *v, const struct scratch *s)
{
    const float px = s->rays.px[SST_CLEAR_BLOCK / 2];
    const float x = (float)(s->x + SST_CLEAR_BLOCK / 2) - px * v->at.bx, y = (float)(s->y + 2) - px * v->at.by;
    const bool inside = x >= 0 && x < (float)v->at.width && y >= 0 && y < (float)v->at.height;

    return inside ? (size_t)y * v->at.stride + (size_t)x : 0;
}

/* Colours of the block from pixel x on, from the rays that see its surfaces. */
static void colour_block(const struct clear *c, struct scratch *s, int x, int y)
{
    struct sst_clear_rays *rays = &s->rays;
    int more = 1;

    s->x = x;
    s->y = y;
    s->own = -1;
    for (int k = 0; k < c->count; k++) {
        s->landed[k] = c->view[k].landed + (size_t)y * c->stride + x;
        __builtin_prefetch(s->landed[k] + c->stride, 0, 2);
    }
    find_surface(c, s);
    rays->slots = 0;
    for (int k = 0; k < c->count && more; k++) {
        const struct clear_view *v = &c->view[k];
        const int slot = rays->slots;
        size_t ahead;

        more = c->kernels->clear_take(rays, &v->at, s->landed[k], x, y);
        if (rays->slots == slot)
            continue;
        ahead = below(v, s);
        if (v->tap->sampler)
            more |= sample_slot(rays, slot, v, x, y);
        for (int j = 0; j < 3 && v->at.plane[j]; j++)
            __builtin_prefetch(v->at.plane[j] + ahead, 0, 2);
        s->view[slot] = k;
        if (v->at.bx * v->at.bx + v->at.by * v->at.by < 1e-12F && !c->as_others)
            s->own = slot;
    }
    c->kernels->clear_blend(&s->out, rays, s->own);
}

/* Weight of a pixel, 0..255, from the weight of its rays: 1 is enough. */
static uint8_t pixel_weight(float total)
{
    const float t = total < 1 ? total : 1;

    return (uint8_t)(255 * t * t + 0.5F);
}

/* For the caller's merge: the surface of each pixel, and how many rays agree on its colour. */
static void note_surface(const struct clear *c, const struct scratch *s, int x, int y, int n)
{
    uint16_t *surface = sst_map_u16_row(c->to.surface, y) + x;
    uint8_t *support = sst_map_u8_row(c->to.support, y) + x;
    const float scale = (float)(1 << c->coarse);

    for (int i = 0; i < n; i++) {
        surface[i] = (uint16_t)(s->out.weight[i] > 0 ? (unsigned)((s->surface[i] - 1) * scale + 0.5F) : SST_DISP_NONE);
        support[i] = (uint8_t)fminf(SST_RENDER_SUPPORT * s->out.support[i] + 0.5F, 255);
    }
}

/* The columns from .. to of a row. */
static void colour_row(const struct clear *c, struct scratch *s, int from, int to, int y)
{
    uint8_t *weight = sst_map_u8_row(c->to.weight, y);

    for (int x = from; x < to; x += SST_CLEAR_BLOCK) {
        const int n = sst_min_int(c->width - x, SST_CLEAR_BLOCK);

        if (!landed_colours(c, x, y))
            continue;
        colour_block(c, s, x, y);
        for (int k = 0; k < 3; k++) {
            uint8_t *out = sst_image_row(c->to.image, k, y) + x;

            for (int i = 0; i < n; i++)
                out[i] = (uint8_t)(int)(s->out.colour[k][i] + 0.5F);
        }
        for (int i = 0; i < n; i++)
            weight[x + i] = pixel_weight(s->out.weight[i]);
        if (c->to.surface)
            note_surface(c, s, x, y, n);
    }
}

static int colour_band(void *arg, int band, int worker)
{
    const struct clear *c = arg;

    for (int x = 0; x < c->width; x += STRIP) {
        for (int y = BAND * band; y < sst_min_int(BAND * (band + 1), c->height); y++)
            colour_row(c, &c->scratch[worker], x, sst_min_int(x + STRIP, c->width), y);
    }
    return 0;
}

/* --- a picture ---------------------------------------------------------------------------------------------------- */

static double distance(const struct clear_view *v)
{
    return hypot((double)v->at.bx, (double)v->at.by);
}

/* Nothing of a view that is not rectified yet, or is a raw frame. */
static void set_planes(struct clear_view *v)
{
    v->at.stride = v->tap->v->image.stride;
    for (int k = 0; k < 3; k++)
        v->at.plane[k] = v->tap->sampler ? NULL : v->tap->v->image.plane[k];
}

static void add_view(struct clear *c, const struct sst_render_tap *t)
{
    const double bx = t->v->bx - c->cfg->view_bx, by = t->v->by - c->cfg->view_by;
    struct clear_view v = { .tap = t,
                            .at = { .width = c->width,
                                    .height = c->height,
                                    .bx = (float)bx,
                                    .by = (float)by,
                                    .x_q6 = (float)(bx / SST_DISP_SCALE),
                                    .x_0 = (float)(c->lf->disp_min_px * bx + 0.5),
                                    .y_q6 = (float)(by / SST_DISP_SCALE),
                                    .y_0 = (float)(c->lf->disp_min_px * by + 0.5),
                                    .coarse = c->coarse } };
    int at = c->count++;

    set_planes(&v);
    for (; at > 0 && distance(&c->view[at - 1]) > distance(&v); at--)
        c->view[at] = c->view[at - 1];
    c->view[at] = v;
}

/* Working memory of a thread from `at` on; NULL: only count. Returns its size. */
static size_t place_scratch(struct scratch *s, uint8_t *at, const struct clear *c)
{
    const size_t views = (size_t)c->count, row = sst_mem_stride((size_t)c->width + 2, 1);
    const size_t slots = views * sizeof(*s->rays.weight), lists = sst_mem_stride(views, sizeof(*s->landed));

    if (at) {
        for (int j = 0; j < 3; j++)
            s->row[j] = at + (size_t)j * row;
        s->state = at + 3 * row;
        at += 4 * row;
        s->rays.weight = (void *)at;
        s->rays.agree = (void *)(at + slots);
        for (int j = 0; j < 3; j++)
            s->rays.colour[j] = (void *)(at + (size_t)(2 + j) * slots);
        at += 5 * slots;
        s->landed = (void *)at;
        s->view = (void *)(at + lists);
    }
    return 4 * row + 5 * slots + 2 * lists;
}

static int allocate(struct clear *c)
{
    const size_t scratch = place_scratch(NULL, NULL, c);
    uint8_t *rows;

    c->scratch = calloc((size_t)c->threads, sizeof(*c->scratch));
    c->rows = rows = sst_mem_alloc_raw((size_t)c->threads, scratch);
    if (!c->scratch || !rows)
        return -ENOMEM;
    for (int i = 0; i < c->threads; i++)
        place_scratch(&c->scratch[i], rows + (size_t)i * scratch, c);
    return 0;
}

/* Stored value of the cut; what is above it is removed. */
static int cut_q6(const struct sst_lightfield *lf, double cut_px)
{
    return (int)sst_clamp_double((cut_px - lf->disp_min_px) * SST_DISP_SCALE, -1, SST_DISP_NONE);
}

void clear_fini(struct clear *c)
{
    landed_give_back(c);
    free(c->scratch);
    sst_mem_free(c->rows);
    sst_render_plan_fini(&c->plan);
}

/* Between the views there are rays for every viewpoint; outside there are not. */
static int check_viewpoint(const struct sst_render_config *cfg, const struct sst_render_plan *p)
{
    double x[2] = { INFINITY, -INFINITY }, y[2] = { INFINITY, -INFINITY };

    for (int i = 0; i < p->count; i++) {
        x[0] = fmin(x[0], p->tap[i].v->bx);
        x[1] = fmax(x[1], p->tap[i].v->bx);
        y[0] = fmin(y[0], p->tap[i].v->by);
        y[1] = fmax(y[1], p->tap[i].v->by);
    }
    if (cfg->view_bx > x[0] - 1e-6 && cfg->view_bx < x[1] + 1e-6 && cfg->view_by > y[0] - 1e-6 &&
        cfg->view_by < y[1] + 1e-6)
        return 0;
    sst_log_error("the viewpoint (%g, %g) lies outside the views; choose one in %g..%g, %g..%g spacings", cfg->view_bx,
                  cfg->view_by, x[0], x[1], y[0], y[1]);
    return -ERANGE;
}

static int check_config(const struct sst_render_config *cfg, const struct sst_render_plan *p)
{
    if (isnan(cfg->cut_px) || cfg->remove_label < 0 || cfg->remove_label > 255) {
        sst_log_error("render: the cut %g or the label to remove, %d, is invalid", cfg->cut_px, cfg->remove_label);
        return -EINVAL;
    }
    for (int i = 0; i < p->count; i++) {
        if (!p->tap[i].v->disp.data) {
            sst_log_error("view %d has no disparity map: run `sst process` on this light field first", p->tap[i].view);
            return -ENODATA;
        }
    }
    return check_viewpoint(cfg, p);
}

/* Views, samplers of raw frames and limits are those of plain refocusing on the middle of the scene. */
static int plan_views(struct sst_render_plan *p, struct sst_renderer *r, const struct sst_render_config *cfg)
{
    struct sst_render_config plain = *cfg;
    double lo = 0, hi = 0;

    plain.method = SST_RENDER_REFOCUS;
    plain.focus_px = sst_renderer_disparities(r, &lo, &hi) ? (lo + hi) / 2 : 0;
    if (cfg->cut_px < lo) {
        sst_log_error("the cut %g px removes everything; choose one in %.2f..%.2f", cfg->cut_px, lo, hi);
        return -ERANGE;
    }
    return render_plan_init_pending(p, r, &plain);
}

/* Stored disparities are below: live counts are samples, so that some may exceed them. */
static int count_bins(const struct sst_renderer *r)
{
    const bool known = r->lf->range_min_px < r->lf->range_max_px;

    return sst_max_int(r->histogram.bins,
                       known ? sst_min_int(sst_disp_q6(r->lf, r->lf->range_max_px) + 1, SST_DISP_NONE) : 0);
}

int clear_init(struct clear *c, struct sst_renderer *r, const struct sst_render_config *cfg)
{
    const struct sst_render_plan *p = &c->plan;
    int err;

    memset(c, 0, sizeof(*c));
    err = plan_views(&c->plan, r, cfg);
    err = err ? err : check_config(cfg, p);
    if (err)
        return err;
    c->renderer = r;
    c->lf = p->lf;
    c->cfg = cfg;
    c->threads = sst_thread_count(cfg->threads);
    c->width = p->lf->width;
    c->height = p->lf->height;
    c->bins = count_bins(r);
    c->cut_q6 = cut_q6(p->lf, cfg->cut_px);
    c->coarse = c->bins > 0x7FFF;
    c->stride = sst_mem_stride((size_t)c->width, 2) / 2;
    c->kernels = sst_kernels_get();
    for (int i = 0; i < p->count; i++) {
        add_view(c, &p->tap[i]);
        c->sampled |= p->sampled && p->tap[i].frame;
    }
    if (cfg->merge || (p->sampled && c->lf->images_raw))
        return 0;
    err = p->pending && !p->sampled ? render_need_view(r, c->view[0].tap->view) : 0;
    c->as_others = !err && sst_image_noise(&c->view[0].tap->v->image) > NOISY;
    return err;
}

/* Rectified views, or samplers, of frames that were pending. @return as render_need_frames() */
static int need_frames(struct clear *c)
{
    const int err = render_need_frames(&c->plan, c->renderer);

    for (int k = 0; k < c->count; k++)
        set_planes(&c->view[k]);
    return err;
}

/* Send all rays to the viewpoint. */
static int land_rays(struct clear *c)
{
    int err = need_frames(c);

    err = err ? err : allocate(c);
    return err ? err : landed_make(c);
}

static void mark_valid(struct sst_map_u8 *valid, const struct sst_map_u8 *weight)
{
    bool any = false;

    for (int y = 0; y < weight->height; y++) {
        const uint8_t *from = sst_map_u8_row(weight, y);
        uint8_t *to = sst_map_u8_row(valid, y);

        for (int x = 0; x < weight->width; x++) {
            to[x] = 4 * from[x] >= 255 ? CLEAR_SEEN : CLEAR_FILLED;
            any |= from[x] != 0;
        }
    }
    for (int y = 0; y < weight->height && !any; y++)
        memset(sst_map_u8_row(valid, y), CLEAR_UNKNOWN, (size_t)weight->width);
}

static int kept_reserve(struct sst_render_kept *kept, int width, int height)
{
    int err = kept->image.plane[0] ? 0 : sst_image_init(&kept->image, width, height);

    err = err || kept->weight.data ? err : sst_map_u8_init(&kept->weight, width, height);
    err = err || kept->support.data ? err : sst_map_u8_init(&kept->support, width, height);
    return err || kept->surface.data ? err : sst_map_u16_init(&kept->surface, width, height);
}

void sst_render_kept_fini(struct sst_render_kept *kept)
{
    sst_image_fini(&kept->image);
    sst_map_u8_fini(&kept->weight);
    sst_map_u8_fini(&kept->support);
    sst_map_u16_fini(&kept->surface);
    kept->id = 0;
}

static void copy_rows(void *to, const void *from, size_t stride, int rows)
{
    memcpy(to, from, stride * (size_t)rows);
}

/* What is kept is coloured where it changed, and copied. */
static int colour_kept(struct clear *c)
{
    struct sst_render_kept *kept = c->cfg->merge->kept;
    const struct clear_target to = c->to;
    int err = kept_reserve(kept, c->width, c->height);

    c->to = (struct clear_target){ &kept->image, &kept->weight, &kept->surface, &kept->support };
    err = err ? err : sst_parallel_for((c->height + BAND - 1) / BAND, c->threads, colour_band, c);
    c->to = to;
    if (err) {
        kept->id = 0;
        return err;
    }
    kept->coloured_px = landed_coloured_px(c);
    kept->coloured = kept->serial;
    for (int i = 0; i < 3; i++)
        copy_rows(to.image->plane[i], kept->image.plane[i], kept->image.stride, c->height);
    copy_rows(to.weight->data, kept->weight.data, kept->weight.stride, c->height);
    copy_rows(to.surface->data, kept->surface.data, kept->surface.stride, c->height);
    copy_rows(to.support->data, kept->support.data, kept->support.stride, c->height);
    return 0;
}

int clear_colour(void *job, int item, int worker)
{
    struct clear *c = (struct clear *)job + item;
    int err = land_rays(c);

    if (err)
        return err;
    for (int i = 0; i < 3; i++)
        memset(c->to.image->plane[i], 0, c->to.image->stride * (size_t)c->height);
    err = landed_kept(c) ? colour_kept(c) : sst_parallel_for((c->height + BAND - 1) / BAND, c->threads, colour_band, c);
    return err || !c->filled ? err : clear_fill_picture(job, item, worker);
}

int clear_fill_picture(void *job, int item, int worker SST_UNUSED)
{
    struct clear *c = (struct clear *)job + item;
    const size_t bytes = clear_fill_bytes(c->width, c->height);
    void *own = c->landed ? NULL : sst_mem_alloc_raw(bytes, 1), *levels = c->landed ? landed_levels(c, bytes) : own;
    const int err = levels ? clear_fill(c->to.image, c->to.weight, levels, c->threads) : -ENOMEM;

    sst_mem_free(own);
    return err;
}

/* A picture of holes. */
static void leave_unseen(struct clear *c)
{
    for (int i = 0; i < 3; i++)
        memset(c->to.image->plane[i], 0, c->to.image->stride * (size_t)c->height);
    for (int y = 0; y < c->height; y++) {
        memset(sst_map_u8_row(c->to.weight, y), 0, (size_t)c->width);
        memset(sst_map_u8_row(c->to.support, y), 0, (size_t)c->width);
        memset(sst_map_u16_row(c->to.surface, y), 0xFF, (size_t)c->width * sizeof(uint16_t)); /* SST_DISP_NONE */
    }
}

static int make_picture(struct clear *c)
{
    const struct sst_render_merge *merge = c->cfg->merge;
    int err = 0;

    if (merge && merge->unseen)
        leave_unseen(c);
    else
        err = clear_place(c) ? 0 : clear_colour(c, 0, 0);

    if (!err && merge)
        err = merge->merge(merge->arg, c->to.image, c->to.weight);
    return err || c->filled || clear_place_fill(c) ? err : clear_fill_picture(c, 0, 0);
}

int clear_render(struct sst_renderer *r, const struct sst_render_config *cfg, struct sst_image *out,
                 struct sst_map_u8 *valid)
{
    const struct sst_render_merge *merge = cfg->merge;
    struct sst_map_u8 weight = { 0 };
    struct clear c;
    int err = clear_init(&c, r, cfg);

    err = err ? err : sst_map_u8_init(&weight, c.width, c.height);
    if (!err) {
        if (merge && merge->kept)
            merge->kept->coloured_px = (int64_t)c.width * c.height;
        c.to = (struct clear_target){ out, &weight, merge ? merge->surface : NULL, merge ? merge->support : NULL };
        err = make_picture(&c);
    }
    if (!err && valid)
        mark_valid(valid, &weight);
    if (err == -ENOMEM && c.lf)
        sst_log_error("not enough memory for a clear picture of %d views of %d x %d", c.count, c.width, c.height);
    sst_map_u8_fini(&weight);
    clear_fini(&c);
    return err;
}

/* --- one pixel explained ------------------------------------------------------------------------------------------ */

/* The rays of the i-th pixel of a block. Returns their number. */
static int describe(const struct clear *c, const struct scratch *s, int i, struct sst_ray *out)
{
    const struct sst_clear_rays *rays = &s->rays;
    int count = 0;

    for (int slot = 0; slot < rays->slots; slot++) {
        const struct clear_view *v = &c->view[s->view[slot]];
        const float at_x = (float)(s->x + i) - rays->px[i] * v->at.bx, at_y = (float)s->y - rays->px[i] * v->at.by;
        const float weight = rays->weight[slot][i];
        const int nx = (int)(at_x + 0.5F), ny = (int)(at_y + 0.5F), landed = s->landed[s->view[slot]][i];

        if (!(weight > 0))
            continue;
        out[count] = (struct sst_ray){ .view = v->tap->view,
                                       .x = (double)at_x,
                                       .y = (double)at_y,
                                       .disp_px = sst_disp_px(c->lf, (uint16_t)((landed / 2 - 1) << c->coarse)),
                                       .aperture = 1,
                                       .w_depth = (double)weight,
                                       .w_label = (double)rays->agree[slot][i] };
        if (v->tap->v->label.data)
            out[count].label = sst_map_u8_row(&v->tap->v->label, ny)[nx];
        out[count].share = (double)((1 - s->out.own[i]) * weight * rays->agree[slot][i] / s->out.support[i] +
                                    (slot == s->own ? s->out.own[i] : 0));
        for (int k = 0; k < 3; k++)
            out[count].colour[k] = (double)rays->colour[k][slot][i];
        count++;
    }
    return count;
}

int clear_rays(struct sst_renderer *r, const struct sst_render_config *cfg, int x, int y, struct sst_ray *rays)
{
    const int i = x % SST_CLEAR_BLOCK;
    struct clear c;
    int err = clear_init(&c, r, cfg), n = 0;

    err = err ? err : land_rays(&c);
    if (!err) {
        colour_block(&c, &c.scratch[0], x - i, y);
        n = describe(&c, &c.scratch[0], i, rays);
    }
    clear_fini(&c);
    return err ? err : n;
}

/* --- all pixels explained ----------------------------------------------------------------------------------------- */

struct clear_job {
    struct clear *c;
    clear_pixel_fn *pixel;
    void *arg;
};

static int describe_row(void *arg, int y, int worker)
{
    const struct clear_job *job = arg;
    const struct clear *c = job->c;
    struct scratch *s = &c->scratch[worker];
    struct sst_ray rays[SST_MAX_VIEWS];

    for (int x = 0; x < c->width; x += SST_CLEAR_BLOCK) {
        colour_block(c, s, x, y);
        for (int i = 0; i < SST_CLEAR_BLOCK && x + i < c->width; i++)
            job->pixel(job->arg, x + i, y, rays, describe(c, s, i, rays));
    }
    return 0;
}

int clear_each(struct sst_renderer *r, const struct sst_render_config *cfg, clear_pixel_fn *pixel, void *arg)
{
    struct clear c;
    struct clear_job job = { &c, pixel, arg };
    int err = clear_init(&c, r, cfg);

    err = err ? err : land_rays(&c);
    err = err ? err : sst_parallel_for(c.height, c.threads, describe_row, &job);
    clear_fini(&c);
    return err;
}
