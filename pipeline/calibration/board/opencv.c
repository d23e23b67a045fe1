/* Loader of opencv_boards.cc, the part libsst-opencv.so. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <stdatomic.h>

#include "base/log.h"
#include "base/plugin.h"
#include "pipeline/calibration/board/opencv_boards.h"

static void *load(const char *function)
{
    static atomic_flag logged = ATOMIC_FLAG_INIT;
    char why[256];
    void *loaded = sst_plugin_symbol("opencv", function, why);

    if (!loaded && !atomic_flag_test_and_set(&logged))
        sst_log_error("boards and markers need OpenCV: %s; install libopencv-dev and build again", why);
    return loaded;
}

int cv_chessboard(float (*corner)[2], const struct sst_map_u8 *luma, int cols, int rows, int thorough)
{
    SST_PLUGIN_CALL(load, cv_chessboard, corner, luma, cols, rows, thorough);
}

int cv_any_chessboard(const struct sst_map_u8 *luma, int *cols, int *rows)
{
    SST_PLUGIN_CALL(load, cv_any_chessboard, luma, cols, rows);
}

int cv_markers(struct cv_marker *out, int max, const struct sst_map_u8 *luma, int dictionary, int border)
{
    SST_PLUGIN_CALL(load, cv_markers, out, max, luma, dictionary, border);
}

int cv_touching_tags(struct cv_marker *out, int max, const struct sst_map_u8 *luma, int dictionary, int border)
{
    SST_PLUGIN_CALL(load, cv_touching_tags, out, max, luma, dictionary, border);
}

int cv_dictionary(int dictionary, int *modules)
{
    SST_PLUGIN_CALL(load, cv_dictionary, dictionary, modules);
}

int cv_marker_bits(uint8_t *bits, int dictionary, int id)
{
    SST_PLUGIN_CALL(load, cv_marker_bits, bits, dictionary, id);
}
