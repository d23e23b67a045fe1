/* Weights of a view's rays: correlation with other views on a surface against that on surfaces in front of it. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/mem.h"
#include "pipeline/posed/surface_internal.h"

#define RADIUS    (SST_WINDOW / 2)
#define FLOOR     0.01f /* variance, of 1 over a picture */
#define SAME      1     /* steps from the surface that still are the surface */
#define CLEARANCE 3     /* steps in front of it that are something else */
#define STRIDE    4     /* of the order of steps: a surface in front shows early, and ends the search in its cell */
#define BIAS      0.02f /* correlation: of the many surfaces in front one is better by chance */
#define SOFT      0.06f
#define LEAST     0.35f /* correlation on the surface from which on a ray counts, ... */
#define FULL      0.55f /* and from which on it counts fully */
#define RING      (4 * WARP_CELL) /* rows of another view that are held */

_Static_assert(LAYER_WINDOW == SST_WINDOW && LAYER_OTHERS <= SST_WINDOW_OTHERS, "the kernels compare them");

/* Another view on a surface: four bands of its rows, and the sums of the row in work. */
struct other {
    struct sst_warped_source from;
    struct warp_view view;
    int16_t *level;     /* [RING][stride] */
    uint8_t *seen;      /* [RING][stride] */
    int pixels[4];      /* that it sees of a band, ... */
    int32_t *sum[3];    /* [stride] columns: levels, squares, products */
    float *mean, *inverse; /* [stride] */
};

struct layer_scratch {
    const struct layers *in;
    struct warp warp;
    struct warp_rows rows;
    size_t width, height, stride;
    int16_t *own, *zero;   /* [height][stride], [stride] */
    float *mean, *inverse; /* [height][stride] of the view's windows */
    float *on, *before;    /* [height][stride] largest correlations */
    uint8_t *alive;        /* [bands][across] cells with weights that may be above 0 */
    struct warp_part *part; /* [across] */
    int needed[4];         /* pixels of a band that are sampled */
    struct other other[LAYER_OTHERS];
    int others;
};

static void scratch_fini(struct layer_scratch *s)
{
    for (int k = 0; k < LAYER_OTHERS; k++) {
        sst_mem_free(s->other[k].level);
        sst_mem_free(s->other[k].seen);
        sst_mem_free(s->other[k].sum[0]);
        sst_mem_free(s->other[k].mean);
    }
    sst_mem_free(s->own);
    sst_mem_free(s->mean);
    sst_mem_free(s->alive);
    sst_mem_free(s->part);
    warp_rows_fini(&s->rows);
    warp_fini(&s->warp);
    *s = (struct layer_scratch){ 0 };
}

static bool other_init(struct other *o, const struct layer_scratch *s, int view)
{
    const struct sst_deep *picture = &s->in->greys->picture[view];

    o->from = warp_source(picture);
    o->view = warp_view_of(&s->warp.camera, &s->in->greys->camera[view], picture->width, picture->height);
    o->level = sst_mem_alloc(RING * s->stride, sizeof(*o->level));
    o->seen = sst_mem_alloc(RING * s->stride, sizeof(*o->seen));
    o->sum[0] = sst_mem_alloc(3 * s->stride, sizeof(*o->sum[0]));
    o->mean = sst_mem_alloc(2 * s->stride, sizeof(*o->mean));
    if (!o->level || !o->seen || !o->sum[0] || !o->mean)
        return false;
    for (int i = 1; i < 3; i++)
        o->sum[i] = o->sum[0] + (size_t)i * s->stride;
    o->inverse = o->mean + s->stride;
    return true;
}

static int scratch_init(struct layer_scratch *s, const struct layers *in, int view, const struct sst_virtual *camera)
{
    size_t pixels;
    bool made;
    int err = warp_init(&s->warp, camera, &in->surface);

    err = err ? err : warp_keep(&s->warp);
    if (err)
        return err;
    s->in = in;
    s->width = (size_t)camera->width;
    s->height = (size_t)camera->height;
    s->stride = (size_t)s->warp.across * WARP_CELL;
    pixels = s->height * s->stride;
    s->own = sst_mem_alloc(pixels + s->stride, sizeof(*s->own));
    s->mean = sst_mem_alloc(4 * pixels, sizeof(*s->mean));
    s->alive = sst_mem_alloc((size_t)s->warp.bands * (size_t)s->warp.across, sizeof(*s->alive));
    s->part = sst_mem_alloc((size_t)s->warp.across, sizeof(*s->part));
    made = s->own && s->mean && s->alive && s->part && !warp_rows_init(&s->rows, &s->warp);
    for (; made && s->others < LAYER_OTHERS && in->other[view][s->others] >= 0; s->others++)
        made = other_init(&s->other[s->others], s, in->other[view][s->others]);
    if (!made)
        return -ENOMEM;
    s->zero = s->own + pixels;
    s->inverse = s->mean + pixels;
    s->on = s->mean + 2 * pixels;
    s->before = s->mean + 3 * pixels;
    memcpy(s->alive, in->seen[view].cell, (size_t)s->warp.bands * (size_t)s->warp.across);
    return 0;
}

/* --- the view itself ------------------------------------------------------------------------------------------------
 */

static void sample_own(struct layer_scratch *s, uint8_t *seen, int view)
{
    const struct sst_deep *picture = &s->in->greys->picture[view];
    const struct sst_warped_source from = warp_source(picture);
    const struct warp_view own =
        warp_view_of(&s->warp.camera, &s->in->greys->camera[view], picture->width, picture->height);

    for (int band = 0; band < s->warp.bands; band++) {
        warp_band(&s->rows, &s->warp, &own, band);
        for (size_t r = 0; r < WARP_CELL && (size_t)band * WARP_CELL + r < s->height; r++) {
            const size_t at = ((size_t)band * WARP_CELL + r) * s->stride;

            sst_kernels_get()->level_row(s->own + at, seen + at, &from, s->rows.segment[r],
                                         (size_t)s->rows.segments[r]);
        }
    }
}

/* Levels of the view, and the means and 1 / standard deviations of its windows. */
static int prepare_own(struct layer_scratch *s, int view)
{
    const struct sst_kernels *kernels = sst_kernels_get();
    int32_t *const sum = sst_mem_alloc(2 * s->stride, sizeof(*sum));
    uint8_t *const seen = sst_mem_alloc(s->height * s->stride, sizeof(*seen));
    const int err = sum && seen ? 0 : -ENOMEM;

    if (!err)
        sample_own(s, seen, view);
    for (size_t y = 0; !err && y < s->height && s->width > 2 * RADIUS; y++) {
        const int16_t *const in = s->own + y * s->stride;
        const int16_t *const row[2] = { in, y >= SST_WINDOW ? in - SST_WINDOW * s->stride : s->zero };
        struct sst_window_sums sums = { sum, sum + s->stride, { NULL, NULL }, FLOOR };

        kernels->window_squares(sum, sum + s->stride, row, s->width);
        if (y >= 2 * RADIUS) {
            const size_t at = (y - RADIUS) * s->stride + RADIUS;

            sums.seen[0] = seen + (y - 2 * RADIUS) * s->stride;
            sums.seen[1] = seen + y * s->stride;
            kernels->window_stats(s->mean + at, s->inverse + at, &sums, s->width - 2 * RADIUS);
        }
    }
    sst_mem_free(seen);
    sst_mem_free(sum);
    return err;
}

/* --- other views ----------------------------------------------------------------------------------------------------
 */

static bool is_alive(const struct layer_scratch *s, int band, int cell)
{
    return band >= 0 && band < s->warp.bands && cell >= 0 && cell < s->warp.across &&
           s->alive[band * s->warp.across + cell];
}

/* Part of a cell that windows of it and of its neighbours need. */
static struct warp_part part_of(const struct layer_scratch *s, int band, int cell)
{
    struct warp_part part = { 0, WARP_CELL, 0 };

    for (int i = 0; i < 9; i++) {
        const int down = i / 3 - 1, right = i % 3 - 1;

        if (!is_alive(s, band + down, cell + right))
            continue;
        part.rows = (uint16_t)(part.rows | (down < 0   ? (1u << RADIUS) - 1
                                            : down > 0 ? UINT16_MAX << (WARP_CELL - RADIUS) & UINT16_MAX
                                                       : UINT16_MAX));
        part.from = (uint8_t)sst_min_int(part.from, right > 0 ? WARP_CELL - RADIUS : 0);
        part.to = (uint8_t)sst_max_int(part.to, right < 0 ? RADIUS : WARP_CELL);
    }
    return part;
}

/* Rows of a band that are in the picture, as bits. */
static unsigned rows_inside(const struct layer_scratch *s, int band)
{
    const int rows = sst_min_int(WARP_CELL, (int)s->height - band * WARP_CELL);

    return (1u << rows) - 1;
}

static int choose_parts(struct layer_scratch *s, int band)
{
    int pixels = 0;

    for (int cell = 0; cell < s->warp.across; cell++) {
        struct warp_part *p = &s->part[cell];

        *p = part_of(s, band, cell);
        p->rows = (uint16_t)(p->rows & rows_inside(s, band));
        p->to = (uint8_t)sst_min_int(p->to, (int)s->width - cell * WARP_CELL);
        if (p->rows && p->to > p->from)
            pixels += __builtin_popcount(p->rows) * (p->to - p->from);
        else
            p->rows = 0;
    }
    return pixels;
}

/* A band of the other views, where it is needed. */
static void sample_band(struct layer_scratch *s, int band)
{
    const struct sst_kernels *kernels = sst_kernels_get();

    s->needed[band % 4] = choose_parts(s, band);
    for (int k = 0; k < s->others; k++) {
        struct other *o = &s->other[k];
        int *const pixels = &o->pixels[band % 4];

        *pixels = 0;
        if (!s->needed[band % 4])
            continue;
        warp_cells(&s->rows, &s->warp, &o->view, band, s->part);
        for (int r = 0; r < WARP_CELL; r++) {
            for (int i = 0; i < s->rows.segments[r]; i++)
                *pixels += s->rows.segment[r][i].n;
        }
        for (int r = 0; r < WARP_CELL; r++) {
            const size_t row = (size_t)(band * WARP_CELL + r) % RING;

            if (*pixels < s->needed[band % 4]) { /* unseen pixels have level 0 */
                memset(o->level + row * s->stride, 0, s->stride * sizeof(*o->level));
                memset(o->seen + row * s->stride, 0, s->stride);
            }
            kernels->level_row(o->level + row * s->stride, o->seen + row * s->stride, &o->from, s->rows.segment[r],
                               (size_t)s->rows.segments[r]);
        }
    }
}

/* --- comparison -----------------------------------------------------------------------------------------------------
 */

/* Windows of one row of pixels: the first one, and their number. */
struct stretch {
    size_t x, y, n;
    int band;
};

static const int16_t *other_row(const struct layer_scratch *s, const struct other *o, size_t y)
{
    return o->level + y % RING * s->stride;
}

/* Column sums up to row `in`, without row `out`; SIZE_MAX: none is taken away. */
static void move_sums(const struct layer_scratch *s, struct other *o, const struct stretch *at, size_t in, size_t out)
{
    const struct sst_kernels *kernels = sst_kernels_get();
    const size_t x = at->x - RADIUS, n = at->n + 2 * RADIUS;
    const int16_t *own[2] = { s->own + in * s->stride + x, s->zero }, *other[2] = { other_row(s, o, in) + x, s->zero };

    if (out != SIZE_MAX) {
        own[1] = s->own + out * s->stride + x;
        other[1] = other_row(s, o, out) + x;
    }
    kernels->window_squares(o->sum[0], o->sum[1], other, n);
    kernels->window_products(o->sum[2], own, other, n);
}

/* Does a view see something of a stretch's band and its neighbours; all that is needed of them? */
static void sees(const struct layer_scratch *s, const struct other *o, int band, bool *any, bool *all)
{
    *any = false;
    *all = true;
    for (int b = sst_max_int(band - 1, 0); b <= sst_min_int(band + 1, s->warp.bands - 1); b++) {
        *any |= o->pixels[b % 4] > 0;
        *all &= o->pixels[b % 4] == s->needed[b % 4];
    }
}

/* Correlations of the rows of a stretch's band with all other views. */
static void compare_stretch(struct layer_scratch *s, float *largest, struct stretch at)
{
    const struct sst_kernels *kernels = sst_kernels_get();
    const size_t first = sst_max_int(at.band * WARP_CELL, RADIUS), x = at.x - RADIUS;
    const size_t end = (size_t)sst_min_int((at.band + 1) * WARP_CELL, (int)s->height - RADIUS);
    struct sst_window_row row = { .floor = FLOOR };
    struct other *of[LAYER_OTHERS];
    bool all[LAYER_OTHERS];

    for (int k = 0; k < s->others; k++) {
        struct other *o = &s->other[k];
        bool any;

        sees(s, o, at.band, &any, &all[row.others]);
        if (!any)
            continue;
        of[row.others] = o;
        row.other_mean[row.others] = o->mean;
        row.other_inverse[row.others] = o->inverse;
        row.products[row.others++] = o->sum[2];
        memset(o->sum[0], 0, 3 * s->stride * sizeof(*o->sum[0]));
        for (size_t y = first - RADIUS; y < first + RADIUS; y++)
            move_sums(s, o, &at, y, SIZE_MAX);
    }
    for (at.y = first; row.others && at.y < end; at.y++) {
        const size_t own = at.y * s->stride + at.x;

        for (size_t k = 0; k < row.others; k++) {
            struct other *o = of[k];
            struct sst_window_sums sums = { o->sum[0], o->sum[1], { NULL, NULL }, FLOOR };

            move_sums(s, o, &at, at.y + RADIUS, at.y > first ? at.y - RADIUS - 1 : SIZE_MAX);
            for (size_t i = 0; i < 2 && !all[k]; i++)
                sums.seen[i] = o->seen + (at.y + 2 * RADIUS * i - RADIUS) % RING * s->stride + x;
            kernels->window_stats(o->mean, o->inverse, &sums, at.n);
        }
        row.mean = s->mean + own;
        row.inverse = s->inverse + own;
        kernels->window_best(largest + own, &row, at.n);
    }
}

/* Neighbouring cells of a band together. */
static void compare_band(struct layer_scratch *s, float *largest, int band)
{
    for (int cell = 0; cell < s->warp.across; cell++) {
        const int first = cell;
        size_t x, end;

        while (is_alive(s, band, cell))
            cell++;
        x = (size_t)sst_max_int(first * WARP_CELL, RADIUS);
        end = (size_t)sst_min_int(cell * WARP_CELL, (int)s->width - RADIUS);
        if (cell > first && end > x && (int)end > RADIUS)
            compare_stretch(s, largest, (struct stretch){ .x = x, .n = end - x, .band = band });
    }
}

/* The largest correlations with other views on a step's surface. */
static void compare_step(struct layer_scratch *s, float *largest, int step)
{
    warp_raise(&s->warp, layers_height(s->in, step), step > SAME);
    sample_band(s, 0);
    for (int band = 0; band < s->warp.bands; band++) {
        if (band + 1 < s->warp.bands)
            sample_band(s, band + 1);
        compare_band(s, largest, band);
    }
}

/* --- weights --------------------------------------------------------------------------------------------------------
 */

/* Are all weights of a cell 0, whatever correlations in front of the surface may follow? */
static bool is_blocked(const struct layer_scratch *s, int band, int cell)
{
    for (size_t y = (size_t)band * WARP_CELL; y < (size_t)(band + 1) * WARP_CELL && y < s->height; y++) {
        const size_t at = y * s->stride + (size_t)cell * WARP_CELL;
        int open = 0;

        for (size_t x = at; x < at + WARP_CELL; x++)
            open |= (s->on[x] > LEAST) & (s->before[x] < s->on[x] + (BIAS + 2 * SOFT));
        if (open)
            return false;
    }
    return true;
}

/* @return false: no cell is left */
static bool close_cells(struct layer_scratch *s)
{
    bool any = false;

    for (int band = 0; band < s->warp.bands; band++) {
        for (int cell = 0; cell < s->warp.across; cell++) {
            uint8_t *alive = &s->alive[band * s->warp.across + cell];

            *alive = *alive && !is_blocked(s, band, cell);
            any |= *alive;
        }
    }
    return any;
}

static float ramp(float v, float lo, float hi)
{
    const float t = (v - lo) / (hi - lo);

    return t <= 0 ? 0 : t >= 1 ? 1 : t * t * (3 - 2 * t);
}

static void write_weights(struct sst_map_u8 *out, const struct layer_scratch *s)
{
    for (size_t y = 0; y < s->height; y++) {
        for (size_t x = 0; x < s->width; x++) {
            const float on = s->on[y * s->stride + x], before = s->before[y * s->stride + x];
            const float better = on > LEAST ? ramp(on - before + BIAS, -2 * SOFT, 2 * SOFT) : 0;

            sst_map_u8_row(out, (int)y)[x] = (uint8_t)(255 * better * ramp(on, LEAST, FULL) + 0.5f);
        }
    }
}

int layers_weigh(struct sst_map_u8 *out, const struct layers *in, int view)
{
    const struct sst_deep *picture = &in->greys->picture[view];
    const struct sst_calib_camera *cam = &in->greys->camera[view];
    struct sst_virtual camera = { picture->width, picture->height, cam->fx, cam->fy, cam->cx, cam->cy, { 0 }, { 0 } };
    struct layer_scratch s = { 0 };
    int err;

    memcpy(camera.rotation, cam->rotation, sizeof(camera.rotation));
    memcpy(camera.centre_mm, cam->position_mm, sizeof(camera.centre_mm));
    err = scratch_init(&s, in, view, &camera);
    err = err ? err : prepare_own(&s, view);
    err = err ? err : sst_map_u8_init(out, camera.width, camera.height);
    if (!err) {
        bool any;

        for (int step = -SAME; step <= SAME; step++)
            compare_step(&s, s.on, step);
        any = close_cells(&s);
        for (int i = 0; any && i < STRIDE; i++) {
            for (int step = CLEARANCE + i; any && step < in->steps; step += STRIDE) {
                compare_step(&s, s.before, step);
                any = close_cells(&s);
            }
        }
        write_weights(out, &s);
    }
    scratch_fini(&s);
    return err;
}
