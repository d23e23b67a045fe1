/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "base/frame.h"

#include <string.h>

size_t sst_frame_packed_bytes(const struct sst_frame *f)
{
    return f->row_bytes ? f->row_bytes * (size_t)f->height : f->bytes;
}

size_t sst_frame_pack(struct sst_frame *to, uint8_t *at, const struct sst_frame *from)
{
    *to = *from;
    to->data = at;
    to->pool = NULL;
    if (!from->row_bytes) {
        memcpy(at, from->data, from->bytes);
        return from->bytes;
    }
    for (int y = 0; y < from->height; y++)
        memcpy(at + (size_t)y * from->row_bytes, from->data + (size_t)y * from->stride, from->row_bytes);
    to->stride = from->row_bytes;
    to->bytes = from->row_bytes * (size_t)from->height;
    to->row_bytes = 0;
    return to->bytes;
}
