/* The references of the shaders verify_*. Their self-tests: verify_test.c. */
#include "pipeline/gpu/verify.h"

#include <stdlib.h>
#include <string.h>

#include "pipeline/gpu/gpu_internal.h"
#include "pipeline/kernels/kernels.h"
#include "pipeline/kernels/verify_ref.h"

#define NONE 0xFFFF
#define PART 64 /* positions between pixels at which colours are compared */

_Static_assert(sizeof(struct sst_gpu_verify_view) == 208 && sizeof(struct sst_gpu_verify_params) == 6144,
               "the layout of verify_*.comp");
_Static_assert(sizeof(struct sst_gpu_verify) <= 128, "Vulkan guarantees 128 bytes of push constants");

/* --- pixels left to votes ----------------------------------------------------------------------------------------- */

static uint32_t *cell_at(void *cells, const struct sst_gpu_verify *p, int x, int y)
{
    const int cols = (p->blend.width + SST_VERIFY_CELL_WIDTH - 1) / SST_VERIFY_CELL_WIDTH;

    return (uint32_t *)cells + (size_t)(y / SST_VERIFY_CELL_HEIGHT) * (size_t)cols + x / SST_VERIFY_CELL_WIDTH;
}

static bool covers(const struct sst_gpu_blend_view *v, int x, int y)
{
    return x >= v->x0 && x < v->x1 && y >= v->y0 && y < v->y1;
}

/* Index of pixel (x, y) of a view, modulo 2^32. */
static size_t pixel_at(const struct sst_gpu_verify *p, const struct sst_gpu_blend_view *v, int x, int y)
{
    return v->first + (uint32_t)y * (uint32_t)p->blend.pitch + (uint32_t)x;
}

/* Index of the pixel at which the ray of pixel (x, y) has its disparity. */
static size_t nearest_at(const struct sst_gpu_verify *p, const struct sst_gpu_blend_view *v, int x, int y)
{
    return pixel_at(p, v, x + v->nx, y + v->ny);
}

static void share_pixel(const struct sst_gpu_verify *p, void *const *buffer, size_t at, size_t plane, int x, int y)
{
    const struct sst_gpu_blend_view *view =
        (const void *)((const struct sst_gpu_verify_params *)buffer[SST_GPU_SHARE_PARAMS] + 1);
    const uint16_t *disp = buffer[SST_GPU_SHARE_DISP];
    const float assigned = ((const float *)buffer[SST_GPU_SHARE_SUMS])[at + 3 * plane];
    float *share = (float *)buffer[SST_GPU_SHARE_SHARE] + at;
    uint32_t *cell = cell_at(buffer[SST_GPU_SHARE_CELLS], p, x, y);
    float there = 0, front = 0;

    if (!(*cell & SST_GPU_CELL_WANTED) || !(assigned < SST_VERIFY_ENOUGH * p->all)) {
        *share = 0;
        return;
    }
    if (!(p->blend.flags & SST_GPU_BLEND_FIRST)) {
        there = share[plane];
        front = share[2 * plane];
    }
    for (uint32_t i = p->blend.first_view; i < p->blend.first_view + p->blend.views; i++) {
        if (!covers(&view[i], x, y))
            continue;
        there += view[i].aperture;
        front += (int)disp[nearest_at(p, &view[i], x, y)] > p->nearest ? view[i].aperture : 0;
    }
    if (!(p->blend.flags & SST_GPU_BLEND_LAST)) {
        share[plane] = there;
        share[2 * plane] = front;
        return;
    }
    *share = sst_verify_share(there, front, assigned);
    if (*share > 0)
        *cell |=
            SST_GPU_CELL_OPEN |
            (((const uint32_t *)buffer[SST_GPU_SHARE_OUT])[at] >> 24 & SST_GPU_PIXEL_BELOW ? SST_GPU_CELL_BELOW : 0U);
}

void verify_share_reference(const void *push, void *const *buffer, const uint32_t groups[3] SST_UNUSED)
{
    const struct sst_gpu_verify *p = push;
    const size_t plane = (size_t)p->blend.rows * (size_t)p->blend.width;

    for (size_t at = 0; at < plane; at++)
        share_pixel(p, buffer, at, plane, (int)(at % (size_t)p->blend.width),
                    p->blend.top + (int)(at / (size_t)p->blend.width));
}

/* --- what the maps explain ---------------------------------------------------------------------------------------- */

/* What the shaders that test it are given. */
struct given {
    const struct sst_gpu_verify *push;
    const struct sst_gpu_verify_view *view;
    const uint32_t *pixel;
    const uint16_t *disp;
    const uint8_t *valid;
    const float *disp_px;
};

static struct given given_by(const struct sst_gpu_verify *p, void *const *buffer)
{
    return (struct given){ p,
                           buffer[SST_GPU_SCREEN_VIEWS],
                           buffer[SST_GPU_SCREEN_PIXELS],
                           buffer[SST_GPU_SCREEN_DISP],
                           buffer[SST_GPU_SCREEN_VALID],
                           buffer[SST_GPU_SCREEN_DISP_PX] };
}

static int level_of(uint32_t pixel, int c)
{
    return (int)(pixel >> (8 * c) & 0xFF);
}

/* Difference of a colour from that of a view at (x, y), bilinear; -1: not seen there. */
static int difference(const struct given *in, const struct sst_gpu_blend_view *v, uint32_t own, float x, float y)
{
    const size_t pitch = (size_t)in->push->blend.pitch;
    int xp, yp, x0, y0, fx, fy, sum = 0;
    size_t at;

    if (!(x >= 0 && y >= 0 && x < (float)in->push->blend.width && y < (float)in->push->height))
        return -1;
    xp = (int)(x * PART + 0.5F);
    yp = (int)(y * PART + 0.5F);
    x0 = xp / PART;
    y0 = yp / PART;
    fx = xp % PART;
    fy = yp % PART;
    if (x0 + 1 >= in->push->blend.width || y0 + 1 >= in->push->height)
        return -1;
    at = pixel_at(in->push, v, x0, y0);
    if (v->flags & SST_GPU_VIEW_VALID && !in->valid[at + (size_t)(fy * 2 / PART) * pitch + (size_t)(fx * 2 / PART)])
        return -1;
    for (int c = 0; c < 3; c++) {
        const int a = level_of(in->pixel[at], c), b = level_of(in->pixel[at + pitch], c);
        const int upper = PART * a + fx * (level_of(in->pixel[at + 1], c) - a);
        const int lower = PART * b + fx * (level_of(in->pixel[at + pitch + 1], c) - b);

        sum += abs(PART * upper + fy * (lower - upper) - PART * PART * level_of(own, c));
    }
    return sum / (PART * PART);
}

/* True if fewer of the views around agree with pixel (x, y) of view v than do not, or none does. */
static bool contradicts(const struct given *in, const struct sst_gpu_verify_view *v, int x, int y, uint16_t disp)
{
    const uint32_t own = in->pixel[pixel_at(in->push, &v->at, x, y)];
    int agree = 0, differ = 0;

    for (uint32_t i = 0; i < v->around; i++) {
        const struct sst_gpu_verify_near *n = &v->near[i];
        const int by = difference(in, &in->view[n->view].at, own, (float)x + in->disp_px[disp] * n->bx,
                                  (float)y + in->disp_px[disp] * n->by);

        agree += by >= 0 && by < in->push->levels;
        differ += by >= in->push->levels;
    }
    return !agree || agree < differ;
}

/* Aperture of a view's ray at pixel (x, y) if it ends in front and is not explained; else 0. */
static float unexplained(const struct given *in, const struct sst_gpu_verify_view *v, int x, int y)
{
    const uint16_t disp = in->disp[nearest_at(in->push, &v->at, x, y)];
    const bool open =
        (int)disp > in->push->nearest && (disp == NONE || contradicts(in, v, x + v->at.nx, y + v->at.ny, disp));

    return open ? v->at.aperture : 0;
}

static bool contradicted(const struct given *in, int x, int y)
{
    float sum = 0;

    for (uint32_t i = 0; i < in->push->count; i++)
        sum += covers(&in->view[i].at, x, y) ? unexplained(in, &in->view[i], x, y) : 0;
    return sum > SST_VERIFY_UNEXPLAINED_LOW * in->push->all;
}

static void screen_cell(const struct given *in, void *const *buffer, int x0, int y0)
{
    const struct sst_gpu_blend *b = &in->push->blend;
    const int x1 = sst_min_int(x0 + SST_VERIFY_CELL_WIDTH, b->width);
    const int y1 = sst_min_int(y0 + SST_VERIFY_CELL_HEIGHT, in->push->to);
    uint32_t *cell = cell_at(buffer[SST_GPU_SCREEN_CELLS], in->push, x0, y0);
    float *share = (float *)buffer[SST_GPU_SCREEN_SHARE];
    int left = 0, found = 0;

    if (!(*cell & SST_GPU_CELL_OPEN))
        return;
    for (int y = y0 + SST_VERIFY_SCREEN_STEP / 2; y < y1; y += SST_VERIFY_SCREEN_STEP) {
        for (int x = x0 + SST_VERIFY_SCREEN_STEP / 2; x < x1; x += SST_VERIFY_SCREEN_STEP) {
            if (share[(y - b->top) * b->width + x] > 0) {
                found += contradicted(in, x, y);
                left++;
            }
        }
    }
    if (SST_VERIFY_SCREEN_SHARE * found > left)
        return;
    for (int y = y0; y < y1; y++)
        memset(share + (y - b->top) * b->width + x0, 0, (size_t)(x1 - x0) * sizeof(*share));
    *cell &= ~(uint32_t)SST_GPU_CELL_OPEN;
}

void verify_screen_reference(const void *push, void *const *buffer, const uint32_t groups[3] SST_UNUSED)
{
    const struct sst_gpu_verify *p = push;
    const struct given in = given_by(p, buffer);

    for (int y = p->from; y < p->to; y += SST_VERIFY_CELL_HEIGHT) {
        for (int x = 0; x < p->blend.width; x += SST_VERIFY_CELL_WIDTH)
            screen_cell(&in, buffer, x, y);
    }
}

/* --- pixels around those left to votes ---------------------------------------------------------------------------- */

static int rays_top(const struct sst_gpu_verify *p)
{
    return sst_max_int(p->from - 1, 0);
}

/* Work on pixel (x, y), `at` its index among those whose rays are held. */
typedef void pixel_fn(const struct sst_gpu_verify *p, void *const *buffer, uint32_t at, int x, int y);

/* True if a pixel around (x, y) is left to votes. */
static bool needed(const struct sst_gpu_verify *p, const float *share, int x, int y)
{
    for (int j = sst_max_int(y - 1, p->from); j <= sst_min_int(y + 1, p->to - 1); j++) {
        for (int i = sst_max_int(x - 1, 0); i <= sst_min_int(x + 1, p->blend.width - 1); i++) {
            if (share[(j - p->blend.top) * p->blend.width + i] > 0)
                return true;
        }
    }
    return false;
}

static void for_needed(const struct sst_gpu_verify *p, void *const *buffer, int share, pixel_fn *pixel)
{
    for (uint32_t at = 0; at < p->rays; at++) {
        const int x = (int)at % p->blend.width, y = rays_top(p) + (int)at / p->blend.width;

        if (needed(p, buffer[share], x, y))
            pixel(p, buffer, at, x, y);
    }
}

static bool all_valid(const uint8_t *valid, const struct sst_gpu_blend_view *v, size_t at, size_t pitch)
{
    const size_t right = (v->flags & SST_GPU_VIEW_RIGHT) != 0, below = v->flags & SST_GPU_VIEW_BELOW ? pitch : 0;

    return !(v->flags & SST_GPU_VIEW_VALID) ||
           (valid[at] && valid[at + right] && valid[at + below] && valid[at + right + below]);
}

/* Index of the first pixel that the colour of a ray is from. */
static size_t colour_at(const struct sst_gpu_verify *p, const struct sst_gpu_blend_view *v, int x, int y)
{
    return pixel_at(p, v, x + v->ix, y + v->iy);
}

static void sum_unexplained(const struct sst_gpu_verify *p, void *const *buffer, uint32_t at, int x, int y)
{
    const struct given in = given_by(p, buffer);
    float sum = 0;

    for (uint32_t i = 0; i < p->count; i++) {
        const struct sst_gpu_blend_view *v = &in.view[i].at;

        if (covers(v, x, y) && all_valid(in.valid, v, colour_at(p, v, x, y), (size_t)p->blend.pitch))
            sum += unexplained(&in, &in.view[i], x, y);
    }
    ((float *)buffer[SST_GPU_UNEXPLAINED_TOTALS])[p->rays + at] = sum;
}

void verify_unexplained_reference(const void *push, void *const *buffer, const uint32_t groups[3] SST_UNUSED)
{
    for_needed(push, buffer, SST_GPU_SCREEN_SHARE, sum_unexplained);
}

/* --- rays --------------------------------------------------------------------------------------------------------- */

/* Colours of the four pixels around a ray, as the kernels read them. */
static void set_colours(struct sst_blend *b, uint8_t colour[2][3][2], const uint32_t *pixel,
                        const struct sst_gpu_blend_view *v, size_t at, size_t pitch)
{
    const size_t right = (v->flags & SST_GPU_VIEW_RIGHT) != 0, below = v->flags & SST_GPU_VIEW_BELOW ? pitch : 0;

    for (int c = 0; c < 3; c++) {
        for (size_t i = 0; i < 2; i++) {
            colour[0][c][i] = (uint8_t)(pixel[at + (i ? right : 0)] >> (8 * c));
            colour[1][c][i] = (uint8_t)(pixel[at + (i ? right : 0) + below] >> (8 * c));
        }
        b->top[c] = colour[0][c];
        b->bottom[c] = colour[1][c];
    }
    for (int i = 0; i < 4; i++)
        b->tap[i] = (int16_t)v->tap[i];
}

/* Colour and weight of a view's ray. */
static float take(uint8_t rgb[3], const struct sst_gpu_verify *p, void *const *buffer,
                  const struct sst_gpu_blend_view *v, int x, int y)
{
    const struct sst_gpu_verify_params *params = buffer[SST_GPU_RAYS_PARAMS];
    const uint32_t *pixel = buffer[SST_GPU_RAYS_PIXELS];
    const size_t at = nearest_at(p, v, x, y);
    const uint8_t label = (uint8_t)(pixel[at] >> 24);
    struct sst_blend_range range[256] = { { 0 } };
    struct sst_blend b = { .aperture = v->aperture,
                           .c1 = p->blend.c1,
                           .focus_whole_q6 = p->blend.focus_whole_q6,
                           .focus_part_q6 = p->blend.focus_part_q6,
                           .scale = p->blend.scale,
                           .first = (uint16_t)p->blend.first,
                           .count = (uint16_t)p->blend.count,
                           .disp = (const uint16_t *)buffer[SST_GPU_RAYS_DISP] + at,
                           .label = v->flags & SST_GPU_VIEW_LABELS && p->blend.flags & SST_GPU_BLEND_BY_LABEL ? &label
                                                                                                              : NULL,
                           .range = range };
    uint8_t colour[2][3][2];
    float weight;

    range[label].weight =
        (const float *)buffer[SST_GPU_RAYS_TABLE] + (size_t)params->label[label].row * SST_BLEND_COLUMNS;
    memcpy(b.power, p->blend.power, sizeof(b.power));
    set_colours(&b, colour, pixel, v, colour_at(p, v, x, y), (size_t)p->blend.pitch);
    sst_blend_take_ref((uint8_t *const[3]){ rgb, rgb + 1, rgb + 2 }, &weight, &b, 1);
    return weight;
}

static void set_rays(const struct sst_gpu_verify *p, void *const *buffer, uint32_t at, int x, int y)
{
    const struct sst_gpu_verify_params *params = buffer[SST_GPU_RAYS_PARAMS];
    const struct sst_gpu_blend_view *view = (const void *)(params + 1);

    for (uint32_t i = p->blend.first_view; i < p->blend.first_view + p->blend.views; i++) {
        const struct sst_gpu_blend_view *v = &view[i];
        struct sst_voting voting = { params->rarity, SST_VERIFY_DOUBT * v->aperture, p->scale, p->most };
        uint32_t *to = (uint32_t *)buffer[SST_GPU_RAYS_RAYS] + v->index * p->rays + at;
        uint8_t rgb[3], votes;
        float weight;

        *to = 0;
        if (!covers(v, x, y) ||
            !all_valid(buffer[SST_GPU_RAYS_VALID], v, colour_at(p, v, x, y), (size_t)p->blend.pitch))
            continue;
        weight = take(rgb, p, buffer, v, x, y);
        if (v->flags & SST_GPU_VIEW_CONFIDENCE) {
            const uint8_t *confidence = buffer[SST_GPU_RAYS_CONFIDENCE];

            weight = sst_verify_doubt(weight, v->aperture, confidence[nearest_at(p, v, x, y)]);
            voting.doubt = 0;
        }
        sst_agree_votes_ref(&votes, (const uint8_t *const[3]){ rgb, rgb + 1, rgb + 2 }, &weight, &voting, 1);
        *to = rgb[0] | (uint32_t)rgb[1] << 8 | (uint32_t)rgb[2] << 16 | (uint32_t)votes << 24;
    }
}

void verify_rays_reference(const void *push, void *const *buffer, const uint32_t groups[3] SST_UNUSED)
{
    for_needed(push, buffer, SST_GPU_RAYS_SHARE, set_rays);
}

/* --- votes -------------------------------------------------------------------------------------------------------- */

/* Colours and votes of a pixel's rays, as the kernels read them. */
struct rays {
    uint8_t colour[SST_GPU_VERIFY_VIEWS][3], vote[SST_GPU_VERIFY_VIEWS];
};

static void read_rays(struct rays *r, const struct sst_gpu_verify *p, const uint32_t *ray, uint32_t at)
{
    for (uint32_t k = 0; k < p->count; k++) {
        for (int c = 0; c < 3; c++)
            r->colour[k][c] = (uint8_t)(ray[k * p->rays + at] >> (8 * c));
        r->vote[k] = (uint8_t)(ray[k * p->rays + at] >> 24);
    }
}

static void find_mode(const struct sst_gpu_verify *p, void *const *buffer, uint32_t at, int x SST_UNUSED,
                      int y SST_UNUSED)
{
    uint32_t *near = buffer[SST_GPU_MODE_NEAR];
    uint8_t mode[3], *const modes[3] = { mode, mode + 1, mode + 2 };
    const uint8_t *const is[3] = { mode, mode + 1, mode + 2 };
    struct rays r;
    float total = 0;

    read_rays(&r, p, buffer[SST_GPU_MODE_RAYS], at);
    sst_agree_mode_ref(modes, r.colour[0], r.vote, p->count, SST_VERIFY_CANDIDATES, 1);
    for (uint32_t k = 0; k < p->count; k++) {
        uint32_t *to = near + k / 2 * p->rays + at;
        uint16_t by;

        sst_agree_near_ref(&by, (const uint8_t *const[3]){ r.colour[k], r.colour[k] + 1, r.colour[k] + 2 }, is,
                           &r.vote[k], 1);
        *to = k % 2 ? *to | (uint32_t)by << 16 : by;
        total += r.vote[k];
    }
    ((float *)buffer[SST_GPU_MODE_TOTALS])[at] = total;
}

void verify_mode_reference(const void *push, void *const *buffer, const uint32_t groups[3] SST_UNUSED)
{
    for_needed(push, buffer, SST_GPU_MODE_SHARE, find_mode);
}

/* The values of `plane` around pixel (x, y); 0 outside the picture. */
static float sum_around(const struct sst_gpu_verify *p, const float *plane, int x, int y)
{
    float v[3][3] = { { 0 } };

    for (int j = sst_max_int(y - 1, 0); j <= sst_min_int(y + 1, p->height - 1); j++) {
        for (int i = sst_max_int(x - 1, 0); i <= sst_min_int(x + 1, p->blend.width - 1); i++)
            v[j - y + 1][i - x + 1] = plane[(j - rays_top(p)) * p->blend.width + i];
    }
    return sst_verify_sum3(v[0], v[1], v[2]);
}

/* Weights of a view's rays around pixel (x, y). */
static void near_around(uint16_t v[3][3], const struct sst_gpu_verify *p, const uint32_t *near, uint32_t k, int x,
                        int y)
{
    memset(v, 0, 9 * sizeof(v[0][0]));
    for (int j = sst_max_int(y - 1, 0); j <= sst_min_int(y + 1, p->height - 1); j++) {
        for (int i = sst_max_int(x - 1, 0); i <= sst_min_int(x + 1, p->blend.width - 1); i++)
            v[j - y + 1][i - x + 1] =
                (uint16_t)(near[k / 2 * p->rays + (uint32_t)((j - rays_top(p)) * p->blend.width + i)] >> (k % 2 * 16));
    }
}

static void mix_pixel(const struct sst_gpu_verify *p, void *const *buffer, float share, int x, int y)
{
    const uint32_t at = (uint32_t)((y - rays_top(p)) * p->blend.width + x);
    const float *totals = buffer[SST_GPU_MIX_TOTALS];
    uint32_t *out = (uint32_t *)buffer[SST_GPU_MIX_OUT] + (y - p->blend.top) * p->blend.width + x, mixed;
    float sum[4] = { 0 }, *const acc[4] = { sum, sum + 1, sum + 2, sum + 3 }, by;
    struct rays r;

    read_rays(&r, p, buffer[SST_GPU_MIX_RAYS], at);
    for (uint32_t k = 0; k < p->count; k++) {
        uint16_t near[3][3];

        near_around(near, p, buffer[SST_GPU_MIX_NEAR], k, x, y);
        sst_agree_sum_ref(acc, (const uint16_t *const[3]){ near[0], near[1], near[2] },
                          (const uint8_t *const[3]){ r.colour[k], r.colour[k] + 1, r.colour[k] + 2 }, &r.vote[k], 1);
    }
    if (!(sum[3] > 0))
        return;
    by = share * sst_verify_ramp(sum[3] / (SST_AGREE_NEAR * sum_around(p, totals, x, y)), SST_VERIFY_AGREE_LOW,
                                 SST_VERIFY_AGREE_HIGH);
    if (p->explained)
        by *= sst_verify_ramp(sum_around(p, totals + p->rays, x, y) / (9 * p->all), SST_VERIFY_UNEXPLAINED_LOW,
                              SST_VERIFY_UNEXPLAINED_HIGH);
    mixed = *out & 0xFF000000U;
    for (int c = 0; c < 3; c++)
        mixed |= (uint32_t)sst_verify_mix(by, sum[c], sum[3], (uint8_t)(*out >> (8 * c))) << (8 * c);
    *out = mixed;
}

void verify_blend_reference(const void *push, void *const *buffer, const uint32_t groups[3] SST_UNUSED)
{
    const struct sst_gpu_verify *p = push;
    const float *share = buffer[SST_GPU_MIX_SHARE];

    for (int y = p->from; y < p->to; y++) {
        for (int x = 0; x < p->blend.width; x++) {
            const float left = share[(y - p->blend.top) * p->blend.width + x];

            if (left > 0)
                mix_pixel(p, buffer, left, x, y);
        }
    }
}
