/* Sets as bytes. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <string.h>

#include "capture/link/link_internal.h"

void wire_put_u64(uint8_t *out, uint64_t value)
{
    for (int i = 0; i < 8; i++)
        out[i] = (uint8_t)(value >> 8 * i);
}

uint64_t wire_get_u64(const uint8_t *in)
{
    uint64_t value = 0;

    for (int i = 0; i < 8; i++)
        value |= (uint64_t)in[i] << 8 * i;
    return value;
}

static void put_u32(uint8_t *out, uint32_t value)
{
    for (int i = 0; i < 4; i++)
        out[i] = (uint8_t)(value >> 8 * i);
}

static uint32_t get_u32(const uint8_t *in)
{
    return (uint32_t)in[0] | (uint32_t)in[1] << 8 | (uint32_t)in[2] << 16 | (uint32_t)in[3] << 24;
}

/* seq, count, t_ns, wall_ns; edge, cameras */
void wire_put_set(uint8_t *out, const struct wire_set *set)
{
    wire_put_u64(out, set->seq);
    wire_put_u64(out + 8, set->count);
    wire_put_u64(out + 16, (uint64_t)set->t_ns);
    wire_put_u64(out + 24, (uint64_t)set->wall_ns);
    put_u32(out + 32, set->edge);
    put_u32(out + 36, (uint32_t)set->cameras);
}

void wire_put_frame(uint8_t *out, const struct wire_frame *f)
{
    const uint32_t words[] = { (uint32_t)f->kind, f->bytes, f->stride, f->sequence, f->lost_before, f->faults };

    for (size_t i = 0; i < ARRAY_LEN(words); i++)
        put_u32(out + 4 * i, words[i]);
    wire_put_u64(out + 24, (uint64_t)f->from_set_ns);
    wire_put_u64(out + 32, f->since);
}

static int get_frame(const uint8_t *in, size_t most, struct wire_frame *f)
{
    const uint32_t kind = get_u32(in);

    *f = (struct wire_frame){ .kind = (enum wire_kind)kind,
                              .bytes = get_u32(in + 4),
                              .stride = get_u32(in + 8),
                              .sequence = get_u32(in + 12),
                              .lost_before = get_u32(in + 16),
                              .faults = get_u32(in + 20),
                              .from_set_ns = (int64_t)wire_get_u64(in + 24),
                              .since = wire_get_u64(in + 32) };
    if (kind > WIRE_UNCHANGED || (kind == WIRE_FRAME) != (f->bytes > 0) || f->bytes > most || f->stride > most)
        return -EBADMSG;
    return f->from_set_ns < -WIRE_AWAY_MAX_NS || f->from_set_ns > WIRE_AWAY_MAX_NS ? -EBADMSG : 0;
}

int wire_get_set(const uint8_t *in, size_t bytes, size_t frame_most, struct wire_set *set, struct wire_frame *frame)
{
    const int cameras = set->cameras;
    const size_t head = WIRE_SET_BYTES + (size_t)cameras * WIRE_FRAME_BYTES;
    size_t total = head;

    if (bytes < head || get_u32(in + 36) != (uint32_t)cameras)
        return -EBADMSG;
    *set = (struct wire_set){ .seq = wire_get_u64(in),
                              .count = wire_get_u64(in + 8),
                              .t_ns = (int64_t)wire_get_u64(in + 16),
                              .wall_ns = (int64_t)wire_get_u64(in + 24),
                              .edge = get_u32(in + 32) != 0,
                              .cameras = cameras,
                              .data = in + head };
    for (int i = 0; i < cameras; i++) {
        if (get_frame(in + WIRE_SET_BYTES + (size_t)i * WIRE_FRAME_BYTES, frame_most, &frame[i]))
            return -EBADMSG;
        total += frame[i].bytes;
    }
    if (total != bytes || set->count > WIRE_COUNT_MAX || set->t_ns < 0 || set->t_ns > WIRE_T_MAX_NS ||
        set->wall_ns < 0 || set->wall_ns > WIRE_WALL_MAX_NS)
        return -EBADMSG;
    return 0;
}

size_t link_frame_most(int width, int height)
{
    return (size_t)width * (size_t)height * 4 + FRAME_BYTES_EXTRA;
}

size_t link_message_most(int cameras, int width, int height)
{
    return MESSAGE_TEXT_MAX + WIRE_SET_BYTES + (size_t)cameras * (WIRE_FRAME_BYTES + link_frame_most(width, height));
}
