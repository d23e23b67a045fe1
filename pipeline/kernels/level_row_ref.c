/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/kernels/kernels.h"

void sst_level_row_ref(int16_t *level, uint8_t *seen, const struct sst_warped_source *from,
                       const struct sst_warped_segment *segment, size_t segments)
{
    for (; segments > 0; segments--, segment++) {
        for (int i = 0; i < segment->n; i++) {
            const int32_t x = segment->x_q16 + i * segment->dx_q16, y = segment->y_q16 + i * segment->dy_q16;
            const int32_t left = x >> 16 < from->width - 2 ? x >> 16 : from->width - 2;
            const int32_t top = y >> 16 < from->height - 2 ? y >> 16 : from->height - 2;
            const int32_t right_q8 = (x - left * 65536 + 128) >> 8, down_q8 = (y - top * 65536 + 128) >> 8;
            const uint16_t *a = from->plane[0] + (size_t)top * from->stride + left, *b = a + from->stride;
            const int64_t above = (int64_t)a[0] * (256 - right_q8) + (int64_t)a[1] * right_q8;
            const int64_t below = (int64_t)b[0] * (256 - right_q8) + (int64_t)b[1] * right_q8;
            const int64_t v_q16 = above * (256 - down_q8) + below * down_q8 - ((int64_t)32768 << 16);

            level[segment->at + i] = (int16_t)((v_q16 + (1 << (15 + SST_LEVEL_SHIFT))) >> (16 + SST_LEVEL_SHIFT));
            seen[segment->at + i] = 1;
        }
    }
}
