/*
 * The joint adjustment with libdogleg (Powell's dog leg, sparse).
 *
 * A detection of n corners has 2 n rows over at most 26 states. Its rows [J r] are compressed by a QR factorisation to
 * at most 21 before the sparse solver sees them: an orthogonal transform leaves J'J, J'r and |r|^2 as they are.
 */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "base/thread.h"
#include "pipeline/calibration/solve/solve_internal.h"

#if WITH_DOGLEG
#include <dogleg.h>

struct adjust {
    struct solve_problem *p;      /* as it is at the solver's point */
    struct solve_camera *camera0; /* initial cameras: rotations are relative to them */
    struct solve_frame *frame0;
    double warp0[2];
    struct solve_layout layout;
    double loss_px;
    int *row_at, *entry_at; /* [count + 1] first row and entry of each detection */
    int rows, entries, priors, most_corners, measurements, threads, evaluations;
    double *scratch;          /* [threads][2 most_corners][columns] */
    dogleg_parameters2_t how; /* the solver reads its limit again at every step */
    double best, least_gain;  /* best sum of squares; smaller relative gains do not count */
    int idle;                 /* evaluations since one counted */
    bool settled;
    const double *state;
    double *x; /* state of one evaluation */
    cholmod_sparse *jt;
};

static int compressed_entries(const struct solve_problem *p, const struct solve_spread *s)
{
    const int lens = p->keep_lens ? 0 : 4 + p->lens, poses = (s->pose >= 0 ? 6 : 0) + (s->frame >= 0 ? 6 : 0);
    const int warp = p->keep_warp ? 0 : 2;

    return lens * (lens + 1) / 2 + (lens + 6) * (poses + warp) + (warp ? 3 : 0);
}

static void count_rows(struct adjust *a)
{
    const struct solve_problem *p = a->p;

    for (int i = 0; i < p->count; i++) {
        const struct solve_detection *d = &p->detection[i];
        const struct solve_spread s = { .pose = a->layout.pose[d->view], .frame = 0 };

        a->row_at[i] = a->rows;
        a->entry_at[i] = a->entries;
        if (!d->used)
            continue;
        for (int c = 0; c < d->corners; c++)
            a->measurements += d->corner[c].out ? 0 : 2;
        a->most_corners = sst_max_int(a->most_corners, d->corners);
        a->rows += solve_block_columns(p);
        a->entries += compressed_entries(p, &s);
    }
    a->row_at[p->count] = a->rows;
    a->entry_at[p->count] = a->entries;
    a->priors = solve_priors(p, &a->layout, NULL, NULL, NULL);
    a->rows += a->priors;
    a->entries += a->priors;
}

static void move_pose(struct solve_pose *to, const struct solve_pose *from, const double *state, const double *scale,
                      double turn[3])
{
    double by[9];

    for (int i = 0; i < 3; i++)
        turn[i] = state[i] * scale[i];
    sst_rotation_from_vector(turn, by);
    sst_numbers_mul3(by, from->rotation, to->rotation);
    for (int i = 0; i < 3; i++)
        to->shift[i] = from->shift[i] + state[3 + i] * scale[3 + i];
}

/* Set the problem from the states. */
static void unpack(struct adjust *a, const double *state)
{
    const struct solve_layout *l = &a->layout;
    double turn[3];

    for (int v = 0; v < a->p->views; v++) {
        struct solve_camera *c = &a->p->camera[v];

        for (int i = 0; i < l->lens_size && l->lens[v] >= 0; i++)
            c->lens[i] = a->camera0[v].lens[i] + state[l->lens[v] + i] * l->scale[l->lens[v] + i];
        if (l->pose[v] >= 0)
            move_pose(&c->pose, &a->camera0[v].pose, state + l->pose[v], l->scale + l->pose[v], turn);
    }
    for (int f = 0; f < a->p->frames; f++) {
        if (l->frame[f] >= 0)
            move_pose(&a->p->frame[f].pose, &a->frame0[f].pose, state + l->frame[f], l->scale + l->frame[f], turn);
    }
    for (int i = 0; i < 2 && l->warp >= 0; i++)
        a->p->warp[i] = a->warp0[i] + state[l->warp + i] * l->scale[l->warp + i];
}

static void turn_of(const struct adjust *a, int at, double turn[3])
{
    for (int i = 0; i < 3; i++)
        turn[i] = at < 0 ? 0 : a->state[at + i] * a->layout.scale[at + i];
}

/* One detection's rows of x and columns of J^T. */
static int evaluate_one(void *arg, int index, int worker)
{
    struct adjust *a = arg;
    const struct solve_detection *d = &a->p->detection[index];
    const int n = solve_block_columns(a->p), first = a->row_at[index];
    double *rows = a->scratch + (size_t)worker * 2 * (size_t)a->most_corners * (size_t)n;
    int *at = (int *)a->jt->p, *state = (int *)a->jt->i, entry = a->entry_at[index], count;
    double *value = a->jt->x, turn_camera[3], turn_board[3];
    struct solve_spread s;
    struct solve_pose board;

    if (!d->used)
        return 0;
    solve_relative(a->p, d, &board);
    turn_of(a, a->layout.pose[d->view], turn_camera);
    turn_of(a, a->layout.frame[d->frame], turn_board);
    solve_spread_make(&s, a->p, &a->layout, d, (const double *[2]){ turn_camera, turn_board });
    count = solve_block(a->p, d, &board, a->loss_px, rows);
    if (count < n)
        memset(rows + (size_t)count * (size_t)n, 0, (size_t)(n - count) * (size_t)n * sizeof(*rows));
    solve_qr(rows, sst_max_int(count, n), n);
    for (int i = 0; i < n; i++) {
        const double *row = rows + (size_t)i * (size_t)n;

        at[first + i] = entry;
        a->x[first + i] = row[n - 1];
        entry += solve_spread_row(&s, row, i, state + entry, value + entry);
    }
    return 0;
}

/* Along weakly determined directions (a denominator near 0) the states keep moving while the sum of squares stays:
 * stop. */
static void stop_when_idle(struct adjust *a, const double *x)
{
    double cost = 0;

    for (int i = 0; i < a->rows; i++)
        cost += x[i] * x[i];
    a->idle = fabs(a->best - cost) <= a->least_gain * a->best ? a->idle + 1 : 0;
    a->best = fmin(a->best, cost);
    if (a->idle >= 2) {
        a->settled = true;
        a->how.max_iterations = 0;
    }
}

static void evaluate(const double *state, double *x, cholmod_sparse *jt, void *cookie)
{
    struct adjust *a = cookie;
    const int first = a->row_at[a->p->count];
    int *at = jt->p;

    unpack(a, state);
    a->state = state;
    a->x = x;
    a->jt = jt;
    a->evaluations++;
    if (sst_parallel_for(a->p->count, a->threads, evaluate_one, a))
        abort(); /* evaluate_one() cannot fail */
    solve_priors(a->p, &a->layout, (int *)jt->i + a->entry_at[a->p->count], (double *)jt->x + a->entry_at[a->p->count],
                 x + first);
    for (int i = 0; i <= a->priors; i++)
        at[first + i] = a->entry_at[a->p->count] + i;
    stop_when_idle(a, x);
}

static void adjust_fini(struct adjust *a)
{
    solve_layout_fini(&a->layout);
    free(a->camera0);
    free(a->frame0);
    free(a->row_at);
    free(a->entry_at);
    free(a->scratch);
}

static int adjust_init(struct adjust *a, struct solve_problem *p, double loss_px)
{
    const size_t columns = (size_t)solve_block_columns(p);
    int err;

    *a = (struct adjust){ .p = p, .loss_px = loss_px, .threads = sst_thread_count(p->threads) };
    memcpy(a->warp0, p->warp, sizeof(a->warp0));
    err = solve_layout_init(&a->layout, p);
    if (err)
        return err;
    a->camera0 = malloc((size_t)p->views * sizeof(*a->camera0));
    a->frame0 = malloc((size_t)p->frames * sizeof(*a->frame0));
    a->row_at = malloc(((size_t)p->count + 1) * sizeof(int));
    a->entry_at = malloc(((size_t)p->count + 1) * sizeof(int));
    if (!a->camera0 || !a->frame0 || !a->row_at || !a->entry_at)
        return -ENOMEM;
    memcpy(a->camera0, p->camera, (size_t)p->views * sizeof(*a->camera0));
    memcpy(a->frame0, p->frame, (size_t)p->frames * sizeof(*a->frame0));
    count_rows(a);
    if (!a->layout.states || !a->measurements)
        return -EDOM;
    a->scratch = malloc((size_t)a->threads * sizeof(double) * columns *
                        ((size_t)sst_max_int(2 * a->most_corners, (int)columns)));
    return a->scratch ? 0 : -ENOMEM;
}

int solve_adjust(struct solve_problem *p, const struct solve_adjust_config *cfg, struct solve_adjusted *out)
{
    struct adjust a;
    dogleg_solverContext_t *ctx = NULL;
    double *state = NULL, cost;
    int err = adjust_init(&a, p, cfg->loss_px);

    if (err)
        goto out;
    err = -ENOMEM;
    state = calloc((size_t)a.layout.states, sizeof(*state));
    if (!state)
        goto out;
    dogleg_getDefaultParameters(&a.how);
    a.how.max_iterations = cfg->max_iterations;
    a.how.update_threshold = cfg->tolerance;
    a.how.Jt_x_threshold = 0; /* absolute, hence meaningless where the noise is unknown */
    a.how.trustregion_threshold = cfg->tolerance * 1e-3;
    a.how.trustregion0 = 1e4;
    a.least_gain = cfg->tolerance * 1e-3;
    a.best = DBL_MAX;
    cost = dogleg_optimize2(state, (unsigned)a.layout.states, (unsigned)a.rows, (unsigned)a.entries, evaluate, &a,
                            &a.how, &ctx);
    err = -EDOM;
    if (!(cost >= 0) || !isfinite(cost) || !ctx)
        goto out;
    unpack(&a, state);
    dogleg_computeJtJfactorization(ctx->beforeStep, ctx);
    *out = (struct solve_adjusted){ .states = a.layout.states,
                                    .measurements = a.measurements,
                                    .evaluations = a.evaluations,
                                    .cost = cost,
                                    .rcond = cholmod_rcond(ctx->factorization, &ctx->common),
                                    .converged = a.settled || a.evaluations <= cfg->max_iterations };
    sst_log_debug("solve: %d states, %d measurements, %d coefficients: %.6g px^2 after %d evaluations", out->states,
                  out->measurements, p->lens, cost, out->evaluations);
    err = 0;
out:
    if (ctx)
        dogleg_freeContext(&ctx);
    free(state);
    adjust_fini(&a);
    return err;
}
#else
int solve_adjust(struct solve_problem *p, const struct solve_adjust_config *cfg, struct solve_adjusted *out)
{
    (void)p;
    (void)cfg;
    (void)out;
    return -ENOTSUP;
}
#endif
