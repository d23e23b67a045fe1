/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/image/image.h"

#include <errno.h>
#include <string.h>

#include "base/log.h"
#include "base/mem.h"
#include "pipeline/image/codec_formats.h"

/* Planes one below the other, and bytes of a pixel in each. */
struct layout {
    size_t planes, pixel_bytes;
};

static int allocate(void **data, size_t *stride, int width, int height, struct layout l)
{
    void *p;

    if (width < 1 || height < 1 || width > SST_IMAGE_MAX_SIDE || height > SST_IMAGE_MAX_SIDE ||
        (size_t)width * (size_t)height > SST_IMAGE_MAX_PIXELS)
        return -EINVAL;
    *stride = sst_mem_stride((size_t)width, l.pixel_bytes);
    p = sst_mem_alloc(l.planes * (size_t)height, *stride);
    if (!p)
        return -ENOMEM;
    *data = p;
    return 0;
}

int sst_image_init(struct sst_image *img, int width, int height)
{
    struct sst_image made = { .width = width, .height = height };
    void *data;
    int err = allocate(&data, &made.stride, width, height, (struct layout){ 3, 1 });

    if (err)
        return err;
    for (size_t c = 0; c < 3; c++)
        made.plane[c] = (uint8_t *)data + c * (size_t)height * made.stride;
    *img = made;
    return 0;
}

void sst_image_fini(struct sst_image *img)
{
    sst_mem_free(img->plane[0]);
    *img = (struct sst_image){ 0 };
}

#define DEFINE_MAP(name, type)                                                                                         \
    int sst_map_##name##_init(struct sst_map_##name *map, int width, int height)                                       \
    {                                                                                                                  \
        struct sst_map_##name made = { .width = width, .height = height };                                             \
        void *data;                                                                                                    \
        int err = allocate(&data, &made.stride, width, height, (struct layout){ 1, sizeof(type) });                    \
                                                                                                                       \
        if (err)                                                                                                       \
            return err;                                                                                                \
        made.data = data;                                                                                              \
        *map = made;                                                                                                   \
        return 0;                                                                                                      \
    }                                                                                                                  \
                                                                                                                       \
    void sst_map_##name##_fini(struct sst_map_##name *map)                                                             \
    {                                                                                                                  \
        sst_mem_free(map->data);                                                                                       \
        *map = (struct sst_map_##name){ 0 };                                                                           \
    }

DEFINE_MAP(u8, uint8_t)
DEFINE_MAP(u16, uint16_t)
DEFINE_MAP(f32, float)

void sst_image_halve_part(struct sst_image *out, const struct sst_image *in, struct sst_rect part)
{
    const int pairs = sst_min_int(part.x1, in->width / 2), last = in->width - 1;

    for (int c = 0; c < 3; c++) {
        for (int y = part.y0; y < part.y1; y++) {
            const uint8_t *restrict a = sst_image_row(in, c, 2 * y);
            const uint8_t *restrict b = sst_image_row(in, c, sst_min_int(2 * y + 1, in->height - 1));
            uint8_t *restrict o = sst_image_row(out, c, y);

            for (int x = part.x0; x < pairs; x++)
                o[x] = (uint8_t)((a[2 * x] + a[2 * x + 1] + b[2 * x] + b[2 * x + 1] + 2) >> 2);
            if (pairs < part.x1)
                o[pairs] = (uint8_t)((2 * a[last] + 2 * b[last] + 2) >> 2);
        }
    }
}

int sst_image_halve(struct sst_image *out, const struct sst_image *in)
{
    const int err = sst_image_init(out, (in->width + 1) / 2, (in->height + 1) / 2);

    if (!err)
        sst_image_halve_part(out, in, (struct sst_rect){ 0, 0, out->width, out->height });
    return err;
}

int sst_map_u8_halve(struct sst_map_u8 *out, const struct sst_map_u8 *in)
{
    const int err = sst_map_u8_init(out, sst_max_int(in->width / 2, 1), sst_max_int(in->height / 2, 1));

    for (int y = 0; !err && y < out->height; y++) {
        const uint8_t *a = sst_map_u8_row(in, 2 * y), *b = sst_map_u8_row(in, sst_min_int(2 * y + 1, in->height - 1));
        uint8_t *row = sst_map_u8_row(out, y);

        for (int x = 0; x < out->width; x++) {
            const int next = sst_min_int(2 * x + 1, in->width - 1);

            row[x] = (uint8_t)((a[2 * x] + a[next] + b[2 * x] + b[next] + 2) >> 2);
        }
    }
    return err;
}

int sst_image_shrink(struct sst_image *img, int max_width)
{
    while (img->width > max_width) {
        struct sst_image half;
        const int err = sst_image_halve(&half, img);

        if (err)
            return err;
        sst_image_fini(img);
        *img = half;
    }
    return 0;
}

void sst_luma_part(struct sst_map_u8 *luma, const struct sst_image *img, struct sst_rect part)
{
    for (int y = part.y0; y < part.y1; y++) {
        const uint8_t *r = sst_image_row(img, 0, y), *g = sst_image_row(img, 1, y), *b = sst_image_row(img, 2, y);
        uint8_t *out = sst_map_u8_row(luma, y);

        for (int x = part.x0; x < part.x1; x++)
            out[x] = (uint8_t)((77 * r[x] + 150 * g[x] + 29 * b[x] + 128) >> 8);
    }
}

int sst_luma(struct sst_map_u8 *luma, const struct sst_image *img)
{
    const int err = sst_map_u8_init(luma, img->width, img->height);

    if (!err)
        sst_luma_part(luma, img, (struct sst_rect){ 0, 0, img->width, img->height });
    return err;
}

int sst_image_size_error(int err, const char *name, int64_t width, int64_t height)
{
    if (err == -ENOMEM) {
        sst_log_error("out of memory for %s (%lldx%lld pixels)", name, (long long)width, (long long)height);
        return -ENOMEM;
    }
    sst_log_error("%s claims %lldx%lld pixels; a side must be 1 to %d and the area at most %zu", name, (long long)width,
                  (long long)height, SST_IMAGE_MAX_SIDE, SST_IMAGE_MAX_PIXELS);
    return -EBADMSG;
}

void sst_rgb_unpack_row(struct sst_image *img, int y, const uint8_t *rgb)
{
    uint8_t *r = sst_image_row(img, 0, y), *g = sst_image_row(img, 1, y), *b = sst_image_row(img, 2, y);

    for (size_t x = 0; x < (size_t)img->width; x++) {
        r[x] = rgb[3 * x];
        g[x] = rgb[3 * x + 1];
        b[x] = rgb[3 * x + 2];
    }
}

void sst_rgb_pack_row(uint8_t *rgb, const struct sst_image *img, int y)
{
    const uint8_t *r = sst_image_row(img, 0, y), *g = sst_image_row(img, 1, y), *b = sst_image_row(img, 2, y);

    for (size_t x = 0; x < (size_t)img->width; x++) {
        rgb[3 * x] = r[x];
        rgb[3 * x + 1] = g[x];
        rgb[3 * x + 2] = b[x];
    }
}

void sst_image_put_rgbx(uint8_t *rgbx, size_t stride, const struct sst_image *img)
{
    for (int y = 0; y < img->height; y++) {
        const uint8_t *r = sst_image_row(img, 0, y), *g = sst_image_row(img, 1, y), *b = sst_image_row(img, 2, y);
        uint8_t *to = rgbx + (size_t)y * stride;

        for (size_t x = 0; x < (size_t)img->width; x++) {
            const uint32_t pixel = (uint32_t)r[x] | (uint32_t)g[x] << 8 | (uint32_t)b[x] << 16 | 0xFF000000U;

            memcpy(to + 4 * x, &pixel, sizeof(pixel));
        }
    }
}
