/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/method/refine/parts.h"

#include <math.h>

#define MAD_TO_SIGMA   1.4826
#define TRIM_SIGMAS    5.0
#define TRIM_SHARE_MAX 4 /* trim at most 1 / 4 */

/* Smallest q with at least half of the n pixels at or below it. */
static int median(const int64_t *hist, int64_t n)
{
    int64_t below = hist[0];
    int q = 0;

    while (2 * below < n)
        below += hist[++q];
    return q;
}

static int64_t pixels_at(const int64_t *hist, int q)
{
    return q >= 0 && q < (int)SST_DISP_NONE ? hist[q] : 0;
}

/* Smallest k with at least half of the n pixels within k of the median m. */
static int median_deviation(const int64_t *hist, int64_t n, int m)
{
    int64_t within = hist[m];
    int k = 0;

    while (2 * within < n) {
        k++;
        within += pixels_at(hist, m - k) + pixels_at(hist, m + k);
    }
    return k;
}

/* n * sum q^2 stays below 2^36 * 2^68: exact in 128 bits, and so is the difference, which is where floats cancel. */
struct moments {
    int64_t n, sum;
    __int128 squares;
};

static struct moments sum_up(const int64_t *hist, int first, int last)
{
    struct moments s = { 0, 0, 0 };

    for (int q = sst_max_int(first, 0); q <= sst_min_int(last, (int)SST_DISP_MAX_Q6); q++) {
        s.n += hist[q];
        s.sum += hist[q] * q;
        s.squares += (__int128)hist[q] * ((int64_t)q * q);
    }
    return s;
}

struct sst_label_fit sst_refine_fit_histogram(const int64_t *hist, double disp_min_px,
                                              const struct sst_refine_config *cfg)
{
    const double floor_q6 =
        sqrt(1.0 / 12 + cfg->matcher_sigma_px * cfg->matcher_sigma_px * SST_DISP_SCALE * SST_DISP_SCALE);
    const struct moments all = sum_up(hist, 0, (int)SST_DISP_MAX_Q6);
    struct sst_label_fit fit = { .count = all.n, .sigma_px = floor_q6 / SST_DISP_SCALE };
    struct moments kept;
    double mean, variance = 0, limit;
    int m;

    fit.usable = all.n > 0 && all.n >= cfg->min_pixels;
    if (all.n == 0)
        return fit;
    m = median(hist, all.n);
    limit = fmin(TRIM_SIGMAS * fmax(MAD_TO_SIGMA * median_deviation(hist, all.n, m), floor_q6), SST_DISP_BINS);
    kept = sum_up(hist, (int)ceil(m - limit), (int)floor(m + limit));
    if (TRIM_SHARE_MAX * (all.n - kept.n) > all.n)
        kept = all;
    mean = (double)kept.sum / (double)kept.n;
    if (kept.n > 1)
        variance =
            (double)(kept.n * kept.squares - (__int128)kept.sum * kept.sum) / ((double)kept.n * (double)(kept.n - 1));
    fit.mean_px = disp_min_px + mean / SST_DISP_SCALE;
    fit.sigma_px = fmax(sqrt(variance), floor_q6) / SST_DISP_SCALE;
    return fit;
}

double sst_refine_fit_density(const struct sst_label_fit *fit, double disp_px)
{
    const double z = (disp_px - fit->mean_px) / fit->sigma_px;

    return exp(-0.5 * z * z) / (fit->sigma_px * sqrt(2 * M_PI));
}

void sst_candidate_masks(uint64_t *mask, const struct sst_label_fit *fits, int count, double disp_min_px, double eps_d)
{
    for (int q = 0; q < SST_DISP_BINS; q++) {
        mask[q] = 0;
        for (int i = 0; i < count && q != (int)SST_DISP_NONE; i++) {
            if (fits[i].usable && sst_refine_fit_density(&fits[i], disp_min_px + q / SST_DISP_SCALE) > eps_d)
                mask[q] |= (uint64_t)1 << i;
        }
    }
}
