/*
 * One detection's share of the normal equations: analytic derivatives, Cauchy's loss, and the compression of its rows.
 *
 * With p a point of the board, P = Rf p + tf in rig axes and q = Rc P + tc in the camera's, both poses move q like one
 * relative pose (R = Rc Rf, t = Rc tf + tc):
 *     dq = -[R p]x w + v            w, v: small rotation and shift of the board in front of the camera
 *     board:   w = Rc Jf df,  v = Rc dtf          Jf, Jc: left Jacobians of the rotations df, dc of the states
 *     camera:  w = Jc dc,     v = -[Rc tf]x Jc dc + dtc
 * so rows need 6 columns for both, and are spread to 12 after compression.
 */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <math.h>
#include <string.h>

#include "pipeline/calibration/solve/solve_internal.h"

/* Derivatives of a distorted point by the point before and by the coefficients. */
struct bend {
    double by[4], by_k[2][SST_LENS_MAX];
};

/* Distorted (u, v) before focal length and centre. @param bend  out, or NULL */
static void distort(const double *k, int coefficients, const double ab[2], double uv[2], struct bend *bend)
{
    const double a = ab[0], b = ab[1];
    const double r2 = a * a + b * b, r4 = r2 * r2, r6 = r4 * r2, ab2 = 2 * a * b;
    const double over = 1 + k[0] * r2 + k[1] * r4 + k[4] * r6;
    const double raw = 1 + k[5] * r2 + k[6] * r4 + k[7] * r6, under = fabs(raw) > 1e-6 ? raw : 1e-6;
    const double s = over / under, ta = r2 + 2 * a * a, tb = r2 + 2 * b * b;

    uv[0] = a * s + k[2] * ab2 + k[3] * ta;
    uv[1] = b * s + k[2] * tb + k[3] * ab2;
    if (bend) {
        double *by = bend->by, (*jk)[SST_LENS_MAX] = bend->by_k;
        const double d_over = k[0] + 2 * k[1] * r2 + 3 * k[4] * r4, d_under = k[5] + 2 * k[6] * r2 + 3 * k[7] * r4;
        const double slope = 2 * (d_over - s * d_under) / under; /* twice ds/d(r2) */
        const double radial[3] = { r2 / under, r4 / under, r6 / under };

        by[0] = s + a * a * slope + 2 * k[2] * b + 6 * k[3] * a;
        by[1] = by[2] = a * b * slope + 2 * k[2] * a + 2 * k[3] * b;
        by[3] = s + b * b * slope + 6 * k[2] * b + 2 * k[3] * a;
        if (coefficients >= 5) {
            jk[0][0] = a * radial[0], jk[1][0] = b * radial[0];
            jk[0][1] = a * radial[1], jk[1][1] = b * radial[1];
            jk[0][2] = ab2, jk[1][2] = tb;
            jk[0][3] = ta, jk[1][3] = ab2;
            jk[0][4] = a * radial[2], jk[1][4] = b * radial[2];
        }
        if (coefficients >= 8) {
            for (int i = 0; i < 3; i++)
                jk[0][5 + i] = -a * s * radial[i], jk[1][5 + i] = -b * s * radial[i];
        }
    }
}

void solve_see(const double *lens, int coefficients, const double q[3], double xy[2], struct solve_slopes *slopes)
{
    /* A step of the solver may move a corner beside the camera: the cost must be large, and finite. */
    const double least = 1e-3 * (fabs(q[0]) + fabs(q[1])) + 1e-9, z = fmax(q[2], least);
    const double ab[2] = { q[0] / z, q[1] / z };
    struct bend bend;
    double uv[2];

    distort(lens + 4, coefficients, ab, uv, slopes ? &bend : NULL);
    for (int i = 0; i < 2; i++)
        xy[i] = lens[i] * uv[i] + lens[2 + i];
    if (!slopes)
        return;
    for (int i = 0; i < 2; i++) {
        const double da = lens[i] * bend.by[2 * i] / z, db = lens[i] * bend.by[2 * i + 1] / z;

        slopes->q[i][0] = da;
        slopes->q[i][1] = db;
        slopes->q[i][2] = -(da * ab[0] + db * ab[1]);
        slopes->lens[i][i] = uv[i];
        slopes->lens[i][1 - i] = 0;
        slopes->lens[i][2 + i] = 1;
        slopes->lens[i][3 - i] = 0;
        for (int c = 0; c < coefficients; c++)
            slopes->lens[i][4 + c] = lens[i] * bend.by_k[i][c];
    }
}

struct sst_calib_camera solve_camera_of(const double *lens)
{
    struct sst_calib_camera cam = {
        .fx = lens[0], .fy = lens[1], .cx = lens[2], .cy = lens[3], .rotation = { 1, 0, 0, 0, 1, 0, 0, 0, 1 }
    };

    memcpy(cam.k, lens + 4, sizeof(cam.k));
    return cam;
}

void solve_corner_place(const struct solve_pose *board_to_camera, const struct solve_corner *c, const double warp[2],
                        double turned[3], double q[3])
{
    const double p[3] = { c->p[0], c->p[1], warp[0] * c->bulge[0] + warp[1] * c->bulge[1] };

    sst_numbers_apply3(board_to_camera->rotation, p, turned);
    for (int i = 0; i < 3; i++)
        q[i] = turned[i] + board_to_camera->shift[i];
}

int solve_block_columns(const struct solve_problem *p)
{
    return (p->keep_lens ? 0 : 4 + p->lens) + 6 + (p->keep_warp ? 0 : 2) + 1;
}

/*
 * Cauchy's loss c^2 log(1 + |r|^2 / c^2) as the square of a residual g(|r|) r / |r|, and the matrix that maps
 * derivatives of r to it: g' along r, g / |r| across.
 */
static void apply_loss(double r[2], double loss_px, double m[4])
{
    const double s2 = r[0] * r[0] + r[1] * r[1], t = s2 / (loss_px * loss_px);
    double ratio, slope; /* g / |r|, and (g' - g / |r|) / |r|^2 */

    if (t < 1e-6) {
        ratio = 1 - t / 4;
        slope = -0.5 / (loss_px * loss_px);
    } else {
        ratio = sqrt(log1p(t) / t);
        slope = (1 / ((1 + t) * ratio) - ratio) / s2;
    }
    m[0] = ratio + slope * r[0] * r[0];
    m[1] = m[2] = slope * r[0] * r[1];
    m[3] = ratio + slope * r[1] * r[1];
    r[0] *= ratio;
    r[1] *= ratio;
}

/* A corner in front of the camera: turned to its axes, its residual and derivatives, and their factors by the loss. */
struct corner_seen {
    const struct solve_corner *c;
    const double *normal; /* [3] of the board */
    double turned[3], r[2], m[4];
    struct solve_slopes slopes;
};

/* Two rows of derivatives, multiplied by m, and residual. */
static void fill_rows(const struct solve_problem *p, const struct corner_seen *s, double *row)
{
    const double *turned = s->turned, *normal = s->normal, *m = s->m;
    const int n = solve_block_columns(p), lens = p->keep_lens ? 0 : 4 + p->lens;
    double j[2][SOLVE_COLS_MAX];

    for (int i = 0; i < 2; i++) {
        double *to = j[i];

        for (int l = 0; l < lens; l++)
            *to++ = s->slopes.lens[i][l];
        /* -slopes.q [turned]x */
        solve_by_motion(s->slopes.q[i], turned, 1, to);
        to += 6;
        for (int l = 0; l < 2 && !p->keep_warp; l++)
            *to++ = s->c->bulge[l] *
                    (s->slopes.q[i][0] * normal[0] + s->slopes.q[i][1] * normal[1] + s->slopes.q[i][2] * normal[2]);
    }
    for (int l = 0; l < n - 1; l++) {
        row[l] = m[0] * j[0][l] + m[1] * j[1][l];
        row[n + l] = m[2] * j[0][l] + m[3] * j[1][l];
    }
    row[n - 1] = s->r[0];
    row[2 * n - 1] = s->r[1];
}

void solve_by_motion(const double by_point[3], const double at[3], double weight, double out[6])
{
    for (int i = 0; i < 3; i++) {
        const int j = (i + 1) % 3, k = (i + 2) % 3;

        out[i] = weight * (at[j] * by_point[k] - at[k] * by_point[j]);
        out[3 + i] = weight * by_point[i];
    }
}

int solve_block(const struct solve_problem *p, const struct solve_detection *d, const struct solve_pose *board,
                double loss_px, double *rows)
{
    const double *lens = p->camera[d->view].lens, *rot = board->rotation;
    const double normal[3] = { rot[2], rot[5], rot[8] };
    const int n = solve_block_columns(p);
    int count = 0;

    for (int i = 0; i < d->corners; i++) {
        const struct solve_corner *c = &d->corner[i];
        const double w = c->weight;
        struct corner_seen seen = { .c = c, .normal = normal, .m = { 1, 0, 0, 1 } };
        double q[3];

        if (c->out)
            continue;
        solve_corner_place(board, c, p->warp, seen.turned, q);
        solve_see(lens, p->lens, q, seen.r, &seen.slopes);
        seen.r[0] = w * (seen.r[0] - c->x);
        seen.r[1] = w * (seen.r[1] - c->y);
        if (loss_px > 0)
            apply_loss(seen.r, loss_px, seen.m);
        for (int k = 0; k < 4; k++)
            seen.m[k] *= w;
        fill_rows(p, &seen, rows + (size_t)count * (size_t)n);
        count += 2;
    }
    return count;
}

void solve_relative(const struct solve_problem *p, const struct solve_detection *d, struct solve_pose *out)
{
    solve_pose_chain(out, &p->camera[d->view].pose, &p->frame[d->frame].pose);
}

void solve_residuals(const struct solve_problem *p, const struct solve_detection *d, double (*out)[2])
{
    struct solve_pose board;

    solve_relative(p, d, &board);
    for (int i = 0; i < d->corners; i++) {
        double turned[3], q[3];

        solve_corner_place(&board, &d->corner[i], p->warp, turned, q);
        solve_see(p->camera[d->view].lens, p->lens, q, out[i], NULL);
        out[i][0] -= d->corner[i].x;
        out[i][1] -= d->corner[i].y;
    }
}
