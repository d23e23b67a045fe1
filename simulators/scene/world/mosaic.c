/* Mosaic: pictures of several cameras side by side in one, as boards with several sensors deliver them. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <string.h>

#include "simulators/scene/world/world_internal.h"

#define MCU_HEIGHT 8
#define MARK_SOF0  0xC0
#define MARK_RST0  0xD0
#define MARK_EOI   0xD9
#define MARK_SOS   0xDA

void sim_mosaic_rows(uint8_t *whole, const uint8_t *part, const struct sim_mosaic *m, int at)
{
    const size_t row = m->part_bytes / (size_t)m->height, stride = row * (size_t)m->cols;
    uint8_t *to = whole + (size_t)(at / m->cols * m->height) * stride + (size_t)(at % m->cols) * row;

    for (int y = 0; y < m->height; y++)
        memcpy(to + (size_t)y * stride, part + (size_t)y * row, row);
}

/* The scan of a JPEG of our own encoder, and its size in the header. @return first byte of the scan */
static size_t find_scan(const uint8_t *data, size_t bytes, size_t *size_at)
{
    size_t at = 2;

    while (at + 9 < bytes) {
        const uint8_t mark = data[at + 1];

        if (mark == MARK_SOF0)
            *size_at = at + 5;
        at += 2 + ((size_t)data[at + 2] << 8 | data[at + 3]);
        if (mark == MARK_SOS)
            return at;
    }
    return 0;
}

/* The next marker of a scan, not a stuffed byte. */
static size_t next_mark(const uint8_t *data, size_t at, size_t bytes)
{
    while (at + 1 < bytes) {
        const uint8_t *ff = memchr(data + at, 0xFF, bytes - at);

        at = ff ? (size_t)(ff - data) : bytes;
        if (at + 1 < bytes && data[at + 1])
            return at;
        at += 2;
    }
    return bytes;
}

static void put16(uint8_t *to, int value)
{
    to[0] = (uint8_t)(value >> 8);
    to[1] = (uint8_t)value;
}

/* Each row of blocks of each camera begins anew after a restart, so that their codes follow each other as they are. */
int sim_mosaic_jpeg(const struct sim_mosaic *m, const struct sst_sim_room *parts, struct sst_sim_room out,
                    size_t *bytes)
{
    const int rows = (m->height + MCU_HEIGHT - 1) / MCU_HEIGHT, n = m->rows * m->cols;
    size_t at[SST_SIM_SPLIT_MAX], size_at = 0, head = 0, to;
    int restarts = 0;

    for (int i = 0; i < n; i++) {
        at[i] = find_scan(parts[i].data, parts[i].bytes, &size_at);
        head = i ? head : at[0];
        if (!at[i] || !size_at)
            return -EINVAL;
    }
    if (out.bytes < head)
        return -ENOSPC;
    memcpy(out.data, parts[0].data, head);
    (void)find_scan(out.data, parts[0].bytes, &size_at);
    put16(out.data + size_at, m->rows * m->height);
    put16(out.data + size_at + 2, m->cols * m->width);
    to = head;
    for (int row = 0; row < m->rows * rows; row++) {
        for (int col = 0; col < m->cols; col++) {
            const int i = row / rows * m->cols + col;
            const size_t end = next_mark(parts[i].data, at[i], parts[i].bytes);

            if (out.bytes < to + (end - at[i]) + 2)
                return -ENOSPC;
            memcpy(out.data + to, parts[i].data + at[i], end - at[i]);
            to += end - at[i];
            at[i] = end + 2;
            out.data[to++] = 0xFF;
            out.data[to++] = (uint8_t)(MARK_RST0 + restarts++ % 8);
        }
    }
    out.data[to - 1] = MARK_EOI;
    *bytes = to;
    return 0;
}
