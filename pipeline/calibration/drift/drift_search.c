/* Search of a feature in another view: correlation of a small block over a band about the predicted line. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <math.h>

#include "pipeline/calibration/drift/drift_internal.h"
#include "pipeline/kernels/kernels.h"

#define BLOCK_W            SST_CORRELATE_WIDTH /* pixels of the level: x - 4 .. x + 3, y - 4 .. y + 4 */
#define BLOCK_H            SST_CORRELATE_HEIGHT
#define ALONG_MAX          512
#define ACROSS_MAX         65
#define AREA_MAX           65536
#define AREA_SMALL         8192 /* a usual one */
#define CORRELATION_COARSE 0.7
#define DISTINCT           0.75 /* best match's distance from 1 over the next one's: above this it is ambiguous */

/* Grey values of a part of a level. */
struct area {
    int x0, y0, width, height;
    int16_t *v;
};

static bool block_inside(const struct area *a, int x, int y)
{
    return x >= a->x0 + 4 && y >= a->y0 + 4 && x + 3 < a->x0 + a->width && y + 4 < a->y0 + a->height;
}

/* Index of the first value of the block around a place. */
static int block_at(const struct area *a, int x, int y)
{
    return (y - 4 - a->y0) * a->width + (x - 4 - a->x0);
}

/* Set the size of the part of a level inside a rectangle. @return false: none, or too large a part */
static bool area_set(struct area *a, const struct drift_pyramid *view, int level, struct sst_rect within)
{
    int w, h;

    drift_level_size(view, level, &w, &h);
    a->x0 = sst_max_int(within.x0, 0);
    a->y0 = sst_max_int(within.y0, 0);
    a->width = sst_min_int(within.x1, w) - a->x0;
    a->height = sst_min_int(within.y1, h) - a->y0;
    return a->width >= BLOCK_W && a->height >= BLOCK_H && (int64_t)a->width * a->height <= AREA_MAX;
}

static void area_read(struct area *a, const struct drift_pyramid *view, int level)
{
    drift_read_grey(a->v, view, level, (struct sst_rect){ a->x0, a->y0, a->x0 + a->width, a->y0 + a->height });
}

static void block_read(struct sst_correlate *b, const struct area *in, int x, int y)
{
    const int16_t *p = in->v + block_at(in, x, y);
    int32_t squares = 0;

    b->sum = 0;
    for (int j = 0; j < BLOCK_H; j++, p += in->width) {
        for (int i = 0; i < BLOCK_W; i++) {
            b->block[j][i] = p[i];
            b->sum += p[i];
            squares += p[i] * p[i];
        }
    }
    b->spread = (double)squares * SST_CORRELATE_SIZE - (double)b->sum * b->sum;
}

struct field {
    int along, across;               /* steps of one pixel of the level */
    float v[ALONG_MAX * ACROSS_MAX]; /* [along][across] */
};

static float field_at(const struct field *f, int i, int j)
{
    return f->v[i * f->across + j];
}

static bool is_peak(const struct field *f, int i, int j)
{
    const float v = field_at(f, i, j);

    for (int di = -1; di <= 1; di++) {
        for (int dj = -1; dj <= 1; dj++) {
            const int k = i + di, l = j + dj;

            /* Equal neighbours: the first one is the peak. */
            if ((di || dj) && k >= 0 && l >= 0 && k < f->along && l < f->across &&
                (field_at(f, k, l) > v || (field_at(f, k, l) == v && (di < 0 || (!di && dj < 0)))))
                return false;
        }
    }
    return v > SST_CORRELATE_NONE;
}

/* Best peak, and the value of the next one that is more than two steps off. */
static bool two_peaks(const struct field *f, int *i, int *j, float *second)
{
    float best = SST_CORRELATE_NONE;
    int at = 0;

    for (int k = 0; k < f->along * f->across; k++) {
        if (f->v[k] > best) {
            best = f->v[k];
            at = k;
        }
    }
    *i = at / f->across;
    *j = at % f->across;
    *second = 0;
    for (int k = 0; k < f->along; k++) {
        for (int l = 0; l < f->across; l++) {
            const bool apart = k < *i - 2 || k > *i + 2 || l < *j - 2 || l > *j + 2;

            if (field_at(f, k, l) > *second && apart && is_peak(f, k, l))
                *second = field_at(f, k, l);
        }
    }
    return best > SST_CORRELATE_NONE;
}

static int round_down(double v)
{
    const int whole = (int)v;

    return whole - (whole > v);
}

/* A step along the line, or across it, px of the level. */
struct step {
    double x, y;
};

static struct step step_by(const double direction[2], double by)
{
    return (struct step){ direction[0] * by, direction[1] * by };
}

/* Pixel of the other view at a step along and one across. */
static void to_pixel(struct step along, struct step across, int *x, int *y)
{
    *x = round_down(along.x + across.x + 0.5);
    *y = round_down(along.y + across.y + 0.5);
}

/* Search: a block's places in an area of the other view. */
struct band {
    const struct drift_pyramid *b;
    const struct drift_search *s;
    struct sst_correlate block;
    struct area area;
    int x, y, level; /* the feature */
    int across;      /* steps to each side */
    bool whole;      /* all of it lies in the picture */
    double from, middle;
};

/* Everything that the search can touch: the corners of the band, and the block around. */
static bool set_band(struct band *n, int along)
{
    struct sst_rect r = { INT32_MAX, INT32_MAX, INT32_MIN, INT32_MIN };

    for (int i = 0; i < 4; i++) {
        int px, py;

        to_pixel(step_by(n->s->u, i % 2 ? n->from + along - 1 : n->from),
                 step_by(n->s->n, i / 2 ? n->middle + n->across : n->middle - n->across), &px, &py);
        r.x0 = sst_min_int(r.x0, n->x + px - 4);
        r.x1 = sst_max_int(r.x1, n->x + px + 5);
        r.y0 = sst_min_int(r.y0, n->y + py - 4);
        r.y1 = sst_max_int(r.y1, n->y + py + 5);
    }
    if (!area_set(&n->area, n->b, n->level, r))
        return false;
    n->whole =
        n->area.x0 == r.x0 && n->area.y0 == r.y0 && n->area.width == r.x1 - r.x0 && n->area.height == r.y1 - r.y0;
    return true;
}

/* Steps that kernels do at once. */
#define STEPS 256

/* Correlations at all steps of the search. @return false: a place on the line itself is outside */
static bool correlate_steps(const struct band *n, struct field *field)
{
    sst_correlate_places_fn *correlate = sst_kernels_get()->correlate_places;
    float *v = field->v;
    bool whole = true;
    struct step across[ACROSS_MAX];
    int32_t at[STEPS];
    int count = 0;

    for (int l = 0; l < field->across; l++)
        across[l] = step_by(n->s->n, n->middle + l - n->across);
    for (int k = 0; k < field->along; k++) {
        const struct step along = step_by(n->s->u, n->from + k);

        if (count + field->across > STEPS) {
            correlate(v, &n->block, at, (size_t)count);
            v += count;
            count = 0;
        }
        for (int l = 0; l < field->across; l++) {
            bool inside;
            int x, y;

            to_pixel(along, across[l], &x, &y);
            inside = n->whole || block_inside(&n->area, n->x + x, n->y + y);
            at[count++] = inside ? block_at(&n->area, n->x + x, n->y + y) : -1;
            whole = whole && (inside || l != n->across);
        }
    }
    correlate(v, &n->block, at, (size_t)count);
    return whole;
}

/* @param field  along and across are set: large, its values are written before they are read */
static void search_band(struct drift_match *out, struct band *n, struct field *field)
{
    const struct drift_search *s = n->s;
    const double size = 1 << n->level;
    float second = 0;
    int i = 0, j = 0;
    bool whole;

    area_read(&n->area, n->b, n->level);
    n->block.grey = n->area.v;
    n->block.stride = (size_t)n->area.width;
    whole = correlate_steps(n, field);
    if (!two_peaks(field, &i, &j, &second))
        return;
    if (field_at(field, i, j) < CORRELATION_COARSE || !i || !j || i + 1 == field->along || j + 1 == field->across) {
        out->outcome = whole ? DRIFT_NOWHERE : DRIFT_OUTSIDE;
        return;
    }
    if (1 - field_at(field, i, j) > DISTINCT * (1 - second)) {
        out->outcome = DRIFT_AMBIGUOUS;
        return;
    }
    out->outcome = DRIFT_FOUND;
    out->along = s->from_px + i * size;
    out->across = s->across_px + (j - n->across) * size;
    out->dx = s->u[0] * out->along + s->n[0] * out->across;
    out->dy = s->u[1] * out->along + s->n[1] * out->across;
}

/* With memory for a usual area, and for any: pages of a large stack frame are touched one by one. */
static __attribute__((noinline)) void search_small(struct drift_match *out, struct band *n, struct field *field)
{
    int16_t v[AREA_SMALL];

    n->area.v = v;
    search_band(out, n, field);
}

static __attribute__((noinline)) void search_large(struct drift_match *out, struct band *n, struct field *field)
{
    int16_t v[AREA_MAX];

    n->area.v = v;
    search_band(out, n, field);
}

void drift_search_match(struct drift_match *out, const struct drift_views *v, const struct drift_feature *f, int level)
{
    const struct drift_search *s = v->s;
    const double size = 1 << level;
    const int x = drift_to_level(f->x, level), y = drift_to_level(f->y, level);
    const int across = sst_min_int((int)ceil(s->band_px / size), ACROSS_MAX / 2);
    struct band n = { .b = v->b,
                      .s = s,
                      .x = x,
                      .y = y,
                      .level = level,
                      .across = across,
                      .from = s->from_px / size,
                      .middle = s->across_px / size };
    int16_t own[BLOCK_W * BLOCK_H * 2];
    struct field field;

    field.along = sst_min_int((int)ceil((s->to_px - s->from_px) / size) + 1, ALONG_MAX);
    field.across = 2 * across + 1;
    *out = (struct drift_match){ .outcome = DRIFT_OUTSIDE };
    if (!area_set(&n.area, v->a, level, (struct sst_rect){ x - 4, y - 4, x + 5, y + 5 }))
        return;
    n.area.v = own;
    area_read(&n.area, v->a, level);
    if (!block_inside(&n.area, x, y))
        return;
    block_read(&n.block, &n.area, x, y);
    if (n.block.spread <= 0) {
        out->outcome = DRIFT_AMBIGUOUS;
        return;
    }
    if (!set_band(&n, field.along))
        return;
    if (n.area.width * n.area.height <= AREA_SMALL)
        search_small(out, &n, &field);
    else
        search_large(out, &n, &field);
}
