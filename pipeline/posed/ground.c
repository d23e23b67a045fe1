/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/posed/ground.h"

#include <errno.h>
#include <math.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "base/stats.h"
#include "pipeline/posed/correlation_internal.h"

#define VIEWS       10
#define WIDTH_PX    512   /* of the compared pictures, about */
#define RATIO       1.03  /* of the distances of neighbouring planes */
#define BEHIND      1.6   /* a peak's share over the least one behind it */
#define LEAST_PX    100   /* ... and pixels above the mean behind it, in a wide sweep: patches of chance are smaller */
#define BEFORE      1.3   /* and over the least one before it, up to a higher one */
#define LEAST_FOUR  0.001 /* of the pixels */
#define SIX_BEHIND  4.0 /* a peak's share of six views over the mean behind it; they agree by chance hardly anywhere */
#define SIX_BEFORE  1.5 /* ... and over the least one before it, up to a higher one */
#define NEAREST     0.7 /* of the 2nd and 98th of 100 points: the sweep's limits */
#define FARTHEST    1.6
#define WIDE        20   /* farthest limit over the nearest one: planes behind the ground are many */
#define OVERLAPPING 0.7  /* of a picture's side: shift of the nearest view at the nearest distance */
#define LITTLE      0.03 /* ... and of the farthest compared view at the farthest */
#define TOLD_PX     1.0  /* shift of the farthest compared view at the end of a second sweep, in compared pixels */
#define VAGUE       0.03 /* of the distance: a compared pixel of parallax, from which on distant pairs of views decide */
#define TOO_VAGUE   2.0  /* multiple of VAGUE without refinement: correlation would draw the ground towards leaves */
#define DISTANT     0.6  /* of the largest distance of two views */
#define LEAST_PAIRS 6    /* that are as distant */
#define SLOPE       0.9  /* of a peak's height: its middle is between the places where it falls to that */
#define HIDDEN      0.05  /* of the compared windows: excess over the mirrored near flank that is a farther surface */
#define LEAST_AGREE 0.01  /* of the windows of distant pairs */
#define BEFORE_FEW  1.1   /* as BEFORE, of distant pairs: all their windows count */
#define SCAN        0.01  /* distances around the peak, relative */
#define SCANS       5     /* to both sides */
#define TILT        0.1   /* tangent: the first step of refinement */
#define STEEPEST    0.6   /* tangent */
#define USUAL_TILT  0.4   /* tangent: the spread of grounds' slopes, which tilts are weighed by */
#define WEAK_TILT   0.07  /* ... where few patches decide */
#define CLEAR_PEAK  0.33  /* of correlation above that around, in the latter, ... */
#define LEAST_PEAK  0.002 /* ... and at least: else agreement decides */
#define ROUNDS      6     /* of steps, each half as large as before */

struct search {
    const struct sst_virtual *camera;
    struct agree agree;
    struct correlation correlation;
    bool few;                       /* patches of ground decide, which do not tell its tilt */
    bool weak;                      /* the correlation has no clear peak: agreement decides */
    double around, around_slope;    /* correlation of planes around the ground, by distance */
    double normal[3], across[2][3]; /* of the sweep's planes, and level axes */
    double along;                   /* of the camera's axis against the normal: negative */
    const SST_ATOMIC(bool) * canceled;
};

static int agree_at(struct agree_tally *tally, struct search *s, const struct sst_surface *plane)
{
    return s->canceled && atomic_load(s->canceled) ? -ECANCELED : agree_on(tally, &s->agree, plane);
}

/* Plane at a distance along the camera's axis, tilted by tangents along the two level axes. */
static struct sst_surface plane_at(const struct search *s, double distance_mm, const double tilt[2])
{
    double normal[3], point[3];

    for (int i = 0; i < 3; i++) {
        normal[i] = s->normal[i] + tilt[0] * s->across[0][i] + tilt[1] * s->across[1][i];
        point[i] = s->camera->centre_mm[i] + distance_mm * s->camera->rotation[6 + i];
    }
    return sst_surface_plane(normal, point);
}

/* --- limits of the sweep --------------------------------------------------------------------------------------------
 */

/* Without points: from where the nearest views begin to overlap to where the baseline of the compared ones shifts
 * a picture by little. @return the farthest compared view's distance, mm; 0: views are at one place */
static double limits_of_baselines(double range[2], const struct sst_posed *posed, const struct sst_virtual *camera)
{
    const double side = sst_min_int(camera->width, camera->height) / camera->fx;
    double least[VIEWS + 1], apart[3]; /* distances from the camera, ascending */
    int n = 0;

    for (int i = 0; i < posed->count; i++) {
        const struct sst_calib_camera *cam = &posed->view[i].camera;
        double mm;
        int at;

        for (int k = 0; k < 3; k++)
            apart[k] = cam->position_mm[k] - camera->centre_mm[k];
        mm = vector_length(apart);
        if (!cam->known || !(mm > 0) || (n > VIEWS && mm >= least[VIEWS]))
            continue;
        n += n <= VIEWS;
        for (at = n - 1; at > 0 && least[at - 1] > mm; at--)
            least[at] = least[at - 1];
        least[at] = mm;
    }
    if (n < 2)
        return 0;
    range[0] = range[0] > 0 ? range[0] : least[0] / (OVERLAPPING * side);
    range[1] = range[1] > 0 ? range[1] : least[n - 1] / (LITTLE * side);
    return least[n - 1];
}

/* @param baseline_mm  out: that limits are by; 0: they are not */
static int limits(double range[2], double *baseline_mm, const struct sst_posed *posed, const struct sst_virtual *camera,
                  const struct sst_ground_config *cfg)
{
    double *depth = NULL;
    const char *by;
    int n = 0;

    *baseline_mm = 0;
    range[0] = cfg->near_mm;
    range[1] = cfg->far_mm;
    if (range[0] > 0 && range[1] > range[0])
        return 0;
    depth = malloc((size_t)sst_max_int(posed->point_count, 1) * sizeof(*depth));
    if (!depth) {
        sst_log_error("no memory for the depths of %d points", posed->point_count);
        return -ENOMEM;
    }
    for (int i = 0; i < posed->point_count; i++) {
        double apart[3];

        for (int k = 0; k < 3; k++)
            apart[k] = posed->points[i].at_mm[k] - camera->centre_mm[k];
        depth[n] = vector_dot(camera->rotation + 6, apart);
        n += depth[n] > 0;
    }
    sst_stats_sort_double(depth, n);
    if (n >= 10) {
        range[0] = range[0] > 0 ? range[0] : NEAREST * depth[n / 50];
        range[1] = range[1] > 0 ? range[1] : FARTHEST * depth[n - 1 - n / 50];
    }
    free(depth);
    if (n < 10)
        *baseline_mm = limits_of_baselines(range, posed, camera);
    by = n < 10 ? "the distances of views" : "the points of the scene";
    if (range[0] > 0 && range[1] > range[0]) {
        sst_log_info("the ground is sought from %.2f to %.2f m, limits by %s", range[0] * 1e-3, range[1] * 1e-3, by);
        return 0;
    }
    sst_log_error(
        "%s leave no distances between which the ground is sought (from %.2f to %.2f m): give both --near and "
        "--far, such as two thirds and one and a half of the height, or --surface plane:Z",
        by, range[0] * 1e-3, range[1] * 1e-3);
    return -EINVAL;
}

/* --- sweep ----------------------------------------------------------------------------------------------------------
 */

static double share(int64_t n, const struct agree_tally *tally)
{
    return tally->seen ? (double)n / (double)tally->seen : 0;
}

static int sweep(struct sst_posed_ground *out, struct search *s, const double range[2])
{
    const double none[2] = { 0, 0 };
    int err = 0;

    out->planes = (int)sst_clamp_double(ceil(log(range[1] / range[0]) / log(RATIO)) + 1, 3, SST_GROUND_PLANES);
    for (int i = 0; i < out->planes && !err; i++) {
        const double distance = range[0] * pow(range[1] / range[0], (double)i / (out->planes - 1));
        const struct sst_surface plane = plane_at(s, distance, none);
        struct agree_tally tally;

        err = agree_at(&tally, s, &plane);
        if (err)
            break;
        out->at_mm[i] = distance;
        out->four[i] = share(tally.four, &tally);
        out->six[i] = share(tally.six, &tally);
    }
    return err;
}

/* The farthest distance at which six views agree on more than a patch. On ground that hardly any ray reaches, four
 * agree no more often than on the lower parts of a dense canopy. @return -1: none */
static int farthest_of_six(const struct sst_posed_ground *g, double px)
{
    double sum = 0;

    for (int i = g->planes - 2; i > 0; i--) {
        double before = INFINITY;
        int k = i - 1;

        sum += g->six[i + 1];
        if (g->six[i] < g->six[i + 1] || g->six[i] < g->six[i - 1] || g->six[i] * px < LEAST_PX ||
            g->six[i] < SIX_BEHIND * sum / (g->planes - 1 - i))
            continue;
        for (; k >= 0 && g->six[k] <= g->six[i]; k--)
            before = fmin(before, g->six[k]);
        if (k < 0 || g->six[i] >= SIX_BEFORE * before)
            return i;
    }
    return -1;
}

/* A peak of a share over planes. */
struct peak_limits {
    double least, before; /* share; over the least one before it, up to a higher one */
    double wide_px;       /* pixels of the compared pictures; 0: the sweep is not wide */
};

/* The farthest peak that stands out from the least share behind it, and from the least one between it and any higher
 * peak before it. Far behind the ground chance makes the least share small: in a wide sweep the mean one counts as
 * well.
 * @param value  [planes] four, or another share @param wide_px  pixels of the compared pictures; 0: the sweep is not
 * wide @return -1: none */
static int farthest_peak(const struct sst_posed_ground *g, const double *value, const struct peak_limits *limits)
{
    double behind = INFINITY, sum = 0, mean;

    for (int i = g->planes - 2; i > 0; i--) {
        double before = INFINITY;
        int k = i - 1;

        behind = fmin(behind, value[i + 1]);
        sum += value[i + 1];
        mean = sum / (g->planes - 1 - i);
        if (value[i] < value[i + 1] || value[i] < value[i - 1] || value[i] < limits->least ||
            value[i] < BEHIND * behind ||
            (limits->wide_px > 0 && (value[i] < BEHIND * mean || (value[i] - mean) * limits->wide_px < LEAST_PX)))
            continue;
        for (; k >= 0 && value[k] <= value[i]; k--)
            before = fmin(before, value[k]);
        if (k < 0 || value[i] >= limits->before * before)
            return i;
    }
    return -1;
}

/* Weight of a tilt: flat ground is likelier, and few patches of ground decide. */
static double likely(const struct search *s, const double tilt[2])
{
    const double usual = s->weak ? WEAK_TILT : USUAL_TILT;

    return exp(-(tilt[0] * tilt[0] + tilt[1] * tilt[1]) / (2 * usual * usual));
}

/* Correlation of a plane, or agreement. */
static int value_at(double *out, struct search *s, const double trial[3])
{
    const struct sst_surface plane = plane_at(s, trial[0], trial + 1);
    struct agree_tally tally;
    int err;

    if (!s->weak)
        return s->canceled && atomic_load(s->canceled) ? -ECANCELED : correlation_on(out, &s->correlation, &plane);
    err = agree_at(&tally, s, &plane);
    *out = err ? 0 : tally.spread;
    return err;
}

/* Correlation above the level around, weighed by the tilt; leaves in front correlate less and less from their
 * distance on, which would draw the ground towards them. */
static int try_plane(double *score, struct search *s, const double trial[3])
{
    double value;
    const int err = value_at(&value, s, trial);

    *score = err ? 0 : (value - s->around - s->around_slope * trial[0]) * likely(s, trial + 1);
    return err;
}

/* The best distance around the sweep's peak. @return 0 (the best is inside, and `best` its score, or there is no peak,
 * and 0), or an error */
static int scan(double at[3], double *best, struct search *s)
{
    const double first = at[0];
    double value[2 * SCANS + 1];
    int err = 0;

    for (int i = 0; i <= 2 * SCANS && !err; i++)
        err = value_at(&value[i], s, (const double[3]){ first * (1 + SCAN * (i - SCANS)), 0, 0 });
    if (err)
        return err;
    s->around_slope = s->weak ? 0 : (value[2 * SCANS] - value[0]) / (2 * SCANS * SCAN * first);
    s->around = s->weak ? 0 : (value[2 * SCANS] + value[0]) / 2 - s->around_slope * first;
    for (int i = 1; i < 2 * SCANS; i++) {
        const double distance = first * (1 + SCAN * (i - SCANS)),
                     score = value[i] - s->around - s->around_slope * distance;

        if (score > *best) {
            *best = score;
            at[0] = distance;
        }
    }
    return 0;
}

/* Distances around the sweep's peak, then steps of distance and of both tilts, smaller in every round; a step that
 * gains is repeated. Agreement counts few places; correlation sums all, and fixes the tilt as well. */
static int refine(struct sst_posed_ground *out, struct search *s, bool level)
{
    const double first = out->at_mm[out->chosen];
    double at[3] = { first, 0, 0 }, step[3] = { SCAN / 2 * first, TILT, TILT }, best = 0;
    int err = scan(at, &best, s);

    s->weak = !err && best < fmax(CLEAR_PEAK * (s->around + s->around_slope * first), LEAST_PEAK);
    if (s->weak) {
        best = 0;
        at[0] = first;
        err = scan(at, &best, s);
    }

    for (int round = 0; round < ROUNDS && best > 0 && !err; round++) {
        for (int k = 0; k < 2 * (level ? 1 : 3) && !err; k++) {
            bool better = true;

            while (better && !err) {
                double trial[3] = { at[0], at[1], at[2] }, score = 0;

                trial[k / 2] += k % 2 ? step[k / 2] : -step[k / 2];
                if (fabs(trial[0] / first - 1) < SCANS * SCAN && hypot(trial[1], trial[2]) < STEEPEST)
                    err = try_plane(&score, s, trial);
                better = !err && score > best;
                best = better ? score : best;
                if (better)
                    memcpy(at, trial, sizeof(at));
            }
        }
        for (int k = 0; k < 3; k++)
            step[k] *= 0.5;
    }
    out->plane = plane_at(s, at[0], at + 1);
    out->distance_mm = at[0];
    out->weak = s->weak || s->few;
    out->tilt_deg = atan(hypot(at[1], at[2])) * 180 / M_PI;
    return err;
}

static void choose_axes(struct search *s, const struct sst_posed *posed)
{
    const double *rotation = s->camera->rotation;
    const double against = vector_dot(posed->up, rotation + 6);
    const bool level = vector_length(posed->up) > 0.5 && against < -0.5; /* of views that look down */

    for (int i = 0; i < 3; i++)
        s->normal[i] = level ? posed->up[i] : -rotation[6 + i];
    vector_cross(s->across[0], s->normal, rotation + 3);
    vector_unit(s->across[0]);
    vector_cross(s->across[1], s->normal, s->across[0]);
}

static void choose_peak(struct sst_posed_ground *g, struct search *s, const struct sst_virtual *small,
                        const double range[2])
{
    const double px = (double)small->width * small->height;
    const struct peak_limits limits = { LEAST_FOUR, BEFORE, range[1] > WIDE * range[0] ? px : 0 };

    const int six = farthest_of_six(g, px);

    g->chosen = farthest_peak(g, g->four, &limits);
    s->few = six > g->chosen;
    g->chosen = s->few ? six : g->chosen;
}

/* Farther planes for views of small baselines (a hovering drone), up to the last parallax of a compared pixel. */
static int sweep_farther(struct sst_posed_ground *g, struct search *s, const struct sst_virtual *small, double range[2],
                         double baseline_mm)
{
    int err;

    range[0] = range[1] / 2;
    range[1] = baseline_mm * small->fx / TOLD_PX;
    if (!(range[1] > range[0]))
        return 0;
    sst_log_info(
        "views agree on no plane there: the ground is sought from %.2f to %.2f m, where views %.2f m apart shift "
        "the picture by %.0f px",
        range[0] * 1e-3, range[1] * 1e-3, baseline_mm * 1e-3, TOLD_PX);
    err = sweep(g, s, range);
    if (!err)
        choose_peak(g, s, small, range);
    return err;
}

/* --- small baselines ------------------------------------------------------------------------------------------------
 */

/* Distances of the compared views. */
struct baselines {
    double middle_mm; /* of the farthest one from the virtual camera */
    double most_mm;   /* of two views */
    int distant;      /* pairs that are distant, compared with that */
};

static double apart_mm(const double a[3], const double b[3])
{
    double v[3];

    for (int i = 0; i < 3; i++)
        v[i] = a[i] - b[i];
    return vector_length(v);
}

static struct baselines measure_baselines(const struct greys *greys, const struct sst_virtual *camera)
{
    struct baselines b = { 0 };

    for (int round = 0; round < 2; round++) {
        for (int k = 0; k < greys->count; k++) {
            b.middle_mm = fmax(b.middle_mm, apart_mm(greys->camera[k].position_mm, camera->centre_mm));
            for (int j = 0; j < k; j++) {
                const double mm = apart_mm(greys->camera[k].position_mm, greys->camera[j].position_mm);

                b.distant += round && mm >= DISTANT * b.most_mm;
                b.most_mm = fmax(b.most_mm, mm);
            }
        }
    }
    return b;
}

/* A pixel of parallax is much of the distance. */
static bool is_vague(double distance_mm, const struct baselines *b, const struct sst_virtual *small)
{
    return b->middle_mm * small->fx * VAGUE < distance_mm;
}

/* Value of a sweep at an inverse distance, linear between planes. */
static double value_of(const struct sst_posed_ground *g, const double *value, double inverse)
{
    int i = 1;

    while (i < g->planes - 1 && g->at_mm[i] * inverse < 1)
        i++;
    return value[i - 1] + (value[i] - value[i - 1]) *
                              sst_clamp_double((1 / inverse - g->at_mm[i - 1]) / (g->at_mm[i] - g->at_mm[i - 1]), 0, 1);
}

/* Inverse distance at which a peak falls to a share of its height, before (-1) or behind (1) it. */
static double falls_at(const struct sst_posed_ground *g, const double *value, int peak, double height, int step)
{
    int i = peak;

    while (i + step >= 0 && i + step < g->planes && value[i] > height * value[peak])
        i += step;
    if (i == peak || value[i] > height * value[peak])
        return 1 / g->at_mm[i];
    return 1 / g->at_mm[i] + (height * value[peak] - value[i]) / (value[i - step] - value[i]) *
                                 (1 / g->at_mm[i - step] - 1 / g->at_mm[i]);
}

/* Inverse distance of a peak's middle: peaks of small baselines are wide and flat. */
static double middle_of(const struct sst_posed_ground *g, const double *value, int peak)
{
    return (falls_at(g, value, peak, SLOPE, -1) + falls_at(g, value, peak, SLOPE, 1)) / 2;
}

/* Merged peak of a farther surface: a single surface agrees as much at parallaxes too small as
 * at parallaxes too large, so an excess on the far side comes from another surface. @return inverse distance, or 0:
 * there is none */
static double hidden_behind(const struct sst_posed_ground *g, const double *value, int peak)
{
    const double middle = middle_of(g, value, peak), half = falls_at(g, value, peak, 0.5, -1) - middle;
    double excess[SST_GROUND_PLANES] = { 0 };
    int best = 0;

    for (int i = peak + 1; i < g->planes; i++) {
        const double mirrored = 2 * middle - 1 / g->at_mm[i];

        if (mirrored * g->at_mm[0] > 1) /* before the sweep */
            break;
        if (mirrored - middle > half)
            excess[i] = value[i] - value_of(g, value, mirrored);
        best = excess[i] > excess[best] ? i : best;
    }
    return excess[best] > HIDDEN ? middle_of(g, excess, best) : 0;
}

/* The farthest peak of the share of windows that agree in distant pairs of views alone, in the whole of the two sweeps'
 * range: near ones agree on leaves and ground at any distance between. @param range  of the first sweep @return 0
 * (`chosen` below 0: none), or an error */
static int sweep_distant_pairs(struct sst_posed_ground *g, struct search *s, const struct sst_virtual *small,
                               const double range[2], const struct baselines *b)
{
    double share_of[SST_GROUND_PLANES], hidden;
    int err = 0;

    g->planes = (int)sst_clamp_double(ceil(log(range[1] / range[0]) / log(RATIO)) + 1, 3, SST_GROUND_PLANES);
    s->agree.least_apart_mm = DISTANT * b->most_mm;
    for (int i = 0; i < g->planes && !err; i++) {
        struct sst_surface plane;
        struct agree_tally tally = { 0 };

        g->at_mm[i] = range[0] * pow(range[1] / range[0], (double)i / (g->planes - 1));
        plane = plane_at(s, g->at_mm[i], (const double[2]){ 0, 0 });
        err = agree_at(&tally, s, &plane);
        share_of[i] = tally.pairs ? (double)tally.agreeing / (double)tally.pairs : 0;
        g->four[i] = share(tally.four, &tally);
        g->six[i] = share(tally.six, &tally);
    }
    s->agree.least_apart_mm = 0;
    if (err)
        return err;
    g->chosen = farthest_peak(g, share_of,
                              &(struct peak_limits){ LEAST_AGREE, BEFORE_FEW, (double)small->width * small->height });
    if (g->chosen >= 0) {
        hidden = hidden_behind(g, share_of, g->chosen);
        g->distance_mm = 1 / (hidden > 0 ? hidden : middle_of(g, share_of, g->chosen));
        g->plane = plane_at(s, g->distance_mm, (const double[2]){ 0, 0 });
    }
    return 0;
}

/* Where near pairs of views hardly tell the distance, or find none, distant ones decide. `distance_mm` is set where
 * nothing is to be refined. */
static int decide(struct sst_posed_ground *g, struct search *s, const struct sst_virtual *small,
                  const struct baselines *apart, const double range[2])
{
    struct sst_posed_ground by = *g;
    int err;

    if (apart->distant < LEAST_PAIRS || (g->chosen >= 0 && !is_vague(g->at_mm[g->chosen], apart, small)))
        return 0;
    err = sweep_distant_pairs(&by, s, small, range, apart);
    if (err || by.chosen < 0 || !is_vague(by.distance_mm, apart, small))
        return err;
    *g = by;
    if (!is_vague(by.distance_mm / TOO_VAGUE, apart, small)) {
        g->at_mm[g->chosen] = by.distance_mm;
        g->distance_mm = 0;
    }
    return 0;
}

static void warn_vague(const struct sst_posed_ground *g, const char *dir, const struct sst_virtual *small,
                       const struct baselines *b)
{
    sst_log_warning("%s: the ground at %.1f m is vague: views are %.2f m apart at most, and a pixel of parallax of the "
                    "compared pictures is %.1f m there; leaves that near count as ground; give --surface plane:Z, or "
                    "views farther apart",
                    dir, g->distance_mm * 1e-3, b->middle_mm * 1e-3,
                    g->distance_mm * g->distance_mm / (b->middle_mm * small->fx) * 1e-3);
}

int sst_posed_ground(struct sst_posed_ground *out, const struct sst_posed *posed, const char *dir,
                     const struct sst_virtual *camera, const struct sst_ground_config *cfg)
{
    const int step = greys_step(posed, (int)lround((double)posed->width / WIDTH_PX));
    const struct sst_virtual small = sst_virtual_scaled(camera, step);
    struct sst_posed_ground g = { .chosen = -1 };
    struct search s = { .camera = camera, .canceled = cfg->canceled };
    struct greys greys = { .step = step };
    struct baselines apart;
    double range[2], baseline;
    const int placed = sst_posed_placed(posed);
    int view[VIEWS], err;

    if (placed < 3) {
        sst_log_error("%s: the ground is found by three placed views at least; there %s; give --surface plane:Z", dir,
                      placed == 1 ? "is 1"
                      : placed    ? "are 2"
                                  : "is none");
        return -ENODATA;
    }
    err = limits(range, &baseline, posed, camera, cfg);
    if (err)
        return err;
    g.views = greys_choose(view, VIEWS, posed, camera, sqrt(range[0] * range[1]));
    if (g.views == -ENOMEM) {
        sst_log_error("no memory to choose from %d views", posed->count);
        return -ENOMEM;
    }
    if (g.views < 3) {
        sst_log_error("%s: the ground is found where at least three placed views see it; there are %d; give --surface "
                      "plane:Z, or other --near and --far",
                      dir, g.views);
        return -ENODATA;
    }
    choose_axes(&s, posed);
    greys.count = g.views;
    err = greys_read(&greys, posed, dir, view, cfg->threads);
    if (!err) {
        const double nearest = range[0];
        const struct sst_surface first = plane_at(&s, nearest, (const double[2]){ 0, 0 });

        apart = measure_baselines(&greys, &small);
        err = agree_init(&s.agree, &small, &first, &greys, cfg->threads);
        err = err ? err : sweep(&g, &s, range);
        if (!err)
            choose_peak(&g, &s, &small, range);
        if (!err && g.chosen < 0 && baseline > 0)
            err = sweep_farther(&g, &s, &small, range, baseline);
        if (!err)
            err = decide(&g, &s, &small, &apart,
                         (const double[2]){ nearest, fmax(range[1], baseline * small.fx / TOLD_PX) });
        if (!err && !(g.distance_mm > 0)) {
            err = g.chosen < 0 ? -ENODATA : correlation_init(&s.correlation, &small, &first, &greys, cfg->threads);
            err = err ? err : refine(&g, &s, cfg->level || s.few);
        }
        correlation_fini(&s.correlation);
        agree_fini(&s.agree);
        if (err == -ENOMEM)
            sst_log_error("no memory to compare %d views", g.views);
        else if (err == -ENODATA)
            sst_log_error("%s: views agree at no distance between %.1f and %.1f m; refine the poses by sst poses "
                          "--refine, or give --surface plane:Z, or other --near and --far",
                          dir, nearest * 1e-3, range[1] * 1e-3);
    }
    if (!err && is_vague(g.distance_mm, &apart, &small))
        warn_vague(&g, dir, &small, &apart);
    greys_fini(&greys);
    if (!err)
        *out = g;
    return err;
}
