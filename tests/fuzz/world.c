/* Fuzz target: files of simulated worlds. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "simulators/scene/world/settings.h"
#include "tests/fuzz/seeds.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static struct sst_sim_settings s;

    if (sst_sim_settings_read(&s, input_file(data, size)))
        return 0;
    if (s.rows < 1 || s.cols < 1 || s.rows * s.cols > SST_CAMERAS_MAX || s.width < 1 || s.height < 1)
        abort();
    return 0;
}
