/* agree_mode with NEON: 16 pixels, whose votes stay in two registers. */
static inline uint8x16_t KERNEL(agree_like)(const uint8x16_t a[3], const uint8_t *b, size_t stride)
{
    uint8x16_t apart = vabdq_u8(a[0], vld1q_u8(b)); /* sums that do not fit saturate */

    apart = vqaddq_u8(apart, vabdq_u8(a[1], vld1q_u8(b + stride)));
    apart = vqaddq_u8(apart, vabdq_u8(a[2], vld1q_u8(b + 2 * stride)));
    return vshrq_n_u8(vqsubq_u8(vdupq_n_u8(SST_AGREE_MODE), apart), 1);
}

static void KERNEL(agree_mode)(uint8_t *const mode[3], const uint8_t *colour, const uint8_t *vote, size_t rays,
                               size_t step, size_t stride)
{
    for (size_t x = 0; x < stride; x += 16) {
        const uint16x8_t zero = vdupq_n_u16(0);
        uint16x8_t best[2] = { zero, zero };
        uint8x16_t result[3] = { vdupq_n_u8(0), vdupq_n_u8(0), vdupq_n_u8(0) };

        for (size_t j = 0; j < rays; j += step) {
            const uint8_t *of = colour + j * 3 * stride + x;
            const uint8x16_t a[3] = { vld1q_u8(of), vld1q_u8(of + stride), vld1q_u8(of + 2 * stride) };
            const uint8x16_t here = vld1q_u8(vote + j * stride + x), there = vtstq_u8(here, here);
            uint16x8_t votes[2] = { zero, zero };
            uint8x16_t more;

            for (size_t k = 0; k < rays; k++) {
                const uint8x16_t like = KERNEL(agree_like)(a, colour + k * 3 * stride + x, stride);
                const uint8x16_t weight = vld1q_u8(vote + k * stride + x);

                votes[0] = vmlal_u8(votes[0], vget_low_u8(like), vget_low_u8(weight));
                votes[1] = vmlal_high_u8(votes[1], like, weight);
            }
            more = vcombine_u8(vmovn_u16(vcgtq_u16(votes[0], best[0])), vmovn_u16(vcgtq_u16(votes[1], best[1])));
            more = vandq_u8(more, there);
            /* The low bytes of a mask widened with its sign are the mask. */
            best[0] = vbslq_u16(vreinterpretq_u16_s16(vmovl_s8(vreinterpret_s8_u8(vget_low_u8(more)))), votes[0], best[0]);
            best[1] = vbslq_u16(vreinterpretq_u16_s16(vmovl_high_s8(vreinterpretq_s8_u8(more))), votes[1], best[1]);
            for (int c = 0; c < 3; c++)
                result[c] = vbslq_u8(more, a[c], result[c]);
        }
        for (int c = 0; c < 3; c++)
            vst1q_u8(mode[c] + x, result[c]);
    }
}
