/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/kernels/simd.h"

#define MEDIAN_LANES (SIMD_BYTES / 2)
typedef uint8_t KERNEL(median_bytes) __attribute__((vector_size(MEDIAN_LANES)));

static inline simd_u16 KERNEL(median_levels)(const uint8_t *p)
{
    KERNEL(median_bytes) v;

    memcpy(&v, p, sizeof(v));
    return __builtin_convertvector(v, simd_u16);
}

/* |a - b| of bytes. */
static inline simd_u16 KERNEL(median_apart)(simd_u16 a, simd_u16 b)
{
#if defined(__AVX2__)
    return (simd_u16)SIMD_OP(abs_epi16)((SIMD_INT)(a - b));
#else
    return simd_less_u16(a, b) | simd_less_u16(b, a);
#endif
}

/* A register of pixels against a row of the window around them. Weights fit 16 bits, 16 * 225, and so do their sums over
 * a row: its shares sum to 86 at most. */
static inline void KERNEL(median_votes_line)(uint32_t *restrict near, uint32_t *restrict all,
                                             const uint16_t *const disp[SST_MEDIAN_SIDE],
                                             const uint8_t *const colour[3][SST_MEDIAN_SIDE], int j, ptrdiff_t x)
{
    const simd_u16 d = simd_load_u16(disp[SST_MEDIAN_REACH] + x), none = { 0 }, step = simd_set_u16(SST_MEDIAN_STEP_Q6);
    const simd_u16 least = simd_less_u16(d, step), most = simd_min_u16(d, ~step) + step;
    uint16_t some[MEDIAN_LANES], every[MEDIAN_LANES];
    simd_u16 own[3], within = none, sum = none;

    for (int c = 0; c < 3; c++)
        own[c] = KERNEL(median_levels)(colour[c][SST_MEDIAN_REACH] + x);
    for (int i = 0; i < SST_MEDIAN_SIDE; i++) {
        const ptrdiff_t at = x + i - SST_MEDIAN_REACH;
        const simd_u16 contrast = KERNEL(median_apart)(own[0], KERNEL(median_levels)(colour[0][j] + at)) +
                                  KERNEL(median_apart)(own[1], KERNEL(median_levels)(colour[1][j] + at)) +
                                  KERNEL(median_apart)(own[2], KERNEL(median_levels)(colour[2][j] + at));
        const simd_u16 room = simd_less_u16(simd_set_u16(SST_MEDIAN_CONTRAST), contrast);
        const simd_u16 w = (room * room >> SST_MEDIAN_SHIFT) * simd_set_u16(sst_median_near[j][i]);
        const simd_u16 there = simd_load_u16(disp[j] + at);

        within += w & (simd_u16)((simd_less_u16(least, there) | simd_less_u16(there, most)) == 0);
        sum += w;
    }
    simd_store_u16(some, within);
    simd_store_u16(every, sum);
    for (int i = 0; i < MEDIAN_LANES; i++) {
        near[i] += some[i];
        all[i] += every[i];
    }
}

static void KERNEL(median_votes_row)(uint32_t *restrict near, uint32_t *restrict all,
                                     const uint16_t *const disp[SST_MEDIAN_SIDE],
                                     const uint8_t *const colour[3][SST_MEDIAN_SIDE], size_t n)
{
    const uint16_t *disp_rest[SST_MEDIAN_SIDE];
    const uint8_t *colour_rest[3][SST_MEDIAN_SIDE];
    size_t start = 0;

    for (; start + MEDIAN_LANES <= n; start += MEDIAN_LANES) {
        memset(near + start, 0, MEDIAN_LANES * sizeof(*near));
        memset(all + start, 0, MEDIAN_LANES * sizeof(*all));
        for (int j = 0; j < SST_MEDIAN_SIDE; j++)
            KERNEL(median_votes_line)(near + start, all + start, disp, colour, j, (ptrdiff_t)start);
    }
    for (int j = 0; j < SST_MEDIAN_SIDE; j++) {
        disp_rest[j] = disp[j] + start;
        for (int c = 0; c < 3; c++)
            colour_rest[c][j] = colour[c][j] + start;
    }
    sst_median_votes_row_ref(near + start, all + start, disp_rest, colour_rest, n - start);
}
#undef MEDIAN_LANES
