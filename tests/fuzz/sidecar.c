/* Fuzz target: the YAML reader and the description of a network beside it. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <math.h>
#include <stdlib.h>

#include <string.h>

#include "pipeline/method/labels/model_info.h"
#include "tests/fuzz/seeds.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerInitialize(int *argc SST_UNUSED, char ***argv SST_UNUSED)
{
    static const char *const seeds[] = {
        "classes: [road, \"traffic light\", person, 'rider']\nlabels: {rider: person, traffic light: Pole}\n"
        "ground: [road]\nmean: [123.675, 116.28, 103.53]\nstd: 57.5\ncolour: bgr\nrange: 0..255\nsize: 480x360\n"
        "output: logits\ntemperature: 1.5\nepsilon_h: 0.5\n",
        "# a comment\nclasses:\n  1: b\n  0: a\nscale: [1, 1e-2, .5]\noutput: probabilities\n",
    };

    for (int i = 0; i < (int)ARRAY_LEN(seeds); i++)
        seed_write("sidecar", i, seeds[i], strlen(seeds[i]));
    return 0;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct sst_model_info info;

    if (sst_labels_model_info_parse(&info, NULL, "fuzz.onnx",
                                    &(struct sst_model_yaml){ (const char *)data, size, "fuzz.yaml" }))
        return 0;
    if (info.channels < 1 || info.classes.count < 1 || info.classes.count > info.channels || info.width < 8)
        abort();
    for (int c = 0; c < 3; c++) {
        if (!isfinite(info.mean[c]) || !(info.std[c] > 0))
            abort();
    }
    for (int i = 0; i < info.channels; i++) {
        if (info.class_of[i] >= info.classes.count)
            abort();
    }
    return 0;
}
