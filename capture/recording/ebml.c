/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "capture/recording/recording_internal.h"

#include <errno.h>

/* The leading zero bits of the first byte give the number of bytes that follow. */
static size_t length(uint8_t first)
{
    size_t n = 1;

    for (uint8_t bit = 0x80; bit && !(first & bit); bit >>= 1)
        n++;
    return n;
}

size_t ebml_number(const uint8_t *data, size_t n, uint64_t *value)
{
    const size_t bytes = n ? length(data[0]) : 0;
    uint64_t v;

    if (!bytes || bytes > 8 || bytes > n)
        return 0;
    v = data[0] & (0x7Fu >> (bytes - 1));
    for (size_t i = 1; i < bytes; i++)
        v = v << 8 | data[i];
    *value = v;
    return bytes;
}

int ebml_head(const uint8_t *data, size_t n, struct ebml *out)
{
    const size_t id_bytes = n ? length(data[0]) : 0;
    uint64_t size;
    uint32_t id = 0;
    size_t size_bytes;

    if (!id_bytes || id_bytes > 4 || id_bytes > n)
        return -EBADMSG;
    for (size_t i = 0; i < id_bytes; i++)
        id = id << 8 | data[i];
    size_bytes = ebml_number(data + id_bytes, n - id_bytes, &size);
    if (!size_bytes)
        return -EBADMSG;
    if (size == ((uint64_t)1 << (7 * size_bytes)) - 1)
        size = SST_EBML_UNKNOWN;
    *out = (struct ebml){ .id = id, .size = size, .head = id_bytes + size_bytes };
    return 0;
}
