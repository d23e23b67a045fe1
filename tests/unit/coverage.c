/* Coverage: counts, criteria, text and picture; detections sorted and in files. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <stdio.h>
#include <unistd.h>

#include <errno.h>

#include "base/file.h"
#include "base/log.h"
#include "pipeline/calibration/board/coverage.h"
#include "tests/board_scene.h"
#include "tests/test.h"

static struct sst_board parsed(const char *text)
{
    struct sst_board b;

    assert_int_equal(sst_board_parse(&b, text), 0);
    return b;
}

static void begin(struct sst_detections *all, const char *board, int rows, int cols, int frames)
{
    const struct sst_board b = parsed(board);

    assert_int_equal(
        sst_detections_init(
            all, &(struct sst_detections){ .board = b, .rows = rows, .cols = cols, .width = 640, .height = 480 }),
        0);
    for (int i = 0; i < frames; i++) {
        char name[16];

        snprintf(name, sizeof(name), "frame %d", i);
        assert_int_equal(sst_detections_frame(all, name), i);
    }
    for (int i = 0; i < rows * cols; i++)
        snprintf(all->camera_name[i], sizeof(all->camera_name[i]), "camera %d", i);
}

/* The board as a camera sees it: its points inside the picture. */
static struct sst_detection seen(const struct sst_board *b, int view, int frame, const double turn[3], double x,
                                 double y, double z)
{
    struct sst_detection d = { .view = view, .frame = frame, .blur_px = 0.7, .blur_aspect = 1.1 };
    struct board_scene s;

    board_scene_defaults(&s, b);
    memcpy(s.turn, turn, sizeof(s.turn));
    s.at_mm[0] = x;
    s.at_mm[1] = y;
    s.at_mm[2] = z;
    d.corner = calloc((size_t)sst_board_points(b), sizeof(*d.corner));
    assert_non_null(d.corner);
    for (int i = 0; i < sst_board_points(b); i++) {
        double p[2], u, v;

        sst_board_point(b, i, p);
        if (board_scene_project(&s, p, &u, &v) && u > 0 && v > 0 && u < 639 && v < 479)
            d.corner[d.corners++] = (struct sst_corner){ i, u, v, 0.5 + 0.001 * i };
    }
    return d;
}

static void add(struct sst_detections *all, struct sst_detection d)
{
    assert_int_equal(sst_detections_add(all, &d), 0);
    assert_null(d.corner);
}

static void tilts_and_depths_are_told_apart(void **state SST_UNUSED)
{
    static const double turns[5][3] = {
        { 0.1, 0.1, 0.5 }, { 0, 0.5, 0 }, { 0, -0.5, 0 }, { 0.5, 0, 0 }, { -0.5, 0, 0 }
    };
    struct sst_coverage c;
    struct sst_detections all;
    double r[9], corner[3];

    begin(&all, "charuco:9x7:50mm:0.7", 1, 1, 5);
    for (int i = 0; i < 5; i++)
        add(&all, seen(&all.board, 0, i, turns[i], 0, 0, i == 0 ? 500 : 1000));
    sst_coverage_count(&c, &all);
    /* By hand: the board's right edge (1, 0, 0) after a rotation about y by +0.5 has z = -sin 0.5: nearer, the board
     * faces left. */
    sst_rotation_from_vector(turns[1], r);
    for (int i = 0; i < 3; i++)
        corner[i] = r[3 * i];
    assert_true(corner[2] < 0);
    for (int i = 0; i < 5; i++)
        assert_int_equal(c.tilt[i], 1);
    sst_detections_fini(&all);

    begin(&all, "charuco:9x7:50mm:0.7", 1, 1, 2);
    add(&all, seen(&all.board, 0, 0, turns[1], 0, 0, 1000));
    sst_coverage_count(&c, &all);
    assert_int_equal(c.tilt[1], 1); /* left */
    add(&all, seen(&all.board, 0, 1, turns[3], 0, 0, 1000));
    sst_coverage_count(&c, &all);
    /* (0, 1, 0) rotated about x by +0.5: z = sin 0.5, the lower side is farther, the board faces down. */
    assert_int_equal(c.tilt[4], 1);
    sst_detections_fini(&all);

    begin(&all, "aprilgrid:4x4:50mm:0.3", 1, 1, 2);
    add(&all, seen(&all.board, 0, 0, turns[0], 0, 0, 600));
    add(&all, seen(&all.board, 0, 1, turns[0], 0, 0, 1200));
    sst_coverage_count(&c, &all);
    assert_true(fabs(c.near_size / c.far_size - 2) < 0.02);
    assert_true(fabs(c.far_size - 50 * 600 / 1200.0) < 0.5);
    assert_int_equal(c.frames, 2);
    assert_int_equal(c.corners, 128);
    sst_detections_fini(&all);
}

static void what_is_missing_is_told(void **state SST_UNUSED)
{
    static const double turns[5][3] = { { 0, 0, 0 }, { 0, 0.5, 0 }, { 0, -0.5, 0 }, { 0.5, 0, 0 }, { -0.5, 0, 0 } };
    struct sst_detections all;
    struct sst_coverage c = { 0 };
    char text[160];

    sst_coverage_missing(&c, text);
    assert_string_equal(text, "everything");
    assert_true(sst_coverage_share(&c) == 0);
    begin(&all, "charuco:9x7:50mm:0.7", 1, 1, 40);
    for (int i = 0; i < 40; i++) /* everywhere but at the lower left */
        add(&all, seen(&all.board, 0, i, turns[i % 5], (i % 4 - 1.5) * 130, (i / 4 % 3 - 1) * 120, i % 2 ? 500 : 800));
    sst_coverage_count(&c, &all);
    sst_coverage_missing(&c, text);
    assert_string_equal(text, "");
    assert_true(sst_coverage_share(&c) == 1);
    memset(c.cell[4], 0, 2 * sizeof(c.cell[0][0]));
    c.tilt[2] = 0;
    c.far_size = c.near_size / 1.2;
    c.frames = 9;
    sst_coverage_missing(&c, text);
    assert_string_equal(text, "lower left, tilt to the right, nearer and farther, 6 more frames");
    /* 23 of 25 regions, 4 of 5 tilts, 0.2 of 0.5 in depth, 9 of 15 frames */
    assert_true(fabs(sst_coverage_share(&c) - (0.4 * 0.92 + 0.25 * 0.8 + 0.15 * 0.4 + 0.2 * 0.6)) < 1e-9);
    memset(&c.cell, 0, sizeof(c.cell));
    memset(&c.tilt, 0, sizeof(c.tilt));
    sst_coverage_missing(&c, text);
    assert_string_equal(text, "all regions, tilts, nearer and farther, 6 more frames");
    sst_detections_fini(&all);
}

/* Fraction of predominantly red pixels. */
static double redness(const struct sst_image *img, int x0, int x1)
{
    double red = 0;

    for (int y = 0; y < img->height; y++) {
        for (int x = x0; x < x1; x++)
            red += sst_image_row(img, 0, y)[x] > sst_image_row(img, 1, y)[x] + 20;
    }
    return red / ((x1 - x0) * img->height);
}

static void the_picture_shows_it(void **state SST_UNUSED)
{
    static const double turn[3] = { 0 };
    struct sst_coverage c[256];
    struct sst_detections all;
    struct sst_image img;

    begin(&all, "charuco:9x7:50mm:0.7", 2, 2, 12);
    *all.camera_name[2] = 0;
    for (int i = 0; i < 12; i++)
        add(&all, seen(&all.board, 1, i, turn, (i % 4 - 1.5) * 130, (i / 4 % 3 - 1) * 120, 500));
    sst_coverage_count(c, &all);
    assert_int_equal(sst_coverage_picture(&img, &all, c), 0);
    assert_true(img.width <= 1600 && img.width > 600);
    assert_true(redness(&img, 0, img.width / 2) > 0.3); /* camera 0 has seen nothing, 2 is a hole */
    assert_true(redness(&img, img.width / 2, img.width) < redness(&img, 0, img.width / 2) + 0.1);
    sst_image_fini(&img);
    sst_detections_fini(&all);
    for (int cols = 1; cols <= 256; cols *= 16) { /* any grid fits */
        begin(&all, "chessboard:9x7:50mm", 256 / cols, cols, 1);
        sst_coverage_count(c, &all);
        assert_int_equal(sst_coverage_picture(&img, &all, c), 0);
        sst_image_fini(&img);
        sst_detections_fini(&all);
    }
}

/* --- detections --------------------------------------------------------------------------------------------------- */

static void detections_are_kept_in_order(void **state SST_UNUSED)
{
    static const int order[6][2] = { { 1, 2 }, { 0, 1 }, { 1, 0 }, { 0, 2 }, { 1, 1 }, { 0, 0 } };
    static const double turn[3] = { 0 };
    struct sst_detections all;
    struct sst_detection again, wrong;

    begin(&all, "charuco:9x7:50mm:0.7", 1, 3, 2);
    for (int i = 0; i < 6; i++)
        add(&all, seen(&all.board, order[i][1], order[i][0], turn, 0, 0, 900));
    assert_int_equal(all.count, 6);
    for (int i = 0; i < 6; i++) {
        assert_int_equal(all.detection[i].frame, i / 3);
        assert_int_equal(all.detection[i].view, i % 3);
    }
    again = seen(&all.board, 1, 1, turn, 0, 0, 900);
    assert_int_equal(sst_detections_add(&all, &again), -EINVAL);
    assert_non_null(again.corner);
    again.view = 3;
    assert_int_equal(sst_detections_add(&all, &again), -EINVAL);
    sst_detection_fini(&again);
    wrong = seen(&all.board, 1, 1, turn, 0, 0, 900);
    wrong.corner[3].id = 2;
    assert_int_equal(sst_detections_add(&all, &wrong), -EINVAL);
    sst_detection_fini(&wrong);
    sst_detections_fini(&all);
}

/* A board with rotational symmetry (half or a quarter of a turn), numbered differently in each view. */
static void views_of_a_frame_number_alike(void **state SST_UNUSED)
{
    static const struct {
        const char *board;
        int ways;
    } cases[] = { { "chessboard:9x7:50mm", 2 },
                  { "chessboard:8x8:50mm", 2 },
                  { "chessboard:7x7:50mm", 4 },
                  { "chessboard:10x7:50mm", 1 } };

    for (size_t i = 0; i < ARRAY_LEN(cases); i++) {
        for (int turn = 0; turn < 16; turn++) {
            const double full = 2 * M_PI;
            struct sst_detections all;
            double first = 0;

            begin(&all, cases[i].board, 1, 6, 1);
            assert_int_equal(sst_chessboard_ways(all.board.cols - 1, all.board.rows - 1), cases[i].ways);
            for (int view = 5; view >= 0; view--) {
                /* The cameras differ in roll by a few degrees; the numbering begins anywhere. */
                const double roll[3] = {
                    0, 0, turn * full / 16 + 0.03 * (view - 2) + view % cases[i].ways * full / cases[i].ways
                };

                add(&all, seen(&all.board, view, 0, roll, 0, 0, 1500));
            }
            for (int view = 0; view < 6; view++) {
                const struct sst_detection *d = &all.detection[view];
                const struct sst_corner *last = &d->corner[all.board.cols - 2];
                const double heading = atan2(last->y - d->corner[0].y, last->x - d->corner[0].x);

                assert_int_equal(d->corner[0].id, 0);
                assert_int_equal(d->corners, sst_board_points(&all.board));
                if (view == 0)
                    first = heading;
                assert_true(fabs(remainder(heading - first, full)) < 0.2);
                assert_true(fabs(heading) < M_PI / cases[i].ways + 0.2 || cases[i].ways == 1);
            }
            sst_detections_fini(&all);
        }
    }
}

static void files_come_back_bit_for_bit(void **state SST_UNUSED)
{
    static const double turn[3] = { 0.2, -0.3, 0.1 };
    char path[] = "/tmp/sst-detections-XXXXXX", text[2][128];
    struct sst_detections all, back;

    assert_true(mkstemp(path) >= 0);
    begin(&all, "aprilgrid:4x3:33.333333333333336mm:0.3:bottom-up", 2, 2, 3);
    strcpy(all.camera_name[1], "a \"quoted\\ name\n");
    all.rig = true;
    all.drive_mm = calloc(4, sizeof(*all.drive_mm));
    all.drive_mm[3][2] = 1 / 3.0;
    for (int i = 0; i < 5; i++)
        add(&all, seen(&all.board, i % 4, i / 2, turn, 10 * i, 0, 700));
    all.outcome[0] = 5;
    all.outcome[5] = 2;
    assert_int_equal(sst_detections_write(&all, path), 0);
    assert_int_equal(sst_detections_read(&back, path), 0);
    sst_board_format(&all.board, text[0]);
    sst_board_format(&back.board, text[1]);
    assert_string_equal(text[0], text[1]);
    assert_memory_equal(back.outcome, all.outcome, sizeof(back.outcome));
    assert_memory_equal(back.drive_mm, all.drive_mm, 4 * sizeof(*all.drive_mm));
    assert_true(back.rig && back.rows == 2 && back.cols == 2 && back.width == 640 && back.height == 480);
    assert_int_equal(back.frames, 3);
    assert_int_equal(back.count, 5);
    for (int i = 0; i < 4; i++)
        assert_string_equal(back.camera_name[i], all.camera_name[i]);
    for (int i = 0; i < 5; i++) {
        const struct sst_detection *a = &all.detection[i], *b = &back.detection[i];

        assert_true(a->view == b->view && a->frame == b->frame && a->corners == b->corners);
        assert_true(a->blur_px == b->blur_px && a->blur_aspect == b->blur_aspect);
        for (int k = 0; k < a->corners; k++)
            assert_true(a->corner[k].id == b->corner[k].id && a->corner[k].x == b->corner[k].x &&
                        a->corner[k].y == b->corner[k].y && a->corner[k].weight == b->corner[k].weight);
    }
    sst_detections_fini(&back);
    sst_detections_fini(&all);
    unlink(path);
}

#define HEAD                                                                                                           \
    "{\"format\": \"sst-detections\", \"version\": 1, \"board\": \"chessboard:4x4:25mm\", \"rows\": 1, \"cols\": 1, "  \
    "\"width\": 64, \"height\": 48, \"cameras\": [\"a\"], \"frames\": [\"f\"], "

static void damaged_files_are_refused(void **state SST_UNUSED)
{
    static const struct {
        const char *text, *words;
    } cases[] = {
        { "", ":1:" },
        { "{}", "format" },
        { "[1]", "format" },
        { "{\"format\": \"sst-detections\", \"version\": 2}", "version" },
        { "{\"format\": \"sst-detections\", \"version\": 1}", "board" },
        { "{\"format\": \"sst-detections\", \"version\": 1, \"board\": \"disc\"}", "disc" },
        { "{\"format\": \"sst-detections\", \"version\": 1, \"board\": \"chessboard:4x4:25mm\", \"rows\": 1e9}",
          "rows" },
        { "{\"format\": \"sst-detections\", \"version\": 1, \"board\": \"chessboard:4x4:25mm\", \"rows\": 200, "
          "\"cols\": 200, \"width\": 9, \"height\": 9}",
          "256" },
        { HEAD "\"detections\": 3}", "detections" },
        { HEAD "\"detections\": [{\"frame\": 1, \"view\": 0, \"corners\": [[0, 1, 2]]}]}", "frame" },
        { HEAD "\"detections\": [{\"frame\": 0, \"view\": 0, \"corners\": []}]}", "no corners" },
        { HEAD "\"detections\": [{\"frame\": 0, \"view\": 0, \"corners\": [[9, 1, 2]]}]}", "detections[0]" },
        { HEAD "\"detections\": [{\"frame\": 0, \"view\": 0, \"corners\": [[1, 1, 2], [1, 1, 2]]}]}", "ascending" },
        { HEAD "\"detections\": [{\"frame\": 0, \"view\": 0, \"corners\": [[1, 1, 2, -1]]}]}", "ascending" },
        { HEAD "\"detections\": [{\"frame\": 0, \"view\": 0, \"corners\": [[1, 1, 1e300]]}]}", "ascending" },
        { HEAD "\"detections\": [{\"frame\": 0, \"view\": 0, \"corners\": [[1, 1, 2]]}, {\"frame\": 0, \"view\": 0, "
               "\"corners\": [[1, 1, 2]]}]}",
          "earlier frame" },
    };
    char path[] = "/tmp/sst-detections-XXXXXX", text[SST_LOG_MAX];
    struct sst_detections all = { .rows = 77 };

    assert_true(mkstemp(path) >= 0);
    for (size_t i = 0; i < ARRAY_LEN(cases); i++) {
        int err;

        assert_int_equal(sst_file_write(path, cases[i].text, strlen(cases[i].text)), 0);
        *text = 0;
        sst_log_hold_errors(text);
        err = sst_detections_read(&all, path);
        sst_log_hold_errors(NULL);
        assert_int_equal(all.rows, 77);
        if (err != -EBADMSG || !strstr(text, cases[i].words))
            fail_msg("%s: %d, %s", cases[i].text, err, text);
    }
    /* Another detector may leave weights and blur out. */
    static const char plain[] = HEAD "\"detections\": [{\"frame\": 0, \"view\": 0, \"corners\": [[1, 5.5, 2]]}]}";

    assert_int_equal(sst_file_write(path, plain, sizeof(plain) - 1), 0);
    assert_int_equal(sst_detections_read(&all, path), 0);
    assert_true(all.detection[0].corner[0].weight == 1 && all.detection[0].corner[0].x == 5.5);
    sst_detections_fini(&all);
    unlink(path);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(tilts_and_depths_are_told_apart),
        cmocka_unit_test(what_is_missing_is_told),
        cmocka_unit_test(the_picture_shows_it),
        cmocka_unit_test(detections_are_kept_in_order),
        cmocka_unit_test(views_of_a_frame_number_alike),
        cmocka_unit_test(files_come_back_bit_for_bit),
        cmocka_unit_test(damaged_files_are_refused),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
