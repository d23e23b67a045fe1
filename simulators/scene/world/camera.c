/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "simulators/scene/world/world_internal.h"

#include <math.h>
#include <string.h>

#include "simulators/scene/noise.h"

#define PI 3.14159265358979323846

/* Normal distribution (Box, Muller 1958). */
double sim_normal(uint64_t *rng)
{
    const double u = 1 - sst_random(rng), v = sst_random(rng);

    return sqrt(-2 * log(u)) * cos(2 * PI * v);
}

void sim_rotation(const double deg[3], double m[9])
{
    const double a = deg[0] * PI / 180, b = deg[1] * PI / 180, c = deg[2] * PI / 180;
    const double turned[9] = {
        cos(b) * cos(c),
        sin(a) * sin(b) * cos(c) - cos(a) * sin(c),
        cos(a) * sin(b) * cos(c) + sin(a) * sin(c),
        cos(b) * sin(c),
        sin(a) * sin(b) * sin(c) + cos(a) * cos(c),
        cos(a) * sin(b) * sin(c) - sin(a) * cos(c),
        -sin(b),
        sin(a) * cos(b),
        cos(a) * cos(b),
    };

    memcpy(m, turned, sizeof(turned));
}

/* The distorted point of (a, b), and its derivatives by a and b. */
static void distort(const double k[5], double a, double b, double out[2], double by[4])
{
    const double r2 = a * a + b * b, radial = 1 + r2 * (k[0] + r2 * (k[1] + r2 * k[4]));
    const double slope = 2 * (k[0] + r2 * (2 * k[1] + r2 * 3 * k[4])); /* of radial, over a or b */

    out[0] = a * radial + 2 * k[2] * a * b + k[3] * (r2 + 2 * a * a);
    out[1] = b * radial + k[2] * (r2 + 2 * b * b) + 2 * k[3] * a * b;
    by[0] = radial + a * a * slope + 2 * k[2] * b + 6 * k[3] * a;
    by[1] = a * b * slope + 2 * k[2] * a + 2 * k[3] * b;
    by[2] = by[1];
    by[3] = radial + b * b * slope + 6 * k[2] * b + 2 * k[3] * a;
}

bool sim_camera_undistort(const struct sim_camera *c, double u, double v, double *a, double *b)
{
    double at[2] = { u, v }, seen[2], by[4];

    for (int i = 0; i < 50; i++) {
        double det;

        distort(c->distortion, at[0], at[1], seen, by);
        det = by[0] * by[3] - by[1] * by[2];
        if (!(det > 0.01))
            return false;
        if (fabs(seen[0] - u) + fabs(seen[1] - v) < 1e-12) {
            *a = at[0];
            *b = at[1];
            return true;
        }
        at[0] -= (by[3] * (seen[0] - u) - by[1] * (seen[1] - v)) / det;
        at[1] -= (by[0] * (seen[1] - v) - by[2] * (seen[0] - u)) / det;
    }
    return false;
}

static int64_t ns(double us)
{
    return (int64_t)llround(us * 1000);
}

static void make_timing(struct sst_sim_timing *t, const struct sst_sim_settings *s, const struct sst_sim_override *o,
                        uint64_t *rng)
{
    const double delay = fmax(0, s->delay_us + s->delay_spread_us * sim_normal(rng));
    const double latency = fmax(0, s->latency_us + s->latency_spread_us * sim_normal(rng));
    const double phase = fabs(s->phase_spread_us * sim_normal(rng)),
                 offset = s->clock_offset_spread_us * sim_normal(rng);
    const double drift = s->clock_drift_spread_ppm * sim_normal(rng);

    t->delay_ns = ns(o->given & SST_SIM_DELAY ? o->delay_us : delay);
    t->jitter_ns = ns(o->given & SST_SIM_JITTER ? o->jitter_us : s->jitter_us);
    t->latency_ns = ns(o->given & SST_SIM_LATENCY ? o->latency_us : latency);
    t->phase_ns = ns(o->given & SST_SIM_PHASE ? o->phase_us : phase);
    t->clock_offset_ns = ns(o->given & SST_SIM_OFFSET ? o->clock_offset_us : offset);
    t->clock_drift_ppm = o->given & SST_SIM_DRIFT ? o->clock_drift_ppm : drift;
}

static void make_place(struct sim_camera *c, const struct sst_sim_settings *s, const struct sst_sim_override *o,
                       double spacing_mm, int cam, uint64_t *rng)
{
    const int ref_row = (s->rows - 1) / 2, ref_col = (s->cols - 1) / 2;
    /* The rig's camera starts at the position of view (0, 0) of the array. */
    const int row = s->rig ? 0 : cam / s->cols, col = s->rig ? 0 : cam % s->cols;
    double turn[3];

    c->position_mm[0] = (col - ref_col) * spacing_mm;
    c->position_mm[1] = (row - ref_row) * spacing_mm;
    c->position_mm[2] = 0;
    for (int i = 0; i < 3; i++) {
        const double error = s->position_spread_mm * sim_normal(rng);

        turn[i] = s->rotation_spread_deg * sim_normal(rng);
        if (o->given & SST_SIM_ROTATION)
            turn[i] = o->rotation_deg[i];
        c->position_mm[i] += o->given & SST_SIM_POSITION ? o->position_mm[i] : error;
    }
    sim_rotation(turn, c->rotation);
}

static void make_lens(struct sim_camera *c, const struct sst_sim_settings *s, const struct sst_sim_override *o,
                      const struct sim_optics *ideal, uint64_t *rng)
{
    double percent = s->focal_spread_percent * sim_normal(rng), shift[2];

    for (int i = 0; i < 2; i++) {
        shift[i] = s->principal_spread_px * sim_normal(rng);
        if (o->given & SST_SIM_PRINCIPAL)
            shift[i] = o->principal_px[i];
    }
    if (o->given & SST_SIM_FOCAL)
        percent = o->focal_percent;
    c->fx = c->fy = ideal->focal_px * (1 + percent / 100);
    c->cx = ideal->cx + shift[0];
    c->cy = ideal->cy + shift[1];
    for (int i = 0; i < 5; i++) {
        const double k = s->distortion[i] + s->distortion_spread[i] * sim_normal(rng);

        c->distortion[i] = o->given & SST_SIM_DISTORTION ? o->distortion[i] : k;
    }
}

void sim_camera_make(struct sim_camera *c, const struct sst_sim_settings *s, const struct sim_optics *ideal, int cam)
{
    const struct sst_sim_override *o = &s->camera[cam];
    uint64_t rng = s->seed * 1000003 + (uint64_t)cam;
    double gain, balance[3];

    sst_random_u64(&rng);
    make_lens(c, s, o, ideal, &rng);
    make_place(c, s, o, ideal->spacing_mm, cam, &rng);
    make_timing(&c->timing, s, o, &rng);
    gain = exp(s->gain_spread_percent / 100 * sim_normal(&rng));
    for (int i = 0; i < 3; i++) {
        balance[i] = exp(s->balance_spread_percent / 100 * sim_normal(&rng));
        c->gain[i] = o->given & SST_SIM_GAIN ? o->gain[i] : gain * (i == 1 ? 1 : balance[i]);
    }
}

void sim_camera_move(struct sim_camera *c, const struct sst_sim_settings *s, int cam)
{
    const struct sst_sim_override *o = &s->camera[cam];
    double turn[9], before[9];

    memcpy(before, c->rotation, sizeof(before));
    sim_rotation(o->moves_deg, turn);
    for (int i = 0; i < 9; i++) {
        const double *row = turn + i / 3 * 3, *column = before + i % 3;

        c->rotation[i] = row[0] * column[0] + row[1] * column[3] + row[2] * column[6];
    }
    for (int i = 0; i < 3; i++)
        c->position_mm[i] += o->moves_mm[i];
}
