/* Fuzz target: lightfield.json of posed light fields. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/posed/posed_internal.h"
#include "tests/fuzz/seeds.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerInitialize(int *argc SST_UNUSED, char ***argv SST_UNUSED)
{
    static const char seed[] =
        "{\"format\":\"sst-lightfield\",\"version\":3,\"kind\":\"posed\",\"width\":64,\"height\":48,\"channels\":3,\"bits\":8,"
        "\"metric\":true,\"source\":\"s\",\"history\":\"\",\"samples\":[1,9],\"up\":[0,0,1],\"geographic\":{\"latitude\":48,"
        "\"longitude\":14,\"altitude_m\":3},\"kelvin\":[0.04,0],\"median_px\":0.5,\"points\":{\"file\":\"points-1.bin\","
        "\"sha256\":\"0123456789abcdef0123456789abcdef0123456789abcdef0123456789abcdef\",\"count\":2},\"views\":[{\"name\":"
        "\"a\",\"file\":\"0000.png\",\"sha256\":\"0123456789abcdef0123456789abcdef0123456789abcdef0123456789abcdef\","
        "\"camera\":\"1\",\"lens\":{\"fx\":70,\"fy\":71,\"cx\":30,\"cy\":20,\"k\":[0.1,0,0,0,0]},\"rotation\":[1,0,0,0,1,0,0,"
        "0,1],\"position_mm\":[1,2,3],\"rms_px\":0.3,\"moment\":2,\"time_s\":1.5}]}";

    seed_write("posed", 0, seed, sizeof(seed) - 1);
    return 0;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct sst_posed posed;
    struct points_file points;
    char (*hashes)[65], *text;

    if (posed_read_json(&posed, &points, input_file(data, size)))
        return 0;
    if (posed_fault(&posed))
        abort();
    hashes = calloc((size_t)posed.count, sizeof(*hashes));
    text = hashes ? posed_to_json(&posed, hashes, &points) : NULL;
    if (!text)
        abort();
    free(text);
    free(hashes);
    sst_posed_fini(&posed);
    return 0;
}
