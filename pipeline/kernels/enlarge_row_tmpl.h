/* enlarge_row: the left pixels of a block of cells, then the right ones. A block's inputs are widened to 16 bits
 * first, so that the selection is one loop of equal lanes. Compiled for AVX2 that loop spills its lanes, hence the form
 * for 16 cells in registers. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */

#if defined(__AVX2__)
#define ENLARGE_BLOCK 16

/* Cells beside each other, and the best ones so far. */
struct KERNEL(enlarge_cells) {
    __m256i disp, label, unlike;
};

static inline __m256i KERNEL(enlarge_apart)(__m256i a, __m256i b)
{
    return _mm256_or_si256(_mm256_subs_epu16(a, b), _mm256_subs_epu16(b, a));
}

static inline __m256i KERNEL(enlarge_shorts)(const uint16_t *from)
{
    return _mm256_loadu_si256((const __m256i *)(const void *)from);
}

/* Select cells from x on of a row where they belong to another surface than the pixel's own cell and their colour is
 * nearer. Differences of colours are below 1024. @param own  cells of the pixels */
static inline void KERNEL(enlarge_choose)(struct KERNEL(enlarge_cells) *best, const struct KERNEL(enlarge_cells) *own,
                                          const struct sst_enlarge *e, int row, long x, __m256i green)
{
    const __m256i disp = KERNEL(enlarge_shorts)(e->disp[row] + x);
    const __m256i label = _mm256_cvtepu8_epi16(_mm_loadu_si128((const __m128i *)(const void *)(e->label[row] + x)));
    const __m256i over =
        _mm256_subs_epu16(KERNEL(enlarge_apart)(disp, own->disp), _mm256_set1_epi16((int16_t)e->step_q6));
    const __m256i same =
        _mm256_and_si256(_mm256_cmpeq_epi16(over, _mm256_setzero_si256()), _mm256_cmpeq_epi16(label, own->label));
    const __m256i unlike = _mm256_or_si256(KERNEL(enlarge_apart)(KERNEL(enlarge_shorts)(e->green4[row] + x), green),
                                           _mm256_srli_epi16(same, 1));
    const __m256i take = _mm256_cmpgt_epi16(best->unlike, unlike);

    best->disp = _mm256_blendv_epi8(best->disp, disp, take);
    best->label = _mm256_blendv_epi8(best->label, label, take);
    best->unlike = _mm256_min_epi16(best->unlike, unlike);
}

/* The pixels of the cells from x on, on their left (side -1) or right (1). @param green  four times theirs */
static inline struct KERNEL(enlarge_cells) KERNEL(enlarge_side)(const struct sst_enlarge *e, long x, long side,
                                                                __m256i green)
{
    const struct KERNEL(enlarge_cells) own = {
        KERNEL(enlarge_shorts)(e->disp[0] + x),
        _mm256_cvtepu8_epi16(_mm_loadu_si128((const __m128i *)(const void *)(e->label[0] + x))),
        KERNEL(enlarge_apart)(KERNEL(enlarge_shorts)(e->green4[0] + x), green)
    };
    struct KERNEL(enlarge_cells) best = own;

    KERNEL(enlarge_choose)(&best, &own, e, 0, x + side, green);
    KERNEL(enlarge_choose)(&best, &own, e, 1, x, green);
    KERNEL(enlarge_choose)(&best, &own, e, 1, x + side, green);
    return best;
}

static void KERNEL(enlarge_row)(uint16_t *disp, uint8_t *label, const struct sst_enlarge *e, size_t n)
{
    long x = 0;

    for (; (long)n - x >= ENLARGE_BLOCK; x += ENLARGE_BLOCK) {
        const __m256i green = _mm256_loadu_si256((const __m256i *)(const void *)(e->green + 2 * x));
        const struct KERNEL(enlarge_cells) left = KERNEL(enlarge_side)(
            e, x, -1, _mm256_slli_epi16(_mm256_and_si256(green, _mm256_set1_epi16(255)), 2));
        const struct KERNEL(enlarge_cells) right =
            KERNEL(enlarge_side)(e, x, 1, _mm256_slli_epi16(_mm256_srli_epi16(green, 8), 2));
        const __m256i low = _mm256_unpacklo_epi16(left.disp, right.disp);
        const __m256i high = _mm256_unpackhi_epi16(left.disp, right.disp);
        __m256i *to = (__m256i *)(void *)(disp + 2 * x);

        _mm256_storeu_si256(to, _mm256_permute2x128_si256(low, high, 0x20));
        _mm256_storeu_si256(to + 1, _mm256_permute2x128_si256(low, high, 0x31));
        _mm256_storeu_si256((__m256i *)(void *)(label + 2 * x),
                            _mm256_or_si256(left.label, _mm256_slli_epi16(right.label, 8)));
    }
    if (x < (long)n) {
        const struct sst_enlarge rest = { { e->disp[0] + x, e->disp[1] + x },
                                          { e->green4[0] + x, e->green4[1] + x },
                                          { e->label[0] + x, e->label[1] + x },
                                          e->green + 2 * x,
                                          e->step_q6 };

        sst_enlarge_row_ref(disp + 2 * x, label + 2 * x, &rest, n - (size_t)x);
    }
}
#else
#define ENLARGE_BLOCK 32

struct KERNEL(enlarge_lanes) {
    uint16_t disp[ENLARGE_BLOCK], label[ENLARGE_BLOCK], unlike[ENLARGE_BLOCK];
};

/* Load cells x .. x+n-1 of a row, and their colour distance to the pixels. */
static inline __attribute__((always_inline)) void KERNEL(enlarge_load)(struct KERNEL(enlarge_lanes) *restrict to,
                                                                       const struct sst_enlarge *e, int row, long x,
                                                                       const uint16_t *restrict green, long n)
{
    const uint16_t *restrict disp = e->disp[row] + x, *restrict green4 = e->green4[row] + x;
    const uint8_t *restrict label = e->label[row] + x;

    for (long i = 0; i < n; i++)
        to->disp[i] = disp[i];
    for (long i = 0; i < n; i++)
        to->label[i] = label[i];
    for (long i = 0; i < n; i++)
        to->unlike[i] = (uint16_t)(green4[i] > green[i] ? green4[i] - green[i] : green[i] - green4[i]);
}

/* Select a cell if it belongs to another surface than the pixel's own cell and its colour is nearer than the current
 * selection. */
static inline __attribute__((always_inline)) void
KERNEL(enlarge_choose)(struct KERNEL(enlarge_lanes) *restrict best, const struct KERNEL(enlarge_lanes) *restrict own,
                       const struct KERNEL(enlarge_lanes) *restrict cell, uint16_t step)
{
    for (int i = 0; i < ENLARGE_BLOCK; i++) {
        const uint16_t d = cell->disp[i], o = own->disp[i];
        const uint16_t apart = (uint16_t)(d > o ? d - o : o - d);
        const uint16_t far = (uint16_t) - (apart > step), other = (uint16_t) - (cell->label[i] != own->label[i]);
        const uint16_t less = (uint16_t) - (cell->unlike[i] < best->unlike[i]);
        const uint16_t take = (uint16_t)((far | other) & less), keep = (uint16_t)~take;

        best->disp[i] = (uint16_t)((d & take) | (best->disp[i] & keep));
        best->label[i] = (uint16_t)((cell->label[i] & take) | (best->label[i] & keep));
        best->unlike[i] = (uint16_t)((cell->unlike[i] & take) | (best->unlike[i] & keep));
    }
}

/* The pixels of n cells from x on, n at most ENLARGE_BLOCK, on their left (side -1) or right (1). */
static inline __attribute__((always_inline)) void KERNEL(enlarge_side)(struct KERNEL(enlarge_lanes) *restrict best,
                                                                       const struct sst_enlarge *e, long x, long side,
                                                                       long n)
{
    const uint8_t *restrict pixel = e->green + 2 * x + (side > 0);
    const uint16_t step = (uint16_t)e->step_q6;
    struct KERNEL(enlarge_lanes) own = { { 0 }, { 0 }, { 0 } }, cell = { { 0 }, { 0 }, { 0 } };
    uint16_t green[ENLARGE_BLOCK];

    for (long i = 0; i < n; i++)
        green[i] = (uint16_t)(4 * pixel[2 * i]);
    KERNEL(enlarge_load)(&own, e, 0, x, green, n);
    *best = own;
    KERNEL(enlarge_load)(&cell, e, 0, x + side, green, n);
    KERNEL(enlarge_choose)(best, &own, &cell, step);
    KERNEL(enlarge_load)(&cell, e, 1, x, green, n);
    KERNEL(enlarge_choose)(best, &own, &cell, step);
    KERNEL(enlarge_load)(&cell, e, 1, x + side, green, n);
    KERNEL(enlarge_choose)(best, &own, &cell, step);
}

/* Inlined with a constant count, so that lanes stay in registers. */
static inline __attribute__((always_inline)) void KERNEL(enlarge_cells)(uint16_t *restrict d, uint8_t *restrict l,
                                                                        const struct sst_enlarge *e, long x, long count)
{
    struct KERNEL(enlarge_lanes) side[2];

    KERNEL(enlarge_side)(&side[0], e, x, -1, count);
    KERNEL(enlarge_side)(&side[1], e, x, 1, count);
    for (long i = 0; i < count; i++) {
        d[2 * i] = side[0].disp[i];
        d[2 * i + 1] = side[1].disp[i];
    }
    for (long i = 0; i < count; i++) {
        l[2 * i] = (uint8_t)side[0].label[i];
        l[2 * i + 1] = (uint8_t)side[1].label[i];
    }
}

static void KERNEL(enlarge_row)(uint16_t *disp, uint8_t *label, const struct sst_enlarge *e, size_t n)
{
    long x = 0;

    for (; (long)n - x >= ENLARGE_BLOCK; x += ENLARGE_BLOCK)
        KERNEL(enlarge_cells)(disp + 2 * x, label + 2 * x, e, x, ENLARGE_BLOCK);
    if (x < (long)n)
        KERNEL(enlarge_cells)(disp + 2 * x, label + 2 * x, e, x, (long)n - x);
}

#endif
#undef ENLARGE_BLOCK
