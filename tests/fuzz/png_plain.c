/* Fuzz target: the reader of plain PNG files. Checksums are put right first: with wrong ones nothing is read. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <string.h>

#include <zlib.h>

#include "pipeline/image/image_internal.h"
#include "tests/fuzz/seeds.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static uint32_t big_endian(const uint8_t *p)
{
    return (uint32_t)p[0] << 24 | (uint32_t)p[1] << 16 | (uint32_t)p[2] << 8 | p[3];
}

static void put_checksums(uint8_t *data, size_t size)
{
    for (size_t at = 8; size >= 12 && at <= size - 12;) {
        const size_t n = big_endian(data + at);
        uint32_t crc;

        if (n > size - at - 12)
            return;
        crc = (uint32_t)crc32(0, data + at + 4, (unsigned)n + 4);
        for (int i = 0; i < 4; i++)
            data[at + 8 + n + (size_t)i] = (uint8_t)(crc >> (24 - 8 * i));
        at += 12 + n;
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    uint8_t *file = malloc(size + 1);

    if (!file)
        abort();
    memcpy(file, data, size);
    put_checksums(file, size);
    for (int kind = PNG_PLAIN_RGB; kind <= PNG_PLAIN_U16; kind++) {
        struct png_plain png;

        if (!WITH_DEFLATE || !png_plain_read(&png, file, size, (enum png_plain_kind)kind))
            continue;
        if (png.width < 1 || png.height < 1 || png.kind != (enum png_plain_kind)kind)
            abort();
        png_plain_fini(&png);
    }
    free(file);
    return 0;
}
