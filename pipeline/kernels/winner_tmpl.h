#if defined(__aarch64__)
#include "pipeline/kernels/arm/winner_tmpl.h"
#else
/* The index is in the low half of a 32-bit key, so that one minimum finds value and smallest index at once. */
static void KERNEL(winner_row)(uint16_t *restrict best, uint16_t *restrict second, const uint16_t *restrict sum,
                               size_t stride, size_t n, size_t nd)
{
    for (size_t x = 0; x < n; x++) {
        const uint16_t *s = sum + x * stride;
        uint32_t key = UINT32_MAX;
        uint16_t other = 65535;
        size_t b;

        for (uint32_t d = 0; d < (uint32_t)nd; d++) {
            const uint32_t k = (uint32_t)s[d] << 16 | d;

            key = k < key ? k : key;
        }
        b = key & 0xFFFF;
        for (size_t d = 0; d + 1 < b; d++)
            other = s[d] < other ? s[d] : other;
        for (size_t d = b + 2; d < nd; d++)
            other = s[d] < other ? s[d] : other;
        best[x] = (uint16_t)b;
        second[x] = other;
    }
}
#endif

static void KERNEL(winner_other_row)(uint32_t *restrict key, const uint16_t *restrict sum, size_t stride, size_t n,
                                     size_t nd)
{
    for (size_t x = 0; x < n; x++) {
        const uint16_t *s = sum + x * stride;
        uint32_t *at = key + (n - 1 - x);

        for (uint32_t d = 0; d < (uint32_t)nd; d++) {
            const uint32_t k = (uint32_t)s[d] << 16 | d;

            at[d] = k < at[d] ? k : at[d];
        }
    }
}
