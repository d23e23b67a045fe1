/* Pairs of neighbours: search ranges, and all their matches. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>

#include "base/stats.h"
#include "base/thread.h"
#include "pipeline/calibration/drift/drift_internal.h"
#include "pipeline/lightfield/share.h"

#define VOTES         32 /* features of a pair that vote for the search range of the others */
#define VOTERS        3 /* of the pairs one votes in the first look */
#define VOTES_LEAST   6
#define VOTE_BAND     4    /* half width across the line, px of the coarsest level; four times that in a second try */
#define BAND          3    /* of the search for all features, px of its level */
#define UNKNOWN_REACH 0.2  /* without a known range: of the picture's longer side per spacing, either way */
#define DRIFT_REACH   0.02 /* of it: how far a camera may have moved along the line */
#define RANGE_CUT     0.03 /* share of votes left out at each end of the range */
#define ENOUGH        96   /* matches: half of the cells; with fewer, a finer search follows */
#define FIRST         4    /* of the cells one is looked at first */
#define SOME          16   /* matches of a pair that are enough to see whether it is off */
#define FEW           4    /* good matches that are more than chance */
#define NARROW_PX     1.5  /* least half width of the finer search's band */
#define NOISE_LEAST   100  /* matches to estimate the noise from */
#define NOISE_BEST    0.02 /* quantile of the misfits that is the noise */
#define NOISE_ROOM    4.0  /* of noise alone, that quantile has a quarter of the allowance */
#define BLOCKS        20   /* of links, that processes exchange */
#define OUTLIER_PX    0.15 /* matches further than this and 5 sigma from their pair's median are no matches */

static int longer_side(const struct drift_work *w)
{
    return sst_max_int(w->lf->width, w->lf->height);
}

void drift_link_set(struct drift_link *link, const struct drift_work *w, int a, int b)
{
    const double x = w->offset[b][0] - w->offset[a][0], y = w->offset[b][1] - w->offset[a][1];
    struct drift_search *s = &link->s;

    *link = (struct drift_link){ .a = a, .b = b, .length = hypot(x, y) };
    if (link->length < 1e-3)
        return; /* one place: no line */
    s->u[0] = x / link->length;
    s->u[1] = y / link->length;
    s->n[0] = -s->u[1];
    s->n[1] = s->u[0];
    if (fabs(s->n[0]) > fabs(s->n[1]) ? s->n[0] < 0 : s->n[1] < 0) {
        s->n[0] = -s->n[0];
        s->n[1] = -s->n[1];
    }
}

int drift_make_links(struct drift_work *w)
{
    const int rows = w->lf->rows, cols = w->lf->cols;

    w->link = calloc((size_t)w->views * 2, sizeof(*w->link));
    if (!w->link)
        return -ENOMEM;
    for (int v = 0; v < w->views; v++) {
        int right = v + 1, below = v + cols;

        if (!w->view[v].image)
            continue;
        while (right / cols == v / cols && !w->view[right].image)
            right++;
        while (below < rows * cols && !w->view[below].image)
            below += cols;
        if (right / cols == v / cols)
            drift_link_set(&w->link[w->links++], w, v, right);
        if (below < rows * cols)
            drift_link_set(&w->link[w->links++], w, v, below);
    }
    return 0;
}

/* --- where to look ------------------------------------------------------------------------------------------------ */

struct job {
    struct drift_work *w;
    const bool *only;
    int vote_level, search_level;
    double *vote; /* [links][VOTES] disparities */
    int *votes;   /* [links] */
};

static bool skipped(const struct job *job, int index)
{
    return (job->only && !job->only[index]) || job->w->link[index].length <= 0;
}

static void set_range(struct drift_search *s, const struct drift_link *link, double min_px, double max_px,
                      double margin_px)
{
    s->from_px = -max_px * link->length - margin_px;
    s->to_px = -min_px * link->length + margin_px;
}

/* A few features, looked for on the coarsest level over the whole range and a wide band. Sets the link's line. */
static int vote(struct job *job, int index, double band)
{
    struct drift_work *w = job->w;
    struct drift_link *link = &w->link[index];
    const struct drift_pyramid *a = &w->view[link->a];
    const struct drift_views views = { a, &w->view[link->b], &link->s };
    const double size = 1 << job->vote_level;
    double across[VOTES], spread[VOTES], *d = job->vote + (size_t)index * VOTES;
    int n = 0, tried = 0;

    link->s.across_px = 0;
    link->s.band_px = band * size;
    set_range(&link->s, link, w->range[0], w->range[1], 2 * size + DRIFT_REACH * longer_side(w));
    for (int i = 0; i < VOTES; i++) {
        const int cell = (2 * i + 1) * DRIFT_CELLS / (2 * VOTES);
        struct drift_match m;

        if (a->first[cell] == a->first[cell + 1])
            continue;
        drift_search_match(&m, &views, &a->feature[a->first[cell]], job->vote_level);
        tried += m.outcome != DRIFT_OUTSIDE && m.outcome != DRIFT_AMBIGUOUS;
        if (m.outcome != DRIFT_FOUND)
            continue;
        d[n] = -m.along / link->length;
        across[n++] = m.across;
    }
    job->votes[index] = n;
    link->s.band_px = (BAND << job->search_level);
    if (n < VOTES_LEAST)
        return tried;
    link->s.across_px = sst_stats_quantile(across, n, 0.5);
    for (int i = 0; i < n; i++)
        spread[i] = fabs(across[i] - link->s.across_px);
    link->s.band_px = fmax(link->s.band_px, 3 * sst_stats_quantile(spread, n, 0.5));
    return 2 * n >= tried ? 0 : tried;
}

static int vote_job(void *arg, int index, int worker SST_UNUSED)
{
    struct job *job = arg;

    if (skipped(job, index))
        return 0;
    if (job->w->stage == DRIFT_FIRST) {
        if (index % VOTERS == 0)
            vote(job, index, VOTE_BAND);
    } else if (vote(job, index, VOTE_BAND) > VOTES_LEAST)
        vote(job, index, 4 * VOTE_BAND);
    return 0;
}

/* Range of the bulk of all votes, and some more. */
static void range_of_votes(struct job *job)
{
    struct drift_work *w = job->w;
    double *v = job->vote, lo, hi;
    int n = 0;

    for (int i = 0; i < w->links; i++) {
        for (int k = 0; k < job->votes[i]; k++)
            v[n++] = job->vote[(size_t)i * VOTES + (size_t)k];
    }
    if (!n) {
        w->range[0] = w->range[1] = 0;
        return;
    }
    lo = sst_stats_quantile(v, n, RANGE_CUT);
    hi = sst_stats_quantile(v, n, 1 - RANGE_CUT);
    w->range[0] = lo - 0.1 * (hi - lo) - (1 << job->vote_level);
    w->range[1] = hi + 0.1 * (hi - lo) + (1 << job->vote_level);
}

/* --- all matches -------------------------------------------------------------------------------------------------- */

/* In the first looks: one cell of a view in FIRST, others in the next view, the same for all its pairs. */
static bool is_first(int cell, int view)
{
    return (cell % DRIFT_CELLS_X + 2 * (cell / DRIFT_CELLS_X) + view) % FIRST == 0;
}

/* The cells' best features, at half the coarsest size. */
static void match_best(struct drift_link *link, const struct drift_work *w, int level)
{
    const struct drift_pyramid *a = &w->view[link->a], *b = &w->view[link->b];
    const struct drift_views views = { a, b, &link->s };

    for (int k = 0; k < DRIFT_CELLS; k++) {
        struct drift_match *m = &link->m[k];

        m->outcome = DRIFT_AMBIGUOUS;
        link->feature[k] = a->first[k];
        if (a->first[k] == a->first[k + 1] || (w->stage == DRIFT_FIRST && !is_first(k, link->a)))
            continue;
        drift_search_match(m, &views, &a->feature[a->first[k]], level);
        if (m->outcome == DRIFT_FOUND)
            drift_refine_match(m, &views, &a->feature[a->first[k]], level);
    }
}

/* All features of a cell until one matches, at full size. */
static void match_cell(struct drift_link *link, const struct drift_work *w, int k)
{
    const struct drift_pyramid *a = &w->view[link->a], *b = &w->view[link->b];
    const struct drift_views views = { a, b, &link->s };

    for (int i = a->first[k]; link->m[k].outcome != DRIFT_FOUND && i < a->first[k + 1]; i++) {
        struct drift_match m;

        drift_search_match(&m, &views, &a->feature[i], 0);
        if (m.outcome == DRIFT_FOUND)
            drift_refine_match(&m, &views, &a->feature[i], 0);
        if (m.outcome != DRIFT_FOUND)
            continue;
        link->m[k] = m;
        link->feature[k] = i;
    }
}

/* Cells without a match, in a band about the matches found. Fine foliage is found only so. */
static void match_rest(struct drift_link *link, const struct drift_work *w)
{
    if (link->matches >= FEW) {
        link->s.across_px = link->median_px;
        link->s.band_px = fmin(fmax(NARROW_PX, 5 * link->spread_px), link->s.band_px);
    }
    for (int k = 0; k < DRIFT_CELLS; k++)
        match_cell(link, w, k);
}

/* Cells of the first look until there are some matches, where they are if nothing is displaced. */
static void match_some(struct drift_link *link, const struct drift_work *w)
{
    int n = link->matches;

    set_range(&link->s, link, w->range[0], w->range[1], NARROW_PX);
    link->s.across_px = 0;
    link->s.band_px = NARROW_PX;
    for (int k = 0; k < DRIFT_CELLS && n < SOME; k++) {
        if (!is_first(k, link->a) || link->m[k].outcome == DRIFT_FOUND)
            continue;
        match_cell(link, w, k);
        n += link->m[k].outcome == DRIFT_FOUND;
    }
    drift_link_judge(link, SST_DRIFT_LEAST_MATCHES);
}

static int best_job(void *arg, int index, int worker SST_UNUSED)
{
    struct job *job = arg;
    struct drift_work *w = job->w;
    struct drift_link *link = &w->link[index];
    const struct drift_pyramid *a = &w->view[link->a], *b = &w->view[link->b];

    if (skipped(job, index))
        return 0;
    set_range(&link->s, link, w->range[0], w->range[1], DRIFT_REACH * longer_side(w));
    if (w->stage == DRIFT_FIRST) {
        link->s.across_px = 0;
        link->s.band_px = BAND << job->search_level;
    }
    link->s.loose = w->cfg.loose;
    link->s.noise = 0.5 * (a->noise + b->noise) * w->noise_factor;
    match_best(link, w, job->search_level);
    return 0;
}

static int rest_job(void *arg, int index, int worker SST_UNUSED)
{
    struct job *job = arg;
    struct drift_work *w = job->w;
    struct drift_link *link = &w->link[index];
    const struct drift_pyramid *a = &w->view[link->a], *b = &w->view[link->b];

    if (skipped(job, index))
        return 0;
    if (w->stage == DRIFT_CLOSER) {
        match_some(link, w);
        return 0;
    }
    link->s.noise = 0.5 * (a->noise + b->noise) * w->noise_factor;
    for (int k = 0; k < DRIFT_CELLS; k++)
        drift_weigh_match(&link->m[k], &link->s);
    drift_link_judge(link, SST_DRIFT_LEAST_MATCHES);
    if (w->stage == DRIFT_FIRST || link->matches >= ENOUGH)
        return 0;
    match_rest(link, w);
    drift_link_judge(link, SST_DRIFT_LEAST_MATCHES);
    return 0;
}

/* Fine texture looks like noise in one picture, but not in the difference of two good matches: the best matches of all
 * show by how much the pictures' noise was overestimated. */
static int estimate_noise_factor(struct drift_work *w)
{
    double *v = malloc(((size_t)w->links * DRIFT_CELLS + 1) * sizeof(*v));
    int n = 0;

    if (!v)
        return -ENOMEM;
    for (int i = 0; i < w->links; i++) {
        const struct drift_link *l = &w->link[i];

        for (int k = 0; l->s.noise > 0 && k < DRIFT_CELLS; k++) {
            if (l->m[k].outcome == DRIFT_FOUND)
                v[n++] = l->m[k].residual / (DRIFT_NOISE_SHARE * l->s.noise * l->s.noise);
        }
    }
    if (n >= NOISE_LEAST)
        w->noise_factor = sqrt(fmin(1, NOISE_ROOM * sst_stats_quantile(v, n, NOISE_BEST)));
    free(v);
    return 0;
}

static void link_figures(struct drift_link *link, double *v)
{
    double sum = 0, squares = 0;
    int n = 0;

    for (int k = 0; k < DRIFT_CELLS; k++) {
        if (!link->used[k])
            continue;
        sum += link->m[k].across;
        squares += link->m[k].across * link->m[k].across;
        v[n++] = fabs(link->m[k].across);
    }
    link->mean_px = sum / n;
    link->rms_px = sqrt(squares / n);
    link->p95_px = sst_stats_quantile(v, n, 0.95);
}

void drift_link_judge(struct drift_link *link, int min_matches)
{
    double v[DRIFT_CELLS], cut;
    int n = 0;

    link->features = link->matches = 0;
    link->mean_px = link->rms_px = link->p95_px = link->median_px = link->spread_px = 0;
    for (int k = 0; k < DRIFT_CELLS; k++) {
        link->used[k] = false;
        link->features += link->m[k].outcome == DRIFT_FOUND || link->m[k].outcome == DRIFT_NOWHERE;
        if (link->m[k].outcome == DRIFT_FOUND)
            v[n++] = link->m[k].across;
    }
    if (n) {
        link->median_px = sst_stats_quantile(v, n, 0.5);
        for (int i = 0; i < n; i++)
            v[i] = fabs(v[i] - link->median_px);
        link->spread_px = 1.4826 * sst_stats_quantile(v, n, 0.5);
        cut = fmax(OUTLIER_PX, 5 * link->spread_px);
        for (int k = 0; k < DRIFT_CELLS; k++) {
            link->used[k] = link->m[k].outcome == DRIFT_FOUND && fabs(link->m[k].across - link->median_px) <= cut;
            link->matches += link->used[k];
        }
        link_figures(link, v);
    }
    /* Some matches, though too few to measure: the scene is hard, the pair is not lost. */
    if (link->matches >= min_matches)
        link->state = SST_DRIFT_PAIR_MEASURED;
    else if (link->features < min_matches || link->matches >= sst_max_int(FEW, link->features / 20))
        link->state = SST_DRIFT_PAIR_BLANK;
    else
        link->state = SST_DRIFT_PAIR_LOST;
}

bool drift_link_useful(const struct drift_link *link)
{
    return link->state != SST_DRIFT_PAIR_LOST && link->matches >= FEW;
}

bool drift_link_bad(const struct drift_link *link, double unusable_px)
{
    return link->state == SST_DRIFT_PAIR_LOST || (link->state == SST_DRIFT_PAIR_MEASURED && link->rms_px > unusable_px);
}

/* --- all pairs ---------------------------------------------------------------------------------------------------- */

static void vote_values(void *arg, int index, struct sst_share_maps *out)
{
    struct job *job = arg;

    sst_share_add_values(out, &job->w->link[index].s, sizeof(job->w->link[index].s));
    sst_share_add_values(out, job->vote + (size_t)index * VOTES, VOTES * sizeof(*job->vote));
    sst_share_add_values(out, &job->votes[index], sizeof(job->votes[index]));
}

static void link_values(void *arg, int index, struct sst_share_maps *out)
{
    struct job *job = arg;

    sst_share_add_values(out, &job->w->link[index], sizeof(job->w->link[index]));
}

/* Trials with some links only are made by each process. */
static int for_links(struct job *job, sst_work_fn *fn, sst_share_maps_fn *values)
{
    const struct drift_work *w = job->w;

    return sst_share_blocks(job->only ? NULL : w->cfg.share, w->links, sst_max_int(w->links / BLOCKS, 1),
                            w->cfg.threads, fn, job, values);
}

int drift_match_links(struct drift_work *w, const bool *only)
{
    const bool known = w->lf->range_max_px > w->lf->range_min_px;
    struct job job = { .w = w, .only = only };
    int err = 0;

    if (w->stage == DRIFT_CLOSER)
        return for_links(&job, rest_job, link_values);
    for (int v = 0; v < w->views; v++)
        job.vote_level = sst_max_int(job.vote_level, w->view[v].levels - 1);
    job.search_level = sst_max_int(job.vote_level - 1, 1);
    job.vote = calloc((size_t)w->links * VOTES + 1, sizeof(*job.vote));
    job.votes = calloc((size_t)w->links + 1, sizeof(*job.votes));
    if (!only) {
        w->range[0] = known ? w->lf->range_min_px : -UNKNOWN_REACH * longer_side(w);
        w->range[1] = known ? w->lf->range_max_px : UNKNOWN_REACH * longer_side(w);
    }
    if (!job.vote || !job.votes)
        err = -ENOMEM;
    else
        err = for_links(&job, vote_job, vote_values);
    if (!err && !known && !only)
        range_of_votes(&job);
    if (!only)
        w->noise_factor = 1;
    err = err ? err : for_links(&job, best_job, link_values);
    if (!err && !only)
        err = estimate_noise_factor(w);
    err = err ? err : for_links(&job, rest_job, link_values);
    free(job.vote);
    free(job.votes);
    return err;
}
