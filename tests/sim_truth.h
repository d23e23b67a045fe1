/* tests/sim_truth.h - true positions of points in a simulated world's pictures, and detected corners. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_TESTS_SIM_TRUTH_H
#define SST_TESTS_SIM_TRUTH_H

#include <jansson.h>

#include "tests/sim_test.h"

/* --- projection, written again from the formulas in docs/use/simulation.md --------------------------------------------
 */

struct sim_view {
    double k[3][3], d[5], r[3][3], c[3];
};

static inline void sim_read_matrix(const json_t *j, double m[3][3])
{
    for (size_t i = 0; i < 3; i++) {
        for (size_t k = 0; k < 3; k++)
            m[i][k] = json_real_value(json_array_get(json_array_get(j, i), k));
    }
}

static inline void sim_read_vector(const json_t *j, double *v, size_t n)
{
    assert_int_equal(json_array_size(j), n);
    for (size_t i = 0; i < n; i++)
        v[i] = json_number_value(json_array_get(j, i));
}

static inline void sim_project(const struct sim_view *v, const double p[3], double out[2])
{
    double q[3], a, b, r2, radial;

    for (int i = 0; i < 3; i++)
        q[i] = v->r[i][0] * (p[0] - v->c[0]) + v->r[i][1] * (p[1] - v->c[1]) + v->r[i][2] * (p[2] - v->c[2]);
    a = q[0] / q[2];
    b = q[1] / q[2];
    r2 = a * a + b * b;
    radial = 1 + v->d[0] * r2 + v->d[1] * r2 * r2 + v->d[4] * r2 * r2 * r2;
    out[0] = v->k[0][0] * (a * radial + 2 * v->d[2] * a * b + v->d[3] * (r2 + 2 * a * a)) + v->k[0][2];
    out[1] = v->k[1][1] * (b * radial + v->d[2] * (r2 + 2 * b * b) + 2 * v->d[3] * a * b) + v->k[1][2];
}

/* Of the world that sim_open() opened last. */
static inline json_t *sim_truth_of(void)
{
    json_t *truth;

    assert_int_equal(sst_sim_world_parameters(test_path("w.yaml"), test_path("truth.json")), 0);
    truth = json_load_file(test_path("truth.json"), 0, NULL);
    assert_non_null(truth);
    return truth;
}

static inline void sim_read_view(const json_t *truth, size_t cam, struct sim_view *v)
{
    const json_t *c = json_array_get(json_object_get(truth, "cameras"), cam);

    sim_read_matrix(json_object_get(c, "K"), v->k);
    sim_read_vector(json_object_get(c, "distortion"), v->d, 5);
    sim_read_matrix(json_object_get(c, "rotation"), v->r);
    sim_read_vector(json_object_get(c, "position_mm"), v->c, 3);
}

/* --- corners ----------------------------------------------------------------------------------------------------- */

static inline double sim_sample(const uint8_t *luma, int width, double x, double y)
{
    const int i = (int)floor(x), j = (int)floor(y);
    const double u = x - i, v = y - j;
    const uint8_t *p = luma + j * width + i;

    return (1 - v) * ((1 - u) * p[0] + u * p[1]) + v * ((1 - u) * p[width] + u * p[width + 1]);
}

/*
 * Where four squares meet: at the corner q every gradient g at p nearby is zero or across p - q, so that the sum of
 * g g' (p - q) vanishes (Foerstner 1987). Found from a start some pixels off.
 */
static inline bool sim_find_corner(const uint8_t *luma, int width, int height, double at[2])
{
    for (int round = 0; round < 20; round++) {
        double a = 0, b = 0, c = 0, u = 0, v = 0, det;

        if (at[0] < 11 || at[1] < 11 || at[0] > width - 12 || at[1] > height - 12)
            return false;
        for (int dy = -8; dy <= 8; dy++) {
            for (int dx = -8; dx <= 8; dx++) {
                const double x = at[0] + dx, y = at[1] + dy, weight = exp(-(dx * dx + dy * dy) / 32.0);
                const double gx = sim_sample(luma, width, x + 1, y) - sim_sample(luma, width, x - 1, y);
                const double gy = sim_sample(luma, width, x, y + 1) - sim_sample(luma, width, x, y - 1);

                a += weight * gx * gx;
                b += weight * gx * gy;
                c += weight * gy * gy;
                u += weight * (gx * gx * dx + gx * gy * dy);
                v += weight * (gx * gy * dx + gy * gy * dy);
            }
        }
        det = a * c - b * b;
        if (!(det > 0))
            return false;
        at[0] += (c * u - b * v) / det;
        at[1] += (a * v - b * u) / det;
    }
    return true;
}

#endif
