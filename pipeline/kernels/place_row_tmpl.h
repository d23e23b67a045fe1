/* place_row */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */

/* Nearest whole number of |v| < 2^22, ties to even, in a form that vectorises. */
static inline int32_t KERNEL(place_nearest)(float v)
{
    const float shifted = v + 12582912.0f; /* 1.5 2^23: the fraction is rounded away */
    int32_t bits;

    memcpy(&bits, &shifted, sizeof(bits));
    return bits - 0x4B400000;
}

static inline int32_t KERNEL(place_at)(int32_t whole_q8, const float *c, float k)
{
    return whole_q8 + KERNEL(place_nearest)(c[0] + k * (c[1] + k * (c[2] + k * c[3])));
}

static void KERNEL(place_row)(int32_t *restrict xy_q8, const struct sst_places *places, float k0, size_t n)
{
    const struct sst_places p = *places;

    for (int i = 0; i < (int)n; i++) {
        const float k = k0 + (float)i;
        const int32_t x = KERNEL(place_at)(p.whole_q8[0], p.c[0], k), y = KERNEL(place_at)(p.whole_q8[1], p.c[1], k);
        const bool inside = (x >= 0) & (x <= p.most[0]) & (y >= 0) & (y <= p.most[1]);

        xy_q8[2 * i] = inside ? x : INT32_MIN;
        xy_q8[2 * i + 1] = inside ? y : INT32_MIN;
    }
}
