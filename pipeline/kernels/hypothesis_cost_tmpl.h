/* hypothesis_cost_row. Positions are arbitrary, so the work is vectorised inside each window: three rows of four
 * pixels, of which a mask selects the similar ones. */
#if defined(__SSE2__)
#include <emmintrin.h>
#endif

struct KERNEL(hypothesis_window) {
    uint8_t mask[3][16];   /* 255 in the three channels of similar pixels */
    uint8_t pixels[3][16]; /* masked */
    unsigned scale;        /* 2^19 / number of similar pixels */
};

static inline void KERNEL(hypothesis_window_init)(struct KERNEL(hypothesis_window) * w, const uint32_t *at,
                                                  ptrdiff_t stride, int similar)
{
    uint8_t middle[16], same[12];
    unsigned count = 0;

    for (int i = 0; i < 16; i++)
        middle[i] = (uint8_t)(at[0] >> 8 * (i & 3));
    memset(w->mask, 0, sizeof(w->mask));
    for (int row = 0; row < 3; row++) {
        memcpy(w->pixels[row], at + (row - 1) * stride - 1, 16);
        for (int i = 0; i < 12; i++) {
            const int a = w->pixels[row][i], b = middle[i];

            same[i] = (a > b ? a - b : b - a) <= similar;
        }
        for (int i = 0; i < 3; i++) {
            const uint8_t all = same[4 * i] & same[4 * i + 1] & same[4 * i + 2];

            count += all;
            for (int c = 0; c < 3; c++)
                w->mask[row][4 * i + c] = (uint8_t)-all;
        }
        for (int i = 0; i < 16; i++)
            w->pixels[row][i] &= w->mask[row][i];
    }
    w->scale = 65536 * 8 / count;
}

#if defined(__SSE2__)
static inline unsigned KERNEL(hypothesis_difference)(const struct KERNEL(hypothesis_window) * w, const uint32_t *at,
                                                     ptrdiff_t stride)
{
    __m128i sum = _mm_setzero_si128();

    for (int row = 0; row < 3; row++) {
        const __m128i there = _mm_loadu_si128((const __m128i *)(const void *)(at + (row - 1) * stride - 1));
        const __m128i mask = _mm_loadu_si128((const __m128i *)(const void *)w->mask[row]);

        sum = _mm_add_epi32(sum, _mm_sad_epu8(_mm_and_si128(there, mask),
                                              _mm_loadu_si128((const __m128i *)(const void *)w->pixels[row])));
    }
    return (unsigned)_mm_cvtsi128_si32(_mm_add_epi32(sum, _mm_unpackhi_epi64(sum, sum)));
}
#else
static inline unsigned KERNEL(hypothesis_difference)(const struct KERNEL(hypothesis_window) * w, const uint32_t *at,
                                                     ptrdiff_t stride)
{
    unsigned sum = 0;

    for (int row = 0; row < 3; row++) {
        uint8_t there[16];

        memcpy(there, at + (row - 1) * stride - 1, 16);
        for (int i = 0; i < 16; i++) {
            const int a = there[i] & w->mask[row][i], b = w->pixels[row][i];

            sum += (unsigned)(a > b ? a - b : b - a);
        }
    }
    return sum;
}
#endif

/* Where a disparity moves a pixel to in each view. */
struct KERNEL(hypothesis_moves) {
    int32_t x[SST_HYPOTHESIS_VIEWS], y[SST_HYPOTHESIS_VIEWS];
};

static inline void KERNEL(hypothesis_move)(struct KERNEL(hypothesis_moves) * m, const struct sst_hypothesis_test *t,
                                           int d)
{
    for (int k = 0; k < SST_HYPOTHESIS_VIEWS; k++) {
        m->x[k] = (t->x[k] + d * t->dx[k]) >> 16;
        m->y[k] = (t->y[k] + d * t->dy[k]) >> 16;
    }
}

static inline unsigned KERNEL(hypothesis_cost)(const struct sst_hypothesis_test *t,
                                               const struct KERNEL(hypothesis_window) * w,
                                               const struct KERNEL(hypothesis_moves) * m, int x, int y, unsigned hides)
{
    unsigned b0 = 65535, b1 = 65535, b2 = 65535, b3 = 65535, seen = 0, visible = 0, sum = 0;

    for (int k = 0; k < t->views; k++) {
        const int xv = x + m->x[k], yv = y + m->y[k];
        const uint32_t *at = t->view[k].pixels + yv * t->view[k].stride + xv;
        unsigned cost, open, c1, c2, c3;

        if ((unsigned)xv >= (unsigned)t->width || (unsigned)yv >= (unsigned)t->height || *at >> 24 == SST_DEPTH_OUTSIDE)
            continue;
        cost = KERNEL(hypothesis_difference)(w, at, t->view[k].stride) * w->scale >> 16;
        cost = cost < SST_HYPOTHESIS_LIMIT ? cost : SST_HYPOTHESIS_LIMIT;
        open = *at >> 24 <= hides;
        seen++;
        visible += open;
        sum += cost & -open;
        c1 = cost > b0 ? cost : b0;
        b0 = cost > b0 ? b0 : cost;
        c2 = c1 > b1 ? c1 : b1;
        b1 = c1 > b1 ? b1 : c1;
        c3 = c2 > b2 ? c2 : b2;
        b2 = c2 > b2 ? b2 : c2;
        b3 = c3 > b3 ? b3 : c3;
    }
    if (seen < SST_HYPOTHESIS_BEST)
        return seen ? b0 : SST_HYPOTHESIS_LIMIT;
    return (sum + b0 + b1 + b2 + b3) / (visible + SST_HYPOTHESIS_BEST);
}

static void KERNEL(hypothesis_cost_row)(uint16_t *cost, const uint16_t *hypothesis, const uint8_t *count,
                                        const struct sst_hypothesis_test *test, int x, int y, size_t n)
{
    _Static_assert(SST_HYPOTHESIS_BEST == 4, "four sums");
    for (size_t k = 0; k < n; k++, x++, cost += SST_HYPOTHESES, hypothesis += SST_HYPOTHESES) {
        struct KERNEL(hypothesis_window) w;
        struct KERNEL(hypothesis_moves) moves;

        for (size_t i = 0; i < SST_HYPOTHESES; i++)
            cost[i] = SST_HYPOTHESIS_FAR;
        if (count[k] == 1)
            cost[0] = 0;
        if (count[k] < 2)
            continue;
        KERNEL(hypothesis_window_init)
        (&w, test->own.pixels + y * test->own.stride + x, test->own.stride, test->similar);
        for (size_t i = 0; i < count[k] && (!i || cost[0] >= test->settled); i++) {
            const int d = hypothesis[i], front = d + test->tolerance;

            KERNEL(hypothesis_move)(&moves, test, d);
            cost[i] = (uint16_t)KERNEL(hypothesis_cost)(test, &w, &moves, x, y,
                                                        test->code[front < 65534 ? front : 65534]);
        }
    }
}
