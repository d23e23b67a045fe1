/* Fuzz target: meshes of a terrain as OBJ files, drawn onto a grid. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <math.h>

#include "pipeline/image/image_internal.h"
#include "tests/fuzz/seeds.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerInitialize(int *argc SST_UNUSED, char ***argv SST_UNUSED)
{
    static const char plane[] = "v -1000 -1000 0\nv  1000 -1000 0\nv -1000  1000 0\nv  1000  1000 2\nvt 0 0\n"
                                "f 1/1 2/2 3/3\nf 2/2 4/4 3/3\n";
    static const char fan[] = "v 0 0 1\nv 4 0 1.5e0\nv 4 4 2\nv 0 4 -3\nv 2 6 0\nf -5 -4//1 -3 -1 -2\r\nf 1 2 3\n";

    seed_write("mesh", 0, plane, sizeof(plane) - 1);
    seed_write("mesh", 1, fan, sizeof(fan) - 1);
    return 0;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct sst_heights h;
    char *text = malloc(size + 1);

    if (!text)
        abort();
    memcpy(text, data, size);
    text[size] = '\0';
    if (!mesh_to_heights(&h, text, "input")) {
        if (h.mm.width < 2 || h.mm.height < 2 || !(fabs(h.step_x_mm) > 0) || !(fabs(h.step_y_mm) > 0))
            abort();
        sst_heights_fini(&h);
    }
    free(text);
    return 0;
}
