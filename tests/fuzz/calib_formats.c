/* Fuzz target: calibrations of other tools; the first byte says whose. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <stdlib.h>
#include <string.h>

#include "pipeline/camera/format.h"
#include "tests/fuzz/seeds.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static const char *const seeds[] = {
    "Kcam0:\n  camera_model: pinhole\n  distortion_coeffs: [0.1, 0.2, 0.3, 0.4]\n  distortion_model: radtan\n"
    "  intrinsics: [500, 501, 320, 240]\n  resolution: [640, 480]\n  rostopic: /cam0/image_raw\n"
    "cam1:\n  T_cn_cnm1:\n  - [0.0, -1.0, 0.0, 0.1]\n  - [1.0, 0.0, 0.0, 0.2]\n  - [0.0, 0.0, 1.0, 0.3]\n"
    "  - [0.0, 0.0, 0.0, 1.0]\n  cam_overlaps: [0]\n  camera_model: pinhole\n  distortion_coeffs: []\n"
    "  distortion_model: none\n  intrinsics: [500, 501, 320, 240]\n  resolution: [640, 480]\n  row: 0\n  col: 1\n",
    "M{\"cameras\": {\"a\": {\"image_size\": [640, 480], \"K\": [[500, 0, 320], [0, 501, 240], [0, 0, 1]], \"dist\": "
    "[[1, 2, "
    "3, 4, 5]]}, \"00_01\": {\"image_size\": [640.0, 480], \"K\": [[5e2, 0, 320], [0, 501, 240], [0, 0, 1]], \"dist\": "
    "null, "
    "\"row\": 0, \"col\": 1}}, \"camera_poses\": {\"a\": {\"R\": [[1, 0, 0], [0, 1, 0], [0, 0, 1]], \"T\": [0, 0, 0]}, "
    "\"00_01_to_a\": {\"R\": [[1, 0, 0], [0, 1, 0], [0, 0, 1]], \"T\": [-0.05, 0, 0]}}, \"image_sets\": {}}",
    "O%YAML:1.0\n---\nimage_width: 640\nimage_height: 480\ncamera_name: \"x\"\nrow: 0\ncol: 0\ncamera_matrix: "
    "!!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   data: [ 5.0e+02, 0., 320., 0., 501., 240., 0., 0., 1. ]\n"
    "distortion_coefficients: !!opencv-matrix\n   rows: 5\n   cols: 1\n   dt: d\n   data: [ 1., 2., 3., 4., 5. ]\n"
    "R: !!opencv-matrix\n   rows: 3\n   cols: 1\n   dt: d\n   data: [ 0.1, 0., 0. ]\n"
    "T: !!opencv-matrix\n   rows: 3\n   cols: 1\n   dt: d\n   data: [ 1., 2., 3. ]\n",
    "O<?xml version=\"1.0\"?>\n<!-- c -->\n<opencv_storage>\n<calibration_time>\"x &lt; "
    "y\"</calibration_time>\n<image_width>"
    "640</image_width>\n<image_height>480</image_height>\n<list>\n  <_>\n    a b</_><_>2</_></list>\n<camera_matrix "
    "type_id=\"opencv-matrix\">\n  <rows>3</rows>\n  <cols>3</cols>\n  <dt>d</dt>\n  <data>\n    5.0e+02 0. 320. 0.\n  "
    "  "
    "501. 240. 0. 0. 1.</data></camera_matrix>\n<distortion_coefficients "
    "type_id=\"opencv-matrix\"><rows>5</rows><cols>1"
    "</cols><dt>d</dt><data>1. 2. 3. 4. 5.</data></distortion_coefficients>\n</opencv_storage>\n",
};

int LLVMFuzzerInitialize(int *argc SST_UNUSED, char ***argv SST_UNUSED)
{
    for (int i = 0; i < (int)ARRAY_LEN(seeds); i++)
        seed_write("calib_formats", i, seeds[i], strlen(seeds[i]));
    return 0;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    const bool row = size > 1 && data[size - 1] % 2; /* a grid is given */
    const struct sst_calib_format_config cfg = { .rows = row ? 1 : 0, .cols = row ? 2 : 0 };
    const char *text = (const char *)data + 1;
    struct sst_calib_camera lens;
    struct sst_calib calib;
    double worst;
    int err;

    if (size < 1)
        return 0;
    err = data[0] == 'K'   ? sst_kalibr_parse(&calib, text, size - 1, "fuzz", &cfg)
          : data[0] == 'M' ? sst_multical_parse(&calib, text, size - 1, "fuzz", &cfg)
                           : sst_opencv_parse(&calib, text, size - 1, "fuzz", &cfg);
    if (err)
        return 0;
    if (sst_calib_fault(&calib) || calib.camera[calib.reference].position_mm[0] != 0)
        abort();
    if (sst_lens_reduce(&lens, &worst, &calib.camera[calib.reference], calib.width, calib.height, 4) > 0)
        abort();
    sst_calib_fini(&calib);
    return 0;
}
