/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/kernels/kernels.h"

void sst_warped_row_ref(uint32_t *const sum[3], uint16_t *count, const struct sst_warped_source *from,
                        const struct sst_warped_segment *segment, size_t segments)
{
    for (; segments > 0; segments--, segment++) {
        for (int i = 0; i < segment->n; i++) {
            const int32_t x = segment->x_q16 + i * segment->dx_q16, y = segment->y_q16 + i * segment->dy_q16;
            const int32_t left = x >> 16 < from->width - 2 ? x >> 16 : from->width - 2;
            const int32_t top = y >> 16 < from->height - 2 ? y >> 16 : from->height - 2;
            const int32_t right_q8 = (x - left * 65536 + 128) >> 8, down_q8 = (y - top * 65536 + 128) >> 8;
            const size_t at = (size_t)top * from->stride + (size_t)left;

            for (int c = 0; c < from->channels; c++) {
                const uint16_t *a = from->plane[c] + at, *b = a + from->stride;
                const int64_t above = (int64_t)a[0] * (256 - right_q8) + (int64_t)a[1] * right_q8;
                const int64_t below = (int64_t)b[0] * (256 - right_q8) + (int64_t)b[1] * right_q8;

                sum[c][segment->at + i] += (uint32_t)((above * (256 - down_q8) + below * down_q8 + 512) >> 10);
            }
            count[segment->at + i]++;
        }
    }
}
