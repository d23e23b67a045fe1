/* Fuzz target: EXIF's orientation in the bytes of a picture. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <string.h>

#include "pipeline/image/codec.h"
#include "tests/fuzz/seeds.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerInitialize(int *argc SST_UNUSED, char ***argv SST_UNUSED)
{
    static const char jpeg[] = "\xff\xd8\xff\xe0\0\4xx\xff\xe1\0\x24"
                               "Exif\0\0MM\0*\0\0\0\x8\0\1\1\x12\0\3\0\0\0\1\0\6\0\0\0\0\0\0\0\0\xff\xda";
    static const char png[] = "\x89PNG\r\n\x1a\n\0\0\0\2IHDRxxcrc.\0\0\0\x1a"
                              "eXIfII*\0\x8\0\0\0\1\0\x12\1\4\0\1\0\0\0\x8\0\0\0crc.\0\0\0\1IDATxcrc.";

    seed_write("orientation", 0, jpeg, sizeof(jpeg) - 1);
    seed_write("orientation", 1, png, sizeof(png) - 1);
    return 0;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    const int orientation = sst_image_orientation(data, size);

    if (orientation < 1 || orientation > 8)
        abort();
    return 0;
}
