/* Fuzz target: detections.json, the board's points in pictures. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/calibration/board/coverage.h"
#include "pipeline/calibration/board/detect.h"
#include "tests/fuzz/seeds.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct sst_detections all;
    static struct sst_coverage coverage[SST_MAX_VIEWS];

    if (sst_detections_read(&all, input_file(data, size)))
        return 0;
    sst_coverage_count(coverage, &all);
    sst_detections_fini(&all);
    return 0;
}
