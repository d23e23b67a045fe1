/* Census and Hamming distances with NEON: 16 pixels at a time, the last ones overlap those before. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
static inline void KERNEL(census_16)(uint64_t *out, const uint8_t *const rows[7], size_t x)
{
    const uint8_t *at[7];
    uint8x16_t plane[8]; /* bytes of the result from the highest down; the first has six bits */
    uint8x16_t centre;

    for (int i = 0; i < 7; i++)
        at[i] = rows[i] + x - 4;
    centre = vld1q_u8(at[3] + 4);
#pragma GCC unroll 8
    for (int p = 0; p < 8; p++) {
        uint8x16_t bits = vdupq_n_u8(0);

#pragma GCC unroll 8
        for (int i = p ? 0 : 2; i < 8; i++) {
            const int j = 8 * p + i - 2, k = j + (j >= 31);

            bits = vsliq_n_u8(vcltq_u8(vld1q_u8(at[k / 9] + k % 9), centre), bits, 1);
        }
        plane[p] = bits;
    }
    for (int half = 0; half < 2; half++) {
        uint8x16_t byte[4];
        uint16x8_t low, high;

        for (int i = 0; i < 4; i++)
            byte[i] = half ? vzip2q_u8(plane[7 - 2 * i], plane[6 - 2 * i]) : vzip1q_u8(plane[7 - 2 * i], plane[6 - 2 * i]);
        for (int quarter = 0; quarter < 2; quarter++) {
            const uint16x8_t b[4] = { vreinterpretq_u16_u8(byte[0]), vreinterpretq_u16_u8(byte[1]),
                                      vreinterpretq_u16_u8(byte[2]), vreinterpretq_u16_u8(byte[3]) };
            uint32_t *to = (uint32_t *)(out + 8 * half + 4 * quarter);

            low = quarter ? vzip2q_u16(b[0], b[1]) : vzip1q_u16(b[0], b[1]);
            high = quarter ? vzip2q_u16(b[2], b[3]) : vzip1q_u16(b[2], b[3]);
            vst2q_u32(to, (uint32x4x2_t){ { vreinterpretq_u32_u16(low), vreinterpretq_u32_u16(high) } });
        }
    }
}

static void KERNEL(census_row)(uint64_t *restrict out, const uint8_t *const rows[7], size_t n)
{
    if (n < 16) {
        sst_census_row_ref(out, rows, n);
        return;
    }
    for (size_t x = 0; x < n; x += 16) {
        x = x < n - 16 ? x : n - 16;
        KERNEL(census_16)(out + x, rows, x);
    }
}

static void KERNEL(hamming_row)(uint8_t *restrict cost, const uint64_t *restrict a, const uint64_t *restrict b,
                                size_t n)
{
    size_t x = 0;

    for (; n - x >= 16; x += 16) {
        uint8x16_t bits[8];

        for (size_t i = 0; i < 8; i++)
            bits[i] = vcntq_u8(vreinterpretq_u8_u64(veorq_u64(vld1q_u64(a + x + 2 * i), vld1q_u64(b + x + 2 * i))));
        for (int left = 4; left; left /= 2) {
            for (int i = 0; i < left; i++)
                bits[i] = vpaddq_u8(bits[2 * i], bits[2 * i + 1]);
        }
        vst1q_u8(cost + x, vshlq_n_u8(bits[0], 2));
    }
    for (; x < n; x++)
        cost[x] = (uint8_t)(4 * __builtin_popcountll(a[x] ^ b[x]));
}

/* 16 places of a pixel at a time, from the last one on. */
static void KERNEL(hamming_steps_row)(uint8_t *restrict cost, const uint64_t *restrict a, const uint64_t *restrict b,
                                      size_t n, size_t nd)
{
    for (size_t x = 0; x < n; x++) {
        const uint64x2_t own = vdupq_n_u64(a[x]);

        for (size_t d = 0; d < nd; d += 16) {
            const uint64_t *last = b + x - d - 15;
            uint8x16_t bits[8];

            for (size_t i = 0; i < 8; i++)
                bits[i] = vcntq_u8(vreinterpretq_u8_u64(veorq_u64(own, vld1q_u64(last + 2 * i))));
            for (int left = 4; left; left /= 2) {
                for (int i = 0; i < left; i++)
                    bits[i] = vpaddq_u8(bits[2 * i], bits[2 * i + 1]);
            }
            bits[0] = vrev64q_u8(vshlq_n_u8(bits[0], 2));
            vst1q_u8(cost + x * nd + d, vextq_u8(bits[0], bits[0], 8));
        }
    }
}
