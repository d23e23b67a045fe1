#include "pipeline/method/refine/parts.h"

#include <math.h>
#include <string.h>

#define COLLINEAR        1e-6
#define RELIABLE_SIGMAS2 4.0    /* squared deviations of the matcher: a rougher surface has no normal; ... */
#define RELIABLE_FLOOR   0.0025 /* ... that deviation is at least 0.05 px */
#define OUTSIDE_SIGMAS2  9.0F   /* a pixel this far off a plane, in squared deviations, ... */
#define OUTSIDE_FLOOR    0.01F  /* ... and 0.1 px, is not on it; smaller residuals are noise, which must not count */

enum column_sum { COL_N, COL_Y, COL_YY, COL_D, COL_YD, COL_DD };

_Static_assert(COL_DD + 1 == SST_PLANE_SUMS, "one column sum each");

/*
 * Sums over a window in absolute pixel coordinates. n S_uv - S_u S_v is the same for any origin, and as integers it is
 * exact: with at most 2^14 pixels, coordinates below 2^15 and disparities below 2^16 no term exceeds 2^60.
 */
struct sums {
    int64_t n, x, y, xx, xy, yy, d, xd, yd, dd;
};

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

static struct sst_plane solve(const struct sums *s, int x0, int y0)
{
    const double n = (double)s->n;
    const double xx = (double)(s->n * s->xx - s->x * s->x), yy = (double)(s->n * s->yy - s->y * s->y);
    const double xy = (double)(s->n * s->xy - s->x * s->y), det = xx * yy - xy * xy;
    const double xd = (double)(s->n * s->xd - s->x * s->d), yd = (double)(s->n * s->yd - s->y * s->d);
    const double dd = (double)(s->n * s->dd - s->d * s->d);
    double a, b, d0, variance;

    if (s->n < 3 || !(det > COLLINEAR * xx * yy))
        return (struct sst_plane){ .variance = INFINITY };
    a = (xd * yy - yd * xy) / det;
    b = (yd * xx - xd * xy) / det;
    d0 = ((double)s->d + a * (double)(s->n * x0 - s->x) + b * (double)(s->n * y0 - s->y)) / n;
    variance = fmax(dd - a * xd - b * yd, 0) / (n * n);
    return (struct sst_plane){
        .a = (float)(a / SST_DISP_SCALE),
        .b = (float)(b / SST_DISP_SCALE),
        .d0 = (float)(d0 / SST_DISP_SCALE),
        .variance = (float)(variance / (SST_DISP_SCALE * SST_DISP_SCALE)),
    };
}

void sst_planes_fit(struct sst_planes *planes, const struct sst_map_u16 *disp, int64_t *sums)
{
    const int r = planes->window / 2, width = disp->width, height = disp->height;
    const size_t w = (size_t)width;

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
            planes->at[(size_t)y * w + (size_t)x] = solve(&s, x, y);
        }
    }
}

struct sst_normal_frame sst_normal_frame_of(const struct sst_lightfield *lf, const struct sst_refine_config *cfg)
{
    return (struct sst_normal_frame){
        .focal_px = lf->focal_px > 0 ? lf->focal_px : lf->width,
        .cx = (lf->width - 1) / 2.0,
        .cy = (lf->height - 1) / 2.0,
        .disp_zero_px = fmax(lf->disp_min_px, 0),
        .score_max = RELIABLE_SIGMAS2 * fmax(cfg->matcher_sigma_px * cfg->matcher_sigma_px, RELIABLE_FLOOR),
    };
}

bool sst_normal_at(double n[3], const struct sst_planes *planes, const struct sst_map_u16 *disp,
                   const struct sst_normal_frame *frame, int x, int y)
{
    static const int8_t shift[9][2] = { { 0, 0 },   { -1, 0 }, { 1, 0 },  { 0, -1 }, { 0, 1 },
                                        { -1, -1 }, { 1, -1 }, { -1, 1 }, { 1, 1 } };
    const uint16_t q = sst_map_u16_row(disp, y)[x];
    const float d = (float)(q / SST_DISP_SCALE);
    const int r = planes->window / 2;
    const struct sst_plane *best = NULL;
    float least = (float)frame->score_max;
    double fa, fb, c, length;
    int bx = 0, by = 0;

    for (int i = 0; i < 9 && q != SST_DISP_NONE; i++) {
        const int px = x + shift[i][0] * r, py = y + shift[i][1] * r;
        const struct sst_plane *p = planes->at + (ptrdiff_t)py * planes->width + px;
        float off, score;

        if (px < 0 || py < 0 || px >= planes->width || py >= planes->height || !(p->variance < least))
            continue;
        off = p->d0 + p->a * (float)(x - px) + p->b * (float)(y - py) - d;
        off *= off;
        score = p->variance + (off > OUTSIDE_SIGMAS2 * p->variance + OUTSIDE_FLOOR ? off : 0);
        if (score < least) {
            least = score;
            best = p;
            bx = px;
            by = py;
        }
    }
    if (!best)
        return false;
    fa = frame->focal_px * best->a;
    fb = frame->focal_px * best->b;
    c = frame->disp_zero_px + best->d0 - best->a * (bx - frame->cx) - best->b * (by - frame->cy);
    length = sqrt(fa * fa + fb * fb + c * c);
    if (!(length > 0))
        return false;
    n[0] = fa / length;
    n[1] = fb / length;
    n[2] = c / length;
    return true;
}
