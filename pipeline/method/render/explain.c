/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdatomic.h>
#include <stdlib.h>

#include "base/mem.h"
#include "base/thread.h"
#include "pipeline/method/render/render_internal.h"

#define LEVELS   24  /* difference of colours that agree, at least ... */
#define NOISE    2.5 /* ... and this many lower quartiles */
#define SPACINGS 1.5 /* distance of the views around */
#define SAMPLES  256 /* rows and columns from which noise is measured, over all views */
#define PART     64  /* positions between pixels */

/* A view around another. */
struct neighbour {
    const struct sst_image *image;
    const struct sst_map_u8 *valid; /* without data: all */
    float bx, by; /* pixels that a point moves by from the other view to this one, per pixel of disparity */
    int tap;
};

struct explainer {
    const struct sst_render_plan *plan;
    struct sst_renderer *renderer;
    struct tap {
        const struct sst_image *image;
        const struct sst_map_u16 *disp;
        int count;
        struct neighbour around[EXPLAINER_AROUND];
    } * tap; /* [plan->count] */
    bool keep;
    atomic_bool prepared;
    /* fixed once prepared */
    int levels;
    SST_ATOMIC(uint8_t) * known; /* [plan->count][height][width] enum known, of the renderer; NULL: not kept */
};

enum known { UNKNOWN = 0, EXPLAINED = 1, CONTRADICTED = 2 };

static struct neighbour neighbour(const struct explainer *e, int tap, const struct sst_view *of)
{
    const struct sst_render_tap *t = &e->plan->tap[tap];
    const struct sst_raw_view *raw = e->plan->lf->images_raw ? &e->renderer->raw[t->view] : NULL;

    return (struct neighbour){ raw ? &raw->rectified : &t->v->image, raw ? &raw->seen : &t->v->valid,
                               (float)(of->bx - t->v->bx), (float)(of->by - t->v->by), tap };
}

static void find_around(struct explainer *e, int k)
{
    const struct sst_render_plan *p = e->plan;
    const struct sst_view *v = p->tap[k].v;
    struct tap *t = &e->tap[k];

    t->image = neighbour(e, k, v).image;
    t->disp = &v->disp;
    for (int i = 0; i < p->count && t->count < EXPLAINER_AROUND; i++) {
        const struct sst_view *other = p->tap[i].v;

        if (i != k && hypot(v->bx - other->bx, v->by - other->by) <= SPACINGS)
            t->around[t->count++] = neighbour(e, i, v);
    }
}

int explainer_create(struct explainer **out, const struct sst_render_plan *p, struct sst_renderer *r)
{
    struct explainer *e = calloc(1, sizeof(*e));

    if (!e)
        return -ENOMEM;
    e->plan = p;
    e->renderer = r;
    e->tap = calloc((size_t)p->count, sizeof(*e->tap));
    if (!e->tap) {
        free(e);
        return -ENOMEM;
    }
    for (int k = 0; k < p->count; k++)
        find_around(e, k);
    *out = e;
    return 0;
}

void explainer_destroy(struct explainer *e)
{
    if (!e)
        return;
    free(e->tap);
    free(e);
}

/* Difference of a colour from that of a neighbour at (x, y), bilinear; -1: not seen there. */
static int difference(const struct neighbour *n, const int colour[3], float x, float y)
{
    const struct sst_image *img = n->image;
    const int xp = (int)(x * PART + 0.5f), yp = (int)(y * PART + 0.5f);
    const int x0 = xp / PART, y0 = yp / PART, fx = xp % PART, fy = yp % PART;
    int sum = 0;

    if (x < 0 || y < 0 || x0 + 1 >= img->width || y0 + 1 >= img->height ||
        (n->valid->data && !sst_map_u8_row(n->valid, y0 + fy * 2 / PART)[x0 + fx * 2 / PART]))
        return -1;
    for (int c = 0; c < 3; c++) {
        const uint8_t *top = img->plane[c] + (size_t)y0 * img->stride + x0, *bottom = top + img->stride;
        const int upper = PART * top[0] + fx * (top[1] - top[0]);
        const int lower = PART * bottom[0] + fx * (bottom[1] - bottom[0]);
        const int value = PART * upper + fy * (lower - upper);

        sum += abs(value - PART * PART * colour[c]);
    }
    return sum / (PART * PART);
}

struct ray {
    int colour[3];
    float x, y, disp_px;
};

static struct ray ray_at(const struct explainer *e, const struct tap *t, int x, int y)
{
    struct ray ray = { .x = (float)x, .y = (float)y };

    for (int c = 0; c < 3; c++)
        ray.colour[c] = sst_image_row(t->image, c, y)[x];
    ray.disp_px = (float)sst_disp_px(e->plan->lf, sst_map_u16_row(t->disp, y)[x]);
    return ray;
}

/* Difference from what a neighbour shows of the ray's place at a disparity. */
static int differs_from(const struct ray *ray, const struct neighbour *n, float disp_px)
{
    return difference(n, ray->colour, ray->x + disp_px * n->bx, ray->y + disp_px * n->by);
}

/* Views around that agree with a ray at a disparity, and those that do not. */
struct agreement {
    int agree, differ;
};

/* Stops once more than half differ, or once no fewer agree than can differ in the end. */
static struct agreement agreement_at(const struct explainer *e, const struct tap *t, const struct ray *ray,
                                     float disp_px)
{
    struct agreement a = { 0, 0 };

    for (int i = 0; i < t->count && 2 * a.differ <= t->count; i++) {
        const int by = differs_from(ray, &t->around[i], disp_px);

        a.agree += by >= 0 && by < e->levels;
        a.differ += by >= e->levels;
        if (a.agree >= a.differ + t->count - 1 - i)
            break;
    }
    return a;
}

static bool contradicts(const struct explainer *e, int k, int x, int y)
{
    const struct tap *t = &e->tap[k];
    const struct ray ray = ray_at(e, t, x, y);
    const struct agreement own = agreement_at(e, t, &ray, ray.disp_px);

    return !own.agree || own.agree < own.differ;
}

/* Threads that test the same pixel at once find the same. */
bool explainer_contradicts(const struct explainer *e, int k, int x, int y)
{
    const struct sst_lightfield *lf = e->plan->lf;
    const size_t at = ((size_t)k * (size_t)lf->height + (size_t)y) * (size_t)lf->width + (size_t)x;
    uint8_t known = e->known ? atomic_load_explicit(&e->known[at], memory_order_relaxed) : UNKNOWN;

    if (known == UNKNOWN) {
        known = contradicts(e, k, x, y) ? CONTRADICTED : EXPLAINED;
        if (e->known)
            atomic_store_explicit(&e->known[at], known, memory_order_relaxed);
    }
    return known == CONTRADICTED;
}

int explainer_levels(const struct explainer *e)
{
    return e->levels;
}

int explainer_around(const struct explainer *e, int k, struct explainer_near *out)
{
    for (int i = 0; i < e->tap[k].count; i++)
        out[i] = (struct explainer_near){ e->tap[k].around[i].bx, e->tap[k].around[i].by, e->tap[k].around[i].tap };
    return e->tap[k].count;
}

int explainer_bins(const struct explainer *e)
{
    return e->renderer->histogram.bins;
}

/* The renderer has counted the disparities: pictures with rays to explain have weights by them. */
bool explainer_reach(const struct explainer *e, int nearest, double *least_px, double *most_px)
{
    const struct sst_lightfield *lf = e->plan->lf;
    const int most = e->renderer->histogram.bins - 1;

    if (most <= nearest)
        return false;
    *least_px = sst_disp_px(lf, (uint16_t)sst_max_int(nearest + 1, 0));
    *most_px = sst_disp_px(lf, (uint16_t)most);
    return true;
}

/* --- preparation -------------------------------------------------------------------------------------------------- */

static int rectify(void *arg, int index, int worker SST_UNUSED)
{
    const struct explainer *e = arg;

    return render_rectify_frame(e->renderer, e->plan->tap[index].view);
}

/* Lower median of the differences of a ray from the views around; -1: there are none. */
static int middle_difference(const struct tap *t, const struct ray *ray)
{
    int sorted[EXPLAINER_AROUND], n = 0;

    for (int i = 0; i < t->count; i++) {
        const int by = differs_from(ray, &t->around[i], ray->disp_px);
        int at = n;

        for (; by >= 0 && at > 0 && sorted[at - 1] > by; at--)
            sorted[at] = sorted[at - 1];
        if (by >= 0) {
            sorted[at] = by;
            n++;
        }
    }
    return n ? sorted[(n - 1) / 2] : -1;
}

static int measure_levels(const struct explainer *e)
{
    const struct sst_lightfield *lf = e->plan->lf;
    const int step = sst_max_int((int)(sqrt((double)lf->width * lf->height * e->plan->count) / SAMPLES), 1);
    int64_t count[3 * 255 + 1] = { 0 }, n = 0, below = 0;
    int quartile = 0;

    for (int k = 0; k < e->plan->count; k++) {
        for (int y = step / 2; y < lf->height; y += step) {
            for (int x = step / 2; x < lf->width; x += step) {
                struct ray ray;
                int by;

                if (sst_map_u16_row(e->tap[k].disp, y)[x] == SST_DISP_NONE)
                    continue;
                ray = ray_at(e, &e->tap[k], x, y);
                by = middle_difference(&e->tap[k], &ray);
                if (by >= 0) {
                    count[by]++;
                    n++;
                }
            }
        }
    }
    while (n && 4 * (below += count[quartile]) < n)
        quartile++;
    return sst_max_int(LEVELS, (int)(NOISE * quartile));
}

void explainer_keep(struct explainer *e)
{
    e->keep = true;
}

/* What the answers depend on besides the light field: the views of the plan. */
static uint64_t key_of(const struct explainer *e)
{
    uint64_t key = 1469598103934665603u;

    for (int k = 0; k < e->plan->count; k++)
        key = (key ^ (uint64_t)(e->plan->tap[k].view + 1)) * 1099511628211u;
    return key;
}

/* The first plan's views get the memory; plans of other views keep nothing. Under the renderer's lock. */
static void find_levels(struct explainer *e)
{
    struct sst_renderer *r = e->renderer;
    const uint64_t key = e->keep ? key_of(e) : 0;

    if (e->keep && r->explained && r->explained_key == key) {
        e->known = r->explained;
        e->levels = r->explained_levels;
        return;
    }
    e->levels = measure_levels(e);
    if (!e->keep || r->explained)
        return;
    r->explained = sst_mem_alloc((size_t)e->plan->count, (size_t)e->plan->lf->width * (size_t)e->plan->lf->height);
    r->explained_key = key;
    r->explained_levels = e->levels;
    e->known = r->explained;
}

int explainer_prepare(struct explainer *e)
{
    int err = 0;

    if (atomic_load_explicit(&e->prepared, memory_order_acquire))
        return 0;
    pthread_mutex_lock(&e->renderer->lock);
    if (!atomic_load_explicit(&e->prepared, memory_order_relaxed)) {
        if (e->plan->lf->images_raw)
            err = sst_parallel_for(e->plan->count, sst_thread_count(e->plan->cfg.threads), rectify, e);
        if (!err)
            find_levels(e);
        atomic_store_explicit(&e->prepared, !err, memory_order_release);
    }
    pthread_mutex_unlock(&e->renderer->lock);
    return err;
}
