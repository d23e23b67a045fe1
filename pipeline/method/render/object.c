/* Objects: regions of nearly constant disparity and colour, through all views. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>

#include "base/log.h"
#include "base/mem.h"
#include "base/thread.h"
#include "pipeline/method/render/plan.h"

#define STEP_PX     0.5 /* of disparity between neighbouring pixels of one object ... */
#define STEP_LEVELS 300 /* ... of one colour; and of colour (sum of R, G, B) where the disparity is the same */
#define SAME_PX     1.0 /* disparities of one surface in two views */
/* The ground comes nearer from row to row, and is level to both sides. */
#define SLOPE_ROWS    4   /* up and down, over which the slope is measured */
#define GROUND_PX     0.6 /* of disparity that it gains over these rows, at least, and at most ... */
#define STEEP_PX      3.0 /* ... from where on it is an outline */
#define LEVEL_COLUMNS 8   /* to both sides ... */
#define LEVEL_PX      0.2 /* ... that differ by less */

struct object {
    const struct sst_lightfield *lf;
    struct sst_map_u8 *mask; /* [rows * cols] */
    int view;                /* in which the region is known */
    const struct sst_map_u8 *region;
    bool ground;            /* the region is ground itself */
    double near_px, far_px; /* disparities of the region */
};

/* Pixels of one view still to be visited. */
struct front {
    const struct object *o;
    int view;
    int32_t *pixel; /* [width * height] */
    int count;
};

bool sst_render_disparity_at(const struct sst_lightfield *lf, int view, int x, int y, double *d)
{
    const uint16_t q = sst_map_u16_row(&lf->views[view].disp, y)[x];

    *d = q == SST_DISP_NONE ? NAN : sst_disp_px(lf, q);
    return q != SST_DISP_NONE;
}

bool sst_render_is_ground(const struct sst_lightfield *lf, int view, int x, int y)
{
    double at, above, below, left, right;

    if (y < SLOPE_ROWS || y + SLOPE_ROWS >= lf->height || x < LEVEL_COLUMNS || x + LEVEL_COLUMNS >= lf->width)
        return false;
    return sst_render_disparity_at(lf, view, x, y, &at) &&
           sst_render_disparity_at(lf, view, x, y - SLOPE_ROWS, &above) &&
           sst_render_disparity_at(lf, view, x, y + SLOPE_ROWS, &below) &&
           sst_render_disparity_at(lf, view, x - LEVEL_COLUMNS, y, &left) &&
           sst_render_disparity_at(lf, view, x + LEVEL_COLUMNS, y, &right) && below - above > GROUND_PX &&
           below - above < STEEP_PX && fabs(left - at) < LEVEL_PX && fabs(right - at) < LEVEL_PX;
}

bool sst_render_joined(const struct sst_lightfield *lf, int view, const int a[2], const int b[2])
{
    const struct sst_image *img = &lf->views[view].image;
    double d, e, colour = 0;

    if (!sst_render_disparity_at(lf, view, a[0], a[1], &d) || !sst_render_disparity_at(lf, view, b[0], b[1], &e))
        return false;
    for (int c = 0; c < 3; c++)
        colour += abs(sst_image_row(img, c, a[1])[a[0]] - sst_image_row(img, c, b[1])[b[0]]);
    return fabs(d - e) / STEP_PX + colour / STEP_LEVELS <= 1;
}

static void visit(struct front *f, int x, int y)
{
    sst_map_u8_row(&f->o->mask[f->view], y)[x] = 255;
    f->pixel[f->count++] = y * f->o->lf->width + x;
}

/* Could the pixel of another view belong to the object, though the region does not show it? Only where the view of the
 * region is covered there, or does not reach. */
static bool may_continue(const struct object *o, int view, int x, int y)
{
    const struct sst_view *v = &o->lf->views[view], *known = &o->lf->views[o->view];
    double d, other, px, py;

    if (!sst_render_disparity_at(o->lf, view, x, y, &d) || d < o->far_px - SAME_PX || d > o->near_px + SAME_PX)
        return false;
    if (view == o->view)
        return true;
    px = floor(x + d * (v->bx - known->bx) + 0.5);
    py = floor(y + d * (v->by - known->by) + 0.5);
    if (px < 0 || py < 0 || px >= o->lf->width || py >= o->lf->height)
        return true;
    return sst_render_disparity_at(o->lf, o->view, (int)px, (int)py, &other) && other > d + SAME_PX;
}

/* Visit all that is connected with what was visited. */
static void spread(struct front *f)
{
    static const int step[4][2] = { { 0, -1 }, { 0, 1 }, { -1, 0 }, { 1, 0 } };
    const struct sst_lightfield *lf = f->o->lf;

    while (f->count) {
        const int at = f->pixel[--f->count], x = at % lf->width, y = at / lf->width;

        for (int i = 0; i < 4; i++) {
            const int x2 = x + step[i][0], y2 = y + step[i][1];

            if (x2 >= 0 && y2 >= 0 && x2 < lf->width && y2 < lf->height &&
                !sst_map_u8_row(&f->o->mask[f->view], y2)[x2] &&
                sst_render_joined(lf, f->view, (const int[]){ x, y }, (const int[]){ x2, y2 }) &&
                (f->o->ground || !sst_render_is_ground(lf, f->view, x2, y2)) && may_continue(f->o, f->view, x2, y2))
                visit(f, x2, y2);
        }
    }
}

/* Does the region show the same surface as a pixel of a view? */
static bool shows(const struct object *o, int view, int x, int y)
{
    const struct sst_view *v = &o->lf->views[view], *known = &o->lf->views[o->view];
    double d, other, px, py;

    if (!sst_render_disparity_at(o->lf, view, x, y, &d))
        return false;
    px = floor(x + d * (v->bx - known->bx) + 0.5);
    py = floor(y + d * (v->by - known->by) + 0.5);
    if (px < 0 || py < 0 || px >= o->lf->width || py >= o->lf->height || !sst_map_u8_row(o->region, (int)py)[(int)px])
        return false;
    return !sst_render_disparity_at(o->lf, o->view, (int)px, (int)py, &other) || fabs(d - other) <= SAME_PX ||
           d > other;
}

static int open_front(struct front *f, const struct object *o, int view)
{
    *f = (struct front){ .o = o, .view = view };
    f->pixel = sst_mem_alloc_raw((size_t)o->lf->width * (size_t)o->lf->height, sizeof(*f->pixel));
    return f->pixel ? sst_map_u8_init(&o->mask[view], o->lf->width, o->lf->height) : -ENOMEM;
}

static int carry(void *arg, int view, int worker SST_UNUSED)
{
    const struct object *o = arg;
    struct front f;
    int err;

    if (!o->lf->views[view].present || (view == o->view && o->mask[view].data))
        return 0;
    err = open_front(&f, o, view);
    for (int y = 0; y < o->lf->height && !err; y++) {
        for (int x = 0; x < o->lf->width; x++) {
            if (view == o->view ? sst_map_u8_row(o->region, y)[x] != 0 : shows(o, view, x, y))
                visit(&f, x, y);
        }
    }
    if (!err && view != o->view)
        spread(&f);
    sst_mem_free(f.pixel);
    return err;
}

/* Outlines mix object and surroundings, and their disparities are the least certain: one pixel more on every side. */
static int widen(void *arg, int view, int worker SST_UNUSED)
{
    const struct object *o = arg;
    struct sst_map_u8 *mask = &o->mask[view];
    struct sst_map_u8 from = *mask;
    int err = from.data ? sst_map_u8_init(mask, from.width, from.height) : 0;

    for (int y = 0; y < from.height && !err; y++) {
        for (int x = 0; x < from.width; x++) {
            uint8_t any = 0;

            for (int dy = y > 0 ? -1 : 0; dy <= (y + 1 < from.height); dy++) {
                for (int dx = x > 0 ? -1 : 0; dx <= (x + 1 < from.width); dx++)
                    any |= sst_map_u8_row(&from, y + dy)[x + dx];
            }
            sst_map_u8_row(mask, y)[x] = any;
        }
    }
    if (err)
        *mask = from;
    else
        sst_map_u8_fini(&from);
    return err;
}

static int check_views(const struct sst_lightfield *lf)
{
    for (int i = 0; i < lf->rows * lf->cols; i++) {
        if (lf->views[i].present && (!lf->views[i].disp.data || lf->images_raw)) {
            sst_log_error("view %d has no disparity map or is not rectified: an object cannot be found in it; run `sst "
                          "process` on this light field first",
                          i);
            return -ENODATA;
        }
    }
    return 0;
}

/* Disparities of the region without the outermost 2 % at each end, which may be wrong. */
static int measure_range(struct object *o)
{
    uint64_t *count = sst_mem_alloc(SST_DISP_NONE, sizeof(*count));
    int lo = 0, hi = 0;

    if (!count)
        return -ENOMEM;
    for (int y = 0; y < o->lf->height; y++) {
        const uint16_t *disp = sst_map_u16_row(&o->lf->views[o->view].disp, y);
        const uint8_t *in = sst_map_u8_row(o->region, y);

        for (int x = 0; x < o->lf->width; x++)
            count[disp[x] == SST_DISP_NONE ? 0 : disp[x]] += in[x] && disp[x] != SST_DISP_NONE;
    }
    if (sst_render_histogram_range(count, 0, SST_DISP_NONE, 0.02, &lo, &hi)) {
        o->near_px = sst_disp_px(o->lf, (uint16_t)hi);
        o->far_px = sst_disp_px(o->lf, (uint16_t)lo);
    } else {
        o->near_px = -INFINITY;
        o->far_px = INFINITY;
    }
    sst_mem_free(count);
    return 0;
}

int sst_render_carry_object(struct sst_map_u8 *mask, const struct sst_lightfield *lf, int view,
                            const struct sst_map_u8 *region, int threads)
{
    struct object o = { .lf = lf, .mask = mask, .view = view, .region = region };
    int err = check_views(lf);

    if (err)
        return err;
    err = measure_range(&o);
    err = err ? err : sst_parallel_for(lf->rows * lf->cols, threads, carry, &o);
    err = err ? err : sst_parallel_for(lf->rows * lf->cols, threads, widen, &o);
    if (err)
        sst_log_error("not enough memory to find an object in %d views", lf->rows * lf->cols);
    return err;
}

int sst_render_grow_object(struct sst_map_u8 *mask, const struct sst_lightfield *lf, int x, int y, int threads)
{
    struct object o = { .lf = lf, .mask = mask, .view = lf->ref_view };
    struct front f;
    double d;
    int err = check_views(lf);

    if (err)
        return err;
    if (x < 0 || y < 0 || x >= lf->width || y >= lf->height) {
        sst_log_error("pixel %d,%d is outside the picture of %d x %d", x, y, lf->width, lf->height);
        return -ERANGE;
    }
    if (!sst_render_disparity_at(lf, lf->ref_view, x, y, &d)) {
        sst_log_error("the disparity of pixel %d,%d is unknown; choose another pixel of the object", x, y);
        return -ENODATA;
    }
    o.ground = sst_render_is_ground(lf, lf->ref_view, x, y);
    o.near_px = d + 0.04 * fmax(lf->range_max_px - lf->range_min_px, 50 * SAME_PX);
    o.far_px = d - 0.04 * fmax(lf->range_max_px - lf->range_min_px, 50 * SAME_PX);
    err = open_front(&f, &o, lf->ref_view);
    if (!err) {
        visit(&f, x, y);
        spread(&f);
    }
    sst_mem_free(f.pixel);
    if (err) {
        sst_log_error("not enough memory to find an object");
        return err;
    }
    return sst_render_carry_object(mask, lf, lf->ref_view, &mask[lf->ref_view], threads);
}
