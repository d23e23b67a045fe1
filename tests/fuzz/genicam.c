/* Fuzz target: messages of GenICam cameras: acknowledgements of actions, packed samples, numbers and stamps of frames. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <stdlib.h>
#include <string.h>

#include "drivers/genicam/genicam_internal.h"
#include "tests/fuzz/seeds.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static const char *const names[] = { "Mono10", "Mono10p", "Mono10Packed", "Mono12p", "Mono12Packed", "Mono16" };

int LLVMFuzzerInitialize(int *argc SST_UNUSED, char ***argv SST_UNUSED)
{
    seed_write("genicam", 0, "\0\0\1\1\0\0\0\1", 8);
    seed_write("genicam", 1, "\x80\x17\1\1\0\0\0\2payload of some pixels", 30);
    return 0;
}

static void unpack(const uint8_t *data, size_t size)
{
    const struct genicam_pixels *p = genicam_pixels_named(names[size % ARRAY_LEN(names)]);
    const size_t bits = p->code >> 16 & 0xff, count = size * 8 / bits;
    uint8_t *frame = malloc(2 * count + 1);

    if (!frame)
        abort();
    memcpy(frame, data, genicam_bytes(p, (int)count, 1));
    genicam_unpack(frame, count, p);
    for (size_t i = 0; i < count; i++)
        if ((frame[2 * i] | frame[2 * i + 1] << 8) & ((1 << (16 - p->bits)) - 1))
            abort();
    free(frame);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct genicam_ids ids = { 0 };
    struct genicam_clock clock = { 0 };
    uint16_t id = 0;
    int64_t t;

    if (genicam_action_read(data, size, &id) != GENICAM_ACTION_NONE && size < 8)
        abort();
    for (size_t i = 0; i + 8 <= size; i += 8) {
        uint64_t word;

        memcpy(&word, data + i, 8);
        if (genicam_lost_before(&ids, word % 3 ? word & 0xffff : word) > 65535)
            abort();
        genicam_clock_add(&clock, (int64_t)(word >> 2), (int64_t)(word >> 3));
        (void)genicam_clock_here(&clock, (int64_t)(word >> 2), &t);
        (void)genicam_clock_there(&clock, (int64_t)(word >> 3), &t);
    }
    unpack(data, size);
    return 0;
}
