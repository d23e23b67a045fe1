/* Fuzz target: a set of a node as bytes, and the naming of its edges. The first byte: how many cameras it has. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <string.h>

#include "capture/link/link_internal.h"
#include "tests/fuzz/seeds.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

#define WIDTH  32
#define HEIGHT 16
#define PERIOD INT64_C(100000000)
#define NOW    INT64_C(5000000000000)
#define WALL   INT64_C(1700000000000000000)

int LLVMFuzzerInitialize(int *argc SST_UNUSED, char ***argv SST_UNUSED)
{
    uint8_t seed[1 + 3 * (WIRE_SET_BYTES + 2 * WIRE_FRAME_BYTES + 100)] = { 2 }, *at = seed + 1;

    for (int i = 0; i < 3; i++) { /* one after the other: as sets of two nodes */
        const struct wire_set set = { .seq = (uint64_t)i + 1,
                                      .count = (uint64_t)i + 7,
                                      .t_ns = NOW + i * PERIOD,
                                      .wall_ns = WALL + i * PERIOD,
                                      .edge = true,
                                      .cameras = 2 };
        const struct wire_frame frame = { .kind = WIRE_FRAME, .bytes = 100, .stride = WIDTH, .sequence = 3 },
                                same = { .kind = WIRE_UNCHANGED, .since = 1, .from_set_ns = -5000 };

        wire_put_set(at, &set);
        wire_put_frame(at + WIRE_SET_BYTES, &frame);
        wire_put_frame(at + WIRE_SET_BYTES + WIRE_FRAME_BYTES, &same);
        memset(at + WIRE_SET_BYTES + 2 * WIRE_FRAME_BYTES, i, 100);
        at += WIRE_SET_BYTES + 2 * WIRE_FRAME_BYTES + 100;
        seed_write("link_wire", i, seed, (size_t)(at - seed));
    }
    return 0;
}

/* What the head does with a set that it has read. */
static void name(struct sst_numbering *n, const struct wire_set *set, const struct wire_frame *frame, int64_t now_ns)
{
    const struct sst_numbering_edge edge = { set->count, set->t_ns, set->wall_ns - (WALL - NOW) };
    struct sst_numbering_place place;

    if (sst_numbering_place(n, (int)(set->seq % SST_NUMBERING_SOURCES), &edge, now_ns, &place) == SST_NUMBERING_PLACED)
        for (int i = 0; i < set->cameras; i++) {
            const int64_t t_ns = place.t_ns + frame[i].from_set_ns;

            if (frame[i].kind == WIRE_FRAME && place.index > INT64_MAX && t_ns)
                abort();
        }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    const int cameras = size ? data[0] % SST_CAMERAS_MAX + 1 : 1;
    struct sst_numbering *n;
    int64_t now_ns = NOW;

    if (!size || sst_numbering_create(&n, PERIOD))
        return 0;
    for (int i = 0; i < SST_NUMBERING_SOURCES; i++)
        sst_numbering_join(n, i, (uint64_t)i + 1);
    data++;
    size--;
    while (size >= WIRE_SET_BYTES) {
        struct wire_frame frame[SST_CAMERAS_MAX];
        struct wire_set set = { .cameras = cameras };
        size_t used = WIRE_SET_BYTES + (size_t)cameras * WIRE_FRAME_BYTES;

        for (int i = 0; i < cameras && used <= size; i++)
            used += (uint32_t)wire_get_u64(data + WIRE_SET_BYTES + (size_t)i * WIRE_FRAME_BYTES + 4);
        if (used > size)
            used = size;
        if (!wire_get_set(data, used, link_frame_most(WIDTH, HEIGHT), &set, frame)) {
            size_t bytes = 0;

            for (int i = 0; i < cameras; i++)
                bytes += frame[i].bytes;
            if (set.data + bytes != data + used)
                abort();
            name(n, &set, frame, now_ns);
            name(n, &set, frame, now_ns + 2 * PERIOD);
        }
        now_ns += 3 * PERIOD;
        data += used;
        size -= used;
    }
    sst_numbering_destroy(n);
    return 0;
}
