/* Photographs of a chessboard by two cameras: all found, and as well as by OpenCV (tests/board_pictures.py). */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

#include "base/file.h"
#include "pipeline/calibration/board/detect.h"
#include "pipeline/image/codec.h"
#include "tests/test.h"

#define FOLDER "../shared/data/calib-opencv-stereo"

static void every_picture_has_its_board(void **state SST_UNUSED)
{
    char path[] = "/tmp/sst-detect-real-XXXXXX", command[256];
    struct sst_detections all;
    struct sst_board board;
    int status;

    assert_true(mkstemp(path) >= 0);
    assert_int_equal(sst_board_parse(&board, "chessboard:9x6c:25mm"), 0);
    assert_int_equal(
        sst_detections_init(
            &all, &(struct sst_detections){ .board = board, .rows = 1, .cols = 2, .width = 640, .height = 480 }),
        0);
    strcpy(all.camera_name[0], "left");
    strcpy(all.camera_name[1], "right");
    for (int i = 1; i <= 14; i++) {
        char name[64];
        int frame;

        if (i == 10) /* the set has none */
            continue;
        snprintf(name, sizeof(name), "%02d", i);
        frame = sst_detections_frame(&all, name);
        assert_true(frame >= 0);
        for (int view = 0; view < 2; view++) {
            enum sst_detect_outcome outcome = SST_DETECT_NONE;
            struct sst_image img = { 0 };
            struct sst_detection d;
            char file[128];

            snprintf(file, sizeof(file), FOLDER "/%s%s.jpg", all.camera_name[view], name);
            assert_int_equal(sst_image_read(&img, file), 0);
            assert_int_equal(sst_board_detect(&board, &img, NULL, &d, &outcome), 0);
            if (outcome != SST_DETECT_FOUND || d.corners != 54)
                fail_msg("%s: outcome %d, %d corners", file, outcome, d.corners);
            d.view = view;
            d.frame = frame;
            assert_int_equal(sst_detections_add(&all, &d), 0);
            all.outcome[outcome]++;
            sst_image_fini(&img);
        }
    }
    assert_int_equal(all.count, 26);
    assert_int_equal(sst_detections_write(&all, path), 0);
    sst_detections_fini(&all);
    snprintf(command, sizeof(command), "/usr/bin/python3 tests/board_pictures.py %s " FOLDER, path);
    status = system(command);
    unlink(path);
    if (WIFEXITED(status) && WEXITSTATUS(status) == 77)
        skip();
    assert_true(WIFEXITED(status) && WEXITSTATUS(status) == 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = { cmocka_unit_test(every_picture_has_its_board) };

    if (!WITH_OPENCV) {
        print_message("a build without OpenCV finds no boards\n");
        return 77;
    }
    if (!sst_path_is_dir(FOLDER)) {
        print_message("%s is not there: no photographs of a board\n", FOLDER);
        return 77;
    }
    return cmocka_run_group_tests(tests, NULL, NULL);
}
