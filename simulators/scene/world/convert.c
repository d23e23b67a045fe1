/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "simulators/scene/world/world_internal.h"

#include <string.h>

#include <linux/videodev2.h>

/* BT.601, full range, as in JPEG: a strip's levels and a decoded frame agree. 16 fraction bits. */
#define HALF 32768

static uint8_t luma_of(int r, int g, int b)
{
    return (uint8_t)((19595 * r + 38470 * g + 7471 * b + HALF) >> 16);
}

static uint8_t clamp_byte(int v)
{
    return (uint8_t)sst_clamp_int(v, 0, 255);
}

void sim_shrink(const struct sst_image *in, struct sst_image *out)
{
    for (int c = 0; c < 3; c++) {
        for (int y = 0; y < out->height; y++) {
            const int y0 = (int)((int64_t)y * in->height / out->height);
            const int y1 = sst_max_int(y0 + 1, (int)((int64_t)(y + 1) * in->height / out->height));

            for (int x = 0; x < out->width; x++) {
                const int x0 = (int)((int64_t)x * in->width / out->width);
                const int x1 = sst_max_int(x0 + 1, (int)((int64_t)(x + 1) * in->width / out->width));
                const int n = (x1 - x0) * (y1 - y0);
                int sum = n / 2;

                for (int v = y0; v < y1; v++) {
                    for (int u = x0; u < x1; u++)
                        sum += sst_image_row(in, c, v)[u];
                }
                sst_image_row(out, c, y)[x] = (uint8_t)(sum / n);
            }
        }
    }
}

size_t sim_format_bytes(uint32_t fourcc, int width, int height)
{
    const size_t pixels = (size_t)width * (size_t)height;

    switch (fourcc) {
    case V4L2_PIX_FMT_YUYV:
    case V4L2_PIX_FMT_Y16:
        return 2 * pixels;
    case V4L2_PIX_FMT_GREY:
    case V4L2_PIX_FMT_SBGGR8:
    case V4L2_PIX_FMT_SGBRG8:
    case V4L2_PIX_FMT_SGRBG8:
    case V4L2_PIX_FMT_SRGGB8:
        return pixels;
    default:
        return 0;
    }
}

/* Plane (0 red .. 2 blue) of an 8-bit Bayer pattern at x, y. */
static int bayer_plane(uint32_t fourcc, int x, int y)
{
    const int red_x = fourcc == V4L2_PIX_FMT_SBGGR8 || fourcc == V4L2_PIX_FMT_SGRBG8;
    const int red_y = fourcc == V4L2_PIX_FMT_SBGGR8 || fourcc == V4L2_PIX_FMT_SGBRG8;
    const bool on_red_x = (x & 1) == red_x, on_red_y = (y & 1) == red_y;

    return on_red_x && on_red_y ? 0 : !on_red_x && !on_red_y ? 2 : 1;
}

static void pack_yuyv_row(const uint8_t *r, const uint8_t *g, const uint8_t *b, int width, uint8_t *out)
{
    for (int x = 0; x < width; x++)
        out[2 * x] = luma_of(r[x], g[x], b[x]);
    for (int x = 0; x + 1 < width; x += 2) {
        const int red = r[x] + r[x + 1], green = g[x] + g[x + 1], blue = b[x] + b[x + 1];

        out[2 * x + 1] = clamp_byte(128 + ((-11058 * red - 21710 * green + 32768 * blue + 2 * HALF) >> 17));
        out[2 * x + 3] = clamp_byte(128 + ((32768 * red - 27439 * green - 5329 * blue + 2 * HALF) >> 17));
    }
}

void sim_pack(const struct sst_image *img, uint32_t fourcc, uint8_t *out)
{
    const size_t pitch = sim_format_bytes(fourcc, img->width, 1);

    for (int y = 0; y < img->height; y++, out += pitch) {
        const uint8_t *r = sst_image_row(img, 0, y), *g = sst_image_row(img, 1, y), *b = sst_image_row(img, 2, y);

        if (fourcc == V4L2_PIX_FMT_YUYV) {
            pack_yuyv_row(r, g, b, img->width, out);
            continue;
        }
        for (int x = 0; x < img->width; x++) {
            if (fourcc == V4L2_PIX_FMT_GREY)
                out[x] = luma_of(r[x], g[x], b[x]);
            else if (fourcc == V4L2_PIX_FMT_Y16) /* 8 bits scaled to 16: 255 becomes 65535 */
                out[2 * x] = out[2 * x + 1] = luma_of(r[x], g[x], b[x]);
            else
                out[x] = sst_image_row(img, bayer_plane(fourcc, x, y), y)[x];
        }
    }
}

void sim_pack_luma(const uint8_t *luma, int width, int height, uint32_t fourcc, uint8_t *out)
{
    const size_t n = (size_t)width * (size_t)height;

    if (fourcc != V4L2_PIX_FMT_YUYV && fourcc != V4L2_PIX_FMT_Y16) {
        memcpy(out, luma, n);
        return;
    }
    for (size_t i = 0; i < n; i++) {
        out[2 * i] = luma[i];
        out[2 * i + 1] = fourcc == V4L2_PIX_FMT_YUYV ? 128 : luma[i];
    }
}
