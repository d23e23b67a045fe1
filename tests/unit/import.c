/* Import and export of light fields: each conversion with a known answer, and refusals. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/file.h"
#include "base/log.h"
#include "pipeline/image/codec.h"
#include "pipeline/image/deep.h"
#include "pipeline/image/develop.h"
#include "pipeline/lightfield/folder.h"
#include "pipeline/lightfield/import.h"
#include "pipeline/lightfield/lightfield_internal.h"
#include "simulators/devices/ptp/ptp_model.h"
#include "tests/deep_read.h"
#include "tests/test.h"

#define WIDTH  6
#define HEIGHT 5

static char top[] = "/tmp/sst-import-XXXXXX";
static char dir[SST_PATH_MAX]; /* of one test */

/* Good for the whole test: none asks for as many as there are places. */
static const char *in_dir(const char *name)
{
    static char path[256][SST_PATH_MAX];
    static int next;

    next = (next + 1) % 256;
    assert_int_equal(sst_path_join(path[next], dir, name), 0);
    return path[next];
}

/* An image with red `tag` everywhere: identifies the file of a view. */
static void put_image(const char *name, int tag, int width, int height)
{
    struct sst_image img;
    const size_t n = strlen(name);

    assert_int_equal(sst_image_init(&img, width, height), 0);
    for (int y = 0; y < height; y++) {
        memset(sst_image_row(&img, 0, y), tag, (size_t)width);
        for (int x = 0; x < width; x++)
            sst_image_row(&img, 1, y)[x] = (uint8_t)(x * 9 + y);
    }
    if (!strcmp(name + n - 3, "jpg"))
        assert_int_equal(sst_image_write_jpeg(&img, in_dir(name), 95), 0);
    else
        assert_int_equal(sst_image_write_png(&img, in_dir(name)), 0);
    sst_image_fini(&img);
}

static void put_text(const char *name, const char *text)
{
    assert_int_equal(sst_file_write(in_dir(name), text, strlen(text)), 0);
}

/* Disparity base + x / 64 at column x, unknown in row 0. */
static void put_pfm(const char *name, double base, int width, int height)
{
    struct sst_map_f32 map;

    assert_int_equal(sst_map_f32_init(&map, width, height), 0);
    for (int y = 0; y < height; y++) {
        for (int x = 0; x < width; x++)
            sst_map_f32_row(&map, y)[x] = y ? (float)(base + x / 64.0) : INFINITY;
    }
    assert_int_equal(sst_map_f32_write_pfm(&map, in_dir(name)), 0);
    sst_map_f32_fini(&map);
}

static struct sst_import_config config(const char *format, const char *source)
{
    return (struct sst_import_config){ .format = format, .source = in_dir(source), .out = in_dir("out"), .threads = 2 };
}

static void load(struct sst_lightfield *lf)
{
    assert_int_equal(sst_lightfield_load(lf, in_dir("out"), SST_LOAD_ALL, 2), 0);
}

static void import_and_load(const struct sst_import_config *cfg, struct sst_lightfield *lf)
{
    assert_int_equal(sst_import(cfg), 0);
    load(lf);
}

static void assert_view(const struct sst_lightfield *lf, int k, int tag, double bx, double by)
{
    assert_true(lf->views[k].present);
    assert_int_equal(sst_image_row(&lf->views[k].image, 0, 0)[0], tag);
    assert_true(fabs(lf->views[k].bx - bx) < 1e-12);
    assert_true(fabs(lf->views[k].by - by) < 1e-12);
}

static void helpers_have_known_answers(void **state SST_UNUSED)
{
    static const char ini[] = "[a]\n# disp_min = 7\n disp_min=-1.5\r\nbaseline_mm : 50 # mm\nempty =\nbad = 1x\n"
                              "inf = inf\n";
    double v = 0;
    int numbers[] = { 9, 3, 9, 0, 3 }, index = 0;

    assert_int_equal(distinct(numbers, 5), 3);
    assert_true(numbers[0] == 0 && numbers[1] == 3 && numbers[2] == 9);
    assert_string_equal(parse_index("007_", &index), "_");
    assert_int_equal(index, 7);
    assert_null(parse_index("100000", &index));
    assert_null(parse_index("-1", &index));
    assert_int_equal(params_number(ini, "ini", "disp_min", &v), 1);
    assert_true(v == -1.5);
    assert_int_equal(params_number(ini, "ini", "baseline_mm", &v), 1);
    assert_true(v == 50);
    assert_int_equal(params_number(ini, "ini", "disp", &v), 0);
    assert_int_equal(params_number(ini, "ini", "empty", &v), -EBADMSG);
    assert_int_equal(params_number(ini, "ini", "bad", &v), -EBADMSG);
    assert_int_equal(params_number(ini, "ini", "inf", &v), -EBADMSG);
    assert_true(v == 50);
}

/* Both numberings run against the positions; every third line of a larger set; column spacing 10, row spacing 9. */
static void stanford_positions_decide(void **state SST_UNUSED)
{
    struct sst_import_config cfg = config("stanford", "src");
    struct sst_lightfield lf;

    put_image("src/a 1_2_00_00_18.0_20.5_30_36.png", 1, WIDTH, HEIGHT); /* lowest, rightmost and off by 0.5 */
    put_image("src/a 1_2_00_03_18.0_10.0_30_36.png", 2, WIDTH, HEIGHT);
    put_image("src/a 1_2_00_06_18.0_0.0_30_36.png", 3, WIDTH, HEIGHT);
    put_image("src/a 1_2_05_00_9.0_20.0_30_36.png", 4, WIDTH, HEIGHT);
    put_image("src/a 1_2_05_03_9.9_10.0_30_36.png", 5, WIDTH, HEIGHT); /* 0.9 too low */
    put_image("src/a 1_2_05_06_9.0_0.0_30_36.png", 6, WIDTH, HEIGHT);
    import_and_load(&cfg, &lf);
    assert_int_equal(lf.rows, 2);
    assert_int_equal(lf.cols, 3);
    assert_int_equal(lf.ref_view, 1);
    assert_true(lf.spacing_mm == 10);
    assert_view(&lf, 0, 6, -1, -0.09);
    assert_view(&lf, 1, 5, 0, 0);
    assert_view(&lf, 2, 4, 1, -0.09);
    assert_view(&lf, 3, 3, -1, 0.81);
    assert_view(&lf, 4, 2, 0, 0.81);
    assert_view(&lf, 5, 1, 1.05, 0.81);
    assert_true(lf.range_min_px == 0 && lf.range_max_px == 0);
    sst_lightfield_fini(&lf);
}

static void a_hole_needs_a_known_grid(void **state SST_UNUSED)
{
    struct sst_import_config cfg = config("stanford", "src");
    struct sst_lightfield lf;

    put_image("src/out_00_00_0.0_0.0_.png", 1, WIDTH, HEIGHT);
    put_image("src/out_00_01_0.0_1.0_.png", 2, WIDTH, HEIGHT);
    put_image("src/out_01_00_1.0_0.0_.png", 3, WIDTH, HEIGHT);
    assert_int_equal(sst_import(&cfg), -EBADMSG);
    assert_false(sst_path_exists(cfg.out));
    cfg.rows = cfg.cols = 2;
    import_and_load(&cfg, &lf);
    assert_false(lf.views[3].present);
    assert_true(lf.views[2].present);
    sst_lightfield_fini(&lf);
    cfg.cols = 3;
    cfg.force = true;
    assert_int_equal(sst_import(&cfg), -EBADMSG);
    load(&lf); /* the earlier one is still there */
    sst_lightfield_fini(&lf);
}

/* A window of 2x3 out of 9x9: rows 3 and 4, columns 3 to 5; the centre of the whole is view 40 = (4, 4). */
static void hci_window_keeps_its_truth(void **state SST_UNUSED)
{
    static const int index[] = { 30, 31, 32, 39, 40, 41 };
    struct sst_import_config cfg = config("hci", "src");
    struct sst_lightfield lf;
    struct sst_map_f32 truth;
    char name[64];

    for (int i = 0; i < 6; i++) {
        snprintf(name, sizeof(name), "src/input_Cam%03d.png", index[i]);
        put_image(name, index[i], WIDTH, HEIGHT);
    }
    put_pfm("src/gt_disp_lowres.pfm", -1.5, WIDTH, HEIGHT);
    import_and_load(&cfg, &lf);
    assert_int_equal(lf.ref_view, 1);
    for (int k = 0; k < 6; k++)
        assert_view(&lf, k, index[k], k % 3 - 1, k / 3);
    assert_true(lf.range_min_px == -1.5 && lf.range_max_px == -1.5 + 5 / 64.0 && lf.disp_min_px == -2);
    assert_null(lf.views[4].disp.data); /* truth is for judging, not for use */
    assert_int_equal(sst_map_f32_read_pfm(&truth, in_dir("out/truth/01_01.pfm")), 0);
    assert_true(isinf(sst_map_f32_row(&truth, 0)[3]) && sst_map_f32_row(&truth, 1)[2] == -1.5f + 2 / 64.0f);
    sst_map_f32_fini(&truth);
    sst_lightfield_fini(&lf);
}

/* 2x3 views of 4x5 from row 1, column 2 on: truth and places of the views go with them, what lies outside is not
 * missed, and the principal point of converging views belongs to the part's reference. */
static void a_part_of_the_grid_is_a_grid(void **state SST_UNUSED)
{
    struct sst_import_config cfg = config("hci", "src");
    double infinity_px = -3;
    struct sst_lightfield lf;
    struct sst_map_f32 truth;
    char name[64];

    for (int i = 0; i < 20; i++) {
        snprintf(name, sizeof(name), "src/input_Cam%03d.png", i);
        put_image(name, 10 * i, WIDTH, HEIGHT);
    }
    put_text("src/parameters.cfg", "num_cams_x = 5\nnum_cams_y = 4\noff_centre_x_px = 0.5\noff_centre_y_px = 0\n");
    put_pfm("src/gt_disp_lowres_Cam013.pfm", 2, WIDTH, HEIGHT);
    memcpy(cfg.part, (const int[4]){ 1, 2, 2, 3 }, sizeof(cfg.part));
    cfg.infinity_px = &infinity_px;
    import_and_load(&cfg, &lf);
    assert_true(lf.rows == 2 && lf.cols == 3 && lf.ref_view == 1);
    for (int k = 0; k < 6; k++)
        assert_view(&lf, k, 10 * (5 * (1 + k / 3) + 2 + k % 3), k % 3 - 1, k / 3);
    /* The whole grid's reference is (1, 2), the part's (1, 3): one spacing to the right. */
    assert_true(fabs(lf.off_centre_px[0] - (0.5 - infinity_px * -1 * -1)) < 1e-12 && lf.off_centre_px[1] == 0);
    assert_non_null(strstr(lf.files->source, "part 1,2,2x3"));
    assert_int_equal(sst_map_f32_read_pfm(&truth, in_dir("out/truth/01_01.pfm")), 0);
    assert_true(sst_map_f32_row(&truth, 1)[2] == 2 + 2 / 64.0f);
    sst_map_f32_fini(&truth);
    sst_lightfield_fini(&lf);
    cfg.force = true;
    cfg.part[1] = 3; /* one column too far */
    assert_int_equal(sst_import(&cfg), -EINVAL);
    cfg.part[1] = 2;
    cfg.labels_dir = in_dir("src");
    assert_int_equal(sst_import(&cfg), -EINVAL);
}

static void a_part_of_a_folder(void **state SST_UNUSED)
{
    struct sst_import_config cfg = config("folder", "src");
    struct sst_lightfield lf;

    put_image("src/01_01.png", 1, WIDTH, HEIGHT);
    put_image("src/01_02.png", 2, WIDTH, HEIGHT);
    put_image("src/02_01.png", 3, WIDTH, HEIGHT);
    put_image("src/02_02.png", 4, WIDTH, HEIGHT);
    cfg.rows = cfg.cols = 3;
    memcpy(cfg.part, (const int[4]){ 1, 1, 2, 2 }, sizeof(cfg.part));
    import_and_load(&cfg, &lf);
    assert_true(lf.rows == 2 && lf.cols == 2 && lf.ref_view == 0);
    for (int k = 0; k < 4; k++)
        assert_view(&lf, k, 1 + k, k % 2, k / 2);
    sst_lightfield_fini(&lf);
    cfg.force = true;
    memcpy(cfg.part, (const int[4]){ 0, 0, 1, 3 }, sizeof(cfg.part)); /* no file there */
    assert_int_equal(sst_import(&cfg), -EBADMSG);
    memcpy(cfg.part, (const int[4]){ 0, 0, 2, 2 }, sizeof(cfg.part)); /* one file */
    assert_int_equal(sst_import(&cfg), -EBADMSG);
}

/* Every second camera of 4x4: a spacing is two of HCI's, so disparities double. */
static void hci_parameters_are_converted(void **state SST_UNUSED)
{
    static const char params[] =
        "[intrinsics]\nfocal_length_mm = 100\nsensor_size_mm = 40\n[extrinsics]\n"
        "num_cams_x = 4\nnum_cams_y = 4\nbaseline_mm = 30\nfocus_distance_m = 2\n[meta]\ndisp_min = -1\n"
        "disp_max = 2.5\n";
    static const int index[] = { 0, 2, 8, 10 };
    struct sst_import_config cfg = config("hci", "src");
    struct sst_lightfield lf;
    struct sst_map_f32 truth;
    char name[64];

    for (int i = 0; i < 4; i++) {
        snprintf(name, sizeof(name), "src/input_Cam%03d.png", index[i]);
        put_image(name, index[i], WIDTH, HEIGHT);
    }
    put_text("src/parameters.cfg", params);
    put_pfm("src/gt_disp_lowres_Cam010.pfm", 0.5, WIDTH, HEIGHT);
    import_and_load(&cfg, &lf);
    for (int k = 0; k < 4; k++)
        assert_view(&lf, k, index[k], k % 2, k / 2);
    assert_true(lf.spacing_mm == 60 && lf.range_min_px == -2 && lf.range_max_px == 5);
    assert_true(lf.focal_px == 2.5 * WIDTH); /* 100 mm of a sensor of 40 mm, on the longer side */
    /* f B / Z of two steps; the axes of the cameras meet before the middle of the grid, 1.5 steps from view 0. */
    assert_true(lf.infinity_known && fabs(lf.infinity_px + 2.5 * WIDTH * 60 / 2000) < 1e-12);
    assert_true(fabs(lf.off_centre_px[0] - 0.75 * lf.infinity_px) < 1e-12 &&
                lf.off_centre_px[1] == lf.off_centre_px[0]);
    assert_int_equal(sst_map_f32_read_pfm(&truth, in_dir("out/truth/01_01.pfm")), 0);
    assert_true(sst_map_f32_row(&truth, 1)[2] == 1 + 4 / 64.0f);
    sst_map_f32_fini(&truth);
    sst_lightfield_fini(&lf);
    put_text("src/parameters.cfg", "num_cams_x = 3\nnum_cams_y = 3\n");
    cfg.force = true;
    assert_int_equal(sst_import(&cfg), -EBADMSG); /* view 10 of 9 */
    put_text("src/parameters.cfg", "num_cams_x = 4\nnum_cams_y = 4\nfocus_distance_m = -2\n");
    assert_int_equal(sst_import(&cfg), -EBADMSG); /* behind the cameras */
    put_text("src/parameters.cfg", "num_cams_x = 4\nnum_cams_y = 4\ndisp_min = 3\ndisp_max = -3\n");
    assert_int_equal(sst_import(&cfg), -EBADMSG);
}

static void put_folder(void)
{
    put_image("src/00_00.png", 10, WIDTH, HEIGHT);
    put_image("src/00_01.jpg", 11, WIDTH, HEIGHT);
    put_image("src/00_02.PNG", 12, WIDTH, HEIGHT);
}

static void folder_reads_external_maps(void **state SST_UNUSED)
{
    struct sst_import_config cfg = config("folder", "src");
    struct sst_lightfield lf;
    struct sst_map_u8 label;

    put_folder();
    cfg.rows = 1;
    cfg.cols = 3;
    cfg.disparity_dir = cfg.labels_dir = in_dir("maps");
    put_pfm("maps/00_00.pfm", -2.25, WIDTH, HEIGHT);
    put_pfm("maps/00_01.pfm", 3, WIDTH, HEIGHT);
    put_pfm("maps/00_02.pfm", 4.0 + 1 / 100.0, WIDTH, HEIGHT);
    assert_int_equal(sst_map_u8_init(&label, WIDTH, HEIGHT), 0);
    for (int k = 0; k < 3; k++) {
        char name[32];

        sst_map_u8_row(&label, 0)[0] = (uint8_t)(20 + 3 * k); /* 20, 23, 26: three more than the list has */
        snprintf(name, sizeof(name), "maps/00_%02d.png", k);
        assert_int_equal(sst_map_u8_write_png(&label, in_dir(name), NULL), 0);
    }
    import_and_load(&cfg, &lf);
    assert_view(&lf, 0, 10, -1, 0);
    assert_view(&lf, 2, 12, 1, 0);
    assert_string_equal(lf.files->view[1].name, "00_01.jpg");
    assert_string_equal(lf.files->view[2].name, "00_02.png");
    assert_true(lf.files->external_disparity && lf.files->external_labels);
    assert_true(lf.disp_min_px == -3);
    assert_true(lf.range_min_px == -2.25 && fabs(lf.range_max_px - (4.01 + 5 / 64.0)) < 1e-6);
    assert_int_equal(sst_map_u16_row(&lf.views[0].disp, 0)[0], SST_DISP_NONE);
    assert_int_equal(sst_map_u16_row(&lf.views[0].disp, 1)[2], 48 + 2);     /* (-2.25 + 3) * 64 + 2 */
    assert_int_equal(sst_map_u16_row(&lf.views[2].disp, 1)[0], 7 * 64 + 1); /* 0.01 px rounds to 1/64 */
    assert_int_equal(sst_map_u8_row(&lf.views[2].label, 0)[0], 26);
    assert_int_equal(lf.classes.count, 26);
    assert_string_equal(sst_classes_name(&lf.classes, 26), "Label26");
    sst_lightfield_fini(&lf);
    sst_map_u8_fini(&label);
}

/* Grey views of 16 bits, 00_00.png ...: view k has the samples base + k ... base + k + span - 1, and one 65535 if hot.
 */
static void put_deep(int views, int base, int span, bool hot)
{
    for (int k = 0; k < views; k++) {
        struct sst_map_u16 map;
        char name[64];

        snprintf(name, sizeof(name), "src/00_%02d.png", k);
        assert_int_equal(sst_map_u16_init(&map, 200, 100), 0);
        for (int i = 0; i < 200 * 100; i++)
            sst_map_u16_row(&map, i / 200)[i % 200] = (uint16_t)(base + k + i * 7919 % span);
        if (hot)
            sst_map_u16_row(&map, 50)[50] = 65535;
        assert_int_equal(sst_map_u16_write_png(&map, in_dir(name)), 0);
        sst_map_u16_fini(&map);
    }
}

static void views_of_16_bits_are_scaled_alike(void **state SST_UNUSED)
{
    static const struct {
        int base, span;
        bool hot;
        struct sst_samples samples;
    } cases[] = {
        { 30000, 221, false, { 30000, 30222 } }, { 0, 1024, false, { 0, 1025 } }, { 0, 1024, true, { 0, 1025 } },
        { 65533, 1, false, { 65533, 65535 } },   { 0, 65000, false, { 0, 0 } },
    };
    struct sst_import_config cfg = config("folder", "src");
    struct sst_lightfield lf;

    cfg.rows = 1;
    cfg.cols = 3;
    cfg.force = true;
    for (size_t i = 0; i < ARRAY_LEN(cases); i++) {
        const int span = cases[i].samples.white - cases[i].samples.black;
        int before, after;

        put_deep(3, cases[i].base, cases[i].span, cases[i].hot);
        import_and_load(&cfg, &lf);
        assert_int_equal(lf.samples.black, cases[i].samples.black);
        assert_int_equal(lf.samples.white, cases[i].samples.white);
        for (int k = 0; k < 3; k++) {
            const int v = cases[i].base + k + 100 * 7919 % cases[i].span - lf.samples.black;

            assert_int_equal(sst_image_row(&lf.views[k].image, 1, 0)[100],
                             span ? (v * 255 + span / 2) / span : (v * 255 + 32767) / 65535);
        }
        assert_int_equal(sst_lightfield_levels(&lf, in_dir("out"), false, &before, &after), 0);
        assert_true(span > 255 || span == 0 || before == after);
        assert_true(after >= 15 || cases[i].span == 1);
        sst_lightfield_fini(&lf);
    }
    /* All samples alike, and views of 8 bits among them: as ever. */
    for (int mixed = 0; mixed < 2; mixed++) {
        put_deep(3, 65535, 1, false);
        for (int k = 1; k < 3; k++)
            put_image(k == 1 ? "src/00_01.png" : "src/00_02.png", 77, 200, 100);
        if (mixed)
            put_deep(1, 500, 200, false);
        import_and_load(&cfg, &lf);
        assert_int_equal(lf.samples.white, 0);
        assert_int_equal(sst_image_row(&lf.views[0].image, 0, 0)[0], mixed ? 2 : 255);
        assert_int_equal(sst_image_row(&lf.views[1].image, 0, 0)[0], 77);
        sst_lightfield_fini(&lf);
    }
}

/* Thermal cameras write TIFF: the same views as of PNG files, their bytes kept. */
static void tiff_views_are_those_of_png(void **state SST_UNUSED)
{
#if WITH_TIFF
    struct sst_import_config cfg = config("folder", "src");
    struct sst_lightfield png, tiff;
    struct sst_map_u16 plane[3][3];
    struct sst_deep deep;

    cfg.rows = 1;
    cfg.cols = 3;
    cfg.force = true;
    put_deep(3, 5700, 300, false);
    import_and_load(&cfg, &png);
    for (int k = 0; k < 3; k++) {
        char from[64], to[64];

        snprintf(from, sizeof(from), "src/00_%02d.png", k);
        snprintf(to, sizeof(to), "src/00_%02d.%s", k, k == 1 ? "TIF" : "tiff");
        assert_int_equal(deep_read(&deep, NULL, in_dir(from)), 0);
        assert_int_equal(sst_deep_write(&deep, in_dir(to)), 0);
        assert_int_equal(unlink(in_dir(from)), 0);
        sst_deep_fini(&deep);
    }
    import_and_load(&cfg, &tiff);
    assert_string_equal(tiff.files->view[1].name, "00_01.tif");
    assert_int_equal(tiff.samples.black, png.samples.black);
    assert_int_equal(tiff.samples.white, png.samples.white);
    assert_int_equal(tiff.samples.black, 5700);
    assert_int_equal(sst_lightfield_read_deep(plane, &tiff, in_dir("out"), 1), 0);
    for (int k = 0; k < 3; k++) {
        for (int c = 0; c < 3; c++) {
            for (int y = 0; y < 100; y++)
                assert_memory_equal(sst_image_row(&tiff.views[k].image, c, y), sst_image_row(&png.views[k].image, c, y),
                                    200);
            assert_int_equal(sst_map_u16_row(&plane[k][c], 0)[100], 5700 + k + 100 * 7919 % 300);
            sst_map_u16_fini(&plane[k][c]);
        }
    }
    sst_lightfield_fini(&png);
    sst_lightfield_fini(&tiff);
#endif
}

static void folder_refuses(void **state SST_UNUSED)
{
    struct sst_import_config cfg = config("folder", "src");
    struct sst_map_f32 map;
    struct sst_lightfield lf;

    put_folder();
    assert_int_equal(sst_import(&cfg), -EINVAL); /* no grid */
    cfg.rows = 1;
    cfg.cols = 2;
    assert_int_equal(sst_import(&cfg), -EBADMSG); /* 00_02 is outside */
    cfg.cols = 4;
    import_and_load(&cfg, &lf); /* 00_03 is a hole */
    assert_int_equal(lf.ref_view, 1);
    sst_lightfield_fini(&lf);
    assert_int_equal(sst_import(&cfg), -EEXIST);
    cfg.out = in_dir("out2");
    cfg.cols = 300;
    assert_int_equal(sst_import(&cfg), -EBADMSG);
    cfg.cols = 3;
    put_image("src/00_00.jpg", 1, WIDTH, HEIGHT); /* twice */
    assert_int_equal(sst_import(&cfg), -EBADMSG);
    assert_int_equal(remove(in_dir("src/00_00.jpg")), 0);
    put_image("src/00_02.PNG", 1, WIDTH + 1, HEIGHT);
    assert_int_equal(sst_import(&cfg), -EBADMSG);
    put_text("src/00_02.PNG", "no image");
    assert_int_equal(sst_import(&cfg), -EBADMSG);
    put_image("src/00_02.PNG", 1, WIDTH, HEIGHT);
    cfg.disparity_dir = in_dir("maps");
    assert_int_equal(sst_import(&cfg), -ENOENT); /* no maps */
    put_pfm("maps/00_00.pfm", 0, WIDTH, HEIGHT);
    put_pfm("maps/00_01.pfm", 0, WIDTH, HEIGHT);
    put_pfm("maps/00_02.pfm", 1023, WIDTH, HEIGHT); /* 1023 + 5/64 is too far from 0 */
    assert_int_equal(sst_import(&cfg), -EBADMSG);
    put_pfm("maps/00_02.pfm", 1e6, WIDTH, HEIGHT);
    assert_int_equal(sst_import(&cfg), -EBADMSG);
    put_pfm("maps/00_02.pfm", 1, HEIGHT, WIDTH);
    assert_int_equal(sst_import(&cfg), -EBADMSG);
    assert_int_equal(sst_map_f32_init(&map, WIDTH, HEIGHT), 0);
    sst_map_f32_row(&map, 2)[1] = NAN;
    assert_int_equal(sst_map_f32_write_pfm(&map, in_dir("maps/00_02.pfm")), 0);
    sst_map_f32_fini(&map);
    assert_int_equal(sst_import(&cfg), -EBADMSG);
    assert_false(sst_path_exists(cfg.out));
    cfg = config("folder", "none");
    cfg.rows = cfg.cols = 1;
    assert_int_equal(sst_import(&cfg), -ENOENT);
    cfg = config("tiff", "src");
    assert_int_equal(sst_import(&cfg), -EINVAL);
}

/* Files that cameras and photo programs leave beside pictures; raw files never mix with pictures. */
static void folder_of_a_camera_is_read(void **state SST_UNUSED)
{
    static const char *const beside[] = { "src/00_00.xmp",     "src/00_00.JSON",    "src/00_01.THM", "src/07_00.txt",
                                          "src/00_00.JPG.xmp", "src/00_01.old.jpg", "src/Thumbs.db", "src/.00_00.jpg" };
    struct sst_import_config cfg = config("folder", "src");
    char said[SST_LOG_MAX] = "", *before;
    uint8_t bayer[32 * 32], *dng;
    struct sst_lightfield lf;
    size_t bytes;

    cfg.rows = 1;
    cfg.cols = 2;
    cfg.force = true;
    for (size_t i = 0; i < ARRAY_LEN(beside); i++)
        put_text(beside[i], "no image");
    before = sst_log_hold_errors(said);
    assert_int_equal(sst_import(&cfg), -EBADMSG); /* nothing else */
    sst_log_hold_errors(before);
    assert_non_null(strstr(said, "only 00_"));
    put_image("src/00_00.jpg", 10, 32, 32);
    put_image("src/00_01.jpg", 20, 32, 32);
    import_and_load(&cfg, &lf);
    sst_lightfield_fini(&lf);

    memset(bayer, 200, sizeof(bayer));
    assert_int_equal(sst_sim_ptp_dng(bayer, 32, 32, &dng, &bytes), 0);
    assert_int_equal(sst_file_write(in_dir("src/00_00.DNG"), dng, bytes), 0);
    import_and_load(&cfg, &lf);
    assert_true(abs(sst_image_row(&lf.views[0].image, 0, 9)[9] - 10) < 6); /* the JPEG */
    sst_lightfield_fini(&lf);
    cfg.prefer_raw = true;
    before = sst_log_hold_errors(said);
    assert_int_equal(sst_import(&cfg), -EBADMSG); /* the other view has none */
    sst_log_hold_errors(before);
    assert_non_null(strstr(said, "row 0, column 1 has only a picture"));
    assert_int_equal(sst_file_write(in_dir("src/00_01.dng"), dng, bytes), 0);
    if (sst_image_can_develop()) {
        for (int i = 0; i < 2; i++) { /* with the pictures, and alone */
            import_and_load(&cfg, &lf);
            for (int k = 0; k < 2; k++)
                assert_int_equal(sst_image_row(&lf.views[k].image, 0, 9)[9], 200);
            sst_lightfield_fini(&lf);
            (void)remove(in_dir("src/00_00.jpg"));
            (void)remove(in_dir("src/00_01.jpg"));
            cfg.prefer_raw = false;
        }
        put_image("src/00_01.jpg", 20, 32, 32);
        before = sst_log_hold_errors(said);
        assert_int_equal(sst_import(&cfg), -EBADMSG);
        sst_log_hold_errors(before);
        assert_non_null(strstr(said, "row 0, column 0 has only a raw file"));
    }
    free(dng);
}

static void replacing_is_refused_where_it_would_hurt(void **state SST_UNUSED)
{
    struct sst_import_config cfg = config("folder", "src");

    put_folder();
    cfg.rows = 1;
    cfg.cols = 3;
    cfg.force = true;
    cfg.out = cfg.source;
    assert_int_equal(sst_import(&cfg), -EINVAL);
    cfg.out = in_dir("");
    assert_int_equal(sst_import(&cfg), -EINVAL);
    cfg.out = in_dir("maps");
    assert_int_equal(sst_import(&cfg), 0); /* an empty folder may go */
    assert_int_equal(remove(in_dir("maps/lightfield.json")), 0);
    assert_int_equal(sst_import(&cfg), -EEXIST); /* a folder of something else may not */
    assert_true(sst_path_exists(in_dir("src/00_00.png")));
}

/* A 2x3 light field with fractional offsets, a hole, a JPEG view and disparity, in dir/lf. */
static void make_lightfield(struct sst_lightfield *lf)
{
    char name[300];

    assert_int_equal(sst_lightfield_init_files(lf, 2, 3), 0);
    assert_int_equal(mkdir(in_dir("lf"), 0777), 0);
    assert_int_equal(mkdir(in_dir("lf/views"), 0777), 0);
    lf->width = WIDTH;
    lf->height = HEIGHT;
    lf->spacing_mm = 37.5;
    lf->focal_px = 1234.5;
    lf->disp_min_px = -4;
    lf->range_min_px = -3.75;
    lf->range_max_px = 9;
    lf->infinity_known = true;
    lf->infinity_px = -5.5;
    lf->off_centre_px[0] = 0.25;
    lf->off_centre_px[1] = -3;
    for (int k = 0; k < 6; k++) {
        struct sst_view *v = &lf->views[k];

        v->present = k != 5;
        if (!v->present)
            continue;
        if (k != lf->ref_view) {
            v->bx += 0.0123456789 * (k + 1);
            v->by += 1.0 / 3 * k;
        }
        snprintf(lf->files->view[k].name, sizeof(lf->files->view[k].name), "00_0%d.%s", k, k == 4 ? "jpg" : "png");
        snprintf(name, sizeof(name), "lf/views/%s", lf->files->view[k].name);
        put_image(name, 30 + 10 * k, WIDTH, HEIGHT);
        assert_int_equal(sst_map_u16_init(&v->disp, WIDTH, HEIGHT), 0);
        for (int y = 0; y < HEIGHT; y++) {
            for (int x = 0; x < WIDTH; x++)
                sst_map_u16_row(&v->disp, y)[x] = (uint16_t)(x == 2 ? (int)SST_DISP_NONE : 100 * k + 17 * x + y);
        }
    }
    assert_int_equal(sst_lightfield_write(lf, in_dir("lf"), 2), 0);
    sst_lightfield_fini(lf);
    assert_int_equal(sst_lightfield_load(lf, in_dir("lf"), SST_LOAD_ALL, 2), 0);
}

static int export_to(const char *format, const char *from, const char *to, bool force, int threads)
{
    return sst_export(
        &(struct sst_export_config){ .format = format, .dir = from, .out = to, .force = force, .threads = threads });
}

static void export_gives_back_the_same(void **state SST_UNUSED)
{
    static const char *const formats[] = { "stanford", "hci" };
    struct sst_lightfield lf, back;

    make_lightfield(&lf);
    for (int f = 0; f < 2; f++) {
        struct sst_import_config cfg = config(formats[f], formats[f]);

        assert_int_equal(export_to(formats[f], in_dir("lf"), cfg.source, false, 2), 0);
        cfg.rows = 2;
        cfg.cols = 3;
        cfg.force = f > 0;
        import_and_load(&cfg, &back);
        assert_true(back.infinity_known && fabs(back.infinity_px - lf.infinity_px) < 1e-12);
        assert_memory_equal(back.off_centre_px, lf.off_centre_px, sizeof(lf.off_centre_px));
        assert_int_equal(back.ref_view, lf.ref_view);
        assert_true(back.spacing_mm == lf.spacing_mm && fabs(back.focal_px - lf.focal_px) < 1e-9);
        assert_true(back.range_min_px == lf.range_min_px && back.range_max_px == lf.range_max_px);
        for (int k = 0; k < 6; k++) {
            const struct sst_view *v = &lf.views[k], *w = &back.views[k];

            assert_int_equal(v->present, w->present);
            if (!v->present)
                continue;
            assert_true(fabs(v->bx - w->bx) < 1e-6 && fabs(v->by - w->by) < 1e-6);
            for (int c = 0; c < 3; c++) {
                for (int y = 0; y < HEIGHT; y++)
                    assert_memory_equal(sst_image_row(&v->image, c, y), sst_image_row(&w->image, c, y), WIDTH);
            }
        }
        sst_lightfield_fini(&back);
    }
    /* HCI has disparity as well: exact in float. */
    for (int k = 0; k < 5; k++) {
        struct sst_map_f32 truth;
        char name[64];

        snprintf(name, sizeof(name), "out/truth/%02d_%02d.pfm", k / 3, k % 3);
        assert_int_equal(sst_map_f32_read_pfm(&truth, in_dir(name)), 0);
        for (int x = 0; x < WIDTH; x++) {
            const uint16_t want = sst_map_u16_row(&lf.views[k].disp, 1)[x];

            assert_int_equal(sst_disp_q6(&lf, (double)sst_map_f32_row(&truth, 1)[x]), want);
            assert_int_equal(isinf(sst_map_f32_row(&truth, 1)[x]) != 0, want == SST_DISP_NONE);
        }
        sst_map_f32_fini(&truth);
    }
    sst_lightfield_fini(&lf);
}

static void export_refuses(void **state SST_UNUSED)
{
    struct sst_lightfield lf;

    make_lightfield(&lf);
    assert_int_equal(export_to("tiff", in_dir("lf"), in_dir("x"), false, 1), -EINVAL);
    assert_int_equal(export_to("hci", in_dir("src"), in_dir("x"), false, 1), -ENOENT);
    assert_int_equal(export_to("hci", in_dir("lf"), in_dir("lf"), true, 1), -EINVAL);
    assert_int_equal(export_to("hci", in_dir("lf"), in_dir("src"), false, 1), -EEXIST);
    assert_int_equal(export_to("hci", in_dir("lf"), in_dir("none/x"), false, 1), -EIO);
    put_image("lf/views/00_01.png", 99, WIDTH, HEIGHT); /* no longer the bytes of its hash */
    assert_int_equal(export_to("stanford", in_dir("lf"), in_dir("x"), false, 1), -EBADMSG);
    assert_false(sst_path_exists(in_dir("x")));
    sst_lightfield_fini(&lf);
}

/* A fresh folder with src/ and maps/ for each test. */
static int setup(void **state SST_UNUSED)
{
    static int n;

    if (!n && !mkdtemp(top))
        return -1;
    snprintf(dir, sizeof(dir), "%s/%d", top, n++);
    return mkdir(dir, 0777) || mkdir(in_dir("src"), 0777) || mkdir(in_dir("maps"), 0777);
}

static int remove_all(void **state SST_UNUSED)
{
    sst_path_remove_tree(top);
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(helpers_have_known_answers),
        cmocka_unit_test_setup(stanford_positions_decide, setup),
        cmocka_unit_test_setup(a_hole_needs_a_known_grid, setup),
        cmocka_unit_test_setup(hci_window_keeps_its_truth, setup),
        cmocka_unit_test_setup(a_part_of_the_grid_is_a_grid, setup),
        cmocka_unit_test_setup(a_part_of_a_folder, setup),
        cmocka_unit_test_setup(hci_parameters_are_converted, setup),
        cmocka_unit_test_setup(folder_reads_external_maps, setup),
        cmocka_unit_test_setup(views_of_16_bits_are_scaled_alike, setup),
        cmocka_unit_test_setup(tiff_views_are_those_of_png, setup),
        cmocka_unit_test_setup(folder_refuses, setup),
        cmocka_unit_test_setup(folder_of_a_camera_is_read, setup),
        cmocka_unit_test_setup(replacing_is_refused_where_it_would_hurt, setup),
        cmocka_unit_test_setup(export_gives_back_the_same, setup),
        cmocka_unit_test_setup(export_refuses, setup),
    };

    return cmocka_run_group_tests(tests, NULL, remove_all);
}
