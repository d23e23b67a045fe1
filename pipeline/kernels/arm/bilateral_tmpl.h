/* bilateral_row with NEON: eight pixels at a time, the last ones overlap those before. Steps that count fit 16 bits, and
 * so does the sum of weights. */
static inline void KERNEL(bilateral_8)(uint16_t *out, const uint16_t *const disp[7], const uint8_t *const luma[7],
                                       const int16_t *weight, uint8_t most, size_t x)
{
    const uint16x8_t centre = vld1q_u16(disp[3] + x);
    const uint8x8_t level = vld1_u8(luma[3] + x);
    int32x4_t sum[2] = { vdupq_n_s32(0), vdupq_n_s32(0) };
    int16x8_t total = vdupq_n_s16(0), mean;
    float32x4_t low, high;

    for (int row = 0; row < 7; row++) {
        const uint16_t *from = disp[row] + x - 3;
        const uint8_t *from_luma = luma[row] + x - 3;

#pragma GCC unroll 7
        for (int i = 0; i < 7; i++) {
            const uint16x8_t d = vld1q_u16(from + i);
            const uint8x8_t alike = vcle_u8(vabd_u8(vld1_u8(from_luma + i), level), vdup_n_u8(most));
            const int16x8_t step = vreinterpretq_s16_u16(vsubq_u16(d, centre));
            const uint16x8_t near = vcleq_u16(vabdq_u16(d, centre), vdupq_n_u16(SST_BILATERAL_STEP_Q6));
            const int16x8_t mask = vandq_s16(vreinterpretq_s16_u16(near), vmovl_s8(vreinterpret_s8_u8(alike)));
            const int16x8_t counted = vandq_s16(mask, vdupq_n_s16(weight[7 * row + i]));

            sum[0] = vmlal_s16(sum[0], vget_low_s16(counted), vget_low_s16(step));
            sum[1] = vmlal_high_s16(sum[1], counted, step);
            total = vaddq_s16(total, counted);
        }
    }
    low = vdivq_f32(vcvtq_f32_s32(sum[0]), vcvtq_f32_s32(vmovl_s16(vget_low_s16(total))));
    high = vdivq_f32(vcvtq_f32_s32(sum[1]), vcvtq_f32_s32(vmovl_high_s16(total)));
    mean = vcombine_s16(vmovn_s32(vcvtq_s32_f32(vaddq_f32(low, vdupq_n_f32(128.5F)))),
                        vmovn_s32(vcvtq_s32_f32(vaddq_f32(high, vdupq_n_f32(128.5F)))));
    mean = vaddq_s16(vsubq_s16(vreinterpretq_s16_u16(centre), vdupq_n_s16(128)), mean);
    /* An unknown disparity, whose bits are all set, stays. */
    vst1q_u16(out + x, vorrq_u16(vreinterpretq_u16_s16(mean), vceqq_u16(centre, vdupq_n_u16(65535))));
}

static void KERNEL(bilateral_row)(uint16_t *restrict out, const uint16_t *const disp[7], const uint8_t *const luma[7],
                                  const int16_t *weight, int tau, size_t n)
{
    if (n < 8 || tau < 1) {
        sst_bilateral_row_ref(out, disp, luma, weight, tau, n);
        return;
    }
    for (size_t x = 0; x < n; x += 8) {
        x = x < n - 8 ? x : n - 8;
        KERNEL(bilateral_8)(out, disp, luma, weight, (uint8_t)sst_min_int(tau - 1, 255), x);
    }
}
