/* Detection of boards in pictures with known truth: positions, numbers, blur, and false detections. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <stdio.h>
#include <unistd.h>

#include <errno.h>

#include "base/file.h"
#include "base/log.h"
#include "base/thread.h"
#include "pipeline/calibration/board/detect.h"
#include "tests/board_scene.h"
#include "tests/small.h"
#include "tests/test.h"

#ifdef __SANITIZE_THREAD__
#define WATCH_THREADS true
#else
#define WATCH_THREADS false
#endif

static struct sst_board parsed(const char *text)
{
    struct sst_board b;

    assert_int_equal(sst_board_parse(&b, text), 0);
    return b;
}

/* Boards with all edges at multiples of dot_mm. */
static const struct {
    const char *text;
    double dot_mm, size_mm;
} kinds[] = {
    { "chessboard:9x6:40mm", 20, 360 },
    { "charuco:8x6:40mm:0.75", 5, 320 },
    { "aprilgrid:5x4:50mm:0.3:bottom-up", 5, 340 },
    { "aprilgrid:5x4:50mm:0.3", 5, 340 },
};

struct errors {
    int points, wrong, visible;
    double mean[2], square, worst;
};

/* Compare with the truth; points off by more than 2 px are wrong. */
static void compare(struct errors *e, const struct board_scene *s, const struct sst_detection *d)
{
    for (int i = 0; i < sst_board_points(&s->board); i++) {
        double p[2], x, y;

        sst_board_point(&s->board, i, p);
        e->visible += board_scene_project(s, p, &x, &y) && x > 4 && y > 4 && x < s->width - 5 && y < s->height - 5;
    }
    for (int i = 0; i < d->corners; i++) {
        double p[2], x, y, off[2];

        assert_true(i == 0 || d->corner[i].id > d->corner[i - 1].id);
        assert_true(d->corner[i].weight > 0 && d->corner[i].weight <= 1);
        sst_board_point(&s->board, d->corner[i].id, p);
        assert_true(board_scene_project(s, p, &x, &y));
        off[0] = d->corner[i].x - x;
        off[1] = d->corner[i].y - y;
        if (hypot(off[0], off[1]) > 2) {
            e->wrong++;
            continue;
        }
        e->points++;
        e->mean[0] += off[0];
        e->mean[1] += off[1];
        e->square += off[0] * off[0] + off[1] * off[1];
        e->worst = fmax(e->worst, hypot(off[0], off[1]));
    }
}

static enum sst_detect_outcome detect_in(struct sst_detection *d, const struct board_scene *s, double dot_mm,
                                         const struct sst_board *sought)
{
    enum sst_detect_outcome outcome = SST_DETECT_NONE;
    struct sst_image img;

    assert_int_equal(board_scene_draw(&img, s, dot_mm), 0);
    assert_int_equal(sst_board_detect(sought, &img, NULL, d, &outcome), 0);
    sst_image_fini(&img);
    return outcome;
}

static void report(const char *what, const struct errors *e)
{
    print_message("%s: %d of %d points, %d wrong, mean error %+.4f %+.4f px, RMS of an axis %.4f, worst %.3f\n", what,
                  e->points, e->visible, e->wrong, e->mean[0] / fmax(e->points, 1), e->mean[1] / fmax(e->points, 1),
                  sqrt(e->square / 2 / fmax(e->points, 1)), e->worst);
}

/* --- places ------------------------------------------------------------------------------------------------------- */

static void place(struct board_scene *s, const char *text, double size_mm, int width)
{
    const struct sst_board b = parsed(text);

    board_scene_defaults(s, &b);
    s->width = width;
    s->height = width * 3 / 4;
    s->cam.fx = s->cam.fy = width * 0.9;
    s->cam.cx = s->width / 2.0 - 0.5;
    s->cam.cy = s->height / 2.0 - 0.5;
    s->at_mm[2] = size_mm * 1.25; /* its width takes 0.72 of the picture's */
}

static void exact_pictures_give_exact_points(void **state SST_UNUSED)
{
    for (size_t k = 0; k < ARRAY_LEN(kinds); k++) {
        struct errors clean = { 0 }, hard = { 0 };

        for (int pose = 0; pose < (k < 2 ? 2 : 1); pose++) {
            struct board_scene s;
            struct sst_detection d;

            place(&s, kinds[k].text, kinds[k].size_mm, 480);
            s.turn[0] = pose ? 0.35 : -0.2;
            s.turn[1] = pose ? -0.3 : 0.4;
            s.turn[2] = pose ? 0.21 : -0.13;
            s.at_mm[0] = pose ? 11.3 : -7.7;
            s.cam.k[0] = -0.15;
            s.cam.k[1] = 0.05;
            s.cam.lens = 5;
            assert_int_equal(detect_in(&d, &s, kinds[k].dot_mm, &s.board), SST_DETECT_FOUND);
            compare(&clean, &s, &d);
            sst_detection_fini(&d);
            s.noise = 3;
            s.vignetting = 0.5;
            s.blur_px = 0.9;
            assert_int_equal(detect_in(&d, &s, kinds[k].dot_mm, &s.board), SST_DETECT_FOUND);
            compare(&hard, &s, &d);
            sst_detection_fini(&d);
        }
        report(kinds[k].text, &clean);
        report("  noise, vignetting, blur", &hard);
        assert_int_equal(clean.wrong + hard.wrong, 0);
        assert_true(clean.points >= 0.96 * clean.visible && hard.points >= 0.96 * hard.visible);
        assert_true(sqrt(clean.square / 2 / clean.points) < 0.02);
        assert_true(sqrt(hard.square / 2 / hard.points) < 0.05);
        for (int axis = 0; axis < 2; axis++) {
            assert_true(fabs(clean.mean[axis] / clean.points) < 0.003);
            assert_true(fabs(hard.mean[axis] / hard.points) < 0.008);
        }
    }
}

/* --- numbers ------------------------------------------------------------------------------------------------------ */

static void partial_and_turned_boards_keep_their_numbers(void **state SST_UNUSED)
{
    static const struct {
        const char *what;
        double x, y, turn[3], scale;
        bool whole;
    } cases[] = {
        { "beyond the right edge", 0.45, 0, { 0.1, -0.2, 0.1 }, 1, false },
        { "beyond the lower left", -0.4, 0.35, { -0.2, 0.1, -0.3 }, 1, false },
        { "on its head", 0, 0, { 0.1, 0.05, 3.0 }, 1, true },
        { "on its side", 0, 0, { 0.1, 0.2, -1.5 }, 1.25, true },
        { "tilted by 60 degrees", 0, 0, { 0.1, 1.05, 0.2 }, 1.1, true },
    };

    for (size_t k = 0; k < 3; k++) {
        for (size_t i = 0; i < ARRAY_LEN(cases); i++) {
            enum sst_detect_outcome outcome;
            struct errors e = { 0 };
            struct board_scene s;
            struct sst_detection d;
            char name[96];

            place(&s, kinds[k].text, kinds[k].size_mm, 360);
            memcpy(s.turn, cases[i].turn, sizeof(s.turn));
            s.at_mm[0] = cases[i].x * kinds[k].size_mm;
            s.at_mm[1] = cases[i].y * kinds[k].size_mm;
            s.at_mm[2] *= cases[i].scale;
            s.noise = 1;
            outcome = detect_in(&d, &s, kinds[k].dot_mm, &s.board);
            compare(&e, &s, &d);
            snprintf(name, sizeof(name), "%s %s", kinds[k].text, cases[i].what);
            report(name, &e);
            assert_int_equal(e.wrong, 0);
            if (k > 0 || cases[i].whole) {
                assert_int_equal(outcome, SST_DETECT_FOUND);
                assert_true(e.points >= 0.7 * e.visible);
            } else {
                assert_true(outcome == SST_DETECT_NONE && !d.corner);
            }
            sst_detection_fini(&d);
        }
    }
}

static void small_faint_and_saturated_boards_are_right_or_missing(void **state SST_UNUSED)
{
    for (size_t k = 0; k < 3; k++) {
        for (int i = 0; i < 3; i++) {
            enum sst_detect_outcome outcome;
            struct errors e = { 0 };
            struct board_scene s;
            struct sst_detection d;
            char name[96];

            place(&s, kinds[k].text, kinds[k].size_mm, 480);
            s.turn[2] = 0.3;
            s.noise = 1;
            if (i == 0) { /* squares of 8 px */
                s.at_mm[2] = s.cam.fx * 40 / 8;
            } else if (i == 1) {
                s.black = 0.10;
                s.white = 0.16;
                s.around = 0.12;
            } else {
                s.white = 2.5;
                s.around = 0.8;
            }
            outcome = detect_in(&d, &s, kinds[k].dot_mm, &s.board);
            compare(&e, &s, &d);
            snprintf(name, sizeof(name), "%s %s", kinds[k].text, i == 0 ? "small" : i == 1 ? "faint" : "saturated");
            report(name, &e);
            assert_int_equal(e.wrong, 0);
            if (i > 0 || k == 0) {
                assert_int_equal(outcome, SST_DETECT_FOUND);
                assert_true(e.points >= 0.9 * e.visible);
            }
            sst_detection_fini(&d);
        }
    }
}

static void another_board_is_not_taken_for_ours(void **state SST_UNUSED)
{
    static const struct {
        const char *drawn, *sought, *guess;
        double dot_mm;
    } cases[] = {
        { "charuco:6x5:40mm:0.75", "charuco:8x6:40mm:0.75", "ChArUco board 6 squares wide and at least 5 high", 5 },
        { "charuco:8x6:40mm:0.75:5x5_50", "charuco:8x6:40mm:0.75", "of dictionary 5x5_50", 40.0 * 0.75 / 7 / 3 },
        { "aprilgrid:4x5:50mm:0.3", "aprilgrid:5x4:50mm:0.3", "AprilGrid 4 tags wide and at least 5 high", 5 },
        { "aprilgrid:5x4:50mm:0.3", "charuco:8x6:40mm:0.75", "AprilGrid 5 tags wide", 5 },
        { "chessboard:9x6:40mm", "chessboard:8x6:40mm", "chessboard of 9x6 squares", 20 },
        { "chessboard:9x6:40mm", "chessboard:10x6:40mm", "chessboard of 9x6 squares", 20 },
        { "chessboard:9x6:40mm", "charuco:9x6:40mm:0.75", "chessboard of 9x6 squares", 20 },
    };

    for (size_t i = 0; i < ARRAY_LEN(cases); i++) {
        const struct sst_board sought = parsed(cases[i].sought);
        enum sst_detect_outcome outcome = SST_DETECT_FOUND;
        struct sst_detection d;
        struct board_scene s;
        struct sst_image img;
        char text[160] = "";

        place(&s, cases[i].drawn, 340, 400);
        s.turn[1] = 0.3;
        s.noise = 1;
        assert_int_equal(board_scene_draw(&img, &s, cases[i].dot_mm), 0);
        assert_int_equal(sst_board_detect(&sought, &img, NULL, &d, &outcome), 0);
        assert_true(sst_board_guess(&sought, &img, text));
        print_message("%s for %s: outcome %d; %s\n", cases[i].drawn, cases[i].sought, outcome, text);
        assert_true(outcome != SST_DETECT_FOUND && !d.corner);
        assert_non_null(strstr(text, cases[i].guess));
        sst_image_fini(&img);
    }
}

/* --- blur --------------------------------------------------------------------------------------------------------- */

static void blur_is_measured(void **state SST_UNUSED)
{
    static const struct {
        double blur_px, motion_px[2], aspect;
        enum sst_detect_outcome outcome;
    } cases[] = {
        { 1, { 0, 0 }, 1, SST_DETECT_FOUND },          { 2, { 0, 0 }, 1, SST_DETECT_FOUND },
        { 3.6, { 0, 0 }, 1, SST_DETECT_BLURRED },      { 0.7, { 6, 0 }, 2.5, SST_DETECT_MOVING },
        { 0.7, { 4.2, 4.2 }, 2.5, SST_DETECT_MOVING }, { 0.7, { -4.2, 4.2 }, 2.5, SST_DETECT_MOVING },
        { 0.7, { 1.5, 0 }, 1.1, SST_DETECT_FOUND },
    };

    for (size_t i = 0; i < ARRAY_LEN(cases); i++) {
        /* The pixel is a box of variance 1/12, a straight path of length l has l^2 / 12 along it. */
        const double l2 = cases[i].motion_px[0] * cases[i].motion_px[0] + cases[i].motion_px[1] * cases[i].motion_px[1];
        const double across = cases[i].blur_px * cases[i].blur_px + 1 / 12.0, along = across + l2 / 12;
        struct errors e = { 0 };
        struct board_scene s;
        struct sst_detection d;

        place(&s, "chessboard:6x5:60mm", 360, 360);
        s.turn[2] = 0.1;
        s.blur_px = cases[i].blur_px;
        memcpy(s.motion_px, cases[i].motion_px, sizeof(s.motion_px));
        s.noise = 1;
        s.gamma = 1.8;
        assert_int_equal(detect_in(&d, &s, 30, &s.board), cases[i].outcome);
        compare(&e, &s, &d);
        print_message("blur %.2f aspect %.2f, expected %.2f %.2f, RMS error %.3f px\n", d.blur_px, d.blur_aspect,
                      sqrt((along + across) / 2), sqrt(along / across), sqrt(e.square / 2 / fmax(e.points, 1)));
        assert_int_equal(e.wrong, 0);
        assert_true(fabs(d.blur_px / sqrt((along + across) / 2) - 1) < 0.2); /* a tone curve makes edges seem wider */
        assert_true(fabs(d.blur_aspect / sqrt(along / across) - 1) <
                    0.3); /* a straight path is no normal distribution */
        assert_true(sqrt(e.square / 2 / fmax(e.points, 1)) < 0.1);
        sst_detection_fini(&d);
    }
}

/* --- hostile pictures --------------------------------------------------------------------------------------------- */

static void fill(struct sst_image *img, int how)
{
    uint64_t rng = 42 + (uint64_t)how;

    for (int y = 0; y < img->height; y++) {
        for (int x = 0; x < img->width; x++) {
            const int v = how == 0   ? 0
                          : how == 1 ? 255
                          : how == 2 ? (int)(255 * sst_random(&rng))
                          : how == 3 ? (x / 16 + y / 16) % 2 * 255 /* squares without an end */
                                     : (x * x / 64 + y * y / 64) % 256;

            for (int c = 0; c < 3; c++)
                sst_image_row(img, c, y)[x] = (uint8_t)v;
        }
    }
}

static void nothing_is_found_where_nothing_is(void **state SST_UNUSED)
{
    static const int sizes[][2] = { { 1, 1 },   { 2, 3 },     { 640, 1 },  { 1, 300 },
                                    { 16, 16 }, { 320, 240 }, { 3000, 7 }, { 1121, 205 } };

    for (size_t k = 0; k < ARRAY_LEN(kinds); k++) {
        const struct sst_board b = parsed(kinds[k].text);

        for (size_t i = 0; i < ARRAY_LEN(sizes); i++) {
            for (int how = 0; how < 5; how++) {
                const struct sst_detect_config cfg = { .quick = i > 5 && k > 0 };
                enum sst_detect_outcome outcome = SST_DETECT_FOUND;
                struct sst_detection d;
                struct sst_image img;

                assert_int_equal(sst_image_init(&img, sizes[i][0], sizes[i][1]), 0);
                fill(&img, how);
                assert_int_equal(sst_board_detect(&b, &img, &cfg, &d, &outcome), 0);
                if (outcome == SST_DETECT_FOUND || d.corner)
                    fail_msg("%s found in %d x %d, kind %d", kinds[k].text, sizes[i][0], sizes[i][1], how);
                sst_image_fini(&img);
            }
        }
    }
}

static void large_pictures_are_as_exact(void **state SST_UNUSED)
{
    for (size_t k = 1; k < 3; k++) {
        const struct sst_detect_config quick = { .quick = true };
        enum sst_detect_outcome outcome;
        struct errors e = { 0 };
        struct board_scene s;
        struct sst_detection d;
        struct sst_image img;

        place(&s, kinds[k].text, kinds[k].size_mm, 1200);
        s.turn[0] = 0.3;
        s.turn[2] = 0.2;
        s.noise = 2;
        s.cam.k[0] = -0.1;
        assert_int_equal(board_scene_draw(&img, &s, kinds[k].dot_mm), 0);
        assert_int_equal(sst_board_detect(&s.board, &img, &quick, &d, &outcome), 0);
        assert_int_equal(outcome, SST_DETECT_FOUND);
        compare(&e, &s, &d);
        report("1200x900", &e);
        assert_int_equal(e.wrong, 0);
        assert_true(e.points >= 0.98 * e.visible);
        assert_true(sqrt(e.square / 2 / e.points) < 0.03);
        sst_detection_fini(&d);
        sst_image_fini(&img);
    }
}

/* One picture, searched by several threads. */
struct looks {
    const struct sst_board *board;
    const struct sst_image *img;
    struct sst_detection found[4];
};

static int look(void *arg, int index, int worker SST_UNUSED)
{
    struct looks *l = arg;
    enum sst_detect_outcome outcome;
    const int err = sst_board_detect(l->board, l->img, NULL, &l->found[index], &outcome);

    return err ? err : outcome == SST_DETECT_FOUND ? 0 : -ENODATA;
}

static void threads_find_the_same(void **state SST_UNUSED)
{
    for (size_t k = 0; k < ARRAY_LEN(kinds); k++) {
        struct looks l = { 0 };
        const size_t n = small_level() >= 2 ? 2 : ARRAY_LEN(l.found);
        struct board_scene s;
        struct sst_image img;

        place(&s, kinds[k].text, kinds[k].size_mm, 320);
        assert_int_equal(board_scene_draw(&img, &s, kinds[k].dot_mm), 0);
        l.board = &s.board;
        l.img = &img;
        assert_int_equal(sst_parallel_for((int)n, 2, look, &l), 0);
        for (size_t i = 1; i < n; i++) {
            assert_int_equal(l.found[i].corners, l.found[0].corners);
            assert_memory_equal(l.found[i].corner, l.found[0].corner,
                                (size_t)l.found[0].corners * sizeof(*l.found[0].corner));
        }
        for (size_t i = 0; i < n; i++)
            sst_detection_fini(&l.found[i]);
        sst_image_fini(&img);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        plain_test(exact_pictures_give_exact_points),
        cmocka_unit_test(partial_and_turned_boards_keep_their_numbers),
        plain_test(small_faint_and_saturated_boards_are_right_or_missing),
        plain_test(another_board_is_not_taken_for_ours),
        plain_test(blur_is_measured),
        cmocka_unit_test(nothing_is_found_where_nothing_is),
        plain_test(large_pictures_are_as_exact),
    };
    const struct CMUnitTest threaded[] = { cmocka_unit_test(threads_find_the_same) };

    if (!WITH_OPENCV) {
        print_message("a build without OpenCV finds no boards\n");
        return 77;
    }
    /* The thread sanitizer makes the others fifty times as slow, and they have one thread each. */
    return cmocka_run_group_tests(threaded, NULL, NULL) +
           (WATCH_THREADS ? 0 : cmocka_run_group_tests(tests, NULL, NULL));
}
