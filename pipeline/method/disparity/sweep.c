/*
 * Surfaces that the first pass missed (design.md, 5.7). Where gaps are small everywhere, no window holds more of what
 * is behind than of what is in front, and no map has the surface behind. In a few views, sparse pixels that their own
 * disparity does not explain are tested at all disparities. Those that one disparity alone explains are points in
 * space: seen from each view, the disparities where points gather are its candidates.
 */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/method/disparity/visible_internal.h"

#include <errno.h>
#include <stdlib.h>

/* Cost of all levels for one pixel. */
static void cost_of_levels(uint16_t *cost, const struct sst_hypothesis_test *t, int x, int y,
                           const struct sst_sweep_plan *p)
{
    for (int from = 0; from < p->levels; from += SST_HYPOTHESES) {
        const uint8_t count = (uint8_t)sst_max_int(2, sst_min_int(SST_HYPOTHESES, p->levels - from));
        uint16_t hypothesis[SST_HYPOTHESES];

        for (int i = 0; i < SST_HYPOTHESES; i++)
            hypothesis[i] = (uint16_t)((from + i) * p->level);
        sst_kernels_get()->hypothesis_cost_row(cost + from, hypothesis, &count, t, x, y, 1);
    }
}

/* The level that alone explains a pixel. @return its weight, 0: there is none */
static int find_distinct(const uint16_t *cost, const struct sst_sweep_plan *p, int *level)
{
    int best = 0, next = SST_HYPOTHESIS_FAR;

    for (int l = 1; l < p->levels; l++)
        best = cost[l] < cost[best] ? l : best;
    for (int l = 0; l < p->levels; l++)
        next = abs(l - best) > p->apart && cost[l] < next ? cost[l] : next;
    *level = best;
    return next - cost[best] < p->distinct ? 0 : sst_min_int(next - cost[best], p->weight_most);
}

/* True if the pixel's own disparity explains it. */
static bool is_explained(const struct sst_hypothesis_test *t, int x, int y, uint16_t own)
{
    const uint16_t hypothesis[SST_HYPOTHESES] = { own, own };
    const uint8_t two = 2;
    uint16_t cost[SST_HYPOTHESES];

    sst_kernels_get()->hypothesis_cost_row(cost, hypothesis, &two, t, x, y, 1);
    return cost[0] < t->settled;
}

int sst_sweep_view(struct sst_sweep *out, const struct sst_sweep_plan *plan, const struct sst_hypothesis_test *test,
                   const struct sst_map_u16 *disp, const struct sst_map_u8 *seen)
{
    struct sst_hypothesis_test all = *test;
    uint16_t cost[SST_SWEEP_LEVELS + SST_HYPOTHESES];
    const int stride = plan->stride;

    all.settled = 0;
    out->count = 0;
    out->point = sst_mem_alloc_raw((size_t)(disp->width / stride + 1) * (size_t)(disp->height / stride + 1),
                                   sizeof(*out->point));
    if (!out->point)
        return -ENOMEM;
    for (int y = stride / 2; y < disp->height; y += stride) {
        for (int x = stride / 2; x < disp->width; x += stride) {
            const uint16_t own = sst_map_u16_row(disp, y)[x];
            int best, weight;

            if ((seen && seen->data && !sst_map_u8_row(seen, y)[x]) ||
                (own != SST_DISP_NONE && is_explained(test, x, y, own)))
                continue;
            cost_of_levels(cost, &all, x, y, plan);
            weight = find_distinct(cost, plan, &best);
            if (weight)
                out->point[out->count++] =
                    (struct sst_sweep_point){ (uint16_t)x, (uint16_t)y, (uint16_t)best, (uint16_t)weight };
        }
    }
    return 0;
}

/* --- the step: items are sweeps ----------------------------------------------------------------------------------- */

static bool is_sweep(const void *job, int i)
{
    return i < ((const struct visible_pass *)job)->sweeps.count;
}

static int sweep_job(void *job, int i, int worker SST_UNUSED)
{
    struct visible_pass *p = job;
    const struct sst_visible_view *v = &p->in->view[p->swept[i]];
    struct sst_hypothesis_test test;
    int nearest[SST_HYPOTHESIS_VIEWS];

    if (p->in->cancel && *p->in->cancel)
        return -ECANCELED;
    visible_set_test(&test, p, p->swept[i], visible_sweep_views(p->in), nearest);
    sst_mem_free(p->sweeps.sweep[i].point);
    return sst_sweep_view(&p->sweeps.sweep[i], &p->sweeps.plan, &test, v->disp, v->seen);
}

static void swept_points(void *job, int i, struct sst_share_maps *out)
{
    struct sst_sweep *s = &((struct visible_pass *)job)->sweeps.sweep[i];

    sst_share_add_list(out, &s->point, &s->count, sizeof(*s->point));
}

static void *sweep_sample(uint32_t seed)
{
    return visible_sample(seed);
}

const struct sst_step disparity_sweep_step = { .name = "sweep",
                                               .stages = 1U << SST_DISPARITY_STAGE_SURFACES,
                                               .wants = is_sweep,
                                               .source = visible_pass_source,
                                               .cpu = sweep_job,
                                               .writes = swept_points,
                                               .sample = sweep_sample,
                                               .sample_free = visible_sample_free };

int visible_sweep(struct visible_pass *p, struct sst_runner_user *user)
{
    const struct sst_run_options how = { p->in->share, p->threads, 1, p->in->cancel };

    return sst_run(user, &disparity_sweep_step, p, p->sweeps.count, &how);
}
