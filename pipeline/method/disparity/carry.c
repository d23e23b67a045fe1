/*
 * Maps of the matched views carried to the others (design.md, 5.7): a pixel goes to where its disparity puts it in the
 * other view, and the nearest surface wins there.
 */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/mem.h"
#include "pipeline/kernels/kernels.h"
#include "pipeline/lightfield/shift.h"
#include "pipeline/method/disparity/disparity_internal.h"

#define AGREED  3  /* sources that must agree */
#define STEP_Q6 64 /* neighbours with a larger difference are on two surfaces */

/* What arrives at a pixel, the larger the better: disparity + 1 (0: nothing yet), the check's result, half of the
 * confidence. */
#define DISP_SHIFT SST_LANDED_DISP
#define CONFIRMED  128u
#define AGREES     (1u << 24) /* of find_agreed() */

static int disp_of(uint32_t arrived)
{
    return (int)(arrived >> DISP_SHIFT) - 1;
}

static uint8_t confidence_of(uint32_t arrived)
{
    return (uint8_t)(arrived << 1);
}

/* Views that are too far away to count in the second pass are too far here: their numbers would not fit. */
int run_carry_sources(const struct sst_visible_views *in, int k, int source[CARRY_SOURCES])
{
    struct sst_visible_views matched = *in;
    struct sst_visible_view *view = calloc((size_t)in->count, sizeof(*view));
    int n;

    if (!view)
        return -ENOMEM;
    matched.view = view;
    for (int i = 0; i < in->count; i++) {
        view[i] = in->view[i];
        if (view[i].carried)
            view[i].image = NULL;
    }
    n = sst_visible_nearest(&matched, k, CARRY_SOURCES, source);
    free(view);
    return n;
}

/* Pixels of a view at which others arrive, [height][width]; see land_row. */
struct arrivals {
    uint32_t *arrived, *farthest; /* farthest: NULL: not wanted */
    uint8_t *rank;                /* scratch, a row */
};

/* One source's part of a view. */
static void carry_view(const struct arrivals *to, const struct carry *c, const struct sst_visible_view *own, int source,
                       uint32_t bit)
{
    const struct sst_visible_view *from = &c->in->view[source];
    const int width = from->disp->width;
    struct sst_landing l = { .width = own->disp->width, .height = own->disp->height, .source = bit };

    sst_shift_parts(sst_shift_by(from->bx - own->bx, c->in->disp_min_px), &l.whole[0], &l.part[0], &l.step[0]);
    sst_shift_parts(sst_shift_by(from->by - own->by, c->in->disp_min_px), &l.whole[1], &l.part[1], &l.step[1]);
    for (l.y = 0; l.y < from->disp->height; l.y++) {
        const uint8_t *confidence = sst_map_u8_row(from->confidence, l.y);
        const uint8_t *status = c->status ? sst_map_u8_row(&c->status[source], l.y) : NULL;

        for (int x = 0; x < width; x++)
            to->rank[x] =
                (uint8_t)(confidence[x] >> 1 | (status && status[x] == SST_DISPARITY_CORRECT ? CONFIRMED : 0));
        sst_kernels_get()->land_row(to->arrived, to->farthest, &l, sst_map_u16_row(from->disp, l.y), to->rank,
                                    (size_t)width);
    }
}

/* A gap of a pixel between pixels a and b of one nearer surface: slanted surfaces get wider from view to view. */
static inline uint32_t between(uint32_t at, uint32_t a, uint32_t b)
{
    const int d = disp_of(at), da = disp_of(a), db = disp_of(b), least = da < db ? da : db;
    const bool gap = (least >= 0) & (abs(da - db) < STEP_Q6) & ((d < 0) | (least > d + STEP_Q6));

    return gap ? (da < db ? a : b) : at;
}

/* Of two pixels side by side only one is a gap, so that a row can be read as it was. @param closed  scratch, a row */
static void close_gaps(uint32_t *arrived, int width, int height, uint32_t *restrict closed)
{
    for (int y = 0; y < height; y++) {
        uint32_t *restrict at = arrived + (size_t)y * (size_t)width;

        closed[0] = at[0];
        closed[width - 1] = at[width - 1];
        for (int x = 1; x + 1 < width; x++)
            closed[x] = between(at[x], at[x - 1], at[x + 1]);
        if (y == 0 || y + 1 == height) {
            memcpy(at, closed, (size_t)width * sizeof(*at));
            continue;
        }
        for (int x = 0; x < width; x++)
            at[x] = between(closed[x], at[x - width], at[x + width]);
    }
}

/* What arrives in view k from the matched views other than itself. @param arrived, farthest  out, [height][width]; see
 * land_row; the latter NULL: not wanted */
static int carry_to(uint32_t *arrived, uint32_t *farthest, const struct carry *c, int k)
{
    const struct sst_visible_view *own = &c->in->view[k];
    const int width = own->disp->width, height = own->disp->height;
    const size_t pixels = (size_t)width * (size_t)height;
    uint32_t *row = sst_mem_alloc_raw((size_t)width, sizeof(*row));
    int source[CARRY_SOURCES];
    const int n = row ? run_carry_sources(c->in, k, source) : -ENOMEM;

    memset(arrived, 0, pixels * sizeof(*arrived));
    for (size_t i = 0; farthest && i < pixels; i++)
        farthest[i] = SST_DISP_NONE;
    for (int i = 0; i < n; i++)
        carry_view(&(struct arrivals){ arrived, farthest, (uint8_t *)row }, c, own, source[i], 1u << i);
    if (n >= 0)
        close_gaps(arrived, width, height, row);
    sst_mem_free(row);
    return n < 0 ? n : 0;
}

static uint32_t *arrived_init(const struct sst_visible_view *v)
{
    return sst_mem_alloc_raw((size_t)v->disp->width * (size_t)v->disp->height, sizeof(uint32_t));
}

/* Are there three bits? */
static bool agree(uint32_t sources)
{
    _Static_assert(AGREED == 3, "two bits are taken away");
    sources &= sources - 1;
    return sources & (sources - 1);
}

/* Set AGREES where most of the sources put the same surface at a pixel, and no other one a different
 * surface. */
static void find_agreed(uint32_t *arrived, const uint32_t *farthest, size_t pixels)
{
    for (size_t i = 0; i < pixels; i++) {
        const bool same = disp_of(arrived[i]) - (int)(farthest[i] & 0xFFFF) < STEP_Q6;

        arrived[i] |= same && agree(farthest[i] >> 16) ? AGREES : 0;
    }
}

/* Write the maps of view k. @param arrived  of carry_to(), with find_agreed() if that is wanted */
static int take_arrived(const struct carry *c, int k, const uint32_t *arrived)
{
    const struct sst_visible_view *own = &c->in->view[k];
    const int width = own->disp->width, height = own->disp->height;
    const int err = own->agreed && !own->agreed->data ? sst_map_u8_init(own->agreed, width, height) : 0;

    for (int y = 0; !err && y < height; y++) {
        const uint32_t *at = arrived + (size_t)y * (size_t)width;
        uint16_t *d = sst_map_u16_row(own->disp, y);
        uint8_t *confidence = sst_map_u8_row(own->confidence, y);
        uint8_t *agreed = own->agreed ? sst_map_u8_row(own->agreed, y) : NULL;
        uint8_t *status = c->status ? sst_map_u8_row(&c->status[k], y) : NULL;

        for (int x = 0; x < width; x++) { /* nothing arrived: -1, SST_DISP_NONE */
            d[x] = (uint16_t)disp_of(at[x] & ~AGREES);
            confidence[x] = confidence_of(at[x]);
        }
        for (int x = 0; agreed && x < width; x++)
            agreed[x] = at[x] & AGREES ? 255 : 0;
        for (int x = 0; status && x < width; x++)
            status[x] = at[x] & CONFIRMED ? SST_DISPARITY_CORRECT : SST_DISPARITY_OCCLUSION;
    }
    return err;
}

static bool carries(const void *job, int k)
{
    const struct carry *c = job;

    return c->in->view[k].image && c->in->view[k].carried;
}

static int carry_job(void *arg, int k, int worker SST_UNUSED)
{
    const struct carry *c = arg;
    const struct sst_visible_view *own = &c->in->view[k];
    const size_t pixels = (size_t)own->disp->width * (size_t)own->disp->height;
    uint32_t *arrived = NULL, *farthest = NULL;
    int err = c->in->cancel && *c->in->cancel ? -ECANCELED : 0;

    if (!err) {
        arrived = arrived_init(own);
        farthest = own->agreed ? sst_mem_alloc_raw(pixels, sizeof(*farthest)) : NULL;
        err = arrived && (farthest || !own->agreed) ? carry_to(arrived, farthest, c, k) : -ENOMEM;
    }
    if (!err && farthest)
        find_agreed(arrived, farthest, pixels);
    err = err ? err : take_arrived(c, k, arrived);
    if (!err)
        sst_fill_background(own->disp);
    sst_mem_free(arrived);
    sst_mem_free(farthest);
    return err;
}

static void carried_source(const void *job, int k, struct sst_plane_source *out)
{
    const struct carry *c = job;

    visible_source(c->in, k, out);
    out->checked = c->status ? &c->status[k] : NULL;
}

static void carried_maps(void *arg, int k, struct sst_share_maps *out)
{
    const struct carry *c = arg;
    const struct sst_visible_view *own = &c->in->view[k];

    sst_share_add_u16(out, own->disp);
    sst_share_add_u8(out, own->confidence);
    if (own->agreed)
        sst_share_add_u8(out, own->agreed);
    if (c->status)
        sst_share_add_u8(out, &c->status[k]);
}

static void *carry_sample(uint32_t seed)
{
    struct disparity_sample *s = disparity_sample(seed, true, true);

    if (!s)
        return NULL;
    s->carry = (struct carry){ &s->in, seed % 4 < 2 ? s->status : NULL, s };
    return &s->carry;
}

static void carry_sample_free(void *job)
{
    disparity_sample_free(job ? ((struct carry *)job)->sample : NULL);
}

const struct sst_step disparity_carry_step = { .name = "carrying",
                                               .stages = 1U << SST_DISPARITY_STAGE_CARRY,
                                               .wants = carries,
                                               .source = carried_source,
                                               .cpu = carry_job,
                                               .writes = carried_maps,
                                               .changes = 1U << SST_PLANE_MAP,
                                               .sample = carry_sample,
                                               .sample_free = carry_sample_free };

int sst_disparity_carry(const struct sst_visible_views *in, struct sst_map_u8 *status, int threads)
{
    const struct sst_run_options how = { in->share, threads, sst_visible_block(in), in->cancel };
    struct carry c = { in, status, NULL };

    visible_adopt(in);
    return sst_run(in->runner, &disparity_carry_step, &c, in->count, &how);
}

int sst_disparity_carry_error(const struct sst_visible_views *in, struct sst_map_u8 *status, int k, double *percent)
{
    const struct sst_visible_view *own = &in->view[k];
    const struct carry c = { in, status, NULL };
    uint32_t *arrived = arrived_init(own);
    int64_t n = 0, off = 0;
    const int err = arrived ? carry_to(arrived, NULL, &c, k) : -ENOMEM;

    for (int y = 0; !err && y < own->disp->height; y++) {
        const uint32_t *at = arrived + (size_t)y * (size_t)own->disp->width;
        const uint16_t *d = sst_map_u16_row(own->disp, y);

        for (int x = 0; x < own->disp->width; x++) {
            if (d[x] == SST_DISP_NONE || disp_of(at[x]) < 0)
                continue;
            n++;
            off += abs(d[x] - disp_of(at[x])) > STEP_Q6;
        }
    }
    *percent = n ? 100.0 * (double)off / (double)n : NAN;
    sst_mem_free(arrived);
    return err;
}

/* The measurement of one process for all. */
struct measured {
    struct disparity_run *run;
    const struct sst_visible_views *in;
    struct sst_map_u8 *status; /* or NULL */
    double error;
};

static void measured_values(void *arg, int index SST_UNUSED, struct sst_share_maps *out)
{
    struct measured *m = arg;

    sst_share_add_values(out, &m->error, sizeof(m->error));
}

static int measure_carrying(void *arg, int index SST_UNUSED, int worker SST_UNUSED)
{
    struct measured *m = arg;

    return sst_disparity_carry_error(m->in, m->status, m->run->lf->ref_view, &m->error);
}

int run_carrying_error(struct disparity_run *run, const struct sst_visible_views *in, struct sst_map_u8 *status,
                       double *error)
{
    struct measured m = { run, in, status, NAN };
    const int ref = run->lf->ref_view;
    int err = 0;

    if (run->lf->views[ref].present && !run->carried[ref])
        err = sst_share_for(run->cfg->share, 1, 1, measure_carrying, &m, measured_values);
    *error = m.error;
    return err;
}
