/* Adjustment of poses (pipeline/posed/solve/): skyline algebra, tracks, starts and priors on simulated sights. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "pipeline/posed/solve/solve_internal.h"
#include "tests/random.h"
#include "tests/small.h"
#include "tests/test.h"

#define VIEWS  10
#define POINTS 300
#define FOCAL  1000.0
#define HALF   400.0 /* of a picture, px */
#define DEG    (3.14159265358979 / 180)

static double random_of(uint64_t *seed, double lo, double hi)
{
    return lo + (hi - lo) * sst_random(seed);
}

/* Ten cameras on a line, tilted up to 6 degrees, at unequal heights, over points at depths of 26 to 45. */
static void make_truth(struct poses_model *m, uint64_t seed)
{
    assert_int_equal(poses_model_init(m, VIEWS, POINTS), 0);
    m->focal = FOCAL;
    for (int v = 0; v < VIEWS; v++) {
        const double turn[3] = { random_of(&seed, -6, 6) * DEG, random_of(&seed, -6, 6) * DEG,
                                 random_of(&seed, -10, 10) * DEG };

        m->centre[v][0] = v + random_of(&seed, -0.04, 0.04);
        m->centre[v][1] = random_of(&seed, -0.05, 0.05);
        m->centre[v][2] = random_of(&seed, -0.05, 0.05);
        sst_rotation_from_vector(turn, m->rotation[v]);
    }
    for (int t = 0; t < POINTS; t++) {
        m->point[t][2] = random_of(&seed, 26, 45);
        m->point[t][0] = random_of(&seed, -6, 15);
        m->point[t][1] = random_of(&seed, -10, 10);
    }
}

/* Sights of each camera, with noise and some wrong ones. */
static void see(struct poses_tracks *out, const struct poses_model *truth, double noise_px, double wrong)
{
    uint64_t seed = 9;

    *out = (struct poses_tracks){ .first = calloc(POINTS + 1, sizeof(int)),
                                  .sight = calloc(POINTS * VIEWS, sizeof(struct poses_sight)) };
    assert_true(out->first && out->sight);
    for (int t = 0; t < POINTS; t++) {
        out->first[t] = out->sights;
        for (int v = 0; v < VIEWS; v++) {
            double d[3], q[3];

            for (int i = 0; i < 3; i++)
                d[i] = truth->point[t][i] - truth->centre[v][i];
            sst_numbers_apply3(truth->rotation[v], d, q);
            if (fabs(q[0] / q[2]) > HALF / FOCAL || fabs(q[1] / q[2]) > HALF / FOCAL)
                continue;
            out->sight[out->sights] = (struct poses_sight){ v, t, FOCAL * q[0] / q[2], FOCAL * q[1] / q[2] };
            out->sight[out->sights].x += noise_px * random_of(&seed, -1, 1);
            out->sight[out->sights].y += noise_px * random_of(&seed, -1, 1);
            if (random_of(&seed, 0, 1) < wrong)
                out->sight[out->sights].x += 40;
            out->sights++;
        }
    }
    out->first[POINTS] = out->sights;
    out->tracks = POINTS;
}

/* A start that is off by as much as similarities of pictures are. */
static void disturb(struct poses_model *m, uint64_t seed)
{
    for (int v = 0; v < VIEWS; v++) {
        const double turn[3] = { random_of(&seed, -0.5, 0.5) * DEG, random_of(&seed, -0.5, 0.5) * DEG,
                                 random_of(&seed, -1, 1) * DEG };
        double by[9];

        sst_rotation_from_vector(turn, by);
        sst_numbers_mul3(by, m->rotation[v], m->rotation[v]);
        m->centre[v][0] = v;
        m->centre[v][1] = m->centre[v][2] = 0;
    }
}

static void adjust(struct poses_model *m, const struct poses_tracks *tracks, struct poses_adjust how)
{
    static const double sigma[] = { 30, 8, 2, 1 };
    double cost;

    for (size_t i = 0; i < ARRAY_LEN(sigma); i++) {
        how.sigma_px = sigma[i];
        how.rounds = 40;
        assert_int_equal(poses_adjust(m, tracks, &how, &cost), 0);
    }
}

static const bool all[VIEWS] = { true, true, true, true, true, true, true, true, true, true };

static double gap(const struct poses_model *m, int v)
{
    const double *a = m->centre[v], *b = m->centre[v - 1];

    return hypot(hypot(a[0] - b[0], a[1] - b[1]), a[2] - b[2]);
}

/* Exact sights beside wrong ones: other points of the scene then meet within 0.1 px in the cameras that are found, the
 * same bytes with more threads. */
static void cameras_on_a_line(void **state SST_UNUSED)
{
    struct poses_adjust how = { .linked = all, .line_along = POSES_LINE_ALONG, .line_across = POSES_LINE_ACROSS };
    struct poses_model truth, m, one, other;
    struct poses_tracks tracks, check;

    make_truth(&truth, 1);
    see(&tracks, &truth, 0.3, 0.1);
    assert_int_equal(poses_model_copy(&m, &truth), 0);
    disturb(&m, 5);
    poses_triangulate(&m, &tracks);
    assert_true(poses_median(&m, &tracks) > 2);
    if (small_level() < 2) {
        assert_int_equal(poses_model_copy(&one, &m), 0);
        adjust(&one, &tracks, how);
    }
    how.threads = 3;
    adjust(&m, &tracks, how);
    if (small_level() < 2) {
        assert_memory_equal(m.rotation, one.rotation, VIEWS * sizeof(*m.rotation));
        assert_memory_equal(m.centre, one.centre, VIEWS * sizeof(*m.centre));
        assert_memory_equal(m.point, one.point, POINTS * sizeof(*m.point));
        poses_model_fini(&one);
    }
    assert_true(poses_median(&m, &tracks) < 0.3);
    make_truth(&other, 1);
    for (int t = 0; t < POINTS; t++)
        other.point[t][2] += 3;
    see(&check, &other, 0, 0);
    poses_triangulate(&m, &check);
    assert_true(poses_median(&m, &check) < 0.1);
    poses_normalise(&m, all);
    poses_normalise(&truth, all);
    for (int v = 1; v < VIEWS; v++)
        assert_true(fabs(gap(&m, v) - gap(&truth, v)) < 0.05);
    poses_tracks_fini(&tracks);
    poses_tracks_fini(&check);
    poses_model_fini(&truth);
    poses_model_fini(&other);
    poses_model_fini(&m);
}

/* A focal length that is 20 % off, and k1, are found. */
static void lens_is_found(void **state SST_UNUSED)
{
    struct poses_model truth, m;
    struct poses_tracks tracks;

    make_truth(&truth, 2);
    see(&tracks, &truth, 0, 0);
    for (int i = 0; i < tracks.sights; i++) {
        struct poses_sight *s = tracks.sight + i;
        const double scale = 1 + 0.1 * (s->x * s->x + s->y * s->y) / (FOCAL * FOCAL);

        s->x *= scale;
        s->y *= scale;
    }
    assert_int_equal(poses_model_copy(&m, &truth), 0);
    m.focal = 1.2 * FOCAL;
    poses_triangulate(&m, &tracks);
    adjust(&m, &tracks, (struct poses_adjust){ .linked = all, .free_focal = true, .free_k1 = true });
    assert_true(poses_median(&m, &tracks) < 0.01);
    assert_true(fabs(m.k1 - 0.1) < 0.01);
    assert_true(fabs(m.focal / FOCAL - 1) < 0.01);
    poses_tracks_fini(&tracks);
    poses_model_fini(&truth);
    poses_model_fini(&m);
}

/* A focal length that is fixed stays, whatever its prior is, and does not stop views and points. */
static void fixed_focal_length_has_no_prior(void **state SST_UNUSED)
{
    struct poses_model truth, m;
    struct poses_tracks tracks;

    make_truth(&truth, 1);
    see(&tracks, &truth, 0.3, 0.1);
    assert_int_equal(poses_model_copy(&m, &truth), 0);
    disturb(&m, 5);
    poses_triangulate(&m, &tracks);
    adjust(&m, &tracks,
           (struct poses_adjust){ .linked = all,
                                  .line_along = POSES_LINE_ALONG,
                                  .line_across = POSES_LINE_ACROSS,
                                  .focal_prior = 2 * FOCAL,
                                  .focal_sigma = 0.03 });
    assert_true(m.focal == FOCAL);
    assert_true(poses_median(&m, &tracks) < 0.3);
    poses_tracks_fini(&tracks);
    poses_model_fini(&truth);
    poses_model_fini(&m);
}

/* Given poses whose compass is off by a degree about the vertical, z here: positions and pictures correct it. */
static void compass_is_corrected(void **state SST_UNUSED)
{
    struct poses_prior prior[VIEWS];
    struct poses_model truth, m;
    struct poses_tracks tracks;
    double turn[9], v[3], between[9];

    make_truth(&truth, 3);
    see(&tracks, &truth, 0.3, 0.05);
    assert_int_equal(poses_model_copy(&m, &truth), 0);
    sst_rotation_from_vector((double[]){ 0, 0, 1 * DEG }, turn);
    for (int k = 0; k < VIEWS; k++) {
        prior[k] = (struct poses_prior){
            .sigma_angle = 1 * DEG, .sigma_centre = 0.02, .axis = { 0, 0, 1 }, .sigma_axis = 30 * DEG
        };
        sst_numbers_mul3(truth.rotation[k], turn, m.rotation[k]);
        memcpy(prior[k].rotation, m.rotation[k], sizeof(prior[k].rotation));
        memcpy(prior[k].centre, truth.centre[k], sizeof(prior[k].centre));
    }
    poses_triangulate(&m, &tracks);
    adjust(&m, &tracks, (struct poses_adjust){ .linked = all, .prior = prior });
    for (int k = 0; k < VIEWS; k++) {
        sst_rotation_between(m.rotation[k], truth.rotation[k], between);
        sst_rotation_to_vector(between, v);
        assert_true(fabs(v[2]) < 0.1 * DEG);
    }
    poses_tracks_fini(&tracks);
    poses_model_fini(&truth);
    poses_model_fini(&m);
}

/* A matrix with gaps: the solution satisfies it. */
static void skyline_solves(void **state SST_UNUSED)
{
    enum { N = 30 };
    int first[N];
    double full[N][N] = { { 0 } }, x[N], b[N];
    struct poses_skyline m;
    uint64_t seed = 4;

    for (int i = 0; i < N; i++) {
        first[i] = i == N - 1 ? 0 : sst_max_int(0, i - 4);
        for (int j = first[i]; j <= i; j++)
            full[i][j] = full[j][i] = i == j ? 10 : random_of(&seed, -1, 1) / (i == N - 1 ? 10 : 1);
    }
    assert_int_equal(poses_skyline_init(&m, first, N), 0);
    for (int i = 0; i < N; i++) {
        x[i] = b[i] = random_of(&seed, -1, 1);
        for (int j = first[i]; j <= i; j++)
            m.row[i][j] = full[i][j];
    }
    assert_true(poses_skyline_factor(&m));
    poses_skyline_substitute(&m, x);
    for (int i = 0; i < N; i++) {
        double sum = 0;

        for (int j = 0; j < N; j++)
            sum += full[i][j] * x[j];
        assert_true(fabs(sum - b[i]) < 1e-12);
    }
    poses_skyline_clear(&m);
    assert_false(poses_skyline_factor(&m));
    poses_skyline_fini(&m);
}

/* Similarities of pictures that a line of cameras takes become equal steps, rolls, and tilts. */
static void start_on_a_line(void **state SST_UNUSED)
{
    enum { N = 4 };
    struct poses_pair pair[N - 1];
    bool linked[N] = { true, true, true, true };
    struct sst_posed posed = { .count = N, .width = 800, .height = 800 };
    struct poses_scene scene = { .posed = &posed, .views = N, .pair = pair, .pairs = N - 1, .linked = linked };
    const double shift[N - 1] = { -30, -30, -40 }; /* the last view is tilted by 10 px */
    struct poses_model m;
    double v[3];

    for (int i = 0; i < N - 1; i++)
        pair[i] =
            (struct poses_pair){ .a = i, .b = i + 1, .count = 100, .share = 1, .similarity = { 1, 0, shift[i], 0 } };
    assert_int_equal(poses_model_init(&m, N, 0), 0);
    m.focal = FOCAL;
    assert_true(poses_start_line(&m, &scene));
    for (int i = 0; i < N; i++)
        assert_true(fabs(m.centre[i][0] - i) < 1e-12 && m.centre[i][1] == 0);
    sst_rotation_to_vector(m.rotation[3], v);
    assert_true(fabs(v[1] + 10 / FOCAL) < 1e-12 && fabs(v[0]) + fabs(v[2]) < 1e-12);
    poses_model_fini(&m);
}

/* Features joined through a third picture are one track; one that sees a picture twice is none. */
/* A view on the line matches little, one nothing; of names that are in order, neither is moved. */
static void views_are_ordered(void **state SST_UNUSED)
{
    enum { N = 8, DULL = 4, BLIND = 2 };
    static const int place[2][N] = { { 0, 1, 2, 3, 4, 5, 6, 7 }, { 5, 0, 7, 2, 4, 6, 1, 3 } };
    static const int as_on_the_line[N] = { 1, 6, 7, 4, 0, 5, 2, 3 }; /* the blind one last */

    for (int mixed = 0; mixed < 2; mixed++) {
        int alike[N * N], order[N];

        for (int i = 0; i < N * N; i++) {
            const int a = place[mixed][i / N], b = place[mixed][i % N], apart = abs(a - b);
            const int good = apart == 0 || a == BLIND || b == BLIND ? 0 : 200 / (apart * apart);

            alike[i] = 30 + (a + b) % 5 + (a == DULL || b == DULL ? good / 3 : good);
        }
        assert_int_equal(poses_order(order, alike, N), 0);
        assert_memory_equal(order, mixed ? as_on_the_line : place[0], sizeof(order));
    }
}

/* Descriptors of single parts: distances follow from the parts that both have. */
static void descriptors_match(void **state SST_UNUSED)
{
    enum { N = 70, MIXED = 3 }; /* more than a block */
    static int16_t a[N][CV_DESCRIPTOR], b[N][CV_DESCRIPTOR];
    const struct cv_features left = { N, NULL, a[0] }, right = { N, NULL, b[0] };
    int match[N][2], count;

    for (int i = 0; i < N; i++) {
        a[i][i] = 512;
        b[N - 1 - i][i] = 512;
    }
    assert_int_equal(poses_descriptors_match(&left, &right, match, &count), 0);
    assert_int_equal(count, N);
    for (int i = 0; i < N; i++) {
        assert_int_equal(match[i][0], i);
        assert_int_equal(match[i][1], N - 1 - i);
    }
    memcpy(b[0], b[N - 1], sizeof(b[0])); /* a[0] has two alike, a[N - 1] none */
    a[MIXED][MIXED] = 362;                /* between two: 0.765 of the distance to the other */
    a[MIXED][MIXED + 1] = 362;
    assert_int_equal(poses_descriptors_match(&left, &right, match, &count), 0);
    assert_int_equal(count, N - 3);
    for (int i = 0; i < count; i++)
        assert_true(match[i][0] != 0 && match[i][0] != N - 1 && match[i][0] != MIXED);
    assert_int_equal(poses_descriptors_match(&left, &(struct cv_features){ 1, NULL, b[0] }, match, &count), 0);
    assert_int_equal(count, 0);
}

static void tracks_join(void **state SST_UNUSED)
{
    float at[2][2] = { { 1, 2 }, { 3, 4 } };
    struct cv_features feature[3] = { { 2, at, NULL }, { 2, at, NULL }, { 2, at, NULL } };
    int first[2][2] = { { 0, 1 }, { 1, 0 } }, second[1][2] = { { 1, 1 } }, third[1][2] = { { 0, 0 } };
    struct poses_pair pair[3] = { { .a = 0, .b = 1, .count = 2, .match = first },
                                  { .a = 1, .b = 2, .count = 1, .match = second },
                                  { .a = 1, .b = 2, .count = 1, .match = third } };
    bool linked[3] = { true, true, true };
    struct sst_posed posed = { .count = 3, .width = 8, .height = 8 };
    struct poses_scene scene = {
        .posed = &posed, .views = 3, .feature = feature, .pair = pair, .pairs = 3, .linked = linked
    };
    struct poses_tracks tracks;

    assert_int_equal(poses_tracks_make(&tracks, &scene), 0);
    assert_int_equal(tracks.tracks, 2);
    assert_int_equal(tracks.sights, 6);
    poses_tracks_fini(&tracks);
    pair[1].match = first; /* joins both features of view 2 with one of view 1 by different ways */
    pair[1].count = 2;
    assert_int_equal(poses_tracks_make(&tracks, &scene), 0);
    assert_int_equal(tracks.tracks, 0);
    poses_tracks_fini(&tracks);
}

/* An adjusted lens before a view's own is stored as one lens that projects alike. */
static void lenses_join(void **state SST_UNUSED)
{
    static const double own[3][SST_LENS_MAX] = { { 0 },
                                                 { -0.08, 0.02, 0.001, -0.0005, 0.01 },
                                                 { 0.1, 0.05, 0.001, 0.0005, 0.01, 0.15, 0.02, 0.003 } };
    static const int lens[3] = { 0, 5, 8 };
    const double k1 = 0.04, factor = 1.05;

    for (int i = 0; i < 3; i++) {
        struct sst_posed posed;
        struct sst_posed_solved solved;
        struct sst_calib_camera before;
        bool placed[2] = { true, true };
        struct poses_scene scene = {
            .posed = &posed, .views = 2, .placed = placed, .focal = FOCAL, .focal_known = true, .lenses = true
        };

        assert_int_equal(sst_posed_init(&posed, 2), 0);
        assert_int_equal(poses_model_init(&scene.model, 2, 0), 0);
        scene.model.focal = factor * FOCAL;
        scene.model.k1 = k1;
        scene.model.centre[1][0] = 1;
        for (int k = 0; k < 2; k++) {
            struct sst_calib_camera *cam = &posed.view[k].camera;

            cam->fx = FOCAL;
            cam->fy = 1.01 * FOCAL;
            cam->cx = cam->cy = HALF;
            cam->lens = lens[i];
            memcpy(cam->k, own[i], sizeof(cam->k));
        }
        before = posed.view[1].camera;
        assert_int_equal(poses_report(&scene, &(struct sst_posed_solve_config){ .free_lens = true }, &solved), 0);
        assert_int_equal(posed.view[1].camera.lens, lens[i] ? lens[i] : 5);
        for (int p = 0; p < 25; p++) {
            const double a = 0.2 * (p % 5 - 2), b = 0.2 * (p / 5 - 2), by = factor * (1 + k1 * (a * a + b * b));
            double should[2], is[2];

            sst_camera_distort(&before, by * a, by * b, &should[0], &should[1]);
            sst_camera_distort(&posed.view[1].camera, a, b, &is[0], &is[1]);
            assert_true(hypot(should[0] - is[0], should[1] - is[1]) < 0.1);
        }
        sst_posed_solved_fini(&solved);
        poses_model_fini(&scene.model);
        sst_posed_fini(&posed);
    }
}

/* Fewer than two views are no result, and no prior of a rig. */
static void two_views_are_placed(void **state SST_UNUSED)
{
    bool placed[2][2] = { { true, false }, { true, false } };
    struct poses_scene scene[2] = { { .dir = "a", .views = 2, .placed = placed[0] },
                                    { .dir = "b", .views = 2, .placed = placed[1] } };
    char text[SST_LOG_MAX] = "";

    for (int s = 0; s < 2; s++) {
        assert_int_equal(poses_model_init(&scene[s].model, 2, 0), 0);
        scene[s].model.centre[1][0] = 1;
    }
    assert_int_equal(poses_share_rig(scene, 2, &(struct sst_posed_solve_config){ .threads = 1 }), 0);
    assert_false(placed[0][1] || placed[1][1]);
    sst_log_hold_errors(text);
    assert_int_equal(poses_check_placed(&scene[0]), -EDOM);
    placed[1][1] = true;
    assert_int_equal(poses_check_placed(&scene[1]), 0);
    sst_log_hold_errors(NULL);
    assert_contains(text, "a: too few matches");
    poses_model_fini(&scene[0].model);
    poses_model_fini(&scene[1].model);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(cameras_on_a_line),
        cmocka_unit_test(lens_is_found),
        cmocka_unit_test(fixed_focal_length_has_no_prior),
        cmocka_unit_test(compass_is_corrected),
        cmocka_unit_test(skyline_solves),
        cmocka_unit_test(start_on_a_line),
        cmocka_unit_test(views_are_ordered),
        cmocka_unit_test(descriptors_match),
        cmocka_unit_test(tracks_join),
        cmocka_unit_test(lenses_join),
        cmocka_unit_test(two_views_are_placed),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
