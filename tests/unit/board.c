/* Boards: parsing and formatting, points, markers, and printing. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/file.h"
#include "base/log.h"
#include "pipeline/calibration/board/homography.h"
#include "pipeline/calibration/board/print.h"
#include "pipeline/image/codec.h"
#include "tests/test.h"

#include <errno.h>
#include <math.h>

static void near(double got, double want, double within)
{
    if (!(fabs(got - want) <= within))
        fail_msg("%.17g, not %.17g", got, want);
}

static struct sst_board parsed(const char *text)
{
    struct sst_board b;

    assert_int_equal(sst_board_parse(&b, text), 0);
    return b;
}

static void texts_come_back(void **state SST_UNUSED)
{
    static const char *const same[] = { "charuco:9x7:50mm:0.7",         "charuco:5x12:0.1mm:0.75:5x5_100",
                                        "aprilgrid:6x6:88.3mm:0.3",     "aprilgrid:4x7:25mm:0.25:bottom-up",
                                        "chessboard:10x7:25mm",         "charuco:8x8:33.333333333333336mm:0.8",
                                        "charuco:9x7:50mm:0.7:original" };

    for (size_t i = 0; i < ARRAY_LEN(same); i++) {
        const struct sst_board b = parsed(same[i]);
        char text[128];

        sst_board_format(&b, text);
        assert_string_equal(text, same[i]);
    }
    assert_int_equal(parsed("chessboard:9x6c:2.5cm").cols, 10);
    assert_int_equal(parsed("chessboard:9x6c:2.5cm").rows, 7);
    near(parsed("chessboard:9x6c:2.5cm").square_mm, 25, 1e-12);
    near(parsed("aprilgrid:6x6:0.088m:0.3").square_mm, 88, 1e-12);
    assert_int_equal(parsed("charuco:9x7:50mm:0.7:4X4_50").dictionary, 0);
}

static void faults_are_told(void **state SST_UNUSED)
{
    static const struct {
        const char *text, *words;
    } cases[] = {
        { "", "kind of board" },
        { "circles:9x7:50mm", "kind of board" },
        { "charuco:9x7:50mm", "too few or too many parts" },
        { "chessboard:10x7:25mm:0.7", "too few or too many parts" },
        { "charuco:9x7:50mm:0.7:4x4_50:x", "too few or too many parts" },
        { "chessboard:10:25mm", "COLUMNSxROWS" },
        { "chessboard:10x7x2:25mm", "COLUMNSxROWS" },
        { "chessboard:-10x7:25mm", "COLUMNSxROWS" },
        { "charuco:9x6c:50mm:0.7", "COLUMNSxROWS" },
        { "chessboard:10x7:25", "length" },
        { "chessboard:10x7:nanmm", "length" },
        { "chessboard:10x7:0mm", "0.1 mm" },
        { "chessboard:10x7:1e9mm", "0.1 mm" },
        { "chessboard:3x7:25mm", "4 to 100" },
        { "chessboard:10x101:25mm", "4 to 100" },
        { "charuco:9x7:50mm:1.2", "0.3 and 0.95" },
        { "charuco:9x7:50mm:x", "not a number" },
        { "charuco:9x7:50mm:0.7:8x8_50", "dictionary" },
        { "charuco:12x10:50mm:0.7", "fewer markers" },
        { "aprilgrid:1x1:50mm:0.3", "at least 2 tags" },
        { "aprilgrid:25x24:50mm:0.3", "fewer markers" },
        { "aprilgrid:6x6:50mm:0.3:top", "bottom-up" },
        { "chessboard:10x7:25mm:::::::::::::::::::::::::::::::::::::::::::::::::::::::::::::::::::::::::::::::::::::::"
          ":::::::::::::::::::::::::::::::",
          "too long" },
    };
    char text[SST_LOG_MAX];

    for (size_t i = 0; i < ARRAY_LEN(cases); i++) {
        struct sst_board b = { .cols = 77 };
        int err;

        *text = 0;
        sst_log_hold_errors(text);
        err = sst_board_parse(&b, cases[i].text);
        sst_log_hold_errors(NULL);
        assert_int_equal(err, -EINVAL);
        assert_int_equal(b.cols, 77);
        if (!strstr(text, cases[i].words) || !strstr(text, "charuco:9x7"))
            fail_msg("%s: %s", cases[i].text, text);
    }
}

static int parse_file(struct sst_board *b, const char *yaml)
{
    char path[] = "/tmp/sst-board-XXXXXX.yaml";
    const int fd = mkstemps(path, 5);
    int err;

    assert_true(fd >= 0);
    assert_int_equal(write(fd, yaml, strlen(yaml)), strlen(yaml));
    close(fd);
    err = sst_board_parse(b, path);
    unlink(path);
    return err;
}

static void kalibr_targets_are_read(void **state SST_UNUSED)
{
    struct sst_board b = { 0 };
    char text[SST_LOG_MAX], held[SST_LOG_MAX];

    assert_int_equal(parse_file(&b, "target_type: 'aprilgrid' #gridtype\ntagCols: 6\ntagRows: 7\ntagSize: 0.088\n"
                                    "tagSpacing: 0.3\ncodeOffset: 0\n"),
                     0);
    sst_board_format(&b, text);
    assert_string_equal(text, "aprilgrid:6x7:88mm:0.3:bottom-up");
    assert_int_equal(parse_file(&b, "target_type: checkerboard\ntargetCols: 6\ntargetRows: 7\nrowSpacingMeters: 0.06\n"
                                    "colSpacingMeters: 0.06\n"),
                     0);
    sst_board_format(&b, text);
    assert_string_equal(text, "chessboard:7x8:60mm");
    sst_log_hold_errors(held);
    assert_int_equal(parse_file(&b, "target_type: circlegrid\n"), -EBADMSG);
    assert_int_equal(parse_file(&b, "target_type: aprilgrid\ntagCols: 6\n"), -EBADMSG);
    assert_int_equal(parse_file(&b, "target_type: aprilgrid\ntagCols: 6\ntagRows: 7\ntagSize: 0.088\ntagSpacing: 0.3\n"
                                    "codeOffset: 20\n"),
                     -EBADMSG);
    assert_non_null(strstr(held, "codeOffset is 20"));
    assert_int_equal(parse_file(&b, "target_type: checkerboard\ntargetCols: 6\ntargetRows: 7\nrowSpacingMeters: 0.06\n"
                                    "colSpacingMeters: 0.05\n"),
                     -EBADMSG);
    assert_int_equal(parse_file(&b, "target_type: aprilgrid\ntagCols: 1\ntagRows: 1\ntagSize: 0.1\ntagSpacing: 0.3\n"),
                     -EBADMSG);
    sst_log_hold_errors(NULL);
    assert_string_equal(text, "chessboard:7x8:60mm");
}

static void check_point(const struct sst_board *b, int id, double x, double y)
{
    double p[2];

    sst_board_point(b, id, p);
    near(p[0], x, 1e-9);
    near(p[1], y, 1e-9);
}

static void points_are_where_the_header_says(void **state SST_UNUSED)
{
    const struct sst_board chess = parsed("chessboard:10x7:25mm"), grid = parsed("aprilgrid:3x2:50mm:0.3");

    assert_int_equal(sst_board_points(&chess), 54);
    check_point(&chess, 0, 0, 0);
    check_point(&chess, 10, 25, 25);
    check_point(&chess, 53, 200, 125);
    assert_int_equal(sst_board_points(&grid), 24);
    check_point(&grid, 0, 0, 0);
    check_point(&grid, 1, 50, 0);
    check_point(&grid, 2, 50, 50);
    check_point(&grid, 3, 0, 50);
    check_point(&grid, 4, 65, 0);     /* second tag: 50 + 15 on */
    check_point(&grid, 22, 180, 115); /* last tag, lower right: 2 x 65 + 50, 65 + 50 */
    near(sst_board_pitch_mm(&chess), 25, 0);
    near(sst_board_pitch_mm(&grid), 15, 1e-12);
}

static void markers_are_numbered_as_printed(void **state SST_UNUSED)
{
    const struct sst_board charuco = parsed("charuco:5x4:40mm:0.5"), up = parsed("aprilgrid:3x2:50mm:0.3:bottom-up");
    struct sst_board_marker m[16];

    /* Black at the upper left: whites of row 0 are columns 1 and 3, of row 1 columns 0, 2, 4. */
    assert_int_equal(sst_board_markers(m, &charuco, false), 10);
    near(m[0].corner[0][0], 10, 1e-12); /* square 1 begins at 0, its marker a quarter in */
    near(m[0].corner[0][1], -30, 1e-12);
    near(m[0].corner[2][0], 30, 1e-12);
    near(m[2].corner[0][0], -30, 1e-12);
    near(m[2].corner[0][1], 10, 1e-12);
    /* White at the upper left, as OpenCV drew boards of even rows before 4.6. */
    assert_int_equal(sst_board_markers(m, &charuco, true), 10);
    near(m[0].corner[0][0], -30, 1e-12);
    assert_int_equal(sst_board_markers(m, &up, false), 6);
    assert_int_equal(m[0].number, 3); /* from the lower left: the upper left is the first of the second row */
    assert_int_equal(m[3].number, 0);
    near(m[3].corner[0][0], 50, 1e-12); /* upside down: its own upper left is at the lower right */
    near(m[3].corner[0][1], 115, 1e-12);
    assert_int_equal(sst_board_markers(NULL, &charuco, false), 10);
}

/* True if the print is black there, mm from the board's first point. */
static bool black(const struct sst_print *p, double x, double y)
{
    bool is = false;

    for (int i = 0; i < p->count; i++) {
        const double u = x + p->first_mm[0] - p->rect[i].x, v = y + p->first_mm[1] - p->rect[i].y;

        is |= u >= 0 && v >= 0 && u < p->rect[i].width && v < p->rect[i].height;
    }
    return is;
}

static void prints_show_the_tags_of_kalibr(void **state SST_UNUSED)
{
    /* Tag 0 of 36h11 as Kalibr's script has it; bit 35 is the upper left module, 1 is white. */
    const uint64_t tag0 = 0xD5D628584;
    const struct sst_board b = parsed("aprilgrid:2x2:100mm:0.3:bottom-up");
    struct sst_print p;

    if (!WITH_OPENCV) {
        print_message("built without OpenCV: boards of tags are not drawn\n");
        skip();
    }
    assert_int_equal(sst_print_board(&p, &b), 0);
    near(p.width_mm, 2 * 130 + 30 + 2 * 30, 1e-9);
    for (int i = 0; i < 36; i++) {
        const double x = 25 + i % 6 * 10, y = 130 + 25 + i / 6 * 10; /* the lower left tag begins at (0, 130) */

        assert_int_equal(black(&p, x, y), !(tag0 >> (35 - i) & 1));
    }
    assert_true(black(&p, 5, 135) && black(&p, 15, 145)); /* border of two modules */
    assert_true(black(&p, -5, -5) && black(&p, 205 + 30, 235));
    assert_false(black(&p, 50, -5));
    sst_print_fini(&p);
}

static void prints_are_files(void **state SST_UNUSED)
{
    const struct sst_board b = parsed("chessboard:5x4:20mm");
    char svg[] = "/tmp/sst-board-XXXXXX.svg", png[] = "/tmp/sst-board-XXXXXX.png";
    struct sst_image img = { 0 };
    struct sst_print p;
    uint8_t *text;
    size_t size;

    assert_true(mkstemps(svg, 4) >= 0 && mkstemps(png, 4) >= 0);
    assert_int_equal(sst_print_board(&p, &b), 0);
    assert_int_equal(p.count, 10);
    assert_int_equal(sst_print_write_svg(&p, "board", svg), 0);
    assert_int_equal(sst_print_write_png(&p, 127, png), 0); /* 5 dots a mm */
    assert_int_equal(sst_file_read(svg, 1 << 20, &text, &size), 0);
    assert_non_null(strstr((char *)text, "width=\"120mm\" height=\"100mm\" viewBox=\"0 0 120 100\""));
    assert_non_null(strstr((char *)text, "M10 10h20v20h-20z"));
    free(text);
    assert_int_equal(sst_image_read(&img, png), 0);
    assert_int_equal(img.width, 600);
    assert_int_equal(sst_image_row(&img, 0, 49)[49], 255);
    assert_int_equal(sst_image_row(&img, 0, 50)[50], 0);
    assert_int_equal(sst_image_row(&img, 0, 149)[149], 0);
    assert_int_equal(sst_image_row(&img, 0, 149)[150], 255);
    sst_image_fini(&img);
    assert_int_equal(sst_print_write_png(&p, 1e6, png), -EINVAL);
    sst_print_fini(&p);
    unlink(svg);
    unlink(png);
}

/* x = (2 u + 1) / (0.1 u + 1), y = (v - 3) / (0.1 u + 1): through five points exactly, and refused where there is no
 * solution. */
static void homographies_are_fitted(void **state SST_UNUSED)
{
    static const double from[6][2] = { { 0, 0 }, { 4, 0 }, { 4, 3 }, { 0, 3 }, { 2, 1 }, { 1, 2 } };
    static const double line[5][2] = { { 0, 0 }, { 1, 1 }, { 2, 2 }, { 3, 3 }, { 4, 4 } };
    double to[6][2], h[9], out[2], by[4], u[2] = { 3, 2 };

    for (int i = 0; i < 6; i++) {
        to[i][0] = (2 * from[i][0] + 1) / (0.1 * from[i][0] + 1);
        to[i][1] = (from[i][1] - 3) / (0.1 * from[i][0] + 1);
    }
    for (int n = 4; n <= 6; n++) {
        assert_true(sst_homography_fit(h, from, (const double(*)[2])to, NULL, n));
        assert_true(sst_homography_apply(h, u, out));
        near(out[0], 7 / 1.3, 1e-9);
        near(out[1], -1 / 1.3, 1e-9);
        assert_true(sst_homography_slope(h, u, by));
        near(by[0], (2 - 0.1 * 7 / 1.3) / 1.3, 1e-9);
        near(by[1], 0, 1e-9);
        near(by[3], 1 / 1.3, 1e-9);
    }
    u[0] = -20; /* behind the horizon */
    assert_false(sst_homography_apply(h, u, out));
    assert_false(sst_homography_fit(h, from, (const double(*)[2])to, NULL, 3));
    assert_false(sst_homography_fit(h, line, (const double(*)[2])to, NULL, 5));
    to[1][0] = NAN;
    assert_false(sst_homography_fit(h, from, (const double(*)[2])to, NULL, 6));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(texts_come_back),
        cmocka_unit_test(faults_are_told),
        cmocka_unit_test(kalibr_targets_are_read),
        cmocka_unit_test(points_are_where_the_header_says),
        cmocka_unit_test(markers_are_numbered_as_printed),
        cmocka_unit_test(prints_show_the_tags_of_kalibr),
        cmocka_unit_test(prints_are_files),
        cmocka_unit_test(homographies_are_fitted),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
