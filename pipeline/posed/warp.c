/* Places of a virtual camera's pixels in views: exact at corners of cells, between them bilinear. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "base/mem.h"
#include "pipeline/posed/surface_internal.h"

#define STEP       8 /* px between the points of the lattice: cells' corners, the middles of their edges and of them */
#define FAR_MM     1e15 /* a surface further away is none */
#define FAR_PX     4e4  /* places further out are none */
#define STRETCHED  (1 << 26) /* in 1/65536 px over a cell: steps are computed in 64 bits from there on */
#define LENS_REACH 1.3  /* a lens counts up to this multiple of its picture's farthest corner */

static size_t depth_count(const struct warp *w)
{
    return (size_t)w->bands * (WARP_CELL + 1) * ((size_t)w->across * WARP_CELL + 1);
}

void warp_restart(struct warp *warp, const struct sst_surface *surface)
{
    const size_t depths = depth_count(warp);

    warp->surface = *surface;
    for (size_t i = 0; i < depths; i++)
        warp->depth[i] = -1;
}

int warp_keep(struct warp *warp)
{
    const size_t depths = depth_count(warp);

    warp->base = sst_mem_alloc_raw(depths, sizeof(*warp->base));
    if (!warp->base)
        return -ENOMEM;
    for (size_t i = 0; i < depths; i++)
        warp->base[i] = -1;
    return 0;
}

void warp_raise(struct warp *warp, double mm, bool coarse)
{
    const size_t depths = depth_count(warp);

    warp->rise_mm = mm;
    warp->coarse = coarse;
    for (size_t i = 0; i < depths; i++)
        warp->depth[i] = -1;
}

int warp_init(struct warp *warp, const struct sst_virtual *camera, const struct sst_surface *surface)
{
    struct warp w = { .camera = *camera };

    w.across = (camera->width + WARP_CELL - 1) / WARP_CELL;
    w.bands = (camera->height + WARP_CELL - 1) / WARP_CELL;
    w.depth = sst_mem_alloc_raw(depth_count(&w), sizeof(*w.depth));
    if (!w.depth)
        return -ENOMEM;
    warp_restart(&w, surface);
    *warp = w;
    return 0;
}

void warp_fini(struct warp *warp)
{
    sst_mem_free(warp->depth);
    sst_mem_free(warp->base);
    warp->depth = NULL;
    warp->base = NULL;
}

int warp_rows_init(struct warp_rows *rows, const struct warp *warp)
{
    struct warp_rows r = { 0 };

    r.segment[0] = sst_mem_alloc_raw((size_t)WARP_CELL * (size_t)warp->across * WARP_CELL, sizeof(*r.segment[0]));
    if (!r.segment[0])
        return -ENOMEM;
    for (int i = 1; i < WARP_CELL; i++)
        r.segment[i] = r.segment[i - 1] + (size_t)warp->across * WARP_CELL;
    *rows = r;
    return 0;
}

void warp_rows_fini(struct warp_rows *rows)
{
    sst_mem_free(rows->segment[0]);
    *rows = (struct warp_rows){ 0 };
}

/* Radius up to which the lens maps larger angles further out, at most a little beyond the picture's corners. */
static double lens_reach(const struct sst_calib_camera *cam, int width, int height)
{
    const double dx = fmax(cam->cx, width - 1 - cam->cx) / cam->fx, dy = fmax(cam->cy, height - 1 - cam->cy) / cam->fy;
    const double corner = LENS_REACH * hypot(dx, dy), *k = cam->k;
    double last = 0;

    if (!cam->lens)
        return INFINITY;
    for (int i = 1; i <= 1000; i++) {
        const double r = 2 * corner * i / 1000, r2 = r * r;
        const double seen =
            r * (1 + r2 * (k[0] + r2 * (k[1] + r2 * k[4]))) / (1 + r2 * (k[5] + r2 * (k[6] + r2 * k[7])));

        if (!isgreater(seen, last)) /* or no number */
            return 2 * corner * (i - 1) / 1000;
        if (seen > corner)
            return r;
        last = seen;
    }
    return 2 * corner;
}

struct warp_view warp_view_of(const struct sst_virtual *from, const struct sst_calib_camera *camera, int width,
                              int height)
{
    struct warp_view v = { .camera = camera, .width = width, .height = height };
    const double reach = lens_reach(camera, width, height);
    double apart[3];

    sst_rotation_between(camera->rotation, from->rotation, v.turn);
    for (int i = 0; i < 3; i++)
        apart[i] = from->centre_mm[i] - camera->position_mm[i];
    for (int i = 0; i < 3; i++)
        v.move_mm[i] = vector_dot(camera->rotation + 3 * i, apart);
    v.most_r2 = reach * reach;
    return v;
}

/* Project the pixel (a, b) at a depth. @return false: behind the view or beyond its lens */
static inline bool project(const struct warp_view *view, const double ab[2], double depth_mm, double xy[2])
{
    const double *t = view->turn;
    const struct sst_calib_camera *cam = view->camera;
    double at[3], a, b, per_z;

    if (!(depth_mm < FAR_MM))
        return false;
    for (int i = 0; i < 3; i++)
        at[i] = (t[3 * i] * ab[0] + t[3 * i + 1] * ab[1] + t[3 * i + 2]) * depth_mm + view->move_mm[i];
    if (!(at[2] > 1e-9))
        return false;
    per_z = 1 / at[2];
    a = at[0] * per_z;
    b = at[1] * per_z;
    if (!(a * a + b * b <= view->most_r2))
        return false;
    if (cam->lens) {
        sst_camera_distort(cam, a, b, &xy[0], &xy[1]);
    } else {
        xy[0] = cam->fx * a + cam->cx;
        xy[1] = cam->fy * b + cam->cy;
    }
    return fabs(xy[0]) < FAR_PX && fabs(xy[1]) < FAR_PX;
}

struct sst_warped_source warp_source(const struct sst_deep *picture)
{
    struct sst_warped_source from = {
        { NULL }, picture->plane[0].stride / sizeof(uint16_t), picture->width, picture->height, picture->channels
    };

    for (int c = 0; c < picture->channels; c++)
        from.plane[c] = picture->plane[c].data;
    return from;
}

bool warp_source_fits(int width, int height)
{
    return width >= 2 && height >= 2 && width < SST_IMAGE_MAX_SIDE && height < SST_IMAGE_MAX_SIDE;
}

int warp_check_size(const struct sst_posed *posed, const char *dir)
{
    if (warp_source_fits(posed->width, posed->height))
        return 0;
    sst_log_error("%s has pictures of %d x %d pixels; those that are rendered have sides of 2 to %d", dir, posed->width,
                  posed->height, SST_IMAGE_MAX_SIDE - 1);
    return -EBADMSG;
}

/* --- one band -------------------------------------------------------------------------------------------------------
 */

struct band {
    struct warp_rows *rows_of;
    const struct warp *warp;
    const struct warp_view *view;
    float *depth, *base; /* of the band's first row */
    int y;
    /* of the cell in work */
    unsigned rows; /* bits: the needed ones, ... */
    int from, to;  /* ... in these columns */
};

static size_t depth_at(const struct band *band, int x, int y)
{
    return (size_t)y * ((size_t)band->warp->across * WARP_CELL + 1) + (size_t)x;
}

/* Depth of the surface itself. */
static double base_depth(const struct band *band, int x, int y)
{
    float *base = &band->base[depth_at(band, x, y)];
    double ray[3];

    if (*base < 0) {
        sst_virtual_ray(&band->warp->camera, x, band->y + y, ray);
        *base = (float)sst_surface_meet(&band->warp->surface, band->warp->camera.centre_mm, ray);
    }
    return (double)*base;
}

/* ... between the corners of a cell. @return INFINITY: a corner has none */
static double coarse_depth(const struct band *band, int x, int y)
{
    const int left = x / WARP_CELL * WARP_CELL, top = y / WARP_CELL * WARP_CELL;
    const double right = (double)(x - left) / WARP_CELL, down = (double)(y - top) / WARP_CELL;
    double inverse = 0;

    for (int i = 0; i < 4; i++) {
        const double w = (i % 2 ? right : 1 - right) * (i / 2 ? down : 1 - down);
        const double depth = w > 0 ? base_depth(band, left + i % 2 * WARP_CELL, top + i / 2 * WARP_CELL) : 1;

        if (!isfinite(depth))
            return INFINITY;
        inverse += w / depth;
    }
    return 1 / inverse;
}

/* Depth of a pixel of column x and row y of the band. */
static float find_depth(const struct band *band, int x, int y)
{
    const struct warp *warp = band->warp;
    double ray[3], along, depth;

    sst_virtual_ray(&warp->camera, x, band->y + y, ray);
    if (!band->base)
        return (float)sst_surface_meet(&warp->surface, warp->camera.centre_mm, ray);
    depth = warp->coarse ? coarse_depth(band, x, y) : INFINITY;
    depth = isfinite(depth) ? depth : base_depth(band, x, y);
    along = -vector_dot(warp->surface.normal, ray);
    depth = along == 0 ? INFINITY : depth - warp->rise_mm / along;
    return isfinite(depth) && depth > 0 ? (float)depth : INFINITY;
}

/* A pixel's place in the view, of column x and row y of the band; NAN: none. */
static inline void place(const struct band *band, int x, int y, double xy[2])
{
    const struct sst_virtual *camera = &band->warp->camera;
    float *depth = band->depth + depth_at(band, x, y);
    const double ab[2] = { (x - camera->cx) / camera->fx, (band->y + y - camera->cy) / camera->fy };

    if (*depth < 0)
        *depth = find_depth(band, x, y);
    if (!project(band->view, ab, (double)*depth, xy))
        xy[0] = xy[1] = NAN;
}

static int64_t least(int64_t a, int64_t b)
{
    return a < b ? a : b;
}

/* Narrow range[0] <= i < range[1] to where 0 <= at + i step <= most. */
static void inside(int64_t range[2], int64_t at, int64_t step, int64_t most)
{
    if (step == 0) {
        if (at < 0 || at > most)
            range[1] = range[0];
        return;
    }
    if (step < 0) {
        at = most - at;
        step = -step;
    }
    if (at < 0)
        range[0] = -least(-range[0], -((-at + step - 1) / step));
    range[1] = at > most ? range[0] : least(range[1], (most - at) / step + 1);
}

static int64_t rounded_shift(int64_t v, int shift)
{
    return shift ? (v + ((int64_t)1 << (shift - 1))) >> shift : v;
}

/* (v r + WARP_CELL / 2) / WARP_CELL, downwards */
static int32_t part_of(int32_t v, int r)
{
    return (v * r + WARP_CELL / 2) >> 4;
}

/* Segments of a cell of the largest size that lies in the picture, as add_cell()'s. @return false: it is stretched too far */
static bool add_whole(const struct band *band, int x, int64_t q16[4][2])
{
    const int first = sst_max_int(band->from - x, 0), n = sst_min_int(WARP_CELL, band->to - x) - first;
    const int rows = sst_min_int(WARP_CELL, band->warp->camera.height - band->y);
    int32_t from[2][WARP_CELL], step[2][WARP_CELL];

    for (int k = 0; k < 2; k++) {
        const int32_t left = (int32_t)q16[0][k], right = (int32_t)q16[1][k];
        const int32_t down[2] = { (int32_t)(q16[2][k] - q16[0][k]), (int32_t)(q16[3][k] - q16[1][k]) };

        if (abs(down[0]) > STRETCHED || abs(down[1]) > STRETCHED)
            return false;
        for (int r = 0; r < WARP_CELL; r++) {
            from[k][r] = left + part_of(down[0], r);
            step[k][r] = part_of(right + part_of(down[1], r) - from[k][r], 1);
        }
    }
    for (int r = 0; r < rows && n > 0; r++) {
        if (band->rows >> r & 1)
            band->rows_of->segment[r][band->rows_of->segments[r]++] =
                (struct sst_warped_segment){ from[0][r] + first * step[0][r],
                                             from[1][r] + first * step[1][r],
                                             n > 1 ? step[0][r] : 0,
                                             n > 1 ? step[1][r] : 0,
                                             x + first,
                                             n };
    }
    return true;
}

/* Segments of a cell whose places are bilinear between its four corners (left, right, then below). */
static void add_cell(const struct band *band, int x, int y, int log2_size, double corner[4][2])
{
    const struct sst_virtual *camera = &band->warp->camera;
    const int size = 1 << log2_size;
    const int64_t most[2] = { (int64_t)(band->view->width - 1) << 16, (int64_t)(band->view->height - 1) << 16 };
    int64_t q16[4][2];
    bool whole = true; /* the cell is inside the picture, as its corners are */

    for (int i = 0; i < 8; i++) {
        q16[i / 2][i % 2] = llrint(corner[i / 2][i % 2] * 65536);
        whole &= q16[i / 2][i % 2] >= size && q16[i / 2][i % 2] <= most[i % 2] - size; /* steps are rounded */
    }
    if (whole && size == WARP_CELL && add_whole(band, x, q16))
        return;
    for (int r = 0; r < size && band->y + y + r < camera->height; r++) {
        int64_t range[2] = { sst_max_int(band->from - x, 0), sst_min_int(size, band->to - x) }, from[2], step[2];
        struct sst_warped_segment *s;

        if (!(band->rows >> (y + r) & 1))
            continue;
        for (int k = 0; k < 2; k++) {
            from[k] = q16[0][k] + rounded_shift((q16[2][k] - q16[0][k]) * r, log2_size);
            step[k] =
                rounded_shift(q16[1][k] + rounded_shift((q16[3][k] - q16[1][k]) * r, log2_size) - from[k], log2_size);
            if (!whole)
                inside(range, from[k], step[k], most[k]);
        }
        if (range[0] >= range[1])
            continue;
        s = &band->rows_of->segment[y + r][band->rows_of->segments[y + r]++];
        s->n = (int32_t)(range[1] - range[0]);
        s->at = x + (int32_t)range[0];
        s->x_q16 = (int32_t)(from[0] + range[0] * step[0]);
        s->y_q16 = (int32_t)(from[1] + range[0] * step[1]);
        s->dx_q16 = s->n > 1 ? (int32_t)step[0] : 0;
        s->dy_q16 = s->n > 1 ? (int32_t)step[1] : 0;
    }
}

/* Do all nine places lie beyond one side of the picture? */
static bool beyond(const struct warp_view *view, double p[9][2])
{
    const double most[2] = { view->width - 1, view->height - 1 };

    for (int k = 0; k < 2; k++) {
        int below = 0, above = 0;

        for (int i = 0; i < 9; i++) {
            below += p[i][k] < -WARP_ERROR_PX;
            above += p[i][k] > most[k] + WARP_ERROR_PX;
        }
        if (below == 9 || above == 9)
            return true;
    }
    return false;
}

/* The largest error of bilinear interpolation at the middles of a cell and of its edges. */
static double largest_error(double p[9][2])
{
    static const int ends[4][3] = { { 1, 0, 2 }, { 3, 0, 6 }, { 5, 2, 8 }, { 7, 6, 8 } };
    double most = 0;

    for (int i = 0; i < 4; i++) {
        const double *middle = p[ends[i][0]], *a = p[ends[i][1]], *b = p[ends[i][2]];

        most = fmax(most, fmax(fabs(middle[0] - (a[0] + b[0]) / 2), fabs(middle[1] - (a[1] + b[1]) / 2)));
    }
    for (int k = 0; k < 2; k++)
        most = fmax(most, fabs(p[4][k] - (p[0][k] + p[2][k] + p[6][k] + p[8][k]) / 4));
    return most;
}

static void add_split(const struct band *band, int x, int y, int log2_size);

/* A cell with its corners, the middles of its edges and its own middle in rows. */
static void add_checked(const struct band *band, int x, int y, int log2_size, double p[9][2])
{
    int none = 0;

    for (int i = 0; i < 9; i++)
        none += isnan(p[i][0]);
    if (none == 9 || (!none && beyond(band->view, p)))
        return;
    if (!none && largest_error(p) <= WARP_ERROR_PX)
        add_cell(
            band, x, y, log2_size,
            (double[4][2]){ { p[0][0], p[0][1] }, { p[2][0], p[2][1] }, { p[6][0], p[6][1] }, { p[8][0], p[8][1] } });
    else
        add_split(band, x, y, log2_size - 1);
}

/* Four cells of the given size; of one pixel they have exact places. */
static void add_split(const struct band *band, int x, int y, int log2_size)
{
    const int size = 1 << log2_size;

    for (int i = 0; i < 4; i++) {
        const int left = x + i % 2 * size, top = y + i / 2 * size;
        double p[9][2];

        if (log2_size == 0) {
            place(band, left, top, p[0]);
            if (!isnan(p[0][0]))
                add_cell(band, left, top, 0,
                         (double[4][2]){
                             { p[0][0], p[0][1] }, { p[0][0], p[0][1] }, { p[0][0], p[0][1] }, { p[0][0], p[0][1] } });
            continue;
        }
        for (int k = 0; k < 9; k++)
            place(band, left + k % 3 * size / 2, top + k / 3 * size / 2, p[k]);
        add_checked(band, left, top, log2_size, p);
    }
}

void warp_cells(struct warp_rows *rows, struct warp *warp, const struct warp_view *view, int band,
                const struct warp_part *part)
{
    const size_t line = (size_t)warp->across * WARP_CELL + 1;
    const size_t first = (size_t)band * (WARP_CELL + 1) * line;
    struct band b = { .rows_of = rows,
                      .warp = warp,
                      .view = view,
                      .depth = warp->depth + first,
                      .base = warp->base ? warp->base + first : NULL,
                      .y = band * WARP_CELL };
    double p[9][2];
    bool beside = false; /* p is of the cell before */

    memset(rows->segments, 0, sizeof(rows->segments));
    for (int cell = 0; cell < warp->across; cell++) {
        const int left = cell * WARP_CELL;

        b.rows = part ? part[cell].rows : UINT16_MAX;
        if (!b.rows) {
            beside = false;
            continue;
        }
        b.from = left + (part ? part[cell].from : 0);
        b.to = sst_min_int(left + (part ? part[cell].to : WARP_CELL), warp->camera.width);
        for (int k = 0; k < 9; k++) {
            if (beside && k % 3 == 0)
                memcpy(p[k], p[k + 2], sizeof(p[k]));
            else
                place(&b, left + k % 3 * STEP, k / 3 * STEP, p[k]);
        }
        beside = true;
        add_checked(&b, left, 0, 4, p);
    }
}

void warp_band(struct warp_rows *rows, struct warp *warp, const struct warp_view *view, int band)
{
    warp_cells(rows, warp, view, band, NULL);
}
