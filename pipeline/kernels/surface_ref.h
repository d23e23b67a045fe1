/* pipeline/kernels/surface_ref.h - planes of disparity windows, their normals, and the energies of label refinement.
 *
 * Sums are exact whole numbers. All other numbers are sums, differences and products of floats in a fixed order.
 * Quotients and roots are Newton's iterations from a guess by the bits.
 */
#ifndef SST_PIPELINE_KERNELS_SURFACE_REF_H
#define SST_PIPELINE_KERNELS_SURFACE_REF_H

#include <stdbool.h>
#include <string.h>

#include "base/base.h"

#define SST_SURFACE_COLLINEAR 1e-3F /* of the product of the diagonal: smaller determinants are lines */
#define SST_SURFACE_NONE      1e30F /* variance of a window without a plane */
#define SST_SURFACE_OUTSIDE   9.0F  /* a pixel this far off a plane, in squared deviations, ... */
#define SST_SURFACE_OUTSIDE_FLOOR                                                                                      \
    0.01F                          /* ... and 0.1 px, is not on it; smaller residuals are noise, which must not count */
#define SST_SURFACE_SHORT  1e-12F  /* squared length of a vector without a direction */
#define SST_SURFACE_ONE    1048576 /* 2^20: a component of 1 as a whole number */
#define SST_SURFACE_PLACES 9       /* windows around a pixel whose planes are compared */

/** 1 / v, relative error at most 3e-7. @param v  1e-30 .. 1e30 */
static inline float sst_surface_reciprocal(float v)
{
    uint32_t bits;
    float r;

    memcpy(&bits, &v, sizeof(bits));
    bits = 0x7EF311C7U - bits;
    memcpy(&r, &bits, sizeof(r));
    for (int i = 0; i < 4; i++)
        r = r * (2.0F - v * r);
    return r;
}

/** 1 / sqrt(v), relative error at most 3e-7. @param v  1e-30 .. 1e30 */
static inline float sst_surface_root(float v)
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

/** Over the known pixels of a window. n S_uv - S_u S_v is the same for any origin of x and y: below 2^60 for windows of
 * up to 2^14 pixels, coordinates below 2^15 and disparities below 2^16. */
struct sst_surface_sums {
    int64_t n, x, y, xx, xy, yy, d, xd, yd, dd;
};

/** Plane d = d0 + a (x - x0) + b (y - y0) of the window around a pixel (x0, y0). */
struct sst_surface_plane {
    float a, b;     /* px per px */
    float d0;       /* px above disp_min_px */
    float variance; /* of the residuals, px^2; SST_SURFACE_NONE: fewer than 3 pixels, or all near one line */
};

static inline struct sst_surface_plane sst_surface_fit(const struct sst_surface_sums *s, int x0, int y0)
{
    const float xx = (float)(s->n * s->xx - s->x * s->x), yy = (float)(s->n * s->yy - s->y * s->y);
    const float xy = (float)(s->n * s->xy - s->x * s->y), area = xx * yy, det = area - xy * xy;
    const float xd = (float)(s->n * s->xd - s->x * s->d), yd = (float)(s->n * s->yd - s->y * s->d);
    const float dd = (float)(s->n * s->dd - s->d * s->d);
    float scale, each, a, b, across, down, d0, rest;

    if (s->n < 3 || !(det > SST_SURFACE_COLLINEAR * area))
        return (struct sst_surface_plane){ 0, 0, 0, SST_SURFACE_NONE };
    scale = sst_surface_reciprocal(det);
    each = sst_surface_reciprocal((float)s->n);
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

/** What makes a disparity plane a normal in space. */
struct sst_surface_frame {
    float focal_px; /* > 0 */
    float cx, cy;   /* principal point */
    float zero_px;  /* disparity of stored value 0, counted from points at infinity */
    float
        score_max; /* px^2, below SST_SURFACE_NONE: a plane with a residual variance of this or more gives no normal */
};

/** The plane of a pixel among those of its places, see sst_normal_at(). @param at  out, its centre @return NULL: none
 */
static inline const struct sst_surface_plane *sst_surface_choose(const struct sst_surface_plane *planes, int width,
                                                                 int height, int radius, float score_max, int disp_q6,
                                                                 int x, int y, int at[2])
{
    static const int8_t shift[SST_SURFACE_PLACES][2] = { { 0, 0 },   { -1, 0 }, { 1, 0 },  { 0, -1 }, { 0, 1 },
                                                         { -1, -1 }, { 1, -1 }, { -1, 1 }, { 1, 1 } };
    const struct sst_surface_plane *best = NULL;
    const float d = (float)disp_q6 * 0.015625F;
    float least = score_max;

    for (int i = 0; i < SST_SURFACE_PLACES; i++) {
        const int px = x + shift[i][0] * radius, py = y + shift[i][1] * radius;
        const struct sst_surface_plane *p;
        float off, score;

        if (px < 0 || py < 0 || px >= width || py >= height)
            continue;
        p = planes + (size_t)py * (size_t)width + px;
        if (!(p->variance < least))
            continue;
        off = ((p->d0 + p->a * (float)(x - px)) + p->b * (float)(y - py)) - d;
        off = off * off;
        score = p->variance + (off > SST_SURFACE_OUTSIDE * p->variance + SST_SURFACE_OUTSIDE_FLOOR ? off : 0.0F);
        if (score < least) {
            least = score;
            best = p;
            at[0] = px;
            at[1] = py;
        }
    }
    return best;
}

/** Unit normal of a plane around pixel (px, py). @return false: it has none; n is untouched */
static inline bool sst_surface_normal(float n[3], const struct sst_surface_plane *p, int px, int py,
                                      const struct sst_surface_frame *f)
{
    const float fa = f->focal_px * p->a, fb = f->focal_px * p->b;
    const float c = ((f->zero_px + p->d0) - p->a * ((float)px - f->cx)) - p->b * ((float)py - f->cy);
    const float square = (fa * fa + fb * fb) + c * c;
    float r;

    if (!(square > SST_SURFACE_SHORT))
        return false;
    r = sst_surface_root(square);
    n[0] = fa * r;
    n[1] = fb * r;
    n[2] = c * r;
    return true;
}

/** A component of a normal as a whole number: sums of these are exact. */
static inline int32_t sst_surface_q20(float v)
{
    return (int32_t)__builtin_floorf(v * (float)SST_SURFACE_ONE + 0.5F);
}

/** E_d = nearest2 / farthest2, 0..1, rounded down to steps of 2^-24: equal shares are equal. @param farthest2  at least
 * nearest2; 0: a region of one pixel, at it; E_d is 0 */
static inline float sst_surface_distance(uint32_t nearest2, uint32_t farthest2)
{
    return farthest2 ? (float)(int32_t)(((uint64_t)nearest2 << 24) / farthest2) * 0x1p-24F : 0.0F;
}

/** E_n = -s / (s + tau), s = <m, mean>; 0 unless s > 0. @param tau  1e-9 .. 1e9 */
static inline float sst_surface_consistency(const float m[3], const float mean[3], float tau)
{
    const float s = (m[0] * mean[0] + m[1] * mean[1]) + m[2] * mean[2];

    return s > 1e-20F ? -(s * sst_surface_reciprocal(s + tau)) : 0.0F;
}

#endif
