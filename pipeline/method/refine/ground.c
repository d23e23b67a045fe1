#include "pipeline/method/refine/parts.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define ROUNDS       4
#define LIMIT_SIGMAS 5.0
#define MAD_TO_SIGMA 1.4826
#define COLLINEAR    1e-6
#define WHOLE        16777216.0 /* 2^24 */
#define MOST_SLOPE   0x1p40
#define MOST_VALUE   0x1p57

/* Exact sums over a region, x and y from the picture's corner: at most 2^28 pixels, so 2^28 * 2^46 < 2^63 * 2^63. */
struct sums {
    int64_t n, x, y, d;
    __int128 xx, xy, yy, xd, yd;
};

/* n^2 times the centred moment of two sums. */
static double centred(__int128 uv, int64_t u, int64_t v, int64_t n)
{
    return (double)(n * uv - (__int128)u * v);
}

static double miss(const struct sst_ground *g, int x, int y, uint16_t q)
{
    return fabs(q - (g->d0 + g->a * x + g->b * y));
}

/* Sums over a row; each fits 64 bits. */
static struct sums sum_up_row(const struct sst_ground *g, const uint8_t *label, const uint16_t *q, int width, int y,
                              int value)
{
    const uint8_t *first = memchr(label, value, (size_t)width);
    int64_t n = 0, sum_x = 0, sum_d = 0, xx = 0, xd = 0;

    for (int x = first ? (int)(first - label) : width; x < width; x++) {
        const int64_t d = q[x];

        if (label[x] != value || q[x] == SST_DISP_NONE || miss(g, x, y, q[x]) > g->limit)
            continue;
        n++;
        sum_x += x;
        sum_d += d;
        xx += (int64_t)x * x;
        xd += x * d;
    }
    return (struct sums){ .n = n,
                          .x = sum_x,
                          .y = n * y,
                          .d = sum_d,
                          .xx = xx,
                          .xy = sum_x * y,
                          .yy = n * y * y,
                          .xd = xd,
                          .yd = sum_d * y };
}

/* Sums over the region's pixels whose residual to the current plane is within its limit. */
static struct sums sum_up(const struct sst_ground *g, const struct sst_view *v, int value)
{
    struct sums s = { 0 };

    for (int y = 0; y < v->label.height; y++) {
        const struct sums row =
            sum_up_row(g, sst_map_u8_row(&v->label, y), sst_map_u16_row(&v->disp, y), v->label.width, y, value);

        s.n += row.n;
        s.x += row.x;
        s.y += row.y;
        s.d += row.d;
        s.xx += row.xx;
        s.xy += row.xy;
        s.yy += row.yy;
        s.xd += row.xd;
        s.yd += row.yd;
    }
    return s;
}

static bool solve(struct sst_ground *g, const struct sums *s)
{
    const double xx = centred(s->xx, s->x, s->x, s->n), yy = centred(s->yy, s->y, s->y, s->n);
    const double xy = centred(s->xy, s->x, s->y, s->n), det = xx * yy - xy * xy;
    const double xd = centred(s->xd, s->x, s->d, s->n), yd = centred(s->yd, s->y, s->d, s->n);

    if (s->n < 3 || !(det > COLLINEAR * xx * yy))
        return false;
    g->a = (xd * yy - yd * xy) / det;
    g->b = (yd * xx - xd * xy) / det;
    g->d0 = ((double)s->d - g->a * (double)s->x - g->b * (double)s->y) / (double)s->n;
    return true;
}

static int bin_of(double residual)
{
    return residual + 0.5 < SST_DISP_BINS - 1 ? (int)(residual + 0.5) : SST_DISP_BINS - 1;
}

/* Median residual of the region's pixels, and their number. */
static double median_miss(const struct sst_ground *g, const struct sst_view *v, int value, int64_t *hist, int64_t *n)
{
    int64_t below;
    int m = 0;

    memset(hist, 0, SST_DISP_BINS * sizeof(*hist));
    *n = 0;
    for (int y = 0; y < v->label.height; y++) {
        const uint8_t *label = sst_map_u8_row(&v->label, y);
        const uint16_t *q = sst_map_u16_row(&v->disp, y);

        for (int x = 0; x < v->label.width; x++) {
            if (label[x] != value || q[x] == SST_DISP_NONE)
                continue;
            hist[bin_of(miss(g, x, y, q[x]))]++;
            ++*n;
        }
    }
    below = hist[0];
    while (2 * below < *n)
        below += hist[++m];
    return m;
}

static int64_t whole(double v, double most)
{
    return llround(sst_clamp_double(v * WHOLE, -most, most));
}

bool sst_ground_fit(struct sst_ground *ground, const struct sst_view *v, int value, const struct sst_refine_config *cfg,
                    int64_t *hist)
{
    struct sst_ground g = { .limit = INFINITY };
    int64_t n = 0;
    struct sums s;

    for (int i = 0; i < ROUNDS; i++) {
        s = sum_up(&g, v, value);
        if (s.n < cfg->min_pixels || !solve(&g, &s))
            return false;
        g.limit = LIMIT_SIGMAS * fmax(MAD_TO_SIGMA * median_miss(&g, v, value, hist, &n),
                                      fmax(cfg->matcher_sigma_px * SST_DISP_SCALE, 0.5));
    }
    s = sum_up(&g, v, value);
    if (4 * (n - s.n) > n)
        return false;
    g.a_q24 = whole(g.a, MOST_SLOPE);
    g.b_q24 = whole(g.b, MOST_SLOPE);
    g.d0_q24 = whole(g.d0, MOST_VALUE);
    g.limit_q24 = whole(g.limit, MOST_VALUE);
    *ground = g;
    return true;
}

bool sst_ground_has(const struct sst_ground *ground, int x, int y, uint16_t disp_q6)
{
    const int64_t off = ((int64_t)disp_q6 << 24) - (ground->d0_q24 + ground->a_q24 * x + ground->b_q24 * y);

    return llabs(off) <= ground->limit_q24;
}
