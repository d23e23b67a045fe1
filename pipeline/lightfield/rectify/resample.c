/* Resampling through a map in one pass: positions of a row, samples in 1/128 levels, light, bytes. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <pthread.h>
#include <stdlib.h>
#include <string.h>

#include "base/mem.h"
#include "pipeline/kernels/kernels.h"
#include "pipeline/lightfield/rectify/rectify_internal.h"

#define MAX_TAPS 6

static const struct {
    const char *name;
    int taps;
} filters[] = {
    [SST_FILTER_BILINEAR] = { "bilinear", 2 },
    [SST_FILTER_BICUBIC] = { "bicubic", 4 },
    [SST_FILTER_LANCZOS] = { "lanczos", 6 },
};

static int16_t weights[ARRAY_LEN(filters)][SST_RESAMPLE_PHASES * MAX_TAPS]; /* fixed after once */
static pthread_once_t once = PTHREAD_ONCE_INIT;

const char *sst_filter_name(enum sst_filter filter)
{
    return filters[filter].name;
}

bool sst_filter_find(enum sst_filter *out, const char *name)
{
    for (size_t i = 0; i < ARRAY_LEN(filters); i++) {
        if (!strcmp(filters[i].name, name)) {
            *out = (enum sst_filter)i;
            return true;
        }
    }
    return false;
}

/* --- filters ------------------------------------------------------------------------------------------------------ */

static double sinc(double x)
{
    return x == 0 ? 1 : sin(M_PI * x) / (M_PI * x);
}

/* The filter at distance x from its centre. */
static double filter_at(enum sst_filter filter, double x)
{
    x = fabs(x);
    switch (filter) {
    case SST_FILTER_BILINEAR:
        return x < 1 ? 1 - x : 0;
    case SST_FILTER_BICUBIC: /* Keys 1981, eq. (4) with a = -1/2 */
        return x < 1 ? (1.5 * x - 2.5) * x * x + 1 : x < 2 ? ((-0.5 * x + 2.5) * x - 4) * x + 2 : 0;
    case SST_FILTER_LANCZOS:
        break;
    }
    return x < 3 ? sinc(x) * sinc(x / 3) : 0;
}

/* Integer weights of one position that sum to 2^14: the largest absorbs the rounding error. */
static void set_weights(int16_t *out, enum sst_filter filter, double part)
{
    const int taps = filters[filter].taps;
    double w[MAX_TAPS], sum = 0;
    int left = 1 << 14, largest = 0;

    for (int i = 0; i < taps; i++) {
        w[i] = filter_at(filter, i + 1 - taps / 2 - part);
        sum += w[i];
    }
    for (int i = 0; i < taps; i++) {
        out[i] = (int16_t)lrint(w[i] / sum * (1 << 14));
        left -= out[i];
        largest = out[i] > out[largest] ? i : largest;
    }
    out[largest] = (int16_t)(out[largest] + left);
}

static void set_all_weights(void)
{
    for (size_t f = 0; f < ARRAY_LEN(filters); f++) {
        for (int p = 0; p < SST_RESAMPLE_PHASES; p++)
            set_weights(&weights[f][p * filters[f].taps], (enum sst_filter)f, p / (double)SST_RESAMPLE_PHASES);
    }
}

const int16_t *filter_weights(enum sst_filter filter, int *taps)
{
    pthread_once(&once, set_all_weights);
    *taps = filters[filter].taps;
    return weights[filter];
}

/* --- raw frames --------------------------------------------------------------------------------------------------- */

struct sst_sampler {
    const struct sst_rectify_map *map;
    uint8_t *packed; /* the frame with interleaved colours, its border repeated */
    struct sst_resample from;
};

static int sampler_make(struct sst_sampler *s, const struct sst_rectify_map *map, enum sst_filter filter)
{
    const size_t border = 2 * SST_RESAMPLE_BORDER, stride = sst_mem_stride((size_t)map->chain.raw_width + border, 4);

    if ((size_t)filter >= ARRAY_LEN(filters))
        return -EINVAL;
    pthread_once(&once, set_all_weights);
    *s =
        (struct sst_sampler){ .map = map, .packed = sst_mem_alloc_raw((size_t)map->chain.raw_height + border, stride) };
    if (!s->packed)
        return -ENOMEM;
    s->from = (struct sst_resample){ .pixel = s->packed + SST_RESAMPLE_BORDER * (stride + 4),
                                     .stride = stride,
                                     .weight = weights[filter],
                                     .taps = filters[filter].taps };
    return 0;
}

/* Repeat the outermost pixels beyond the sides of the frame that a stored part touches. */
static void repeat_border(const struct sst_sampler *s, const struct sst_rect *part)
{
    const size_t border = SST_RESAMPLE_BORDER, own = s->from.stride;
    const int x = part->x0, y = part->y0, width = part->x1 - x, height = part->y1 - y;
    const bool left = x == 0, right = x + width == s->map->chain.raw_width;
    const bool top = y == 0, bottom = y + height == s->map->chain.raw_height;
    uint8_t *const first = s->packed + (border + (size_t)y) * own + 4 * (border + (size_t)x);
    /* Include the border columns on the sides that the part touches: border rows repeat them too. */
    const size_t before = left ? 4 * border : 0, after = right ? 4 * border : 0, line = 4 * (size_t)width;

    for (int row = 0; row < height; row++) {
        uint8_t *to = first + (size_t)row * own;

        for (size_t i = 4; i <= before; i += 4)
            memcpy(to - i, to, 4);
        for (size_t i = 0; i < after; i += 4)
            memcpy(to + line + i, to + line - 4, 4);
    }
    for (size_t i = 1; top && i <= border; i++)
        memcpy(first - before - i * own, first - before, before + line + after);
    for (size_t i = 0; bottom && i < border; i++) {
        uint8_t *last = first - before + (size_t)(height - 1) * own;

        memcpy(last + (i + 1) * own, last, before + line + after);
    }
}

static int sampler_init(struct sst_sampler *s, const struct sst_rectify_map *map, enum sst_filter filter,
                        const struct sst_image *raw)
{
    int err = raw->width == map->chain.raw_width && raw->height == map->chain.raw_height ? 0 : -EINVAL;

    err = err ? err : sampler_make(s, map, filter);
    if (err)
        return err;
    sst_image_put_rgbx(s->packed + SST_RESAMPLE_BORDER * (s->from.stride + 4), s->from.stride, raw);
    repeat_border(s, &(struct sst_rect){ 0, 0, raw->width, raw->height });
    return 0;
}

int sst_sampler_create(struct sst_sampler **out, const struct sst_rectify_map *map, enum sst_filter filter,
                       const struct sst_image *raw)
{
    struct sst_sampler *s = calloc(1, sizeof(*s));
    int err = s ? sampler_init(s, map, filter, raw) : -ENOMEM;

    if (err)
        sst_sampler_destroy(s);
    else
        *out = s;
    return err;
}

void sst_sampler_destroy(struct sst_sampler *s)
{
    if (!s)
        return;
    sst_mem_free(s->packed);
    free(s);
}

int sst_sampler_create_empty(struct sst_sampler **out, const struct sst_rectify_map *map, enum sst_filter filter)
{
    struct sst_sampler *s = calloc(1, sizeof(*s));
    int err = s ? sampler_make(s, map, filter) : -ENOMEM;

    if (err) {
        sst_sampler_destroy(s);
        return err;
    }
    memset(s->packed, 0, ((size_t)map->chain.raw_height + 2 * SST_RESAMPLE_BORDER) * s->from.stride);
    *out = s;
    return 0;
}

const uint8_t *sst_sampler_pixels(const struct sst_sampler *s, size_t *stride)
{
    *stride = s->from.stride;
    return s->from.pixel;
}

void sst_sampler_put(struct sst_sampler *s, const struct sst_rect *part, const uint8_t *rgbx, size_t stride)
{
    const size_t border = SST_RESAMPLE_BORDER, own = s->from.stride;
    uint8_t *const first = s->packed + (border + (size_t)part->y0) * own + 4 * (border + (size_t)part->x0);

    for (int row = 0; row < part->y1 - part->y0; row++)
        memcpy(first + (size_t)row * own, rgbx + (size_t)row * stride, 4 * (size_t)(part->x1 - part->x0));
    repeat_border(s, part);
}

bool sst_rectify_map_box(const struct sst_rectify_map *map, enum sst_filter filter, const struct sst_rect *part,
                         int box[4], struct sst_map_u8 *valid)
{
    const int half = filters[filter].taps / 2, w = map->chain.raw_width, h = map->chain.raw_height;
    int32_t low[2] = { INT32_MAX, INT32_MAX }, high[2] = { INT32_MIN, INT32_MIN };
    int32_t xy_q8[2 * SST_SAMPLE_MAX];

    for (int y = part->y0; y < part->y1; y++) {
        for (int x = part->x0; x < part->x1; x += SST_SAMPLE_MAX) {
            const int n = sst_min_int(SST_SAMPLE_MAX, part->x1 - x);

            sst_rectify_map_row(map, x, y, n, xy_q8);
            for (int i = 0; i < n; i++) {
                const bool seen = xy_q8[2 * i] != INT32_MIN;

                if (valid)
                    sst_map_u8_row(valid, y)[x + i] = seen ? 255 : 0;
                for (int axis = 0; seen && axis < 2; axis++) {
                    low[axis] = sst_min_int(low[axis], xy_q8[2 * i + axis] >> 8);
                    high[axis] = sst_max_int(high[axis], xy_q8[2 * i + axis] >> 8);
                }
            }
        }
    }
    if (low[0] == INT32_MAX) {
        memset(box, 0, 4 * sizeof(*box));
        return false;
    }
    /* The taps of a position after pixel x are at x + 1 - half .. x + half, clamped to the border. */
    box[0] = sst_clamp_int(low[0] + 1 - half, 0, w - 1);
    box[1] = sst_clamp_int(low[1] + 1 - half, 0, h - 1);
    box[2] = sst_clamp_int(high[0] + half, 0, w - 1) + 1;
    box[3] = sst_clamp_int(high[1] + half, 0, h - 1) + 1;
    return true;
}

/* --- rows --------------------------------------------------------------------------------------------------------- */

static void round_row(uint8_t *restrict out, const uint16_t *restrict sample, int n)
{
    for (int i = 0; i < n; i++)
        out[i] = (uint8_t)((sample[i] + (1 << (SST_LIGHT_SHIFT - 1))) >> SST_LIGHT_SHIFT);
}

/* Samples to bytes: with light correction, or only rounded. */
static void finish_row(const struct gain_map *light, uint16_t *const sample[3], const struct sst_rectified_row *row,
                       uint8_t *const out[3])
{
    struct gain_factors factors = { 0 };
    float scratch[2 * SST_SAMPLE_MAX];

    if (light)
        gain_map_row(light, row, scratch, &factors);
    for (int c = 0; c < 3; c++) {
        const struct sst_light l = { .value = sample[c],
                                     .falloff = factors.falloff,
                                     .falloff_root = factors.falloff_root,
                                     .gain = factors.gain[c],
                                     .gain_root = factors.gain_root[c] };

        if (light)
            sst_kernels_get()->light_row(out[c], &l, (size_t)row->n);
        else
            round_row(out[c], sample[c], row->n);
    }
}

void sst_sampler_row(const struct sst_sampler *s, const struct sst_rectified_row *row, uint8_t *const out[3],
                     uint8_t *seen)
{
    int32_t xy_q8[2 * SST_SAMPLE_MAX];
    uint16_t samples[3][SST_SAMPLE_MAX], *const sample[3] = { samples[0], samples[1], samples[2] };

    sst_rectify_map_row(s->map, row->x0, row->y, row->n, xy_q8);
    sst_kernels_get()->resample_row(sample, &s->from, xy_q8, (size_t)row->n);
    finish_row(s->map->light, sample, row, out);
    for (int i = 0; seen && i < row->n; i++)
        seen[i] = xy_q8[2 * i] == INT32_MIN ? 0 : 255;
}

/* --- views -------------------------------------------------------------------------------------------------------- */

int sst_rectify_view(const struct sst_rectified_view *out, const struct sst_rectify_map *map, enum sst_filter filter,
                     const struct sst_image *raw)
{
    const struct sst_image *image = out->image;
    struct sst_sampler sampler;
    int err;

    if (image->width != map->width || image->height != map->height ||
        (out->valid && (out->valid->width != map->width || out->valid->height != map->height)))
        return -EINVAL;
    err = sampler_init(&sampler, map, filter, raw);
    if (err)
        return err;
    for (int y = 0; y < image->height; y++) {
        for (int x = 0; x < image->width; x += SST_SAMPLE_MAX) {
            const struct sst_rectified_row row = { x, y, sst_min_int(SST_SAMPLE_MAX, image->width - x) };
            uint8_t *const to[3] = { sst_image_row(image, 0, y) + x, sst_image_row(image, 1, y) + x,
                                     sst_image_row(image, 2, y) + x };

            sst_sampler_row(&sampler, &row, to, out->valid ? sst_map_u8_row(out->valid, y) + x : NULL);
        }
    }
    sst_mem_free(sampler.packed);
    return 0;
}
