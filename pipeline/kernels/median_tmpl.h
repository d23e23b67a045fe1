#if defined(__aarch64__)
#include "pipeline/kernels/arm/median_tmpl.h"
#elif defined(__AVX2__)
#if defined(__AVX512BW__)
typedef __m512i KERNEL(median_lanes);
#define MEDIAN_LEAST(a, b)   _mm512_min_epu16(a, b)
#define MEDIAN_MOST(a, b)    _mm512_max_epu16(a, b)
#define MEDIAN_LOAD(p)       _mm512_loadu_si512(p)
#define MEDIAN_STORE(p, v)   _mm512_storeu_si512(p, v)
#else
typedef __m256i KERNEL(median_lanes);
#define MEDIAN_LEAST(a, b)   _mm256_min_epu16(a, b)
#define MEDIAN_MOST(a, b)    _mm256_max_epu16(a, b)
#define MEDIAN_LOAD(p)       _mm256_loadu_si256((const __m256i *)(const void *)(p))
#define MEDIAN_STORE(p, v)   _mm256_storeu_si256((__m256i *)(void *)(p), v)
#endif
#define MEDIAN_SORT(a, b)                                                                                              \
    do {                                                                                                               \
        const KERNEL(median_lanes) least_ = MEDIAN_LEAST(a, b);                                                        \
        (b) = MEDIAN_MOST(a, b);                                                                                       \
        (a) = least_;                                                                                                  \
    } while (0)

static inline void KERNEL(sort5)(KERNEL(median_lanes) v[5])
{
    MEDIAN_SORT(v[0], v[1]);
    MEDIAN_SORT(v[3], v[4]);
    MEDIAN_SORT(v[2], v[4]);
    MEDIAN_SORT(v[2], v[3]);
    MEDIAN_SORT(v[0], v[3]);
    MEDIAN_SORT(v[0], v[2]);
    MEDIAN_SORT(v[1], v[4]);
    MEDIAN_SORT(v[1], v[3]);
    MEDIAN_SORT(v[1], v[2]);
}

/* Of 7: of any 5 of them neither the smallest nor the largest is the median, and so on with one more value each. */
static inline KERNEL(median_lanes) KERNEL(median7)(KERNEL(median_lanes) v[7])
{
    MEDIAN_SORT(v[0], v[1]);
    MEDIAN_SORT(v[2], v[3]);
    MEDIAN_SORT(v[0], v[2]);
    MEDIAN_SORT(v[1], v[3]);
    MEDIAN_SORT(v[0], v[4]);
    MEDIAN_SORT(v[3], v[4]); /* v[0] and v[4] drop out; 1, 2, 3 remain, 5 is added */
    MEDIAN_SORT(v[1], v[2]);
    MEDIAN_SORT(v[1], v[3]);
    MEDIAN_SORT(v[2], v[3]);
    MEDIAN_SORT(v[1], v[5]);
    MEDIAN_SORT(v[3], v[5]); /* v[1] and v[5] drop out; 2, 3 remain, 6 is added */
    return MEDIAN_MOST(MEDIAN_LEAST(v[2], v[3]), MEDIAN_LEAST(MEDIAN_MOST(v[2], v[3]), v[6]));
}

/*
 * Columns of 5 are sorted once for all 5 windows that hold them. Within a window the ranks are then sorted across the
 * columns: the value in row i and column j (from 1) has i j - 1 values below it and (6 - i)(6 - j) - 1 above. Those with
 * more than 12 on one side are no median: 13 remain, of which three diagonals hold 4, 5 and 4. Of the lower diagonal only
 * the largest, of the upper one only the smallest can be it.
 */
static inline KERNEL(median_lanes) KERNEL(median_of_columns)(const uint16_t *const at[5])
{
    KERNEL(median_lanes) r[5][5], v[7];

    for (int i = 0; i < 5; i++) {
        for (int j = 0; j < 5; j++)
            r[i][j] = MEDIAN_LOAD(at[i] + j);
        KERNEL(sort5)(r[i]);
    }
    v[0] = MEDIAN_MOST(MEDIAN_MOST(r[0][3], r[1][2]), MEDIAN_MOST(r[2][1], r[3][0]));
    v[1] = r[0][4];
    v[2] = r[1][3];
    v[3] = r[2][2];
    v[4] = r[3][1];
    v[5] = r[4][0];
    v[6] = MEDIAN_LEAST(MEDIAN_LEAST(r[1][4], r[2][3]), MEDIAN_LEAST(r[3][2], r[4][1]));
    return KERNEL(median7)(v);
}

static void KERNEL(median5_row)(uint16_t *restrict out, const uint16_t *const rows[5], size_t n)
{
    enum { LANES = sizeof(KERNEL(median_lanes)) / sizeof(uint16_t), PART = 8 * LANES };
    uint16_t sorted[5][PART + LANES];
    const uint16_t *rest[5];
    size_t start = 0;

    for (; start < n && n >= LANES; start += PART) {
        const size_t count = n - start < PART ? (n - start < LANES ? LANES : n - start) : PART;

        start = n - start < LANES ? n - LANES : start; /* a short last part overlaps the one before */
        for (size_t x = 0; x < count + 4;) {
            KERNEL(median_lanes) v[5];

            for (int j = 0; j < 5; j++)
                v[j] = MEDIAN_LOAD(rows[j] + start + x - 2);
            KERNEL(sort5)(v);
            for (int j = 0; j < 5; j++)
                MEDIAN_STORE(sorted[j] + x, v[j]);
            x = x + LANES < count + 4 && x + 2 * LANES > count + 4 ? count + 4 - LANES : x + LANES;
        }
        for (size_t x = 0; x < count;) {
            const uint16_t *const at[5] = { sorted[0] + x, sorted[1] + x, sorted[2] + x, sorted[3] + x, sorted[4] + x };

            MEDIAN_STORE(out + start + x, KERNEL(median_of_columns)(at));
            x = x + LANES < count && x + 2 * LANES > count ? count - LANES : x + LANES;
        }
    }
    for (int j = 0; j < 5 && start < n; j++)
        rest[j] = rows[j] + start;
    if (start < n)
        sst_median5_row_ref(out + start, rest, n - start);
}
#undef MEDIAN_LEAST
#undef MEDIAN_MOST
#undef MEDIAN_LOAD
#undef MEDIAN_STORE
#undef MEDIAN_SORT
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
