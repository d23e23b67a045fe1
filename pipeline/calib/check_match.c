/* Where a feature is in another view: correlation over a band about the predicted line, then sub-pixel alignment.
 *
 * Alignment is Lucas and Kanade's in its inverse compositional form (Baker, Matthews 2004) for a shift, a gain and an
 * offset: the template's derivatives have their parts along the template and along a constant taken out, so that gain
 * and offset drop out of the equations. The fixed point is where these derivatives see no difference; it is unbiased if
 * the interpolation is (cubic, on smoothed values: below 0.01 px, tests/unit/check.c). */
#include <math.h>
#include <string.h>

#include "pipeline/calib/check_parts.h"

/* --- coarse ------------------------------------------------------------------------------------------------------- */

#define BLOCK_W            8 /* pixels of the search level: x - 4 .. x + 3, y - 4 .. y + 4 */
#define BLOCK_H            9
#define ALONG_MAX          512
#define CROSS_MAX          65
#define CORRELATION_COARSE 0.7
#define DISTINCT           0.75 /* best match's distance from 1 over the next one's: above this it is ambiguous */

struct block {
    int16_t v[BLOCK_H][BLOCK_W];
    int32_t sum;
    double spread; /* n sum of squares - sum^2 */
};

static bool block_inside(const struct sst_map_u8 *grey, int x, int y)
{
    return x >= 4 && y >= 4 && x + 3 < grey->width && y + 4 < grey->height;
}

static void block_read(struct block *b, const struct sst_map_u8 *grey, int x, int y)
{
    int32_t squares = 0;

    b->sum = 0;
    for (int j = 0; j < BLOCK_H; j++) {
        const uint8_t *p = sst_map_u8_row(grey, y - 4 + j) + x - 4;

        for (int i = 0; i < BLOCK_W; i++) {
            b->v[j][i] = p[i];
            b->sum += p[i];
            squares += p[i] * p[i];
        }
    }
    b->spread = (double)squares * (BLOCK_W * BLOCK_H) - (double)b->sum * b->sum;
}

/* Correlation coefficient, 0 where the other block is flat. */
static float correlate(const struct block *a, const struct sst_map_u8 *grey, int x, int y)
{
    int32_t sum = 0, squares = 0, product = 0;
    double spread;

    for (int j = 0; j < BLOCK_H; j++) {
        const uint8_t *p = sst_map_u8_row(grey, y - 4 + j) + x - 4;

        for (int i = 0; i < BLOCK_W; i++) {
            sum += p[i];
            squares += p[i] * p[i];
            product += p[i] * a->v[j][i];
        }
    }
    spread = (double)squares * (BLOCK_W * BLOCK_H) - (double)sum * sum;
    if (spread <= 0)
        return 0;
    return (float)(((double)product * (BLOCK_W * BLOCK_H) - (double)sum * a->sum) / sqrt(spread * a->spread));
}

struct field {
    int along, cross; /* steps of one pixel of the level */
    float v[ALONG_MAX][CROSS_MAX];
};

#define OUT_OF_PICTURE (-2.0f)

static bool is_peak(const struct field *f, int i, int j)
{
    const float v = f->v[i][j];

    for (int di = -1; di <= 1; di++) {
        for (int dj = -1; dj <= 1; dj++) {
            const int k = i + di, l = j + dj;

            /* Equal neighbours: the first of them is the peak. */
            if ((di || dj) && k >= 0 && l >= 0 && k < f->along && l < f->cross &&
                (f->v[k][l] > v || (f->v[k][l] == v && (di < 0 || (!di && dj < 0)))))
                return false;
        }
    }
    return v > OUT_OF_PICTURE;
}

/* Best peak, and the value of the next one that is more than two steps off. */
static bool two_peaks(const struct field *f, int *i, int *j, float *second)
{
    float best = OUT_OF_PICTURE;

    for (int k = 0; k < f->along; k++) {
        for (int l = 0; l < f->cross; l++) {
            if (f->v[k][l] > best) {
                best = f->v[k][l];
                *i = k;
                *j = l;
            }
        }
    }
    *second = 0;
    for (int k = 0; k < f->along; k++) {
        for (int l = 0; l < f->cross; l++) {
            const bool apart = k < *i - 2 || k > *i + 2 || l < *j - 2 || l > *j + 2;

            if (apart && f->v[k][l] > *second && is_peak(f, k, l))
                *second = f->v[k][l];
        }
    }
    return best > OUT_OF_PICTURE;
}

/* Level 0's pixel x is at (x - (2^level - 1) / 2) / 2^level. */
static int to_level(int x, int level)
{
    return (int)floor((x - 0.5 * ((1 << level) - 1)) / (1 << level) + 0.5);
}

void sst_check_search(struct sst_check_match *out, const struct sst_check_view *a, const struct sst_check_view *b,
                      const struct sst_check_feature *f, const struct sst_check_search *s, int level)
{
    const struct sst_map_u8 *from = &a->level[level], *in = &b->level[level];
    const double size = 1 << level;
    const int x = to_level(f->x, level), y = to_level(f->y, level);
    const int band = sst_min_int((int)ceil(s->band_px / size), CROSS_MAX / 2);
    struct field field = { .cross = 2 * band + 1 };
    struct block block;
    float second = 0;
    int i = 0, j = 0;
    bool whole = true;

    *out = (struct sst_check_match){ .outcome = SST_CHECK_OUTSIDE };
    field.along = sst_min_int((int)ceil((s->to_px - s->from_px) / size) + 1, ALONG_MAX);
    if (!block_inside(from, x, y))
        return;
    block_read(&block, from, x, y);
    if (block.spread <= 0) {
        out->outcome = SST_CHECK_AMBIGUOUS;
        return;
    }
    for (int k = 0; k < field.along; k++) {
        for (int l = 0; l < field.cross; l++) {
            const double along = s->from_px / size + k, cross = s->cross_px / size + l - band;
            const int bx = x + (int)floor(s->u[0] * along + s->n[0] * cross + 0.5);
            const int by = y + (int)floor(s->u[1] * along + s->n[1] * cross + 0.5);
            const bool inside = block_inside(in, bx, by);

            field.v[k][l] = inside ? correlate(&block, in, bx, by) : OUT_OF_PICTURE;
            whole = whole && (inside || l != band);
        }
    }
    if (!two_peaks(&field, &i, &j, &second))
        return;
    if (field.v[i][j] < CORRELATION_COARSE || !i || !j || i + 1 == field.along || j + 1 == field.cross) {
        out->outcome = whole ? SST_CHECK_NOWHERE : SST_CHECK_OUTSIDE;
        return;
    }
    if (1 - field.v[i][j] > DISTINCT * (1 - second)) {
        out->outcome = SST_CHECK_AMBIGUOUS;
        return;
    }
    out->outcome = SST_CHECK_MATCHED;
    out->along = s->from_px + i * size;
    out->cross = s->cross_px + (j - band) * size;
    out->dx = s->u[0] * out->along + s->n[0] * out->cross;
    out->dy = s->u[1] * out->along + s->n[1] * out->cross;
}

/* --- sub-pixel ---------------------------------------------------------------------------------------------------- */

#define RADIUS 5
#define RADIUS_COARSE 4
#define LANES            16 /* a row of the window, filled up with zeros */
#define REACH            3  /* px that the alignment may go from its start */
#define ROUNDS           12
#define SETTLED          0.002 /* px */
#define CORRELATION_FINE 0.85
#define BOTH_WAYS_PX     0.25
/* Variance of a sum over smoothed noise, over that of as many independent values: the filter's 1 / (sum of squares) =
 * (256 / 70)^2, less what the derivative's own frequencies leave of it; measured in tests. */
#define SMOOTHED       6.0
#define VARIANCE_FLOOR 4e-4 /* px^2: interpolation, and surfaces that are not parallel to the picture */

struct window {
    int radius;
    float t[2 * RADIUS + 1][LANES], gx[2 * RADIUS + 1][LANES], gy[2 * RADIUS + 1][LANES];
    float mean;
    double tt, xx, xy, yy, det; /* sums of squares of t; of the derivatives, without their parts along t and 1 */
};

static double window_sum(const float p[][LANES], const float q[][LANES], int rows)
{
    float lane[LANES] = { 0 };
    double sum = 0;

    for (int y = 0; y < rows; y++) {
        for (int x = 0; x < LANES; x++)
            lane[x] += p[y][x] * q[y][x];
    }
    for (int x = 0; x < LANES; x++)
        sum += lane[x];
    return sum;
}

/* Take out the mean and the part along t (if any). */
static void project(float p[][LANES], const struct window *w, bool along)
{
    const int n = 2 * w->radius + 1;
    double mean = 0, part;

    for (int y = 0; y < n; y++) {
        for (int x = 0; x < n; x++)
            mean += p[y][x];
    }
    mean /= n * n;
    for (int y = 0; y < n; y++) {
        for (int x = 0; x < n; x++)
            p[y][x] -= (float)mean;
    }
    if (!along)
        return;
    part = window_sum(p, w->t, n) / w->tt;
    for (int y = 0; y < n; y++) {
        for (int x = 0; x < n; x++)
            p[y][x] -= (float)part * w->t[y][x];
    }
}

static bool window_read(struct window *w, const struct sst_check_view *view, int level, int x0, int y0, int radius)
{
    const int n = 2 * radius + 1, side = n + 2;
    float patch[(2 * RADIUS + 3) * (2 * RADIUS + 3)];
    double sum = 0;

    if (!sst_check_patch(patch, view, level, x0 - radius - 1, y0 - radius - 1, side, side))
        return false;
    memset(w, 0, sizeof(*w));
    w->radius = radius;
    for (int y = 0; y < n; y++) {
        for (int x = 0; x < n; x++) {
            const float *p = patch + (y + 1) * side + x + 1;

            w->t[y][x] = *p;
            w->gx[y][x] = 0.5f * (p[1] - p[-1]);
            w->gy[y][x] = 0.5f * (p[side] - p[-side]);
            sum += *p;
        }
    }
    w->mean = (float)(sum / (n * n));
    project(w->t, w, false);
    w->tt = window_sum(w->t, w->t, n);
    if (w->tt < 1e-3 * n * n)
        return false;
    project(w->gx, w, true);
    project(w->gy, w, true);
    w->xx = window_sum(w->gx, w->gx, n);
    w->xy = window_sum(w->gx, w->gy, n);
    w->yy = window_sum(w->gy, w->gy, n);
    w->det = w->xx * w->yy - w->xy * w->xy;
    return w->det > 1e-4 * w->xx * w->yy;
}

/* Cubic through four values (Keys 1981, a = -1/2), at t after the second. */
static void cubic(float w[4], double t)
{
    w[0] = (float)(t * (-0.5 + t * (1 - 0.5 * t)));
    w[1] = (float)(1 + t * t * (-2.5 + 1.5 * t));
    w[2] = (float)(t * (0.5 + t * (2 - 1.5 * t)));
    w[3] = (float)(t * t * (-0.5 + 0.5 * t));
}

/* The window at (px, py) of a patch, less `mean`. */
static void resample(float out[][LANES], const float *patch, int side, int n, double px, double py, float mean)
{
    const int x0 = (int)floor(px), y0 = (int)floor(py);
    float wx[4], wy[4], rows[2 * RADIUS + 4][LANES] = { { 0 } };

    cubic(wx, px - x0);
    cubic(wy, py - y0);
    for (int y = 0; y < n + 3; y++) {
        const float *p = patch + (y0 - 1 + y) * side + x0 - 1;

        for (int x = 0; x < n; x++)
            rows[y][x] = wx[0] * p[x] + wx[1] * p[x + 1] + wx[2] * p[x + 2] + wx[3] * p[x + 3] - mean;
    }
    for (int y = 0; y < n; y++) {
        for (int x = 0; x < LANES; x++)
            out[y][x] = wy[0] * rows[y][x] + wy[1] * rows[y + 1][x] + wy[2] * rows[y + 2][x] + wy[3] * rows[y + 3][x];
    }
}

/* Correlation of template and window; per-pixel variance of their difference in the template's grey levels. */
static double fit_quality(const struct window *w, float i[][LANES], double gain, double *variance)
{
    const int n = 2 * w->radius + 1;
    double spread;

    project(i, w, false);
    spread = window_sum((const float(*)[LANES])i, (const float(*)[LANES])i, n);
    *variance = fmax(spread / (gain * gain) - w->tt, 0) / (n * n - 4);
    return spread > 0 ? gain * sqrt(w->tt / spread) : 0;
}

/* Align view b at (x0 + *px, y0 + *py) with the window around (x0, y0); pixels of the level. */
static bool align(const struct window *w, const struct sst_check_view *b, int level, int x0, int y0, double *px,
                  double *py, double *variance, double *correlation)
{
    const int n = 2 * w->radius + 1, edge = w->radius + REACH + 1, side = 2 * edge + 2;
    const int cx = (int)floor(*px + 0.5), cy = (int)floor(*py + 0.5);
    float patch[(2 * (RADIUS + REACH) + 4) * (2 * (RADIUS + REACH) + 4)], i[2 * RADIUS + 1][LANES] = { { 0 } };
    double x = *px - cx, y = *py - cy; /* from the patch's middle */

    if (!sst_check_patch(patch, b, level, x0 + cx - edge, y0 + cy - edge, side, side))
        return false;
    for (int round = 0; round < ROUNDS; round++) {
        const double to = REACH + 1;
        double sx, sy, gain, dx, dy;

        resample(i, patch, side, n, x + to, y + to, w->mean);
        gain = window_sum((const float(*)[LANES])i, w->t, n) / w->tt;
        if (gain < 0.2 || gain > 5)
            return false;
        sx = window_sum((const float(*)[LANES])i, w->gx, n) / gain;
        sy = window_sum((const float(*)[LANES])i, w->gy, n) / gain;
        dx = (w->yy * sx - w->xy * sy) / w->det;
        dy = (w->xx * sy - w->xy * sx) / w->det;
        x -= dx;
        y -= dy;
        if (fabs(x) > REACH - 1e-6 || fabs(y) > REACH - 1e-6)
            return false;
        if (dx * dx + dy * dy > SETTLED * SETTLED)
            continue;
        *px = cx + x;
        *py = cy + y;
        *correlation = fit_quality(w, i, gain, variance);
        return *correlation > (level ? CORRELATION_COARSE : CORRELATION_FINE);
    }
    return false;
}

/* Variances along u and across it, each with the other unknown: the inverse of the structure tensor. */
static void set_variances(struct sst_check_match *m, const struct window *w, const struct sst_check_search *s,
                          double noise)
{
    const double scale = SMOOTHED * noise / w->det;
    const double ixx = w->yy * scale, ixy = -w->xy * scale, iyy = w->xx * scale;

    m->var_along = VARIANCE_FLOOR + s->u[0] * s->u[0] * ixx + 2 * s->u[0] * s->u[1] * ixy + s->u[1] * s->u[1] * iyy;
    m->var_cross = VARIANCE_FLOOR + s->n[0] * s->n[0] * ixx + 2 * s->n[0] * s->n[1] * ixy + s->n[1] * s->n[1] * iyy;
}

static bool forth(struct window *w, struct sst_check_match *m, const struct sst_check_view *a,
                  const struct sst_check_view *b, const struct sst_check_feature *f, int level, double *noise)
{
    for (; level >= 0; level--) {
        const int x = to_level(f->x, level), y = to_level(f->y, level);
        double px = m->dx / (1 << level), py = m->dy / (1 << level);

        if (!window_read(w, a, level, x, y, level ? RADIUS_COARSE : RADIUS) ||
            !align(w, b, level, x, y, &px, &py, noise, &m->correlation))
            return false;
        m->dx = px * (1 << level);
        m->dy = py * (1 << level);
    }
    return true;
}

void sst_check_refine(struct sst_check_match *m, const struct sst_check_view *a, const struct sst_check_view *b,
                      const struct sst_check_feature *f, const struct sst_check_search *s, int level)
{
    struct window w, back;
    double noise = 0, unused = 0, bx, by;
    int x, y;

    m->outcome = SST_CHECK_NOWHERE;
    if (!forth(&w, m, a, b, f, level, &noise))
        return;
    x = (int)floor(f->x + m->dx + 0.5);
    y = (int)floor(f->y + m->dy + 0.5);
    bx = -m->dx;
    by = -m->dy;
    if (!window_read(&back, b, 0, x, y, RADIUS) || !align(&back, a, 0, x, y, &bx, &by, &unused, &unused) ||
        hypot(m->dx + bx, m->dy + by) > BOTH_WAYS_PX)
        return;
    m->dx = 0.5 * (m->dx - bx);
    m->dy = 0.5 * (m->dy - by);
    m->along = s->u[0] * m->dx + s->u[1] * m->dy;
    m->cross = s->n[0] * m->dx + s->n[1] * m->dy;
    set_variances(m, &w, s, noise);
    m->outcome = SST_CHECK_MATCHED;
}
