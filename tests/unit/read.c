/* libsst-read: sizes of its structures, pixels, cameras and maps of a lattice, refusals as text. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "pipeline/image/codec.h"
#include "pipeline/lightfield/lightfield.h"
#include "pipeline/lightfield/folder.h"
#include "read/sst/read.h"
#include "tests/test.h"

#define W 7
#define H 5

static char dir[] = "/tmp/sst-read-XXXXXX";

static uint8_t level(int view, int c, int x, int y)
{
    return (uint8_t)(view * 50 + c * 11 + x * 3 + y * 17);
}

/* A lattice of 1 x 2 with a hole behind them, 16 bits in the second view, a map for the first. */
static int setup(void **state SST_UNUSED)
{
    struct sst_lightfield lf;
    struct sst_map_u16 plane[3];
    char path[SST_PATH_MAX];

    if (!mkdtemp(dir) || sst_lightfield_init_files(&lf, 1, 3) || sst_path_join(path, dir, "views") || sst_path_make_dir(path))
        return -1;
    lf.width = W;
    lf.height = H;
    lf.focal_px = 100;
    lf.spacing_mm = 40;
    lf.disp_min_px = -2;
    lf.infinity_known = true;
    lf.infinity_px = -1;
    lf.samples = (struct sst_samples){ 0, 1023 };
    for (int k = 0; k < 2; k++) {
        struct sst_image img;

        lf.views[k].present = true;
        snprintf(lf.files->view[k].name, sizeof(lf.files->view[k].name), "v%d.png", k);
        snprintf(path, sizeof(path), "%s/views/v%d.png", dir, k);
        if (sst_image_init(&img, W, H))
            return -1;
        for (int c = 0; c < 3; c++) {
            if (sst_map_u16_init(&plane[c], W, H))
                return -1;
            for (int i = 0; i < W * H; i++) {
                sst_image_row(&img, c, i / W)[i % W] = level(k, c, i % W, i / W);
                sst_map_u16_row(&plane[c], i / W)[i % W] = (uint16_t)(4 * level(k, c, i % W, i / W));
            }
        }
        if (k ? sst_image_write_deep(plane, path) : sst_image_write_png(&img, path))
            return -1;
        for (int c = 0; c < 3; c++)
            sst_map_u16_fini(&plane[c]);
        sst_image_fini(&img);
    }
    if (sst_lightfield_choose_ref(&lf) || sst_map_u16_init(&lf.views[0].disp, W, H) || sst_map_u8_init(&lf.views[0].label, W, H))
        return -1;
    for (int k = 0; k < 3; k++)
        lf.views[k].bx = k - lf.ref_view;
    sst_map_u16_row(&lf.views[0].disp, 0)[0] = SST_DISP_NONE;
    sst_map_u16_row(&lf.views[0].disp, 4)[6] = 5 * 64 + 32;
    sst_map_u8_row(&lf.views[0].label, 2)[3] = SST_LABEL_TREE;
    if (sst_lightfield_write(&lf, dir, 1))
        return -1;
    sst_lightfield_fini(&lf);
    return 0;
}

static int teardown(void **state SST_UNUSED)
{
    sst_path_remove_tree(dir);
    return 0;
}

/* Programs that were built against SST_READ_0.2 have these. */
static void structures_keep_their_size(void **state SST_UNUSED)
{
    if (sizeof(void *) != 8)
        return;
    assert_int_equal(sizeof(struct sst_read_info), 96);
    assert_int_equal(offsetof(struct sst_read_info, focal_px), 56);
    assert_int_equal(offsetof(struct sst_read_info, kelvin_offset), 88);
    assert_int_equal(sizeof(struct sst_read_view), 256);
    assert_int_equal(offsetof(struct sst_read_view, bx), 24);
    assert_int_equal(offsetof(struct sst_read_view, name), 248);
}

static void lattice_is_read(void **state SST_UNUSED)
{
    struct sst_read_info info = { .size = sizeof(info) };
    struct sst_read_view view = { .size = sizeof(view) };
    struct sst_read *lf;
    uint8_t rgb[H][32], label[H][W];
    uint16_t deep[H][W][3];
    float px[H][W];

    assert_int_equal(sst_read_open(&lf, dir), 0);
    assert_int_equal(sst_read_get_info(lf, &info), 0);
    assert_int_equal(info.views, 3);
    assert_int_equal(info.width, W);
    assert_int_equal(info.reference, 1);
    assert_true(info.infinity_px == -1);
    assert_int_equal(sst_read_get_view(lf, 0, &view), 0);
    assert_true(view.present && view.placed && view.bx == -1 && view.position_mm[0] == -40 && view.fx == 100 && view.cx == 3 - 1);
    assert_string_equal(view.name, "v0.png");
    assert_int_equal(sst_read_get_view(lf, 2, &view), 0);
    assert_true(!view.present && !view.placed && isnan(view.fx));
    assert_string_equal(sst_read_label_name(lf, SST_LABEL_TREE), "Tree");
    assert_null(sst_read_label_name(lf, info.labels + 1));

    memset(rgb, 7, sizeof(rgb));
    assert_int_equal(sst_read_rgb8(lf, 0, rgb[0], sizeof(rgb[0])), 0);
    for (int i = 0; i < W * H; i++)
        assert_int_equal(rgb[i / W][3 * (i % W) + 2], level(0, 2, i % W, i / W));
    assert_int_equal(rgb[1][3 * W], 7); /* between the rows */
    assert_int_equal(sst_read_rgb16(lf, 0, deep[0][0], 0), 0);
    assert_int_equal(deep[4][6][1], 257 * level(0, 1, 6, 4));
    assert_int_equal(sst_read_rgb16(lf, 1, deep[0][0], 0), 0);
    assert_int_equal(deep[4][6][1], 4 * level(1, 1, 6, 4));
    assert_int_equal(sst_read_rgb8(lf, 1, rgb[0], sizeof(rgb[0])), 0);
    assert_int_equal(rgb[4][19], (4 * level(1, 1, 6, 4) * 255 + 511) / 1023);

    assert_int_equal(sst_read_disparity(lf, 0, px[0], 0), 0);
    assert_true(isnan(px[0][0]) && px[0][1] == -2 && px[4][6] == 3.5f);
    assert_int_equal(sst_read_labels(lf, 0, label[0], 0), 0);
    assert_int_equal(label[2][3], SST_LABEL_TREE);
    assert_string_equal(sst_read_error(), "");
    sst_read_close(lf);
}

/* @param words  of the error's text */
static void refused(int err, int expected, const char *words)
{
    assert_int_equal(err, expected);
    if (!strstr(sst_read_error(), words) || strchr(sst_read_error(), '\n'))
        fail_msg("no \"%s\" in: %s", words, sst_read_error());
}

static void faults_are_sentences(void **state SST_UNUSED)
{
    struct sst_read_info info = { .size = sizeof(info) + 1 };
    struct sst_read_view view = { .size = 4 };
    struct sst_read *lf = NULL, *untouched = NULL;
    uint8_t rgb[H * W * 3];
    char path[SST_PATH_MAX];
    float px[H * W];

    refused(sst_read_open(&untouched, "/nowhere"), -ENOENT, "/nowhere is not a light field");
    assert_null(untouched);
    assert_int_equal(sst_read_open(&lf, dir), 0);
    refused(sst_read_get_info(lf, &info), -EINVAL, "info->size");
    refused(sst_read_get_view(lf, 0, &view), -EINVAL, "out->size");
    refused(sst_read_rgb8(lf, 3, rgb, 0), -EINVAL, "no view");
    refused(sst_read_rgb8(lf, -1, rgb, 0), -EINVAL, "no view");
    refused(sst_read_rgb8(lf, 2, rgb, 0), -ENODATA, "no view at this place");
    refused(sst_read_rgb8(lf, 0, rgb, 3 * W - 1), -EINVAL, "stride");
    refused(sst_read_disparity(lf, 1, px, 0), -ENODATA, "sst process");
    refused(sst_read_confidence(lf, 0, rgb, 0), -ENODATA, "no map");
    snprintf(path, sizeof(path), "%s/views/v0.png", dir);
    assert_int_equal(truncate(path, 40), 0);
    refused(sst_read_rgb8(lf, 0, rgb, 0), -EBADMSG, "v0.png");
    assert_int_equal(unlink(path), 0);
    refused(sst_read_rgb16(lf, 0, (uint16_t[H * W * 3]){ 0 }, 0), -ENOENT, "v0.png");
    sst_read_close(lf);
    sst_read_close(NULL);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(structures_keep_their_size),
        cmocka_unit_test(lattice_is_read),
        cmocka_unit_test(faults_are_sentences),
    };

    return cmocka_run_group_tests(tests, setup, teardown);
}
