/* Fuzz target: parameters.cfg of light fields of the HCI benchmark. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <math.h>
#include <string.h>

#include "pipeline/lightfield/lightfield_internal.h"
#include "tests/fuzz/seeds.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerInitialize(int *argc SST_UNUSED, char ***argv SST_UNUSED)
{
    static const char seed[] = "[intrinsics]\nfocal_length_mm = 100.0\nsensor_size_mm = 35\n# a comment\n[extrinsics]\n"
                               "num_cams_x = 9\nnum_cams_y=9\nbaseline_mm = 90.5\n[meta]\ndisp_min = -1.5\n"
                               "disp_max = 1e0\noffset_x_040 = 0.25\r\n";

    seed_write("params", 0, seed, strlen(seed));
    return 0;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static const char *const keys[] = { "focal_length_mm", "num_cams_x", "disp_min", "offset_x_040", "x" };
    char *text = malloc(size + 1);

    if (!text)
        abort();
    memcpy(text, data, size);
    text[size] = 0;
    for (size_t i = 0; i < ARRAY_LEN(keys); i++) {
        double value = 7;
        const int r = params_number(text, "fuzz", keys[i], &value);

        if ((r == 1 && !isfinite(value)) || (r != 1 && value != 7))
            abort();
    }
    free(text);
    return 0;
}
