#if defined(__aarch64__)
#include "pipeline/kernels/arm/median_tmpl.h"
#else
/*
 * Forgetful selection: of any 14 of the 25 values neither the smallest nor the largest is the median, so both are
 * dropped, the next value is added, and so on with 13, 12, ... 2 + 1. Each step is minima and maxima over a block of
 * pixels.
 */
static void KERNEL(median5_row)(uint16_t *restrict out, const uint16_t *const rows[5], size_t n)
{
    enum { BLOCK = 32 };
    uint16_t v[14][BLOCK];
    const uint16_t *rest[5];
    size_t start = 0;

    for (; start < n && n >= BLOCK; start += BLOCK) {
        start = n - start < BLOCK ? n - BLOCK : start; /* the last block overlaps the one before */
        for (int k = 0; k < 14; k++)
            memcpy(v[k], rows[k / 5] + start + k % 5 - 2, sizeof(v[k]));
        for (int size = 14, next = 14; size > 2; size--, next++) {
            /* Smallest to v[0], largest to v[size - 1]. */
            for (int k = 1; k < size; k++) {
                for (int x = 0; x < BLOCK; x++) {
                    const uint16_t a = v[0][x], b = v[k][x];

                    v[0][x] = a < b ? a : b;
                    v[k][x] = a < b ? b : a;
                }
            }
            for (int k = 1; k < size - 1; k++) {
                for (int x = 0; x < BLOCK; x++) {
                    const uint16_t a = v[k][x], b = v[size - 1][x];

                    v[k][x] = a < b ? a : b;
                    v[size - 1][x] = a < b ? b : a;
                }
            }
            memcpy(v[0], next < 25 ? rows[next / 5] + start + next % 5 - 2 : v[1], sizeof(v[0]));
        }
        memcpy(out + start, v[0], sizeof(v[0]));
    }
    for (int j = 0; j < 5; j++)
        rest[j] = rows[j] + start;
    sst_median5_row_ref(out + start, rest, n - start);
}
#endif
