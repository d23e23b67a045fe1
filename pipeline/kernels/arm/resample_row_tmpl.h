/* resample_row with NEON: the work is vectorised inside each pixel, two columns of R G B X at a time. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
static inline void KERNEL(resample_run)(uint16_t *const out[3], const struct sst_resample *from, const int32_t *xy_q8,
                                        size_t n, int taps)
{
    uint16_t *restrict red = out[0], *restrict green = out[1], *restrict blue = out[2];
    const uint8_t *origin = from->pixel + (1 - taps / 2) * (ptrdiff_t)(from->stride + 4);

    for (size_t i = 0; i < n; i++) {
        const int32_t x = xy_q8[2 * i], y = xy_q8[2 * i + 1];
        const uint8_t *p = origin + (y >> 8) * (ptrdiff_t)from->stride + 4 * (ptrdiff_t)(x >> 8);
        int32x4_t column[6], sum = vdupq_n_s32(0);
        int16x8_t wx = vdupq_n_s16(0), wy = wx;
        uint16x4_t value;

        if (x == INT32_MIN) {
            red[i] = green[i] = blue[i] = 0;
            continue;
        }
        memcpy(&wx, from->weight + (x & 255) * taps, 2 * (size_t)taps);
        memcpy(&wy, from->weight + (y & 255) * taps, 2 * (size_t)taps);
        for (int t = 0; t < taps; t++)
            column[t] = sum;
        for (int ty = 0; ty < taps; ty++) {
            for (int t = 0; t < taps; t += 2) {
                const int16x8_t two = vreinterpretq_s16_u16(vmovl_u8(vld1_u8(p + (size_t)ty * from->stride + 4 * t)));

                column[t] = vmlal_n_s16(column[t], vget_low_s16(two), wy[ty]);
                column[t + 1] = vmlal_high_n_s16(column[t + 1], two, wy[ty]);
            }
        }
        for (int t = 0; t < taps; t++)
            sum = vmlal_n_s16(sum, vrshrn_n_s32(column[t], 8), wx[t]);
        value = vmin_u16(vqrshrun_n_s32(sum, 13), vdup_n_u16(SST_LIGHT_WHITE));
        vst1_lane_u16(red + i, value, 0);
        vst1_lane_u16(green + i, value, 1);
        vst1_lane_u16(blue + i, value, 2);
    }
}
