/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/eval/eval.h"

#include <errno.h>
#include <math.h>

static double percent(int64_t part, int64_t whole)
{
    return whole > 0 ? 100.0 * (double)part / (double)whole : NAN;
}

int sst_eval_disparity(struct sst_disparity_error *out, const struct sst_map_f32 *estimate,
                       const struct sst_map_f32 *truth, const struct sst_map_u8 *mask)
{
    static const double limits[] = { 0.03, 0.07, 0.5, 1, 2, 4 };
    int64_t pixels = 0, known = 0, bad[ARRAY_LEN(limits)] = { 0 };
    double squares = 0, absolute = 0;

    if (estimate->width != truth->width || estimate->height != truth->height ||
        (mask && (mask->width != truth->width || mask->height != truth->height)))
        return -EINVAL;
    for (int y = 0; y < truth->height; y++) {
        const float *e = sst_map_f32_row(estimate, y), *t = sst_map_f32_row(truth, y);
        const uint8_t *m = mask ? sst_map_u8_row(mask, y) : NULL;

        for (int x = 0; x < truth->width; x++) {
            const double off = isfinite(e[x]) ? fabs((double)e[x] - (double)t[x]) : INFINITY;

            if (!isfinite(t[x]) || (m && !m[x]))
                continue;
            pixels++;
            for (size_t i = 0; i < ARRAY_LEN(limits); i++)
                bad[i] += off > limits[i];
            if (!isfinite(e[x]))
                continue;
            known++;
            squares += off * off;
            absolute += off;
        }
    }
    *out = (struct sst_disparity_error){
        .pixels = pixels,
        .bad003 = percent(bad[0], pixels),
        .bad007 = percent(bad[1], pixels),
        .bad_half = percent(bad[2], pixels),
        .bad1 = percent(bad[3], pixels),
        .bad2 = percent(bad[4], pixels),
        .bad4 = percent(bad[5], pixels),
        .rmse = known ? sqrt(squares / (double)known) : NAN,
        .mean_abs = known ? absolute / (double)known : NAN,
        .density = percent(known, pixels),
    };
    return 0;
}

/* Weighted mean of a and b; a part with weight 0 does not count, even if it is NaN. */
static double mix(double a, double weight_a, double b, double weight_b)
{
    if (!(weight_b > 0))
        return weight_a > 0 ? a : NAN;
    return weight_a > 0 ? (a * weight_a + b * weight_b) / (weight_a + weight_b) : b;
}

void sst_eval_disparity_merge(struct sst_disparity_error *sum, const struct sst_disparity_error *add)
{
    const double n = (double)sum->pixels, m = (double)add->pixels;
    const double known_n = n > 0 ? n * sum->density / 100 : 0, known_m = m > 0 ? m * add->density / 100 : 0;

    *sum = (struct sst_disparity_error){
        .pixels = sum->pixels + add->pixels,
        .bad003 = mix(sum->bad003, n, add->bad003, m),
        .bad007 = mix(sum->bad007, n, add->bad007, m),
        .bad_half = mix(sum->bad_half, n, add->bad_half, m),
        .bad1 = mix(sum->bad1, n, add->bad1, m),
        .bad2 = mix(sum->bad2, n, add->bad2, m),
        .bad4 = mix(sum->bad4, n, add->bad4, m),
        .rmse = sqrt(mix(sum->rmse * sum->rmse, known_n, add->rmse * add->rmse, known_m)),
        .mean_abs = mix(sum->mean_abs, known_n, add->mean_abs, known_m),
        .density = mix(sum->density, n, add->density, m),
    };
}

int sst_eval_visible(struct sst_map_u8 *mask, const struct sst_map_f32 *truth, const struct sst_map_f32 *other,
                     double dbx, double dby)
{
    if (mask->width != truth->width || mask->height != truth->height || other->width != truth->width ||
        other->height != truth->height)
        return -EINVAL;
    for (int y = 0; y < truth->height; y++) {
        const float *t = sst_map_f32_row(truth, y);
        uint8_t *m = sst_map_u8_row(mask, y);

        for (int x = 0; x < truth->width; x++) {
            const double ox = floor(x - t[x] * dbx + 0.5), oy = floor(y - t[x] * dby + 0.5);

            if (isfinite(t[x]) && ox >= 0 && oy >= 0 && ox < truth->width && oy < truth->height &&
                sst_map_f32_row(other, (int)oy)[(int)ox] <= t[x] + 1.0F)
                m[x] = 255;
        }
    }
    return 0;
}
