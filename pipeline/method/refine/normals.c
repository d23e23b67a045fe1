/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/method/refine/parts.h"

#include <math.h>
#include <string.h>

#define RELIABLE_SIGMAS2 4.0    /* squared deviations of the matcher: a rougher surface has no normal; ... */
#define RELIABLE_FLOOR   0.0025 /* ... that deviation is at least 0.05 px */
#define COLLINEAR        1e-3F  /* of the product of the diagonal: smaller determinants are lines */
#define SHORT            1e-12F /* squared length of a vector without a direction */
#define OUTSIDE          9.0F   /* a pixel this far off a plane, in squared deviations, ... */
#define OUTSIDE_FLOOR    0.01F  /* ... and 0.1 px, is not on it; smaller residuals are noise, which must not count */
#define PLACES           9      /* windows around a pixel whose planes are compared */

/* Over the known pixels of a window. n S_uv - S_u S_v is the same for any origin of x and y: below 2^60 for windows of
 * up to 2^14 pixels, coordinates below 2^15 and disparities below 2^16. */
struct sums {
    int64_t n, x, y, xx, xy, yy, d, xd, yd, dd;
};

enum column_sum { COL_N, COL_Y, COL_YY, COL_D, COL_YD, COL_DD };

_Static_assert(COL_DD + 1 == SST_PLANE_SUMS, "one column sum each");

/* Add (sign 1) or remove (sign -1) row y in the column sums. */
static void add_row(int64_t *col, const struct sst_map_u16 *disp, int y, int64_t sign)
{
    const uint16_t *d = sst_map_u16_row(disp, y);
    const size_t w = (size_t)disp->width;

    for (size_t x = 0; x < w; x++) {
        const int64_t one = d[x] == SST_DISP_NONE ? 0 : sign, v = one * d[x];

        col[COL_N * w + x] += one;
        col[COL_Y * w + x] += one * y;
        col[COL_YY * w + x] += one * y * y;
        col[COL_D * w + x] += v;
        col[COL_YD * w + x] += v * y;
        col[COL_DD * w + x] += v * d[x];
    }
}

static void add_column(struct sums *s, const int64_t *col, size_t w, int x, int64_t sign)
{
    const int64_t n = sign * col[COL_N * w + (size_t)x], y = sign * col[COL_Y * w + (size_t)x];
    const int64_t d = sign * col[COL_D * w + (size_t)x];

    s->n += n;
    s->x += n * x;
    s->y += y;
    s->xx += n * x * x;
    s->xy += y * x;
    s->yy += sign * col[COL_YY * w + (size_t)x];
    s->d += d;
    s->xd += d * x;
    s->yd += sign * col[COL_YD * w + (size_t)x];
    s->dd += sign * col[COL_DD * w + (size_t)x];
}

/* Plane of the window around a pixel (x0, y0). */
static struct sst_surface_plane fit_plane(const struct sums *s, int x0, int y0)
{
    const float xx = (float)(s->n * s->xx - s->x * s->x), yy = (float)(s->n * s->yy - s->y * s->y);
    const float xy = (float)(s->n * s->xy - s->x * s->y), area = xx * yy, det = area - xy * xy;
    const float xd = (float)(s->n * s->xd - s->x * s->d), yd = (float)(s->n * s->yd - s->y * s->d);
    const float dd = (float)(s->n * s->dd - s->d * s->d);
    float scale, each, a, b, across, down, d0, rest;

    if (s->n < 3 || !(det > COLLINEAR * area))
        return (struct sst_surface_plane){ 0, 0, 0, SST_SURFACE_NONE };
    scale = sst_reciprocal(det);
    each = sst_reciprocal((float)s->n);
    a = (xd * yy - yd * xy) * scale;
    b = (yd * xx - xd * xy) * scale;
    across = (float)(s->n * x0 - s->x) * each;
    down = (float)(s->n * y0 - s->y) * each;
    d0 = ((float)s->d * each + a * across) + b * down;
    rest = (dd - a * xd) - b * yd;
    rest = rest > 0 ? rest : 0;
    return (struct sst_surface_plane){ a * 0.015625F, b * 0.015625F, d0 * 0.015625F,
                                       (rest * (each * each)) * 0.000244140625F };
}

void sst_planes_fit(struct sst_planes *planes, const struct sst_map_u16 *disp, int64_t *sums)
{
    const int r = planes->window / 2, width = disp->width, height = disp->height;
    const size_t w = (size_t)width;

    planes->disp = disp;
    memset(sums, 0, SST_PLANE_SUMS * w * sizeof(*sums));
    for (int y = 0; y < sst_min_int(r, height); y++)
        add_row(sums, disp, y, 1);
    for (int y = 0; y < height; y++) {
        struct sums s = { 0 };

        if (y + r < height)
            add_row(sums, disp, y + r, 1);
        if (y - r - 1 >= 0)
            add_row(sums, disp, y - r - 1, -1);
        for (int x = 0; x < sst_min_int(r, width); x++)
            add_column(&s, sums, w, x, 1);
        for (int x = 0; x < width; x++) {
            if (x + r < width)
                add_column(&s, sums, w, x + r, 1);
            if (x - r - 1 >= 0)
                add_column(&s, sums, w, x - r - 1, -1);
            planes->at[(size_t)y * w + (size_t)x] = fit_plane(&s, x, y);
        }
    }
}

struct sst_surface_frame sst_normal_frame_of(const struct sst_lightfield *lf, const struct sst_refine_config *cfg)
{
    const double sigma2 = fmax(cfg->matcher_sigma_px * cfg->matcher_sigma_px, RELIABLE_FLOOR);

    return (struct sst_surface_frame){
        .focal_px = (float)(lf->focal_px > 0 ? lf->focal_px : lf->width),
        .cx = (float)((lf->width - 1) / 2.0 + lf->off_centre_px[0]),
        .cy = (float)((lf->height - 1) / 2.0 + lf->off_centre_px[1]),
        .zero_px = (float)fmax(lf->disp_min_px - lf->infinity_px, 0),
        .score_max = (float)(RELIABLE_SIGMAS2 * sigma2),
    };
}

/* Plane of a pixel among its places, see sst_normal_at(). @param at  out, its centre @return NULL: none */
static const struct sst_surface_plane *choose_plane(const struct sst_planes *planes, float score_max, int x, int y,
                                                    int at[2])
{
    static const int8_t shift[PLACES][2] = { { 0, 0 },   { -1, 0 }, { 1, 0 },  { 0, -1 }, { 0, 1 },
                                             { -1, -1 }, { 1, -1 }, { -1, 1 }, { 1, 1 } };
    const float d = (float)sst_map_u16_row(planes->disp, y)[x] * 0.015625F;
    const struct sst_surface_plane *best = NULL;
    const int radius = planes->window / 2;
    float least = score_max;

    for (int i = 0; i < PLACES; i++) {
        const int px = x + shift[i][0] * radius, py = y + shift[i][1] * radius;
        const struct sst_surface_plane *p;
        float off, score;

        if (px < 0 || py < 0 || px >= planes->width || py >= planes->height)
            continue;
        p = planes->at + (size_t)py * (size_t)planes->width + px;
        if (!(p->variance < least))
            continue;
        off = ((p->d0 + p->a * (float)(x - px)) + p->b * (float)(y - py)) - d;
        off = off * off;
        score = p->variance + (off > OUTSIDE * p->variance + OUTSIDE_FLOOR ? off : 0.0F);
        if (score < least) {
            least = score;
            best = p;
            at[0] = px;
            at[1] = py;
        }
    }
    return best;
}

/* 1 / sqrt(v), relative error at most 3e-7. @param v  1e-30 .. 1e30 */
static float inverse_root(float v)
{
    const float half = 0.5F * v;
    uint32_t bits;
    float r;

    memcpy(&bits, &v, sizeof(bits));
    bits = 0x5F3759DFU - (bits >> 1);
    memcpy(&r, &bits, sizeof(r));
    for (int i = 0; i < 4; i++)
        r = r * (1.5F - (half * r) * r);
    return r;
}

/* Unit normal of a plane around pixel (px, py). @return false: it has none; n is untouched */
static bool normal_of(float n[3], const struct sst_surface_plane *p, int px, int py, const struct sst_surface_frame *f)
{
    const float fa = f->focal_px * p->a, fb = f->focal_px * p->b;
    const float c = ((f->zero_px + p->d0) - p->a * ((float)px - f->cx)) - p->b * ((float)py - f->cy);
    const float square = (fa * fa + fb * fb) + c * c;
    float r;

    if (!(square > SHORT))
        return false;
    r = inverse_root(square);
    n[0] = fa * r;
    n[1] = fb * r;
    n[2] = c * r;
    return true;
}

bool sst_normal_at(float n[3], const struct sst_planes *planes, const struct sst_surface_frame *frame, int x, int y)
{
    const struct sst_surface_plane *best;
    int at[2];

    if (sst_map_u16_row(planes->disp, y)[x] == SST_DISP_NONE)
        return false;
    best = choose_plane(planes, frame->score_max, x, y, at);
    return best && normal_of(n, best, at[0], at[1], frame);
}
