/* Imports of poses: each format written here from a model with known projections; round trips by the exports. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "pipeline/posed/export.h"
#include "pipeline/posed/import/import.h"
#include "tests/posed_model.h"

static struct truth truth[MODEL_VIEWS];
static FILE *out; /* file that is written */

static void begin(const char *name)
{
    out = fopen(test_path("%s", name), "wb");
    assert_non_null(out);
}

static void end(void)
{
    assert_int_equal(fclose(out), 0);
    out = NULL;
}

static void make_dir(const char *name)
{
    assert_int_equal(sst_path_make_dir(test_path("%s", name)), 0);
}

/* Import the source and compare. */
static void check(const char *source, double focal_px)
{
    char from[SST_PATH_MAX], to[SST_PATH_MAX];
    struct sst_posed_import_config cfg = { .source = from, .out = to, .focal_px = focal_px, .force = true, .threads = 2 };
    struct sst_posed posed;

    snprintf(from, sizeof(from), "%s", test_path("%s", source));
    snprintf(to, sizeof(to), "%s", test_path("%s.lf", source));
    assert_int_equal(sst_posed_import(&cfg), 0);
    assert_true(sst_posed_is(to));
    assert_int_equal(sst_posed_load(&posed, to), 0);
    assert_projects(&posed, truth);
    assert_int_equal(posed.width, MODEL_WIDTH);
    assert_int_equal(posed.channels, 3);
    sst_posed_fini(&posed);
}

/* Round trip: export the imported light field and import the export. */
static void check_round_trip(const char *source)
{
    static const char *const formats[] = { "colmap", "nerfstudio" };
    char dir[SST_PATH_MAX], to[SST_PATH_MAX], name[64];

    snprintf(dir, sizeof(dir), "%s", test_path("%s.lf", source));
    for (size_t i = 0; i < ARRAY_LEN(formats); i++) {
        struct sst_export_config cfg = { .format = formats[i], .dir = dir, .out = to, .force = true, .threads = 1 };

        if (i && truth[0].k[5] != 0) /* nerfstudio's lens has five coefficients */
            continue;
        snprintf(name, sizeof(name), "%s.%s", source, formats[i]);
        snprintf(to, sizeof(to), "%s", test_path("%s", name));
        assert_int_equal(sst_posed_export(&cfg), 0);
        check(name, 0);
    }
}

/* --- COLMAP ------------------------------------------------------------------------------------------------------- */

/* w first; these turns are small. */
static void quaternion(double q[4], const struct truth *c)
{
    q[0] = sqrt(1 + c->R[0] + c->R[4] + c->R[8]) / 2;
    q[1] = (c->R[7] - c->R[5]) / 4 / q[0];
    q[2] = (c->R[2] - c->R[6]) / 4 / q[0];
    q[3] = (c->R[3] - c->R[1]) / 4 / q[0];
}

/* Parameters of a lens model. @return their number */
static int parameters(double p[12], const char *model)
{
    const struct truth *c = &truth[0];
    const bool one = strstr(model, "SIMPLE") || !strcmp(model, "RADIAL");
    const int k = !strcmp(model, "SIMPLE_RADIAL") ? 1 : !strcmp(model, "RADIAL") ? 2 : !strcmp(model, "OPENCV") ? 4
                  : !strcmp(model, "FULL_OPENCV") ? 8 : 0;
    int n = 0;

    p[n++] = c->fx;
    if (!one)
        p[n++] = c->fy;
    p[n++] = c->cx + 0.5;
    p[n++] = c->cy + 0.5;
    for (int i = 0; i < k; i++)
        p[n++] = c->k[i];
    return n;
}

static void put_colmap_text(const char *model)
{
    double p[12], q[4], t[3];
    const int n = parameters(p, model);
    char name[32];

    begin("text/sparse/cameras.txt");
    fprintf(out, "# comment\n7 %s %d %d", model, MODEL_WIDTH, MODEL_HEIGHT);
    for (int i = 0; i < n; i++)
        fprintf(out, " %.17g", p[i]);
    fputs("\r\n", out);
    end();
    begin("text/sparse/images.txt");
    for (int i = 0; i < MODEL_VIEWS; i++) {
        picture_name(name, i);
        quaternion(q, &truth[i]);
        truth_translation(t, &truth[i]);
        fprintf(out, "%d %.17g %.17g %.17g %.17g %.17g %.17g %.17g 7 %s\n%s\n", 3 * i + 1, q[0], q[1], q[2], q[3], t[0],
                t[1], t[2], name, i % 2 ? "" : "12.5 13.5 -1 14 15 2");
    }
    end();
    begin("text/sparse/points3D.txt");
    for (int i = 0; i < MODEL_POINTS; i++) {
        double X[3];

        truth_point(X, i);
        fprintf(out, "%d %.17g %.17g %.17g 1 2 3 %g 1 0 4 1\n", i, X[0], X[1], X[2], 0.1 * (i + 1));
    }
    end();
}

static void text_models_project_as_they_should(void **state SST_UNUSED)
{
    static const struct {
        const char *name;
        int coefficients;
    } models[] = { { "SIMPLE_PINHOLE", 0 }, { "SIMPLE_RADIAL", 1 }, { "RADIAL", 2 }, { "OPENCV", 4 }, { "FULL_OPENCV", 8 } };
    struct sst_posed posed;

    make_dir("text");
    make_dir("text/sparse");
    put_pictures("text/images");
    for (size_t i = 0; i < ARRAY_LEN(models); i++) {
        truth_make(truth, models[i].coefficients);
        put_colmap_text(models[i].name);
        check("text", 0);
        check_round_trip("text");
    }
    assert_int_equal(sst_posed_load(&posed, test_path("text.lf")), 0);
    assert_int_equal(posed.point_count, MODEL_POINTS);
    assert_int_equal(posed.points[3].views, 2);
    assert_true(fabs(posed.points[3].at_mm[2] - 4750) < 1e-6);
    assert_true(fabs(posed.median_px - 0.7) < 1e-9);
    assert_false(posed.metric);
    assert_string_equal(posed.view[1].name, "b\xc3\xa4um 2.png");
    sst_posed_fini(&posed);
}

static void put(const void *data, size_t n)
{
    assert_int_equal(fwrite(data, 1, n, out), n); /* of a little-endian machine, as the tests run on */
}

static void put_u64(uint64_t v)
{
    put(&v, 8);
}

static void put_u32(uint32_t v)
{
    put(&v, 4);
}

static void binary_model_projects_as_it_should(void **state SST_UNUSED)
{
    double p[12], q[4], t[3], X[3], error = 0.25;
    char name[32];

    truth_make(truth, 8);
    make_dir("binary");
    put_pictures("binary/images");
    begin("binary/cameras.bin");
    put_u64(1);
    put_u32(5);
    put_u32(6); /* FULL_OPENCV */
    put_u64(MODEL_WIDTH);
    put_u64(MODEL_HEIGHT);
    put(p, sizeof(p[0]) * (size_t)parameters(p, "FULL_OPENCV"));
    end();
    begin("binary/images.bin");
    put_u64(MODEL_VIEWS);
    for (int i = 0; i < MODEL_VIEWS; i++) {
        picture_name(name, i);
        quaternion(q, &truth[i]);
        truth_translation(t, &truth[i]);
        put_u32((uint32_t)i + 1);
        put(q, sizeof(q));
        put(t, sizeof(t));
        put_u32(5);
        put(name, strlen(name) + 1);
        put_u64(1);
        put(t, 16);
        put_u64(~0ull);
    }
    end();
    begin("binary/points3D.bin");
    put_u64(MODEL_POINTS);
    for (int i = 0; i < MODEL_POINTS; i++) {
        truth_point(X, i);
        put_u64((uint64_t)i);
        put(X, sizeof(X));
        put("rgb", 3);
        put(&error, 8);
        put_u64(1);
        put_u32(1);
        put_u32(0);
    }
    end();
    check("binary", 0);
    check_round_trip("binary");
}

/* --- JSON --------------------------------------------------------------------------------------------------------- */

static void aos_projects_as_it_should(void **state SST_UNUSED)
{
    double t[3];
    char name[32];

    truth_make(truth, 0);
    for (int i = 0; i < MODEL_VIEWS; i++) {
        truth[i].cx = (MODEL_WIDTH - 1) / 2.0;
        truth[i].cy = (MODEL_HEIGHT - 1) / 2.0;
    }
    make_dir("aos");
    put_pictures("aos/images");
    begin("aos/poses.json");
    fputs("{\"images\": [", out);
    for (int i = 0; i < MODEL_VIEWS; i++) {
        const double *R = truth[i].R;
        const char *quote = i % 2 ? "\"" : "";

        picture_name(name, i);
        truth_translation(t, &truth[i]);
        fprintf(out, "%s{\"imagefile\": \"%s\", \"M3x4\": [", i ? "," : "", name);
        for (int row = 0; row < 3; row++)
            fprintf(out, "%s[%s%.17g%s, %.17g, %.17g, %s%.17g%s]", row ? "," : "", quote, R[3 * row], quote, R[3 * row + 1],
                    R[3 * row + 2], quote, t[row], quote);
        fputs("]}", out);
    }
    fputs("]}", out);
    end();
    check("aos", 70);
    check_round_trip("aos");
}

static void nerfstudio_projects_as_it_should(void **state SST_UNUSED)
{
    /* The world was turned and moved. */
    static const double A[12] = { 0, 0, 1, 0.3, 1, 0, 0, -2, 0, 1, 0, 5 };
    char name[32];

    truth_make(truth, 5);
    make_dir("nerf");
    put_pictures("nerf/images");
    begin("nerf/transforms.json");
    fprintf(out, "{\"camera_model\": \"OPENCV\", \"w\": %d, \"h\": %d, \"fl_x\": %.17g, \"fl_y\": %.17g, \"cx\": %.17g, \"cy\": "
                 "%.17g, \"k1\": %.17g, \"k2\": %.17g, \"p1\": %.17g, \"p2\": %.17g, \"k3\": %.17g, \"applied_transform\": "
                 "[[0, 0, 1, 0.3], [1, 0, 0, -2], [0, 1, 0, 5]], \"frames\": [",
            MODEL_WIDTH, MODEL_HEIGHT, truth[0].fx, truth[0].fy, truth[0].cx + 0.5, truth[0].cy + 0.5, truth[0].k[0],
            truth[0].k[1], truth[0].k[2], truth[0].k[3], truth[0].k[4]);
    for (int i = 0; i < MODEL_VIEWS; i++) {
        picture_name(name, i);
        fprintf(out, "%s{\"file_path\": \"./images/%s\", \"transform_matrix\": [", i ? "," : "", name);
        for (int row = 0; row < 3; row++) {
            double v[4] = { 0, 0, 0, A[4 * row + 3] };

            for (int l = 0; l < 3; l++) {
                v[0] += A[4 * row + l] * truth[i].R[l];
                v[1] -= A[4 * row + l] * truth[i].R[3 + l];
                v[2] -= A[4 * row + l] * truth[i].R[6 + l];
                v[3] += A[4 * row + l] * truth[i].centre[l];
            }
            fprintf(out, "[%.17g, %.17g, %.17g, %.17g], ", v[0], v[1], v[2], v[3]);
        }
        fputs("[0, 0, 0, 1]]}", out);
    }
    fputs("]}", out);
    end();
    check("nerf", 0);
    check_round_trip("nerf");
}

static void opensfm_projects_as_it_should(void **state SST_UNUSED)
{
    double t[3];
    char name[32];

    truth_make(truth, 5);
    make_dir("sfm");
    put_pictures("sfm/images");
    begin("sfm/reconstruction.json");
    fprintf(out, "[{\"cameras\": {\"a b\": {\"projection_type\": \"brown\", \"width\": %d, \"height\": %d, \"focal_x\": %.17g, "
                 "\"focal_y\": %.17g, \"c_x\": %.17g, \"c_y\": %.17g, \"k1\": %.17g, \"k2\": %.17g, \"p1\": %.17g, "
                 "\"p2\": %.17g, \"k3\": %.17g}}, \"reference_lla\": {\"latitude\": 48.5, \"longitude\": 14.25, "
                 "\"altitude\": 0}, \"shots\": {",
            MODEL_WIDTH, MODEL_HEIGHT, truth[0].fx / MODEL_WIDTH, truth[0].fy / MODEL_WIDTH,
            (truth[0].cx - (MODEL_WIDTH - 1) / 2.0) / MODEL_WIDTH, (truth[0].cy - (MODEL_HEIGHT - 1) / 2.0) / MODEL_WIDTH,
            truth[0].k[0], truth[0].k[1], truth[0].k[2], truth[0].k[3], truth[0].k[4]);
    for (int i = 0; i < MODEL_VIEWS; i++) {
        picture_name(name, i);
        truth_translation(t, &truth[i]);
        fprintf(out, "%s\"%s\": {\"camera\": \"a b\", \"rotation\": [%.17g, %.17g, %.17g], \"translation\": [%.17g, %.17g, "
                     "%.17g]}",
                i ? "," : "", name, truth[i].turn[0], truth[i].turn[1], truth[i].turn[2], t[0], t[1], t[2]);
    }
    fputs("}, \"points\": {\"1\": {\"coordinates\": [0, 0, 5], \"color\": [1, 2, 3]}}}]", out);
    end();
    check("sfm", 0);
    check_round_trip("sfm");
}

/* --- other files -------------------------------------------------------------------------------------------------- */

static void llff_projects_as_it_should(void **state SST_UNUSED)
{
    const char header[] = "{'descr': '<f8', 'fortran_order': False, 'shape': (8, 17), }\n";
    const uint16_t bytes = sizeof(header) - 1;

    truth_make(truth, 0);
    for (int i = 0; i < MODEL_VIEWS; i++) {
        truth[i].cx = (MODEL_WIDTH - 1) / 2.0;
        truth[i].cy = (MODEL_HEIGHT - 1) / 2.0;
    }
    make_dir("llff");
    put_pictures("llff/images");
    begin("llff/poses_bounds.npy");
    put("\x93NUMPY\1\0", 8);
    put(&bytes, 2);
    put(header, bytes);
    for (int i = 0; i < MODEL_VIEWS; i++) {
        const double size[3] = { MODEL_HEIGHT, MODEL_WIDTH, truth[i].fx }, bounds[2] = { 1, 9 };

        for (int row = 0; row < 3; row++) {
            const double v[5] = { truth[i].R[3 + row], truth[i].R[row], -truth[i].R[6 + row], truth[i].centre[row], size[row] };

            put(v, sizeof(v));
        }
        put(bounds, sizeof(bounds));
    }
    end();
    check("llff", 0);
    check_round_trip("llff");
}

static void mrcal_projects_as_it_should(void **state SST_UNUSED)
{
    double t[3];

    truth_make(truth, 8);
    make_dir("mrcal");
    put_pictures("mrcal/images");
    for (int i = 0; i < MODEL_VIEWS; i++) {
        char name[80];

        snprintf(name, sizeof(name), "mrcal/b\xc3\xa4um %d.cameramodel", i + 1);
        begin(name);
        truth_translation(t, &truth[i]);
        fprintf(out, "{ # 'intrinsics': [ 1 ]\n 'lensmodel': 'LENSMODEL_OPENCV8',\n 'intrinsics': [ %.17g, %.17g, %.17g, %.17g",
                truth[i].fx, truth[i].fy, truth[i].cx, truth[i].cy);
        for (int j = 0; j < 8; j++)
            fprintf(out, ", %.17g", truth[i].k[j]);
        fprintf(out, ",],\n 'extrinsics': [ %.17g, %.17g, %.17g, %.17g, %.17g, %.17g,],\n 'imagersize': [ %d, %d,],\n}\n",
                truth[i].turn[0], truth[i].turn[1], truth[i].turn[2], t[0], t[1], t[2], MODEL_WIDTH, MODEL_HEIGHT);
        end();
    }
    check("mrcal", 0);
    check_round_trip("mrcal");
}

/* --- geo.txt ------------------------------------------------------------------------------------------------------ */

static void load_geo(struct sst_posed *posed, const char *text)
{
    char from[SST_PATH_MAX], to[SST_PATH_MAX];
    const struct sst_posed_import_config cfg = { .source = from, .out = to, .focal_px = 50, .force = true };

    begin("geo/geo.txt");
    fputs(text, out);
    end();
    snprintf(from, sizeof(from), "%s", test_path("geo/geo.txt"));
    snprintf(to, sizeof(to), "%s", test_path("geo.lf"));
    assert_int_equal(sst_posed_import(&cfg), 0);
    assert_int_equal(sst_posed_load(posed, to), 0);
    assert_true(posed->metric && posed->geographic);
}

static void assert_at(const struct sst_posed *posed, int view, const double X[3], const double want[2])
{
    double px[2];

    view_project(px, &posed->view[view].camera, X, 1000);
    if (!(hypot(px[0] - (want[0] + 31.5), px[1] - (want[1] + 23.5)) < 0.01))
        fail_msg("view %d: %.4f, %.4f, not %.4f, %.4f from the middle", view, px[0] - 31.5, px[1] - 23.5, want[0], want[1]);
}

/* From 20 m over the ground: f / Z = 2.5 px/m. */
static void angles_are_odms(void **state SST_UNUSED)
{
    struct sst_posed posed;

    make_dir("geo");
    for (int i = 0; i < 5; i++) {
        char name[32];

        snprintf(name, sizeof(name), "geo/%c.png", 'a' + i);
        put_picture(test_path("%s", name), i);
    }
    load_geo(&posed, "EPSG:4326\n# comment\na.png 14.3 48.3 320 0 0 0 1 1\nb.png 14.3 48.3 320 90 0 0\n"
                     "c.png 14.3 48.3 320 0 45 0\nd.png 14.3 48.3 320 90 45 0\ne.png 14.3 48.3 320.001 0 0 45\n");
    assert_true(fabs(posed.latitude - 48.3) < 1e-12 && fabs(posed.longitude - 14.3) < 1e-12 && posed.altitude_m == 320);
    /* 2 m east and 1 m north on the ground: to the right and up; with the top in the east: up to the left. */
    assert_at(&posed, 0, (const double[3]){ 2, 1, -20 }, (const double[2]){ 5, -2.5 });
    assert_at(&posed, 1, (const double[3]){ 2, 1, -20 }, (const double[2]){ -2.5, -5 });
    /* Half-way forward: the ground 20 m ahead is in the middle; to the left with a roll. */
    assert_at(&posed, 2, (const double[3]){ 0, 20, -20 }, (const double[2]){ 0, 0 });
    assert_at(&posed, 3, (const double[3]){ 20, 0, -20 }, (const double[2]){ 0, 0 });
    assert_at(&posed, 4, (const double[3]){ -20, 0, -20 }, (const double[2]){ 0, 0 });
    sst_posed_fini(&posed);
}

/* Places with longitude, latitude and zone coordinates, both from a survey's file. */
static void utm_is_where_longitude_and_latitude_say(void **state SST_UNUSED)
{
    static const char *const lines[] = { "EPSG:32633", "WGS84 UTM 33N", "+proj=utm +zone=33 +datum=WGS84 +units=m +no_defs" };
    struct sst_posed posed;
    char text[400];

    for (size_t i = 0; i < ARRAY_LEN(lines); i++) {
        snprintf(text, sizeof(text), "%s\na.png 450126.11627760687 5353828.794316645 320 0 0 0\n"
                                     "b.png 450069.2625109379 5353828.815501057 320 0 0 0\n",
                 lines[i]);
        load_geo(&posed, text);
        assert_true(fabs(posed.latitude - 48.335673) < 2e-8 && fabs(posed.longitude - 14.32703) < 2e-8);
        /* 56.85 m on the map, stretched by the scale there. */
        assert_true(fabs(hypot(posed.view[1].camera.position_mm[0], posed.view[1].camera.position_mm[1]) - 56873) < 20);
        assert_true(fabs(posed.view[1].camera.position_mm[2]) < 1);
        sst_posed_fini(&posed);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(text_models_project_as_they_should),
        cmocka_unit_test(binary_model_projects_as_it_should),
        cmocka_unit_test(aos_projects_as_it_should),
        cmocka_unit_test(nerfstudio_projects_as_it_should),
        cmocka_unit_test(opensfm_projects_as_it_should),
        cmocka_unit_test(llff_projects_as_it_should),
        cmocka_unit_test(mrcal_projects_as_it_should),
        cmocka_unit_test(angles_are_odms),
        cmocka_unit_test(utm_is_where_longitude_and_latitude_say),
    };

    sst_log_set_level(SST_LOG_ERROR);
    return cmocka_run_group_tests(tests, test_folder_create, test_folder_remove);
}
