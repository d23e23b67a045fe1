/* The two cheapest as minima and maxima of bytes, which every CPU level has. */
static void KERNEL(cheapest_row)(uint8_t *restrict first, uint8_t *restrict second, const uint8_t *a, const uint8_t *b,
                                 size_t n)
{
    size_t x = 0;

#if defined(__aarch64__)
    for (; n - x >= 16; x += 16) {
        const uint8x16_t t = vminq_u8(vrhaddq_u8(vld1q_u8(a + x), vld1q_u8(b + x)), vdupq_n_u8(SST_COST_MAX - 1));
        const uint8x16_t one = vld1q_u8(first + x);

        vst1q_u8(first + x, vminq_u8(one, t));
        vst1q_u8(second + x, vminq_u8(vld1q_u8(second + x), vmaxq_u8(one, t)));
    }
#endif
    for (; x < n; x++) {
        const uint8_t mean = (uint8_t)((a[x] + b[x] + 1) >> 1), t = mean < SST_COST_MAX ? mean : SST_COST_MAX - 1;
        const uint8_t one = first[x], two = second[x], over = one > t ? one : t;

        first[x] = one < t ? one : t;
        second[x] = two < over ? two : over;
    }
}
