/* Scores of single pictures: local ones of one channel, Reed-Xiaoli's of colours. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "pipeline/posed/find/find_internal.h"

#define RX_ROUNDS 3
#define RX_CUT    3.0 /* distance beyond which a colour does not count in the next round */
#define RX_LEAST  1.0 /* levels^2 added to variances: of rounding */

static uint16_t level_of(double score)
{
    const double level = floor(SCORE_STEPS * (score + SCORE_LOWEST) + 0.5);

    return (uint16_t)fmin(fmax(level, 0), 65535);
}

static uint16_t median_level(const struct sst_deep *picture, uint32_t *count)
{
    const int64_t half = ((int64_t)picture->width * picture->height + 1) / 2;
    int64_t below = 0;
    int level = 0;

    memset(count, 0, 65536 * sizeof(*count));
    for (int y = 0; y < picture->height; y++) {
        const uint16_t *row = sst_map_u16_row(&picture->plane[0], y);

        for (int x = 0; x < picture->width; x++)
            count[row[x]]++;
    }
    for (; level < 65535; level++) {
        below += count[level];
        if (below >= half)
            break;
    }
    return (uint16_t)level;
}

int find_centred(struct sst_deep *out, const struct sst_deep *picture)
{
    uint32_t *count = malloc(65536 * sizeof(*count));
    int err = count ? sst_deep_init(out, picture->width, picture->height, 1, 65535) : -ENOMEM;
    int by;

    if (err) {
        free(count);
        return err;
    }
    by = FIND_MIDDLE - median_level(picture, count);
    free(count);
    for (int y = 0; y < picture->height; y++) {
        const uint16_t *row = sst_map_u16_row(&picture->plane[0], y);
        uint16_t *to = sst_map_u16_row(&out->plane[0], y);

        for (int x = 0; x < picture->width; x++)
            to[x] = (uint16_t)sst_clamp_int(row[x] + by, 0, 65535);
    }
    return 0;
}

int find_local_scores(struct sst_deep *out, const struct sst_deep *picture, int sign, int reach)
{
    struct find_score_config cfg = find_score_defaults();
    struct sst_map_f32 value = { 0 }, score = { 0 };
    int err = sst_map_f32_init(&value, picture->width, picture->height);

    cfg.reach = reach;
    for (int y = 0; !err && y < picture->height; y++) {
        for (int x = 0; x < picture->width; x++)
            sst_map_f32_row(&value, y)[x] = sst_map_u16_row(&picture->plane[0], y)[x];
    }
    err = err ? err : find_score(&score, &value, &cfg, 1);
    err = err ? err : sst_deep_init(out, picture->width, picture->height, 1, 65535);
    for (int y = 0; !err && y < picture->height; y++) {
        for (int x = 0; x < picture->width; x++) {
            const double v = (double)sst_map_f32_row(&score, y)[x];

            sst_map_u16_row(&out->plane[0], y)[x] = level_of(isnan(v) ? 0 : sign * v);
        }
    }
    sst_map_f32_fini(&value);
    sst_map_f32_fini(&score);
    return err;
}

/* --- Reed and Xiaoli 1990 ----------------------------------------------------------------------------------------- */

/* Distribution of colours: mean, and the inverse of the covariance. */
struct colours {
    double mean[3], inverse[6]; /* xx xy xz yy yz zz */
    bool known;
};

static double distance2(const struct colours *c, const double rgb[3])
{
    const double d[3] = { rgb[0] - c->mean[0], rgb[1] - c->mean[1], rgb[2] - c->mean[2] };
    const double *m = c->inverse;

    return d[0] * (m[0] * d[0] + 2 * (m[1] * d[1] + m[2] * d[2])) + d[1] * (m[3] * d[1] + 2 * m[4] * d[2]) +
           m[5] * d[2] * d[2];
}

static void rgb_at(double rgb[3], const struct sst_deep *picture, int x, int y)
{
    for (int i = 0; i < 3; i++)
        rgb[i] = sst_map_u16_row(&picture->plane[i], y)[x];
}

/* Inverse of a symmetric matrix with `least` added to its diagonal. */
static void invert(double out[6], const double v[6], double least)
{
    const double a = v[0] + least, b = v[1], c = v[2], d = v[3] + least, e = v[4], f = v[5] + least;
    const double det = a * (d * f - e * e) - b * (b * f - c * e) + c * (b * e - c * d);

    out[0] = (d * f - e * e) / det;
    out[1] = (c * e - b * f) / det;
    out[2] = (b * e - c * d) / det;
    out[3] = (a * f - c * c) / det;
    out[4] = (b * c - a * e) / det;
    out[5] = (a * d - b * b) / det;
}

/* Mean and covariance of the colours that the ones before do not call outliers. */
static struct colours learn(const struct sst_deep *picture, const struct colours *before, double least)
{
    struct colours c = { .known = true };
    double sum[3] = { 0 }, product[6] = { 0 }, covariance[6], origin[3], n = 0;

    rgb_at(origin, picture, picture->width / 2, picture->height / 2);
    for (int y = 0; y < picture->height; y++) {
        for (int x = 0; x < picture->width; x++) {
            double rgb[3];
            int k = 0;

            rgb_at(rgb, picture, x, y);
            if (before->known && distance2(before, rgb) > RX_CUT * RX_CUT)
                continue;
            for (int i = 0; i < 3; i++) {
                sum[i] += rgb[i] - origin[i];
                for (int j = i; j < 3; j++)
                    product[k++] += (rgb[i] - origin[i]) * (rgb[j] - origin[j]);
            }
            n++;
        }
    }
    if (n == 0)
        return *before;
    for (int i = 0, k = 0; i < 3; i++) {
        c.mean[i] = origin[i] + sum[i] / n;
        for (int j = i; j < 3; j++, k++)
            covariance[k] = product[k] / n - sum[i] / n * (sum[j] / n);
    }
    invert(c.inverse, covariance, least);
    return c;
}

/* Means of 2 reach + 1 pixels along one axis, twice: views fall on each other within a few centimetres. */
static void smear(struct sst_map_u16 *map, uint16_t *line, int reach, bool down)
{
    const int length = down ? map->height : map->width, lines = down ? map->width : map->height;

    for (int l = 0; l < lines; l++) {
        for (int i = 0; i < length; i++)
            line[i] = down ? sst_map_u16_row(map, i)[l] : sst_map_u16_row(map, l)[i];
        for (int i = 0, from = 0, to = 0, sum = 0; i < length; i++) {
            for (; to < length && to <= i + reach; to++)
                sum += line[to];
            for (; from < i - reach; from++)
                sum -= line[from];
            *(down ? &sst_map_u16_row(map, i)[l] : &sst_map_u16_row(map, l)[i]) = (uint16_t)(sum / (to - from));
        }
    }
}

static int smooth(struct sst_map_u16 *map, int reach)
{
    uint16_t *line = malloc((size_t)sst_max_int(map->width, map->height) * sizeof(*line));

    if (!line)
        return -ENOMEM;
    for (int i = 0; i < 4 && reach > 0; i++)
        smear(map, line, reach, i % 2);
    free(line);
    return 0;
}

int find_colour_scores(struct sst_deep *out, const struct sst_deep *picture, int reach)
{
    const double step = picture->white / 255.0;
    struct colours c = { .known = false };
    const int err = sst_deep_init(out, picture->width, picture->height, 1, 65535);

    if (err)
        return err;
    for (int i = 0; i < RX_ROUNDS; i++)
        c = learn(picture, &c, RX_LEAST * step * step);
    for (int y = 0; y < picture->height; y++) {
        for (int x = 0; x < picture->width; x++) {
            double rgb[3];

            rgb_at(rgb, picture, x, y);
            sst_map_u16_row(&out->plane[0], y)[x] = level_of(sqrt(fmax(distance2(&c, rgb), 0)));
        }
    }
    return smooth(&out->plane[0], reach);
}
