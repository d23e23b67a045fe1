/* disp_span, cell_score, score_add: whole blocks of lanes; the rest by the references, for extremes by a block that
 * overlaps the last one. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#if defined(__SSE2__)
#include <emmintrin.h>
#endif

/* Rows are 16 to 50 values: with blocks of 32, those of 16 would be left to the reference. */
#define SPAN_LANES 16
typedef uint16_t KERNEL(span_values) __attribute__((vector_size(2 * SPAN_LANES)));

/* Columns of blocks, so that extremes stay in registers. */
static void KERNEL(disp_span)(uint16_t span[2], const uint16_t *disp, size_t stride, int end, size_t n, size_t rows)
{
    const KERNEL(span_values) zero = { 0 }, above = zero + (uint16_t)end;
    KERNEL(span_values) least = zero + span[0], most = zero + span[1];

    if (n < SPAN_LANES) {
        sst_disp_span_ref(span, disp, stride, end, n, rows);
        return;
    }
    for (size_t x = 0; x < n; x += SPAN_LANES) {
        const uint16_t *row = disp + (n - x < SPAN_LANES ? n - SPAN_LANES : x);

        for (size_t y = 0; y < rows; y++, row += stride / sizeof(*row)) {
            KERNEL(span_values) at, known, less, more;

            memcpy(&at, row, sizeof(at));
            known = at & (KERNEL(span_values))(at < above);
            less = (KERNEL(span_values))(at < least);
            more = (KERNEL(span_values))(known > most);
            least = (at & less) | (least & ~less);
            most = (known & more) | (most & ~more);
        }
    }
    for (int i = 0; i < SPAN_LANES; i++) {
        span[0] = least[i] < span[0] ? least[i] : span[0];
        span[1] = most[i] > span[1] ? most[i] : span[1];
    }
}
#undef SPAN_LANES

#define SCORE_BLOCK 16

#if defined(__SSE2__)
/* Sums of differences saturate at 255, which changes nothing: less the usual difference, that is above the largest
 * score, too. */
static inline __m128i KERNEL(score_apart)(const uint8_t *a, const uint8_t *b)
{
    const __m128i at = _mm_loadu_si128((const __m128i *)a), was = _mm_loadu_si128((const __m128i *)b);

    return _mm_or_si128(_mm_subs_epu8(at, was), _mm_subs_epu8(was, at));
}

static inline void KERNEL(score_block)(uint8_t *score, uint16_t *usual, const struct sst_score_cells *c, int learns,
                                       size_t x)
{
    __m128i *to = (__m128i *)usual, was[2] = { _mm_loadu_si128(to), _mm_loadu_si128(to + 1) };
    const __m128i off = _mm_add_epi8(_mm_packus_epi16(_mm_srli_epi16(was[0], 8), _mm_srli_epi16(was[1], 8)),
                                     _mm_set1_epi8(SST_SCORE_SLACK));
    __m128i least = _mm_set1_epi8(-1), some;

    _Static_assert(255 - SST_SCORE_USUAL - SST_SCORE_SLACK >= SST_SCORE_CAP && SST_SCORE_USUAL < 128, "saturates");
    for (int i = 0; i < SST_SCORE_SLOTS; i++)
        least = _mm_min_epu8(least, _mm_adds_epu8(_mm_adds_epu8(KERNEL(score_apart)(c->now[0] + x, c->slot[i][0] + x),
                                                                KERNEL(score_apart)(c->now[1] + x, c->slot[i][1] + x)),
                                                  KERNEL(score_apart)(c->now[2] + x, c->slot[i][2] + x)));
    _mm_storeu_si128((__m128i *)score, _mm_min_epu8(_mm_subs_epu8(least, off), _mm_set1_epi8(SST_SCORE_CAP)));
    if (!learns)
        return;
    some = _mm_min_epu8(least, _mm_set1_epi8(SST_SCORE_USUAL));
    was[0] = _mm_add_epi16(
        was[0], _mm_srai_epi16(_mm_sub_epi16(_mm_unpacklo_epi8(_mm_setzero_si128(), some), was[0]), SST_SCORE_RATE));
    was[1] = _mm_add_epi16(
        was[1], _mm_srai_epi16(_mm_sub_epi16(_mm_unpackhi_epi8(_mm_setzero_si128(), some), was[1]), SST_SCORE_RATE));
    _mm_storeu_si128(to, was[0]);
    _mm_storeu_si128(to + 1, was[1]);
}
#else
static inline uint8_t KERNEL(score_apart)(uint8_t a, uint8_t b)
{
    return (uint8_t)((a > b ? a : b) - (a > b ? b : a));
}

/* least = min(least, |r - sr| + |g - sg| + |b - sb|) of a block */
static inline void KERNEL(score_lower)(uint16_t *restrict least, const uint8_t *restrict r, const uint8_t *restrict g,
                                       const uint8_t *restrict b, const uint8_t *restrict sr,
                                       const uint8_t *restrict sg, const uint8_t *restrict sb)
{
    for (int i = 0; i < SCORE_BLOCK; i++) {
        const uint16_t d = (uint16_t)(KERNEL(score_apart)(r[i], sr[i]) + KERNEL(score_apart)(g[i], sg[i]) +
                                      KERNEL(score_apart)(b[i], sb[i]));

        least[i] = d < least[i] ? d : least[i];
    }
}

static inline void KERNEL(score_block)(uint8_t *restrict score, uint16_t *restrict usual,
                                       const struct sst_score_cells *c, int learns, size_t x)
{
    uint16_t least[SCORE_BLOCK];

    for (int i = 0; i < SCORE_BLOCK; i++)
        least[i] = 3 * 255;
    for (int i = 0; i < SST_SCORE_SLOTS; i++)
        KERNEL(score_lower)
        (least, c->now[0] + x, c->now[1] + x, c->now[2] + x, c->slot[i][0] + x, c->slot[i][1] + x, c->slot[i][2] + x);
    for (int i = 0; i < SCORE_BLOCK; i++) {
        const int above = least[i] - (usual[i] >> 8) - SST_SCORE_SLACK;

        score[i] = (uint8_t)(above < 0 ? 0 : above > SST_SCORE_CAP ? SST_SCORE_CAP : above);
    }
    for (int i = 0; i < SCORE_BLOCK && learns; i++) {
        const int some = least[i] < SST_SCORE_USUAL ? least[i] : SST_SCORE_USUAL;

        usual[i] = (uint16_t)(usual[i] + ((256 * some - usual[i]) >> SST_SCORE_RATE));
    }
}
#endif

static void KERNEL(cell_score)(uint8_t *score, uint16_t *usual, const struct sst_score_cells *c, int learns, size_t n)
{
    struct sst_score_cells rest;
    size_t x = 0;

    for (; n - x >= SCORE_BLOCK; x += SCORE_BLOCK)
        KERNEL(score_block)(score + x, usual + x, c, learns, x);
    if (x == n)
        return;
    for (int k = 0; k < 3; k++) {
        rest.now[k] = c->now[k] + x;
        for (int i = 0; i < SST_SCORE_SLOTS; i++)
            rest.slot[i][k] = c->slot[i][k] + x;
    }
    sst_cell_score_ref(score + x, usual + x, &rest, learns, n - x);
}
#undef SCORE_BLOCK

static void KERNEL(score_add)(uint16_t *restrict sum, const uint8_t *restrict score, size_t n)
{
    for (size_t x = 0; x < n; x++)
        sum[x] = (uint16_t)(sum[x] + score[x]);
}
