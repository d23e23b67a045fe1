/* Clear picture of one view: rendered by sst_render() from the light field as it is, merged with the memory of earlier
 * sets (memory.c), and with outlines of removed objects.
 *
 * Where nothing changed nothing is rendered. A ray goes to the viewpoint by its own disparity; pixels that changed
 * tiles cannot reach come from the last picture (struct sst_render_kept). The memory merges the whole picture. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "base/thread.h"
#include "pipeline/live/picture/picture_internal.h"

#define RAYS          5 /* live maps are off by half a pixel: more rays blur */
#define OLD_S         1.0
#define TINT_SHARE    64 /* of 256 */
#define OUTLINE_SHARE 110
#define OUTLINE_REACH 5 /* px to each side: outlines follow the mean of the removed pixels over them */
#define TRACK_PX      2.0 /* disparities of a track about its mean, or ... */
#define TRACK         0.2 /* ... this fraction of it */
#define BAND          16
#define SAME_PX       1.0 /* disparities of one surface */
#define MOVING        3   /* changed cells behind leaves that make a walker */
#define AIM_REACH     48  /* px around a click on something hidden */
#define AIM_PARTS     6   /* of an object that occluders divide */

static const uint8_t tint_colour[3] = { 60, 120, 255 };
static const uint8_t outline_colour[3] = { 255, 255, 255 };

struct picture_clear {
    struct sst_live *live;
    bool rendered;
    struct sst_render_config cfg; /* of the picture */
    bool taken_over; /* the memory is another picture's, until the first picture */
    unsigned objects_shown, objects_version;
    uint64_t serial, present_serial;
    double disp_min_px;
    struct sst_render_kept kept;
    struct picture_memory memory;
    struct picture_objects objects;
    struct picture_behind behind;
    struct picture_arrivals arrivals;
    struct sst_map_u16 surface, sums;     /* sums: working memory of outlines; empty until the first ones */
    struct sst_map_u8 support, kind, cut; /* cut: 1: the reference view's pixel is removed */
    struct sst_livepicture_clear state;
    struct sst_image *image; /* that is decorated */
};

int picture_clear_create(struct picture_clear **out, struct sst_live *live)
{
    struct picture_clear *c = calloc(1, sizeof(*c));
    const int w = live->lf.width, h = live->lf.height;
    int err = c ? picture_memory_init(&c->memory, w, h) : -ENOMEM;

    err = err ? err : picture_arrivals_init(&c->arrivals, &c->memory);
    err = err ? err : sst_map_u16_init(&c->surface, w, h);
    err = err ? err : sst_map_u8_init(&c->support, w, h);
    err = err ? err : sst_map_u8_init(&c->kind, w, h);
    if (err) {
        sst_log_error("no memory for a clear picture of %dx%d pixels", w, h);
        picture_clear_destroy(c);
        return -ENOMEM;
    }
    c->live = live;
    c->state.cut_px = NAN;
    picture_objects_init(&c->objects, w, h);
    *out = c;
    return 0;
}

void picture_clear_destroy(struct picture_clear *c)
{
    if (!c)
        return;
    sst_render_kept_fini(&c->kept);
    picture_memory_fini(&c->memory);
    picture_objects_fini(&c->objects);
    picture_behind_fini(&c->behind);
    picture_arrivals_fini(&c->arrivals);
    sst_map_u16_fini(&c->surface);
    sst_map_u16_fini(&c->sums);
    sst_map_u8_fini(&c->support);
    sst_map_u8_fini(&c->kind);
    sst_map_u8_fini(&c->cut);
    free(c);
}

/* --- memory ------------------------------------------------------------------------------------------------------- */

static const struct sst_view *lead_view(const struct sst_live *live)
{
    const struct sst_view *v = &live->lf.views[live->lf.ref_view];

    return live->present[live->lf.ref_view] && v->disp.data ? v : NULL;
}

static int cut_q6(const struct sst_live *live, double cut_px)
{
    return (int)sst_clamp_double((cut_px - live->lf.disp_min_px) * SST_DISP_SCALE, -1, SST_DISP_NONE);
}

static int merge(void *arg, struct sst_image *img, struct sst_map_u8 *weight)
{
    struct picture_clear *c = arg;
    const struct sst_live *live = c->live;
    const bool behind = isfinite(c->cfg.cut_px) && picture_behind_render(&c->behind, live, img, weight, c->cfg.cut_px);
    const struct picture_merge in = { .lf = &live->lf,
                                      .t_ns = live->focus.t_ns,
                                      .threads = live->cfg.threads,
                                      .image = img,
                                      .weight = weight,
                                      .surface = &c->surface,
                                      .support = &c->support,
                                      .kind = &c->kind,
                                      .behind = behind ? &c->behind : NULL,
                                      .cut_q6 = cut_q6(live, c->cfg.cut_px),
                                      .remove_label = c->cfg.remove_label,
                                      .lead = lead_view(live),
                                      .removed = c->objects.count ? &c->objects.mask[live->lf.ref_view] : NULL,
                                      .views = live->sampled,
                                      .view = live->sample,
                                      .stamp = live->stamp,
                                      .serial = c->serial,
                                      .tile = SST_LIVE_TILE,
                                      .tile_cols = live->changes.cols };

    int err = picture_memory_merge(&c->memory, &in);

    if (!err && behind)
        picture_behind_explore(&c->behind, &c->memory);
    c->state.moving = behind && c->behind.moving >= MOVING;
    c->arrivals.count = 0;
    if (!err && c->state.moving)
        picture_arrivals_find(&c->arrivals, &c->memory, &live->lf);
    return err;
}

static void count_kinds(struct picture_clear *c)
{
    const double all = (double)c->kind.width * c->kind.height;
    int seen = 0, remembered = 0;
    double oldest_s = 0;

    for (int y = 0; y < c->kind.height; y++) {
        const uint8_t *kind = sst_map_u8_row(&c->kind, y);

        for (int x = 0; x < c->kind.width; x++) {
            seen += kind[x] == PICTURE_SEEN;
            remembered += kind[x] == PICTURE_REMEMBERED;
            if (kind[x] == PICTURE_REMEMBERED)
                oldest_s = fmax(oldest_s, picture_memory_age_s(&c->memory, x, y));
        }
    }
    c->state.seen = seen / all;
    c->state.remembered = remembered / all;
    c->state.filled = 1 - c->state.seen - c->state.remembered;
    c->state.oldest_s = oldest_s;
}

/* --- outlines and tint -------------------------------------------------------------------------------------------- */

static void mix(struct sst_image *img, int x, int y, const uint8_t colour[3], int share)
{
    for (int c = 0; c < 3; c++) {
        uint8_t *to = sst_image_row(img, c, y) + x;

        *to = (uint8_t)((*to * (256 - share) + colour[c] * share + 128) >> 8);
    }
}

static int tint_band(void *arg, int index, int worker SST_UNUSED)
{
    const struct picture_clear *c = arg;

    for (int y = index * BAND; y < sst_min_int((index + 1) * BAND, c->kind.height); y++) {
        const uint8_t *kind = sst_map_u8_row(&c->kind, y);

        for (int x = 0; x < c->kind.width; x++) {
            if (kind[x] == PICTURE_REMEMBERED && picture_memory_age_s(&c->memory, x, y) > OLD_S)
                mix(c->image, x, y, tint_colour, TINT_SHARE);
        }
    }
    return 0;
}

/* Which pixels of the reference view are removed. */
static void mark_cut(struct picture_clear *c, const struct sst_view *v)
{
    const int cut = cut_q6(c->live, c->cfg.cut_px), label = c->cfg.remove_label;
    const struct sst_map_u8 *mask = c->objects.count ? &c->objects.mask[c->live->lf.ref_view] : NULL;

    for (int y = 0; y < c->cut.height; y++) {
        const uint16_t *disp = sst_map_u16_row(&v->disp, y);
        uint8_t *to = sst_map_u8_row(&c->cut, y);

        for (int x = 0; x < c->cut.width; x++)
            to[x] = disp[x] > cut && disp[x] != SST_DISP_NONE;
        for (int x = 0; x < c->cut.width && label && v->label.data; x++)
            to[x] |= sst_map_u8_row(&v->label, y)[x] == label;
        for (int x = 0; x < c->cut.width && mask && mask->data; x++)
            to[x] |= sst_map_u8_row(mask, y)[x] != 0;
    }
}

/* Pixels of a removed track in its box become 2. */
static void mark_track(struct picture_clear *c, const struct sst_view *v, const struct sst_live_track *t)
{
    const double reach = fmax(TRACK_PX, TRACK * t->disp_px);
    const int from = cut_q6(c->live, t->disp_px - reach), to = cut_q6(c->live, t->disp_px + reach);
    const int x0 = sst_clamp_int((int)t->at[0], 0, c->cut.width), x1 = sst_clamp_int((int)t->at[2], 0, c->cut.width);
    const int y0 = sst_clamp_int((int)t->at[1], 0, c->cut.height), y1 = sst_clamp_int((int)t->at[3], 0, c->cut.height);

    for (int y = y0; y < y1; y++) {
        const uint16_t *disp = sst_map_u16_row(&v->disp, y);
        uint8_t *cut = sst_map_u8_row(&c->cut, y);

        for (int x = x0; x < x1; x++)
            cut[x] = cut[x] && disp[x] >= from && disp[x] <= to ? 2 : cut[x];
    }
}

static bool has_tracks(const struct live_cut *cut)
{
    bool has = false;

    for (int i = 0; i < cut->tracks && !has; i++)
        has = cut->track[i].state != SST_LIVE_TRACK_COVERED;
    return has;
}

/* Unmark removed pixels that belong to no track. */
static void mark_moving(struct picture_clear *c, const struct sst_view *v)
{
    const struct live_cut *cut = &c->live->cut;

    for (int i = 0; i < cut->tracks; i++)
        if (cut->track[i].state != SST_LIVE_TRACK_COVERED)
            mark_track(c, v, &cut->track[i]);
    for (int y = 0; y < c->cut.height; y++)
        for (int x = 0; x < c->cut.width; x++)
            sst_map_u8_row(&c->cut, y)[x] = sst_map_u8_row(&c->cut, y)[x] == 2;
}

/* Removed pixels of a window around each pixel: along rows, then along columns. */
static void sum_windows(struct picture_clear *c)
{
    const int w = c->cut.width, h = c->cut.height;

    for (int y = 0; y < h; y++) {
        const uint8_t *in = sst_map_u8_row(&c->cut, y);
        uint16_t *to = sst_map_u16_row(&c->sums, y);
        int sum = 0;

        for (int x = -OUTLINE_REACH; x < w; x++) {
            sum += x + OUTLINE_REACH < w ? in[x + OUTLINE_REACH] : 0;
            sum -= x > OUTLINE_REACH ? in[x - OUTLINE_REACH - 1] : 0;
            if (x >= 0)
                to[x] = (uint16_t)sum;
        }
    }
}

/* Is most of the window around a pixel removed? */
static bool mostly_removed(const struct picture_clear *c, int x, int y)
{
    const int y0 = sst_max_int(y - OUTLINE_REACH, 0), y1 = sst_min_int(y + OUTLINE_REACH + 1, c->cut.height);
    const int x0 = sst_max_int(x - OUTLINE_REACH, 0), x1 = sst_min_int(x + OUTLINE_REACH + 1, c->cut.width);
    int sum = 0;

    for (int row = y0; row < y1; row++)
        sum += sst_map_u16_row(&c->sums, row)[x];
    return 2 * sum > (x1 - x0) * (y1 - y0);
}

static int inside_band(void *arg, int index, int worker SST_UNUSED)
{
    struct picture_clear *c = arg;

    for (int y = index * BAND; y < sst_min_int((index + 1) * BAND, c->cut.height); y++) {
        for (int x = 0; x < c->cut.width; x++)
            sst_map_u8_row(&c->cut, y)[x] = mostly_removed(c, x, y);
    }
    return 0;
}

static int outline_band(void *arg, int index, int worker SST_UNUSED)
{
    const struct picture_clear *c = arg;

    for (int y = index * BAND; y < sst_min_int((index + 1) * BAND, c->cut.height - 1); y++) {
        const uint8_t *in = sst_map_u8_row(&c->cut, y), *below = sst_map_u8_row(&c->cut, y + 1);

        for (int x = 0; x < c->cut.width - 1; x++) {
            if (in[x] != in[x + 1] || in[x] != below[x])
                mix(c->image, x, y, outline_colour, OUTLINE_SHARE);
        }
    }
    return 0;
}

static int draw_outlines(struct picture_clear *c, bool moving)
{
    const int bands = (c->kind.height + BAND - 1) / BAND, threads = c->live->cfg.threads;
    const struct sst_view *v = lead_view(c->live);
    int err = 0;

    if (!v || (moving && !has_tracks(&c->live->cut)))
        return 0;
    if (!c->sums.data) {
        err = sst_map_u16_init(&c->sums, c->kind.width, c->kind.height);
        err = err ? err : sst_map_u8_init(&c->cut, c->kind.width, c->kind.height);
    }
    if (err)
        return err;
    mark_cut(c, v);
    if (moving)
        mark_moving(c, v);
    sum_windows(c);
    err = sst_parallel_for(bands, threads, inside_band, c);
    return err ? err : sst_parallel_for(bands, threads, outline_band, c);
}

/* --- rendering ---------------------------------------------------------------------------------------------------- */

/* The settings as they are now: the automatic cut, and limits. */
static void resolve(struct picture_clear *c, struct sst_render_config *cfg)
{
    double lo, hi;

    cfg->threads = c->live->cfg.threads;
    cfg->rays = RAYS;
    cfg->view_bx = cfg->view_by = 0; /* the memory is of the reference view */
    if (isnan(cfg->cut_px))
        cfg->cut_px = sst_live_cut(c->live);
    if (isnan(cfg->cut_px))
        cfg->cut_px = INFINITY;
    if (sst_renderer_disparities(c->live->renderer, &lo, &hi))
        cfg->cut_px = fmax(cfg->cut_px, lo);
    cfg->remove = c->objects.count ? c->objects.mask : NULL;
}

/* The remembered surfaces have other stored disparities now, or other views see them. */
static void check_memory(struct picture_clear *c)
{
    const bool valid = c->rendered || c->taken_over;

    c->taken_over = false;
    if (valid && same(c->disp_min_px, c->live->lf.disp_min_px))
        return;
    picture_memory_forget(&c->memory);
    c->disp_min_px = c->live->lf.disp_min_px;
}

void picture_clear_remember(struct picture_clear *c, const struct picture_clear *from)
{
    picture_memory_copy(&c->memory, &from->memory);
    c->disp_min_px = from->disp_min_px;
    c->taken_over = from->rendered || from->taken_over;
}

int picture_clear_decorate(struct picture_clear *c, enum sst_livepicture_outline outline, bool tint, struct sst_image *image)
{
    const int bands = (c->kind.height + BAND - 1) / BAND;
    int err;

    c->image = image;
    err = tint ? sst_parallel_for(bands, c->live->cfg.threads, tint_band, c) : 0;
    return err || !outline ? err : draw_outlines(c, outline == SST_OUTLINE_MOVING);
}

/* The maps are of an earlier set: only rays that agree behind dense leaves show something. */
static bool is_late(const struct picture_clear *c)
{
    return c->live->late && c->rendered && c->behind.planned && isfinite(c->cfg.cut_px);
}

int picture_clear_render(struct picture_clear *c, const struct sst_render_config *cfg, bool whole,
                         struct sst_image *image, int64_t *rendered_px)
{
    const struct sst_live *live = c->live;
    struct sst_render_config wanted = *cfg;
    const struct sst_render_merge step = { merge, c, &c->surface, &c->support,
                                           live->cfg.skip_change ? &c->kept : NULL, is_late(c) };
    bool changed, other;
    int err = 0;

    if (c->serial != live->serial)
        err = picture_objects_follow(&c->objects, &live->lf, live->focus.t_ns, live->cfg.threads);
    resolve(c, &wanted);
    other = whole || !c->rendered || c->present_serial != live->present_serial ||
            c->objects_shown != c->objects_version || !same(wanted.cut_px, c->cfg.cut_px) ||
            wanted.remove_label != c->cfg.remove_label;
    changed = other || c->serial != live->serial;
    *rendered_px = 0;
    if (err || !changed)
        return err;
    check_memory(c);
    if (other)
        picture_arrivals_rest(&c->arrivals, live->focus.t_ns);
    c->rendered = false;
    c->cfg = wanted;
    wanted.merge = &step;
    c->kept.stamp = live->stamp;
    c->kept.tile = SST_LIVE_TILE;
    c->kept.tile_cols = live->changes.cols;
    c->kept.tile_rows = live->changes.rows;
    c->kept.serial = live->serial;
    c->kept.since = live->present_serial;
    err = sst_render(live->renderer, &wanted, image, NULL);
    if (err)
        return err;
    count_kinds(c);
    c->rendered = true;
    c->objects_shown = c->objects_version;
    c->serial = live->serial;
    c->present_serial = live->present_serial;
    c->state.cut_px = isfinite(wanted.cut_px) ? wanted.cut_px : NAN;
    *rendered_px = (int64_t)image->width * image->height;
    if (step.kept) /* the memory may have changed where no colour has */
        *rendered_px = c->kept.coloured_px ? c->kept.coloured_px : 1;
    return 0;
}

void picture_clear_state(const struct picture_clear *c, struct sst_livepicture_clear *out)
{
    *out = c->state;
    out->objects = c->objects.count;
    out->arrivals = c->arrivals.count;
    memcpy(out->arrival, c->arrivals.at, sizeof(out->arrival));
}

/* --- clicks ------------------------------------------------------------------------------------------------------- */

/* Disparity of the surface shown at a pixel; NaN: filled. */
static double shown_px(const struct picture_clear *c, int x, int y)
{
    const uint8_t kind = sst_map_u8_row(&c->kind, y)[x];
    const uint16_t shown = kind == PICTURE_REMEMBERED
                               ? c->memory.pixel[(size_t)y * (size_t)c->memory.width + (size_t)x].disp
                               : sst_map_u16_row(&c->surface, y)[x];

    return shown != SST_DISP_NONE && kind > PICTURE_FILLED ? sst_disp_px(&c->live->lf, shown) : NAN;
}

enum aimed { AIMED_NOTHING, AIMED_SURFACE, AIMED_OBJECT };

/* Meaning of a reference pixel for a click on a surface that it does not see: part of that surface, or of an object
 * whose removal shows it. */
static enum aimed match(const struct picture_clear *c, const struct sst_view *v, int x, int y, double shown)
{
    const uint16_t q = sst_map_u16_row(&v->disp, y)[x];

    for (int i = 0; i < c->objects.count; i++) {
        const struct picture_object *at = &c->objects.object[i];

        if (sst_map_u8_row(&at->region, y)[x])
            return shown >= at->far_px - SAME_PX ? AIMED_NOTHING : AIMED_OBJECT; /* also where nothing is shown */
    }
    return q != SST_DISP_NONE && fabs(sst_disp_px(&c->live->lf, q) - shown) <= SAME_PX ? AIMED_SURFACE : AIMED_NOTHING;
}

/* Where the reference camera sees a surface in front of the cut, a click means an object behind it: one that was
 * removed there, else the surface shown. Moves to the nearest pixel of it that the camera sees. @return false: there is
 * none */
static bool aim(const struct picture_clear *c, int *x, int *y)
{
    const struct sst_lightfield *lf = &c->live->lf;
    const struct sst_view *v = lead_view(c->live);
    const int x0 = *x, y0 = *y, far = AIM_REACH * AIM_REACH;
    int best = far + 1;
    double shown;

    if (!c->rendered || !v || x0 < 0 || y0 < 0 || x0 >= lf->width || y0 >= lf->height ||
        sst_map_u16_row(&v->disp, y0)[x0] == SST_DISP_NONE ||
        !(sst_disp_px(lf, sst_map_u16_row(&v->disp, y0)[x0]) > c->state.cut_px))
        return true;
    shown = shown_px(c, x0, y0);
    for (int row = sst_max_int(y0 - AIM_REACH, 0); row < sst_min_int(y0 + AIM_REACH + 1, lf->height); row++) {
        for (int col = sst_max_int(x0 - AIM_REACH, 0); col < sst_min_int(x0 + AIM_REACH + 1, lf->width); col++) {
            const enum aimed what = match(c, v, col, row, shown);
            const int distance =
                (col - x0) * (col - x0) + (row - y0) * (row - y0) - (what == AIMED_OBJECT ? 2 * far : 0);

            if (what != AIMED_NOTHING && distance < best) {
                best = distance;
                *x = col;
                *y = row;
            }
        }
    }
    return best <= far;
}

int picture_clear_toggle(struct picture_clear *c, int x, int y, bool *removed)
{
    struct picture_click at = { &c->live->lf, x, y, c->live->focus.t_ns, c->live->cfg.threads };
    int err = aim(c, &at.x, &at.y) ? 0 : -ENODATA;
    const bool hidden = at.x != x || at.y != y;

    err = err ? err : picture_objects_toggle(&c->objects, &at, removed);
    for (int part = 1; !err && hidden && *removed && part < AIM_PARTS; part++) {
        at.x = x;
        at.y = y;
        if (!aim(c, &at.x, &at.y))
            break;
        err = picture_objects_extend(&c->objects, &at);
    }
    c->objects_version += !err;
    return err;
}

void picture_clear_restore(struct picture_clear *c)
{
    c->objects_version += c->objects.count > 0;
    picture_objects_restore(&c->objects);
}

/* Label of most rays that see the surface shown at a pixel. */
static int shown_label(const struct sst_lightfield *lf, double disp_px, int x, int y)
{
    double count[256] = { 0 };

    for (int k = 0; k < lf->rows * lf->cols; k++) {
        const struct sst_view *v = &lf->views[k];
        const double px = floor(x - disp_px * v->bx + 0.5), py = floor(y - disp_px * v->by + 0.5);

        if (!v->present || !v->disp.data || !v->label.data ||
            !(px >= 0 && py >= 0 && px < lf->width && py < lf->height))
            continue;
        if (fabs(sst_disp_px(lf, sst_map_u16_row(&v->disp, (int)py)[(int)px]) - disp_px) <= 1)
            count[sst_map_u8_row(&v->label, (int)py)[(int)px]]++;
    }
    return most_voted(count);
}

int picture_clear_pick(const struct picture_clear *c, int x, int y, struct sst_livepicture_pick *out)
{
    const struct sst_live *live = c->live;
    const struct sst_view *v = lead_view(live);
    uint16_t front;

    if (!c->rendered || c->present_serial != live->present_serial || !live->ready)
        return -ENODATA;
    *out = (struct sst_livepicture_pick){ .disp_px = shown_px(c, x, y), .front_px = NAN };
    if (!isnan(out->disp_px))
        out->label = shown_label(&live->lf, out->disp_px, x, y);
    front = v ? sst_map_u16_row(&v->disp, y)[x] : SST_DISP_NONE;
    if (front == SST_DISP_NONE)
        return 0;
    out->front_px = sst_disp_px(&live->lf, front);
    out->front_label = v->label.data ? sst_map_u8_row(&v->label, y)[x] : 0;
    return 0;
}
