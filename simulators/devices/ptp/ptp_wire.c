/* simulators/devices/ptp/ptp_wire.c - numbers, strings and arrays as PTP writes them. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <stdlib.h>
#include <string.h>

#include "base/mem.h"
#include "simulators/devices/ptp/ptp_internal.h"

#define TEXT_MAX 254

static bool make_room(struct ptp_bytes *b, size_t bytes)
{
    size_t room = (size_t)b->room;
    uint8_t *data;

    if (b->failed || b->size + bytes <= room)
        return !b->failed;
    room = b->size + bytes > 2 * room ? b->size + bytes : 2 * room;
    data = room <= INT32_MAX ? realloc(b->data, room) : NULL;
    if (!data) {
        b->failed = true;
        return false;
    }
    b->data = data;
    b->room = (int)room;
    return true;
}

void ptp_put_bytes(struct ptp_bytes *b, const uint8_t *data, size_t bytes)
{
    if (!bytes || !make_room(b, bytes))
        return;
    memcpy(b->data + b->size, data, bytes);
    b->size += bytes;
}

void ptp_put(struct ptp_bytes *b, uint64_t value, int bytes)
{
    uint8_t out[8];

    for (int i = 0; i < bytes; i++)
        out[i] = (uint8_t)(value >> 8 * i);
    ptp_put_bytes(b, out, (size_t)bytes);
}

void ptp_put_text(struct ptp_bytes *b, const char *text)
{
    const size_t n = strnlen(text, TEXT_MAX);

    ptp_put(b, n ? n + 1 : 0, 1);
    for (size_t i = 0; i < n; i++)
        ptp_put(b, (uint8_t)text[i], 2);
    if (n)
        ptp_put(b, 0, 2);
}

void ptp_put_codes(struct ptp_bytes *b, const uint16_t *codes, size_t count)
{
    ptp_put(b, count, 4);
    for (size_t i = 0; i < count; i++)
        ptp_put(b, codes[i], 2);
}

void ptp_free(struct ptp_bytes *b)
{
    free(b->data);
    *b = (struct ptp_bytes){ .data = NULL };
}

uint32_t ptp_get(const uint8_t *data, int bytes)
{
    uint32_t value = 0;

    for (int i = 0; i < bytes; i++)
        value |= (uint32_t)data[i] << 8 * i;
    return value;
}
