/*
 * The common geometry of an array: plane and lattice of the centres, one rotation, one K.
 *
 * In rectified axes (z normal to the plane of the centres, x along the rows, origin at the reference camera) a point P
 * is seen from the centre c = (bx B, by B, dz) at x = cx + s f (P.x - bx B) / (P.z - dz), and from the reference at
 * x_ref = cx + f P.x / P.z. With dz = 0 and s = 1 that is x = x_ref - bx d, d = f B / P.z, for every P. A centre off
 * the plane magnifies by P.z / (P.z - dz); s = (plane - dz) / plane compensates this exactly where P.z = plane;
 * elsewhere r dz (1 / P.z - 1 / plane) remains at r px from the principal point.
 */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <string.h>

#include "base/border.h"
#include "base/log.h"
#include "pipeline/lightfield/rectify/rectify.h"

#define STEP_SHARE_MAX 0.5                 /* of a step: a centre farther from its position is nearer to another one */
#define SWAP_SHARE_MAX 0.25                /* the same limit with a pair of cameras exchanged */
#define TILT_COS_MIN   0.70710678118654752 /* of the angle between normal and mean viewing direction: 45 degrees */
#define AWAY_COS_MIN   0.5                 /* between one camera's direction and the mean: 60 degrees */

/* The known cameras. */
struct centres {
    int n;
    int view[SST_MAX_VIEWS];
    int row[SST_MAX_VIEWS], col[SST_MAX_VIEWS];
    double at[SST_MAX_VIEWS][3]; /* mm, rig axes */
    double mean_axis[3][3];      /* x, y, z of all cameras, unit length */
};

/* Centre (row, col) is at origin + col step[0] + row step[1]; a step is 0 where all cameras share a column or row. */
struct lattice {
    double origin[3], step[2][3];
    bool across, down; /* cameras in more than one column, row */
};

static double dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void cross(double out[3], const double a[3], const double b[3])
{
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

static double length(const double a[3])
{
    return sqrt(dot(a, a));
}

/* @return false: the vector is 0 */
static bool unit(double a[3])
{
    const double l = length(a);

    if (!(l > 0))
        return false;
    for (int i = 0; i < 3; i++)
        a[i] /= l;
    return true;
}

/* a less its part along the unit vector n, to unit length. */
static bool unit_across(double a[3], const double n[3])
{
    const double along = dot(a, n);

    for (int i = 0; i < 3; i++)
        a[i] -= along * n[i];
    return unit(a);
}

#define refused(...) (sst_log_error("cannot rectify: " __VA_ARGS__), -EBADMSG)

static const char *name_of(const struct sst_calib *calib, int view)
{
    return calib->camera[view].name[0] ? calib->camera[view].name : "(no name)";
}

static int collect(struct centres *c, const struct sst_calib *calib)
{
    const char *fault = sst_calib_fault(calib);

    if (fault)
        return refused("invalid calibration: %s; calibrate again", fault);
    memset(c, 0, sizeof(*c));
    for (int k = 0; k < calib->rows * calib->cols; k++) {
        const struct sst_calib_camera *cam = &calib->camera[k];

        if (!cam->known)
            continue;
        c->view[c->n] = k;
        c->row[c->n] = k / calib->cols;
        c->col[c->n] = k % calib->cols;
        memcpy(c->at[c->n++], cam->position_mm, sizeof(cam->position_mm));
        for (int i = 0; i < 9; i++)
            c->mean_axis[i / 3][i % 3] += cam->rotation[i];
    }
    if (c->n < 2)
        return refused("the calibration has only one camera, and a light field needs two");
    for (int i = 0; i < 3; i++) {
        if (!unit(c->mean_axis[i]))
            return refused("the cameras point in opposite directions; correct their places in the grid");
    }
    return 0;
}

/* Least squares over all centres; sums of whole numbers are exact. @return false: all cameras on one diagonal of the
 * grid, which does not determine the steps */
static bool fit_lattice(struct lattice *l, const struct centres *c)
{
    double mean[3] = { 0 }, row = 0, col = 0, rr = 0, cc = 0, rc = 0, r_at[3] = { 0 }, c_at[3] = { 0 }, det;

    for (int i = 0; i < c->n; i++) {
        row += c->row[i];
        col += c->col[i];
        for (int j = 0; j < 3; j++)
            mean[j] += c->at[i][j] / c->n;
    }
    for (int i = 0; i < c->n; i++) { /* indices times n: whole numbers */
        const double dr = c->row[i] * c->n - row, dc = c->col[i] * c->n - col;

        rr += dr * dr;
        cc += dc * dc;
        rc += dr * dc;
        for (int j = 0; j < 3; j++) {
            r_at[j] += dr * (c->at[i][j] - mean[j]);
            c_at[j] += dc * (c->at[i][j] - mean[j]);
        }
    }
    *l = (struct lattice){ .across = cc > 0, .down = rr > 0 };
    det = rr * cc - rc * rc;
    if (l->across && l->down && !(det > 0))
        return false;
    for (int j = 0; j < 3; j++) {
        l->step[0][j] = !l->across ? 0 : l->down ? c->n * ((c_at[j] * rr - r_at[j] * rc) / det) : c->n * c_at[j] / cc;
        l->step[1][j] = !l->down ? 0 : l->across ? c->n * ((r_at[j] * cc - c_at[j] * rc) / det) : c->n * r_at[j] / rr;
        l->origin[j] = mean[j] - (col * l->step[0][j] + row * l->step[1][j]) / c->n;
    }
    return true;
}

static double shortest_step(const struct lattice *l)
{
    const double a = length(l->step[0]), b = length(l->step[1]);

    return !l->across ? b : !l->down ? a : fmin(a, b);
}

static void residual(double out[3], const struct lattice *l, const struct centres *c, int i)
{
    for (int j = 0; j < 3; j++)
        out[j] = c->at[i][j] - l->origin[j] - c->col[i] * l->step[0][j] - c->row[i] * l->step[1][j];
}

/* The centre farthest from its lattice position. */
static int worst_centre(const struct lattice *l, const struct centres *c, double *mm)
{
    int worst = 0;

    *mm = 0;
    for (int i = 0; i < c->n; i++) {
        double r[3];

        residual(r, l, c, i);
        if (length(r) > *mm) {
            *mm = length(r);
            worst = i;
        }
    }
    return worst;
}

/* Check that columns run to the right and rows down as seen by the cameras. @return NULL, or the fault. Arrays mounted
 * upside down pass, since both are reversed; a single row or column cannot be checked. */
static const char *mirrored(const struct lattice *l, const struct centres *c)
{
    const double *x = c->mean_axis[0], *y = c->mean_axis[1], *z = c->mean_axis[2];
    double normal[3];

    if (!l->down) {
        cross(normal, z, l->step[0]);
        return dot(normal, y) > 0 ? NULL : "columns run from right to left";
    }
    if (!l->across) {
        cross(normal, l->step[1], z);
        return dot(normal, x) > 0 ? NULL : "rows run from the bottom up";
    }
    cross(normal, l->step[0], l->step[1]);
    if (dot(normal, z) > 0)
        return NULL;
    if (dot(l->step[0], x) < 0 && dot(l->step[1], y) > 0)
        return "columns run from right to left";
    if (dot(l->step[0], x) > 0 && dot(l->step[1], y) < 0)
        return "rows run from the bottom up";
    return "rows and columns are exchanged";
}

/* A lattice with steps less than 30 degrees apart. */
static bool one_line(const struct lattice *l)
{
    double n[3];

    cross(n, l->step[0], l->step[1]);
    return l->across && l->down && !(length(n) > 0.5 * length(l->step[0]) * length(l->step[1]));
}

static bool regular(const struct lattice *l, const struct centres *c, double share)
{
    double mm;

    worst_centre(l, c, &mm);
    return mm <= share * shortest_step(l);
}

static void swap_centres(struct centres *c, int i, int j)
{
    double at[3];

    memcpy(at, c->at[i], sizeof(at));
    memcpy(c->at[i], c->at[j], sizeof(at));
    memcpy(c->at[j], at, sizeof(at));
}

/* The best pair of cameras that, exchanged, gives a lattice. */
static bool find_swap(struct centres *c, int *a, int *b)
{
    double best = INFINITY;

    for (int i = 0; i < c->n; i++) {
        for (int j = i + 1; j < c->n; j++) {
            struct lattice l;
            double mm;

            swap_centres(c, i, j);
            if (fit_lattice(&l, c) && !mirrored(&l, c) && regular(&l, c, SWAP_SHARE_MAX)) {
                worst_centre(&l, c, &mm);
                if (mm < best) {
                    best = mm;
                    *a = i;
                    *b = j;
                }
            }
            swap_centres(c, i, j);
        }
    }
    return best < INFINITY;
}

static int refuse_order(const struct sst_calib *calib, struct centres *c, const struct lattice *l)
{
    double mm;
    int a = 0, b = 0;

    if (find_swap(c, &a, &b))
        return refused("cameras %s (row %d, column %d) and %s (row %d, column %d) are swapped: each is at the "
                       "other's place; swap them in the configuration and calibrate again",
                       name_of(calib, c->view[a]), c->row[a], c->col[a], name_of(calib, c->view[b]), c->row[b],
                       c->col[b]);
    a = worst_centre(l, c, &mm);
    return refused(
        "the centres do not form a regular grid: camera %s (row %d, column %d) is %.1f mm off its place, the steps "
        "are %.1f and %.1f mm; correct the cameras' places in the grid or calibrate again",
        name_of(calib, c->view[a]), c->row[a], c->col[a], mm, length(l->step[0]), length(l->step[1]));
}

/* Eigenvector of the smallest eigenvalue of a symmetric matrix, by Jacobi's rotations. */
static void smallest_direction(double m[3][3], double out[3])
{
    double v[3][3] = { { 1, 0, 0 }, { 0, 1, 0 }, { 0, 0, 1 } }; /* columns */
    int smallest = 0;

    for (int sweep = 0; sweep < 30; sweep++) {
        for (int p = 0; p < 2; p++) {
            for (int q = p + 1; q < 3; q++) {
                const double angle = 0.5 * atan2(2 * m[p][q], m[q][q] - m[p][p]), c = cos(angle), s = sin(angle);

                for (int i = 0; i < 3; i++) { /* columns, then rows */
                    const double a = m[i][p], b = m[i][q], d = v[i][p], e = v[i][q];

                    m[i][p] = c * a - s * b;
                    m[i][q] = s * a + c * b;
                    v[i][p] = c * d - s * e;
                    v[i][q] = s * d + c * e;
                }
                for (int i = 0; i < 3; i++) {
                    const double a = m[p][i], b = m[q][i];

                    m[p][i] = c * a - s * b;
                    m[q][i] = s * a + c * b;
                }
            }
        }
    }
    for (int i = 1; i < 3; i++) {
        if (m[i][i] < m[smallest][smallest])
            smallest = i;
    }
    for (int i = 0; i < 3; i++)
        out[i] = v[i][smallest];
}

/* Total least squares: the direction of least variance of the centres. */
static void plane_normal(const struct centres *c, double normal[3])
{
    double mean[3] = { 0 }, scatter[3][3] = { { 0 } };

    for (int i = 0; i < c->n; i++) {
        for (int j = 0; j < 3; j++)
            mean[j] += c->at[i][j] / c->n;
    }
    for (int i = 0; i < c->n; i++) {
        for (int j = 0; j < 9; j++)
            scatter[j / 3][j % 3] += (c->at[i][j / 3] - mean[j / 3]) * (c->at[i][j % 3] - mean[j % 3]);
    }
    smallest_direction(scatter, normal);
}

/* Rectified x, y and z in rig axes, the rows of the common rotation. */
static int choose_axes(double r[9], const struct centres *c, const struct lattice *l)
{
    double *x = r, *y = r + 3, *z = r + 6;
    bool good = true;

    if (l->across && l->down) {
        plane_normal(c, z);
        if (dot(z, c->mean_axis[2]) < 0) {
            for (int i = 0; i < 3; i++)
                z[i] = -z[i];
        }
        memcpy(x, l->step[0], 3 * sizeof(*x));
        good = unit_across(x, z);
    } else {
        double *along = l->across ? x : y;

        memcpy(along, l->step[l->across ? 0 : 1], 3 * sizeof(*along));
        memcpy(z, c->mean_axis[2], 3 * sizeof(*z));
        good = unit(along) && unit_across(z, along);
        if (!l->across)
            cross(x, y, z);
    }
    if (!good || dot(z, c->mean_axis[2]) < TILT_COS_MIN)
        return refused("the cameras point %.0f degrees away from the normal of the plane of their centres; more "
                       "than 45 cannot form a light field",
                       acos(sst_clamp_double(good ? dot(z, c->mean_axis[2]) : 0, -1, 1)) * 180 / M_PI);
    cross(y, z, x);
    return 0;
}

/* Multiply by a rotation. */
static void turn(double out[3], const double r[9], const double v[3])
{
    for (int i = 0; i < 3; i++)
        out[i] = dot(r + 3 * i, v);
}

/* Measure the distances of the centres from plane and lattice. */
static void measure(struct sst_rectified *to, const struct centres *c, const struct lattice *l)
{
    double step[2][3], mean = 0, out2 = 0, in2 = 0;

    for (int i = 0; i < c->n; i++) {
        double r[3], t[3];

        residual(r, l, c, i);
        turn(t, to->rotation, r);
        in2 += t[0] * t[0] + t[1] * t[1];
        to->lattice_max_mm = fmax(to->lattice_max_mm, hypot(t[0], t[1]));
    }
    to->lattice_rms_mm = sqrt(in2 / c->n);
    for (int i = 0; i < 2; i++) {
        turn(step[i], to->rotation, l->step[i]);
        to->step_mm[i] = hypot(step[i][0], step[i][1]);
    }
    if (l->across && l->down)
        to->skew_deg = atan2(-(step[0][0] * step[1][0] + step[0][1] * step[1][1]),
                             step[0][0] * step[1][1] - step[0][1] * step[1][0]) *
                       180 / M_PI;
    to->spacing_mm = l->across && l->down ? (to->step_mm[0] + to->step_mm[1]) / 2 : to->step_mm[0] + to->step_mm[1];
    for (int i = 0; i < c->n; i++)
        mean += dot(to->rotation + 6, c->at[i]) / c->n;
    for (int i = 0; i < c->n; i++) {
        const double off = dot(to->rotation + 6, c->at[i]) - mean;

        out2 += off * off;
        to->out_max_mm = fmax(to->out_max_mm, fabs(off));
    }
    to->out_rms_mm = sqrt(out2 / c->n);
}

/* Direction of the centre of a camera's picture, as rectified x / z, y / z. */
static int middle_of(const struct sst_rectified *to, const struct sst_calib *calib, int view, double out[2])
{
    const struct sst_calib_camera *cam = &calib->camera[view];
    double in_camera[3] = { 0, 0, 1 }, in_rig[3], d[3];

    if (!sst_camera_undistort(cam, (calib->width - 1) / 2.0, (calib->height - 1) / 2.0, &in_camera[0], &in_camera[1]))
        in_camera[0] = in_camera[1] = 0; /* the lens folds over there: use the axis */
    for (int i = 0; i < 3; i++)
        in_rig[i] = cam->rotation[i] * in_camera[0] + cam->rotation[3 + i] * in_camera[1] + cam->rotation[6 + i];
    turn(d, to->rotation, in_rig);
    if (d[2] < AWAY_COS_MIN * length(d))
        return refused("camera %s (row %d, column %d) points %.0f degrees away from the normal of the array's plane; "
                       "correct its mount or calibrate again",
                       name_of(calib, view), view / calib->cols, view % calib->cols,
                       acos(d[2] / length(d)) * 180 / M_PI);
    out[0] = d[0] / d[2];
    out[1] = d[1] / d[2];
    return 0;
}

/* The mean focal length, and the principal point that centres the mean of the pictures' centres. */
static int choose_k(struct sst_rectified *to, const struct sst_calib *calib, const struct centres *c,
                    const struct sst_rectify_config *cfg)
{
    double focal = 0, middle[2] = { 0, 0 };

    for (int i = 0; i < c->n; i++) {
        const struct sst_calib_camera *cam = &calib->camera[c->view[i]];
        double at[2];
        const int err = middle_of(to, calib, c->view[i], at);

        if (err)
            return err;
        focal += (cam->fx + cam->fy) / 2 / c->n;
        middle[0] += at[0] / c->n;
        middle[1] += at[1] / c->n;
    }
    to->focal_px = cfg->focal_px > 0 ? cfg->focal_px : focal;
    to->cx = (to->width - 1) / 2.0 - to->focal_px * middle[0];
    to->cy = (to->height - 1) / 2.0 - to->focal_px * middle[1];
    return 0;
}

int sst_rectified_place(struct sst_rectified *to, const struct sst_calib *calib)
{
    const double *ref = calib->camera[to->reference].position_mm;

    for (int k = 0; k < calib->rows * calib->cols; k++) {
        const double *at = calib->camera[k].position_mm;
        const double from_ref[3] = { at[0] - ref[0], at[1] - ref[1], at[2] - ref[2] };
        double t[3];

        to->view[k].known = calib->camera[k].known;
        if (!to->view[k].known)
            continue;
        turn(t, to->rotation, from_ref);
        to->view[k].bx = t[0] / to->spacing_mm;
        to->view[k].by = t[1] / to->spacing_mm;
        to->view[k].dz_mm = t[2];
        to->view[k].scale = to->plane_mm > 0 ? (to->plane_mm - t[2]) / to->plane_mm : 1;
        if (!(fabs(to->view[k].scale - 1) <= 0.5)) {
            sst_log_error("cannot rectify: the plane at %g mm is too close to camera %s (row %d, column %d), which "
                          "is %.1f mm off the reference's plane; choose one farther away",
                          to->plane_mm, name_of(calib, k), k / calib->cols, k % calib->cols, t[2]);
            return -EINVAL;
        }
    }
    return 0;
}

static int check_config(const struct sst_rectify_config *cfg)
{
    if (isfinite(cfg->focal_px) && cfg->focal_px >= 0 && cfg->focal_px <= 1e7 && isfinite(cfg->plane_mm) &&
        cfg->width >= 0 && cfg->height >= 0 && cfg->width <= SST_IMAGE_MAX_SIDE && cfg->height <= SST_IMAGE_MAX_SIDE &&
        !cfg->width == !cfg->height && (size_t)cfg->width * (size_t)cfg->height <= SST_IMAGE_MAX_PIXELS)
        return 0;
    sst_log_error("cannot rectify to %d x %d pixels, focal length %g px, plane %g mm; correct these", cfg->width,
                  cfg->height, cfg->focal_px, cfg->plane_mm);
    return -EINVAL;
}

int sst_rectify_plan(struct sst_rectified *out, const struct sst_calib *calib, const struct sst_rectify_config *cfg)
{
    struct sst_rectified to;
    struct centres c;
    struct lattice l;
    const char *wrong;
    int err = check_config(cfg);

    err = err ? err : collect(&c, calib);
    if (err)
        return err;
    to = (struct sst_rectified){ .rows = calib->rows,
                                 .cols = calib->cols,
                                 .reference = calib->reference,
                                 .width = cfg->width ? cfg->width : calib->width,
                                 .height = cfg->height ? cfg->height : calib->height,
                                 .plane_mm = cfg->plane_mm < 0 ? calib->range_mm : cfg->plane_mm };
    if (!fit_lattice(&l, &c))
        return refused("the known cameras lie on one diagonal of the grid; add a camera beside it");
    if (!regular(&l, &c, STEP_SHARE_MAX) || !(shortest_step(&l) > 0))
        return refuse_order(calib, &c, &l);
    if (one_line(&l))
        return refused(
            "rows and columns of the grid run in one direction: all centres lie on one line, which is a grid "
            "of one row or column; correct the cameras' places");
    wrong = mirrored(&l, &c);
    if (wrong)
        return refused("the grid is mirrored: its %s as the cameras see it; views are numbered from the upper left, "
                       "seen from behind the cameras",
                       wrong);
    err = choose_axes(to.rotation, &c, &l);
    if (err)
        return err;
    measure(&to, &c, &l);
    err = choose_k(&to, calib, &c, cfg);
    err = err ? err : sst_rectified_place(&to, calib);
    if (err)
        return err;
    sst_border_doubles("rotation of the rectified views", to.rotation, 9);
    sst_border_doubles("geometry of the rectified views", (const double[]){ to.focal_px, to.cx, to.cy, to.spacing_mm }, 4);
    *out = to;
    return 0;
}
