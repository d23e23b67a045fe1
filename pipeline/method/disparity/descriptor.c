/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <string.h>

#include "base/mem.h"
#include "pipeline/kernels/kernels.h"
#include "pipeline/method/disparity/stage.h"

#define CENSUS_NARROW 64
#define CENSUS_MARGIN 8 /* columns repeated on each side; the census window reaches 4 */

/* Columns of a part, in row y of the luma sampled at (x, y) + (phase % 4, phase / 4) / 4, with CENSUS_MARGIN columns
 * repeated beside the view. */
static void phase_row(uint8_t *out, const struct sst_map_u8 *luma, struct sst_rect part, int y, int phase)
{
    const int w = luma->width, h = luma->height, px = phase % 4, py = phase / 4;
    const uint8_t *a = sst_map_u8_row(luma, sst_clamp_int(y, 0, h - 1));
    const uint8_t *b = sst_map_u8_row(luma, sst_clamp_int(y + 1, 0, h - 1));
    uint8_t *o = out + CENSUS_MARGIN;

    for (int x = part.x0; x < sst_min_int(part.x1, w - 1); x++)
        o[x] =
            (uint8_t)(((4 - py) * ((4 - px) * a[x] + px * a[x + 1]) + py * ((4 - px) * b[x] + px * b[x + 1]) + 8) >> 4);
    if (part.x1 == w) {
        o[w - 1] = (uint8_t)(((4 - py) * a[w - 1] + py * b[w - 1] + 2) >> 2);
        memset(o + w, o[w - 1], CENSUS_MARGIN);
    }
    if (!part.x0)
        memset(out, o[0], CENSUS_MARGIN);
}

/* A part of the census of one phase. */
static int census_part(struct sst_descriptor *desc, int phase, struct sst_rect part)
{
    const size_t w = (size_t)desc->width, padded = sst_mem_stride(w + 2 * CENSUS_MARGIN, 1);
    const struct sst_rect read = { sst_max_int(part.x0 - CENSUS_MARGIN, 0), 0,
                                   sst_min_int(part.x1 + CENSUS_MARGIN, desc->width), desc->height };
    const struct sst_kernels *k = sst_kernels_get();
    uint8_t *ring = sst_mem_keep(&desc->rows, 7, padded);

    if (!ring)
        return -ENOMEM;
    for (int y = part.y0, next = part.y0 - 3; y < part.y1; y++) {
        const uint8_t *rows[7];

        /* Row j of the image, borders repeated, is in ring slot (j + 7) % 7. */
        for (; next <= y + 3; next++)
            phase_row(ring + (size_t)((next + 7) % 7) * padded, &desc->luma, read, next, phase);
        for (int j = 0; j < 7; j++)
            rows[j] = ring + (size_t)((y + j - 3 + 7) % 7) * padded + CENSUS_MARGIN + part.x0;
        k->census_row(desc->census[phase] + (size_t)y * desc->census_stride + part.x0, rows,
                      (size_t)(part.x1 - part.x0));
    }
    return 0;
}

static size_t census_stride(const struct sst_descriptor *desc)
{
    return sst_mem_stride((size_t)desc->width, sizeof(uint64_t)) / sizeof(uint64_t);
}

static int make_census(struct sst_descriptor *desc, int phase)
{
    desc->census_stride = census_stride(desc);
    desc->census[phase] = sst_mem_alloc_raw((size_t)desc->height * desc->census_stride, sizeof(uint64_t));
    return desc->census[phase] ? census_part(desc, phase, (struct sst_rect){ 0, 0, desc->width, desc->height })
                               : -ENOMEM;
}

int sst_descriptor_update(struct sst_descriptor *desc, const struct sst_image *img, struct sst_rect part)
{
    /* The window reaches 4 columns and 3 rows, a phase between two pixels one more to the left and up. Narrow parts are
     * widened: the kernel is slow for less than CENSUS_NARROW columns. */
    const int end = sst_min_int(part.x1 + 4, desc->width);
    const int left = sst_max_int(sst_min_int(part.x0 - 5, end - CENSUS_NARROW), 0);
    const struct sst_rect around = { left, sst_max_int(part.y0 - 4, 0),
                                     sst_min_int(sst_max_int(end, left + CENSUS_NARROW), desc->width),
                                     sst_min_int(part.y1 + 3, desc->height) };
    int err = 0;

    sst_image_halve_part(&desc->image, img, part);
    sst_luma_part(&desc->luma, &desc->image, part);
    for (int p = 0; !err && p < SST_PHASES; p++) {
        if (desc->census[p])
            err = census_part(desc, p, around);
    }
    return err;
}

int sst_descriptor_add_phases(struct sst_descriptor *desc, unsigned phases)
{
    int err = 0;

    for (int p = 1; !err && desc->census[0] && p < SST_PHASES; p++) {
        if (phases & 1u << p && !desc->census[p])
            err = make_census(desc, p);
    }
    return err;
}

int sst_descriptor_lend_census(struct sst_descriptor *desc, int phase, uint64_t *memory)
{
    desc->census_stride = census_stride(desc);
    desc->census_lent = true;
    desc->census[phase] = memory;
    return census_part(desc, phase, (struct sst_rect){ 0, 0, desc->width, desc->height });
}

int sst_descriptor_add_census(struct sst_descriptor *desc)
{
    return desc->census[0] ? 0 : make_census(desc, 0);
}

void sst_descriptor_drop_phases(struct sst_descriptor *desc)
{
    for (int p = 1; p < SST_PHASES; p++) {
        sst_mem_free(desc->census[p]);
        desc->census[p] = NULL;
    }
}

int sst_descriptor_init(struct sst_descriptor *desc, const struct sst_image *img, int scale, enum sst_cost cost,
                        struct sst_network *net)
{
    struct sst_descriptor made = { .image = *img };
    int err = 0;

    if (scale == 2) {
        err = sst_image_halve(&made.image, img);
        if (err)
            return err;
        made.image_owned = true;
    }
    made.width = made.image.width;
    made.height = made.image.height;
    err = sst_luma(&made.luma, &made.image);
    if (!err && cost & SST_COST_CENSUS)
        err = make_census(&made, 0);
    if (!err && cost & SST_COST_MCCNN)
        err = sst_descriptor_add_features(&made, net, NULL);
    if (err) {
        sst_descriptor_fini(&made);
        return err;
    }
    *desc = made;
    return 0;
}

int sst_disparity_mask_reduce(struct sst_map_u8 *out, const struct sst_map_u8 *mask, int factor)
{
    const int err = sst_map_u8_init(out, (mask->width + factor - 1) / factor, (mask->height + factor - 1) / factor);

    if (err)
        return err;
    memset(out->data, 255, out->stride * (size_t)out->height);
    for (int y = 0; y < mask->height; y++) {
        const uint8_t *in = sst_map_u8_row(mask, y);
        uint8_t *to = sst_map_u8_row(out, y / factor);

        for (int x = 0; x < mask->width; x++)
            to[x / factor] &= in[x];
    }
    return 0;
}

void sst_descriptor_fini(struct sst_descriptor *desc)
{
    if (desc->image_owned)
        sst_image_fini(&desc->image);
    sst_map_u8_fini(&desc->luma);
    sst_map_u8_fini(&desc->seen);
    for (int p = 0; p < SST_PHASES && !desc->census_lent; p++)
        sst_mem_free(desc->census[p]);
    sst_mem_free(desc->feature_memory);
    sst_mem_kept_fini(&desc->rows);
    *desc = (struct sst_descriptor){ 0 };
}
