/* Fuzz target: manifest.json. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <stdlib.h>

#include <string.h>

#include "pipeline/method/network/manifest.h"
#include "tests/fuzz/seeds.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerInitialize(int *argc SST_UNUSED, char ***argv SST_UNUSED)
{
    static const char seed[] =
        "{\"format\": \"sst-models\", \"version\": 1, \"models\": [{\"file\": \"a.onnx\", \"kind\": \"labels\","
        " \"description\": \"d\", \"bytes\": 1, \"licence\": \"l\", \"training_data\": \"t\", \"sha256\":"
        " \"731c1273e373d5a6d88df2fc0fb6b911fe9ee255151527a47e34dfbdea2eef1e\","
        " \"figures\": {\"miou\": 1.5, \"n\": 2}}]}";

    seed_write("manifest", 0, seed, strlen(seed));
    return 0;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct sst_manifest manifest;

    if (sst_manifest_parse(&manifest, (const char *)data, size, "fuzz"))
        return 0;
    for (int i = 0; i < manifest.n; i++) {
        if (sst_manifest_find(&manifest, manifest.entries[i].file) != &manifest.entries[i])
            abort();
        (void)sst_manifest_matches(&manifest.entries[i], data, size);
    }
    sst_manifest_fini(&manifest);
    return 0;
}
