/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/eval/eval.h"

#include <errno.h>
#include <math.h>
#include <string.h>

#include "base/mem.h"

#define PSNR_MAX_DB 100.0
#define RADIUS      5
#define SIGMA       1.5
#define C1          (0.01 * 255 * 0.01 * 255)
#define C2          (0.03 * 255 * 0.03 * 255)

static bool fits(const struct sst_image *a, const struct sst_image *b, const struct sst_map_u8 *mask)
{
    return a->width == b->width && a->height == b->height &&
           (!mask || (mask->width == a->width && mask->height == a->height));
}

double sst_psnr(const struct sst_image *a, const struct sst_image *b, const struct sst_map_u8 *mask)
{
    uint64_t squares = 0, pixels = 0;

    if (!fits(a, b, mask))
        return NAN;
    for (int y = 0; y < a->height; y++) {
        const uint8_t *m = mask ? sst_map_u8_row(mask, y) : NULL;

        for (int c = 0; c < 3; c++) {
            const uint8_t *p = sst_image_row(a, c, y), *q = sst_image_row(b, c, y);

            for (int x = 0; x < a->width; x++) {
                if (!m || m[x])
                    squares += (uint64_t)((p[x] - q[x]) * (p[x] - q[x]));
            }
        }
        for (int x = 0; x < a->width; x++)
            pixels += !m || m[x];
    }
    if (pixels == 0)
        return NAN;
    if (squares == 0)
        return PSNR_MAX_DB;
    return fmin(10 * log10(255.0 * 255.0 * 3 * (double)pixels / (double)squares), PSNR_MAX_DB);
}

static void luma_row(double *out, const struct sst_image *img, int y)
{
    const uint8_t *r = sst_image_row(img, 0, y), *g = sst_image_row(img, 1, y), *b = sst_image_row(img, 2, y);

    for (int x = 0; x < img->width; x++)
        out[x] = 0.299 * r[x] + 0.587 * g[x] + 0.114 * b[x];
}

/* The five local means of SSIM; first as sums, with the weight of the part of the window inside. */
enum mean { MEAN_A, MEAN_B, MEAN_AA, MEAN_BB, MEAN_AB, MEANS };

struct ssim {
    int width, height;
    double *a, *b;         /* luma [height][width] */
    double *column[MEANS]; /* [width] sums over the rows of the window */
    double kernel[2 * RADIUS + 1];
};

/* Sums over the window's rows around y; returns their weight. */
static double sum_columns(struct ssim *s, int y)
{
    const size_t w = (size_t)s->width;
    double weight = 0;

    for (int i = 0; i < MEANS; i++)
        memset(s->column[i], 0, w * sizeof(double));
    for (int j = sst_max_int(y - RADIUS, 0); j <= sst_min_int(y + RADIUS, s->height - 1); j++) {
        const double k = s->kernel[j - y + RADIUS];
        const double *a = s->a + (size_t)j * w, *b = s->b + (size_t)j * w;

        weight += k;
        for (size_t x = 0; x < w; x++) {
            s->column[MEAN_A][x] += k * a[x];
            s->column[MEAN_B][x] += k * b[x];
            s->column[MEAN_AA][x] += k * (a[x] * a[x]);
            s->column[MEAN_BB][x] += k * (b[x] * b[x]);
            s->column[MEAN_AB][x] += k * (a[x] * b[x]);
        }
    }
    return weight;
}

static double ssim_at(const struct ssim *s, int x, double row_weight)
{
    double m[MEANS] = { 0 }, weight = 0, var_a, var_b, cov;

    for (int j = sst_max_int(x - RADIUS, 0); j <= sst_min_int(x + RADIUS, s->width - 1); j++) {
        const double k = s->kernel[j - x + RADIUS];

        weight += k;
        for (int i = 0; i < MEANS; i++)
            m[i] += k * s->column[i][j];
    }
    for (int i = 0; i < MEANS; i++)
        m[i] /= weight * row_weight;
    /* Luma is at most 255: the cancellation error is below 1e-11, negligible beside C2 = 58.5, even if negative. */
    var_a = m[MEAN_AA] - m[MEAN_A] * m[MEAN_A];
    var_b = m[MEAN_BB] - m[MEAN_B] * m[MEAN_B];
    cov = m[MEAN_AB] - m[MEAN_A] * m[MEAN_B];
    return (2 * m[MEAN_A] * m[MEAN_B] + C1) * (2 * cov + C2) /
           ((m[MEAN_A] * m[MEAN_A] + m[MEAN_B] * m[MEAN_B] + C1) * (var_a + var_b + C2));
}

static bool row_is_empty(const uint8_t *mask, int width)
{
    int x = 0;

    while (x < width && !mask[x])
        x++;
    return x == width;
}

static double ssim_mean(struct ssim *s, const struct sst_map_u8 *mask)
{
    double sum = 0;
    int64_t pixels = 0;

    for (int y = 0; y < s->height; y++) {
        const uint8_t *m = mask ? sst_map_u8_row(mask, y) : NULL;
        double row_weight;

        if (m && row_is_empty(m, s->width))
            continue;
        row_weight = sum_columns(s, y);
        for (int x = 0; x < s->width; x++) {
            if (!m || m[x]) {
                sum += ssim_at(s, x, row_weight);
                pixels++;
            }
        }
    }
    return pixels ? sum / (double)pixels : NAN;
}

int sst_ssim(double *out, const struct sst_image *a, const struct sst_image *b, const struct sst_map_u8 *mask)
{
    const size_t w = (size_t)a->width, n = w * (size_t)a->height;
    struct ssim s = { .width = a->width, .height = a->height };
    double *memory;

    if (!fits(a, b, mask))
        return -EINVAL;
    memory = sst_mem_alloc_raw(2 * n + MEANS * w, sizeof(*memory));
    if (!memory)
        return -ENOMEM;
    s.a = memory;
    s.b = memory + n;
    for (size_t i = 0; i < MEANS; i++)
        s.column[i] = memory + 2 * n + i * w;
    for (int i = -RADIUS; i <= RADIUS; i++)
        s.kernel[i + RADIUS] = exp(-i * i / (2 * SIGMA * SIGMA));
    for (int y = 0; y < a->height; y++) {
        luma_row(s.a + (size_t)y * w, a, y);
        luma_row(s.b + (size_t)y * w, b, y);
    }
    *out = ssim_mean(&s, mask);
    sst_mem_free(memory);
    return 0;
}
