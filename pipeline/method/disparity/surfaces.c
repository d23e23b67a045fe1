/*
 * Tests of hypotheses, a round of the second pass (visible.c): each pixel has a few hypotheses, the surfaces around it,
 * surfaces projected from other views and surfaces of the sweep (around.c); their costs, the optimisation over
 * them (hypotheses.c) and the choice.
 */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <string.h>

#include "base/mem.h"
#include "pipeline/method/disparity/visible_internal.h"

bool visible_counts_skipped(const struct visible_pass *p)
{
    return p->in->skip_hypotheses && p->in->report;
}

/* Where colours are alike everywhere, no hypothesis is better than another by more than noise: the pixel's own one
 * stays. One that costs VISIBLE_CHANGE or less cannot lose, and no other is tested. */
static void prefer_own(uint16_t *cost, const uint8_t *count, int n)
{
    for (int x = 0; x < n; x++) {
        for (int i = 1; i < count[x]; i++)
            cost[x * SST_HYPOTHESES + i] = (uint16_t)(cost[x * SST_HYPOTHESES + i] + VISIBLE_CHANGE);
    }
}

/* Best hypothesis of a pixel by its costs alone. */
static int cheapest(const uint16_t *cost, int count)
{
    int best = 0;

    for (int i = 1; i < count; i++)
        best = cost[i] < cost[best] ? i : best;
    return best;
}

void visible_count_skipped(const struct visible_tested *t, const struct hypothesis_part *part, const uint32_t *chosen)
{
    struct visible_counted *counted = &t->p->counted[t->k];
    int64_t hypotheses = 0, skipped = 0;
    const bool sampled = part->y % VISIBLE_SAMPLED_ROWS == VISIBLE_SAMPLED_ROWS / 2;
    struct sst_hypothesis_test whole = t->test;
    uint16_t exact[HYPOTHESIS_STRIP * SST_HYPOTHESES];

    whole.settled = VISIBLE_CHANGE + 1;
    if (sampled) {
        sst_kernels_get()->hypothesis_cost_row(exact, part->hypothesis, part->count, &whole, part->left, part->y,
                                               (size_t)part->n);
        prefer_own(exact, part->count, part->n);
    }
    for (int x = 0; x < part->n; x++) {
        const int count = part->count[x], at = x * SST_HYPOTHESES;
        const uint32_t there = chosen ? chosen[x] : 0;
        const uint16_t own = chosen ? 0 : part->cost[at];
        const bool left_out = chosen ? there >> 28 & 1 : own > VISIBLE_CHANGE && own < VISIBLE_CHEAP;

        hypotheses += count;
        skipped += count > 1 && left_out ? count - 1 : 0;
        if (!sampled)
            continue;
        counted->samples += count > 0;
        counted->changed += count && cheapest(exact + at, count) !=
                                         (chosen ? (int)(there >> 25 & 7) : cheapest(part->cost + at, count));
    }
    counted->hypotheses += hypotheses;
    counted->skipped += skipped;
}

/* Hypotheses of a strip and their costs: the rows of the other views that one row needs are in the cache for the next.
 */
static void test_strip(const struct visible_tested *t, int left)
{
    struct hypothesis_lists *l = t->lists;
    uint16_t hypothesis[HYPOTHESIS_STRIP * SST_HYPOTHESES], cost[HYPOTHESIS_STRIP * SST_HYPOTHESES];
    uint8_t count[HYPOTHESIS_STRIP];
    struct hypothesis_part part = { hypothesis, cost, count, left, 0, sst_min_int(HYPOTHESIS_STRIP, l->width - left) };

    for (; part.y < l->height; part.y++) {
        sst_around_list(hypothesis, count, t->around, t->view, &(struct sst_around_part){ left, part.y, part.n });
        sst_kernels_get()->hypothesis_cost_row(cost, hypothesis, count, &t->test, left, part.y, (size_t)part.n);
        prefer_own(cost, count, part.n);
        if (visible_counts_skipped(t->p))
            visible_count_skipped(t, &part, NULL);
        hypothesis_lists_add(l, &part, t->test.settled);
    }
}

/* Costs, optimisation and choice. */
static void choose(const struct visible_tested *t)
{
    struct visible_pass *p = t->p;
    struct hypothesis_lists *lists = t->lists;

    for (int left = 0; left < lists->width; left += HYPOTHESIS_STRIP) {
        test_strip(t, left);
        hypothesis_paths_down(lists, &p->penalty, &t->test.own, left / HYPOTHESIS_STRIP);
    }
    for (int y = 0; y < lists->height; y++) {
        hypothesis_paths_along(lists, &p->penalty, &t->test.own, y);
        hypothesis_choose_row(lists, y, sst_map_u16_row(&p->out[t->k], y), sst_map_u8_row(&p->confidence[t->k], y));
    }
}

int visible_begin(struct visible_tested *t, struct visible_pass *p, int k, struct visible_scratch *scratch)
{
    const struct sst_visible_view *v = &p->in->view[k];
    int err;

    *t = (struct visible_tested){ p, k, v, &scratch->lists, &scratch->around, { .views = 0 } };
    p->counted[k] = (struct visible_counted){ 0 };
    sst_map_u16_fini(&p->out[k]);
    sst_map_u8_fini(&p->confidence[k]);
    err = sst_map_u16_init(&p->out[k], v->disp->width, v->disp->height);
    err = err ? err : sst_map_u8_init(&p->confidence[k], v->disp->width, v->disp->height);
    err = err ? err : hypothesis_lists_init(t->lists, v->disp->width, v->disp->height);
    for (int y = 0; !err && y < v->disp->height; y++)
        memcpy(sst_map_u8_row(&p->confidence[k], y), sst_map_u8_row(v->confidence, y), (size_t)v->disp->width);
    return err;
}

static bool tests(const void *job, int k)
{
    const struct visible_pass *p = job;

    return p->in->view[k].image && p->in->view[k].carried == p->in->repair;
}

static int test_view(void *job, int k, int worker)
{
    struct visible_pass *p = job;
    struct visible_tested t;
    int nearest[SST_HYPOTHESIS_VIEWS], err;

    if (p->in->cancel && *p->in->cancel)
        return -ECANCELED;
    err = visible_begin(&t, p, k, &p->scratch[worker]);
    err = err ? err : sst_around_init(t.around, p->in, k, &p->sweeps);
    if (err)
        return err;
    visible_set_test(&t.test, p, k, visible_views(p->in), nearest);
    choose(&t);
    return 0;
}

static void tested_maps(void *arg, int k, struct sst_share_maps *out)
{
    struct visible_pass *p = arg;

    sst_share_add_u16(out, &p->out[k]);
    sst_share_add_u8(out, &p->confidence[k]);
    sst_share_add_values(out, &p->counted[k], sizeof(p->counted[k]));
}

static void *surfaces_sample(uint32_t seed)
{
    struct visible_pass *p = visible_sample(seed);

    if (!p || !visible_sweep(p, NULL))
        return p;
    visible_sample_free(p);
    return NULL;
}

const struct sst_step disparity_surfaces_step = { .name = "surfaces",
                                                  .stages = 1U << SST_DISPARITY_STAGE_SURFACES,
                                                  .wants = tests,
                                                  .source = visible_pass_source,
                                                  .counter = SST_DISPARITY_TESTED,
                                                  .cpu = test_view,
                                                  .writes = tested_maps,
                                                  .changes = 1U << SST_PLANE_MAP,
                                                  .sample = surfaces_sample,
                                                  .sample_free = visible_sample_free };

int visible_test(struct visible_pass *p, struct sst_runner_user *user)
{
    const struct sst_run_options how = { p->in->share, p->threads, 1, p->in->cancel };

    return sst_run(user, &disparity_surfaces_step, p, p->in->count, &how);
}
