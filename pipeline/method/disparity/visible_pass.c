/* The state of the second pass: pictures with depth codes, tests of a view, samples. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/method/disparity/visible_internal.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>

#include "base/mem.h"
#include "base/thread.h"

#define MARGIN         2  /* columns and rows around a packed view */
#define SIMILAR        24 /* levels: pixels of a window that count; in noise ... */
#define SIMILAR_MOST   40
#define SIMILAR_GAIN   3   /* ... as many more for a level of it */
#define NOISE          4.5 /* ... beyond this, which texture feigns */
#define LEVELS_RANGE   24  /* the range's share that makes a step: surfaces that are nearer to each other are one */
#define STEP_LEAST     8   /* 1/64 px */
#define STEP_MOST      96  /* 1/64 px: a pixel and a half, what checks and noise of the first pass leave */
#define P1             30  /* penalties, in the units of SST_HYPOTHESIS_LIMIT */
#define P2             300
#define EDGE_STEP      16 /* levels at which P2 is halved */
#define SWEPT          4  /* one in this many views looks for surfaces that no map has */
#define NEAREST_CODE   254
#define DISPLACED_MOST 32000 /* px */

/* --- pictures ----------------------------------------------------------------------------------------------------- */

static int pack_colours(struct visible_packed *p, const struct sst_image *img)
{
    const ptrdiff_t stride = img->width + 2 * MARGIN;

    p->memory = sst_mem_alloc_raw((size_t)stride * (size_t)(img->height + 2 * MARGIN), sizeof(*p->memory));
    if (!p->memory)
        return -ENOMEM;
    p->stride = stride;
    p->similar = sst_min_int(SIMILAR + (int)(SIMILAR_GAIN * fmax(sst_image_noise(img) - NOISE, 0)), SIMILAR_MOST);
    p->pixels = p->memory + MARGIN * stride + MARGIN;
    for (int y = -MARGIN; y < img->height + MARGIN; y++) {
        const int from = sst_clamp_int(y, 0, img->height - 1);
        const uint8_t *r = sst_image_row(img, 0, from), *g = sst_image_row(img, 1, from);
        const uint8_t *b = sst_image_row(img, 2, from);
        uint32_t *to = p->pixels + y * stride;

        for (int x = 0; x < img->width; x++)
            to[x] = r[x] | (uint32_t)g[x] << 8 | (uint32_t)b[x] << 16;
        for (int x = 1; x <= MARGIN; x++) {
            to[-x] = to[0];
            to[img->width - 1 + x] = to[img->width - 1];
        }
    }
    return 0;
}

static int pack_job(void *arg, int k, int worker SST_UNUSED)
{
    struct visible_pass *p = arg;
    const struct sst_visible_view *v = &p->in->view[k];
    struct sst_image half = { 0 };
    int err;

    if (!v->image)
        return 0;
    if (p->in->scale == 1)
        return pack_colours(&p->view[k], v->image);
    err = sst_image_halve(&half, v->image);
    err = err ? err : pack_colours(&p->view[k], &half);
    sst_image_fini(&half);
    return err;
}

/* The codes of a view's map. */
static int code_job(void *arg, int k, int worker SST_UNUSED)
{
    struct visible_pass *p = arg;
    const struct sst_visible_view *v = &p->in->view[k];

    for (int y = 0; v->image && y < v->disp->height; y++) {
        const uint16_t *d = sst_map_u16_row(v->disp, y);
        const uint8_t *seen = v->seen && v->seen->data ? sst_map_u8_row(v->seen, y) : NULL;
        uint32_t *to = p->view[k].pixels + y * p->view[k].stride;

        for (int x = 0; x < v->disp->width; x++) {
            const uint32_t code = seen && !seen[x] ? SST_DEPTH_OUTSIDE : p->code[d[x]];

            to[x] = (to[x] & 0xFFFFFF) | code << 24;
        }
    }
    return 0;
}

int visible_pass_code(struct visible_pass *p)
{
    return sst_parallel_for(p->in->count, p->threads, code_job, p);
}

unsigned visible_most(const struct sst_visible_views *in)
{
    return (unsigned)in->range * 64 + 1;
}

static void set_codes(struct visible_pass *p)
{
    const unsigned most = visible_most(p->in);

    for (unsigned d = 0; d < SST_DISP_NONE; d++)
        p->code[d] = (uint8_t)(1 + (d < most ? d : most) * (NEAREST_CODE - 1) / most);
    p->code[SST_DISP_NONE] = 0;
}

/* --- views to test against ---------------------------------------------------------------------------------------- */

int sst_visible_nearest(const struct sst_visible_views *in, int k, int most, int *nearest)
{
    const struct sst_visible_view *own = &in->view[k];
    const double reach = fabs(in->disp_min_px) + SST_DISP_NONE / SST_DISP_SCALE;
    double distance[SST_HYPOTHESIS_VIEWS];
    int n = 0;

    for (int i = 0; i < in->count; i++) {
        const struct sst_visible_view *v = &in->view[i];
        const double far = hypot(v->bx - own->bx, v->by - own->by);
        int at;

        if (i == k || !v->image || far * reach > DISPLACED_MOST || (n == most && far >= distance[n - 1]))
            continue;
        n += n < most;
        for (at = n - 1; at > 0 && distance[at - 1] > far; at--) {
            distance[at] = distance[at - 1];
            nearest[at] = nearest[at - 1];
        }
        distance[at] = far;
        nearest[at] = i;
    }
    return n;
}

enum sst_step_plane visible_colours(const struct sst_visible_views *in)
{
    return in->scale == 1 ? SST_PLANE_COLOUR : SST_PLANE_REDUCED;
}

void visible_source(const struct sst_visible_views *in, int k, struct sst_plane_source *out)
{
    const struct sst_visible_view *v = &in->view[k];

    *out = (struct sst_plane_source){
        .image = v->image, .seen = v->seen, .disp = v->disp, .confidence = v->confidence, .agreed = v->agreed
    };
}

int sst_visible_block(const struct sst_visible_views *in)
{
    size_t pixels = 0;

    for (int k = 0; k < in->count && !pixels; k++)
        pixels = in->view[k].image ? (size_t)in->view[k].disp->width * (size_t)in->view[k].disp->height : 0;
    return sst_share_block(pixels);
}

void visible_set_test(struct sst_hypothesis_test *t, const struct visible_pass *p, int k, int views, int *nearest)
{
    const struct sst_visible_view *own = &p->in->view[k];

    *t = (struct sst_hypothesis_test){ .own = { p->view[k].pixels, p->view[k].stride },
                                       .views = sst_visible_nearest(p->in, k, views, nearest),
                                       .width = own->disp->width,
                                       .height = own->disp->height,
                                       .code = p->code,
                                       .tolerance = p->sweeps.plan.step,
                                       .similar = p->view[k].similar,
                                       .settled = p->in->skip_hypotheses ? VISIBLE_CHEAP : VISIBLE_CHANGE + 1 };
    for (int i = 0; i < t->views; i++) {
        const struct visible_packed *at = &p->view[nearest[i]];
        const double bx = p->in->view[nearest[i]].bx - own->bx, by = p->in->view[nearest[i]].by - own->by;

        t->view[i] = (struct sst_packed_view){ at->pixels, at->stride };
        t->x[i] = visible_q16(0.5 - p->in->disp_min_px * bx);
        t->y[i] = visible_q16(0.5 - p->in->disp_min_px * by);
        t->dx[i] = visible_q16(-bx / 64);
        t->dy[i] = visible_q16(-by / 64);
    }
}

void visible_pass_source(const void *pass, int k, struct sst_plane_source *out)
{
    visible_source(((const struct visible_pass *)pass)->in, k, out);
}

/* --- the pass ----------------------------------------------------------------------------------------------------- */

static void set_penalties(struct visible_pass *p)
{
    p->penalty.near = (uint16_t)sst_max_int(p->sweeps.plan.step / 2, 1);
    for (int colour = 0; colour < 256; colour++) {
        p->penalty.p1[colour] = P1;
        p->penalty.p2[colour] = (uint16_t)sst_max_int(P2 * EDGE_STEP / (EDGE_STEP + colour), P1);
    }
}

/* All views are of one size. */
static void set_plan(struct visible_pass *p)
{
    const int step = sst_clamp_int(p->in->range * 64 / LEVELS_RANGE, STEP_LEAST, STEP_MOST);

    for (int k = 0; k < p->in->count; k++) {
        const struct sst_visible_view *v = &p->in->view[k];

        if (v->image)
            sst_sweep_plan_init(&p->sweeps.plan, v->disp->width, v->disp->height, p->in->range * 64, step);
    }
}

/* One view in SWEPT looks for points. */
static void set_sweeps(struct visible_pass *p)
{
    for (int k = 0; k < p->in->count; k++) {
        const struct sst_visible_view *v = &p->in->view[k];

        if (p->in->swept || !v->image || (lround(v->bx) + 2 * lround(v->by)) % SWEPT)
            continue;
        p->sweeps.sweep[p->sweeps.count].bx = v->bx;
        p->sweeps.sweep[p->sweeps.count].by = v->by;
        p->swept[p->sweeps.count++] = k;
    }
}

int visible_pass_init(struct visible_pass *p)
{
    const size_t count = (size_t)p->in->count;
    int err;

    p->view = calloc(count, sizeof(*p->view));
    p->out = calloc(count, sizeof(*p->out));
    p->confidence = calloc(count, sizeof(*p->confidence));
    p->scratch = calloc((size_t)p->threads + 1, sizeof(*p->scratch));
    p->counted = calloc(count, sizeof(*p->counted));
    p->sweeps.sweep = calloc(count, sizeof(*p->sweeps.sweep));
    p->swept = calloc(count, sizeof(*p->swept));
    p->code = sst_mem_alloc_raw(65536, 1);
    if (!p->view || !p->out || !p->confidence || !p->scratch || !p->counted || !p->sweeps.sweep || !p->swept ||
        !p->code)
        return -ENOMEM;
    set_codes(p);
    set_plan(p);
    set_penalties(p);
    set_sweeps(p);
    err = sst_parallel_for(p->in->count, p->threads, pack_job, p);
    return err ? err : visible_pass_code(p);
}

void visible_pass_fini(struct visible_pass *p)
{
    for (int k = 0; k < p->in->count; k++) {
        if (p->view)
            sst_mem_free(p->view[k].memory);
        if (p->out)
            sst_map_u16_fini(&p->out[k]);
        if (p->confidence)
            sst_map_u8_fini(&p->confidence[k]);
    }
    for (int i = 0; i < p->sweeps.count; i++)
        sst_sweep_fini(&p->sweeps.sweep[i]);
    for (int i = 0; p->scratch && i <= p->threads; i++) {
        hypothesis_lists_fini(&p->scratch[i].lists);
        sst_around_fini(&p->scratch[i].around);
    }
    free(p->scratch);
    free(p->counted);
    free(p->sweeps.sweep);
    free(p->swept);
    sst_mem_free(p->code);
    free(p->view);
    free(p->out);
    free(p->confidence);
}

void visible_sample_free(void *pass)
{
    struct visible_pass *p = pass;

    if (!p)
        return;
    visible_pass_fini(p);
    disparity_sample_free(p->sample);
    free(p);
}

/* Pixels at which the sources of a carried view agree. */
static int set_agreed(struct sst_map_u8 *agreed, const struct sst_map_u16 *size)
{
    const int err = sst_map_u8_init(agreed, size->width, size->height);

    for (int y = 0; !err && y < size->height; y++) {
        for (int x = 0; x < size->width; x++)
            sst_map_u8_row(agreed, y)[x] = (x * x + 13 * y) % 5 ? 0 : 255;
    }
    return err;
}

/* A surface in which large windows hold no step. */
static void flatten(struct sst_map_u16 *disp)
{
    for (int y = 0; y < disp->height; y++) {
        for (int x = disp->width / 2; x < disp->width; x++)
            sst_map_u16_row(disp, y)[x] = 460;
    }
}

struct visible_pass *visible_sample(uint32_t seed)
{
    const bool repair = seed % 2;
    struct disparity_sample *s = disparity_sample(seed, false, repair);
    struct visible_pass *p = s ? calloc(1, sizeof(*p)) : NULL;
    int err = 0;

    if (!p) {
        disparity_sample_free(s);
        return NULL;
    }
    s->in.repair = s->in.skip_hypotheses = repair;
    s->in.report = repair ? &s->report : NULL;
    *p = (struct visible_pass){ .in = &s->in, .threads = 1, .sample = s };
    for (int k = 0; !err && k < s->in.count; k++) {
        if (!repair)
            flatten(&s->disp[k]);
        else if (s->view[k].image)
            err = set_agreed(&s->agreed[k], &s->disp[k]);
    }
    err = err ? err : visible_pass_init(p);
    p->sweeps.plan.gathered = 2000; /* candidates of few points */
    if (!err)
        return p;
    visible_sample_free(p);
    return NULL;
}
