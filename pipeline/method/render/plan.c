/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/method/render/verify.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/border.h"
#include "base/log.h"
#include "base/mem.h"
#include "base/thread.h"
#include "pipeline/method/render/render_internal.h"

/* Offline, rarity of colours is counted from every n-th pixel of every n-th row of all views. */
#define RARITY_STEP 8
/* Shifts this close to an integer are rounded: products like 0.1 * 3 must not lose a column. */
#define WHOLE_PX 1e-6

static void count_rarity(struct sst_renderer *r)
{
    int view[SST_MAX_VIEWS], views = r->lf->rows * r->lf->cols;

    for (int i = 0; i < views; i++)
        view[i] = i;
    sst_rarity_count(r->rarity, r->lf, view, views, RARITY_STEP);
}

int sst_renderer_count(struct sst_renderer *r)
{
    int err = 0;

    pthread_mutex_lock(&r->lock);
    if (!r->counted) {
        err = sst_render_histogram_init(&r->histogram, r->lf, r->threads);
        if (!err)
            count_rarity(r);
        r->counted = !err;
    }
    pthread_mutex_unlock(&r->lock);
    if (err)
        sst_log_error("not enough memory for the disparity histograms");
    return err;
}

int sst_renderer_recount(struct sst_renderer *r, const int *view, int views, int step)
{
    int err;

    pthread_mutex_lock(&r->lock);
    err = sst_render_histogram_recount(&r->histogram, r->lf, view, views, step);
    sst_rarity_count(r->rarity, r->lf, view, views, step);
    r->counted = true; /* if out of memory: empty */
    pthread_mutex_unlock(&r->lock);
    if (err)
        sst_log_error("not enough memory for the disparity histograms");
    return err;
}

static int check_config(const struct sst_render_config *cfg)
{
    const struct {
        const char *name;
        double v, min, max;
    } values[] = {
        { "focus", cfg->focus_px, -SST_IMAGE_MAX_SIDE, SST_IMAGE_MAX_SIDE },
        { "sigma", cfg->sigma_px ? cfg->sigma_px : 1, 1e-6, INFINITY },
        { "c1", cfg->c1, 0, 1 },
        { "c2", cfg->c2, 0, 1 },
        { "focus label", cfg->focus_label, 0, 255 },
        { "label factor", cfg->label_factor, 1, 1e6 },
        { "range percentile", cfg->range_percentile, 0, 0.5 },
        { "range margin", cfg->range_margin_px, -1e6, 1e6 },
        { "aperture", cfg->aperture, 0, INFINITY },
        { "viewpoint x", cfg->view_bx, -SST_MAX_VIEWS, SST_MAX_VIEWS },
        { "skip error", cfg->skip_rays ? cfg->skip_error_db : 50, 20, 100 },
        { "viewpoint y", cfg->view_by, -SST_MAX_VIEWS, SST_MAX_VIEWS },
    };

    for (size_t i = 0; i < ARRAY_LEN(values); i++) {
        if (isgreaterequal(values[i].v, values[i].min) && islessequal(values[i].v, values[i].max))
            continue; /* not for NaN, quietly */
        sst_log_error("render: %s %g is outside %.10g..%.10g", values[i].name, values[i].v, values[i].min, values[i].max);
        return -EINVAL;
    }
    return 0;
}

/* Check the focus against the disparities, and derive the defaults that depend on their range. */
static int fit_to_disparities(struct sst_render_config *cfg, struct sst_renderer *r)
{
    double lo = 0, hi = 0, slack;
    const bool known = sst_renderer_disparities(r, &lo, &hi);

    slack = 0.1 * (hi - lo) + 1;
    if (known && (cfg->focus_px < lo - slack || cfg->focus_px > hi + slack)) {
        sst_log_error("the focus %g px lies outside the disparities of this light field; choose one in %.2f..%.2f",
                      cfg->focus_px, lo, hi);
        return -ERANGE;
    }
    if (cfg->sigma_px == 0)
        cfg->sigma_px = fmax((hi - lo) / 10, 0.1);
    if (cfg->range_margin_px < 0)
        cfg->range_margin_px = (hi - lo) / 50;
    return 0;
}

static double distance(const struct sst_render_tap *t, const struct sst_render_config *cfg)
{
    return hypot(t->v->bx - cfg->view_bx, t->v->by - cfg->view_by);
}

static bool in_aperture(const struct sst_render_tap *t, const struct sst_render_config *cfg)
{
    return t->v->present && distance(t, cfg) <= cfg->aperture + 1e-9;
}

/* Number of views that a picture uses: those in the aperture, at most max_views. */
static int views_used(const struct sst_lightfield *lf, const struct sst_render_config *cfg)
{
    int n = 0;

    for (int view = 0; view < lf->rows * lf->cols; view++)
        n += in_aperture(&(struct sst_render_tap){ .v = &lf->views[view] }, cfg);
    return cfg->max_views > 0 ? sst_min_int(n, cfg->max_views) : n;
}

bool sst_render_prefers_raw(const struct sst_lightfield *lf, const struct sst_render_config *cfg, int pictures)
{
    int present = 0;

    for (int view = 0; view < lf->rows * lf->cols; view++)
        present += lf->views[view].present;
    if (lf->correction && !lf->calibration && cfg->method == SST_RENDER_CLEAR)
        return true;
    return (lf->calibration || lf->correction) && (int64_t)pictures * views_used(lf, cfg) <= present;
}

/* Mapping of output pixels by a shift of `shift` px: first tap, fraction, nearest tap, range of pixels with all taps
 * inside. */
static void place(double shift, int size, int *tap, double *part, int *nearest, int *from, int *to)
{
    const double whole = floor(shift + WHOLE_PX);

    *part = shift - whole < WHOLE_PX ? 0 : shift - whole;
    *tap = (int)whole;
    *nearest = *tap + (*part >= 0.5);
    *from = sst_clamp_int(-*tap, 0, size);
    *to = sst_clamp_int(size - *tap - (*part > 0), 0, size);
}

/* Keep the max_views taps nearest to the viewpoint, the earlier view first in a tie; their order is kept. */
static void select_nearest(struct sst_render_plan *p)
{
    struct sst_render_tap kept[SST_MAX_VIEWS];
    int n = 0;

    for (int i = 0; i < p->count; i++) {
        const double d = distance(&p->tap[i], &p->cfg);
        int nearer = 0;

        for (int k = 0; k < p->count; k++) {
            const double other = distance(&p->tap[k], &p->cfg);

            nearer += other < d || (other == d && k < i);
        }
        if (nearer < p->cfg.max_views)
            kept[n++] = p->tap[i];
    }
    memcpy(p->tap, kept, (size_t)n * sizeof(kept[0]));
    p->count = n;
}

static int choose_views(struct sst_render_plan *p, const struct sst_renderer *r)
{
    const struct sst_lightfield *lf = p->lf;
    double rim = 0;

    for (int view = 0; view < lf->rows * lf->cols; view++) {
        const struct sst_view *v = r->rectified ? &r->rectified[view] : &lf->views[view];
        const struct sst_render_tap t = { .view = view, .v = v, .aperture = 1 };

        if (sst_view_has_frame(&lf->views[view]) && in_aperture(&t, &p->cfg))
            p->tap[p->count++] = t;
    }
    if (p->cfg.max_views > 0 && p->cfg.max_views < p->count)
        select_nearest(p);
    if (!p->count) {
        sst_log_error("no view lies within %g spacings of the viewpoint (%g, %g); widen the aperture", p->cfg.aperture,
                      p->cfg.view_bx, p->cfg.view_by);
        return -ERANGE;
    }
    for (int i = 0; i < p->count; i++)
        rim = fmax(rim, distance(&p->tap[i], &p->cfg));
    /* cos^2 that reaches 0 half a spacing outside the outermost view. */
    for (int i = 0; i < p->count && p->cfg.aperture_soft; i++) {
        const double c = cos(M_PI / 2 * distance(&p->tap[i], &p->cfg) / (rim + 0.5));

        p->tap[i].aperture = c * c;
    }
    return 0;
}

static int place_views(struct sst_render_plan *p)
{
    int overlapping = 0;

    for (int i = 0; i < p->count; i++) {
        struct sst_render_tap *t = &p->tap[i];

        place(-p->cfg.focus_px * (t->v->bx - p->cfg.view_bx), p->lf->width, &t->ix, &t->fx, &t->nx, &t->x0, &t->x1);
        place(-p->cfg.focus_px * (t->v->by - p->cfg.view_by), p->lf->height, &t->iy, &t->fy, &t->ny, &t->y0, &t->y1);
        overlapping += t->x0 < t->x1 && t->y0 < t->y1;
    }
    if (overlapping > 1 || overlapping == p->count)
        return 0;
    sst_log_error("at the focus %g px the views of %d x %d pixels do not overlap; choose one nearer to 0",
                  p->cfg.focus_px, p->lf->width, p->lf->height);
    return -ERANGE;
}

static bool depth_counts(const struct sst_render_config *cfg)
{
    return isfinite(cfg->sigma_px) && cfg->c1 < 1;
}

/* Set the disparities that end at the focus, by label: those within SST_END_SIGMAS of it in columns whose object's
 * range contains it. Unknown ones only where depth does not count and their label has one range. */
static void set_ends(struct sst_render_plan *p, const struct sst_columns *within)
{
    const double focus_q6 = (p->cfg.focus_px - p->lf->disp_min_px) * SST_DISP_SCALE;
    const double reach_q6 = SST_END_SIGMAS * p->cfg.sigma_px * SST_DISP_SCALE;
    const bool by_depth = depth_counts(&p->cfg);
    const int nearest =
        by_depth ? (int)sst_clamp_double(floor(focus_q6 + reach_q6), -1, SST_DISP_NONE - 1) : (int)SST_DISP_NONE;
    const int farthest = by_depth ? (int)sst_clamp_double(ceil(focus_q6 - reach_q6), 0, SST_DISP_NONE) : 0;

    for (int label = 0; label < 256; label++) {
        const int first = sst_max_int(farthest, within[label].first << SST_BLEND_COLUMN_SHIFT);
        const int end = (within[label].last + 1) << SST_BLEND_COLUMN_SHIFT;
        const int last = sst_min_int(nearest, first ? sst_min_int(end, SST_DISP_NONE) - 1 : end - 1);

        p->ends[label] = first <= last ? (uint32_t)first | (uint32_t)last << 16 : SST_DISP_NONE;
    }
}

static void set_label_weights(struct sst_render_plan *p, const struct sst_renderer *r)
{
    struct sst_columns within[256];

    sst_render_label_weights(p->table, p->labels, within, &r->histogram, &p->cfg);
    for (int i = 0; i < 256; i++) {
        const size_t rows = (size_t)(p->labels->range[i].weight - p->table) / SST_BLEND_COLUMNS + 1;

        p->table_rows = i && rows < p->table_rows ? p->table_rows : rows;
    }
    set_ends(p, within);
}

/* Set the constants of the weights, and the table if labels have weights. */
static int weigh(struct sst_render_plan *p, struct sst_renderer *r)
{
    const struct sst_render_config *cfg = &p->cfg;
    const double sigma_q6 = cfg->sigma_px * SST_DISP_SCALE;
    const double focus_q6 = (cfg->focus_px - p->lf->disp_min_px) * SST_DISP_SCALE;
    const bool by_depth = depth_counts(cfg), by_label = cfg->c2 < 1 || cfg->focus_label;
    struct sst_columns within[256];
    int err;

    p->weighted = by_depth || by_label;
    p->blend.near = (struct sst_blend_near){ .scale = 1 };
    if (by_depth)
        sst_blend_near_set(&p->blend.near, focus_q6, sigma_q6, cfg->c1);
    for (int i = 0; i < p->count && p->weighted; i++) {
        if (!p->tap[i].v->disp.data) {
            sst_log_error(
                "view %d has no disparity map: run `sst process` on this light field first, or use the refocus method",
                p->tap[i].view);
            return -ENODATA;
        }
    }
    if (!p->weighted)
        return 0;
    for (int label = 0; label < 256; label++)
        within[label] = (struct sst_columns){ 0, SST_BLEND_COLUMNS - 1 };
    set_ends(p, within);
    if (!by_label)
        return 0;
    err = sst_renderer_count(r);
    if (err)
        return err;
    p->table = sst_mem_alloc_raw((size_t)257 * SST_BLEND_COLUMNS, sizeof(float));
    p->labels = calloc(1, sizeof(*p->labels));
    if (!p->table || !p->labels) {
        sst_log_error("not enough memory for the table of label weights");
        return -ENOMEM;
    }
    set_label_weights(p, r);
    p->blend.by = p->labels;
    return 0;
}

/* Create the verifiers, one per thread. */
static int open_verifiers(struct sst_render_plan *p, struct sst_renderer *r)
{
    const int threads = sst_thread_count(p->cfg.threads);
    int err = 0;

    if (p->cfg.verify == SST_VERIFY_AUTO &&
        (p->lf->disparity_tested || !sst_lightfield_has(p->lf, SST_LOAD_CONFIDENCE)))
        return 0;
    err = sst_renderer_count(r);
    if (err)
        return err;
    p->numbers = sst_verify_numbers(p);
    p->rarity = malloc(sizeof(r->rarity));
    p->verifier = calloc((size_t)threads, sizeof(struct sst_verifier *));
    for (; p->rarity && p->verifier && p->verifiers < threads && !err; p->verifiers += !err)
        err = sst_verifier_create(&p->verifier[p->verifiers], p);
    if (!err && p->cfg.verify == SST_VERIFY_AUTO)
        err = explainer_create(&p->explainer, p, r);
    if (err || !p->rarity || !p->verifier) {
        sst_log_error("not enough memory to verify rays on %d threads", threads);
        return -ENOMEM;
    }
    memcpy(p->rarity, r->rarity, sizeof(r->rarity));
    return 0;
}

/* Places of the views and weights: whatever is not finite here is a pixel that is wrong without saying so. */
static void check_border(const struct sst_render_plan *p)
{
    const struct sst_blend *b = &p->blend;
    const float depth[] = { b->near.floor, b->near.scale };

    sst_border_doubles("focus of a picture", &p->cfg.focus_px, 1);
    for (int i = 0; i < p->count; i++)
        sst_border_doubles("place of a view", (const double[]){ p->tap[i].fx, p->tap[i].fy, p->tap[i].aperture }, 3);
    if (p->weighted)
        sst_border_floats("depth weights", depth, ARRAY_LEN(depth));
    if (p->table)
        sst_border_floats("label weights", p->table, p->table_rows * SST_BLEND_COLUMNS);
}

static int init_pending(struct sst_render_plan *p, struct sst_renderer *r, const struct sst_render_config *cfg)
{
    int err = check_config(cfg);

    *p = (struct sst_render_plan){ .lf = r->lf, .cfg = *cfg, .table_rows = 1 };
    err = err ? err : fit_to_disparities(&p->cfg, r);
    err = err ? err : choose_views(p, r);
    err = err ? err : place_views(p);
    err = err ? err : render_plan_frames(p, r);
    if (!err && cfg->method == SST_RENDER_SST)
        err = weigh(p, r);
    p->summed = !p->weighted && !cfg->aperture_soft;
    if (!err && cfg->verify != SST_VERIFY_OFF && p->weighted && isfinite(p->cfg.sigma_px))
        err = open_verifiers(p, r);
    if (err)
        sst_render_plan_fini(p);
    else
        check_border(p);
    return err;
}

int sst_render_plan_init(struct sst_render_plan *p, struct sst_renderer *r, const struct sst_render_config *cfg)
{
    int err = init_pending(p, r, cfg);

    if (err)
        return err;
    err = render_need_frames(p, r);
    if (err)
        sst_render_plan_fini(p);
    return err;
}

int render_plan_init_pending(struct sst_render_plan *p, struct sst_renderer *r, const struct sst_render_config *cfg)
{
    return r->runner ? init_pending(p, r, cfg) : sst_render_plan_init(p, r, cfg);
}

void sst_render_plan_fini(struct sst_render_plan *p)
{
    for (int i = 0; i < p->verifiers; i++)
        sst_verifier_destroy(p->verifier[i]);
    explainer_destroy(p->explainer);
    free(p->verifier);
    free(p->rarity);
    sst_mem_free(p->table);
    free(p->labels);
    p->explainer = NULL;
    p->verifier = NULL;
    p->verifiers = 0;
    p->rarity = NULL;
    p->table = NULL;
    p->labels = NULL;
}

bool sst_render_plan_update(struct sst_render_plan *p, const struct sst_renderer *r, double tolerance, double share)
{
    const bool labels = p->table && sst_render_label_weights_differ(p->labels->range, &r->histogram, &p->cfg, tolerance, share);

    if (!labels && !(p->rarity && sst_rarity_differs(p->rarity, r->rarity, tolerance)))
        return false;
    if (p->table)
        set_label_weights(p, r);
    if (p->rarity)
        memcpy(p->rarity, r->rarity, sizeof(r->rarity));
    return true;
}

double sst_render_plan_label_weight(const struct sst_render_plan *p, int label, uint16_t disp_q6)
{
    return p->table ? (double)p->labels->range[label].weight[disp_q6 >> SST_BLEND_COLUMN_SHIFT] : 1;
}
