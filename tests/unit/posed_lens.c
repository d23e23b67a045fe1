/* Lenses, moments and names of imports without poses: MATLAB's files built here byte by byte, other calibrations. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <zlib.h>

#include "base/log.h"
#include "pipeline/posed/import/import.h"
#include "tests/posed_model.h"

/* --- MATLAB's elements -------------------------------------------------------------------------------------------- */

struct bytes {
    uint8_t data[4096];
    size_t n;
};

static void add(struct bytes *b, const void *data, size_t n)
{
    memcpy(b->data + b->n, data, n);
    b->n += n;
}

static void add_element(struct bytes *b, uint32_t type, const void *data, size_t n)
{
    const uint32_t head[2] = { type, (uint32_t)n };

    add(b, head, sizeof(head));
    add(b, data, n);
    while (type != 15 && b->n % 8)
        b->data[b->n++] = 0;
}

/* Flags, dimensions and an empty name. */
static void begin_matrix(struct bytes *b, uint32_t class, int32_t rows, int32_t columns)
{
    add_element(b, 6, (const uint32_t[2]){ class, 0 }, 8);
    add_element(b, 5, (const int32_t[2]){ rows, columns }, 8);
    add_element(b, 1, "", 0);
}

static void add_doubles(struct bytes *b, const double *v, int rows, int columns)
{
    struct bytes m = { .n = 0 };

    begin_matrix(&m, 6, rows, columns);
    add_element(&m, 9, v, sizeof(*v) * (size_t)(rows * columns));
    add_element(b, 14, m.data, m.n);
}

/* Structure of a lens with IntrinsicMatrix, or with K as newer versions name it. */
static void add_lens(struct bytes *b, bool newer)
{
    static const double matrix[9] = { 70, 0, 31, 0, 71.5, 25, 0, 0, 1 }, k[9] = { 70, 0, 0, 0, 71.5, 0, 31, 25, 1 };
    char names[4][24] = { "RadialDistortion", "TangentialDistortion", "ImageSize", "IntrinsicMatrix" };
    struct bytes m = { .n = 0 };
    struct bytes size = { .n = 0 };

    if (newer)
        strcpy(names[3], "K");
    begin_matrix(&m, 2, 1, 1);
    add(&m, (const uint16_t[2]){ 5, 4 }, 4); /* a small element: the bytes of a name */
    add(&m, (const uint32_t[1]){ 24 }, 4);
    add_element(&m, 1, names, sizeof(names));
    add_doubles(&m, (const double[3]){ -0.11, 0.02, 0.004 }, 1, 3);
    add_doubles(&m, (const double[2]){ 0.0013, -0.0007 }, 1, 2);
    begin_matrix(&size, 6, 1, 2); /* whole numbers are stored in fewer bytes */
    add(&size, (const uint16_t[4]){ 4, 4, MODEL_HEIGHT, MODEL_WIDTH }, 8);
    add_element(&m, 14, size.data, size.n);
    add_doubles(&m, newer ? k : matrix, 3, 3);
    add_element(b, 14, m.data, m.n);
}

static void write_mat(const struct bytes *b)
{
    char header[129];
    FILE *f = fopen(test_path("lens.mat"), "wb");

    assert_non_null(f);
    snprintf(header, sizeof(header), "%-124s%c%cIM", "MATLAB 5.0 MAT-file", 0, 1);
    header[124] = 0;
    assert_int_equal(fwrite(header, 1, 128, f), 128);
    assert_int_equal(fwrite(b->data, 1, b->n, f), b->n);
    assert_int_equal(fclose(f), 0);
}

/* --- imports ------------------------------------------------------------------------------------------------------ */

static int import(struct sst_posed *posed, const char *lens, const char *moments)
{
    char from[SST_PATH_MAX], to[SST_PATH_MAX], file[SST_PATH_MAX];
    struct sst_posed_import_config cfg = { .source = from, .out = to, .moments = moments, .force = true };
    int err;

    snprintf(from, sizeof(from), "%s", test_path("pictures"));
    snprintf(to, sizeof(to), "%s", test_path("lf"));
    snprintf(file, sizeof(file), "%s", test_path("%s", lens ? lens : ""));
    cfg.lens = lens ? file : NULL;
    err = sst_posed_import_pictures(&cfg);
    return err ? err : sst_posed_load(posed, to);
}

static void assert_lens(void)
{
    static const double k[8] = { -0.11, 0.02, 0.0013, -0.0007, 0.004 };
    const struct sst_calib_camera *c;
    struct sst_posed posed;

    assert_int_equal(import(&posed, "lens.mat", NULL), 0);
    c = &posed.view[3].camera;
    assert_false(c->known);
    assert_true(c->fx == 70 && c->fy == 71.5 && c->cx == 30 && c->cy == 24); /* the first pixel is 1 */
    assert_int_equal(c->lens, 5);
    assert_memory_equal(c->k, k, sizeof(k));
    sst_posed_fini(&posed);
}

static void lenses_of_matlab_are_read(void **state SST_UNUSED)
{
    struct bytes file = { .n = 0 }, inner = { .n = 0 }, object = { .n = 0 };
    uLongf size = sizeof(file.data);
    uint8_t packed[4096];

    put_pictures("pictures");
    for (int newer = 0; newer < 2; newer++) {
        file.n = 0;
        add_lens(&file, newer);
        write_mat(&file);
        assert_lens();
    }
    /* As an object of MATLAB: in a stream in bytes, compressed. */
    add(&inner, "\0\1IM\0\0\0\0", 8);
    add_lens(&inner, false);
    begin_matrix(&object, 9, 1, (int32_t)inner.n);
    add_element(&object, 2, inner.data, inner.n);
    file.n = 0;
    add_element(&file, 14, object.data, object.n);
    assert_int_equal(compress(packed, &size, file.data, file.n), Z_OK);
    file.n = 0;
    add_element(&file, 15, packed, size);
    write_mat(&file);
    assert_lens();
}

static void files_of_matlab_without_a_lens_are_refused(void **state SST_UNUSED)
{
    struct bytes file = { .n = 0 };
    struct sst_posed posed;

    write_mat(&file);
    assert_int_equal(import(&posed, "lens.mat", NULL), -EBADMSG);
    add_doubles(&file, (const double[1]){ 1 }, 1, 1);
    write_mat(&file);
    assert_int_equal(import(&posed, "lens.mat", NULL), -EBADMSG);
    file.n = 0;
    add_lens(&file, false);
    for (size_t n = 8; n < 400; n += 8) { /* cut off within the lens */
        const struct bytes whole = file;

        file.n = n;
        write_mat(&file);
        assert_int_equal(import(&posed, "lens.mat", NULL), -EBADMSG);
        file = whole;
    }
}

static void lenses_of_other_calibrations_are_read(void **state SST_UNUSED)
{
    struct sst_calib calib;
    struct sst_posed posed;

    assert_int_equal(sst_calib_init(&calib, 1, 1), 0);
    calib.width = MODEL_WIDTH;
    calib.height = MODEL_HEIGHT;
    calib.camera[0].known = true;
    calib.camera[0].fx = calib.camera[0].fy = 66;
    calib.camera[0].cx = 30;
    assert_int_equal(sst_calib_write(&calib, test_path("calib.yaml")), 0);
    assert_int_equal(import(&posed, "calib.yaml", NULL), 0);
    assert_true(posed.view[7].camera.fx == 66 && posed.view[7].camera.cx == 30);
    sst_posed_fini(&posed);
    calib.width++;
    assert_int_equal(sst_calib_write(&calib, test_path("calib.yaml")), 0);
    assert_int_equal(import(&posed, "calib.yaml", NULL), -EBADMSG);
    sst_calib_fini(&calib);
}

/* --- names -------------------------------------------------------------------------------------------------------- */

static void moments_and_cameras_are_in_the_names(void **state SST_UNUSED)
{
    static const char *const names[] = { "B1/IMG_10.png", "B1/IMG_9.png", "B2/IMG_9.png", "B2/IMG_010.png" };
    struct sst_posed posed;

    sst_path_remove_tree(test_path("pictures"));
    assert_int_equal(sst_path_make_dir(test_path("pictures")), 0);
    assert_int_equal(sst_path_make_dir(test_path("pictures/B1")), 0);
    assert_int_equal(sst_path_make_dir(test_path("pictures/B2")), 0);
    for (int i = 0; i < 4; i++)
        put_picture(test_path("pictures/%s", names[i]), i);
    assert_int_equal(import(&posed, NULL, "{camera}/IMG_{moment}.png"), 0);
    assert_int_equal(posed.count, 4);
    /* By number; names alone would occur twice. */
    assert_string_equal(posed.view[0].name, "B1/IMG_9.png");
    assert_string_equal(posed.view[1].name, "B1/IMG_10.png");
    assert_string_equal(posed.view[3].name, "B2/IMG_010.png");
    assert_string_equal(posed.view[3].camera.name, "B2");
    assert_int_equal(posed.view[0].moment, 1);
    assert_int_equal(posed.view[2].moment, 1);
    assert_true(posed.view[1].moment != 1 && posed.view[3].moment != 1);
    sst_posed_fini(&posed);
    assert_int_equal(import(&posed, NULL, "{camera}/DSC_{moment}.png"), -EBADMSG);
    assert_int_equal(import(&posed, NULL, "{camera}/*"), -EINVAL);
}

static void times_are_in_the_names(void **state SST_UNUSED)
{
    static const char *const names[] = { "DJI_20260301_235958_1_T.png", "DJI_20260302_000003_2_T.png" };
    struct sst_posed posed;

    sst_path_remove_tree(test_path("pictures"));
    assert_int_equal(sst_path_make_dir(test_path("pictures")), 0);
    for (int i = 0; i < 2; i++)
        put_picture(test_path("pictures/%s", names[i]), i);
    assert_int_equal(import(&posed, NULL, NULL), 0);
    assert_true(posed.view[0].time_s == 0 && posed.view[1].time_s == 5);
    sst_posed_fini(&posed);
    put_picture(test_path("pictures/DJI_20261302_000003.png"), 2); /* no month */
    assert_int_equal(import(&posed, NULL, NULL), 0);
    assert_true(isnan(posed.view[0].time_s));
    sst_posed_fini(&posed);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(lenses_of_matlab_are_read),
        cmocka_unit_test(files_of_matlab_without_a_lens_are_refused),
        cmocka_unit_test(lenses_of_other_calibrations_are_read),
        cmocka_unit_test(moments_and_cameras_are_in_the_names),
        cmocka_unit_test(times_are_in_the_names),
    };

    sst_log_set_level(SST_LOG_ERROR);
    return cmocka_run_group_tests(tests, test_folder_create, test_folder_remove);
}
