/* median5_row with NEON: forgetful selection as in the other form, of eight pixels whose values stay in registers. The
 * last eight overlap those before. */
static inline __attribute__((always_inline)) void KERNEL(median_swap)(uint16x8_t *low, uint16x8_t *high)
{
    const uint16x8_t a = *low, b = *high;

    *low = vminq_u16(a, b);
    *high = vmaxq_u16(a, b);
}

/* Smallest of `size` (a compile-time constant) values to v[0], which `next` replaces; largest to v[size - 1]. */
static inline __attribute__((always_inline)) void KERNEL(median_drop)(uint16x8_t v[14], const int size, uint16x8_t next)
{
#pragma GCC unroll 16
    for (int k = 1; k < size; k++)
        KERNEL(median_swap)(&v[0], &v[k]);
#pragma GCC unroll 16
    for (int k = 1; k < size - 1; k++)
        KERNEL(median_swap)(&v[k], &v[size - 1]);
    v[0] = next;
}

static void KERNEL(median5_row)(uint16_t *restrict out, const uint16_t *const rows[5], size_t n)
{
    if (n < 8) {
        sst_median5_row_ref(out, rows, n);
        return;
    }
#define MEDIAN_VALUE(k) vld1q_u16(rows[(k) / 5] + x + (k) % 5 - 2)
#define MEDIAN_DROP(size) KERNEL(median_drop)(v, size, MEDIAN_VALUE(28 - (size)))
    for (size_t x = 0; x < n; x += 8) {
        uint16x8_t v[14];

        x = x < n - 8 ? x : n - 8;
#pragma GCC unroll 16
        for (int k = 0; k < 14; k++)
            v[k] = MEDIAN_VALUE(k);
        MEDIAN_DROP(14);
        MEDIAN_DROP(13);
        MEDIAN_DROP(12);
        MEDIAN_DROP(11);
        MEDIAN_DROP(10);
        MEDIAN_DROP(9);
        MEDIAN_DROP(8);
        MEDIAN_DROP(7);
        MEDIAN_DROP(6);
        MEDIAN_DROP(5);
        MEDIAN_DROP(4);
        KERNEL(median_drop)(v, 3, v[1]);
        vst1q_u16(out + x, v[1]);
    }
#undef MEDIAN_VALUE
#undef MEDIAN_DROP
}
