/* Rendered picture of one client: whole when its settings change, afterwards cell by cell. Tiles of views have the
 * serial number of their last change, and cells with rays into tiles of a later number than the picture's are rendered
 * again. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "pipeline/live/picture/picture_internal.h"

struct sst_livepicture {
    struct sst_live *live;
    struct sst_image image;
    struct sst_render_config cfg; /* settings of the plan */
    bool planned;
    struct sst_render_plan plan;
    uint64_t serial, counted, present_serial; /* of the light field in the image */
    double disp_min_px;                       /* disparity of stored value 0 in the image's light field */
    uint8_t *cells;
    int cols, rows;
    struct picture_clear *clear; /* NULL until the first clear picture */
    bool is_clear;               /* the image */
    struct sst_image decorated;  /* empty until it is needed */
    struct sst_liveposed_picture posed; /* in place of all above */
};

int sst_livepicture_create(struct sst_livepicture **out, struct sst_live *live)
{
    struct sst_livepicture *p = calloc(1, sizeof(*p));
    int err;

    if (!p) {
        sst_log_error("no memory for a picture");
        return -ENOMEM;
    }
    p->live = live;
    if (live->posed) {
        *out = p;
        return 0;
    }
    p->cols = (live->lf.width + SST_RENDER_CELL_WIDTH - 1) / SST_RENDER_CELL_WIDTH;
    p->rows = (live->lf.height + SST_RENDER_CELL_HEIGHT - 1) / SST_RENDER_CELL_HEIGHT;
    p->cells = malloc((size_t)p->cols * (size_t)p->rows);
    err = p->cells ? sst_image_init(&p->image, live->lf.width, live->lf.height) : -ENOMEM;
    if (err) {
        sst_log_error("no memory for a picture of %dx%d pixels", live->lf.width, live->lf.height);
        sst_livepicture_destroy(p);
        return -ENOMEM;
    }
    *out = p;
    return 0;
}

void sst_livepicture_destroy(struct sst_livepicture *p)
{
    if (!p)
        return;
    if (p->planned)
        sst_render_plan_fini(&p->plan);
    picture_clear_destroy(p->clear);
    sst_liveposed_picture_fini(&p->posed);
    sst_image_fini(&p->image);
    sst_image_fini(&p->decorated);
    free(p->cells);
    free(p);
}

/* --- settings ----------------------------------------------------------------------------------------------------- */

/* Largest distance of a view from the viewpoint, along either axis. */
static double reach(const struct sst_lightfield *lf, const struct sst_render_config *cfg)
{
    double most = 1;

    for (int k = 0; k < lf->rows * lf->cols; k++) {
        if (!lf->views[k].present)
            continue;
        most = fmax(most, fabs(lf->views[k].bx - cfg->view_bx));
        most = fmax(most, fabs(lf->views[k].by - cfg->view_by));
    }
    return most;
}

/* Resolve defaults, and clamp the focus to where there is something to render: by the disparities in the scene, not by
 * the searched range, which may be much wider. */
void picture_resolve(struct sst_render_config *cfg, const struct sst_live *live)
{
    const struct sst_lightfield *lf = &live->lf;
    const double most_px = 0.5 * sst_min_int(lf->width, lf->height) / reach(lf, cfg);
    double lo, hi;

    cfg->threads = live->cfg.threads;
    cfg->verify = cfg->verify && live->low_confidence ? SST_VERIFY_ON : SST_VERIFY_OFF;
    if (isnan(cfg->focus_px))
        cfg->focus_px = isnan(live->focus.focus_px) ? 0 : live->focus.focus_px;
    if (sst_live_range(live, &lo, &hi)) {
        if (cfg->sigma_px == 0)
            cfg->sigma_px = fmax((hi - lo) / 10, 0.1);
        if (cfg->range_margin_px < 0)
            cfg->range_margin_px = (hi - lo) / 50;
    }
    if (sst_renderer_disparities(live->renderer, &lo, &hi))
        cfg->focus_px = sst_clamp_double(cfg->focus_px, lo, hi);
    cfg->focus_px = sst_clamp_double(cfg->focus_px, -most_px, most_px);
}

bool picture_same_settings(const struct sst_render_config *a, const struct sst_render_config *b)
{
    return a->method == b->method && same(a->focus_px, b->focus_px) && same(a->sigma_px, b->sigma_px) &&
           same(a->c1, b->c1) && same(a->c2, b->c2) && a->focus_label == b->focus_label &&
           same(a->label_factor, b->label_factor) && a->range == b->range &&
           same(a->range_percentile, b->range_percentile) && same(a->range_margin_px, b->range_margin_px) &&
           a->unsupported == b->unsupported && same(a->aperture, b->aperture) && a->aperture_soft == b->aperture_soft &&
           same(a->view_bx, b->view_bx) && same(a->view_by, b->view_by) && a->max_views == b->max_views &&
           a->verify == b->verify && a->threads == b->threads;
}

/* Make a plan for these settings and the present views. */
static int make_plan(struct sst_livepicture *p, const struct sst_render_config *cfg)
{
    struct sst_render_plan plan;
    int err = sst_render_plan_init(&plan, p->live->renderer, cfg);

    if (err)
        return err;
    if (p->planned)
        sst_render_plan_fini(&p->plan);
    p->plan = plan;
    p->planned = true;
    p->cfg = *cfg;
    p->present_serial = p->live->present_serial;
    p->counted = p->live->counted;
    p->disp_min_px = p->live->lf.disp_min_px;
    return 0;
}

/* --- changed cells ------------------------------------------------------------------------------------------------ */

/* Where the cells of changed rays are marked. */
struct marks {
    uint8_t *cells;
    int cols, width, height, around; /* around: px that a ray affects beside its own */
};

/* Cells of output pixels whose ray of this tap meets a part of the view: colour is read at
 * x + ix and, between pixels, at x + ix + 1; disparity and label at one of the two. Verified rays also affect the
 * pixels around. */
static void mark_tile(const struct marks *m, const struct sst_render_tap *t, struct sst_rect r)
{
    int from_x = sst_max_int(r.x0 - t->ix - (t->fx > 0), t->x0), to_x = sst_min_int(r.x1 - t->ix, t->x1) - 1;
    int from_y = sst_max_int(r.y0 - t->iy - (t->fy > 0), t->y0), to_y = sst_min_int(r.y1 - t->iy, t->y1) - 1;

    if (from_x > to_x || from_y > to_y)
        return;
    from_x = sst_max_int(from_x - m->around, 0);
    to_x = sst_min_int(to_x + m->around, m->width - 1);
    from_y = sst_max_int(from_y - m->around, 0);
    to_y = sst_min_int(to_y + m->around, m->height - 1);
    for (int y = from_y / SST_RENDER_CELL_HEIGHT; from_y <= to_y && y <= to_y / SST_RENDER_CELL_HEIGHT; y++)
        memset(m->cells + y * m->cols + from_x / SST_RENDER_CELL_WIDTH, 1,
               (size_t)(to_x / SST_RENDER_CELL_WIDTH - from_x / SST_RENDER_CELL_WIDTH + 1));
}

static void mark_view(const struct marks *m, const struct sst_live *live, const struct sst_render_tap *t,
                      uint64_t serial)
{
    const uint64_t *stamp = live->stamp[t->view];

    for (int row = 0; row < live->changes.rows; row++) {
        for (int col = 0, to; col < live->changes.cols; col = to) {
            const bool changed = stamp[row * live->changes.cols + col] > serial;

            for (to = col + 1; to < live->changes.cols; to++) {
                if ((stamp[row * live->changes.cols + to] > serial) != changed)
                    break;
            }
            if (changed)
                mark_tile(m, t,
                          (struct sst_rect){ col * SST_LIVE_TILE, row * SST_LIVE_TILE,
                                             sst_min_int(to * SST_LIVE_TILE, live->lf.width),
                                             sst_min_int((row + 1) * SST_LIVE_TILE, live->lf.height) });
        }
    }
}

void picture_mark_changes(uint8_t *cells, const struct sst_live *live, const struct sst_render_plan *plan,
                          uint64_t serial)
{
    const struct marks m = { .cells = cells,
                             .cols = (live->lf.width + SST_RENDER_CELL_WIDTH - 1) / SST_RENDER_CELL_WIDTH,
                             .width = live->lf.width,
                             .height = live->lf.height,
                             .around = plan->verifier ? 1 : 0 };

    for (int i = 0; i < plan->count; i++)
        mark_view(&m, live, &plan->tap[i], serial);
}

/* @return pixels in marked cells */
static int64_t mark_changes(struct sst_livepicture *p)
{
    int64_t n = 0;

    memset(p->cells, 0, (size_t)p->cols * (size_t)p->rows);
    picture_mark_changes(p->cells, p->live, &p->plan, p->serial);
    for (int row = 0; row < p->rows; row++) {
        const int height = sst_min_int(SST_RENDER_CELL_HEIGHT, p->image.height - row * SST_RENDER_CELL_HEIGHT);

        for (int col = 0; col < p->cols; col++) {
            if (p->cells[row * p->cols + col])
                n += height * sst_min_int(SST_RENDER_CELL_WIDTH, p->image.width - col * SST_RENDER_CELL_WIDTH);
        }
    }
    return n;
}

/* --- rendering ---------------------------------------------------------------------------------------------------- */

static bool has_views(const struct sst_live *live)
{
    for (int k = 0; k < live->lf.rows * live->lf.cols; k++) {
        if (live->present[k])
            return true;
    }
    return false;
}

static int reserve_clear(struct sst_livepicture *p)
{
    return p->clear ? 0 : picture_clear_create(&p->clear, p->live);
}

static int render_clear(struct sst_livepicture *p, const struct sst_render_config *cfg, const struct sst_image **image,
                        int64_t *rendered_px)
{
    int err = reserve_clear(p);

    p->present_serial = UINT64_MAX; /* the image is not the plan's any more */
    err = err ? err : picture_clear_render(p->clear, cfg, !p->is_clear, &p->image, rendered_px);
    p->is_clear = !err;
    *image = &p->image;
    return err;
}

/* Are there no maps yet of the set that the picture would show, with the settings that it has? */
static bool is_waiting(const struct sst_livepicture *p, const struct sst_render_config *cfg)
{
    struct sst_render_config wanted = *cfg;

    if (!p->live->late || !p->planned || p->is_clear || p->present_serial != p->live->present_serial)
        return false;
    picture_resolve(&wanted, p->live);
    return picture_same_settings(&wanted, &p->cfg);
}

int sst_livepicture_render(struct sst_livepicture *p, const struct sst_render_config *cfg,
                           const struct sst_image **image, int64_t *rendered_px)
{
    const struct sst_live *live = p->live;
    struct sst_render_config wanted = *cfg;
    const int64_t all = (int64_t)p->image.width * p->image.height;
    int64_t pixels = all;
    bool whole;
    int err = 0;

    if (atomic_load(&live->canceled))
        return -ECANCELED;
    if (live->posed) {
        err = sst_liveposed_render(live->posed, &p->posed, cfg, rendered_px);
        *image = &p->posed.image;
        return err;
    }
    if (!has_views(live) || (cfg->method != SST_RENDER_REFOCUS && !live->ready))
        return -ENODATA;
    if (cfg->method == SST_RENDER_CLEAR)
        return render_clear(p, cfg, image, rendered_px);
    if (is_waiting(p, cfg)) {
        *image = &p->image;
        *rendered_px = 0;
        return 0;
    }
    p->is_clear = false;
    picture_resolve(&wanted, live);
    whole = !p->planned || !picture_same_settings(&wanted, &p->cfg) || p->present_serial != live->present_serial ||
            !same(p->disp_min_px, live->lf.disp_min_px);
    if (whole) {
        err = make_plan(p, &wanted);
    } else if (p->counted != live->counted) {
        whole = sst_render_plan_update(&p->plan, live->renderer, PICTURE_NOTICEABLE, PICTURE_NOTICEABLE_SHARE);
        p->counted = live->counted;
    }
    if (!err && !whole)
        pixels = p->serial != live->serial ? mark_changes(p) : 0;
    if (!err && !whole && pixels == all) /* new histogram counts then cost nothing extra */
        (void)sst_render_plan_update(&p->plan, live->renderer, 0, 0);
    if (!err && pixels)
        err = sst_render_plan_render_live(live->renderer, &p->plan, whole ? NULL : p->cells, &p->image);
    if (err) {
        p->present_serial = UINT64_MAX; /* render everything next time */
        return err;
    }
    p->serial = live->serial;
    *image = &p->image;
    *rendered_px = pixels;
    return 0;
}

/* --- clear pictures ----------------------------------------------------------------------------------------------- */

int sst_livepicture_decorate(struct sst_livepicture *p, enum sst_livepicture_outline outline, bool tint,
                             const struct sst_image **image)
{
    struct sst_image *to = &p->decorated;
    int err = 0;

    *image = p->live->posed ? &p->posed.image : &p->image;
    if (!p->is_clear || (!outline && !tint))
        return 0;
    if (to->width != p->image.width || to->height != p->image.height) {
        sst_image_fini(to);
        err = sst_image_init(to, p->image.width, p->image.height);
    }
    if (err)
        return err;
    memcpy(to->plane[0], p->image.plane[0], 3 * to->stride * (size_t)to->height);
    *image = to;
    return picture_clear_decorate(p->clear, outline, tint, to);
}

int sst_livepicture_remember(struct sst_livepicture *p, const struct sst_livepicture *from)
{
    const int err = from->clear ? reserve_clear(p) : 0;

    if (!err && from->clear)
        picture_clear_remember(p->clear, from->clear);
    return err;
}

void sst_livepicture_clear(const struct sst_livepicture *p, struct sst_livepicture_clear *out)
{
    if (p->is_clear) {
        picture_clear_state(p->clear, out);
        return;
    }
    *out = (struct sst_livepicture_clear){
        .cut_px = NAN, .seen = NAN, .remembered = NAN, .filled = NAN, .oldest_s = NAN
    };
    if (p->live->posed && p->posed.method == SST_RENDER_CLEAR && p->posed.serial)
        out->seen = p->posed.seen;
}

int sst_livepicture_toggle(struct sst_livepicture *p, int x, int y, bool *removed)
{
    const int err = p->live->posed ? -ENOTSUP : p->live->ready ? reserve_clear(p) : -ENODATA;

    return err ? err : picture_clear_toggle(p->clear, x, y, removed);
}

void sst_livepicture_restore(struct sst_livepicture *p)
{
    if (p->clear)
        picture_clear_restore(p->clear);
}

/* --- picking ------------------------------------------------------------------------------------------------------ */

/* The surface that the picture is focused on. */
static int pick_posed(const struct sst_livepicture *p, int x, int y, struct sst_livepicture_pick *out)
{
    const struct sst_image *image = &p->posed.image;

    if (!p->posed.serial)
        return -ENODATA;
    if (x < 0 || y < 0 || x >= image->width || y >= image->height)
        return -ERANGE;
    *out = (struct sst_livepicture_pick){
        .disp_px = sst_liveposed_disparity(p->live->posed, p->posed.focus_px, x, y), .front_px = NAN
    };
    return isnan(out->disp_px) ? -ENODATA : 0;
}

int sst_livepicture_pick(struct sst_livepicture *p, int x, int y, struct sst_livepicture_pick *out)
{
    if (p->live->posed)
        return pick_posed(p, x, y, out);
    if (x < 0 || y < 0 || x >= p->image.width || y >= p->image.height)
        return -ERANGE;
    if (p->is_clear)
        return picture_clear_pick(p->clear, x, y, out);
    if (!p->planned || p->present_serial != p->live->present_serial || !p->live->ready)
        return -ENODATA;
    *out = pick_surface(p->live, &p->plan, x, y);
    return 0;
}
