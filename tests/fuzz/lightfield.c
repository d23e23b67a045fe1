/* Fuzz target: lightfield.json. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/lightfield/lightfield_internal.h"
#include "tests/fuzz/seeds.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct sst_lightfield lf;

    if (lightfield_read_json(&lf, input_file(data, size)))
        return 0;
    if (lightfield_fault(&lf) || lf.rows < 1 || lf.cols < 1)
        abort();
    sst_lightfield_fini(&lf);
    return 0;
}
