/* median5_row: the last vector of pixels overlaps its predecessor. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/kernels/simd.h"

static inline void KERNEL(sort)(simd_u16 *v, int i, int j)
{
    const simd_u16 least = simd_min_u16(v[i], v[j]);

    v[j] = simd_max_u16(v[i], v[j]);
    v[i] = least;
}

static inline void KERNEL(sort5)(simd_u16 v[5])
{
    KERNEL(sort)(v, 0, 1);
    KERNEL(sort)(v, 3, 4);
    KERNEL(sort)(v, 2, 4);
    KERNEL(sort)(v, 2, 3);
    KERNEL(sort)(v, 0, 3);
    KERNEL(sort)(v, 0, 2);
    KERNEL(sort)(v, 1, 4);
    KERNEL(sort)(v, 1, 3);
    KERNEL(sort)(v, 1, 2);
}

/* Of 7: of any 5 of them neither the smallest nor the largest is the median, and so on with one more value each. */
static inline simd_u16 KERNEL(median7)(simd_u16 v[7])
{
    KERNEL(sort)(v, 0, 1);
    KERNEL(sort)(v, 2, 3);
    KERNEL(sort)(v, 0, 2);
    KERNEL(sort)(v, 1, 3);
    KERNEL(sort)(v, 0, 4);
    KERNEL(sort)(v, 3, 4); /* v[0] and v[4] drop out; 1, 2, 3 remain, 5 is added */
    KERNEL(sort)(v, 1, 2);
    KERNEL(sort)(v, 1, 3);
    KERNEL(sort)(v, 2, 3);
    KERNEL(sort)(v, 1, 5);
    KERNEL(sort)(v, 3, 5); /* v[1] and v[5] drop out; 2, 3 remain, 6 is added */
    return simd_max_u16(simd_min_u16(v[2], v[3]), simd_min_u16(simd_max_u16(v[2], v[3]), v[6]));
}

/*
 * Columns of 5 are sorted once for all 5 windows that hold them. Within a window the ranks are then sorted across the
 * columns: the value in row i and column j (from 1) has i j - 1 values below it and (6 - i)(6 - j) - 1 above. Those with
 * more than 12 on one side are no median: 13 remain, of which three diagonals hold 4, 5 and 4. Of the lower diagonal only
 * the largest, of the upper one only the smallest can be it.
 */
static inline simd_u16 KERNEL(median_of_columns)(const uint16_t *const at[5])
{
    simd_u16 r[5][5], v[7];

    for (int i = 0; i < 5; i++) {
        for (int j = 0; j < 5; j++)
            r[i][j] = simd_load_u16(at[i] + j);
        KERNEL(sort5)(r[i]);
    }
    v[0] = simd_max_u16(simd_max_u16(r[0][3], r[1][2]), simd_max_u16(r[2][1], r[3][0]));
    v[1] = r[0][4];
    v[2] = r[1][3];
    v[3] = r[2][2];
    v[4] = r[3][1];
    v[5] = r[4][0];
    v[6] = simd_min_u16(simd_min_u16(r[1][4], r[2][3]), simd_min_u16(r[3][2], r[4][1]));
    return KERNEL(median7)(v);
}

static void KERNEL(median5_row)(uint16_t *restrict out, const uint16_t *const rows[5], size_t n)
{
    enum { LANES = SIMD_BYTES / 2, PART = 8 * LANES };
    uint16_t sorted[5][PART + LANES];
    const uint16_t *rest[5];
    size_t start = 0;

    for (; start < n && n >= LANES; start += PART) {
        const size_t count = n - start < PART ? (n - start < LANES ? LANES : n - start) : PART;

        start = n - start < LANES ? n - LANES : start; /* a short last part overlaps the one before */
        for (size_t x = 0; x < count + 4;) {
            simd_u16 v[5];

            for (int j = 0; j < 5; j++)
                v[j] = simd_load_u16(rows[j] + start + x - 2);
            KERNEL(sort5)(v);
            for (int j = 0; j < 5; j++)
                simd_store_u16(sorted[j] + x, v[j]);
            x = x + LANES < count + 4 && x + 2 * LANES > count + 4 ? count + 4 - LANES : x + LANES;
        }
        for (size_t x = 0; x < count;) {
            const uint16_t *const at[5] = { sorted[0] + x, sorted[1] + x, sorted[2] + x, sorted[3] + x, sorted[4] + x };

            simd_store_u16(out + start + x, KERNEL(median_of_columns)(at));
            x = x + LANES < count && x + 2 * LANES > count ? count - LANES : x + LANES;
        }
    }
    for (int j = 0; j < 5 && start < n; j++)
        rest[j] = rows[j] + start;
    if (start < n)
        sst_median5_row_ref(out + start, rest, n - start);
}
