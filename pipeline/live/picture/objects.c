/* Objects that a user has removed: regions of the reference view that follow the scene from set to set.
 *
 * An object is found by sst_render_grow_object(). In the next set it continues its last region: pixels of it that still
 * have its disparities, and pixels connected with them by nearly the same disparity and colour. So that it does not run
 * into a neighbour, it ends at the ground, its disparities stay within the width that they had, and it grows by half
 * from set to set, to three times its first area at most. In the other views it is marked by disparity: pixels whose
 * surface the region shows, or whose place in the reference view is occluded or outside of it beside the region. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/mem.h"
#include "base/thread.h"
#include "pipeline/live/picture/picture_internal.h"

#define SAME_PX     1.0  /* disparities of one surface in two views, as in object.c */
#define DRIFT_PX    0.5  /* of its disparities between two sets */
#define GROWTH      1.5  /* of its area from set to set, ... */
#define GROWTH_MOST 3    /* ... and in all */
#define LEAST_SHARE 0.25 /* of its region that is still there, or it is lost */
#define GROWN_SHARE 0.05 /* of the range of disparities: an object's, to both sides of its first pixel */
#define LOST_NS     INT64_C(2000000000)
#define MOST_SHARE  0.6 /* of the picture */

void picture_objects_init(struct picture_objects *o, int width, int height)
{
    *o = (struct picture_objects){ .width = width, .height = height };
}

void picture_objects_fini(struct picture_objects *o)
{
    for (int i = 0; i < SST_LIVEPICTURE_OBJECTS; i++)
        sst_map_u8_fini(&o->object[i].region);
    for (int k = 0; k < SST_MAX_VIEWS; k++)
        sst_map_u8_fini(&o->mask[k]);
    sst_map_u8_fini(&o->next);
    sst_mem_free(o->stack);
    *o = (struct picture_objects){ 0 };
}

static void drop(struct picture_objects *o, int i)
{
    const struct picture_object dropped = o->object[i];

    memmove(&o->object[i], &o->object[i + 1], (size_t)(o->count - 1 - i) * sizeof(dropped));
    o->object[--o->count] = dropped;
    sst_map_u8_fini(&o->object[o->count].region);
}

void picture_objects_restore(struct picture_objects *o)
{
    while (o->count)
        drop(o, o->count - 1);
}

/* --- the reference view ------------------------------------------------------------------------------------------- */

/* Area, bounds and disparities of a region; the outermost 2 % of these may be wrong. */
static void measure(struct picture_object *at, const struct sst_lightfield *lf)
{
    uint32_t count[SST_BLEND_COLUMNS] = { 0 }, all = 0, below = 0;
    int far, near = SST_BLEND_COLUMNS - 1;

    at->x0 = lf->width;
    at->y0 = lf->height;
    at->x1 = at->y1 = at->area = 0;
    for (int y = 0; y < lf->height; y++) {
        const uint8_t *in = sst_map_u8_row(&at->region, y);
        const uint16_t *disp = sst_map_u16_row(&lf->views[lf->ref_view].disp, y);

        for (int x = 0; x < lf->width; x++) {
            if (!in[x])
                continue;
            at->area++;
            at->x0 = sst_min_int(at->x0, x);
            at->x1 = sst_max_int(at->x1, x + 1);
            at->y0 = sst_min_int(at->y0, y);
            at->y1 = y + 1;
            if (disp[x] != SST_DISP_NONE) {
                count[disp[x] >> SST_BLEND_COLUMN_SHIFT]++;
                all++;
            }
        }
    }
    for (far = 0; far < near && 50 * (below + count[far]) <= all; far++)
        below += count[far];
    for (below = 0; near > far && 50 * (below + count[near]) <= all; near--)
        below += count[near];
    at->far_px = lf->disp_min_px + far * (1 << SST_BLEND_COLUMN_SHIFT) / SST_DISP_SCALE;
    at->near_px = lf->disp_min_px + (near + 1) * (1 << SST_BLEND_COLUMN_SHIFT) / SST_DISP_SCALE;
}

/* Keep the width of the disparities around their middle. */
static void narrow(struct picture_object *at)
{
    const double excess = fmax(at->near_px - at->far_px - at->first_px, 0) / 2;

    at->near_px -= excess;
    at->far_px += excess;
}

static bool in_range(const struct picture_object *at, double d, double slack_px)
{
    return d >= at->far_px - slack_px && d <= at->near_px + slack_px;
}

/* Pixels of the last region that still have its disparities. @return their number */
static int keep_region(struct picture_objects *o, const struct picture_object *at, const struct sst_lightfield *lf)
{
    int kept = 0;

    for (int y = 0; y < lf->height; y++) {
        const uint8_t *in = sst_map_u8_row(&at->region, y);
        uint8_t *to = sst_map_u8_row(&o->next, y);
        double d;

        for (int x = 0; x < lf->width; x++) {
            to[x] = in[x] && sst_render_disparity_at(lf, lf->ref_view, x, y, &d) && in_range(at, d, DRIFT_PX) ? 255 : 0;
            if (to[x])
                o->stack[kept++] = y * lf->width + x;
        }
    }
    return kept;
}

/* Add connected pixels, `most` in all. */
static void spread(struct picture_objects *o, const struct picture_object *at, const struct sst_lightfield *lf,
                   int count, int most)
{
    const int step[4] = { -lf->width, lf->width, -1, 1 };

    for (int next = 0; next < count; next++) {
        const int from = o->stack[next], x = from % lf->width, y = from / lf->width;
        const bool inside[4] = { y > 0, y + 1 < lf->height, x > 0, x + 1 < lf->width };

        for (int i = 0; i < 4 && count < most; i++) {
            const int to = from + step[i], x2 = inside[i] ? to % lf->width : 0, y2 = inside[i] ? to / lf->width : 0;
            double d;

            if (!inside[i] || sst_map_u8_row(&o->next, y2)[x2] ||
                !sst_render_disparity_at(lf, lf->ref_view, x2, y2, &d) || !in_range(at, d, DRIFT_PX) ||
                !sst_render_joined(lf, lf->ref_view, (const int[]){ x, y }, (const int[]){ x2, y2 }) ||
                (!at->ground && sst_render_is_ground(lf, lf->ref_view, x2, y2)))
                continue;
            sst_map_u8_row(&o->next, y2)[x2] = 255;
            o->stack[count++] = to;
        }
    }
}

/* The object in this set. @return false: it has been lost for long */
static bool follow(struct picture_objects *o, struct picture_object *at, const struct sst_lightfield *lf, int64_t t_ns)
{
    const int kept = keep_region(o, at, lf);
    const double most = fmin(GROWTH * at->area + 1, (double)GROWTH_MOST * at->first_area);
    struct sst_map_u8 region = at->region;

    if (kept < LEAST_SHARE * at->area)
        return t_ns - at->seen_ns < LOST_NS;
    spread(o, at, lf, kept, (int)fmin(most, (double)lf->width * lf->height));
    at->region = o->next;
    o->next = region;
    at->seen_ns = t_ns;
    measure(at, lf);
    narrow(at);
    return true;
}

/* --- the other views ---------------------------------------------------------------------------------------------- */

struct marking {
    struct picture_objects *o;
    const struct sst_lightfield *lf;
};

/* Does a pixel of a view belong to the object? */
static bool belongs(const struct picture_object *at, const struct sst_lightfield *lf, int view, int x, int y)
{
    double d, other;
    int px, py;

    if (!sst_render_disparity_at(lf, view, x, y, &d) || !in_range(at, d, SAME_PX))
        return false;
    px = (int)floor(x + d * lf->views[view].bx + 0.5);
    py = (int)floor(y + d * lf->views[view].by + 0.5);
    if (px < 0 || py < 0 || px >= lf->width || py >= lf->height)
        return sst_map_u8_row(&at->region, sst_clamp_int(py, 0, lf->height - 1))[sst_clamp_int(px, 0, lf->width - 1)] !=
               0;
    if (sst_map_u8_row(&at->region, py)[px])
        return true;
    return px >= at->x0 && px < at->x1 && py >= at->y0 && py < at->y1 &&
           sst_render_disparity_at(lf, lf->ref_view, px, py, &other) && other > d + SAME_PX;
}

/* With one pixel more on every side: outlines mix object and surroundings, and are the least certain. */
static void mark(struct sst_map_u8 *mask, int x, int y)
{
    const int x0 = sst_max_int(x - 1, 0), x1 = sst_min_int(x + 2, mask->width);

    for (int row = sst_max_int(y - 1, 0); row < sst_min_int(y + 2, mask->height); row++)
        memset(sst_map_u8_row(mask, row) + x0, 255, (size_t)(x1 - x0));
}

/* Bounds of an object in a view along one axis: it moves by -d b, and a part at the border may go on there. */
static void bounds(int *from, int *to, double b, const struct picture_object *at, int size)
{
    const double near = -b * (at->near_px + SAME_PX), far = -b * (at->far_px - SAME_PX);

    *from = *from ? sst_clamp_int((int)floor(*from + fmin(near, far)) - 1, 0, size) : 0;
    *to = *to < size ? sst_clamp_int((int)ceil(*to + fmax(near, far)) + 1, 0, size) : size;
}

static int mark_view(void *arg, int view, int worker SST_UNUSED)
{
    const struct marking *m = arg;
    const struct sst_view *v = &m->lf->views[view];
    struct sst_map_u8 *mask = &m->o->mask[view];

    if (!mask->data)
        return 0;
    memset(mask->data, 0, mask->stride * (size_t)mask->height);
    for (int i = 0; i < m->o->count && v->present && v->disp.data; i++) {
        const struct picture_object *at = &m->o->object[i];
        int x0 = at->x0, x1 = at->x1, y0 = at->y0, y1 = at->y1;

        bounds(&x0, &x1, v->bx, at, m->lf->width);
        bounds(&y0, &y1, v->by, at, m->lf->height);
        for (int y = y0; y < y1; y++) {
            for (int x = x0; x < x1; x++) {
                if (view == m->lf->ref_view ? sst_map_u8_row(&at->region, y)[x] != 0 : belongs(at, m->lf, view, x, y))
                    mark(mask, x, y);
            }
        }
    }
    return 0;
}

static int mark_views(struct picture_objects *o, const struct sst_lightfield *lf, int threads)
{
    struct marking m = { o, lf };
    int err = 0;

    for (int k = 0; k < lf->rows * lf->cols && !err; k++) {
        if (lf->views[k].present && !o->mask[k].data)
            err = sst_map_u8_init(&o->mask[k], lf->width, lf->height);
    }
    return err ? err : sst_parallel_for(lf->rows * lf->cols, threads, mark_view, &m);
}

static bool has_reference(const struct sst_lightfield *lf)
{
    const struct sst_view *v = &lf->views[lf->ref_view];

    return v->present && v->image.plane[0] && v->disp.data;
}

int picture_objects_follow(struct picture_objects *o, const struct sst_lightfield *lf, int64_t t_ns, int threads)
{
    if (!o->count)
        return 0;
    for (int i = o->count - 1; i >= 0 && has_reference(lf); i--) {
        if (!follow(o, &o->object[i], lf, t_ns))
            drop(o, i);
    }
    return mark_views(o, lf, threads);
}

/* --- clicks ------------------------------------------------------------------------------------------------------- */

static int reserve(struct picture_objects *o)
{
    if (!o->stack)
        o->stack = sst_mem_alloc_raw((size_t)o->width * (size_t)o->height, sizeof(*o->stack));
    if (!o->stack)
        return -ENOMEM;
    return o->next.data ? 0 : sst_map_u8_init(&o->next, o->width, o->height);
}

/* The outline that sst_render_grow_object() adds is of other surfaces; only pixels with nearly the disparity of the
 * clicked one can be followed. */
static void drop_outline(struct sst_map_u8 *region, const struct sst_lightfield *lf, int x, int y)
{
    const double slack_px = SAME_PX + GROWN_SHARE * fmax(lf->range_max_px - lf->range_min_px, 0);
    double at, d;

    if (!sst_render_disparity_at(lf, lf->ref_view, x, y, &at))
        return;
    for (int row = 0; row < region->height; row++) {
        uint8_t *in = sst_map_u8_row(region, row);

        for (int col = 0; col < region->width; col++) {
            if (in[col] && !(sst_render_disparity_at(lf, lf->ref_view, col, row, &d) && fabs(d - at) <= slack_px))
                in[col] = 0;
        }
    }
}

static void measure_first(struct picture_object *at, const struct sst_lightfield *lf)
{
    measure(at, lf);
    at->first_area = at->area;
    at->first_px = at->near_px - at->far_px;
}

static int add(struct picture_objects *o, const struct picture_click *click)
{
    const struct sst_lightfield *lf = click->lf;
    const int x = click->x, y = click->y;
    struct picture_object *at = &o->object[o->count];
    struct sst_map_u8 mask[SST_MAX_VIEWS] = { 0 };
    int err = sst_render_grow_object(mask, lf, x, y, click->threads);

    if (!err) {
        *at = (struct picture_object){ .region = mask[lf->ref_view], .seen_ns = click->t_ns };
        mask[lf->ref_view] = (struct sst_map_u8){ 0 };
        o->count++;
        drop_outline(&at->region, lf, x, y);
        at->ground = sst_render_is_ground(lf, lf->ref_view, x, y);
        measure_first(at, lf);
        if (at->area > MOST_SHARE * lf->width * lf->height) {
            drop(o, o->count - 1);
            err = -EINVAL;
        }
    }
    for (int k = 0; k < SST_MAX_VIEWS; k++)
        sst_map_u8_fini(&mask[k]);
    return err;
}

int picture_objects_toggle(struct picture_objects *o, const struct picture_click *click, bool *removed)
{
    const struct sst_lightfield *lf = click->lf;
    const int x = click->x, y = click->y;
    double d;
    int err;

    if (x < 0 || y < 0 || x >= o->width || y >= o->height)
        return -ERANGE;
    for (int i = o->count - 1; i >= 0; i--) {
        if (sst_map_u8_row(&o->object[i].region, y)[x]) {
            drop(o, i);
            *removed = false;
            return mark_views(o, lf, click->threads);
        }
    }
    if (o->count == SST_LIVEPICTURE_OBJECTS)
        return -EOVERFLOW;
    if (!has_reference(lf) || !sst_render_disparity_at(lf, lf->ref_view, x, y, &d))
        return -ENODATA;
    err = reserve(o);
    err = err ? err : add(o, click);
    err = err ? err : mark_views(o, lf, click->threads);
    if (!err)
        *removed = true;
    return err;
}

int picture_objects_extend(struct picture_objects *o, const struct picture_click *click)
{
    struct picture_object *at = &o->object[o->count - 1];
    int err = o->count < SST_LIVEPICTURE_OBJECTS ? add(o, click) : -EOVERFLOW;

    if (err)
        return err == -ENOMEM ? err : 0;
    for (int row = 0; row < o->height; row++) {
        const uint8_t *from = sst_map_u8_row(&at[1].region, row);
        uint8_t *to = sst_map_u8_row(&at->region, row);

        for (int col = 0; col < o->width; col++)
            to[col] |= from[col];
    }
    drop(o, o->count - 1);
    measure_first(at, click->lf);
    return mark_views(o, click->lf, click->threads);
}
