/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <limits.h>
#include <stdlib.h>
#include <string.h>

#include "pipeline/kernels/kernels.h"
#include "pipeline/lightfield/shift.h"
#include "pipeline/method/disparity/visible.h"

#define AGREE_Q6   64 /* |d - D_n| <= 1 px */
#define DIRECTIONS 16

/* Places of pixels in a neighbour at whole disparities, from their own place in the view under check on. */
struct places {
    int count;
    int32_t across[SST_DISPARITY_MAX_STEPS], down[SST_DISPARITY_MAX_STEPS];
    int32_t at[SST_DISPARITY_MAX_STEPS]; /* values of the map, row by row */
    int least[2], most[2];               /* of across, of down */
};

/* A neighbour, and where a pixel of the view under check lies in it. */
struct neighbour {
    const struct sst_map_u16 *disp;
    struct sst_shift across, down;
    struct places places;
};

/* A row of the view under check. */
struct checked_row {
    const struct neighbour *view;
    int views, width, y;
};

static void find_places(struct neighbour *n, int steps)
{
    const int row = (int)(n->disp->stride / sizeof(*n->disp->data)), far = 2 * SST_IMAGE_MAX_SIDE;
    struct places *p = &n->places;

    p->count = sst_min_int(steps, SST_DISPARITY_MAX_STEPS);
    for (int d = 0; d < p->count; d++) {
        const int at[2] = { sst_clamp_int(sst_shifted(0, n->across, d * (int)SST_DISP_SCALE), -far, far),
                            sst_clamp_int(sst_shifted(0, n->down, d * (int)SST_DISP_SCALE), -far, far) };

        p->across[d] = at[0];
        p->down[d] = at[1];
        p->at[d] = (int32_t)((int64_t)at[1] * row + at[0]);
        for (int axis = 0; axis < 2; axis++) {
            p->least[axis] = d ? sst_min_int(p->least[axis], at[axis]) : at[axis];
            p->most[axis] = d ? sst_max_int(p->most[axis], at[axis]) : at[axis];
        }
    }
}

/* True if view n holds disparity d (1/64 px) at the point to which d maps pixel (x, y). */
static bool agrees(const struct neighbour *n, int x, int y, int d_q6)
{
    const int xn = sst_shifted(x, n->across, d_q6), yn = sst_shifted(y, n->down, d_q6);
    int there;

    if ((unsigned)xn >= (unsigned)n->disp->width || (unsigned)yn >= (unsigned)n->disp->height)
        return false;
    there = sst_map_u16_row(n->disp, yn)[xn];
    return there != (int)SST_DISP_NONE && d_q6 != (int)SST_DISP_NONE && abs(there - d_q6) <= AGREE_Q6;
}

static bool is_inside(const struct neighbour *n, int x, int y, int d)
{
    return (unsigned)(x + n->places.across[d]) < (unsigned)n->disp->width &&
           (unsigned)(y + n->places.down[d]) < (unsigned)n->disp->height;
}

/* The first whole disparity at which view n agrees; -1: none. The points lie along a line of the view: it is inside for
 * one range of disparities. */
static int find_agreement(const struct neighbour *n, int x, int y)
{
    const struct places *p = &n->places;
    const uint16_t *own = sst_map_u16_row(n->disp, y) + x;
    int d = 0, end = p->count;

    if (x + p->least[0] < 0 || x + p->most[0] >= n->disp->width || y + p->least[1] < 0 ||
        y + p->most[1] >= n->disp->height) {
        while (d < end && !is_inside(n, x, y, d))
            d++;
        while (d < end && !is_inside(n, x, y, end - 1))
            end--;
    }
    /* SST_DISP_NONE is farther than AGREE_Q6 from all disparities. */
    for (; d < end; d++) {
        if ((unsigned)(own[p->at[d]] - d * (int)SST_DISP_SCALE + AGREE_Q6) <= 2 * AGREE_Q6)
            return d;
    }
    return -1;
}

/* Leave out of a list of columns where view n agrees with the pixels' own disparities. @return how many stay */
static int drop_correct(uint16_t *column, int columns, const struct neighbour *n, const uint16_t *d, int y)
{
    int left = 0;

    for (int i = 0; i < columns; i++) {
        const int x = column[i];

        column[left] = (uint16_t)x;
        left += !agrees(n, x, y, d[x]);
    }
    return left;
}

/* The same where view n agrees at any whole disparity. The pixel beside a pixel is mostly of the same surface. */
static int drop_seen(uint16_t *column, int columns, const struct neighbour *n, int y)
{
    int left = 0, last = -1;

    for (int i = 0; i < columns; i++) {
        const int x = column[i];
        const int step = last >= 0 && agrees(n, x, y, last * (int)SST_DISP_SCALE) ? last : find_agreement(n, x, y);

        column[left] = (uint16_t)x;
        left += step < 0;
        last = step < 0 ? last : step;
    }
    return left;
}

/* A row, view by view: places of pixels side by side in a view lie in the same lines of the cache. */
static void check_row(uint8_t *status, const uint16_t *d, const struct checked_row *r, uint16_t *column)
{
    int left = r->width;

    for (int x = 0; x < r->width; x++) {
        column[x] = (uint16_t)x;
        status[x] = SST_DISPARITY_CORRECT;
    }
    for (int i = 0; i < r->views && left; i++)
        left = drop_correct(column, left, &r->view[i], d, r->y);
    for (int i = 0; i < left; i++)
        status[column[i]] = SST_DISPARITY_MISMATCH;
    for (int i = 0; i < r->views && left; i++)
        left = drop_seen(column, left, &r->view[i], r->y);
    for (int i = 0; i < left; i++)
        status[column[i]] = SST_DISPARITY_OCCLUSION;
}

void sst_disparity_check_views(struct sst_map_u8 *status, const struct sst_map_u16 *disp_q6,
                               const struct sst_checked_views *from, int steps)
{
    struct neighbour view[SST_MAX_NEIGHBOURS];
    struct checked_row row = { view, from->count, disp_q6->width, 0 };
    uint16_t column[SST_IMAGE_MAX_SIDE];

    for (int i = 0; i < from->count; i++) {
        const struct sst_checked_view *v = &from->view[i];

        view[i].disp = v->disp_q6;
        view[i].across = sst_shift_by(-v->bx, from->disp_min_px);
        view[i].down = sst_shift_by(-v->by, from->disp_min_px);
        find_places(&view[i], steps);
    }
    for (; row.y < disp_q6->height; row.y++)
        check_row(sst_map_u8_row(status, row.y), sst_map_u16_row(disp_q6, row.y), &row, column);
}

static bool is_wanted(uint8_t status, uint16_t disp)
{
    return status == SST_DISPARITY_OCCLUSION && disp == SST_DISP_NONE;
}

/* Let disparities land where pixels are left, and nowhere else. @return false: none is left */
static bool open_wanted(uint32_t *out, const struct sst_map_u16 *disp, const struct sst_map_u8 *status)
{
    unsigned any = 0;

    for (int y = 0; y < disp->height; y++, out += disp->width) {
        const uint16_t *d = sst_map_u16_row(disp, y);
        const uint8_t *s = sst_map_u8_row(status, y);

        for (int x = 0; x < disp->width; x++) {
            const bool wanted = is_wanted(s[x], d[x]);

            out[x] = wanted ? 0 : SST_LANDED_CLOSED;
            any |= wanted;
        }
    }
    return any;
}

/* Project the correct pixels of a neighbour into this view, to where pixels are left; the nearest surface wins.
 * @param out  [height][width] from open_wanted() */
static void project(uint32_t *out, const struct sst_checked_view *n, double disp_min_px)
{
    struct sst_landing l = { .width = n->disp_q6->width, .height = n->disp_q6->height };
    uint16_t correct[SST_IMAGE_MAX_SIDE];

    if (fmax(fabs(n->bx), fabs(n->by)) > SST_LANDED_FAR) /* shows nothing of this view */
        return;
    sst_shift_parts(sst_shift_by(n->bx, disp_min_px), &l.whole[0], &l.part[0], &l.step[0]);
    sst_shift_parts(sst_shift_by(n->by, disp_min_px), &l.whole[1], &l.part[1], &l.step[1]);
    for (; l.y < l.height; l.y++) {
        const uint16_t *d = sst_map_u16_row(n->disp_q6, l.y);
        const uint8_t *status = sst_map_u8_row(n->status, l.y);

        for (int x = 0; x < l.width; x++)
            correct[x] = (uint16_t)(d[x] | -(status[x] != SST_DISPARITY_CORRECT));
        sst_kernels_get()->land_row(out, NULL, &l, correct, NULL, (size_t)l.width);
    }
}

/* Copy the projected value to every pixel that is left. */
static void copy_projected(struct sst_map_u16 *disp, const uint32_t *projected)
{
    for (int y = 0; y < disp->height; y++, projected += disp->width) {
        uint16_t *d = sst_map_u16_row(disp, y);

        for (int x = 0; x < disp->width; x++) {
            const uint32_t there = projected[x] >> SST_LANDED_DISP;

            d[x] = projected[x] && projected[x] != SST_LANDED_CLOSED ? (uint16_t)(there - 1) : d[x];
        }
    }
}

/* Directions at about 22.5 degrees: a step of two pixels along one axis, and one along the other in two steps. */
static const int8_t direction[DIRECTIONS][2] = { { 2, 0 },  { 2, 1 },  { 2, 2 },  { 1, 2 },   { 0, 2 },   { -1, 2 },
                                                 { -2, 2 }, { -2, 1 }, { -2, 0 }, { -2, -1 }, { -2, -2 }, { -1, -2 },
                                                 { 0, -2 }, { 1, -2 }, { 2, -2 }, { 2, -1 } };

/* Places that a direction has from a coordinate on before the picture ends; places r are step * r / 2 away. A step has
 * one or two pixels. */
static int places(int from, int step, int size)
{
    if (!step)
        return INT_MAX;
    return step > 0 ? (2 * (size - 1 - from) + 1) >> (step - 1) : (2 * from + 1) >> (-step - 1);
}

/* The first of the places of a direction that is correct; 0: none. */
static int nearest_correct(const struct sst_map_u8 *status, const int8_t step[2], int x, int y)
{
    const int most = sst_min_int(places(x, step[0], status->width), places(y, step[1], status->height));
    const ptrdiff_t stride = (ptrdiff_t)status->stride, whole = step[1] * stride + step[0];
    const ptrdiff_t odd = step[1] / 2 * stride + step[0] / 2;
    const uint8_t *at = sst_map_u8_row(status, y) + x;
    int r = 1;

    for (; r < most; r += 2, at += whole) {
        if (at[odd] == SST_DISPARITY_CORRECT)
            return r;
        if (at[whole] == SST_DISPARITY_CORRECT)
            return r + 1;
    }
    return r == most && at[odd] == SST_DISPARITY_CORRECT ? r : 0;
}

/* Median of the nearest correct pixels in all directions (lower one of an even number); NONE if there is none. */
static uint16_t median_around(const struct sst_map_u16 *disp, const struct sst_map_u8 *status, int x, int y)
{
    uint16_t v[DIRECTIONS];
    int n = 0;

    for (int k = 0; k < DIRECTIONS; k++) {
        const int r = nearest_correct(status, direction[k], x, y);
        uint16_t found;
        int place;

        if (!r)
            continue;
        found = sst_map_u16_row(disp, y + direction[k][1] * r / 2)[x + direction[k][0] * r / 2];
        for (place = n++; place > 0 && v[place - 1] > found; place--)
            v[place] = v[place - 1];
        v[place] = found;
    }
    return n ? v[(n - 1) / 2] : (uint16_t)SST_DISP_NONE;
}

/* Remaining pixels get the farther of the nearest known disparities to their left and right: the background. */
static void fill_row_from_background(uint16_t *d, int width)
{
    for (int x = 0; x < width;) {
        int end = x;
        uint16_t left, right;

        if (d[x] != SST_DISP_NONE) {
            x++;
            continue;
        }
        while (end < width && d[end] == SST_DISP_NONE)
            end++;
        left = x > 0 ? d[x - 1] : (uint16_t)SST_DISP_NONE;
        right = end < width ? d[end] : (uint16_t)SST_DISP_NONE;
        for (; x < end; x++)
            d[x] = left < right ? left : right; /* NONE is the largest value */
    }
}

void sst_fill_background(struct sst_map_u16 *disp)
{
    int known = -1;

    for (int y = 0; y < disp->height; y++) {
        uint16_t *d = sst_map_u16_row(disp, y);

        fill_row_from_background(d, disp->width);
        if (d[0] == SST_DISP_NONE)
            continue;
        /* A filled row is dense; empty rows above copy the first one, those below the last one. */
        for (int j = known + 1; j < y; j++)
            memcpy(sst_map_u16_row(disp, j), sst_map_u16_row(disp, known >= 0 ? known : y),
                   (size_t)disp->width * sizeof(*d));
        known = y;
    }
    for (int j = known + 1; known >= 0 && j < disp->height; j++)
        memcpy(sst_map_u16_row(disp, j), sst_map_u16_row(disp, known), (size_t)disp->width * sizeof(uint16_t));
}

void sst_fill_views(struct sst_map_u16 *disp_q6, const struct sst_map_u8 *status, const struct sst_checked_views *from,
                    uint32_t *scratch)
{
    for (int y = 0; y < disp_q6->height; y++) {
        uint16_t *d = sst_map_u16_row(disp_q6, y);

        for (int x = 0; x < disp_q6->width; x++) {
            const int s = sst_map_u8_row(status, y)[x];

            if (s == SST_DISPARITY_MISMATCH)
                d[x] = median_around(disp_q6, status, x, y);
            else if (s == SST_DISPARITY_OCCLUSION)
                d[x] = SST_DISP_NONE;
        }
    }
    for (int i = 0; i < from->count;) {
        const int end = i < from->near ? from->near : from->count;

        if (!open_wanted(scratch, disp_q6, status))
            break;
        for (; i < end; i++)
            project(scratch, &from->view[i], from->disp_min_px);
        copy_projected(disp_q6, scratch);
    }
    sst_fill_background(disp_q6);
}
