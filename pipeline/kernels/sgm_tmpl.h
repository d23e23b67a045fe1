/* Semi-global optimisation: 16-bit lanes over the disparities of one pixel. nd is a multiple of 32. */
static inline void KERNEL(sgm_step)(uint16_t *restrict cur, const uint16_t *restrict prev, uint16_t *restrict sum,
                                    const uint8_t *restrict cost, uint16_t p1, uint16_t p2, int first, size_t nd)
{
    const uint16_t prev_min = prev[-2], jump = (uint16_t)(prev_min + p2);
    uint16_t cur_min = SST_SGM_FAR;

    for (size_t d = 0; d < nd; d++) {
        const uint16_t below = prev[(ptrdiff_t)d - 1], above = prev[d + 1];
        const uint16_t near = (uint16_t)((below < above ? below : above) + p1);
        const uint16_t same = prev[d];
        const uint16_t stay = same < near ? same : near;
        const uint16_t best = stay < jump ? stay : jump;
        const uint16_t l = (uint16_t)(cost[d] + best - prev_min);

        cur[d] = l;
        sum[d] = (uint16_t)(first ? l : sum[d] + l);
        cur_min = l < cur_min ? l : cur_min;
    }
    cur[-1] = cur[nd] = SST_SGM_FAR;
    cur[-2] = cur_min;
}

#if defined(__AVX512BW__)
/* A pixel's L in registers, its minimum in all lanes of another one. */
struct KERNEL(sgm_state) {
    __m512i l[2], least;
};

static inline __m512i KERNEL(sgm_least)(__m512i v)
{
    const __m256i half = _mm256_min_epu16(_mm512_castsi512_si256(v), _mm512_extracti64x4_epi64(v, 1));
    const __m128i quarter = _mm_min_epu16(_mm256_castsi256_si128(half), _mm256_extracti128_si256(half, 1));

    return _mm512_broadcastw_epi16(_mm_minpos_epu16(quarter));
}

/* L of the next pixel. @param regs  1 or 2: nd is 32 of it */
static inline void KERNEL(sgm_next)(struct KERNEL(sgm_state) *s, const __m512i below[2], const __m512i above[2],
                                    uint16_t *sum, const uint8_t *cost, uint16_t p1, uint16_t p2, int first,
                                    const int regs)
{
    const __m512i one = _mm512_set1_epi16((int16_t)p1), was = s->least;
    const __m512i jump = _mm512_add_epi16(was, _mm512_set1_epi16((int16_t)p2));

#pragma GCC unroll 2
    for (int r = 0; r < regs; r++) {
        const __m512i near = _mm512_add_epi16(_mm512_min_epu16(below[r], above[r]), one);
        const __m512i best = _mm512_min_epu16(_mm512_min_epu16(s->l[r], near), jump);
        const __m512i c = _mm512_cvtepu8_epi16(_mm256_loadu_si256((const __m256i *)(const void *)(cost + 32 * r)));
        const __m512i l = _mm512_add_epi16(_mm512_sub_epi16(best, was), c);

        _mm512_storeu_si512(sum + 32 * r, first ? l : _mm512_add_epi16(l, _mm512_loadu_si512(sum + 32 * r)));
        s->l[r] = l;
    }
    s->least = KERNEL(sgm_least)(regs == 2 ? _mm512_min_epu16(s->l[0], s->l[1]) : s->l[0]);
}

static inline void KERNEL(sgm_load)(struct KERNEL(sgm_state) *s, const uint16_t *l, const int regs)
{
    s->least = _mm512_set1_epi16((int16_t)l[-2]);
    s->l[0] = _mm512_loadu_si512(l);
    s->l[1] = regs == 2 ? _mm512_loadu_si512(l + 32) : s->l[0];
}

static inline void KERNEL(sgm_store)(const struct KERNEL(sgm_state) *s, uint16_t *l, const int regs)
{
#pragma GCC unroll 2
    for (int r = 0; r < regs; r++)
        _mm512_storeu_si512(l + 32 * r, s->l[r]);
    l[-1] = l[32 * regs] = SST_SGM_FAR;
    l[-2] = (uint16_t)_mm_cvtsi128_si32(_mm512_castsi512_si128(s->least));
}

static inline void KERNEL(sgm_across_regs)(uint16_t *c, const uint16_t *p, uint16_t *sum, const uint8_t *cost,
                                           const uint8_t *penalty, const uint16_t *p1, const uint16_t *p2, int first,
                                           size_t n, const int regs)
{
    const size_t nd = 32 * (size_t)regs, entry = nd + 2 * SST_SGM_PAD;

    for (size_t x = 0; x < n; x++, c += entry, p += entry) {
        __m512i below[2], above[2];
        struct KERNEL(sgm_state) s;

        KERNEL(sgm_load)(&s, p, regs);
#pragma GCC unroll 2
        for (int r = 0; r < regs; r++) {
            below[r] = _mm512_loadu_si512(p + 32 * r - 1);
            above[r] = _mm512_loadu_si512(p + 32 * r + 1);
        }
        KERNEL(sgm_next)(&s, below, above, sum + x * nd, cost + x * nd, p1[penalty[x]], p2[penalty[x]], first, regs);
        KERNEL(sgm_store)(&s, c, regs);
    }
}

/* `rows` paths along rows, 1 or SST_SGM_ROWS; only the first and the last entries of `line` are used. */
static inline void KERNEL(sgm_along_regs)(uint16_t *line, uint16_t *sum, const uint8_t *cost, size_t stride,
                                          const uint8_t *penalty, size_t penalty_stride, const uint16_t *p1,
                                          const uint16_t *p2, int dir, int first, const size_t rows, size_t n,
                                          const int regs)
{
    const size_t nd = 32 * (size_t)regs, entry = nd + 2 * SST_SGM_PAD;
    const __m512i lane = _mm512_set_epi16(31, 30, 29, 28, 27, 26, 25, 24, 23, 22, 21, 20, 19, 18, 17, 16, 15, 14, 13, 12,
                                          11, 10, 9, 8, 7, 6, 5, 4, 3, 2, 1, 0);
    const __m512i up = _mm512_add_epi16(lane, _mm512_set1_epi16(1)), down = _mm512_add_epi16(lane, _mm512_set1_epi16(31));
    __m512i low[SST_SGM_ROWS], high[SST_SGM_ROWS];
    struct KERNEL(sgm_state) s[SST_SGM_ROWS];

#pragma GCC unroll 4
    for (size_t r = 0; r < rows; r++) {
        const uint16_t *l = line + (r * (n + 2) + (dir > 0 ? 0 : n + 1)) * entry + SST_SGM_PAD;

        KERNEL(sgm_load)(&s[r], l, regs);
        low[r] = _mm512_set1_epi16((int16_t)l[-1]);
        high[r] = _mm512_set1_epi16((int16_t)l[nd]);
    }
    for (size_t i = 0; i < n; i++) {
        const size_t x = dir > 0 ? i : n - 1 - i;

#pragma GCC unroll 4
        for (size_t r = 0; r < rows; r++) {
            const uint8_t step = penalty[r * penalty_stride + x];
            const __m512i below[2] = { _mm512_permutex2var_epi16(low[r], down, s[r].l[0]),
                                       _mm512_permutex2var_epi16(s[r].l[0], down, s[r].l[1]) };
            const __m512i above[2] = { _mm512_permutex2var_epi16(s[r].l[0], up, regs == 2 ? s[r].l[1] : high[r]),
                                       _mm512_permutex2var_epi16(s[r].l[1], up, high[r]) };

            KERNEL(sgm_next)(&s[r], below, above, sum + r * stride + x * nd, cost + r * stride + x * nd, p1[step],
                             p2[step], first, regs);
            low[r] = high[r] = _mm512_set1_epi16(SST_SGM_FAR);
        }
    }
#pragma GCC unroll 4
    for (size_t r = 0; r < rows; r++)
        KERNEL(sgm_store)(&s[r], line + (r * (n + 2) + (dir > 0 ? n : 1)) * entry + SST_SGM_PAD, regs);
}

/* @return whether it was done: where L fits two registers */
static bool KERNEL(sgm_along_done)(uint16_t *line, uint16_t *sum, const uint8_t *cost, size_t stride,
                                   const uint8_t *penalty, size_t penalty_stride, const uint16_t *p1,
                                   const uint16_t *p2, int dir, int first, size_t rows, size_t n, size_t nd)
{
    const bool all = rows == SST_SGM_ROWS;

    if (nd > 64 || (!all && rows > 1))
        return false;
    if (nd == 32 && all)
        KERNEL(sgm_along_regs)(line, sum, cost, stride, penalty, penalty_stride, p1, p2, dir, first, SST_SGM_ROWS, n, 1);
    else if (nd == 32)
        KERNEL(sgm_along_regs)(line, sum, cost, stride, penalty, penalty_stride, p1, p2, dir, first, 1, n, 1);
    else if (all)
        KERNEL(sgm_along_regs)(line, sum, cost, stride, penalty, penalty_stride, p1, p2, dir, first, SST_SGM_ROWS, n, 2);
    else
        KERNEL(sgm_along_regs)(line, sum, cost, stride, penalty, penalty_stride, p1, p2, dir, first, 1, n, 2);
    return true;
}
#endif

static void KERNEL(sgm_across_row)(uint16_t *cur, const uint16_t *prev, uint16_t *sum, const uint8_t *cost,
                                   const uint8_t *penalty, const uint16_t *p1, const uint16_t *p2, int dx, int first,
                                   size_t n, size_t nd)
{
    const size_t entry = nd + 2 * SST_SGM_PAD;
    uint16_t *c = cur + entry + SST_SGM_PAD;
    const uint16_t *p = prev + (size_t)(1 + dx) * entry + SST_SGM_PAD;

#if defined(__AVX512BW__)
    if (nd == 32 && first)
        KERNEL(sgm_across_regs)(c, p, sum, cost, penalty, p1, p2, 1, n, 1);
    else if (nd == 32)
        KERNEL(sgm_across_regs)(c, p, sum, cost, penalty, p1, p2, 0, n, 1);
    else if (nd == 64)
        KERNEL(sgm_across_regs)(c, p, sum, cost, penalty, p1, p2, first, n, 2);
    if (nd == 32 || nd == 64)
        return;
#endif
    for (size_t x = 0; x < n; x++, c += entry, p += entry) {
        if (first)
            KERNEL(sgm_step)(c, p, sum + x * nd, cost + x * nd, p1[penalty[x]], p2[penalty[x]], 1, nd);
        else
            KERNEL(sgm_step)(c, p, sum + x * nd, cost + x * nd, p1[penalty[x]], p2[penalty[x]], 0, nd);
    }
}

/* Each pixel waits for the one before: rows side by side fill the time. */
static inline void KERNEL(sgm_along_few)(uint16_t *line, uint16_t *sum, const uint8_t *cost, size_t stride,
                                         const uint8_t *penalty, size_t penalty_stride, const uint16_t *p1,
                                         const uint16_t *p2, int dir, int first, size_t rows, size_t n, size_t nd)
{
    const size_t entry = nd + 2 * SST_SGM_PAD, line_stride = (n + 2) * entry;

    for (size_t i = 0; i < n; i++) {
        const size_t x = dir > 0 ? i : n - 1 - i;

        for (size_t r = 0; r < rows; r++) {
            uint16_t *c = line + r * line_stride + (x + 1) * entry + SST_SGM_PAD;
            const uint8_t *p = penalty + r * penalty_stride;

            KERNEL(sgm_step)(c, c - (ptrdiff_t)entry * dir, sum + r * stride + x * nd, cost + r * stride + x * nd,
                             p1[p[x]], p2[p[x]], first, nd);
        }
    }
}

static void KERNEL(sgm_along_rows)(uint16_t *line, uint16_t *sum, const uint8_t *cost, size_t stride,
                                   const uint8_t *penalty, size_t penalty_stride, const uint16_t *p1,
                                   const uint16_t *p2, int dir, int first, size_t rows, size_t n, size_t nd)
{
    for (size_t r = 0; r < rows; r += SST_SGM_ROWS) {
        const size_t count = rows - r < SST_SGM_ROWS ? rows - r : SST_SGM_ROWS;
        uint16_t *l = line + r * (n + 2) * (nd + 2 * SST_SGM_PAD);

#if defined(__AVX512BW__)
        if (KERNEL(sgm_along_done)(l, sum + r * stride, cost + r * stride, stride, penalty + r * penalty_stride,
                                   penalty_stride, p1, p2, dir, first, count, n, nd))
            continue;
#endif
        if (first)
            KERNEL(sgm_along_few)(l, sum + r * stride, cost + r * stride, stride, penalty + r * penalty_stride,
                                  penalty_stride, p1, p2, dir, 1, count, n, nd);
        else
            KERNEL(sgm_along_few)(l, sum + r * stride, cost + r * stride, stride, penalty + r * penalty_stride,
                                  penalty_stride, p1, p2, dir, 0, count, n, nd);
    }
}
