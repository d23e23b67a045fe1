/* Initial values of the adjustment: lenses and poses from homographies of single detections. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/stats.h"
#include "base/thread.h"
#include "pipeline/calibration/board/homography.h"
#include "pipeline/calibration/solve/solve_internal.h"

#define SEED_DETECTIONS 30 /* detections for the initial fit of a lens */
#define SEED_ITERATIONS 30
#define SEED_TURN       1e-5 /* rad: a smaller change of a pose means convergence */
#define ALIKE           10   /* the second pose of a plane is tried if its residuals are less than this times as long */

/* Pose from a homography onto the plane z = 1; the board is in front of the camera. */
static bool decompose(const double h[9], struct solve_pose *out)
{
    double r[2][3], sum[3], difference[3], third[3], n0 = 0, n1 = 0, s = 0, d = 0, f;

    for (int i = 0; i < 3; i++) {
        n0 += h[3 * i] * h[3 * i];
        n1 += h[3 * i + 1] * h[3 * i + 1];
    }
    if (!(n0 > 0) || !(n1 > 0) || !isfinite(n0 + n1))
        return false;
    f = 2 / (sqrt(n0) + sqrt(n1));
    for (int i = 0; i < 3; i++) {
        sum[i] = h[3 * i] / sqrt(n0) + h[3 * i + 1] / sqrt(n1);
        difference[i] = h[3 * i] / sqrt(n0) - h[3 * i + 1] / sqrt(n1);
        s += sum[i] * sum[i];
        d += difference[i] * difference[i];
        out->shift[i] = f * h[3 * i + 2];
    }
    if (!(s > 1e-12) || !(d > 1e-12))
        return false;
    /* The pair of perpendicular unit vectors nearest to both columns. */
    for (int i = 0; i < 3; i++) {
        const double a = sum[i] / sqrt(2 * s), b = difference[i] / sqrt(2 * d);

        r[0][i] = a + b;
        r[1][i] = a - b;
    }
    third[0] = r[0][1] * r[1][2] - r[0][2] * r[1][1];
    third[1] = r[0][2] * r[1][0] - r[0][0] * r[1][2];
    third[2] = r[0][0] * r[1][1] - r[0][1] * r[1][0];
    for (int i = 0; i < 3; i++) {
        out->rotation[3 * i] = r[0][i];
        out->rotation[3 * i + 1] = r[1][i];
        out->rotation[3 * i + 2] = third[i];
    }
    return true;
}

/* A detection, and the lens that it is seen through. */
struct sight {
    const struct solve_problem *p;
    const struct solve_detection *d;
    const double *lens;
};

/* Robust normal equations of a pose; returns the cost, Cauchy's with scale c. */
static double pose_normal(const struct sight *s, const struct solve_pose *pose, double c, double a[36], double g[6])
{
    const struct solve_detection *d = s->d;
    double cost = 0;

    memset(a, 0, 36 * sizeof(*a));
    memset(g, 0, 6 * sizeof(*g));
    for (int i = 0; i < d->corners; i++) {
        double t[3], q[3], xy[2], r2, w;
        struct solve_slopes slopes;

        solve_corner_place(pose, &d->corner[i], s->p->warp, t, q);
        solve_see(s->lens, s->p->lens, q, xy, &slopes);
        xy[0] -= d->corner[i].x;
        xy[1] -= d->corner[i].y;
        r2 = xy[0] * xy[0] + xy[1] * xy[1];
        w = 1 / (1 + r2 / (c * c));
        cost += log1p(r2 / (c * c));
        for (int k = 0; k < 2; k++) {
            double j[6];

            solve_by_motion(slopes.q[k], t, 1, j);
            for (int m = 0; m < 6; m++) {
                g[m] += w * j[m] * xy[k];
                for (int n = 0; n <= m; n++)
                    a[6 * m + n] += w * j[m] * j[n];
            }
        }
    }
    return cost;
}

/* Median length of the residuals over 1.1774: sigma of one axis. */
static double pose_sigma(const struct sight *s, const struct solve_pose *pose, double *work)
{
    const struct solve_detection *d = s->d;

    for (int i = 0; i < d->corners; i++) {
        double t[3], q[3], xy[2];

        solve_corner_place(pose, &d->corner[i], s->p->warp, t, q);
        solve_see(s->lens, s->p->lens, q, xy, NULL);
        work[i] = hypot(xy[0] - d->corner[i].x, xy[1] - d->corner[i].y);
    }
    return sst_stats_upper_median(work, d->corners) / 1.1774;
}

/* Levenberg-Marquardt on the six parameters of a pose; the loss scale follows the residuals. */
static double refine(const struct solve_problem *p, const struct solve_detection *d, const double *lens,
                     struct solve_pose *pose, double *work)
{
    const struct sight s = { p, d, lens };
    double sigma = pose_sigma(&s, pose, work), damp = 1e-4;

    for (int step = 0; step < 20; step++) {
        const double c = fmax(3 * sigma, 0.05);
        double a[36], g[6], again[6], turned[9];
        const double cost = pose_normal(&s, pose, c, a, g);
        struct solve_pose next = *pose;

        for (int i = 0; i < 6; i++)
            a[7 * i] *= 1 + damp;
        if (!solve_cholesky(a, 6))
            break;
        for (int i = 0; i < 6; i++)
            g[i] = -g[i];
        sst_numbers_substitute(a, 6, g);
        sst_rotation_from_vector(g, turned);
        sst_numbers_mul3(turned, pose->rotation, next.rotation);
        for (int i = 0; i < 3; i++)
            next.shift[i] += g[3 + i];
        if (!(pose_normal(&s, &next, c, a, again) <= cost)) {
            damp *= 10;
            if (damp > 1e6)
                break;
            continue;
        }
        *pose = next;
        damp = fmax(damp / 10, 1e-9);
        sigma = pose_sigma(&s, pose, work);
        if (fabs(g[0]) + fabs(g[1]) + fabs(g[2]) < SEED_TURN)
            break;
    }
    return sigma;
}

/* The second pose of a plane that looks nearly the same from afar: its normal mirrored at the line of sight to its
 * centre. */
static void other_pose(const struct solve_pose *pose, const double middle[3], struct solve_pose *out)
{
    double sight[3], along[9], about[3], turn[9], moved[3], length = 0, dot = 0;

    sst_numbers_apply3(pose->rotation, middle, sight);
    for (int i = 0; i < 3; i++) {
        sight[i] += pose->shift[i];
        length += sight[i] * sight[i];
    }
    memcpy(moved, sight, sizeof(moved));
    for (int i = 0; i < 3; i++) {
        sight[i] /= sqrt(fmax(length, 1e-12));
        dot += sight[i] * pose->rotation[3 * i + 2];
    }
    /* Half a turn about the line of sight gives that normal; half a turn about the normal itself keeps the points. */
    for (int i = 0; i < 3; i++)
        about[i] = M_PI * sight[i];
    sst_rotation_from_vector(about, turn);
    sst_numbers_mul3(turn, pose->rotation, along);
    for (int i = 0; i < 9; i++)
        out->rotation[i] = i % 3 < 2 ? -along[i] : along[i];
    sst_numbers_apply3(out->rotation, middle, about);
    for (int i = 0; i < 3; i++)
        out->shift[i] = moved[i] - about[i];
}

void solve_single_camera(struct solve_single *out, const struct solve_problem *p, const struct solve_detection *d,
                         const double *lens)
{
    const struct sst_calib_camera cam = solve_camera_of(lens);
    double(*board)[2] = malloc((size_t)d->corners * sizeof(*board)), h[9], facing = 0, middle[3] = { 0 };
    double(*seen)[2] = malloc((size_t)d->corners * sizeof(*seen)), *work = malloc((size_t)d->corners * sizeof(*work));
    int n = 0;

    *out = (struct solve_single){ 0 };
    for (int i = 0; board && seen && work && i < d->corners; i++) {
        memcpy(board[n], d->corner[i].p, sizeof(board[n]));
        n += sst_camera_undistort(&cam, d->corner[i].x, d->corner[i].y, &seen[n][0], &seen[n][1]);
    }
    if (n >= SOLVE_MIN_CORNERS && sst_homography_fit(h, board, seen, NULL, n) && decompose(h, &out->pose)) {
        struct solve_pose other;
        double sigma;

        for (int i = 0; i < n; i++) {
            middle[0] += board[i][0] / n;
            middle[1] += board[i][1] / n;
        }
        for (int i = 0; i < 3; i++)
            facing += out->pose.rotation[3 * i + 2] * (out->pose.shift[i] + out->pose.rotation[3 * i] * middle[0] +
                                                       out->pose.rotation[3 * i + 1] * middle[1]);
        out->mirrored = facing < 0;
        out->rms_px = refine(p, d, lens, &out->pose, work);
        other_pose(&out->pose, middle, &other);
        sigma = pose_sigma(&(struct sight){ p, d, lens }, &other, work);
        if (sigma < ALIKE * out->rms_px)
            sigma = refine(p, d, lens, &other, work);
        if (sigma < out->rms_px) {
            out->pose = other;
            out->rms_px = sigma;
        }
        out->known = isfinite(out->rms_px) && out->pose.shift[2] > 0;
    }
    free(board);
    free(seen);
    free(work);
}

/* Focal length from homographies, with a centred principal point: if the columns h1, h2 are images of perpendicular
 * unit vectors, h1' W h2 = 0 and h1' W h1 = h2' W h2 with W = diag(1/f^2, 1/f^2, 1) (Zhang 2000). 0: unknown */
static double seed_focal(const struct solve_problem *p, const int *list, int count)
{
    double top = 0, bottom = 0;

    for (int k = 0; k < count; k++) {
        const struct solve_detection *d = &p->detection[list[k]];
        double(*board)[2] = malloc((size_t)d->corners * sizeof(*board)), h[9], size = 0;
        double(*seen)[2] = malloc((size_t)d->corners * sizeof(*seen));
        bool fine = board && seen;

        for (int i = 0; fine && i < d->corners; i++) {
            memcpy(board[i], d->corner[i].p, sizeof(board[i]));
            seen[i][0] = (d->corner[i].x - (p->width - 1) / 2.0) / p->width;
            seen[i][1] = (d->corner[i].y - (p->height - 1) / 2.0) / p->width;
        }
        fine = fine && sst_homography_fit(h, board, seen, NULL, d->corners);
        free(board);
        free(seen);
        for (int i = 0; fine && i < 6; i++)
            size += h[i / 2 * 3 + i % 2] * h[i / 2 * 3 + i % 2];
        if (!fine || !(size > 0))
            continue;
        for (int i = 0; i < 2; i++) {
            const double u = i ? h[0] * h[0] + h[3] * h[3] - h[1] * h[1] - h[4] * h[4] : h[0] * h[1] + h[3] * h[4];
            const double v = i ? h[6] * h[6] - h[7] * h[7] : h[6] * h[7];

            top -= u * v / (size * size);
            bottom += u * u / (size * size);
        }
    }
    /* top / bottom = 1 / f^2 in pictures' widths */
    return bottom > 0 && top > bottom * 1e-3 && top < bottom * 100 ? p->width * sqrt(bottom / top) : 0;
}

/* Initial lens of each camera by an adjustment of its own detections. */
struct seed {
    struct solve_problem *p;
    struct solve_single *single;
    int *list, *first; /* detections by view: list[first[v] .. first[v + 1]]; a rig: all in view 0 */
    double (*lens)[SOLVE_LENS_MAX];
    bool *known;
    int groups;
    double focal;
};

static void plain_lens(const struct solve_problem *p, double focal, double lens[SOLVE_LENS_MAX])
{
    memset(lens, 0, SOLVE_LENS_MAX * sizeof(*lens));
    lens[0] = lens[1] = focal;
    lens[2] = (p->width - 1) / 2.0;
    lens[3] = (p->height - 1) / 2.0;
}

/* A lens is plausible if it is near the estimate from the homographies and valid over the whole picture. */
static bool lens_is_sane(const struct solve_problem *p, const double *lens, double focal)
{
    const struct sst_calib_camera cam = solve_camera_of(lens);
    bool sane = lens[0] > focal / 2 && lens[0] < 2 * focal && fabs(lens[1] / lens[0] - 1) < 0.2 &&
                fabs(lens[2] - p->width / 2.0) < 0.25 * p->width && fabs(lens[3] - p->height / 2.0) < 0.25 * p->width;

    for (int i = 0; sane && i < 16; i++) {
        double a, b;

        sane = sst_camera_undistort(&cam, i % 4 * (p->width - 1) / 3.0, i / 4 * (p->height - 1) / 3.0, &a, &b);
    }
    return sane;
}

/* One camera, up to SEED_DETECTIONS of its detections spread over time, each a board of its own. */
static int fit_alone(const struct seed *s, int group, double *lens, bool *known)
{
    const int *list = s->list + s->first[group], n = s->first[group + 1] - s->first[group];
    const int take = sst_min_int(n, SEED_DETECTIONS);
    const struct solve_adjust_config cfg = { .loss_px = 2, .max_iterations = SEED_ITERATIONS, .tolerance = 1e-2 };
    struct solve_problem alone = {
        .views = 1, .width = s->p->width, .height = s->p->height, .lens = 5, .threads = 1, .keep_warp = true
    };
    struct solve_adjusted done;
    int err = -ENOMEM;

    alone.camera = calloc(1, sizeof(*alone.camera));
    alone.frame = calloc((size_t)take + 1, sizeof(*alone.frame));
    alone.detection = calloc((size_t)take + 1, sizeof(*alone.detection));
    if (!alone.camera || !alone.frame || !alone.detection)
        goto out;
    for (int i = 0; i < 9; i++)
        alone.camera->pose.rotation[i] = i % 4 == 0;
    memcpy(alone.camera->lens, lens, sizeof(alone.camera->lens));
    for (int i = 0; i < take; i++) {
        const struct solve_detection *d = &s->p->detection[list[(int64_t)i * n / take]];
        struct solve_single pose;

        solve_single_camera(&pose, &alone, d, lens);
        if (!pose.known || pose.mirrored)
            continue;
        alone.frame[alone.count].pose = pose.pose;
        alone.detection[alone.count] = *d;
        alone.detection[alone.count].view = 0;
        alone.detection[alone.count].frame = alone.count;
        alone.count++;
    }
    alone.frames = alone.count;
    *known = false;
    err = 0;
    if (alone.count < 3)
        goto out;
    err = solve_adjust(&alone, &cfg, &done);
    if (err == -EDOM) {
        err = 0;
    } else if (!err && lens_is_sane(&alone, alone.camera->lens, lens[0])) {
        memcpy(lens, alone.camera->lens, sizeof(alone.camera->lens));
        *known = true;
    }
out:
    solve_problem_fini(&alone);
    return err;
}

static int lens_of_group(void *arg, int group, int worker SST_UNUSED)
{
    struct seed *s = arg;
    const int n = s->first[group + 1] - s->first[group];
    const double own = seed_focal(s->p, s->list + s->first[group], n);
    const bool trust = own > 0.67 * s->focal && own < 1.5 * s->focal;

    plain_lens(s->p, trust ? own : s->focal, s->lens[group]);
    return n ? fit_alone(s, group, s->lens[group], &s->known[group]) : 0;
}

static int pose_of_one(void *arg, int index, int worker SST_UNUSED)
{
    struct seed *s = arg;
    const struct solve_detection *d = &s->p->detection[index];

    if (d->used)
        solve_single_camera(&s->single[index], s->p, d, s->p->camera[d->view].lens);
    return 0;
}

/* Typical focal length from homographies: the median over the cameras. */
static void typical_focal(struct seed *s, double *work)
{
    int n = 0;

    for (int g = 0; g < s->groups; g++) {
        const double f = seed_focal(s->p, s->list + s->first[g], s->first[g + 1] - s->first[g]);

        if (f > 0)
            work[n++] = f;
    }
    s->focal = n ? sst_stats_upper_median(work, n) : sst_max_int(s->p->width, s->p->height);
}

/* Assign lenses to all cameras; ones without use the median camera's. */
static void assign_lenses(struct seed *s, double *work)
{
    struct solve_problem *p = s->p;
    int known = 0, middle = -1;

    for (int g = 0; g < s->groups; g++) {
        if (s->known[g])
            work[known++] = s->lens[g][0];
    }
    if (known) {
        const double f = sst_stats_upper_median(work, known);

        for (int g = 0; g < s->groups && middle < 0; g++) {
            if (s->known[g] && s->lens[g][0] == f)
                middle = g;
        }
    }
    for (int v = 0; v < p->views; v++) {
        const int g = p->rig ? 0 : v;

        memcpy(p->camera[v].lens, s->lens[s->known[g] || middle < 0 ? g : middle], sizeof(p->camera[v].lens));
    }
}

static int seed_lenses(struct seed *s)
{
    struct solve_problem *p = s->p;
    double *work = malloc((size_t)s->groups * sizeof(*work));
    int err = -ENOMEM;

    s->lens = calloc((size_t)s->groups, sizeof(*s->lens));
    s->known = calloc((size_t)s->groups, sizeof(*s->known));
    s->list = malloc((size_t)(p->count + 1) * sizeof(int));
    s->first = malloc((size_t)(s->groups + 1) * sizeof(int));
    if (!work || !s->lens || !s->known || !s->list || !s->first)
        goto out;
    for (int g = 0, n = 0; g <= s->groups; g++) {
        s->first[g] = n;
        for (int i = 0; i < p->count && g < s->groups; i++) {
            if (p->detection[i].used && (p->rig || p->detection[i].view == g))
                s->list[n++] = i;
        }
    }
    typical_focal(s, work);
    err = sst_parallel_for(s->groups, sst_thread_count(p->threads), lens_of_group, s);
    if (!err)
        assign_lenses(s, work);
out:
    free(work);
    free(s->lens);
    free(s->known);
    free(s->list);
    free(s->first);
    return err;
}

int solve_seed(struct solve_problem *p, struct solve_single *single)
{
    struct seed s = { .p = p, .single = single, .groups = p->rig ? 1 : p->views };
    int err = p->keep_lens ? 0 : seed_lenses(&s);

    return err ? err : sst_parallel_for(p->count, sst_thread_count(p->threads), pose_of_one, &s);
}
