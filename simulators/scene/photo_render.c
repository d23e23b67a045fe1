/* Renderer of layered scenes: sprites from front to back, each pixel until it is opaque. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <float.h>
#include <limits.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/mem.h"
#include "simulators/scene/scene_internal.h"

#define CLEAR (1 / 512.0F) /* transmittance below which nothing behind is visible */

struct canvas {
    const struct photo_scene *s;
    double bx, by;
    float *light;  /* [height][width]: share that still passes */
    float *colour; /* [height][width][3] */
    struct sst_map_f32 *disp;
    struct sst_map_u8 *label;
};

/* Catmull-Rom weights of the four neighbours at fraction t. */
static void weights(double t, float w[4])
{
    const float f = (float)t;

    w[0] = 0.5F * f * (-1 + f * (2 - f));
    w[1] = 0.5F * (2 + f * f * (-5 + 3 * f));
    w[2] = 0.5F * f * (1 + f * (4 - 3 * f));
    w[3] = 0.5F * f * f * (f - 1);
}

typedef float quad __attribute__((vector_size(16)));
typedef uint8_t quad_u8 __attribute__((vector_size(4)));

static quad texel_at(const struct photo_sprite *p, int x, int y)
{
    quad_u8 t = { 0 };

    if (x >= 0 && y >= 0 && x < p->width && y < p->height)
        memcpy(&t, p->rgba + 4 * ((size_t)y * (size_t)p->width + (size_t)x), sizeof(t));
    return __builtin_convertvector(t, quad);
}

/* RGBA at texel position (u, v); beyond the sprite everything is transparent. */
static void sample(const struct photo_sprite *p, double u, double v, float out[4])
{
    const int iu = (int)floor(u), iv = (int)floor(v);
    float wu[4], wv[4];
    quad sum = { 0 };

    weights(u - iu, wu);
    weights(v - iv, wv);
    for (int j = 0; j < 4; j++) {
        quad row = { 0 };

        for (int i = 0; i < 4; i++)
            row += wu[i] * texel_at(p, iu - 1 + i, iv - 1 + j);
        sum += wv[j] * row;
    }
    for (int c = 3; c >= 0; c--)
        out[c] = sum[c] < 0 ? 0 : sum[c] > (c == 3 ? 255 : out[3]) ? (c == 3 ? 255 : out[3]) : sum[c];
}

/* Disparity at pixel (x, y) of a view: of the plane point X with X - d(X) b = x. */
static double disparity_at(const struct canvas *c, const struct photo_sprite *p, double x, double y)
{
    return (p->d0 + p->gx * x + p->gy * y) / (1 - p->gx * c->bx - p->gy * c->by);
}

/* Rows v .. v + 1 of a sprite are transparent at u <= spans[v + 1][0] and u >= spans[v + 1][1]. */
int photo_sprite_index(struct photo_sprite *p)
{
    p->spans = malloc((size_t)(p->height + 1) * sizeof(*p->spans));
    if (!p->spans)
        return -ENOMEM;
    for (int i = 0; i <= p->height; i++) {
        int lo = INT_MAX, hi = INT_MIN;

        for (int y = sst_max_int(i - 2, 0); y <= sst_min_int(i + 1, p->height - 1); y++) {
            const uint8_t *row = p->rgba + 4 * (size_t)y * (size_t)p->width;
            int x0 = 0, x1 = p->width - 1;

            while (x0 <= x1 && !row[4 * x0 + 3])
                x0++;
            while (x1 > x0 && !row[4 * x1 + 3])
                x1--;
            lo = x0 <= x1 ? sst_min_int(lo, x0) : lo;
            hi = x0 <= x1 ? sst_max_int(hi, x1) : hi;
        }
        p->spans[i][0] = lo > hi ? INT_MAX : lo - 2;
        p->spans[i][1] = lo > hi ? INT_MIN : hi + 2;
    }
    return 0;
}

static void draw_pixel(const struct canvas *c, const struct photo_sprite *p, int x, int y)
{
    const size_t at = (size_t)y * (size_t)c->s->width + (size_t)x;
    const double d = disparity_at(c, p, x, y), u = x + c->bx * d - p->x, v = y + c->by * d - p->y;
    const float before = c->light[at];
    const int *span;
    float rgba[4];

    if (before < CLEAR || v <= -1 || v >= p->height)
        return;
    span = p->spans[(int)(v + 1)];
    if (u <= span[0] || u >= span[1])
        return;
    sample(p, u, v, rgba);
    if (rgba[3] <= 0)
        return;
    for (int k = 0; k < 3; k++)
        c->colour[3 * at + (size_t)k] += before * rgba[k];
    c->light[at] = before * (1 - rgba[3] / 255);
    if (before > 0.5F && c->light[at] <= 0.5F) {
        if (c->disp)
            sst_map_f32_row(c->disp, y)[x] = (float)d;
        if (c->label)
            sst_map_u8_row(c->label, y)[x] = (uint8_t)p->label;
    }
}

/* Pixels that the sprite may cover: its corners in the view. */
static void draw(const struct canvas *c, const struct photo_sprite *p)
{
    double x0 = DBL_MAX, x1 = -DBL_MAX, y0 = DBL_MAX, y1 = -DBL_MAX;

    for (int i = 0; i < 4; i++) {
        const double x = p->x + (i & 1 ? p->width : -1), y = p->y + (i & 2 ? p->height : -1);
        const double d = p->d0 + p->gx * x + p->gy * y;

        x0 = fmin(x0, x - c->bx * d);
        x1 = fmax(x1, x - c->bx * d);
        y0 = fmin(y0, y - c->by * d);
        y1 = fmax(y1, y - c->by * d);
    }
    x0 = fmax(floor(x0), 0);
    y0 = fmax(floor(y0), 0);
    x1 = fmin(ceil(x1), c->s->width - 1);
    y1 = fmin(ceil(y1), c->s->height - 1);
    for (int y = (int)y0; y <= (int)y1; y++) {
        for (int x = (int)x0; x <= (int)x1; x++)
            draw_pixel(c, p, x, y);
    }
}

static void store(const struct canvas *c, struct sst_image *image)
{
    for (int y = 0; y < image->height; y++) {
        const float *from = c->colour + 3 * (size_t)y * (size_t)image->width;

        for (int k = 0; k < 3; k++) {
            uint8_t *row = sst_image_row(image, k, y);

            for (int x = 0; x < image->width; x++)
                row[x] = (uint8_t)fminf(from[3 * x + k] + 0.5F, 255);
        }
    }
}

static void store_mask(const struct canvas *c, struct sst_map_u8 *mask)
{
    for (int y = 0; y < mask->height; y++) {
        for (int x = 0; x < mask->width; x++)
            sst_map_u8_row(mask, y)[x] = c->light[(size_t)y * (size_t)mask->width + (size_t)x] < 0.5F ? 255 : 0;
    }
}

int photo_render(const struct photo_scene *s, const double b[2], bool hidden, const struct sst_scene_maps *out,
                 struct sst_map_u8 *mask)
{
    const size_t pixels = (size_t)s->width * (size_t)s->height;
    struct canvas c = { .s = s, .bx = b[0], .by = b[1], .disp = out->disp, .label = out->label };
    bool front = true;

    c.light = sst_mem_alloc_raw(pixels, sizeof(float));
    c.colour = sst_mem_alloc(pixels, 3 * sizeof(float));
    if (!c.light || !c.colour) {
        sst_mem_free(c.light);
        sst_mem_free(c.colour);
        return -ENOMEM;
    }
    for (size_t i = 0; i < pixels; i++)
        c.light[i] = 1;
    for (int i = 0; i < s->count; i++) {
        if (front && !s->sprites[i].front && mask)
            store_mask(&c, mask);
        front = front && s->sprites[i].front;
        if (!hidden || !s->sprites[i].front)
            draw(&c, &s->sprites[i]);
    }
    if (out->image)
        store(&c, out->image);
    sst_mem_free(c.light);
    sst_mem_free(c.colour);
    return 0;
}

/* Sum of four uniform numbers: nearly Gaussian, variance 1. */
static double gaussian(uint64_t *rng)
{
    const uint64_t r = sst_random_u64(rng);
    const double sum = (double)((r & 0xFFFF) + (r >> 16 & 0xFFFF) + (r >> 32 & 0xFFFF) + (r >> 48));

    return (sum / 65535 - 2) * sqrt(3);
}

void photo_expose(const struct photo_scene *s, struct sst_image *image, int view, bool reference)
{
    uint64_t rng = s->rng + 0x9E37u * ((uint64_t)view + 1);
    const double random = sst_random_in(&rng, -1, 1), gain = reference ? 1 : 1 + s->gain_percent / 100 * random;

    if (gain == 1 && s->noise <= 0)
        return;
    for (int c = 0; c < 3; c++) {
        for (int y = 0; y < image->height; y++) {
            uint8_t *row = sst_image_row(image, c, y);

            for (int x = 0; x < image->width; x++)
                row[x] = (uint8_t)sst_clamp_double(row[x] * gain + s->noise * gaussian(&rng) + 0.5, 0, 255);
        }
    }
}
