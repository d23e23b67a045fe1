/* Propagation of corner noise: covariance of the cameras, and from it the uncertainty of pixels. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/thread.h"
#include "pipeline/calibration/solve/solve_internal.h"

#define BOARD 6 /* states of one board */

/* One detection's contribution to the normal matrix. */
struct share {
    int n, state[SOLVE_COLS_MAX + 6];
    double m[SOLVE_COLS_MAX + 6][SOLVE_COLS_MAX + 6];
};

struct build {
    const struct solve_problem *p;
    struct solve_layout layout;
    struct share *share; /* [views]: of one frame */
    const struct solve_detection **at;
    int size;
    double *s;    /* [size][size], lower */
    double *side; /* [BOARD][size]: board by camera states of one frame */
};

/* Camera states keep their indices, the warp follows, boards are -1 .. -6. */
static int place(const struct build *b, int state)
{
    if (state < b->layout.camera_states)
        return state;
    if (b->layout.warp >= 0 && state >= b->layout.warp)
        return b->layout.camera_states + state - b->layout.warp;
    return -1 - (state - b->layout.camera_states) % BOARD;
}

static void share_of(struct build *b, const struct solve_detection *d, struct share *out, double *rows)
{
    const int n = solve_block_columns(b->p);
    struct solve_pose board;
    struct solve_spread spread;
    int count;

    solve_relative(b->p, d, &board);
    solve_spread_make(&spread, b->p, &b->layout, d, NULL);
    count = solve_block(b->p, d, &board, 0, rows);
    solve_qr(rows, count, n);
    out->n = 0;
    memset(out->m, 0, sizeof(out->m));
    for (int i = 0; i < count && i < n - 1; i++) {
        double value[SOLVE_COLS_MAX + 6];
        int state[SOLVE_COLS_MAX + 6];
        const int got = solve_spread_row(&spread, rows + (size_t)i * (size_t)n, i, state, value);
        int first;

        if (!i) {
            out->n = got;
            memcpy(out->state, state, (size_t)got * sizeof(*state));
        }
        /* Later rows are suffixes of the first, as the lens's columns drop out, or of the warp's. */
        first = out->n - got;
        for (int x = 0; x < got; x++) {
            for (int y = 0; y < got; y++)
                out->m[first + x][first + y] += value[x] * value[y];
        }
    }
}

static int share_work(void *arg, int index, int worker SST_UNUSED)
{
    struct build *b = arg;
    const struct solve_detection *d = b->at[index];
    double *rows;

    if (!d)
        return 0;
    rows = malloc((size_t)(2 * d->corners + SOLVE_COLS_MAX) * SOLVE_COLS_MAX * sizeof(*rows));
    if (!rows)
        return -ENOMEM;
    share_of(b, d, &b->share[index], rows);
    free(rows);
    return 0;
}

/* S -= E' C^-1 E, side being E and c the Cholesky factor of C. */
static void eliminate(struct build *b, const double c[BOARD * BOARD])
{
    const size_t size = (size_t)b->size;

    /* side becomes L^-1 E */
    for (int r = 0; r < BOARD; r++) {
        double *row = b->side + (size_t)r * size;

        for (int k = 0; k < r; k++) {
            for (size_t j = 0; j < size; j++)
                row[j] -= c[r * BOARD + k] * b->side[(size_t)k * size + j];
        }
        for (size_t j = 0; j < size; j++)
            row[j] /= c[r * BOARD + r];
    }
    for (int r = 0; r < BOARD; r++) {
        const double *row = b->side + (size_t)r * size;

        for (size_t i = 0; i < size; i++) {
            for (size_t j = 0; j <= i && row[i] != 0; j++)
                b->s[i * size + j] -= row[i] * row[j];
        }
    }
}

/* Add a frame with its board eliminated: S += A - E' C^-1 E. */
static void add_frame(struct build *b)
{
    const size_t size = (size_t)b->size;
    double c[BOARD * BOARD] = { 0 };

    for (int v = 0; v < b->p->views; v++) {
        const struct share *h = &b->share[v];

        for (int x = 0; b->at[v] && x < h->n; x++) {
            const int i = place(b, h->state[x]);

            for (int y = 0; y < h->n && i < 0; y++) {
                const int j = place(b, h->state[y]);

                if (j < 0)
                    c[(-1 - i) * BOARD - 1 - j] += h->m[x][y];
            }
        }
    }
    if (!solve_cholesky(c, BOARD))
        return; /* an undetermined board contributes nothing */
    memset(b->side, 0, BOARD * size * sizeof(*b->side));
    for (int v = 0; v < b->p->views; v++) {
        const struct share *h = &b->share[v];

        for (int x = 0; b->at[v] && x < h->n; x++) {
            const int i = place(b, h->state[x]);

            for (int y = 0; y < h->n; y++) {
                const int j = place(b, h->state[y]);

                if (i < 0 && j >= 0)
                    b->side[(size_t)(-1 - i) * size + (size_t)j] += h->m[x][y];
                else if (i >= 0 && j >= 0 && j <= i)
                    b->s[(size_t)i * size + (size_t)j] += h->m[x][y];
            }
        }
    }
    eliminate(b, c);
}

static int build_normal(struct build *b)
{
    const struct solve_problem *p = b->p;

    for (int first = 0, next; first < p->count; first = next) {
        int err, any = 0;

        memset(b->at, 0, (size_t)p->views * sizeof(*b->at));
        for (next = first; next < p->count && p->detection[next].frame == p->detection[first].frame; next++) {
            if (p->detection[next].used) {
                b->at[p->detection[next].view] = &p->detection[next];
                any = 1;
            }
        }
        if (!any)
            continue;
        err = sst_parallel_for(p->views, sst_thread_count(p->threads), share_work, b);
        if (err)
            return err;
        add_frame(b);
    }
    return 0;
}

static int add_priors(struct build *b)
{
    const size_t most = (size_t)(2 + 3 * b->p->views);
    int *state = malloc(most * sizeof(*state)), n;
    double *value = malloc(2 * most * sizeof(*value));

    if (!state || !value) {
        free(state);
        free(value);
        return -ENOMEM;
    }
    n = solve_priors(b->p, &b->layout, state, value, value + most);
    for (int i = 0; i < n; i++) {
        const size_t at = (size_t)place(b, state[i]);

        b->s[at * (size_t)b->size + at] += value[i] * value[i];
    }
    free(state);
    free(value);
    return 0;
}

int solve_covariances(struct solve_covariance *out, const struct solve_problem *p, double sigma_px)
{
    struct build b = { .p = p };
    double *work = NULL;
    int err = solve_layout_init(&b.layout, p);

    if (err)
        return err;
    b.size = b.layout.camera_states + (b.layout.warp >= 0 ? 2 : 0);
    b.s = calloc((size_t)b.size * (size_t)b.size + 1, sizeof(*b.s));
    b.side = malloc((BOARD * (size_t)b.size + 1) * sizeof(*b.side));
    b.share = malloc((size_t)p->views * sizeof(*b.share));
    b.at = malloc((size_t)p->views * sizeof(*b.at));
    work = malloc((size_t)(b.size + 1) * sizeof(*work));
    err = b.s && b.side && b.share && b.at && work ? build_normal(&b) : -ENOMEM;
    err = err ? err : add_priors(&b);
    if (!err && !solve_cholesky(b.s, b.size))
        err = -EDOM;
    if (!err) {
        solve_cholesky_inverse(b.s, b.size, work);
        for (int i = 0; i < b.size; i++) {
            for (int j = 0; j < b.size; j++) {
                const int warp = b.layout.warp - b.layout.camera_states;
                const double u = b.layout.scale[i < b.layout.camera_states ? i : i + warp];
                const double v = b.layout.scale[j < b.layout.camera_states ? j : j + warp];

                b.s[(size_t)i * (size_t)b.size + (size_t)j] *= sigma_px * sigma_px * u * v;
            }
        }
        *out = (struct solve_covariance){ .layout = b.layout, .size = b.size, .m = b.s };
        b.layout = (struct solve_layout){ 0 };
        b.s = NULL;
    }
    solve_layout_fini(&b.layout);
    free(b.s);
    free(b.side);
    free(b.share);
    free(b.at);
    free(work);
    return err;
}

void solve_covariance_fini(struct solve_covariance *c)
{
    solve_layout_fini(&c->layout);
    free(c->m);
    *c = (struct solve_covariance){ 0 };
}

double solve_unit_sigma(const struct solve_adjusted *done)
{
    return sqrt(done->cost / fmax(done->measurements - done->states, 1));
}

/* Centre of a cell of the maps. */
static void cell_pixel(const struct solve_problem *p, int row, int col, double xy[2])
{
    xy[0] = (col + 0.5) / SST_UNCERTAINTY_COLS * p->width - 0.5;
    xy[1] = (row + 0.5) / SST_UNCERTAINTY_ROWS * p->height - 0.5;
}

static bool cell_inside(const struct solve_problem *p, const double xy[2], double share)
{
    return fabs(2 * (xy[0] + 0.5) / p->width - 1) <= share && fabs(2 * (xy[1] + 0.5) / p->height - 1) <= share;
}

static bool direction(const double *lens, double x, double y, double q[3])
{
    const struct sst_calib_camera cam = solve_camera_of(lens);

    q[2] = 1;
    return sst_camera_undistort(&cam, x, y, &q[0], &q[1]);
}

/* Variance of a linear function of states. */
static double variance(const struct solve_covariance *c, const double *j, const int *state, int n)
{
    double sum = 0;

    for (int a = 0; a < n; a++) {
        for (int b = 0; b < n; b++)
            sum += j[a] * j[b] * c->m[(size_t)state[a] * (size_t)c->size + (size_t)state[b]];
    }
    return fmax(sum, 0);
}

/* The rotation that best compensates each of the lens's states over all cells: rotation = -coefficient times state. */
static bool shared_turn(const struct solve_problem *p, const double *lens, double share, double turn[3][SOLVE_LENS_MAX])
{
    double a[9] = { 0 }, g[3][SOLVE_LENS_MAX] = { 0 };

    for (int cell = 0; cell < SST_UNCERTAINTY_ROWS * SST_UNCERTAINTY_COLS; cell++) {
        double xy[2], q[3], seen[2], jw[6];
        struct solve_slopes slopes;

        cell_pixel(p, cell / SST_UNCERTAINTY_COLS, cell % SST_UNCERTAINTY_COLS, xy);
        if (!cell_inside(p, xy, share) || !direction(lens, xy[0], xy[1], q))
            continue;
        solve_see(lens, p->lens, q, seen, &slopes);
        for (int k = 0; k < 2; k++) {
            solve_by_motion(slopes.q[k], q, 1, jw);
            for (int i = 0; i < 3; i++) {
                for (int j = 0; j < 3; j++)
                    a[3 * i + j] += jw[i] * jw[j];
                for (int l = 0; l < 4 + p->lens; l++)
                    g[i][l] += jw[i] * slopes.lens[k][l];
            }
        }
    }
    if (!solve_cholesky(a, 3))
        return false;
    for (int l = 0; l < 4 + p->lens; l++) {
        double x[3] = { g[0][l], g[1][l], g[2][l] };

        sst_numbers_substitute(a, 3, x);
        for (int i = 0; i < 3; i++)
            turn[i][l] = x[i];
    }
    return true;
}

void solve_lens_map(const struct solve_problem *p, const struct solve_covariance *c, int view, double share,
                    float map[SST_UNCERTAINTY_ROWS][SST_UNCERTAINTY_COLS])
{
    const double *lens = p->camera[view].lens;
    const int first = c->layout.lens[view], n = first >= 0 ? 4 + p->lens : 0;
    double turn[3][SOLVE_LENS_MAX];
    int state[SOLVE_LENS_MAX];
    const bool fine = shared_turn(p, lens, share, turn);

    for (int l = 0; l < n; l++)
        state[l] = first + l;
    for (int row = 0; row < SST_UNCERTAINTY_ROWS; row++) {
        for (int col = 0; col < SST_UNCERTAINTY_COLS; col++) {
            double xy[2], q[3], seen[2], jw[6], sum = 0;
            struct solve_slopes slopes;

            map[row][col] = NAN;
            cell_pixel(p, row, col, xy);
            if (!fine || !cell_inside(p, xy, share) || !direction(lens, xy[0], xy[1], q))
                continue;
            solve_see(lens, p->lens, q, seen, &slopes);
            for (int k = 0; k < 2; k++) {
                solve_by_motion(slopes.q[k], q, 1, jw);
                for (int l = 0; l < n; l++)
                    slopes.lens[k][l] -= jw[0] * turn[0][l] + jw[1] * turn[1][l] + jw[2] * turn[2][l];
                sum += variance(c, slopes.lens[k], state, n);
            }
            map[row][col] = (float)sqrt(sum / 2);
        }
    }
}

/* Transfer of a reference pixel to a view: derivatives by the reference's lens, the view's lens and its pose. */
static bool transfer(const struct solve_problem *p, int view, double depth_mm, const double xy[2],
                     double j[2][2 * SOLVE_LENS_MAX + 6])
{
    const double *lens0 = p->camera[p->reference].lens, *lens = p->camera[view].lens;
    const struct solve_pose *pose = &p->camera[view].pose;
    const double z = depth_mm > 0 ? depth_mm : 1, move = depth_mm > 0;
    const int n = 4 + p->lens;
    double ab[3], X[3], turned[3], q[3], seen[2];
    struct solve_slopes slopes;
    struct solve_slopes first;
    double det;

    if (!direction(lens0, xy[0], xy[1], ab))
        return false;
    solve_see(lens0, p->lens, ab, seen, &first);
    det = first.q[0][0] * first.q[1][1] - first.q[0][1] * first.q[1][0];
    for (int i = 0; i < 3; i++)
        X[i] = z * ab[i];
    sst_numbers_apply3(pose->rotation, X, turned);
    for (int i = 0; i < 3; i++)
        q[i] = turned[i] + move * pose->shift[i];
    solve_see(lens, p->lens, q, seen, &slopes);
    if (!(q[2] > 0) || seen[0] < -0.5 || seen[1] < -0.5 || seen[0] > p->width - 0.5 || seen[1] > p->height - 0.5 ||
        !(fabs(det) > 0))
        return false;
    for (int k = 0; k < 2; k++) {
        double jab[2], back[2];

        for (int i = 0; i < 2; i++)
            jab[i] = z * (slopes.q[k][0] * pose->rotation[i] + slopes.q[k][1] * pose->rotation[3 + i] +
                          slopes.q[k][2] * pose->rotation[6 + i]);
        /* (a, b) moves by -first.q^-1 first.lens when the lens does and the pixel stays */
        back[0] = (jab[0] * first.q[1][1] - jab[1] * first.q[1][0]) / det;
        back[1] = (jab[1] * first.q[0][0] - jab[0] * first.q[0][1]) / det;
        for (int l = 0; l < n; l++) {
            j[k][l] = -(back[0] * first.lens[0][l] + back[1] * first.lens[1][l]);
            j[k][n + l] = slopes.lens[k][l];
        }
        solve_by_motion(slopes.q[k], turned, 1, &j[k][2 * n]);
        for (int i = 0; i < 3; i++)
            j[k][2 * n + 3 + i] *= move;
    }
    return true;
}

void solve_transfer_map(const struct solve_problem *p, const struct solve_covariance *c, int view, double depth_mm,
                        float map[SST_UNCERTAINTY_ROWS][SST_UNCERTAINTY_COLS])
{
    const int n = 4 + p->lens, from[3] = { c->layout.lens[p->reference], c->layout.lens[view], c->layout.pose[view] };
    int state[2 * SOLVE_LENS_MAX + 6], at[2 * SOLVE_LENS_MAX + 6], count = 0;

    for (int i = 0; i < 2 * n + 6; i++) {
        const int part = i < n ? 0 : i < 2 * n ? 1 : 2;

        if (from[part] >= 0 && view != p->reference) {
            at[count] = i;
            state[count++] = from[part] + i - part * n;
        }
    }
    for (int row = 0; row < SST_UNCERTAINTY_ROWS; row++) {
        for (int col = 0; col < SST_UNCERTAINTY_COLS; col++) {
            double xy[2], j[2][2 * SOLVE_LENS_MAX + 6], used[2 * SOLVE_LENS_MAX + 6], sum = 0;

            cell_pixel(p, row, col, xy);
            if (!transfer(p, view, depth_mm, xy, j)) {
                map[row][col] = NAN;
                continue;
            }
            for (int k = 0; k < 2; k++) {
                for (int i = 0; i < count; i++)
                    used[i] = j[k][at[i]];
                sum += variance(c, used, state, count);
            }
            map[row][col] = (float)sqrt(sum / 2);
        }
    }
}

double sst_uncertainty_rms(const float (*map)[SST_UNCERTAINTY_COLS])
{
    double sum = 0;
    int n = 0;

    for (int i = 0; map && i < SST_UNCERTAINTY_ROWS * SST_UNCERTAINTY_COLS; i++) {
        const double v = (double)map[i / SST_UNCERTAINTY_COLS][i % SST_UNCERTAINTY_COLS];

        if (isfinite(v)) {
            sum += v * v;
            n++;
        }
    }
    return n ? sqrt(sum / n) : (double)NAN;
}
