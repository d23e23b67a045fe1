/* pipeline/lightfield: in memory, and as a folder. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "base/file.h"
#include "base/log.h"
#include "pipeline/image/codec.h"
#include "pipeline/kernels/sha256.h"
#include "pipeline/lightfield/lightfield.h"
#include "pipeline/lightfield/lightfield_internal.h"
#include "tests/folder.h"
#include "tests/test.h"

/* A 2x3 light field of 5x4 pixels with a hole at row 1, col 2, in a folder of this name. */
static void make_lightfield(struct sst_lightfield *lf, const char *name)
{
    char path[SST_PATH_MAX];

    assert_int_equal(sst_lightfield_init_files(lf, 2, 3), 0);
    lf->width = 5;
    lf->height = 4;
    lf->disp_min_px = -3;
    lf->range_min_px = -2.5;
    lf->range_max_px = 1.0 / 3.0;
    lf->focal_px = 1200.125;
    lf->spacing_mm = 50;
    snprintf(lf->files->source, sizeof(lf->files->source), "test \"quoted\" \xC3\xA9");
    (void)mkdir(test_path("%s", name), 0777);
    snprintf(path, sizeof(path), "%s/views", name);
    (void)mkdir(test_path("%s", path), 0777);
    for (int k = 0; k < 5; k++) {
        struct sst_view *v = &lf->views[k];

        v->present = true;
        if (k != lf->ref_view) {
            v->bx += 0.1 * k;
            v->by -= 0.3 / 7 * k;
        }
        sst_view_name(lf, k, lf->files->view[k].name);
        strcat(lf->files->view[k].name, ".png");
        assert_int_equal(sst_image_init(&v->image, 5, 4), 0);
        assert_int_equal(sst_map_u16_init(&v->disp, 5, 4), 0);
        for (int y = 0; y < 4; y++) {
            for (int x = 0; x < 5; x++) {
                sst_image_row(&v->image, 1, y)[x] = (uint8_t)(40 * k + 5 * y + x);
                sst_map_u16_row(&v->disp, y)[x] = (uint16_t)(x == 4 ? (int)SST_DISP_NONE : 1000 * k + 10 * y + x);
            }
        }
        snprintf(path, sizeof(path), "%s/views/%s", name, lf->files->view[k].name);
        assert_int_equal(sst_image_write_png(&v->image, test_path("%s", path)), 0);
    }
    assert_int_equal(sst_map_u8_init(&lf->views[1].label, 5, 4), 0);
    sst_map_u8_row(&lf->views[1].label, 3)[4] = SST_LABEL_NUCLEUS;
}

static void the_reference_view_is_the_middle_one(void **state SST_UNUSED)
{
    struct sst_lightfield lf;

    assert_int_equal(sst_lightfield_init(&lf, 6, 6), 0);
    assert_int_equal(lf.ref_view, 2 * 6 + 2);
    assert_true(lf.views[0].bx == -2 && lf.views[0].by == -2);
    assert_true(lf.views[35].bx == 3 && lf.views[35].by == 3);
    assert_int_equal(sst_lightfield_choose_ref(&lf), -EBADMSG);
    lf.views[35].present = lf.views[8].present = lf.views[20].present = true;
    assert_int_equal(sst_lightfield_choose_ref(&lf), 0);
    assert_int_equal(lf.ref_view, 8); /* 8 = (1,2) and 20 = (3,2) are equally near */
    sst_lightfield_fini(&lf);
    assert_int_equal(sst_lightfield_init(&lf, 16, 16), 0);
    sst_lightfield_fini(&lf);
    sst_lightfield_fini(&lf);
    assert_int_equal(sst_lightfield_init(&lf, 0, 1), -EINVAL);
    assert_int_equal(sst_lightfield_init(&lf, 1, 257), -EINVAL);
    assert_int_equal(sst_lightfield_init(&lf, 65536, 65536), -EINVAL);
}

static void disparity_is_stored_in_64ths(void **state SST_UNUSED)
{
    const struct sst_lightfield lf = { .disp_min_px = -3 };

    assert_int_equal(sst_disp_q6(&lf, -3), 0);
    assert_int_equal(sst_disp_q6(&lf, 0), 192);
    assert_int_equal(sst_disp_q6(&lf, 1.0 / 128 - 3), 1);
    assert_int_equal(sst_disp_q6(&lf, -3.01), SST_DISP_NONE);
    assert_int_equal(sst_disp_q6(&lf, -3 + 65534 / 64.0), 65534);
    assert_int_equal(sst_disp_q6(&lf, -3 + 65535 / 64.0), SST_DISP_NONE);
    assert_int_equal(sst_disp_q6(&lf, (double)INFINITY), SST_DISP_NONE);
    assert_int_equal(sst_disp_q6(&lf, (double)NAN), SST_DISP_NONE);
    assert_true(sst_disp_px(&lf, 224) == 0.5);
}

static void sha256_of_abc(void **state SST_UNUSED)
{
    char hex[65];

    sst_sha256_hex(hex, (const uint8_t *)"abc", 3); /* FIPS 180-4 example */
    assert_string_equal(hex, "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
}

static void assert_same(const struct sst_lightfield *a, const struct sst_lightfield *b)
{
    assert_int_equal(a->rows, b->rows);
    assert_int_equal(a->cols, b->cols);
    assert_int_equal(a->ref_view, b->ref_view);
    assert_true(a->disp_min_px == b->disp_min_px && a->range_min_px == b->range_min_px &&
                a->range_max_px == b->range_max_px && a->focal_px == b->focal_px && a->spacing_mm == b->spacing_mm);
    assert_string_equal(a->files->source, b->files->source);
    assert_int_equal(a->classes.count, b->classes.count);
    assert_memory_equal(a->classes.ground, b->classes.ground, sizeof(a->classes.ground));
    for (int k = 0; k < a->rows * a->cols; k++) {
        const struct sst_view *v = &a->views[k], *w = &b->views[k];

        assert_int_equal(v->present, w->present);
        if (!v->present)
            continue;
        assert_true(v->bx == w->bx && v->by == w->by);
        for (int y = 0; y < a->height; y++) {
            assert_memory_equal(sst_image_row(&v->image, 1, y), sst_image_row(&w->image, 1, y), 5);
            assert_memory_equal(sst_map_u16_row(&v->disp, y), sst_map_u16_row(&w->disp, y), 10);
        }
        assert_int_equal(v->label.data != NULL, w->label.data != NULL);
    }
}

static void a_folder_gives_back_what_was_written(void **state SST_UNUSED)
{
    struct sst_lightfield lf, back;

    make_lightfield(&lf, "round");
    assert_int_equal(sst_lightfield_write(&lf, test_path("round"), 2), 0);
    assert_int_equal(sst_lightfield_load(&back, test_path("round"), SST_LOAD_ALL, 2), 0);
    assert_same(&lf, &back);
    assert_int_equal(sst_map_u8_row(&back.views[1].label, 3)[4], SST_LABEL_NUCLEUS);
    /* Another picture under an old hash. */
    assert_int_equal(sst_image_write_png(&lf.views[0].image, test_path("round/views/00_01.png")), 0);
    sst_lightfield_fini(&back);
    assert_int_equal(sst_lightfield_load(&back, test_path("round"), SST_LOAD_IMAGES, 2), -EBADMSG);
    {
        char said[SST_LOG_MAX] = "", *before = sst_log_hold_errors(said);

        assert_int_equal(sst_lightfield_load(&back, test_path("round"), SST_LOAD_IMAGES, 2), -EBADMSG);
        sst_log_hold_errors(before);
        assert_non_null(strstr(said, "round/views/00_01.png has changed since it was stored"));
        assert_non_null(strstr(said, "--no-verify"));
    }
    assert_int_equal(sst_lightfield_load(&back, test_path("round"), SST_LOAD_IMAGES | SST_LOAD_UNVERIFIED, 2), 0);
    sst_lightfield_fini(&back);
    assert_int_equal(sst_lightfield_load(&back, test_path("round"), 0, 1), 0);
    assert_null(back.views[0].image.plane[0]);
    assert_null(back.views[0].disp.data);
    sst_lightfield_fini(&back);
    sst_lightfield_fini(&lf);
}

/* Places of infinity and of the principal point; files from before these keys load as unknown. */
static void geometry_comes_back(void **state SST_UNUSED)
{
    static const double infinity[] = { 0, 0, -7.25, 3 };
    struct sst_lightfield lf, back;

    for (int i = 0; i < 4; i++) {
        make_lightfield(&lf, "geometry");
        lf.infinity_known = i > 0;
        lf.infinity_px = infinity[i];
        lf.off_centre_px[0] = i == 3 ? 1.5 : 0;
        lf.off_centre_px[1] = i == 3 ? -1.0 / 3 : 0;
        /* All optional fields at once. */
        lf.disparity_tested = lf.files->judged = lf.files->plausible = i == 3;
        lf.skew_us = i == 3 ? 12 : 0;
        assert_int_equal(sst_lightfield_write(&lf, test_path("geometry"), 2), 0);
        assert_int_equal(sst_lightfield_load(&back, test_path("geometry"), 0, 1), 0);
        assert_int_equal(back.infinity_known, i > 0);
        assert_true(back.infinity_px == infinity[i]);
        assert_memory_equal(back.off_centre_px, lf.off_centre_px, sizeof(lf.off_centre_px));
        sst_lightfield_fini(&back);
        sst_lightfield_fini(&lf);
    }
}

static void maps_are_replaced_whole_or_not(void **state SST_UNUSED)
{
    struct sst_lightfield lf, back;

    make_lightfield(&lf, "maps");
    assert_int_equal(sst_lightfield_write(&lf, test_path("maps"), 2), 0);
    sst_map_u8_fini(&lf.views[1].label);
    sst_map_u16_fini(&lf.views[0].disp);
    sst_map_u16_row(&lf.views[2].disp, 0)[0] = 4711;
    assert_int_equal(sst_map_u8_init(&lf.views[4].confidence, 5, 4), 0);
    snprintf(lf.files->history, sizeof(lf.files->history), "second");
    assert_int_equal(sst_lightfield_save_maps(&lf, test_path("maps"), 2), 0);
    assert_int_equal(sst_lightfield_load(&back, test_path("maps"), SST_LOAD_ALL, 2), 0);
    assert_string_equal(back.files->history, "second");
    assert_non_null(back.views[1].label.data); /* no labels in memory: the ones in the folder stay */
    assert_null(back.views[0].disp.data);
    assert_int_equal(sst_map_u16_row(&back.views[2].disp, 0)[0], 4711);
    assert_non_null(back.views[4].confidence.data);
    sst_lightfield_fini(&back);
    /* A failed write leaves the old state. */
    sst_map_u16_row(&lf.views[2].disp, 0)[0] = 1;
    assert_int_equal(sst_map_u8_init(&lf.views[1].label, 4, 4), 0);
    assert_int_equal(sst_lightfield_save_maps(&lf, test_path("maps"), 2), -EINVAL);
    sst_map_u8_fini(&lf.views[1].label);
    lf.range_max_px = (double)NAN;
    assert_int_equal(sst_lightfield_save_maps(&lf, test_path("maps"), 2), -EINVAL);
    assert_int_equal(sst_lightfield_load(&back, test_path("maps"), SST_LOAD_ALL, 2), 0);
    assert_int_equal(sst_map_u16_row(&back.views[2].disp, 0)[0], 4711);
    sst_lightfield_fini(&back);
    sst_lightfield_fini(&lf);
}

/* Replace the first `from` in lightfield.json by `to`, and load. */
static int load_edited(const char *from, const char *to)
{
    struct sst_lightfield lf;
    uint8_t *text;
    size_t size;
    char *at, *edited;
    int err;

    assert_int_equal(sst_file_read(test_path("edit/lightfield.json"), 1 << 20, &text, &size), 0);
    at = strstr((char *)text, from);
    assert_non_null(at);
    edited = malloc(size + strlen(to) + 1);
    assert_non_null(edited);
    sprintf(edited, "%.*s%s%s", (int)(at - (char *)text), text, to, at + strlen(from));
    assert_int_equal(sst_file_write(test_path("edit/lightfield.json"), edited, strlen(edited)), 0);
    err = sst_lightfield_load(&lf, test_path("edit"), 0, 1);
    if (!err)
        sst_lightfield_fini(&lf);
    assert_int_equal(sst_file_write(test_path("edit/lightfield.json"), text, size), 0);
    free(edited);
    free(text);
    return err;
}

static void every_field_is_checked(void **state SST_UNUSED)
{
    static const char *const edits[][2] = {
        { "\"format\": \"sst-lightfield\"", "\"format\": \"other\"" },
        { "\"version\": 1", "\"version\": 2" },
        { "\"version\": 1", "\"version\": 0" },
        { "\"version\": 1", "\"version\": \"1\"" },
        { "\"rows\": 2", "\"rows\": 0" },
        { "\"rows\": 2", "\"rows\": 1" }, /* views of row 1 are left over */
        { "\"rows\": 2", "\"rows\": 200" },
        { "\"rows\": 2", "\"rows\": 2.5" },
        { "\"cols\": 3", "\"cols\": 99999999999" },
        { "\"width\": 5", "\"width\": 0" },
        { "\"height\": 4", "\"height\": 32769" },
        { "\"disp_min_px\": -3.0", "\"disp_min_px\": 1e300" },
        { "\"disp_min_px\": -3.0", "\"disp_min_px\": null" },
        { "\"disp_min_px\": -3.0", "\"disp_min_px\": -3.0, \"extra\": 1" },
        { "\"disp_min_px\": -3.0", "\"disp_min_px\": -3.0, \"disp_min_px\": -3.0" },
        { "\"disp_min_px\": -3.0,", "" },
        { "\"disp_steps_per_px\": 64.0", "\"disp_steps_per_px\": 16" },
        { "\"range_min_px\": -2.5", "\"range_min_px\": 2.5" },
        { "\"focal_px\": 1200.125", "\"focal_px\": -1" },
        { "\"spacing_mm\": 50.0", "\"spacing_mm\": 1e999" },
        { "\"labels_given\": false", "\"labels_given\": 0" },
        { "\"name\": \"Sky\"", "\"name\": \"building\"" },
        { "\"name\": \"Sky\"", "\"name\": \"\"" },
        { "\"name\": \"Sky\"", "\"name\": \"a name that is longer than thirty-one bytes\"" },
        { "\"ground\": false", "\"ground\": \"no\"" },
        { "\"source\":", "\"infinity_px\": \"far\", \"source\":" },
        { "\"source\":", "\"infinity_px\": 1e6, \"source\":" },
        { "\"source\":", "\"parallel\": true, \"infinity_px\": -3, \"source\":" },
        { "\"source\":", "\"off_centre_px\": [1], \"source\":" },
        { "\"row\": 1", "\"row\": 0" },
        { "\"bx\": -1.0", "\"bx\": -1e5" },
        { "\"bx\": 0.0", "\"bx\": 0.25" }, /* the reference view's */
        { "\"file\": \"00_00.png\"", "\"file\": \"../00_00.png\"" },
        { "\"file\": \"00_00.png\"", "\"file\": \".hidden\"" },
        { "\"file\": \"00_00.png\"", "\"file\": \"\"" },
        { "\"file\": \"00_00.png\"", "\"file\": \"00_01.png\"" },
        { "\"file\": \"00_00.png\"", "\"file\": \"a\\u0007\"" },
        { "\"sha256\": \"", "\"sha256\": \"G" },
        { "\"views\": [", "\"views\": [7, " },
        { "{", "[" },
        { "{", "" },
    };
    struct sst_lightfield lf;

    make_lightfield(&lf, "edit");
    assert_int_equal(sst_lightfield_write(&lf, test_path("edit"), 2), 0);
    assert_int_equal(load_edited("\"bx\": -1.0", "\"bx\": -1"), 0);
    assert_int_equal(load_edited("\"history\": \"\"", "\"history\": \"x\""), 0);
    /* All that a light field can have besides. */
    assert_int_equal(load_edited("\"disp_min_px\": -3.0",
                                 "\"disp_min_px\": -3.0, \"disparity_tested\": true, \"parallel\": true, "
                                 "\"skew_us\": 12.5, \"samples\": [64, 1023], \"plausible\": true, "
                                 "\"implausible\": \"\", \"correction\": [{\"row\": 0, \"col\": 0, "
                                 "\"right_px\": 0.05, \"down_px\": 0, \"roll_deg\": 0.1, \"scale\": 0, "
                                 "\"gain\": [1, 1, 1], \"falloff\": 0.1, \"exponent\": 1}]"),
                     0);
    for (size_t i = 0; i < ARRAY_LEN(edits); i++) {
        if (load_edited(edits[i][0], edits[i][1]) != -EBADMSG)
            fail_msg("%s was accepted", edits[i][1]);
    }
    sst_lightfield_fini(&lf);
    assert_int_equal(sst_lightfield_load(&lf, test_path("none"), 0, 1), -ENOENT);
}

static void maps_of_another_size_are_refused(void **state SST_UNUSED)
{
    struct sst_lightfield lf, back;
    struct sst_map_u8 wrong, label;

    make_lightfield(&lf, "sizes");
    assert_int_equal(sst_lightfield_write(&lf, test_path("sizes"), 2), 0);
    assert_int_equal(sst_map_u8_init(&wrong, 4, 5), 0);
    assert_int_equal(sst_map_u8_init(&label, 5, 4), 0);
    sst_map_u8_row(&label, 0)[3] = 24; /* one more than there are classes */
    assert_int_equal(sst_map_u8_write_png(&wrong, test_path("sizes/labels/00_01.png"), NULL), 0);
    assert_int_equal(sst_lightfield_load(&back, test_path("sizes"), SST_LOAD_LABELS, 2), -EBADMSG);
    assert_int_equal(sst_map_u8_write_png(&label, test_path("sizes/labels/00_01.png"), NULL), 0);
    assert_int_equal(sst_lightfield_load(&back, test_path("sizes"), SST_LOAD_LABELS, 2), -EBADMSG);
    assert_int_equal(sst_lightfield_load(&back, test_path("sizes"), SST_LOAD_DISPARITY, 2), 0);
    sst_lightfield_fini(&back);
    assert_int_equal(remove(test_path("sizes/views/00_02.png")), 0);
    assert_int_equal(sst_lightfield_load(&back, test_path("sizes"), SST_LOAD_IMAGES, 2), -ENOENT);
    sst_map_u8_fini(&wrong);
    sst_map_u8_fini(&label);
    sst_lightfield_fini(&lf);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_reference_view_is_the_middle_one),
        cmocka_unit_test(disparity_is_stored_in_64ths),
        cmocka_unit_test(sha256_of_abc),
        cmocka_unit_test(a_folder_gives_back_what_was_written),
        cmocka_unit_test(geometry_comes_back),
        cmocka_unit_test(maps_are_replaced_whole_or_not),
        cmocka_unit_test(every_field_is_checked),
        cmocka_unit_test(maps_of_another_size_are_refused),
    };

    return cmocka_run_group_tests(tests, test_folder_create, test_folder_remove);
}
