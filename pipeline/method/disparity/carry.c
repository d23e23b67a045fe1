/*
 * Maps of the matched views carried to the others (design.md, 5.7): a pixel goes to where its disparity puts it in the
 * other view, and the nearest surface wins there.
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/mem.h"
#include "base/thread.h"
#include "pipeline/gpu/carry.h"
#include "pipeline/kernels/kernels.h"
#include "pipeline/lightfield/share.h"
#include "pipeline/lightfield/shift.h"
#include "pipeline/method/disparity/disparity_internal.h"

#define SOURCES 4  /* nearest matched views that a map comes from */
#define AGREED  3  /* sources that must agree */
#define STEP_Q6 64 /* neighbours with a larger difference are on two surfaces */

/* What arrives at a pixel, the larger the better: disparity + 1 (0: nothing yet), the check's result, half of the
 * confidence. */
#define DISP_SHIFT SST_LANDED_DISP
#define CONFIRMED  128u

static int disp_of(uint32_t arrived)
{
    return (int)(arrived >> DISP_SHIFT) - 1;
}

static uint8_t confidence_of(uint32_t arrived)
{
    return (uint8_t)(arrived << 1);
}

struct carry {
    const struct sst_visible_views *in;
    struct sst_map_u8 *status;
    bool *done; /* [in->count] on the device; only the background is left */
};

/* Views that are too far away to count in the second pass are too far here: their numbers would not fit. */
static int sources_of(const struct sst_visible_views *in, int k, int *source)
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
    n = sst_visible_nearest(&matched, k, SOURCES, source);
    free(view);
    return n;
}

/* One source's part of a view. @param farthest  NULL: not wanted @param rank  scratch, a row */
static void carry_view(uint32_t *arrived, uint32_t *farthest, const struct carry *c, const struct sst_visible_view *own,
                       int source, uint32_t bit, uint8_t *rank)
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
            rank[x] = (uint8_t)(confidence[x] >> 1 | (status && status[x] == SST_DISPARITY_CORRECT ? CONFIRMED : 0));
        sst_kernels_get()->land_row(arrived, farthest, &l, sst_map_u16_row(from->disp, l.y), rank, (size_t)width);
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
    int source[SOURCES];
    const int n = row ? sources_of(c->in, k, source) : -ENOMEM;

    memset(arrived, 0, pixels * sizeof(*arrived));
    for (size_t i = 0; farthest && i < pixels; i++)
        farthest[i] = SST_DISP_NONE;
    for (int i = 0; i < n; i++)
        carry_view(arrived, farthest, c, own, source[i], 1u << i, (uint8_t *)row);
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

/* Set SST_GPU_CARRY_AGREED where most of the sources put the same surface at a pixel, and no other one a different
 * surface. */
static void find_agreed(uint32_t *arrived, const uint32_t *farthest, size_t pixels)
{
    for (size_t i = 0; i < pixels; i++) {
        const bool same = disp_of(arrived[i]) - (int)(farthest[i] & 0xFFFF) < STEP_Q6;

        arrived[i] |= same && agree(farthest[i] >> 16) ? SST_GPU_CARRY_AGREED : 0;
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

        for (int x = 0; x < width; x++) {
            const int disp = disp_of(at[x] & ~SST_GPU_CARRY_AGREED);

            d[x] = disp < 0 ? (uint16_t)SST_DISP_NONE : (uint16_t)disp;
            confidence[x] = confidence_of(at[x]);
            if (agreed)
                agreed[x] = at[x] & SST_GPU_CARRY_AGREED ? 255 : 0;
            if (c->status)
                sst_map_u8_row(&c->status[k], y)[x] =
                    at[x] & CONFIRMED ? SST_DISPARITY_CORRECT : SST_DISPARITY_OCCLUSION;
        }
    }
    return err;
}

static int carry_job(void *arg, int k, int worker SST_UNUSED)
{
    const struct carry *c = arg;
    const struct sst_visible_view *own = &c->in->view[k];
    uint32_t *farthest = NULL;
    const size_t pixels = own->image ? (size_t)own->disp->width * (size_t)own->disp->height : 0;
    uint32_t *arrived;
    int err;

    if (!own->image || !own->carried)
        return 0;
    if (c->in->cancel && *c->in->cancel)
        return -ECANCELED;
    if (c->done[k]) {
        sst_fill_background(own->disp);
        return 0;
    }
    arrived = arrived_init(own);
    if (arrived && own->agreed)
        farthest = sst_mem_alloc_raw(pixels, sizeof(*farthest));
    err = arrived && (farthest || !own->agreed) ? carry_to(arrived, farthest, c, k) : -ENOMEM;
    if (!err && farthest)
        find_agreed(arrived, farthest, pixels);
    err = err ? err : take_arrived(c, k, arrived);
    if (!err)
        sst_fill_background(own->disp);
    sst_mem_free(arrived);
    sst_mem_free(farthest);
    return err;
}

static void carried_maps(void *arg, int k, struct sst_share_maps *out)
{
    const struct carry *c = arg;
    const struct sst_visible_view *own = &c->in->view[k];

    if (!own->image || !own->carried)
        return;
    sst_share_add_u16(out, own->disp);
    sst_share_add_u8(out, own->confidence);
    if (own->agreed)
        sst_share_add_u8(out, own->agreed);
    if (c->status)
        sst_share_add_u8(out, &c->status[k]);
}

/* Load the sources of all views that `which` names, or of all carried ones. @param which  a view, or -1
 * @return 1: loaded, 0: the device fails, or an error */
static int load_sources(const struct carry *c, int which)
{
    const struct sst_visible_views *in = c->in;
    bool *wanted = calloc((size_t)in->count, sizeof(*wanted));
    int err = wanted ? 0 : -ENOMEM;

    for (int k = 0; k < in->count && !err; k++) {
        int source[SOURCES], n;

        if (!in->view[k].image || (which < 0 ? !in->view[k].carried : k != which))
            continue;
        n = sources_of(in, k, source);
        for (int i = 0; i < n; i++)
            wanted[source[i]] = true;
        err = n < 0 ? n : 0;
    }
    if (!err)
        err = disparity_device_carry_load(in->device, in, c->status, wanted);
    free(wanted);
    return err;
}

/* carry_to() and, if `agreed`, find_agreed() on the device. @param stays  struct device_carry @return likewise */
static int carry_to_on_device(uint32_t *arrived, const struct carry *c, int k, bool agreed, bool stays)
{
    int source[SOURCES];
    const int n = sources_of(c->in, k, source);
    const struct device_carry in = {
        .in = c->in, .view = k, .source = source, .sources = n, .agreed = agreed, .stays = stays, .out = arrived
    };

    return n < 0 ? n : disparity_device_carry(c->in->device, &in);
}

/* As many of the carried views as the device can do. */
static int carry_on_device(const struct carry *c)
{
    uint32_t *arrived = NULL;
    int err = load_sources(c, -1);

    for (int k = 0; k < c->in->count && err == 1; k++) {
        const struct sst_visible_view *own = &c->in->view[k];

        if (!own->image || !own->carried)
            continue;
        if (c->in->cancel && *c->in->cancel) {
            err = -ECANCELED;
            break;
        }
        if (!arrived)
            arrived = arrived_init(own);
        err = arrived ? carry_to_on_device(arrived, c, k, own->agreed, true) : -ENOMEM;
        if (err != 1)
            break;
        err = take_arrived(c, k, arrived);
        c->done[k] = !err;
        err = err ? err : 1;
    }
    sst_mem_free(arrived);
    return err < 0 ? err : 0;
}

int sst_disparity_carry(const struct sst_visible_views *in, struct sst_map_u8 *status, int threads)
{
    struct carry c = { in, status, calloc((size_t)in->count, sizeof(*c.done)) };
    int err = c.done ? 0 : -ENOMEM;

    if (in->device && in->share) /* its views are the processes' */
        sst_disparity_device_note_stage(in->device, SST_DISPARITY_STAGE_CARRY);
    else if (in->device)
        err = err ? err : carry_on_device(&c);
    err =
        err ? err : sst_share_blocks(in->share, in->count, sst_visible_block(in), threads, carry_job, &c, carried_maps);
    for (int k = 0; c.done && k < in->count; k++) {
        if (in->view[k].carried && !c.done[k])
            disparity_device_map_changed(in->device, k);
    }
    free(c.done);
    return err;
}

/* What arrives in view k, on the device if it can. */
static int carry_to_one(uint32_t *arrived, const struct carry *c, int k)
{
    int done = c->in->device ? load_sources(c, k) : 0;

    if (done == 1)
        done = carry_to_on_device(arrived, c, k, false, false);
    return done == 0 ? carry_to(arrived, NULL, c, k) : done < 0 ? done : 0;
}

int sst_disparity_carry_error(const struct sst_visible_views *in, struct sst_map_u8 *status, int k, double *percent)
{
    const struct sst_visible_view *own = &in->view[k];
    const struct carry c = { in, status, NULL };
    uint32_t *arrived = arrived_init(own);
    int64_t n = 0, off = 0;
    const int err = arrived ? carry_to_one(arrived, &c, k) : -ENOMEM;

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
