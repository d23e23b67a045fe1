/* Blocks of rays in registers, for blend_tmpl.h: BLEND_BLOCK pixels in two vectors of 32 bits a pixel. */

#if defined(__AVX512VBMI__)
#define BLEND_HALF 16
#define BLEND_I    __m512i   /* half a block */
#define BLEND_F    __m512    /* half a block */
#define BLEND_M    __mmask32 /* a block */

/* Colours of half a block: pairs of neighbours in 16 bits, times their weights. Of p, BLEND_BLOCK + 1 bytes are read. */
static inline BLEND_I KERNEL(blend_pairs)(const uint8_t *p, int half)
{
    const __m512i step = _mm512_set_epi32(0x000F000F, 0x000E000E, 0x000D000D, 0x000C000C, 0x000B000B, 0x000A000A,
                                          0x00090009, 0x00080008, 0x00070007, 0x00060006, 0x00050005, 0x00040004,
                                          0x00030003, 0x00020002, 0x00010001, 0x00000000);
    const __m512i first = _mm512_set1_epi32(half ? 0x0010000F : 0x00010000);
    const __m256i bytes = _mm256_loadu_si256((const __m256i *)(const void *)(p + half));

    return _mm512_maskz_permutexvar_epi8(0x5555555555555555, _mm512_add_epi8(step, first),
                                         _mm512_castsi256_si512(bytes));
}

static inline BLEND_I KERNEL(blend_dot)(BLEND_I sum, BLEND_I a, BLEND_I b)
{
    return _mm512_dpwssd_epi32(sum, a, b);
}

static inline BLEND_I KERNEL(blend_dot0)(BLEND_I a, BLEND_I b)
{
    return _mm512_madd_epi16(a, b);
}

static inline BLEND_I KERNEL(blend_int)(int32_t v)
{
    return _mm512_set1_epi32(v);
}

static inline BLEND_F KERNEL(blend_float)(BLEND_I v)
{
    return _mm512_cvtepi32_ps(v);
}

static inline BLEND_I KERNEL(blend_and)(BLEND_I a, BLEND_I b)
{
    return _mm512_and_si512(a, b);
}

static inline BLEND_F KERNEL(blend_mask)(BLEND_F v, BLEND_I bits)
{
    return _mm512_castsi512_ps(_mm512_and_si512(_mm512_castps_si512(v), bits));
}

static inline BLEND_I KERNEL(blend_load_int)(const int32_t *p)
{
    return _mm512_loadu_si512(p);
}

static inline void KERNEL(blend_store_int)(int32_t *p, BLEND_I v)
{
    _mm512_storeu_si512(p, v);
}

static inline BLEND_F KERNEL(blend_set)(float v)
{
    return _mm512_set1_ps(v);
}

static inline BLEND_F KERNEL(blend_load)(const float *p)
{
    return _mm512_loadu_ps(p);
}

static inline void KERNEL(blend_store)(float *p, BLEND_F v)
{
    _mm512_storeu_ps(p, v);
}

/* half a block of stored disparities */
static inline BLEND_F KERNEL(blend_disp)(const uint16_t *p)
{
    return _mm512_cvtepi32_ps(_mm512_cvtepu16_epi32(_mm256_loadu_si256((const __m256i *)(const void *)p)));
}

static inline BLEND_F KERNEL(blend_mul)(BLEND_F a, BLEND_F b)
{
    return _mm512_mul_ps(a, b);
}

static inline BLEND_F KERNEL(blend_add)(BLEND_F a, BLEND_F b)
{
    return _mm512_add_ps(a, b);
}

static inline BLEND_F KERNEL(blend_sub)(BLEND_F a, BLEND_F b)
{
    return _mm512_sub_ps(a, b);
}

/* a times 2^-k, k the whole number that is added to SST_EXP2_MAGIC in m */
static inline BLEND_F KERNEL(blend_scale)(BLEND_F a, BLEND_F m)
{
    return _mm512_castsi512_ps(
        _mm512_sub_epi32(_mm512_castps_si512(a), _mm512_slli_epi32(_mm512_castps_si512(m), 23)));
}

/* (uint16_t)(disp - first) < count */
static inline BLEND_M KERNEL(blend_within)(const uint16_t *disp, uint16_t first, uint16_t count)
{
    const __m512i d = _mm512_sub_epi16(_mm512_loadu_si512(disp), _mm512_set1_epi16((int16_t)first));

    return _mm512_cmplt_epu16_mask(d, _mm512_set1_epi16((int16_t)count));
}

static inline BLEND_M KERNEL(blend_labelled)(const uint8_t *label, uint8_t as)
{
    return _mm256_cmpeq_epi8_mask(_mm256_loadu_si256((const __m256i *)(const void *)label),
                                  _mm256_set1_epi8((char)as));
}

/* Bit x: pixel x. */
static inline uint32_t KERNEL(blend_bits)(BLEND_M m)
{
    return m;
}

static inline BLEND_M KERNEL(blend_both)(BLEND_M a, BLEND_M b)
{
    return a & b;
}

/* yes where m, else no; of half a block */
static inline BLEND_F KERNEL(blend_select)(BLEND_M m, int half, BLEND_F yes, BLEND_F no)
{
    return _mm512_mask_blend_ps((__mmask16)(m >> (half ? 16 : 0)), no, yes);
}

/* The low bytes. */
static inline void KERNEL(blend_bytes)(uint8_t *to, BLEND_I v)
{
    _mm_storeu_si128((__m128i *)(void *)to, _mm512_cvtepi32_epi8(v));
}

static inline BLEND_I KERNEL(blend_round)(BLEND_I level)
{
    return _mm512_srli_epi32(_mm512_add_epi32(level, _mm512_set1_epi32(SST_BLEND_LEVEL / 2)), SST_BLEND_LEVEL_BITS);
}
#else
#define BLEND_HALF 8
#define BLEND_I    __m256i /* half a block */
#define BLEND_F    __m256  /* half a block */
#define BLEND_M    __m256i /* a block, 16 bits a pixel */

/* Colours of half a block: pairs of neighbours in 16 bits, times their weights. Of p, BLEND_BLOCK + 1 bytes are read. */
static inline BLEND_I KERNEL(blend_pairs)(const uint8_t *p, int half)
{
    const __m256i order = half ? _mm256_setr_epi8(7, -1, 8, -1, 8, -1, 9, -1, 9, -1, 10, -1, 10, -1, 11, -1, 11, -1, 12,
                                                  -1, 12, -1, 13, -1, 13, -1, 14, -1, 14, -1, 15, -1)
                               : _mm256_setr_epi8(0, -1, 1, -1, 1, -1, 2, -1, 2, -1, 3, -1, 3, -1, 4, -1, 4, -1, 5, -1,
                                                  5, -1, 6, -1, 6, -1, 7, -1, 7, -1, 8, -1);

    return _mm256_shuffle_epi8(
        _mm256_broadcastsi128_si256(_mm_loadu_si128((const __m128i *)(const void *)(p + half))), order);
}

static inline BLEND_I KERNEL(blend_dot)(BLEND_I sum, BLEND_I a, BLEND_I b)
{
#if defined(__AVXVNNI__)
    return _mm256_dpwssd_avx_epi32(sum, a, b);
#else
    return _mm256_add_epi32(sum, _mm256_madd_epi16(a, b));
#endif
}

static inline BLEND_I KERNEL(blend_dot0)(BLEND_I a, BLEND_I b)
{
    return _mm256_madd_epi16(a, b);
}

static inline BLEND_I KERNEL(blend_int)(int32_t v)
{
    return _mm256_set1_epi32(v);
}

static inline BLEND_F KERNEL(blend_float)(BLEND_I v)
{
    return _mm256_cvtepi32_ps(v);
}

static inline BLEND_I KERNEL(blend_and)(BLEND_I a, BLEND_I b)
{
    return _mm256_and_si256(a, b);
}

static inline BLEND_F KERNEL(blend_mask)(BLEND_F v, BLEND_I bits)
{
    return _mm256_castsi256_ps(_mm256_and_si256(_mm256_castps_si256(v), bits));
}

static inline BLEND_I KERNEL(blend_load_int)(const int32_t *p)
{
    return _mm256_loadu_si256((const __m256i *)(const void *)p);
}

static inline void KERNEL(blend_store_int)(int32_t *p, BLEND_I v)
{
    _mm256_storeu_si256((__m256i *)(void *)p, v);
}

static inline BLEND_F KERNEL(blend_set)(float v)
{
    return _mm256_set1_ps(v);
}

static inline BLEND_F KERNEL(blend_load)(const float *p)
{
    return _mm256_loadu_ps(p);
}

static inline void KERNEL(blend_store)(float *p, BLEND_F v)
{
    _mm256_storeu_ps(p, v);
}

static inline BLEND_F KERNEL(blend_disp)(const uint16_t *p)
{
    return _mm256_cvtepi32_ps(_mm256_cvtepu16_epi32(_mm_loadu_si128((const __m128i *)(const void *)p)));
}

static inline BLEND_F KERNEL(blend_mul)(BLEND_F a, BLEND_F b)
{
    return _mm256_mul_ps(a, b);
}

static inline BLEND_F KERNEL(blend_add)(BLEND_F a, BLEND_F b)
{
    return _mm256_add_ps(a, b);
}

static inline BLEND_F KERNEL(blend_sub)(BLEND_F a, BLEND_F b)
{
    return _mm256_sub_ps(a, b);
}

/* a times 2^-k, k the whole number that is added to SST_EXP2_MAGIC in m */
static inline BLEND_F KERNEL(blend_scale)(BLEND_F a, BLEND_F m)
{
    return _mm256_castsi256_ps(
        _mm256_sub_epi32(_mm256_castps_si256(a), _mm256_slli_epi32(_mm256_castps_si256(m), 23)));
}

/* (uint16_t)(disp - first) < count */
static inline BLEND_M KERNEL(blend_within)(const uint16_t *disp, uint16_t first, uint16_t count)
{
    const __m256i at = _mm256_sub_epi16(_mm256_loadu_si256((const __m256i *)(const void *)disp),
                                        _mm256_set1_epi16((int16_t)first));
    const __m256i left = _mm256_subs_epu16(_mm256_set1_epi16((int16_t)count), at);

    return _mm256_xor_si256(_mm256_cmpeq_epi16(left, _mm256_setzero_si256()), _mm256_set1_epi16(-1));
}

static inline BLEND_M KERNEL(blend_labelled)(const uint8_t *label, uint8_t as)
{
    return _mm256_cvtepi8_epi16(
        _mm_cmpeq_epi8(_mm_loadu_si128((const __m128i *)(const void *)label), _mm_set1_epi8((char)as)));
}

/* Bit x: pixel x. */
static inline uint32_t KERNEL(blend_bits)(BLEND_M m)
{
    return (uint32_t)_mm_movemask_epi8(_mm_packs_epi16(_mm256_castsi256_si128(m), _mm256_extracti128_si256(m, 1)));
}

static inline BLEND_M KERNEL(blend_both)(BLEND_M a, BLEND_M b)
{
    return _mm256_and_si256(a, b);
}

/* yes where m, else no; of half a block */
static inline BLEND_F KERNEL(blend_select)(BLEND_M m, int half, BLEND_F yes, BLEND_F no)
{
    const __m128i of = half ? _mm256_extracti128_si256(m, 1) : _mm256_castsi256_si128(m);

    return _mm256_blendv_ps(no, yes, _mm256_castsi256_ps(_mm256_cvtepi16_epi32(of)));
}

/* The low bytes. */
static inline void KERNEL(blend_bytes)(uint8_t *to, BLEND_I v)
{
    const __m128i words = _mm_packus_epi32(_mm256_castsi256_si128(v), _mm256_extracti128_si256(v, 1));

    _mm_storel_epi64((__m128i *)(void *)to, _mm_packus_epi16(words, words));
}

static inline BLEND_I KERNEL(blend_round)(BLEND_I level)
{
    return _mm256_srli_epi32(_mm256_add_epi32(level, _mm256_set1_epi32(SST_BLEND_LEVEL / 2)), SST_BLEND_LEVEL_BITS);
}
#endif

#define BLEND_BLOCK   (2 * BLEND_HALF)
#define BLEND_ALL     ((uint32_t)((1ULL << BLEND_BLOCK) - 1))
#define BLEND_UNKNOWN ((SST_BLEND_COLUMNS - 1) << SST_BLEND_COLUMN_SHIFT) /* and above: the last column of W_s */

/* Of a run: weights of the pixels of both rows, and of a block. */
struct KERNEL(blend_taps) {
    BLEND_I top, bottom;
};
struct KERNEL(blend_weights) {
    BLEND_F half[2];
};

/* Two weights as one number, as they lie in memory: a rounded one may be -1, whose sign must not reach the other. */
static inline int32_t KERNEL(blend_two_taps)(const int16_t *tap)
{
    int32_t two;

    memcpy(&two, tap, sizeof(two));
    return two;
}

static inline struct KERNEL(blend_taps) KERNEL(blend_set_taps)(const struct sst_blend *b)
{
    return (struct KERNEL(blend_taps)){ KERNEL(blend_int)(KERNEL(blend_two_taps)(b->tap)),
                                        KERNEL(blend_int)(KERNEL(blend_two_taps)(b->tap + 2)) };
}

/* Colours of half a block. */
static inline BLEND_I KERNEL(blend_colours)(const struct sst_blend *b, int c, size_t x, int half,
                                            const struct KERNEL(blend_taps) *t)
{
    const BLEND_I top = KERNEL(blend_dot0)(KERNEL(blend_pairs)(b->top[c] + x, half), t->top);

    return KERNEL(blend_dot)(top, KERNEL(blend_pairs)(b->bottom[c] + x, half), t->bottom);
}

/* W_s of a block with an irregular label or unknown disparities, one by one. */
static __attribute__((noinline)) struct KERNEL(blend_weights) KERNEL(blend_label_table)(const struct sst_blend *b,
                                                                                       size_t x)
{
    struct KERNEL(blend_weights) w;
    float each[BLEND_BLOCK];

    for (size_t i = 0; i < BLEND_BLOCK; i++)
        each[i] = b->range[b->label[x + i]].weight[b->disp[x + i] >> SST_BLEND_COLUMN_SHIFT];
    for (int half = 0; half < 2; half++)
        w.half[half] = KERNEL(blend_load)(each + half * BLEND_HALF);
    return w;
}

/* Put the W_s of the pixels `of` a block that have a label into w. */
static inline void KERNEL(blend_one_label)(struct KERNEL(blend_weights) *w, const struct sst_blend *b,
                                           const struct sst_blend_range *r, BLEND_M of, size_t x)
{
    for (int i = 0; i < r->ranges; i++) {
        const BLEND_M within = KERNEL(blend_both)(of, KERNEL(blend_within)(b->disp + x, r->first[i], r->count[i]));

        for (int half = 0; half < 2; half++)
            w->half[half] = KERNEL(blend_select)(within, half, KERNEL(blend_set)(r->inside[i]), w->half[half]);
    }
}

/* W_s of a block: one label after the other. */
static inline struct KERNEL(blend_weights) KERNEL(blend_block_labels)(const struct sst_blend *b, size_t x)
{
    const struct sst_blend_range *r = &b->range[b->label[x]];
    BLEND_M of = KERNEL(blend_labelled)(b->label + x, b->label[x]);
    uint32_t left = BLEND_ALL & ~KERNEL(blend_bits)(of);
    struct KERNEL(blend_weights) w;

    if (r->ranges > SST_BLEND_RANGES || KERNEL(blend_bits)(KERNEL(blend_within)(b->disp + x, BLEND_UNKNOWN, 16)))
        return KERNEL(blend_label_table)(b, x);
    w.half[0] = w.half[1] = KERNEL(blend_set)(r->outside);
    KERNEL(blend_one_label)(&w, b, r, of, x);
    while (left) {
        const uint8_t label = b->label[x + (size_t)__builtin_ctz(left)];

        r = &b->range[label];
        of = KERNEL(blend_labelled)(b->label + x, label);
        if (r->ranges > SST_BLEND_RANGES)
            return KERNEL(blend_label_table)(b, x);
        for (int half = 0; half < 2; half++)
            w.half[half] = KERNEL(blend_select)(of, half, KERNEL(blend_set)(r->outside), w.half[half]);
        KERNEL(blend_one_label)(&w, b, r, of, x);
        left &= ~KERNEL(blend_bits)(of);
    }
    return w;
}

/* A W_s W_d of a block. */
static inline struct KERNEL(blend_weights) KERNEL(blend_block_weights)(const struct sst_blend *b, size_t x)
{
    const BLEND_F aperture = KERNEL(blend_set)(b->aperture), c1 = KERNEL(blend_set)(b->c1);
    struct KERNEL(blend_weights) w = { { aperture, aperture } };
    BLEND_M near;

    if (!b->disp)
        return w;
    if (b->label) {
        w = KERNEL(blend_block_labels)(b, x);
        for (int half = 0; half < 2; half++)
            w.half[half] = KERNEL(blend_mul)(aperture, w.half[half]);
    }
    near = KERNEL(blend_within)(b->disp + x, b->first, b->count);
    if (!KERNEL(blend_bits)(near)) {
        for (int half = 0; half < 2; half++)
            w.half[half] = KERNEL(blend_mul)(w.half[half], c1);
        return w;
    }
    for (int half = 0; half < 2; half++) {
        const BLEND_F disp = KERNEL(blend_disp)(b->disp + x + half * BLEND_HALF);
        const BLEND_F d = KERNEL(blend_sub)(KERNEL(blend_sub)(disp, KERNEL(blend_set)(b->focus_whole_q6)),
                                            KERNEL(blend_set)(b->focus_part_q6));
        const BLEND_F u = KERNEL(blend_mul)(KERNEL(blend_mul)(d, d), KERNEL(blend_set)(b->scale));
        const BLEND_F m = KERNEL(blend_add)(u, KERNEL(blend_set)(SST_EXP2_MAGIC));
        const BLEND_F r = KERNEL(blend_sub)(KERNEL(blend_sub)(m, KERNEL(blend_set)(SST_EXP2_MAGIC)), u);
        BLEND_F p = KERNEL(blend_set)(b->power[4]);

        for (int i = 3; i >= 0; i--)
            p = KERNEL(blend_add)(KERNEL(blend_mul)(p, r), KERNEL(blend_set)(b->power[i]));
        p = KERNEL(blend_select)(near, half, KERNEL(blend_scale)(p, m), KERNEL(blend_set)(0));
        w.half[half] = KERNEL(blend_mul)(w.half[half], KERNEL(blend_add)(p, c1));
    }
    return w;
}

/* No bits for the first `done` pixels, all for the others. */
static inline BLEND_I KERNEL(blend_undone)(size_t done, int half)
{
    static const int32_t mask[2 * BLEND_BLOCK] = {
#if BLEND_HALF == 16
        [BLEND_BLOCK + 16] = -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1,
#endif
        [BLEND_BLOCK] = -1,      -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1,
    };

    return KERNEL(blend_load_int)(mask + BLEND_BLOCK - done + half * BLEND_HALF);
}

static inline void KERNEL(blend_prefetch)(const struct sst_blend *next, size_t x)
{
    for (int c = 0; c < 3; c++)
        __builtin_prefetch(next->bottom[c] + x, 0, 2);
    if (next->disp) {
        __builtin_prefetch(next->disp + x, 0, 2);
        __builtin_prefetch(next->disp + x + 32, 0, 2);
    }
    if (next->label)
        __builtin_prefetch(next->label + x, 0, 2);
}

static inline void KERNEL(blend_increase)(float *at, BLEND_F by)
{
    KERNEL(blend_store)(at, KERNEL(blend_add)(KERNEL(blend_load)(at), by));
}

/* A block, without its first `done` pixels. */
static inline void KERNEL(blend_rays_block)(float *const acc[4], const struct sst_blend *b, size_t x,
                                            const struct KERNEL(blend_taps) *t, size_t done)
{
    const struct KERNEL(blend_weights) w = KERNEL(blend_block_weights)(b, x);

    for (int half = 0; half < 2; half++) {
        const BLEND_F of = done ? KERNEL(blend_mask)(w.half[half], KERNEL(blend_undone)(done, half)) : w.half[half];
        const size_t at = x + (size_t)half * BLEND_HALF;

        KERNEL(blend_increase)(acc[3] + at, of);
        for (int c = 0; c < 3; c++)
            KERNEL(blend_increase)(acc[c] + at,
                                   KERNEL(blend_mul)(of, KERNEL(blend_float)(KERNEL(blend_colours)(b, c, x, half, t))));
    }
}

static void KERNEL(blend_rays)(float *const acc[4], const struct sst_blend *b, size_t n)
{
    const struct KERNEL(blend_taps) t = KERNEL(blend_set_taps)(b);
    const struct sst_blend of = *b;
    float *const to[4] = { acc[0], acc[1], acc[2], acc[3] };
    size_t x = 0;

    if (n < BLEND_BLOCK) {
        KERNEL(blend_rays_parts)(acc, b, n);
        return;
    }
    for (; x + BLEND_BLOCK <= n; x += BLEND_BLOCK) {
        if (of.next && x % 64 == 0)
            KERNEL(blend_prefetch)(of.next, x);
        KERNEL(blend_rays_block)(to, &of, x, &t, 0);
    }
    if (x < n)
        KERNEL(blend_rays_block)(to, &of, n - BLEND_BLOCK, &t, x - (n - BLEND_BLOCK));
}

/* A block, without its first `done` pixels. */
static inline void KERNEL(blend_plain_block)(int32_t *const sum[3], float *count, const struct sst_blend *b, size_t x,
                                             const struct KERNEL(blend_taps) *t, size_t done)
{
    for (int half = 0; half < 2; half++) {
        const BLEND_I undone = done ? KERNEL(blend_undone)(done, half) : KERNEL(blend_int)(-1);
        const size_t at = x + (size_t)half * BLEND_HALF;
        const struct KERNEL(blend_taps) of = {
            done ? KERNEL(blend_and)(t->top, undone) : t->top,
            done ? KERNEL(blend_and)(t->bottom, undone) : t->bottom,
        };

        KERNEL(blend_increase)(count + at, KERNEL(blend_mask)(KERNEL(blend_set)(1), undone));
        for (int c = 0; c < 3; c++) {
            const BLEND_I was = KERNEL(blend_load_int)(sum[c] + at);
            const BLEND_I top = KERNEL(blend_dot)(was, KERNEL(blend_pairs)(b->top[c] + x, half), of.top);

            KERNEL(blend_store_int)(sum[c] + at,
                                    KERNEL(blend_dot)(top, KERNEL(blend_pairs)(b->bottom[c] + x, half), of.bottom));
        }
    }
}

static void KERNEL(blend_plain)(int32_t *const sum[3], float *count, const struct sst_blend *b, size_t n)
{
    const struct KERNEL(blend_taps) t = KERNEL(blend_set_taps)(b);
    const struct sst_blend of = *b;
    int32_t *const to[3] = { sum[0], sum[1], sum[2] };
    size_t x = 0;

    if (n < BLEND_BLOCK) {
        KERNEL(blend_plain_parts)(sum, count, b, n);
        return;
    }
    for (; x + BLEND_BLOCK <= n; x += BLEND_BLOCK) {
        if (of.next && x % 64 == 0)
            KERNEL(blend_prefetch)(of.next, x);
        KERNEL(blend_plain_block)(to, count, &of, x, &t, 0);
    }
    if (x < n)
        KERNEL(blend_plain_block)(to, count, &of, n - BLEND_BLOCK, &t, x - (n - BLEND_BLOCK));
}

static void KERNEL(blend_take)(uint8_t *const colour[3], float *weight, const struct sst_blend *b, size_t n)
{
    const struct KERNEL(blend_taps) t = KERNEL(blend_set_taps)(b);

    if (n < BLEND_BLOCK) {
        KERNEL(blend_take_parts)(colour, weight, b, n);
        return;
    }
    for (size_t x = 0; x < n; x += BLEND_BLOCK) {
        const size_t from = x + BLEND_BLOCK <= n ? x : n - BLEND_BLOCK;
        const struct KERNEL(blend_weights) w = KERNEL(blend_block_weights)(b, from);

        for (int half = 0; half < 2; half++) {
            const size_t at = from + (size_t)half * BLEND_HALF;

            KERNEL(blend_store)(weight + at, w.half[half]);
            for (int c = 0; c < 3; c++)
                KERNEL(blend_bytes)(colour[c] + at,
                                    KERNEL(blend_round)(KERNEL(blend_colours)(b, c, from, half, &t)));
        }
    }
}

#undef BLEND_HALF
#undef BLEND_BLOCK
#undef BLEND_I
#undef BLEND_F
#undef BLEND_M
#undef BLEND_ALL
#undef BLEND_UNKNOWN
