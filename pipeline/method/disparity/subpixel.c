/*
 * Refinement between pixels (design.md, 5.8). The first pass searches quarter pixels, and its answers gather around
 * them. Here the luma of the views around a pixel, whose differences are nearly linear in the disparity, gives each
 * pixel a disparity and a weight; windows of similar pixels share them along the slope of the surface. Windows that
 * carry little texture follow planes through larger ones, from which the slopes are.
 */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/mem.h"
#include "base/thread.h"
#include "pipeline/lightfield/share.h"
#include "pipeline/method/disparity/subpixel_internal.h"

#define LIMIT      10 /* levels: from this difference on, a view does not count */
#define TOLERANCE  20 /* 1/64 px: a surface that is nearer by more than this hides a point */
#define MARGIN     SST_SUBPIXEL_REACH
#define GAIN_STEP  8
#define GAIN_LIMIT 32   /* levels: pixels that differ by more are not the same surface */
#define GAIN_LEAST 64   /* pixels */
#define GAIN_MOST  1.25 /* gains are within 1 / this and this */

/* --- pictures ----------------------------------------------------------------------------------------------------- */

static uint32_t larger(uint16_t a, uint16_t b)
{
    return a > b ? a : b;
}

/* Row y of a view, one column more on both sides. */
static void pack_row(uint32_t *to, const uint8_t *luma, const uint16_t *disp, int width)
{
    for (int x = 0; x + 1 < width; x++)
        to[x] = luma[x] | (uint32_t)luma[x + 1] << 8 | larger(disp[x], disp[x + 1]) << 16;
    to[width - 1] = to[width] = luma[width - 1] * 257u | (uint32_t)disp[width - 1] << 16;
    to[-1] = to[0];
}

static int pack_luma(struct subpixel_packed *p, const struct sst_map_u8 *luma, const struct sst_map_u16 *disp)
{
    const int w = luma->width, h = luma->height;

    p->stride = w + 2;
    p->memory = sst_mem_alloc_raw((size_t)p->stride * (size_t)(h + 2), sizeof(*p->memory));
    if (!p->memory)
        return -ENOMEM;
    p->pixels = p->memory + p->stride + 1;
    for (int y = -1; y <= h; y++) {
        const int from = sst_clamp_int(y, 0, h - 1);

        pack_row(p->pixels + y * p->stride, sst_map_u8_row(luma, from), sst_map_u16_row(disp, from), w);
    }
    return 0;
}

static int pack_job(void *arg, int k, int worker SST_UNUSED)
{
    struct subpixel_pass *p = arg;
    const struct sst_visible_view *v = &p->in->view[k];
    struct sst_image half = { 0 };
    struct sst_map_u8 luma = { 0 };
    int err = 0;

    if (!v->image)
        return 0;
    if (p->in->scale == 2)
        err = sst_image_halve(&half, v->image);
    err = err ? err : sst_luma(&luma, p->in->scale == 2 ? &half : v->image);
    err = err ? err : pack_luma(&p->view[k], &luma, v->disp);
    sst_map_u8_fini(&luma);
    sst_image_fini(&half);
    return err;
}

/* --- views to compare with ---------------------------------------------------------------------------------------- */

/* Sums over pairs of levels, here and in another view. */
struct levels {
    const struct sst_subpixel_fit *fit;
    const struct sst_subpixel_view *view;
    double n, here, there, mixed, squared;
};

static void add_levels(struct levels *s, const struct sst_map_u16 *disp, int x, int y)
{
    const struct sst_subpixel_fit *f = s->fit;
    const struct sst_subpixel_view *v = s->view;
    const int d = sst_map_u16_row(disp, y)[x];
    const int here = f->own.pixels[y * f->own.stride + x] & 255;
    int there, xv, yv;

    if (d >= SST_SUBPIXEL_NONE)
        return;
    xv = x + ((v->x + d * v->dx + 32768) >> 16);
    yv = y + ((v->y + d * v->dy + 32768) >> 16);
    if (xv < 0 || yv < 0 || xv >= f->width || yv >= f->height)
        return;
    there = v->view.pixels[yv * v->view.stride + xv] & 255;
    if (abs(there - here) > GAIN_LIMIT)
        return;
    s->n += 1;
    s->here += here;
    s->there += there;
    s->mixed += here * there;
    s->squared += there * there;
}

/* Fit the gain and the offset between two views: least squares over a sample of their pixels. */
static void set_gain(struct sst_subpixel_view *v, const struct sst_subpixel_fit *f, const struct sst_map_u16 *disp,
                     int step)
{
    struct levels s = { .fit = f, .view = v };
    double variance, gain = 1;

    for (int y = 0; y < f->height; y += step) {
        for (int x = 0; x < f->width; x += step)
            add_levels(&s, disp, x, y);
    }
    v->gain = 1;
    v->offset = 0;
    if (s.n < GAIN_LEAST)
        return;
    variance = s.n * s.squared - s.there * s.there;
    if (variance > s.n * s.n) /* more than a level */
        gain = fmin(fmax((s.n * s.mixed - s.here * s.there) / variance, 1 / GAIN_MOST), GAIN_MOST);
    v->gain = (float)gain;
    v->offset = (float)((s.here - gain * s.there) / s.n);
}

void subpixel_set_fit(struct sst_subpixel_fit *f, const struct subpixel_pass *p, int k, int *nearest)
{
    const struct sst_visible_view *own = &p->in->view[k];

    *f = (struct sst_subpixel_fit){ .own = { p->view[k].pixels, p->view[k].stride },
                                    .views = sst_visible_nearest(p->in, k, p->views, nearest),
                                    .width = own->disp->width,
                                    .height = own->disp->height,
                                    .tolerance = TOLERANCE,
                                    .inverse_limit = 1.0f / LIMIT };
    for (int i = 0; i < f->views; i++) {
        const struct subpixel_packed *at = &p->view[nearest[i]];
        const double bx = p->in->view[nearest[i]].bx - own->bx, by = p->in->view[nearest[i]].by - own->by;

        f->view[i] = (struct sst_subpixel_view){ .view = { at->pixels, at->stride },
                                                 .x = visible_q16(-p->in->disp_min_px * bx),
                                                 .y = visible_q16(-p->in->disp_min_px * by),
                                                 .dx = visible_q16(-bx / 64),
                                                 .dy = visible_q16(-by / 64),
                                                 .bx = (float)bx,
                                                 .by = (float)by };
        set_gain(&f->view[i], f, own->disp, p->gain_step);
    }
}

/* --- one view ----------------------------------------------------------------------------------------------------- */

/* Planes with MARGIN pixels of weight 0 around; pointers to (0, 0). */
struct subpixel_planes {
    int width, height;
    ptrdiff_t stride;
    void *memory;
    uint32_t *colour;
    int32_t *first, *disp;   /* 1/64 px: the answer that is refined, the answer of this step */
    float *weight, *product; /* of the fit */
    float *shared, *kept;    /* the windows' disparity, px, and its weight */
    float *slope[2];         /* px per pixel to the right, down */
};

enum { PLANES = 9 };

static int planes_init(struct subpixel_planes *p, int width, int height)
{
    const size_t stride = sst_mem_stride((size_t)width + 2 * MARGIN, sizeof(float)) / sizeof(float);
    const size_t plane = stride * (size_t)(height + 2 * MARGIN), origin = MARGIN * stride + MARGIN;
    uint32_t *at;

    _Static_assert(sizeof(float) == sizeof(uint32_t), "planes of one size");
    *p = (struct subpixel_planes){ .width = width, .height = height, .stride = (ptrdiff_t)stride };
    p->memory = sst_mem_alloc(PLANES * plane, sizeof(float));
    if (!p->memory)
        return -ENOMEM;
    at = (uint32_t *)p->memory + origin;
    p->colour = at;
    p->first = (int32_t *)(at + plane);
    p->disp = (int32_t *)(at + 2 * plane);
    p->weight = (float *)p->memory + origin + 3 * plane;
    p->product = p->weight + plane;
    p->shared = p->weight + 2 * plane;
    p->kept = p->weight + 3 * plane;
    p->slope[0] = p->weight + 4 * plane;
    p->slope[1] = p->weight + 5 * plane;
    return 0;
}

static void load_row(struct subpixel_planes *p, const struct sst_image *img, const struct sst_map_u16 *disp, int y)
{
    const uint8_t *r = sst_image_row(img, 0, y), *g = sst_image_row(img, 1, y), *b = sst_image_row(img, 2, y);
    const uint16_t *d = sst_map_u16_row(disp, y);
    uint32_t *colour = p->colour + y * p->stride;
    int32_t *first = p->first + y * p->stride, *to = p->disp + y * p->stride;

    for (int x = 0; x < p->width; x++) {
        colour[x] = r[x] | (uint32_t)g[x] << 8 | (uint32_t)b[x] << 16;
        to[x] = first[x] = d[x] < SST_SUBPIXEL_NONE ? d[x] : SST_SUBPIXEL_NONE;
    }
    for (int i = 0; i < 2; i++)
        memset(p->slope[i] + y * p->stride, 0, (size_t)p->width * sizeof(float));
}

static int load(struct subpixel_planes *p, const struct subpixel_pass *pass, const struct sst_visible_view *v)
{
    struct sst_image half = { 0 };
    int err = p->memory ? 0 : planes_init(p, v->disp->width, v->disp->height);

    if (!err && pass->in->scale == 2)
        err = sst_image_halve(&half, v->image);
    for (int y = 0; !err && y < p->height; y++)
        load_row(p, pass->in->scale == 2 ? &half : v->image, v->disp, y);
    sst_image_fini(&half);
    return err;
}

/* 1/64 px. */
static int32_t near_first(float disp_px, int32_t first, int most)
{
    const int32_t d = (int32_t)(disp_px * 64 + 0.5f); /* below 0 it is clamped */

    return sst_clamp_int(d, sst_max_int(first - SUBPIXEL_MOST, 0), sst_min_int(first + SUBPIXEL_MOST, most));
}

/* Share the fits of row y in small windows. @param weight, product  rows of scratch */
static void share_row(struct subpixel_planes *p, int y, float *weight, float *product)
{
    const ptrdiff_t row = y * p->stride;
    const struct sst_subpixel_window w = { .colour = p->colour + row,
                                           .disp = p->disp + row,
                                           .weight = p->weight + row,
                                           .product = p->product + row,
                                           .slope = { p->slope[0] + row, p->slope[1] + row },
                                           .stride = p->stride,
                                           .similar = SUBPIXEL_SIMILAR,
                                           .apart = SUBPIXEL_APART / 64.0f };
    const int32_t *disp = p->disp + row;
    float *shared = p->shared + row, *kept = p->kept + row;

    sst_kernels_get()->subpixel_window_row(weight, product, &w, (size_t)p->width);
    for (int x = 0; x < p->width; x++) {
        shared[x] = (product[x] + SUBPIXEL_FEW * ((float)disp[x] * (1 / 64.0f))) / (weight[x] + SUBPIXEL_FEW);
        kept[x] = disp[x] < SST_SUBPIXEL_NONE
                      ? (weight[x] < SUBPIXEL_ENOUGH ? weight[x] : SUBPIXEL_ENOUGH) + SUBPIXEL_FEW
                      : 0;
    }
}

/* Let the small windows of row y follow the large ones by the weight that they lack. @param wide  row of scratch */
static void follow_row(struct subpixel_planes *p, int y, int range, float *wide)
{
    const ptrdiff_t row = y * p->stride;
    const struct sst_subpixel_planes w = { .colour = p->colour + row,
                                           .disp = p->shared + row,
                                           .weight = p->kept + row,
                                           .stride = p->stride,
                                           .similar = SUBPIXEL_SIMILAR,
                                           .apart = SUBPIXEL_WIDE_APART / 64.0f };
    const float *shared = p->shared + row, *kept = p->kept + row;
    const int32_t *first = p->first + row;
    int32_t *disp = p->disp + row;

    sst_kernels_get()->subpixel_plane_row(wide, (float *const[]){ p->slope[0] + row, p->slope[1] + row }, &w,
                                          (size_t)p->width);
    for (int x = 0; x < p->width; x++) {
        const float share = kept[x] < SUBPIXEL_ENOUGH ? 1 - kept[x] / SUBPIXEL_ENOUGH : 0;
        const float mixed = shared[x] + share * (wide[x] - shared[x]);

        disp[x] = disp[x] < SST_SUBPIXEL_NONE ? near_first(mixed, first[x], range * 64) : disp[x];
    }
}

/* One step: fit each pixel, share among windows, follow planes. @param rows  scratch, 2 */
static void step_all(struct subpixel_planes *p, const struct sst_subpixel_fit *f, int range, float *rows)
{
    for (int y = 0; y < p->height; y++) {
        const ptrdiff_t row = y * p->stride;

        sst_kernels_get()->subpixel_fit_row(p->weight + row, p->product + row, p->disp + row, f, y, (size_t)p->width);
    }
    for (int y = 0; y < p->height; y++)
        share_row(p, y, rows, rows + p->width);
    for (int y = 0; y < p->height; y++)
        follow_row(p, y, range, rows);
}

static void store(const struct subpixel_planes *p, struct sst_map_u16 *out)
{
    for (int y = 0; y < p->height; y++) {
        const int32_t *disp = p->disp + y * p->stride;
        uint16_t *to = sst_map_u16_row(out, y);

        for (int x = 0; x < p->width; x++)
            to[x] = (uint16_t)(disp[x] < SST_SUBPIXEL_NONE ? disp[x] : (int32_t)SST_DISP_NONE);
    }
}

static bool refines(const void *job, int k)
{
    const struct subpixel_pass *p = job;

    return p->in->view[k].image && !p->in->view[k].carried;
}

static int refine_job(void *arg, int k, int worker)
{
    struct subpixel_pass *p = arg;
    struct subpixel_planes *planes = &p->planes[worker];
    struct sst_subpixel_fit fit;
    float *rows = NULL;
    int nearest[SST_SUBPIXEL_VIEWS], err;

    if (p->in->cancel && *p->in->cancel)
        return -ECANCELED;
    sst_map_u16_fini(&p->out[k]);
    err = load(planes, p, &p->in->view[k]);
    err = err ? err : sst_map_u16_init(&p->out[k], planes->width, planes->height);
    if (!err) {
        rows = sst_mem_alloc_raw(2 * (size_t)planes->width, sizeof(*rows));
        err = rows ? 0 : -ENOMEM;
    }
    if (!err) {
        subpixel_set_fit(&fit, p, k, nearest);
        for (int i = 0; i < p->steps; i++) {
            fit.across = i + 1 < p->steps;
            step_all(planes, &fit, p->in->range, rows);
        }
        store(planes, &p->out[k]);
    }
    sst_mem_free(rows);
    return err;
}

static void refined_maps(void *arg, int k, struct sst_share_maps *out)
{
    struct subpixel_pass *p = arg;

    sst_share_add_u16(out, &p->out[k]);
}

static void refined_source(const void *job, int k, struct sst_plane_source *out)
{
    visible_source(((const struct subpixel_pass *)job)->in, k, out);
}

/* --- the step ----------------------------------------------------------------------------------------------------- */

static void pass_fini(struct subpixel_pass *p)
{
    for (int k = 0; k < p->in->count; k++) {
        if (p->out)
            sst_map_u16_fini(&p->out[k]);
        if (p->view)
            sst_mem_free(p->view[k].memory);
    }
    for (int i = 0; p->planes && i < p->threads; i++)
        sst_mem_free(p->planes[i].memory);
    free(p->planes);
    free(p->view);
    free(p->out);
}

/* @return 0, -ENOMEM; pass_fini() frees all, also after a failure */
static int pass_init(struct subpixel_pass *p)
{
    p->view = calloc((size_t)p->in->count, sizeof(*p->view));
    p->out = calloc((size_t)p->in->count, sizeof(*p->out));
    p->planes = calloc((size_t)p->threads, sizeof(*p->planes));
    return p->view && p->out && p->planes ? sst_parallel_for(p->in->count, p->threads, pack_job, p) : -ENOMEM;
}

static void refine_sample_free(void *job)
{
    struct subpixel_pass *p = job;

    if (!p)
        return;
    pass_fini(p);
    disparity_sample_free(p->sample);
    free(p);
}

static void *refine_sample(uint32_t seed)
{
    struct disparity_sample *s = disparity_sample(seed, false, !(seed % 2));
    struct subpixel_pass *p = s ? calloc(1, sizeof(*p)) : NULL;

    if (!p) {
        disparity_sample_free(s);
        return NULL;
    }
    *p = (struct subpixel_pass){
        .in = &s->in, .steps = 2, .views = seed % 2 ? 8 : 3, .gain_step = 2, .threads = 1, .sample = s
    };
    if (!pass_init(p))
        return p;
    refine_sample_free(p);
    return NULL;
}

const struct sst_step disparity_subpixel_step = { .name = "subpixel",
                                                  .stages = 1U << SST_DISPARITY_STAGE_SUBPIXEL,
                                                  .wants = refines,
                                                  .source = refined_source,
                                                  .cpu = refine_job,
                                                  .writes = refined_maps,
                                                  .changes = 1U << SST_PLANE_MAP,
                                                  .sample = refine_sample,
                                                  .sample_free = refine_sample_free };

int sst_disparity_subpixel(const struct sst_visible_views *in, int steps, int views, int threads)
{
    const struct sst_run_options how = { in->share, threads, 1, in->cancel };
    struct subpixel_pass p = { .in = in, .steps = steps, .views = views, .gain_step = GAIN_STEP, .threads = threads };
    int err = pass_init(&p);

    visible_adopt(in);
    err = err ? err : sst_run(in->runner, &disparity_subpixel_step, &p, in->count, &how);
    for (int k = 0; !err && k < in->count; k++) {
        if (p.out[k].data)
            memcpy(in->view[k].disp->data, p.out[k].data, p.out[k].stride * (size_t)p.out[k].height);
    }
    pass_fini(&p);
    return err;
}
