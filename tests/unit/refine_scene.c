/* pipeline/method/refine: labels of a synthetic light field of things standing on a table, and that the normals earn
 * their keep. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "pipeline/method/refine/refine.h"
#include "tests/random.h"
#include "tests/small.h"
#include "tests/test.h"

#define SIDE         3
#define VIEWS        (SIDE * SIDE)
#define BAND         5
#define TABLE_TOP_Y  60.0
#define TABLE_FAR_PX 8.0
#define TABLE_SLOPE  0.14 /* px of disparity per row: near rows shift more */

/* An upright thing: an ellipse cut off at its foot, where it stands on the table and has the table's disparity. */
struct thing {
    int label;
    double x, foot, half_width, height;
};

static const struct thing things[] = {
    { SST_LABEL_HORSE, 80, 130, 32, 80 },
    { SST_LABEL_BICYCLE, 230, 160, 40, 70 },
    { SST_LABEL_MOTORCYCLE, 150, 205, 36, 75 },
};

static uint64_t seed;

static double table_disparity(double y_ref)
{
    return TABLE_FAR_PX + TABLE_SLOPE * (y_ref - TABLE_TOP_Y);
}

/* Truth of one ray: the nearest surface. */
static uint8_t trace(double x, double y, const struct sst_view *v, double *disp)
{
    uint8_t label = SST_LABEL_BUILDING;
    const double table = table_disparity(y) / (1 - TABLE_SLOPE * v->by);

    *disp = 6;
    if (y + table * v->by >= TABLE_TOP_Y) {
        label = SST_LABEL_TABLE;
        *disp = table;
    }
    for (size_t i = 0; i < ARRAY_LEN(things); i++) {
        const struct thing *t = &things[i];
        const double d = table_disparity(t->foot), u = (x + d * v->bx - t->x) / t->half_width;
        const double h = (t->foot - (y + d * v->by)) / t->height; /* 0 at the foot, 1 at the top */

        if (d >= *disp - 1e-9 && h >= 0 && u * u + (2 * h - 0.8) * (2 * h - 0.8) / 1.44 <= 1) {
            label = (uint8_t)t->label;
            *disp = d;
        }
    }
    return label;
}

struct scene {
    struct sst_lightfield lf;
    struct sst_view views[VIEWS];
    struct sst_map_u8 truth[VIEWS], hcsm[VIEWS];
};

static bool near_border(const struct sst_map_u8 *truth, int x, int y)
{
    const uint8_t label = sst_map_u8_row(truth, y)[x];

    for (int j = sst_max_int(y - BAND, 0); j <= sst_min_int(y + BAND, truth->height - 1); j++) {
        for (int i = sst_max_int(x - BAND, 0); i <= sst_min_int(x + BAND, truth->width - 1); i++) {
            if (sst_map_u8_row(truth, j)[i] != label)
                return true;
        }
    }
    return false;
}

static void make_view(struct scene *s, int k, double noise_px)
{
    struct sst_view *v = &s->views[k];
    const int w = s->lf.width, h = s->lf.height;

    v->present = true;
    v->bx = k % SIDE - 1;
    v->by = k / SIDE - 1;
    assert_int_equal(sst_map_u16_init(&v->disp, w, h), 0);
    assert_int_equal(sst_map_u8_init(&v->label, w, h), 0);
    assert_int_equal(sst_map_u8_init(&s->truth[k], w, h), 0);
    assert_int_equal(sst_map_u8_init(&s->hcsm[k], w, h), 0);
    for (int y = 0; y < h; y++) {
        for (int x = 0; x < w; x++) {
            double d;

            sst_map_u8_row(&s->truth[k], y)[x] = trace(x, y, v, &d);
            sst_map_u16_row(&v->disp, y)[x] = sst_disp_q6(&s->lf, d + noise_px * test_normal(&seed));
        }
    }
    for (int y = 0; y < h; y++) {
        for (int x = 0; x < w; x++) {
            if (!near_border(&s->truth[k], x, y) && sst_random(&seed) > 0.3)
                sst_map_u8_row(&s->hcsm[k], y)[x] = sst_map_u8_row(&s->truth[k], y)[x];
        }
    }
}

static void restore(struct scene *s)
{
    for (int k = 0; k < VIEWS; k++)
        memcpy(s->views[k].label.data, s->hcsm[k].data, (size_t)s->lf.height * s->hcsm[k].stride);
}

static void scene_init(struct scene *s, double noise_px)
{
    memset(s, 0, sizeof(*s));
    seed = 1;
    s->lf = (struct sst_lightfield){ .rows = SIDE,
                                     .cols = SIDE,
                                     .width = 300,
                                     .height = 220,
                                     .ref_view = VIEWS / 2,
                                     .focal_px = 320,
                                     .disp_min_px = 2,
                                     .views = s->views };
    s->lf.classes = sst_classes_default;
    for (int k = 0; k < VIEWS; k++)
        make_view(s, k, noise_px);
    restore(s);
}

static void scene_fini(struct scene *s)
{
    for (int k = 0; k < VIEWS; k++) {
        sst_map_u16_fini(&s->views[k].disp);
        sst_map_u8_fini(&s->views[k].label);
        sst_map_u8_fini(&s->truth[k]);
        sst_map_u8_fini(&s->hcsm[k]);
    }
}

/* Percent right of the pixels that the HCSM leaves open: of all, and of those on the things. */
struct score {
    double open, right, things;
};

static struct score score(const struct scene *s)
{
    double n = 0, open = 0, right = 0, thing = 0, thing_right = 0;

    for (int k = 0; k < VIEWS; k++) {
        for (int i = 0; i < s->lf.width * s->lf.height; i++) {
            const int x = i % s->lf.width, y = i / s->lf.width, truth = sst_map_u8_row(&s->truth[k], y)[x];
            const bool hit = sst_map_u8_row(&s->views[k].label, y)[x] == truth;

            n++;
            if (sst_map_u8_row(&s->hcsm[k], y)[x])
                continue;
            open++;
            right += hit;
            thing += truth >= SST_LABEL_HORSE;
            thing_right += hit && truth >= SST_LABEL_HORSE;
        }
    }
    return (struct score){ 100 * open / n, 100 * right / open, 100 * thing_right / thing };
}

static struct score refine(struct scene *s, double p_normal, bool ground_plane, double noise_px)
{
    struct sst_refine_config cfg;
    struct score result;

    sst_refine_config_defaults(&cfg);
    cfg.p_normal = p_normal;
    cfg.ground_plane = ground_plane;
    cfg.matcher_sigma_px = fmax(cfg.matcher_sigma_px, noise_px);
    restore(s);
    assert_int_equal(sst_refine_labels(&s->lf, &cfg, NULL), 0);
    result = score(s);
    printf("noise %.1f px, p_n %g, ground plane %d: open %.2f %%, right %.2f %%, on things %.2f %%\n", noise_px,
           p_normal, ground_plane, result.open, result.right, result.things);
    return result;
}

/*
 * The table has the disparities of all things on it, so most open pixels of a thing are conflicts with the ground. The
 * paper's energy alone, the same without normals, and the energy with the plane of the table known.
 */
static void normals_and_plane_beat_distance_alone(void **state SST_UNUSED)
{
    static const struct {
        double noise_px, right, things, plane_right, plane_things;
    } bars[] = { { 0, 99.5, 98.5, 99.9, 99.9 }, { 0.2, 98, 95, 98.5, 96 }, { 0.5, 96.5, 92, 97, 93 } };

    for (size_t i = 0; i < ARRAY_LEN(bars); i++) {
        struct score energy, distance, plane;
        struct scene s;

        scene_init(&s, bars[i].noise_px);
        energy = refine(&s, 1, false, bars[i].noise_px);
        distance = refine(&s, 0, false, bars[i].noise_px);
        plane = refine(&s, 1, true, bars[i].noise_px);
        assert_true(energy.open > 40 && energy.open < 45);
        assert_true(energy.right > bars[i].right && energy.things > bars[i].things);
        assert_true(energy.right > distance.right + 4 && energy.things > distance.things + 20);
        assert_true(plane.right > bars[i].plane_right && plane.things > bars[i].plane_things);
        scene_fini(&s);
    }
}

static void threads_do_not_matter(void **state SST_UNUSED)
{
    struct sst_label_fit fits[2][SST_MAX_CLASSES];
    uint8_t *first[VIEWS];
    struct scene s;

    scene_init(&s, 0.2);
    memset(fits, 0, sizeof(fits));
    for (int pass = 0; pass < 2; pass++) {
        struct sst_refine_config cfg;

        sst_refine_config_defaults(&cfg);
        cfg.threads = pass ? 5 : 1;
        restore(&s);
        assert_int_equal(sst_refine_labels(&s.lf, &cfg, fits[pass]), 0);
        for (int k = 0; k < VIEWS; k++) {
            const size_t bytes = (size_t)s.lf.height * s.views[k].label.stride;

            if (pass) {
                assert_memory_equal(first[k], s.views[k].label.data, bytes);
                free(first[k]);
                continue;
            }
            first[k] = malloc(bytes);
            assert_non_null(first[k]);
            memcpy(first[k], s.views[k].label.data, bytes);
        }
    }
    for (int i = 0; i < s.lf.classes.count; i++) {
        assert_true(fits[0][i].mean_px == fits[1][i].mean_px && fits[0][i].sigma_px == fits[1][i].sigma_px);
        assert_int_equal(fits[0][i].count, fits[1][i].count);
    }
    scene_fini(&s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(normals_and_plane_beat_distance_alone),
        plain_test(threads_do_not_matter),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
