/* One detection's share of the normal equations: analytic derivatives, Cauchy's loss, and the compression of its rows.
 *
 * With p a point of the board, P = Rf p + tf in rig axes and q = Rc P + tc in the camera's, both poses move q as one
 * relative pose (R = Rc Rf, t = Rc tf + tc) does:
 *     dq = -[R p]x w + v            w, v: small turn and shift of the board before the camera
 *     board:   w = Rc Jf df,  v = Rc dtf          Jf, Jc: left Jacobians of the turns df, dc that the states are
 *     camera:  w = Jc dc,     v = -[Rc tf]x Jc dc + dtc
 * so that rows need 6 columns for both, and are spread onto 12 after they were compressed.
 */
#include <math.h>
#include <string.h>

#include "pipeline/calibration/solve/solve_internal.h"

/* (u, v) before focal length and centre; by (a, b) and by the coefficients. */
static void bend(const double *k, int coefficients, double a, double b, double uv[2], double by[4],
                 double jk[2][SST_LENS_MAX])
{
    const double r2 = a * a + b * b, r4 = r2 * r2, r6 = r4 * r2, ab2 = 2 * a * b;
    const double over = 1 + k[0] * r2 + k[1] * r4 + k[4] * r6;
    const double raw = 1 + k[5] * r2 + k[6] * r4 + k[7] * r6, under = fabs(raw) > 1e-6 ? raw : 1e-6;
    const double s = over / under, ta = r2 + 2 * a * a, tb = r2 + 2 * b * b;

    uv[0] = a * s + k[2] * ab2 + k[3] * ta;
    uv[1] = b * s + k[2] * tb + k[3] * ab2;
    if (by) {
        const double d_over = k[0] + 2 * k[1] * r2 + 3 * k[4] * r4, d_under = k[5] + 2 * k[6] * r2 + 3 * k[7] * r4;
        const double slope = 2 * (d_over - s * d_under) / under; /* of s, by r2, twice */
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

void solve_see(const double *lens, int coefficients, const double q[3], double xy[2], double jq[2][3],
               double jl[2][SOLVE_LENS_MAX])
{
    /* A step of the solver may put a corner beside the camera: it must cost much, and be finite. */
    const double least = 1e-3 * (fabs(q[0]) + fabs(q[1])) + 1e-9, z = fmax(q[2], least);
    const double a = q[0] / z, b = q[1] / z;
    double uv[2], by[4], jk[2][SST_LENS_MAX];

    bend(lens + 4, coefficients, a, b, uv, jq ? by : NULL, jk);
    for (int i = 0; i < 2; i++)
        xy[i] = lens[i] * uv[i] + lens[2 + i];
    if (!jq)
        return;
    for (int i = 0; i < 2; i++) {
        const double da = lens[i] * by[2 * i] / z, db = lens[i] * by[2 * i + 1] / z;

        jq[i][0] = da;
        jq[i][1] = db;
        jq[i][2] = -(da * a + db * b);
        jl[i][i] = uv[i];
        jl[i][1 - i] = 0;
        jl[i][2 + i] = 1;
        jl[i][3 - i] = 0;
        for (int c = 0; c < coefficients; c++)
            jl[i][4 + c] = lens[i] * jk[i][c];
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

    solve_apply3(board_to_camera->rotation, p, turned);
    for (int i = 0; i < 3; i++)
        q[i] = turned[i] + board_to_camera->shift[i];
}

int solve_block_columns(const struct solve_problem *p)
{
    return (p->keep_lens ? 0 : 4 + p->lens) + 6 + (p->keep_warp ? 0 : 2) + 1;
}

/*
 * Cauchy's loss c^2 log(1 + |r|^2 / c^2) as the square of a residual g(|r|) r / |r|, and the matrix that carries
 * derivatives of r over to it: g' along r, g / |r| across.
 */
static void soften(double r[2], double loss_px, double m[4])
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

/* Two rows from derivatives and residual, those multiplied by m. */
static void fill_rows(const struct solve_problem *p, const struct solve_corner *c, const double m[4],
                      const double turned[3], const double normal[3], double jq[2][3], double jl[2][SOLVE_LENS_MAX],
                      const double r[2], double *row)
{
    const int n = solve_block_columns(p), lens = p->keep_lens ? 0 : 4 + p->lens;
    double j[2][SOLVE_COLS_MAX];

    for (int i = 0; i < 2; i++) {
        double *to = j[i];

        for (int l = 0; l < lens; l++)
            *to++ = jl[i][l];
        /* -jq [turned]x */
        *to++ = turned[1] * jq[i][2] - turned[2] * jq[i][1];
        *to++ = turned[2] * jq[i][0] - turned[0] * jq[i][2];
        *to++ = turned[0] * jq[i][1] - turned[1] * jq[i][0];
        for (int l = 0; l < 3; l++)
            *to++ = jq[i][l];
        for (int l = 0; l < 2 && !p->keep_warp; l++)
            *to++ = c->bulge[l] * (jq[i][0] * normal[0] + jq[i][1] * normal[1] + jq[i][2] * normal[2]);
    }
    for (int l = 0; l < n - 1; l++) {
        row[l] = m[0] * j[0][l] + m[1] * j[1][l];
        row[n + l] = m[2] * j[0][l] + m[3] * j[1][l];
    }
    row[n - 1] = r[0];
    row[2 * n - 1] = r[1];
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
        double turned[3], q[3], r[2], jq[2][3], jl[2][SOLVE_LENS_MAX], m[4] = { 1, 0, 0, 1 };

        if (c->out)
            continue;
        solve_corner_place(board, c, p->warp, turned, q);
        solve_see(lens, p->lens, q, r, jq, jl);
        r[0] = w * (r[0] - c->x);
        r[1] = w * (r[1] - c->y);
        if (loss_px > 0)
            soften(r, loss_px, m);
        for (int k = 0; k < 4; k++)
            m[k] *= w;
        fill_rows(p, c, m, turned, normal, jq, jl, r, rows + (size_t)count * (size_t)n);
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
        solve_see(p->camera[d->view].lens, p->lens, q, out[i], NULL, NULL);
        out[i][0] -= d->corner[i].x;
        out[i][1] -= d->corner[i].y;
    }
}
