/* Fuzz target: calib.yaml. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "pipeline/camera/calib.h"
#include "tests/camera_project.h"
#include "tests/fuzz/seeds.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerInitialize(int *argc SST_UNUSED, char ***argv SST_UNUSED)
{
    static const char seed[] =
        "# a comment\nformat: sst-calib\nversion: 1\ncreated: \"2026-01-31T09:15:00.000000000Z\"\nsource: \"x \\\" "
        "y\"\n"
        "board: charuco:9x7:50mm:0.7\nrows: 1\ncols: 3\nwidth: 640\nheight: 480\nreference: [0, 1]\nrig: true\n"
        "range_mm: 1500.5\nnoise_px: 0.1\ncameras:\n  - row: 0\n    col: 1\n    name: \"a b\"\n"
        "    focal_px: [500, 501.5]\n    centre_px: [320, 240]\n    distortion: [-0.1, 0.2, 1.0e-03, 0, 0.5]\n"
        "    rotation: [1, 0, 0, 0, 1, 0,\n               0, 0, 1]\n    position_mm: [0, 0, 0]\n    gain: [1, 1.1, "
        "0.9]\n"
        "    falloff: [-0.1, 0, 0]\n    quality: { rms_px: 0.1, corners: 77, sigma_px: 0.02 }\n"
        "  - { row: 0, col: 2, focal_px: [1, 1], centre_px: [1, 1], distortion: [1, 2, 3, 4, 5, 6, 7, 8], rotation: "
        "[0, -1, 0, 1, 0, 0, 0, 0, 1], position_mm: [1e3, -2, 3] }\n";

    seed_write("calib_yaml", 0, seed, strlen(seed));
    return 0;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct sst_calib calib;
    double x, y;

    if (sst_calib_parse(&calib, (const char *)data, size, "fuzz"))
        return 0;
    if (sst_calib_fault(&calib))
        abort();
    for (int k = 0; k < calib.rows * calib.cols; k++) {
        if (calib.camera[k].known && !camera_project(&calib.camera[k], (const double[]){ 10, -20, 1000 }, &x, &y) &&
            (isnan(x) || isnan(y)))
            abort();
    }
    sst_calib_fini(&calib);
    return 0;
}
