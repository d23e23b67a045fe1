#include "pipeline/method/refine/parts.h"

#include <math.h>
#include <string.h>

#define RELIABLE_SIGMAS2 4.0    /* squared deviations of the matcher: a rougher surface has no normal; ... */
#define RELIABLE_FLOOR   0.0025 /* ... that deviation is at least 0.05 px */

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

static void add_column(struct sst_surface_sums *s, const int64_t *col, size_t w, int x, int64_t sign)
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

void sst_planes_fit(struct sst_planes *planes, const struct sst_map_u16 *disp, int64_t *sums)
{
    const int r = planes->window / 2, width = disp->width, height = disp->height;
    const size_t w = (size_t)width;

    memset(sums, 0, SST_PLANE_SUMS * w * sizeof(*sums));
    for (int y = 0; y < sst_min_int(r, height); y++)
        add_row(sums, disp, y, 1);
    for (int y = 0; y < height; y++) {
        struct sst_surface_sums s = { 0 };

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
            planes->at[(size_t)y * w + (size_t)x] = sst_surface_fit(&s, x, y);
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

bool sst_normal_at(float n[3], const struct sst_planes *planes, const struct sst_map_u16 *disp,
                   const struct sst_surface_frame *frame, int x, int y)
{
    const uint16_t q = sst_map_u16_row(disp, y)[x];
    const struct sst_surface_plane *best;
    int at[2];

    if (q == SST_DISP_NONE)
        return false;
    best = sst_surface_choose(planes->at, planes->width, planes->height, planes->window / 2, frame->score_max, q, x, y,
                              at);
    return best && sst_surface_normal(n, best, at[0], at[1], frame);
}
