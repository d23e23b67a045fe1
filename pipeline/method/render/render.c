/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/method/render/render.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "base/thread.h"
#include "pipeline/lightfield/correction.h"
#include "pipeline/method/render/clear_internal.h"
#include "pipeline/method/render/render_internal.h"
#include "pipeline/method/render/verify.h"

_Static_assert(SST_BLEND_MAX <= SST_SAMPLE_MAX, "a run of rays is sampled in one go");

void sst_render_config_defaults(struct sst_render_config *cfg)
{
    *cfg = (struct sst_render_config){
        .method = SST_RENDER_SST,
        .sigma_px = 0,
        .c1 = 0.005,
        .c2 = 0.02,
        .label_factor = 2,
        .range = SST_RANGE_OBJECT,
        .range_percentile = 0.01,
        .range_margin_px = -1,
        .unsupported = SST_UNSUPPORTED_REFOCUS,
        .verify = SST_VERIFY_AUTO,
        .aperture = INFINITY,
        .cut_px = INFINITY,
        .skip_error_db = 50,
    };
}

int sst_renderer_create(struct sst_renderer **out, const struct sst_lightfield *lf, int threads)
{
    struct sst_renderer *r = calloc(1, sizeof(*r));

    if (!r) {
        sst_log_error("not enough memory for a renderer");
        return -ENOMEM;
    }
    r->lf = lf;
    r->threads = threads;
    if (lf->images_raw || sst_lightfield_has_originals(lf)) {
        r->raw = calloc((size_t)(lf->rows * lf->cols), sizeof(*r->raw));
        if (!r->raw) {
            free(r);
            sst_log_error("not enough memory for a renderer");
            return -ENOMEM;
        }
    }
    pthread_mutex_init(&r->lock, NULL);
    *out = r;
    return 0;
}

void sst_renderer_destroy(struct sst_renderer *r)
{
    if (!r)
        return;
    for (int k = 0; r->raw && k < r->lf->rows * r->lf->cols; k++) {
        sst_sampler_destroy(r->raw[k].sampler);
        sst_rectify_map_destroy(r->raw[k].map);
        sst_image_fini(&r->raw[k].rectified);
        sst_map_u8_fini(&r->raw[k].seen);
    }
    free(r->raw);
    free(r->rectified);
    render_runner_destroy(r->runner);
    landed_destroy(r->landed);
    sst_mem_free((void *)r->explained);
    sst_render_histogram_fini(&r->histogram);
    pthread_mutex_destroy(&r->lock);
    free(r);
}

bool sst_renderer_skips(struct sst_renderer *r, struct sst_render_skip_report *out)
{
    struct sst_skip_counts c;
    double mean2;

    pthread_mutex_lock(&r->lock);
    c = r->skips;
    pthread_mutex_unlock(&r->lock);
    mean2 = c.sampled ? (double)c.error2 / (3 * (double)c.sampled) : NAN;
    *out = (struct sst_render_skip_report){ .pictures = c.pictures,
                                            .rays_skipped = c.rays ? (double)c.skipped / (double)c.rays : 0,
                                            .rays_even = c.rays ? (double)c.even / (double)c.rays : 0,
                                            .sampled = c.sampled,
                                            .error_levels = sqrt(mean2),
                                            .error_db = isgreater(mean2, 0) ? 10 * log10(255 * 255 / mean2)
                                                        : c.sampled         ? INFINITY
                                                                            : NAN };
    return c.pictures;
}

double sst_renderer_confirmed(struct sst_renderer *r)
{
    return sst_lightfield_confirmed(r->lf, r->threads);
}

bool sst_renderer_disparities(struct sst_renderer *r, double *min_px, double *max_px)
{
    const struct sst_lightfield *lf = r->lf;
    double lo = INFINITY, hi = -INFINITY;

    if (lf->range_min_px < lf->range_max_px) {
        lo = lf->range_min_px;
        hi = lf->range_max_px;
    }
    if (!sst_renderer_count(r) && r->histogram.bins) {
        lo = fmin(lo, sst_disp_px(lf, (uint16_t)r->histogram.first_bin));
        hi = fmax(hi, sst_disp_px(lf, (uint16_t)(r->histogram.bins - 1)));
    }
    if (lo > hi)
        return false;
    *min_px = lo;
    *max_px = hi;
    return true;
}

int sst_renderer_labels(struct sst_renderer *r, int label[255])
{
    int n = 0;

    if (sst_renderer_count(r))
        return 0;
    for (int i = 1; i < 256; i++) {
        if (r->histogram.present[i])
            label[n++] = i;
    }
    return n;
}

/* Note which of n pixels from the sink's `skip` on the rays of one view support. */
static void add_support(const struct render_sink *s, int skip, const struct sst_render_plan *p,
                        const struct sst_blend *b, int n)
{
    if (p->weighted)
        sst_kernels_get()->blend_support(s->support + skip, b->disp, b->label, p->ends, (size_t)n);
    else
        memset(s->support + skip, 255, (size_t)n);
}

/* Set what the kernels read of a view for the pixels from `from` on of row y, but for the colours. */
static void set_maps(struct sst_blend *b, const struct sst_render_plan *p, const struct sst_render_tap *t, int from,
                     int y, bool plain)
{
    if (plain) {
        b->aperture = 1;
        b->disp = NULL;
        b->label = NULL;
        return;
    }
    b->aperture = (float)t->aperture;
    b->disp = p->weighted ? sst_map_u16_row(&t->v->disp, y + t->ny) + from + t->nx : NULL;
    b->label = p->table && t->v->label.data ? sst_map_u8_row(&t->v->label, y + t->ny) + from + t->nx : NULL;
    b->disp_below = t->v->disp.stride;
    b->label_below = t->v->label.stride;
}

static void set_colours(struct sst_blend *b, const struct sst_render_tap *t, int from, int y)
{
    for (int c = 0; c < 3; c++) {
        b->top[c] = sst_image_row(&t->v->image, c, y + t->iy) + from + t->ix;
        b->bottom[c] = t->fy > 0 ? b->top[c] + t->v->image.stride : b->top[c];
    }
    b->below = t->v->image.stride;
    sst_blend_set_taps(b->tap, t->fx, t->fy);
}

/* Pass rays with colours at top and bottom, `skip` pixels after the sink's first; output pixels from .. to of row y. */
static void blend(const struct render_sink *s, int skip, const struct sst_render_plan *p,
                  const struct sst_render_tap *t, struct sst_blend *b, int from, int to, int y)
{
    const struct sst_kernels *k = sst_kernels_get();

    set_maps(b, p, t, from, y, s->plain);
    if (s->samples) {
        uint8_t *const colour[3] = { s->samples->colour[0] + skip, s->samples->colour[1] + skip,
                                     s->samples->colour[2] + skip };

        k->blend_take(colour, s->samples->weight + skip, b, (size_t)(to - from));
    } else {
        if (s->plain) {
            int32_t *const at[3] = { s->sum[0] + skip, s->sum[1] + skip, s->sum[2] + skip };

            k->blend_plain(at, s->count + skip, b, 1, (size_t)(to - from));
        } else if (!s->support_only) {
            float *const at[4] = { s->acc[0] + skip, s->acc[1] + skip, s->acc[2] + skip, s->acc[3] + skip };

            k->blend_rays(at, b, 1, (size_t)(to - from));
        }
        if (s->support)
            add_support(s, skip, p, b, to - from);
    }
}
/* Pass the rays of one view, output pixels from .. to of row y; the sink begins at x. */
static void add_run(const struct render_sink *s, const struct sst_render_plan *p, const struct sst_render_tap *t, int x,
                    int from, int to, int y)
{
    struct sst_blend b = p->blend;

    set_colours(&b, t, from, y);
    blend(s, from - x, p, t, &b, from, to, y);
}

/* The same from a raw frame: colours are sampled at the rays; rays outside the frame are skipped. */
static void add_raw(const struct render_sink *s, const struct sst_render_plan *p, const struct sst_render_tap *t, int x,
                    int from, int end, int y)
{
    uint8_t colour[3][SST_BLEND_MAX + 1], seen[SST_BLEND_MAX], *const out[3] = { colour[0], colour[1], colour[2] };
    const int n = end - from;

    sst_sampler_row(t->sampler, &(struct sst_rectified_row){ from + t->ix + t->fx, y + t->iy + t->fy, n }, out, seen);
    for (int c = 0; c < 3; c++)
        colour[c][n] = 0; /* the kernels read one more, with weight 0 */
    for (int i = 0, to; i < n; i = to) {
        struct sst_blend b = p->blend;

        for (to = i + 1; to < n && seen[to] == seen[i]; to++)
            ;
        if (!seen[i])
            continue;
        for (int c = 0; c < 3; c++)
            b.top[c] = b.bottom[c] = colour[c] + i;
        sst_blend_set_taps(b.tap, 0, 0);
        blend(s, from + i - x, p, t, &b, from + i, from + to, y);
    }
}

/* First output pixel from x on whose ray is valid in the view (found), or is not. */
static int next_ray(const struct sst_render_tap *t, int x, int end, int y, bool found)
{
    while (x < end && sst_render_tap_sees(t, x, y) != found)
        x++;
    return x;
}

void render_add_view(const struct render_sink *s, const struct sst_render_plan *p, const struct sst_render_tap *t,
                     int x, int n, int y)
{
    const int end = sst_min_int(x + n, t->x1);
    int from = sst_max_int(x, t->x0);

    if (from >= end || y < t->y0 || y >= t->y1)
        return;
    if (t->sampler) {
        add_raw(s, p, t, x, from, end, y);
        return;
    }
    while (t->v->valid.data && (from = next_ray(t, from, end, y, true)) < end) {
        const int to = next_ray(t, from, end, y, false);

        add_run(s, p, t, x, from, to, y);
        from = to;
    }
    if (from < end)
        add_run(s, p, t, x, from, end, y);
}

/* Columns of row y that all of SST_BLEND_VIEWS views have. @return false: there are none, or a view is a raw frame or
 * has invalid pixels */
static bool common_columns(const struct sst_render_tap *t, int *from, int *to, int y)
{
    for (int k = 0; k < SST_BLEND_VIEWS; k++) {
        if (t[k].sampler || t[k].v->valid.data || y < t[k].y0 || y >= t[k].y1)
            return false;
        *from = sst_max_int(*from, t[k].x0);
        *to = sst_min_int(*to, t[k].x1);
    }
    return *from < *to;
}

/* Pixels x .. x + n of row y. */
struct stretch {
    int x, n, y;
};

/* Add the rays of SST_BLEND_VIEWS views: at once where all have them, one view after the other beside that. */
static void add_views(const struct render_sink *s, const struct sst_render_plan *p, const struct sst_render_tap *t,
                      struct stretch at)
{
    const int x = at.x, n = at.n, y = at.y;
    struct sst_blend b[SST_BLEND_VIEWS];
    int from = x, to = x + n;
    const bool common = common_columns(t, &from, &to, y);

    for (int k = 0; k < SST_BLEND_VIEWS && !common; k++)
        render_add_view(s, p, &t[k], x, n, y);
    if (!common)
        return;
    for (int k = 0; k < SST_BLEND_VIEWS; k++) {
        const int first = sst_max_int(x, t[k].x0), end = sst_min_int(x + n, t[k].x1);

        if (first < from)
            add_run(s, p, &t[k], x, first, from, y);
        if (to < end)
            add_run(s, p, &t[k], x, to, end, y);
        b[k] = p->blend;
        set_maps(&b[k], p, &t[k], from, y, s->plain);
        set_colours(&b[k], &t[k], from, y);
        if (s->support)
            add_support(s, from - x, p, &b[k], to - from);
    }
    to -= from;
    from -= x;
    if (s->plain)
        sst_kernels_get()->blend_plain((int32_t *const[3]){ s->sum[0] + from, s->sum[1] + from, s->sum[2] + from },
                                       s->count + from, b, SST_BLEND_VIEWS, (size_t)to);
    else
        sst_kernels_get()->blend_rays(
            (float *const[4]){ s->acc[0] + from, s->acc[1] + from, s->acc[2] + from, s->acc[3] + from }, b,
            SST_BLEND_VIEWS, (size_t)to);
}

const struct sst_blend *render_read_ahead(struct sst_blend *b, const struct sst_render_plan *p,
                                          const struct sst_render_tap *t, int x, int n, int y, bool plain)
{
    const int from = sst_max_int(x, t->x0), end = sst_min_int(x + n, t->x1);

    if (from >= end || y < t->y0 || y >= t->y1 || t->sampler)
        return NULL;
    set_maps(b, p, t, from, y, plain);
    set_colours(b, t, from, y);
    return b;
}

void sst_render_plan_sample(const struct sst_render_samples *to, const struct sst_render_plan *p,
                            const struct sst_render_tap *t, int x, int n, int y)
{
    const struct render_sink s = { .samples = to };

    render_add_view(&s, p, t, x, n, y);
}

void render_mend_row(const struct sst_render_plan *p, struct sst_image *out, const float *weight, int x, int n, int y)
{
    struct sst_ray rays[SST_MAX_VIEWS];
    double rgb[3];

    for (int i = 0; i < n; i++) {
        if (weight[i] >= SST_BLEND_FLOOR)
            continue;
        (void)sst_render_pixel_exact(p, x + i, y, rgb, rays);
        for (int c = 0; c < 3; c++)
            sst_image_row(out, c, y)[x + i] = (uint8_t)(rgb[c] + 0.5);
    }
}

void render_mark_row(const struct sst_render_plan *p, struct sst_image *out, struct sst_map_u8 *valid,
                     const uint8_t *support, int x, int n, int y)
{
    if (valid)
        memcpy(sst_map_u8_row(valid, y) + x, support, (size_t)n);
    for (int c = 0; c < 3 && p->cfg.unsupported == SST_UNSUPPORTED_INVALID; c++) {
        uint8_t *to = sst_image_row(out, c, y) + x;

        for (int i = 0; i < n; i++)
            to[i] &= support[i];
    }
}

/* Sums of rays. Rows begin at different places of a page: stores to one would delay loads from the others. */
struct sums {
    _Alignas(SST_ALIGN) union {
        float sum[SST_BLEND_MAX + 80];
        int32_t count[SST_BLEND_MAX + 80]; /* plans that sum: colours */
    } of[4];
};

/* n pixels of the rows from y on, n at most SST_BLEND_MAX: SST_BLEND_VIEWS views at a time, whose rows then are few
 * streams from memory and long ones. @param weight  out, sums of weights @param support  out, or NULL */
static void render_rows(const struct render_picture *pic, float (*weight)[SST_BLEND_MAX],
                        uint8_t (*support)[SST_BLEND_MAX], int x, int n, int y, int rows)
{
    const struct sst_render_plan *p = pic->plan;
    struct sums sums[SST_RENDER_CELL_HEIGHT];
    struct render_sink s[SST_RENDER_CELL_HEIGHT];

    if (p->votes_only) {
        for (int i = 0; i < rows; i++)
            memset(weight[i], 0, (size_t)n * sizeof(**weight));
        return;
    }
    for (int i = 0; i < rows; i++) {
        float *const acc[4] = { sums[i].of[0].sum, sums[i].of[1].sum, sums[i].of[2].sum, sums[i].of[3].sum };

        s[i] = (struct render_sink){ .acc = { acc[0], acc[1], acc[2], acc[3] },
                                     .sum = { sums[i].of[0].count, sums[i].of[1].count, sums[i].of[2].count },
                                     .count = acc[3],
                                     .support = support ? support[i] : NULL,
                                     .plain = p->summed };
        for (int c = 0; c < 4; c++)
            memset(acc[c], 0, (size_t)n * sizeof(*acc[c]));
        if (support)
            memset(support[i], 0, (size_t)n);
    }
    for (int first = 0; first < p->count; first += SST_BLEND_VIEWS) {
        const int end = sst_min_int(first + SST_BLEND_VIEWS, p->count);

        for (int i = 0; i < rows; i++) {
            if (end - first == SST_BLEND_VIEWS) {
                add_views(&s[i], p, &p->tap[first], (struct stretch){ x, n, y + i });
                continue;
            }
            for (int k = first; k < end; k++)
                render_add_view(&s[i], p, &p->tap[k], x, n, y + i);
        }
    }
    for (int i = 0; i < rows; i++) {
        for (int c = 0; c < 3; c++) {
            for (int at = 0; p->summed && at < n; at++)
                s[i].acc[c][at] = (float)s[i].sum[c][at];
            sst_kernels_get()->blend_finish(sst_image_row(pic->out, c, y + i) + x, s[i].acc[c], s[i].acc[3], (size_t)n);
        }
        memcpy(weight[i], s[i].acc[3], (size_t)n * sizeof(**weight));
        render_mend_row(pic->plan, pic->out, weight[i], x, n, y + i);
    }
}

/* First pixel from x on of a cell that is to be rendered (wanted), or is not. */
static int next_cell(const uint8_t *cells, int x, int width, bool wanted)
{
    while (x < width && (cells[x / SST_RENDER_CELL_WIDTH] != 0) != wanted)
        x = (x / SST_RENDER_CELL_WIDTH + 1) * SST_RENDER_CELL_WIDTH;
    return sst_min_int(x, width);
}

/* One row of cells. */
static int render_band(void *arg, int index, int worker)
{
    const struct render_picture *pic = arg;
    struct sst_verifier *verifier = pic->plan->verifier && !pic->voted ? pic->plan->verifier[worker] : NULL;
    float weight[SST_RENDER_CELL_HEIGHT][SST_BLEND_MAX];
    uint8_t support[SST_RENDER_CELL_HEIGHT][SST_BLEND_MAX];
    const bool count = pic->valid || pic->plan->cfg.unsupported == SST_UNSUPPORTED_INVALID;
    const int width = pic->plan->lf->width, top = index * SST_RENDER_CELL_HEIGHT;
    const int end = sst_min_int(top + SST_RENDER_CELL_HEIGHT, pic->plan->lf->height);
    const uint8_t *cells = pic->cells ? pic->cells + (size_t)index * (size_t)pic->cols : NULL;

    for (int x = 0, to; x < width; x = to) {
        x = cells ? next_cell(cells, x, width, true) : x;
        to = sst_min_int(cells ? next_cell(cells, x, width, false) : width, x + SST_BLEND_MAX);
        if (x < to)
            pic->pixels(pic, weight, count ? support : NULL, x, to - x, top, end - top);
        if (verifier && x < to)
            sst_verify(verifier, pic->plan, weight, x, to, top, end, pic->out);
        for (int y = top; y < end && count && x < to; y++)
            render_mark_row(pic->plan, pic->out, pic->valid, support[y - top], x, to - x, y);
    }
    return 0;
}

int render_picture_bands(struct render_picture *pic)
{
    const struct sst_render_plan *p = pic->plan;

    pic->cols = (p->lf->width + SST_RENDER_CELL_WIDTH - 1) / SST_RENDER_CELL_WIDTH;
    return sst_parallel_for((p->lf->height + SST_RENDER_CELL_HEIGHT - 1) / SST_RENDER_CELL_HEIGHT,
                            sst_thread_count(p->cfg.threads), render_band, pic);
}

int sst_render_plan_render(const struct sst_render_plan *p, const uint8_t *cells, struct sst_image *out,
                           struct sst_map_u8 *valid)
{
    struct render_picture pic = { .plan = p, .cells = cells, .out = out, .valid = valid, .pixels = render_rows };

    return render_picture_bands(&pic);
}

/* With the skips of the plan, if they pay. */
static int render_skipping(struct sst_renderer *r, struct render_picture *pic)
{
    bool done = false;
    const int err = pic->plan->cfg.skip_rays ? skip_render(r, pic->plan, pic->out, pic->valid, &done) : 0;

    return err || done ? err : render_picture_bands(pic);
}

int render_picture_on_cpu(void *arg, int item, int worker SST_UNUSED)
{
    struct render_picture *pic = (struct render_picture *)arg + item;
    int err = 0;

    pic->pixels = render_rows;
    pic->voted = false;
    if (pic->own && pic->own->pending)
        err = render_need_frames(pic->own, pic->renderer);
    if (err)
        return err;
    return pic->renderer->runner || pic->cells ? render_picture_bands(pic) : render_skipping(pic->renderer, pic);
}

static int render_anywhere(struct render_picture *pic)
{
    return render_place(pic) ? pic->err : render_picture_on_cpu(pic, 0, 0);
}

int sst_render_plan_render_live(struct sst_renderer *r, const struct sst_render_plan *p, const uint8_t *cells,
                                struct sst_image *out)
{
    return render_anywhere(&(struct render_picture){ .renderer = r, .plan = p, .cells = cells, .out = out });
}

int sst_render(struct sst_renderer *r, const struct sst_render_config *cfg, struct sst_image *out,
               struct sst_map_u8 *valid)
{
    const struct sst_lightfield *lf = r->lf;
    struct sst_render_plan plan;
    int err;

    if (out->width != lf->width || out->height != lf->height ||
        (valid && (valid->width != lf->width || valid->height != lf->height))) {
        sst_log_error("render: the picture is %d x %d, the light field %d x %d", out->width, out->height, lf->width,
                      lf->height);
        return -EINVAL;
    }
    if (cfg->method == SST_RENDER_CLEAR)
        return clear_render(r, cfg, out, valid);
    err = render_plan_init_pending(&plan, r, cfg);
    if (err)
        return err;
    if (plan.explainer)
        explainer_keep(plan.explainer);
    err = render_anywhere(
        &(struct render_picture){ .renderer = r, .plan = &plan, .own = &plan, .out = out, .valid = valid });
    sst_render_plan_fini(&plan);
    return err;
}
