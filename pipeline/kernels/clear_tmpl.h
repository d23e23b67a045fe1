/* clear_land, clear_surface, clear_take, clear_blend. Positions of rays are nearly in line, so that AVX-512 gathers by
 * permuting a stretch of 64 pixels instead of loading one by one; without it the compiler's loops are the fastest. */

/* --- rays to the viewpoint --- */

#if defined(__AVX512VBMI__)
static inline __m512i KERNEL(clear_moved)(__m512i disp, float scale, float zero)
{
    const __m512 at = _mm512_add_ps(_mm512_mul_ps(_mm512_cvtepi32_ps(disp), _mm512_set1_ps(scale)), _mm512_set1_ps(zero));

    return _mm512_cvtps_epi32(_mm512_roundscale_ps(at, _MM_FROUND_TO_NEG_INF | _MM_FROUND_NO_EXC));
}

/* The rays of 16 pixels: those that move alike are stored at once. */
static inline void KERNEL(clear_land_16)(uint16_t *landed, size_t stride, const struct sst_clear_view *v, __m256i disp,
                                         __m128i state, int x, int y)
{
    const __m512i q = _mm512_cvtepu16_epi32(disp);
    const __m512i lane = _mm512_set_epi32(15, 14, 13, 12, 11, 10, 9, 8, 7, 6, 5, 4, 3, 2, 1, 0);
    const __m512i dx = KERNEL(clear_moved)(q, v->x_q6, v->x_0), dy = KERNEL(clear_moved)(q, v->y_q6, v->y_0);
    const __m512i to_x = _mm512_add_epi32(_mm512_add_epi32(dx, lane), _mm512_set1_epi32(x));
    const __m512i to_y = _mm512_add_epi32(dy, _mm512_set1_epi32(y));
    const __m256i level = _mm256_add_epi16(_mm256_srl_epi16(disp, _mm_cvtsi32_si128(v->coarse)), _mm256_set1_epi16(1));
    const __m256i kept = _mm256_srli_epi16(_mm256_cvtepu8_epi16(state), 1), ray = _mm256_or_si256(_mm256_slli_epi16(level, 1), kept);
    __mmask16 rays = _mm_test_epi8_mask(state, state);
    int32_t move_x[16], move_y[16];

    rays = _mm512_mask_cmplt_epu32_mask(rays, to_x, _mm512_set1_epi32(v->width));
    rays = _mm512_mask_cmplt_epu32_mask(rays, to_y, _mm512_set1_epi32(v->height));
    _mm512_storeu_si512(move_x, dx);
    _mm512_storeu_si512(move_y, dy);
    while (rays) {
        const int first = __builtin_ctz(rays);
        const __mmask16 alike =
            _mm512_mask_cmpeq_epi32_mask(_mm512_mask_cmpeq_epi32_mask(rays, dx, _mm512_set1_epi32(move_x[first])), dy,
                                         _mm512_set1_epi32(move_y[first]));
        uint16_t *to = landed + (ptrdiff_t)(y + move_y[first]) * (ptrdiff_t)stride + x + move_x[first];

        _mm256_mask_storeu_epi16(to, alike, _mm256_max_epu16(_mm256_maskz_loadu_epi16(alike, to), ray));
        rays &= (__mmask16)~alike;
    }
}

static void KERNEL(clear_land)(uint16_t *landed, size_t stride, const struct sst_clear_view *v, const uint16_t *disp,
                               const uint8_t *state, int y)
{
    for (int x = 0; x < v->width; x += 16) {
        const __mmask16 inside = (__mmask16)(v->width - x >= 16 ? 0xFFFF : (1 << (v->width - x)) - 1);
        const __m128i states = _mm_maskz_loadu_epi8(inside, state + x);

        if (_mm_test_epi8_mask(states, states))
            KERNEL(clear_land_16)(landed, stride, v, _mm256_maskz_loadu_epi16(inside, disp + x), states, x, y);
    }
}
#else
static void KERNEL(clear_land)(uint16_t *landed, size_t stride, const struct sst_clear_view *v, const uint16_t *disp,
                               const uint8_t *state, int y)
{
    const unsigned w = (unsigned)v->width, h = (unsigned)v->height;
    int dx[SST_CLEAR_BLOCK], dy[SST_CLEAR_BLOCK];

    for (int x0 = 0; x0 < v->width; x0 += SST_CLEAR_BLOCK) {
        const int n = v->width - x0 < SST_CLEAR_BLOCK ? v->width - x0 : SST_CLEAR_BLOCK;

        for (int i = 0; i < n; i++) {
            const float q = disp[x0 + i], at_x = q * v->x_q6 + v->x_0, at_y = q * v->y_q6 + v->y_0;
            const int whole_x = (int)at_x, whole_y = (int)at_y;

            dx[i] = whole_x - ((float)whole_x > at_x);
            dy[i] = whole_y - ((float)whole_y > at_y);
        }
        for (int i = 0; i < n; i++) {
            const unsigned to_x = (unsigned)(x0 + i + dx[i]), to_y = (unsigned)(y + dy[i]);
            const unsigned ray = 2U * (unsigned)(disp[x0 + i] >> v->coarse) + 2 + (state[x0 + i] == SST_CLEAR_KEPT);

            if (state[x0 + i] && to_x < w && to_y < h && landed[to_y * stride + to_x] < ray)
                landed[to_y * stride + to_x] = (uint16_t)ray;
        }
    }
}
#endif

/* --- surface --- */

typedef uint16_t KERNEL(clear_block) __attribute__((vector_size(2 * SST_CLEAR_BLOCK)));

/* a = max(a, b). By address: as values their ABI would depend on the level. */
static inline void KERNEL(clear_raise)(KERNEL(clear_block) * a, const KERNEL(clear_block) * b)
{
    const KERNEL(clear_block) of_a = (KERNEL(clear_block))(*a > *b);

    *a = (*a & of_a) | (*b & ~of_a);
}

static void KERNEL(clear_surface)(float *surface, const uint16_t *const *landed, size_t views)
{
    const KERNEL(clear_block) zero = { 0 }, two = zero + 2;
    KERNEL(clear_block) top = zero, needed = zero;

    for (size_t k = 0; k < views; k++) {
        KERNEL(clear_block) at;

        memcpy(&at, landed[k], sizeof(at));
        at >>= 1;
        KERNEL(clear_raise)(&top, &at);
        needed -= (KERNEL(clear_block))(at != 0);
    }
    needed = (needed + 3) >> 2;
    KERNEL(clear_raise)(&needed, &two);
    for (int i = 0; i < SST_CLEAR_BLOCK; i++)
        surface[i] = 0;
    for (;;) {
        /* behind: sum of distances from the nearest ray, at most SST_CLEAR_TOLERANCE each. */
        KERNEL(clear_block) count = zero, behind = zero, next = zero, found, left;
        unsigned any = 0;

        for (size_t k = 0; k < views; k++) {
            KERNEL(clear_block) at, distance, farther, of_it;

            memcpy(&at, landed[k], sizeof(at));
            at >>= 1;
            distance = top - at;
            farther = at & (KERNEL(clear_block))(at < top);
            of_it = (KERNEL(clear_block))(distance <= SST_CLEAR_TOLERANCE) & (KERNEL(clear_block))(at <= top) &
                    (KERNEL(clear_block))(at != 0);
            count -= of_it;
            behind += distance & of_it;
            KERNEL(clear_raise)(&next, &farther);
        }
        found = (KERNEL(clear_block))(count >= needed) & (KERNEL(clear_block))(top != 0);
        left = next & ~found;
        for (int i = 0; i < SST_CLEAR_BLOCK; i++) {
            const int sum = (int)count[i] * top[i] - behind[i];

            surface[i] = found[i] ? (float)sum / (float)count[i] : surface[i];
            any |= left[i];
        }
        if (!any)
            return;
        top = left;
    }
}

/* --- rays of a surface --- */

#if defined(__AVX512VBMI__)
/* Where the rays of 16 pixels come from. */
struct KERNEL(clear_lanes) {
    __m512i x0, y0;
    __m512i across, down; /* bilinear weights: bytes 64 - f, f, 64 - f, f of the columns, int16 64 - f, f of the rows */
};

/* Some of the rays, whose pixels lie on two rows and within 64 columns from `column`. */
struct KERNEL(clear_stretch) {
    __mmask16 rays;
    int column, row, next; /* next: the row below, or the same at the end of the picture */
    __mmask64 readable;
    __m512i index; /* bytes c, c + 1, c, c + 1 of each ray, c its column from `column` */
};

static inline __m512i KERNEL(clear_fraction)(__m512 x, __m512i x0)
{
    const __m512 f = _mm512_sub_ps(x, _mm512_cvtepi32_ps(x0));

    return _mm512_cvttps_epi32(_mm512_add_ps(_mm512_mul_ps(f, _mm512_set1_ps(64)), _mm512_set1_ps(0.5F)));
}

/* Which of the rays lie inside the view. */
static inline __mmask16 KERNEL(clear_lanes_init)(struct KERNEL(clear_lanes) * l, const struct sst_clear_view *v,
                                                 const float *px, int x, int y, __mmask16 rays)
{
    const __m512i lane = _mm512_set_epi32(15, 14, 13, 12, 11, 10, 9, 8, 7, 6, 5, 4, 3, 2, 1, 0);
    const __m512 disp = _mm512_loadu_ps(px), zero = _mm512_setzero_ps();
    const __m512 at_x = _mm512_sub_ps(_mm512_cvtepi32_ps(_mm512_add_epi32(lane, _mm512_set1_epi32(x))),
                                      _mm512_mul_ps(disp, _mm512_set1_ps(v->bx)));
    const __m512 at_y = _mm512_sub_ps(_mm512_set1_ps((float)y), _mm512_mul_ps(disp, _mm512_set1_ps(v->by)));
    const __m512i whole = _mm512_set1_epi32(64);
    __m512i f;

    l->x0 = _mm512_cvttps_epi32(at_x);
    l->y0 = _mm512_cvttps_epi32(at_y);
    f = KERNEL(clear_fraction)(at_x, l->x0);
    f = _mm512_or_si512(_mm512_sub_epi32(whole, f), _mm512_slli_epi32(f, 8));
    l->across = _mm512_or_si512(f, _mm512_slli_epi32(f, 16));
    f = KERNEL(clear_fraction)(at_y, l->y0);
    l->down = _mm512_or_si512(_mm512_sub_epi32(whole, f), _mm512_slli_epi32(f, 16));
    rays = _mm512_mask_cmp_ps_mask(rays, at_x, zero, _CMP_GE_OQ);
    rays = _mm512_mask_cmp_ps_mask(rays, at_y, zero, _CMP_GE_OQ);
    rays = _mm512_mask_cmp_ps_mask(rays, at_x, _mm512_set1_ps((float)(v->width - 1)), _CMP_LE_OQ);
    return _mm512_mask_cmp_ps_mask(rays, at_y, _mm512_set1_ps((float)(v->height - 1)), _CMP_LE_OQ);
}

/* The first of the rays, and those that lie near it. */
static inline void KERNEL(clear_next_stretch)(struct KERNEL(clear_stretch) * s, const struct sst_clear_view *v,
                                              const struct KERNEL(clear_lanes) * l, __mmask16 rays)
{
    __m512i at;
    int columns;

    s->row = _mm_cvtsi128_si32(_mm512_castsi512_si128(_mm512_maskz_compress_epi32(rays, l->y0)));
    s->column = _mm_cvtsi128_si32(_mm512_castsi512_si128(_mm512_maskz_compress_epi32(rays, l->x0))) - 16;
    s->column = s->column < 0 ? 0 : s->column;
    s->next = s->row + 1 < v->height ? s->row + 1 : s->row;
    columns = v->width - s->column;
    s->readable = columns >= 64 ? ~(__mmask64)0 : ((__mmask64)1 << columns) - 1;
    at = _mm512_sub_epi32(l->x0, _mm512_set1_epi32(s->column));
    s->rays = _mm512_mask_cmpeq_epi32_mask(rays, l->y0, _mm512_set1_epi32(s->row));
    s->rays = _mm512_mask_cmple_epu32_mask(s->rays, at, _mm512_set1_epi32(62));
    at = _mm512_or_si512(at, _mm512_slli_epi32(at, 8));
    at = _mm512_or_si512(at, _mm512_slli_epi32(at, 16));
    s->index = _mm512_add_epi32(at, _mm512_set1_epi32(0x01000100));
}

static inline __m512 KERNEL(clear_bilinear)(const uint8_t *plane, size_t stride, const struct KERNEL(clear_stretch) * s,
                                            const struct KERNEL(clear_lanes) * l)
{
    const __m512i top = _mm512_maskz_loadu_epi8(s->readable, plane + (size_t)s->row * stride + s->column);
    const __m512i bottom = _mm512_maskz_loadu_epi8(s->readable, plane + (size_t)s->next * stride + s->column);
    const __m512i pixels = _mm512_mask_permutexvar_epi8(_mm512_permutexvar_epi8(s->index, top), 0xCCCCCCCCCCCCCCCC,
                                                        s->index, bottom);
    const __m512i sum = _mm512_madd_epi16(_mm512_maddubs_epi16(pixels, l->across), l->down);

    return _mm512_mul_ps(_mm512_cvtepi32_ps(sum), _mm512_set1_ps(1.0F / 4096));
}

/* Colours of the rays of 16 pixels, the i-th ones of the block. Returns which of them lie inside the view. */
static inline __mmask16 KERNEL(clear_take_16)(const struct sst_clear_rays *rays, const struct sst_clear_view *v, int x,
                                              int y, int i, __mmask16 seen)
{
    __m512 colour[3] = { _mm512_setzero_ps(), _mm512_setzero_ps(), _mm512_setzero_ps() };
    struct KERNEL(clear_lanes) l;
    __mmask16 left;

    if (seen)
        seen = KERNEL(clear_lanes_init)(&l, v, rays->px + i, x + i, y, seen);
    left = v->plane[0] ? seen : 0;
    while (left) {
        struct KERNEL(clear_stretch) s;

        KERNEL(clear_next_stretch)(&s, v, &l, left);
        left &= (__mmask16)~s.rays;
        for (int c = 0; c < 3; c++)
            colour[c] = _mm512_mask_blend_ps(s.rays, colour[c], KERNEL(clear_bilinear)(v->plane[c], v->stride, &s, &l));
    }
    for (int c = 0; c < 3; c++)
        _mm512_storeu_ps(rays->colour[c][rays->slots] + i, colour[c]);
    return seen;
}

static int KERNEL(clear_take)(struct sst_clear_rays *rays, const struct sst_clear_view *v, const uint16_t *landed,
                              int x, int y)
{
    const __m512i at = _mm512_loadu_si512(landed), level = _mm512_srli_epi16(at, 1);
    const __m512i wanted = _mm512_loadu_si512(rays->wanted), one = _mm512_set1_epi16(1);
    __mmask32 seen = _mm512_cmpge_epu16_mask(level, _mm512_loadu_si512(rays->first)), kept;
    __m512i left;
    float *weight;

    seen = _mm512_mask_cmple_epu16_mask(seen, level, _mm512_loadu_si512(rays->last));
    seen = _mm512_mask_cmpgt_epi16_mask(seen, wanted, _mm512_setzero_si512());
    if (!seen)
        return _mm512_cmpgt_epi16_mask(wanted, _mm512_setzero_si512()) != 0;
    seen = KERNEL(clear_take_16)(rays, v, x, y, 0, (__mmask16)seen) |
           (__mmask32)KERNEL(clear_take_16)(rays, v, x, y, 16, (__mmask16)(seen >> 16)) << 16;
    kept = _mm512_mask_test_epi16_mask(seen, at, one);
    weight = rays->weight[rays->slots];
    for (int i = 0; i < SST_CLEAR_BLOCK; i += 16) {
        const __m512 rim = _mm512_maskz_mov_ps((__mmask16)(seen >> i), _mm512_set1_ps(SST_CLEAR_RIM));

        _mm512_storeu_ps(weight + i, _mm512_mask_blend_ps((__mmask16)(kept >> i), rim, _mm512_set1_ps(1)));
    }
    rays->slots += seen != 0;
    left = _mm512_mask_sub_epi16(wanted, kept, wanted, one);
    _mm512_storeu_si512(rays->wanted, left);
    return _mm512_cmpgt_epi16_mask(left, _mm512_setzero_si512()) != 0;
}
#else
static int KERNEL(clear_take)(struct sst_clear_rays *rays, const struct sst_clear_view *v, const uint16_t *landed,
                              int x, int y)
{
    return sst_clear_take_ref(rays, v, landed, x, y);
}
#endif

/* --- colour --- */

static inline void KERNEL(clear_mean)(float colour[3][SST_CLEAR_BLOCK], const struct sst_clear_rays *rays)
{
    float sum[4][SST_CLEAR_BLOCK] = { { 0 } };

    for (int k = 0; k < rays->slots; k++) {
        const float *restrict weight = rays->weight[k], *restrict agree = rays->agree[k];
        const float *restrict r = rays->colour[0][k], *restrict g = rays->colour[1][k], *restrict b = rays->colour[2][k];

        for (int i = 0; i < SST_CLEAR_BLOCK; i++) {
            const float w = weight[i] * agree[i];

            sum[0][i] += w * r[i];
            sum[1][i] += w * g[i];
            sum[2][i] += w * b[i];
            sum[3][i] += w;
        }
    }
    for (int c = 0; c < 3; c++)
        for (int i = 0; i < SST_CLEAR_BLOCK; i++)
            colour[c][i] = sum[3][i] > 0 ? sum[c][i] / (sum[3][i] > 0 ? sum[3][i] : 1) : 0;
}

static inline void KERNEL(clear_deviation)(float *restrict out, const struct sst_clear_rays *rays, int k,
                                           float colour[3][SST_CLEAR_BLOCK])
{
    const float *restrict r = rays->colour[0][k], *restrict g = rays->colour[1][k], *restrict b = rays->colour[2][k];

    for (int i = 0; i < SST_CLEAR_BLOCK; i++)
        out[i] = fabsf(r[i] - colour[0][i]) + fabsf(g[i] - colour[1][i]) + fabsf(b[i] - colour[2][i]);
}

/* 1 where a ray deviates by more than 4 levels. */
static inline int KERNEL(clear_differ)(int32_t *restrict differ, const struct sst_clear_rays *rays,
                                       float colour[3][SST_CLEAR_BLOCK])
{
    float largest[SST_CLEAR_BLOCK] = { 0 }, off[SST_CLEAR_BLOCK];
    int any = 0;

    for (int k = 0; k < rays->slots; k++) {
        const float *restrict weight = rays->weight[k];

        KERNEL(clear_deviation)(off, rays, k, colour);
        for (int i = 0; i < SST_CLEAR_BLOCK; i++) {
            const float of_ray = weight[i] > 0 ? off[i] : 0;

            largest[i] = of_ray > largest[i] ? of_ray : largest[i];
        }
    }
    for (int i = 0; i < SST_CLEAR_BLOCK; i++)
        differ[i] = largest[i] > 3 * 4;
    for (int i = 0; i < SST_CLEAR_BLOCK; i++)
        any |= differ[i];
    return any;
}

/* Agreement with a colour by a deviation of half the weight; 1 where no ray differs. */
static inline void KERNEL(clear_agree)(const struct sst_clear_rays *rays, float colour[3][SST_CLEAR_BLOCK],
                                       const int32_t *restrict differ, float half_weight)
{
    const float scale = 1 / (3 * half_weight);
    float off[SST_CLEAR_BLOCK];

    for (int k = 0; k < rays->slots; k++) {
        float *restrict agree = rays->agree[k];

        KERNEL(clear_deviation)(off, rays, k, colour);
        for (int i = 0; i < SST_CLEAR_BLOCK; i++) {
            const float t = off[i] * scale, t2 = t * t, of_ray = 1 / (1 + t2 * t2);

            agree[i] = differ[i] ? of_ray : 1;
        }
    }
}

static void KERNEL(clear_blend)(struct sst_clear_colours *out, const struct sst_clear_rays *rays, int own)
{
    int32_t differ[SST_CLEAR_BLOCK];
    float off[SST_CLEAR_BLOCK];

    for (int k = 0; k < rays->slots; k++)
        for (int i = 0; i < SST_CLEAR_BLOCK; i++)
            rays->agree[k][i] = 1;
    KERNEL(clear_mean)(out->colour, rays);
    if (KERNEL(clear_differ)(differ, rays, out->colour)) {
        KERNEL(clear_agree)(rays, out->colour, differ, 20);
        KERNEL(clear_mean)(out->colour, rays);
        KERNEL(clear_agree)(rays, out->colour, differ, 10);
        KERNEL(clear_mean)(out->colour, rays);
    }
    memset(out->weight, 0, sizeof(out->weight));
    memset(out->support, 0, sizeof(out->support));
    memset(out->own, 0, sizeof(out->own));
    for (int k = 0; k < rays->slots; k++) {
        const float *restrict weight = rays->weight[k], *restrict agree = rays->agree[k];

        for (int i = 0; i < SST_CLEAR_BLOCK; i++) {
            out->weight[i] += weight[i];
            out->support[i] += weight[i] * agree[i];
        }
    }
    if (own < 0)
        return;
    KERNEL(clear_deviation)(off, rays, own, out->colour);
    for (int i = 0; i < SST_CLEAR_BLOCK; i++) {
        const float share = 2 - off[i] / (3 * 10), most = share < 1 ? share : 1;

        out->own[i] = rays->weight[own][i] >= 1 ? (most > 0 ? most : 0) : 0;
    }
    for (int c = 0; c < 3; c++)
        for (int i = 0; i < SST_CLEAR_BLOCK; i++)
            out->colour[c][i] += out->own[i] * (rays->colour[c][own][i] - out->colour[c][i]);
}
