/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/image/codec.h"
#include "pipeline/image/image_internal.h"

bool sst_image_is_jpeg(const uint8_t *data, size_t size)
{
    return size >= 3 && data[0] == 0xFF && data[1] == 0xD8 && data[2] == 0xFF;
}

bool jpeg_next_segment(struct jpeg_segment *s, const uint8_t *data, size_t size)
{
    size_t at = s->at ? s->at + 4 + s->bytes : 2, length;

    if (s->mark == JPEG_MARK_SOS || size < 2 || data[0] != 0xFF || data[1] != 0xD8)
        return false;
    while (at + 4 <= size && data[at] == 0xFF && data[at + 1] == 0xFF) /* a byte that fills */
        at++;
    if (at + 4 > size || data[at] != 0xFF)
        return false;
    length = (size_t)data[at + 2] << 8 | data[at + 3];
    if (length < 2 || length > size - at - 2)
        return false;
    *s = (struct jpeg_segment){ .at = at, .mark = data[at + 1], .data = data + at + 4, .bytes = length - 2 };
    return true;
}
