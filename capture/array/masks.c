/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "capture/array/masks.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/log.h"
#include "base/thread.h"
#include "pipeline/image/blank.h"
#include "pipeline/lightfield/rectify/rectify.h"

#define THREADS_MAX 8
#define LOG_NS      INT64_C(60000000000)
#define BEYOND      1.0 /* pictures: a corner on the edge of the reference view goes on this far beyond it */

/* Corners of a mask in pixels, also beyond the edge. */
struct region {
    int n;
    double x[3 * SST_MASK_POINTS], y[3 * SST_MASK_POINTS];
    const struct sst_config_mask *mask;
};

struct mask_camera {
    uint8_t *black; /* blocks; NULL: no mask */
    struct sst_blank *blank;
    double share;
    int64_t logged_ns;
    unsigned held; /* frames withheld since then */
};

struct sst_masks {
    int cameras, cols, rows; /* blocks of a frame */
    int threads, masked;
    int list[SST_CAMERAS_MAX]; /* of cameras with a mask */
    struct sst_config_camera place[SST_CAMERAS_MAX];
    struct mask_camera camera[SST_CAMERAS_MAX];
    /* of one call */
    const struct sst_frameset *set;
    struct sst_masks_set *to;
    int result[SST_CAMERAS_MAX];
};

/* --- geometry ----------------------------------------------------------------------------------------------------- */

/* Geometry by which masks are placed in views. */
struct views {
    const struct sst_array_config *array;
    const char *path; /* of the calibration; "": none */
    struct sst_calib calib;
    struct sst_rectified to;
    double bx, by; /* of the reference view */
};

static double dot(double ax, double ay, double bx, double by)
{
    return ax * bx + ay * by;
}

/* Distance of a point from a segment. */
static double from_segment(const double p[2], const double a[2], const double b[2])
{
    const double dx = b[0] - a[0], dy = b[1] - a[1], d2 = dot(dx, dy, dx, dy);
    const double t = d2 > 0 ? sst_clamp_double(dot(p[0] - a[0], p[1] - a[1], dx, dy) / d2, 0, 1) : 0;

    return hypot(p[0] - a[0] - t * dx, p[1] - a[1] - t * dy);
}

static double side(const double a[2], const double b[2], const double p[2])
{
    return (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]);
}

/* Distance between two segments, 0 where they cross. */
static double between(const double a[2], const double b[2], const double c[2], const double d[2])
{
    if (side(a, b, c) * side(a, b, d) < 0 && side(c, d, a) * side(c, d, b) < 0)
        return 0;
    return fmin(fmin(from_segment(a, c, d), from_segment(b, c, d)), fmin(from_segment(c, a, b), from_segment(d, a, b)));
}

/* Inside if the outline goes around the point: also where outlines cross themselves nothing is left out. */
static bool inside(const struct region *r, const double p[2])
{
    int around = 0;

    for (int i = 0, k = r->n - 1; i < r->n; k = i++)
        if ((r->y[i] > p[1]) != (r->y[k] > p[1]) &&
            p[0] < (r->x[k] - r->x[i]) * (p[1] - r->y[i]) / (r->y[k] - r->y[i]) + r->x[i])
            around += r->y[i] > p[1] ? 1 : -1;
    return around != 0;
}

/* Does the segment come within `reach` of the region? */
static bool touches(const struct region *r, const double a[2], const double b[2], double reach)
{
    if (inside(r, a) || inside(r, b))
        return true;
    for (int i = 0, k = r->n - 1; i < r->n; k = i++)
        if (between(a, b, (const double[]){ r->x[k], r->y[k] }, (const double[]){ r->x[i], r->y[i] }) <= reach)
            return true;
    return false;
}

/* Way out of the picture at a corner: -1, 0 or 1 on each axis. */
static int outwards(double at)
{
    return at <= 0 ? -1 : at >= 1;
}

/* Is the line between two corners a part of the picture's edge? */
static bool along_edge(const double *x, const double *y, int a, int b)
{
    return (outwards(x[a]) && outwards(x[a]) == outwards(x[b])) || (outwards(y[a]) && outwards(y[a]) == outwards(y[b]));
}

/* Pixel centres lie on integers: the picture goes from -0.5 on. */
static void add_corner(struct region *r, double x, double y, const struct sst_array_config *a)
{
    r->x[r->n] = x * a->width - 0.5;
    r->y[r->n++] = y * a->height - 0.5;
}

/* The region as drawn, and its continuation beyond the edge of the picture. @param beyond  0: nothing */
static void set_region(struct region *r, const struct sst_config_mask *m, const struct sst_array_config *a, double beyond)
{
    double x[SST_MASK_POINTS], y[SST_MASK_POINTS];
    const int n = sst_mask_corners(m, x, y);

    r->mask = m;
    r->n = 0;
    for (int i = 0; i < n; i++) {
        const bool before = along_edge(x, y, i, (i + n - 1) % n), after = along_edge(x, y, i, (i + 1) % n);

        if (!before || !(beyond > 0))
            add_corner(r, x[i], y[i], a);
        if (beyond > 0 && (outwards(x[i]) || outwards(y[i])))
            add_corner(r, x[i] + beyond * outwards(x[i]), y[i] + beyond * outwards(y[i]), a);
        if (beyond > 0 && !after)
            add_corner(r, x[i], y[i], a);
    }
}

/* Position in the rectified picture of a raw pixel, the inverse of sst_rectify_point(). @return false: there is none */
static bool rectify(const struct views *v, int view, const double raw[2], double out[2])
{
    const struct sst_calib_camera *cam = &v->calib.camera[view];
    const double focal = v->to.focal_px * v->to.view[view].scale;
    double ray[3] = { 0, 0, 1 }, turn[9], p[3];

    if (!sst_camera_undistort(cam, raw[0], raw[1], &ray[0], &ray[1]))
        return false;
    sst_rotation_between(v->to.rotation, cam->rotation, turn);
    for (int i = 0; i < 3; i++)
        p[i] = turn[3 * i] * ray[0] + turn[3 * i + 1] * ray[1] + turn[3 * i + 2] * ray[2];
    if (!(p[2] > 1e-6))
        return false;
    out[0] = focal * p[0] / p[2] + v->to.cx;
    out[1] = focal * p[1] / p[2] + v->to.cy;
    return true;
}

/* --- placing ------------------------------------------------------------------------------------------------------ */

/* Half the diagonal of a block: its pixels lie within this distance of its centre. */
static double half_block(void)
{
    return SST_BLANK_SIDE * sqrt(0.5);
}

static void block_centre(int col, int row, double at[2])
{
    at[0] = (col + 0.5) * SST_BLANK_SIDE - 0.5;
    at[1] = (row + 0.5) * SST_BLANK_SIDE - 0.5;
}

static void mask_own(struct sst_masks *m, uint8_t *black, const struct region *r)
{
    for (int row = 0; row < m->rows; row++)
        for (int col = 0; col < m->cols; col++) {
            double at[2];

            block_centre(col, row, at);
            if (touches(r, at, at, half_block()))
                black[row * m->cols + col] = 1;
        }
}

/* Blocks without a position in the rectified view, beyond the fold of a lens, are black. */
static void mask_from_reference(struct sst_masks *m, uint8_t *black, const struct region *r, const struct views *v,
                                int view)
{
    const bool calibrated = v->path[0] != 0;
    const double bx = calibrated ? v->to.view[view].bx - v->bx : view % v->array->cols - v->bx;
    const double by = calibrated ? v->to.view[view].by - v->by : view / v->array->cols - v->by;
    const double grows = calibrated ? v->to.focal_px / fmin(v->calib.camera[view].fx, v->calib.camera[view].fy) : 1;
    const double reach = half_block() * fmax(grows, 1) * 1.25 + SST_MASKS_MARGIN_PX; /* lenses stretch corners */

    for (int row = 0; row < m->rows; row++)
        for (int col = 0; col < m->cols; col++) {
            double raw[2], at[2], near[2], far[2];

            block_centre(col, row, raw);
            memcpy(at, raw, sizeof(at));
            if (calibrated && !rectify(v, view, raw, at)) {
                black[row * m->cols + col] = 1;
                continue;
            }
            near[0] = at[0] + r->mask->near_px * bx;
            near[1] = at[1] + r->mask->near_px * by;
            far[0] = at[0] + r->mask->far_px * bx;
            far[1] = at[1] + r->mask->far_px * by;
            if (touches(r, far, near, reach))
                black[row * m->cols + col] = 1;
        }
}

static int place_camera(struct sst_masks *m, int cam, const struct views *v)
{
    const struct sst_array_config *a = v->array;
    const struct sst_config_camera *at = &a->camera[cam];
    const int view = at->row * a->cols + at->col, blocks = m->cols * m->rows;
    struct mask_camera *c = &m->camera[cam];
    int n = 0;

    c->black = calloc((size_t)blocks, 1);
    if (!c->black)
        return -ENOMEM;
    for (int i = 0; i < a->masks; i++) {
        const struct sst_config_mask *mask = &a->mask[i];
        const bool reference = mask->row < 0;
        struct region r;

        if (at->row < 0) {
            memset(c->black, 1, (size_t)blocks);
            continue;
        }
        if (!reference && (mask->row != at->row || mask->col != at->col))
            continue;
        set_region(&r, mask, a, reference ? BEYOND : 0);
        if (!reference) {
            mask_own(m, c->black, &r);
        } else if (v->path[0] && !v->calib.camera[view].known) {
            sst_log_warning("privacy masks: %s has no camera of row %d, col %d, so its frames are black as a whole",
                            v->path, at->row, at->col);
            memset(c->black, 1, (size_t)blocks);
        } else {
            mask_from_reference(m, c->black, &r, v, view);
        }
    }
    for (int i = 0; i < blocks; i++)
        n += c->black[i];
    c->share = (double)n / blocks;
    if (!n) {
        free(c->black);
        c->black = NULL;
        return 0;
    }
    m->list[m->masked++] = cam;
    return sst_blank_create(&c->blank);
}

/* --- calibration -------------------------------------------------------------------------------------------------- */

/* The view that the live picture shows: the one nearest to the middle that has a camera here, or, on a host with some
 * of the array's cameras, in the calibration. */
static int reference_view(const struct views *v)
{
    const struct sst_array_config *a = v->array;
    const int row = (a->rows - 1) / 2, col = (a->cols - 1) / 2;
    bool has[SST_CAMERAS_MAX] = { false };
    int best = row * a->cols + col, least = -1;

    for (int i = 0; i < a->bound; i++)
        if (a->camera[i].row >= 0)
            has[a->camera[i].row * a->cols + a->camera[i].col] = true;
    for (int k = 0; k < a->rows * a->cols; k++) {
        const int dr = k / a->cols - row, dc = k % a->cols - col, d2 = dr * dr + dc * dc;

        if ((v->path[0] && !v->calib.camera[k].known) || (a->role != SST_CONFIG_NODE && !has[k]))
            continue;
        if (least < 0 || d2 < least) {
            best = k;
            least = d2;
        }
    }
    return best;
}

static int read_views(struct views *v)
{
    const struct sst_array_config *a = v->array;
    const struct sst_calib *c = &v->calib;
    int err = 0, view;

    if (v->path[0]) {
        err = sst_calib_read(&v->calib, v->path);
        if (err)
            return err;
        if (c->rows != a->rows || c->cols != a->cols || c->width != a->width || c->height != a->height) {
            sst_log_error("%s is for %dx%d cameras of %dx%d pixels, the array has %dx%d of %dx%d: privacy masks cannot be "
                          "placed by it; calibrate this array",
                          v->path, c->rows, c->cols, c->width, c->height, a->rows, a->cols, a->width, a->height);
            return -EBADMSG;
        }
        err = sst_rectify_plan(&v->to, c, &(struct sst_rectify_config){ .plane_mm = -1 });
    } else {
        sst_log_warning("privacy masks of the reference view are placed without live: calibration, as if cameras stood "
                        "exactly on their lattice; calibrate, or give masks for each camera");
    }
    view = reference_view(v);
    v->bx = v->path[0] ? v->to.view[view].bx : view % a->cols;
    v->by = v->path[0] ? v->to.view[view].by : view / a->cols;
    return err;
}

static bool of_reference(const struct sst_array_config *a)
{
    for (int i = 0; i < a->masks; i++)
        if (a->mask[i].row < 0)
            return true;
    return false;
}

int sst_masks_create(struct sst_masks **out, const struct sst_array_config *array)
{
    struct sst_masks *m = calloc(1, sizeof(*m));
    struct views *v = calloc(1, sizeof(*v));
    int err = m && v ? 0 : -ENOMEM;

    *out = NULL;
    if (!err && array->masks && !sst_blank_format(array->fourcc)) {
        sst_log_error("privacy: masks cannot be applied to cameras: format %s", sst_array_format_name(array->fourcc));
        err = -EINVAL;
    }
    if (!err && array->masks) {
        v->array = array;
        v->path = array->mask_calibration;
        m->cameras = array->bound;
        m->cols = (array->width + SST_BLANK_SIDE - 1) / SST_BLANK_SIDE;
        m->rows = (array->height + SST_BLANK_SIDE - 1) / SST_BLANK_SIDE;
        err = of_reference(array) ? read_views(v) : 0;
    }
    for (int i = 0; !err && array->masks && i < array->bound; i++) {
        m->place[i] = array->camera[i];
        err = place_camera(m, i, v);
    }
    if (v)
        sst_calib_fini(&v->calib);
    free(v);
    if (!err && array->masks) {
        m->threads = sst_min_int(sst_min_int(sst_thread_count(0), THREADS_MAX), sst_max_int(m->masked, 1));
        *out = m;
        return 0;
    }
    sst_masks_destroy(m);
    return err;
}

void sst_masks_destroy(struct sst_masks *m)
{
    for (int i = 0; m && i < m->cameras; i++) {
        sst_blank_destroy(m->camera[i].blank);
        free(m->camera[i].black);
    }
    free(m);
}

/* --- frames ------------------------------------------------------------------------------------------------------- */

static int mask_frame(void *arg, int index, int worker SST_UNUSED)
{
    struct sst_masks *m = arg;
    const int cam = m->list[index];
    const struct sst_frame *f = m->set->frame[cam];
    const struct sst_blank_blocks blocks = { m->cols, m->rows, m->camera[cam].black };
    struct sst_raw raw;

    if (!f)
        return 0;
    raw = (struct sst_raw){ f->fourcc, f->width, f->height, f->stride, f->data, f->bytes };
    m->result[cam] = sst_blank_frame(m->camera[cam].blank, &raw, &blocks, &raw);
    if (m->result[cam])
        return 0;
    m->to->frame[cam] = *f;
    m->to->frame[cam].stride = raw.stride;
    m->to->frame[cam].data = raw.data;
    m->to->frame[cam].bytes = raw.bytes;
    m->to->frame[cam].row_bytes = 0; /* a picture of its own */
    return 0;
}

static const char *reason_of(int err)
{
    return err == -EBADMSG   ? "to a damaged JPEG; check its cable and USB power"
           : err == -ENOTSUP ? "to JPEGs of arithmetic code or with four colours; set cameras: format to another one"
           : err == -EINVAL  ? "to frames of this size or format; see cameras: width, height and format"
                             : "for want of memory";
}

static void log_withheld(struct sst_masks *m, int cam)
{
    struct mask_camera *c = &m->camera[cam];
    const int64_t now_ns = sst_clock_now_ns();

    c->held++;
    if (c->logged_ns && now_ns - c->logged_ns < LOG_NS)
        return;
    sst_log_warning("camera of row %d, col %d: %u frame%s withheld, since privacy masks cannot be applied %s",
                    m->place[cam].row, m->place[cam].col, c->held, c->held == 1 ? " is" : "s are",
                    reason_of(m->result[cam]));
    c->logged_ns = now_ns;
    c->held = 0;
}

void sst_masks_apply(struct sst_masks *m, const struct sst_frameset *set, struct sst_masks_set *out)
{
    int err;

    m->set = set;
    m->to = out;
    out->set = *set;
    out->withheld = 0;
    for (int i = 0; i < m->masked; i++)
        m->result[m->list[i]] = -ENOMEM; /* of frames that no thread comes to */
    err = sst_parallel_for(m->masked, m->threads, mask_frame, m);
    for (int i = 0; i < m->masked; i++) {
        const int cam = m->list[i];

        if (!set->frame[cam])
            continue;
        out->set.frame[cam] = err || m->result[cam] ? NULL : &out->frame[cam];
        if (out->set.frame[cam])
            continue;
        out->set.present--;
        out->cam[out->withheld++] = cam;
        log_withheld(m, cam);
    }
}

double sst_masks_share(const struct sst_masks *m, int cam)
{
    return m && cam < m->cameras ? m->camera[cam].share : 0;
}
