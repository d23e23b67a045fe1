/* Starts of the adjustment: cameras on a line or in a plane, by similarities of pictures. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/stats.h"
#include "pipeline/posed/solve/solve_internal.h"

#define MIN_SHARE 0.15 /* of matches that a similarity explains, to be used */

int poses_model_init(struct poses_model *model, int views, int tracks)
{
    *model = (struct poses_model){ .views = views, .tracks = tracks, .focal = 1 };
    model->rotation = calloc((size_t)views, sizeof(*model->rotation));
    model->centre = calloc((size_t)views, sizeof(*model->centre));
    model->point = calloc((size_t)tracks + 1, sizeof(*model->point));
    if (!model->rotation || !model->centre || !model->point) {
        poses_model_fini(model);
        return -ENOMEM;
    }
    for (int v = 0; v < views; v++)
        model->rotation[v][0] = model->rotation[v][4] = model->rotation[v][8] = 1;
    return 0;
}

void poses_model_fini(struct poses_model *model)
{
    free(model->rotation);
    free(model->centre);
    free(model->point);
    *model = (struct poses_model){ 0 };
}

int poses_model_copy(struct poses_model *out, const struct poses_model *in)
{
    const int err = poses_model_init(out, in->views, in->tracks);

    if (err)
        return err;
    memcpy(out->rotation, in->rotation, (size_t)in->views * sizeof(*in->rotation));
    memcpy(out->centre, in->centre, (size_t)in->views * sizeof(*in->centre));
    memcpy(out->point, in->point, (size_t)in->tracks * sizeof(*in->point));
    out->focal = in->focal;
    out->k1 = in->k1;
    return 0;
}

double poses_spacing(const struct poses_model *model, const bool *linked, const int *order)
{
    double sum = 0;
    int last = -1, steps = 0;

    for (int i = 0; i < model->views; i++) {
        const int v = order ? order[i] : i;

        if (!linked[v])
            continue;
        if (last >= 0) {
            const double *a = model->centre[order ? order[last] : last], *b = model->centre[v];

            sum += sqrt((a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1]) + (a[2] - b[2]) * (a[2] - b[2]));
            steps += i - last;
        }
        last = i;
    }
    return steps ? sum / steps : 0;
}

double poses_normalise(struct poses_model *model, const bool *linked)
{
    const double was = poses_spacing(model, linked, NULL);

    if (!(was > 0))
        return was;
    for (int v = 0; v < model->views; v++) {
        for (int i = 0; i < 3; i++)
            model->centre[v][i] /= was;
    }
    for (int t = 0; t < model->tracks; t++) {
        for (int i = 0; i < 3; i++)
            model->point[t][i] /= was;
    }
    return was;
}

/* Best pair of v with an earlier placed view. */
static const struct poses_pair *pair_before(const struct poses_scene *scene, int v, const bool *placed)
{
    const struct poses_pair *best = NULL;

    for (int p = 0; p < scene->pairs; p++) {
        const struct poses_pair *pair = scene->pair + p;

        if (pair->b == v && placed[pair->a] && pair->share >= MIN_SHARE &&
            (!best || pair->count * pair->share > best->count * best->share))
            best = pair;
    }
    return best;
}

/* Rotation of a view by its roll and by the tilt that shifts its picture. */
static void rotation_of(double roll, const double shift_px[2], double focal, double out[9])
{
    const double tilt[3] = { -shift_px[1] / focal, shift_px[0] / focal, 0 }, turn[3] = { 0, 0, roll };
    double a[9], b[9];

    sst_rotation_from_vector(turn, a);
    sst_rotation_from_vector(tilt, b);
    sst_numbers_mul3(a, b, out);
}

struct line_step {
    int from, to;
    double roll, shift[2]; /* of the scene in the first view's orientation */
};

/* Chain of shifts from the first view on. @return steps, or 0: a view has no pair with an earlier one */
static int line_steps(struct line_step *step, const struct poses_scene *scene, double *roll, bool *placed)
{
    int steps = 0, begin = -1;

    for (int v = 0; v < scene->views; v++) {
        const struct poses_pair *pair;
        double c, s;

        if (!scene->linked[v])
            continue;
        placed[v] = true;
        if (begin < 0) {
            begin = v;
            continue;
        }
        placed[v] = false;
        pair = pair_before(scene, v, placed);
        if (!pair)
            return 0;
        placed[v] = true;
        roll[v] = roll[pair->a] + atan2(pair->similarity[1], pair->similarity[0]);
        c = cos(roll[v]);
        s = sin(roll[v]);
        step[steps++] = (struct line_step){ .from = pair->a,
                                            .to = v,
                                            .roll = roll[v],
                                            .shift = { c * pair->similarity[2] + s * pair->similarity[3],
                                                       -s * pair->similarity[2] + c * pair->similarity[3] } };
    }
    return steps;
}

/* Median shift of the scene from one place on the line to the next. */
static void median_shift(const struct line_step *step, int steps, double *work, double mean[2])
{
    for (int i = 0; i < 2; i++) {
        for (int k = 0; k < steps; k++)
            work[k] = step[k].shift[i] / (step[k].to - step[k].from);
        mean[i] = sst_stats_median(work, steps);
    }
}

bool poses_start_line(struct poses_model *model, const struct poses_scene *scene)
{
    const size_t n = (size_t)scene->views;
    struct line_step *step = calloc(n, sizeof(*step));
    double *roll = calloc(n, sizeof(*roll)), (*tilt)[2] = calloc(n, sizeof(*tilt)), *work = calloc(n, sizeof(*work));
    bool *placed = calloc(n, sizeof(*placed)), good = false;
    int steps = 0;

    if (step && roll && tilt && work && placed)
        steps = line_steps(step, scene, roll, placed);
    if (steps > 0) {
        double mean[2], length;

        median_shift(step, steps, work, mean);
        length = hypot(mean[0], mean[1]);
        good = length > 1e-3 * model->focal;
        for (int k = 0; good && k < steps; k++) {
            const int v = step[k].to, apart = v - step[k].from;

            for (int i = 0; i < 2; i++) {
                tilt[v][i] = tilt[step[k].from][i] + step[k].shift[i] - apart * mean[i];
                model->centre[v][i] = model->centre[step[k].from][i] - apart * mean[i] / length;
            }
            rotation_of(roll[v], tilt[v], model->focal, model->rotation[v]);
        }
    }
    free(step);
    free(roll);
    free(tilt);
    free(work);
    free(placed);
    return good;
}

void poses_start_turns(struct poses_model *model, const struct poses_scene *scene)
{
    const size_t n = (size_t)scene->views;
    struct line_step *step = calloc(n, sizeof(*step));
    double *roll = calloc(n, sizeof(*roll)), (*tilt)[2] = calloc(n, sizeof(*tilt));
    bool *placed = calloc(n, sizeof(*placed));
    const int steps = step && roll && tilt && placed ? line_steps(step, scene, roll, placed) : 0;

    for (int k = 0; k < steps; k++) {
        const int v = step[k].to;

        for (int i = 0; i < 2; i++)
            tilt[v][i] = tilt[step[k].from][i] + step[k].shift[i];
        rotation_of(roll[v], tilt[v], model->focal, model->rotation[v]);
    }
    free(step);
    free(roll);
    free(tilt);
    free(placed);
}

/* Strongest pair between placed views and others. */
static const struct poses_pair *next_pair(const struct poses_scene *scene, const bool *placed)
{
    const struct poses_pair *best = NULL;

    for (int p = 0; p < scene->pairs; p++) {
        const struct poses_pair *pair = scene->pair + p;

        if (placed[pair->a] != placed[pair->b] && scene->linked[pair->a] && scene->linked[pair->b] &&
            (!best || pair->count * pair->share > best->count * best->share))
            best = pair;
    }
    return best;
}

/* Ground = place + scale turn(-roll) picture, of each view: ground of the first view's px. */
struct ground {
    double place[2], s, r;
};

/* Ground of b from a's, for b = M a + t: A_b = A_a M^-1, place_b = place_a - A_b t. */
static struct ground step_ground(const struct ground *a, const double m[4], bool forward)
{
    const double size2 = m[0] * m[0] + m[1] * m[1];
    struct ground b;

    if (forward) {
        b.s = (a->s * m[0] + a->r * m[1]) / size2;
        b.r = (a->r * m[0] - a->s * m[1]) / size2;
        b.place[0] = a->place[0] - (b.s * m[2] - b.r * m[3]);
        b.place[1] = a->place[1] - (b.r * m[2] + b.s * m[3]);
    } else {
        b.s = a->s * m[0] - a->r * m[1];
        b.r = a->r * m[0] + a->s * m[1];
        b.place[0] = a->place[0] + a->s * m[2] - a->r * m[3];
        b.place[1] = a->place[1] + a->r * m[2] + a->s * m[3];
    }
    return b;
}

void poses_start_plane(struct poses_model *model, const struct poses_scene *scene)
{
    struct ground *ground = calloc((size_t)scene->views, sizeof(*ground));
    bool *placed = calloc((size_t)scene->views, sizeof(*placed));
    const struct poses_pair *pair;
    int first = 0;

    if (!ground || !placed)
        goto done;
    while (!scene->linked[first])
        first++;
    placed[first] = true;
    ground[first] = (struct ground){ .s = 1 };
    while ((pair = next_pair(scene, placed)) != NULL) {
        const int from = placed[pair->a] ? pair->a : pair->b, to = from == pair->a ? pair->b : pair->a;

        ground[to] = step_ground(ground + from, pair->similarity, from == pair->a);
        placed[to] = true;
    }
    for (int v = 0; v < scene->views; v++) {
        if (!placed[v])
            continue;
        model->centre[v][0] = ground[v].place[0];
        model->centre[v][1] = ground[v].place[1];
        model->centre[v][2] = model->focal * (1 - hypot(ground[v].s, ground[v].r));
        rotation_of(-atan2(ground[v].r, ground[v].s), (double[2]){ 0, 0 }, model->focal, model->rotation[v]);
    }
done:
    free(ground);
    free(placed);
}

/* --- points ------------------------------------------------------------------------------------------------------- */

/* Direction of a sight's ray in the world. */
static void ray_of(const struct poses_model *m, const struct poses_sight *s, double ray[3])
{
    const double *r = m->rotation[s->view], u[3] = { s->x / m->focal, s->y / m->focal, 1 };
    const double length = sqrt(u[0] * u[0] + u[1] * u[1] + 1);

    for (int i = 0; i < 3; i++)
        ray[i] = (r[i] * u[0] + r[3 + i] * u[1] + r[6 + i] * u[2]) / length;
}

/* Point nearest to the rays. @return its depth in the first view */
static double meet(const struct poses_model *m, const struct poses_tracks *tracks, int track, double point[3])
{
    const int from = tracks->first[track], to = tracks->first[track + 1];
    const double *r = m->rotation[tracks->sight[from].view], *c = m->centre[tracks->sight[from].view];
    double a[3][3] = { { 1e-12, 0, 0 }, { 0, 1e-12, 0 }, { 0, 0, 1e-12 } };

    memset(point, 0, 3 * sizeof(*point));
    for (int s = from; s < to; s++) {
        const double *at = m->centre[tracks->sight[s].view];
        double ray[3];

        ray_of(m, tracks->sight + s, ray);
        for (int i = 0; i < 3; i++) {
            for (int j = 0; j < 3; j++) {
                const double part = (i == j) - ray[i] * ray[j];

                a[i][j] += part;
                point[i] += part * (at[j] - c[j]);
            }
        }
    }
    sst_stats_solve3(a, point);
    for (int i = 0; i < 3; i++)
        point[i] += c[i];
    return r[6] * (point[0] - c[0]) + r[7] * (point[1] - c[1]) + r[8] * (point[2] - c[2]);
}

void poses_far_points(struct poses_model *model, const struct poses_tracks *tracks)
{
    for (int t = 0; t < tracks->tracks; t++) {
        const struct poses_sight *s = tracks->sight + tracks->first[t];
        double ray[3];

        ray_of(model, s, ray);
        for (int i = 0; i < 3; i++)
            model->point[t][i] = model->centre[s->view][i] + ray[i];
    }
}

void poses_triangulate(struct poses_model *model, const struct poses_tracks *tracks)
{
    double *depth = malloc((size_t)tracks->tracks * 2 * sizeof(*depth) + 1), usual;
    int ahead = 0;

    if (!depth)
        return;
    for (int t = 0; t < tracks->tracks; t++) {
        depth[t] = meet(model, tracks, t, model->point[t]);
        if (depth[t] > 0 && isfinite(depth[t]))
            depth[tracks->tracks + ahead++] = depth[t];
    }
    usual = ahead > tracks->tracks / 4 ? sst_stats_median(depth + tracks->tracks, ahead) : model->focal;
    for (int t = 0; t < tracks->tracks; t++) {
        const struct poses_sight *s = tracks->sight + tracks->first[t];
        const double *r = model->rotation[s->view], *c = model->centre[s->view];
        double ray[3], along;

        if (depth[t] > 0.3 * usual && depth[t] < 3 * usual)
            continue;
        ray_of(model, s, ray);
        along = usual / (r[6] * ray[0] + r[7] * ray[1] + r[8] * ray[2]);
        for (int i = 0; i < 3; i++)
            model->point[t][i] = c[i] + along * ray[i];
    }
    free(depth);
}

/* --- reversal ----------------------------------------------------------------------------------------------------- */

static double length_of(const double v[3])
{
    return sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
}

/* Turn the view so that `now` is seen where `before` was. */
static void turn_view(double rotation[9], const double now[3], const double before[3])
{
    double axis[3], turn[9], both[9], sine, angle;

    for (int i = 0; i < 3; i++)
        axis[i] = now[(i + 1) % 3] * before[(i + 2) % 3] - now[(i + 2) % 3] * before[(i + 1) % 3];
    sine = length_of(axis);
    if (!(sine > 0))
        return;
    angle = atan2(sine, now[0] * before[0] + now[1] * before[1] + now[2] * before[2]);
    for (int i = 0; i < 3; i++)
        axis[i] *= angle / sine;
    sst_rotation_from_vector(axis, turn);
    sst_numbers_mul3(rotation, turn, both);
    memcpy(rotation, both, sizeof(both));
}

/* Mean centre, mean direction of view and median depth. */
static void middle_of(const struct poses_model *m, const bool *linked, double centre[3], double ahead[3])
{
    double length;
    int count = 0;

    memset(centre, 0, 3 * sizeof(*centre));
    memset(ahead, 0, 3 * sizeof(*ahead));
    for (int v = 0; v < m->views; v++) {
        for (int i = 0; linked[v] && i < 3; i++) {
            centre[i] += m->centre[v][i];
            ahead[i] += m->rotation[v][6 + i];
        }
        count += linked[v];
    }
    length = length_of(ahead);
    for (int i = 0; i < 3; i++) {
        centre[i] /= count;
        ahead[i] /= length > 0 ? length : 1;
    }
}

static double usual_depth(const struct poses_model *m, const double centre[3], const double ahead[3])
{
    double *depth = malloc((size_t)m->tracks * sizeof(*depth) + 1), usual = 0;

    for (int t = 0; depth && t < m->tracks; t++) {
        depth[t] = 0;
        for (int i = 0; i < 3; i++)
            depth[t] += (m->point[t][i] - centre[i]) * ahead[i];
    }
    if (depth)
        usual = sst_stats_median(depth, m->tracks);
    free(depth);
    return usual;
}

bool poses_reverse(struct poses_model *m, const struct poses_tracks *tracks, const bool *linked)
{
    double middle[3], ahead[3], depth;

    middle_of(m, linked, middle, ahead);
    depth = usual_depth(m, middle, ahead);
    for (int v = 0; v < m->views; v++) {
        double across[3], along = 0, now[3], before[3];

        for (int i = 0; i < 3; i++)
            along += (m->centre[v][i] - middle[i]) * ahead[i];
        for (int i = 0; i < 3; i++) {
            across[i] = m->centre[v][i] - middle[i] - along * ahead[i];
            before[i] = middle[i] + depth * ahead[i] - m->centre[v][i];
            now[i] = before[i] + 2 * across[i];
        }
        if (!linked[v])
            continue;
        if (!(length_of(across) < depth))
            return false; /* so far apart, perspective tells */
        for (int i = 0; i < 3; i++)
            m->centre[v][i] -= 2 * across[i];
        turn_view(m->rotation[v], now, before);
    }
    poses_triangulate(m, tracks);
    return true;
}
