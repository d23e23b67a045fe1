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
                                         __mmask16 rays, int x, int y)
{
    const __m512i q = _mm512_cvtepu16_epi32(disp), lane = _mm512_set_epi32(15, 14, 13, 12, 11, 10, 9, 8, 7, 6, 5, 4, 3, 2, 1, 0);
    const __m512i dx = KERNEL(clear_moved)(q, v->x_q6, v->x_0), dy = KERNEL(clear_moved)(q, v->y_q6, v->y_0);
    const __m512i to_x = _mm512_add_epi32(_mm512_add_epi32(dx, lane), _mm512_set1_epi32(x));
    const __m512i to_y = _mm512_add_epi32(dy, _mm512_set1_epi32(y));
    const __m256i stored = _mm256_add_epi16(disp, _mm256_set1_epi16(1));
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

        _mm256_mask_storeu_epi16(to, alike, _mm256_max_epu16(_mm256_maskz_loadu_epi16(alike, to), stored));
        rays &= (__mmask16)~alike;
    }
}

static void KERNEL(clear_land)(uint16_t *landed, size_t stride, const struct sst_clear_view *v, int y)
{
    const uint16_t *disp = v->disp + (size_t)y * v->disp_stride;
    const uint8_t *state = v->state + (size_t)y * (size_t)v->width;

    for (int x = 0; x < v->width; x += 16) {
        const __mmask16 inside = (__mmask16)(v->width - x >= 16 ? 0xFFFF : (1 << (v->width - x)) - 1);
        const __m128i kept = _mm_maskz_loadu_epi8(inside, state + x);
        const __mmask16 rays = _mm_test_epi8_mask(kept, kept);

        if (rays)
            KERNEL(clear_land_16)(landed, stride, v, _mm256_maskz_loadu_epi16(inside, disp + x), rays, x, y);
    }
}
#else
static void KERNEL(clear_land)(uint16_t *landed, size_t stride, const struct sst_clear_view *v, int y)
{
    const uint16_t *disp = v->disp + (size_t)y * v->disp_stride;
    const uint8_t *state = v->state + (size_t)y * (size_t)v->width;
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
            const uint16_t stored = (uint16_t)(disp[x0 + i] + 1);

            if (state[x0 + i] && to_x < w && to_y < h && landed[to_y * stride + to_x] < stored)
                landed[to_y * stride + to_x] = stored;
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
        KERNEL(clear_raise)(&top, &at);
        needed -= (KERNEL(clear_block))(at != 0);
    }
    needed = (needed + 3) >> 2;
    KERNEL(clear_raise)(&needed, &two);
    for (int i = 0; i < SST_CLEAR_BLOCK; i++)
        surface[i] = -1;
    for (;;) {
        /* behind: sum of distances from the nearest ray, at most SST_CLEAR_TOLERANCE each. */
        KERNEL(clear_block) count = zero, behind = zero, next = zero, found, left;
        unsigned any = 0;

        for (size_t k = 0; k < views; k++) {
            KERNEL(clear_block) at, distance, farther, of_it;

            memcpy(&at, landed[k], sizeof(at));
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

            surface[i] = found[i] ? (float)sum / (float)count[i] - 1 : surface[i];
            any |= left[i];
        }
        if (!any)
            return;
        top = left;
    }
}

/* --- rays of a surface --- */

#if defined(__AVX512VBMI__)
/* Where the rays of 16 pixels come from, and what has been found of them. */
struct KERNEL(clear_lanes) {
    __m512 x, y, surface;
    __m512i x0, y0, nx, ny;
    __m512i across, down; /* bilinear weights: bytes 64 - f, f, 64 - f, f of the columns, int16 of the rows */
};

/* Some of the rays, whose pixels lie on two rows and within 64 columns from `column`. */
struct KERNEL(clear_stretch) {
    __mmask16 rays;
    int column, row, next; /* next: the row below, or the same at the end of the picture */
    __mmask64 readable;
};

/* Bytes (x, x + 1) of the upper and of the lower row for each ray, as the four bytes of a lane. */
static inline __m512i KERNEL(clear_pixels)(const uint8_t *plane, size_t stride, const struct KERNEL(clear_stretch) * s,
                                           __m512i index)
{
    const __m512i top = _mm512_maskz_loadu_epi8(s->readable, plane + (size_t)s->row * stride + s->column);
    const __m512i bottom = _mm512_maskz_loadu_epi8(s->readable, plane + (size_t)s->next * stride + s->column);

    return _mm512_mask_permutexvar_epi8(_mm512_permutexvar_epi8(index, top), 0xCCCCCCCCCCCCCCCC, index, bottom);
}

static inline __m512i KERNEL(clear_disparities)(const uint16_t *row, const struct KERNEL(clear_stretch) * s, __m512i index)
{
    const __m512i near = _mm512_maskz_loadu_epi16((__mmask32)s->readable, row + s->column);
    const __m512i far = _mm512_maskz_loadu_epi16((__mmask32)(s->readable >> 32), row + s->column + 32);

    return _mm512_and_si512(_mm512_permutex2var_epi16(near, index, far), _mm512_set1_epi32(0xFFFF));
}

/* Which of the rays of a stretch see the surface; *whole: those of full weight. */
static inline __mmask16 KERNEL(clear_sees)(const struct sst_clear_view *v, const struct KERNEL(clear_stretch) * s,
                                           const struct KERNEL(clear_lanes) * l, __mmask16 *whole)
{
    const __m512i index = _mm512_sub_epi32(l->nx, _mm512_set1_epi32(s->column));
    const __mmask16 lower = _mm512_cmpneq_epi32_mask(l->ny, _mm512_set1_epi32(s->row));
    const size_t w = (size_t)v->width;
    const __m512i state_top = _mm512_maskz_loadu_epi8(s->readable, v->state + (size_t)s->row * w + s->column);
    const __m512i state_bottom = _mm512_maskz_loadu_epi8(s->readable, v->state + (size_t)s->next * w + s->column);
    const __m512i state = _mm512_and_si512(_mm512_mask_blend_epi32(lower, _mm512_permutexvar_epi8(index, state_top),
                                                                   _mm512_permutexvar_epi8(index, state_bottom)),
                                           _mm512_set1_epi32(0xFF));
    const uint16_t *row = v->disp + (size_t)s->row * v->disp_stride, *next = v->disp + (size_t)s->next * v->disp_stride;
    const __m512i disp =
        _mm512_mask_blend_epi32(lower, KERNEL(clear_disparities)(row, s, index), KERNEL(clear_disparities)(next, s, index));
    const __m512 off = _mm512_abs_ps(_mm512_sub_ps(_mm512_cvtepi32_ps(disp), l->surface));
    const __mmask16 seen = _mm512_mask_cmp_ps_mask(_mm512_mask_cmpneq_epi32_mask(s->rays, state, _mm512_setzero_si512()),
                                                   off, _mm512_set1_ps(SST_CLEAR_TOLERANCE), _CMP_LE_OQ);

    *whole = _mm512_mask_cmpeq_epi32_mask(seen, state, _mm512_set1_epi32(SST_CLEAR_KEPT));
    return seen;
}

static inline __m512 KERNEL(clear_bilinear)(const uint8_t *plane, size_t stride, const struct KERNEL(clear_stretch) * s,
                                            const struct KERNEL(clear_lanes) * l, __m512i index)
{
    const __m512i pixels = KERNEL(clear_pixels)(plane, stride, s, index);
    const __m512i sum = _mm512_madd_epi16(_mm512_maddubs_epi16(pixels, l->across), l->down);

    return _mm512_mul_ps(_mm512_cvtepi32_ps(sum), _mm512_set1_ps(1.0F / 4096));
}

static inline struct KERNEL(clear_stretch)
    KERNEL(clear_next_stretch)(const struct sst_clear_view *v, const struct KERNEL(clear_lanes) * l, __mmask16 rays)
{
    struct KERNEL(clear_stretch) s;
    int columns;

    s.row = _mm_cvtsi128_si32(_mm512_castsi512_si128(_mm512_maskz_compress_epi32(rays, l->y0)));
    s.column = _mm_cvtsi128_si32(_mm512_castsi512_si128(_mm512_maskz_compress_epi32(rays, l->x0))) - 16;
    s.column = s.column < 0 ? 0 : s.column;
    s.next = s.row + 1 < v->height ? s.row + 1 : s.row;
    columns = v->width - s.column;
    s.readable = columns >= 64 ? ~(__mmask64)0 : ((__mmask64)1 << columns) - 1;
    s.rays = _mm512_mask_cmpeq_epi32_mask(rays, l->y0, _mm512_set1_epi32(s.row));
    s.rays = _mm512_mask_cmple_epu32_mask(s.rays, _mm512_sub_epi32(l->x0, _mm512_set1_epi32(s.column)),
                                          _mm512_set1_epi32(62));
    return s;
}

static inline __m512i KERNEL(clear_fraction)(__m512 x, __m512i x0)
{
    const __m512 f = _mm512_sub_ps(x, _mm512_cvtepi32_ps(x0));

    return _mm512_cvttps_epi32(_mm512_add_ps(_mm512_mul_ps(f, _mm512_set1_ps(64)), _mm512_set1_ps(0.5F)));
}

static inline void KERNEL(clear_lanes_init)(struct KERNEL(clear_lanes) * l)
{
    const __m512 half = _mm512_set1_ps(0.5F);
    const __m512i whole = _mm512_set1_epi32(64);
    __m512i f;

    l->x0 = _mm512_cvttps_epi32(l->x);
    l->y0 = _mm512_cvttps_epi32(l->y);
    l->nx = _mm512_cvttps_epi32(_mm512_add_ps(l->x, half));
    l->ny = _mm512_cvttps_epi32(_mm512_add_ps(l->y, half));
    f = KERNEL(clear_fraction)(l->x, l->x0);
    f = _mm512_or_si512(_mm512_sub_epi32(whole, f), _mm512_slli_epi32(f, 8));
    l->across = _mm512_or_si512(f, _mm512_slli_epi32(f, 16));
    f = KERNEL(clear_fraction)(l->y, l->y0);
    l->down = _mm512_or_si512(_mm512_sub_epi32(whole, f), _mm512_slli_epi32(f, 16));
}

/* The i-th to the i+15th pixels of a block. Returns which have a ray. */
static inline __mmask16 KERNEL(clear_take_16)(struct sst_clear_rays *rays, const struct sst_clear_view *v, int x, int y,
                                              int i, __mmask16 pixels)
{
    const __m512i lane = _mm512_set_epi32(15, 14, 13, 12, 11, 10, 9, 8, 7, 6, 5, 4, 3, 2, 1, 0);
    const __m512 zero = _mm512_setzero_ps(), px = _mm512_loadu_ps(rays->px + i);
    const __m512i wanted = _mm512_loadu_si512(rays->wanted + i);
    __m512 colour[3] = { zero, zero, zero };
    __mmask16 left, taken = 0, full = 0;
    struct KERNEL(clear_lanes) l;

    l.surface = _mm512_loadu_ps(rays->surface + i);
    left = _mm512_mask_cmp_ps_mask(pixels, l.surface, zero, _CMP_GE_OQ);
    left = _mm512_mask_cmpgt_epi32_mask(left, wanted, _mm512_setzero_si512());
    l.x = _mm512_sub_ps(_mm512_cvtepi32_ps(_mm512_add_epi32(lane, _mm512_set1_epi32(x + i))),
                        _mm512_mul_ps(px, _mm512_set1_ps(v->bx)));
    l.y = _mm512_sub_ps(_mm512_set1_ps((float)y), _mm512_mul_ps(px, _mm512_set1_ps(v->by)));
    left = _mm512_mask_cmp_ps_mask(left, l.x, zero, _CMP_GE_OQ);
    left = _mm512_mask_cmp_ps_mask(left, l.y, zero, _CMP_GE_OQ);
    left = _mm512_mask_cmp_ps_mask(left, l.x, _mm512_set1_ps((float)(v->width - 1)), _CMP_LE_OQ);
    left = _mm512_mask_cmp_ps_mask(left, l.y, _mm512_set1_ps((float)(v->height - 1)), _CMP_LE_OQ);
    if (left)
        KERNEL(clear_lanes_init)(&l);
    while (left) {
        const struct KERNEL(clear_stretch) s = KERNEL(clear_next_stretch)(v, &l, left);
        __mmask16 whole;
        const __mmask16 seen = KERNEL(clear_sees)(v, &s, &l, &whole);

        left &= (__mmask16)~s.rays;
        taken |= seen;
        full |= whole;
        if (seen) {
            const __m512i at = _mm512_sub_epi32(l.x0, _mm512_set1_epi32(s.column));
            const __m512i index = _mm512_add_epi32(_mm512_mullo_epi32(at, _mm512_set1_epi32(0x01010101)),
                                                   _mm512_set1_epi32(0x01000100));

            for (int c = 0; c < 3 && v->plane[c]; c++)
                colour[c] = _mm512_mask_blend_ps(seen, colour[c],
                                                 KERNEL(clear_bilinear)(v->plane[c], v->stride, &s, &l, index));
        }
    }
    _mm512_storeu_ps(rays->weight[rays->slots] + i,
                     _mm512_mask_blend_ps(full, _mm512_maskz_mov_ps(taken, _mm512_set1_ps(SST_CLEAR_RIM)),
                                          _mm512_set1_ps(1)));
    for (int c = 0; c < 3; c++)
        _mm512_storeu_ps(rays->colour[c][rays->slots] + i, colour[c]);
    _mm512_storeu_si512(rays->wanted + i, _mm512_mask_sub_epi32(wanted, full, wanted, _mm512_set1_epi32(1)));
    return taken;
}

static int KERNEL(clear_take)(struct sst_clear_rays *rays, const struct sst_clear_view *v, int x, int y, int n)
{
    const uint32_t pixels = n >= SST_CLEAR_BLOCK ? 0xFFFFFFFF : (1U << n) - 1;
    int any = 0, more = 0;

    for (int i = 0; i < SST_CLEAR_BLOCK; i += 16)
        any |= KERNEL(clear_take_16)(rays, v, x, y, i, (__mmask16)(pixels >> i));
    rays->slots += any != 0;
    for (int i = 0; i < SST_CLEAR_BLOCK; i += 16) {
        const __mmask16 wanted =
            _mm512_cmpgt_epi32_mask(_mm512_loadu_si512(rays->wanted + i), _mm512_setzero_si512());

        more |= _mm512_mask_cmp_ps_mask(wanted & (__mmask16)(pixels >> i), _mm512_loadu_ps(rays->surface + i),
                                        _mm512_setzero_ps(), _CMP_GE_OQ);
    }
    return more != 0;
}
#else
static int KERNEL(clear_take)(struct sst_clear_rays *rays, const struct sst_clear_view *v, int x, int y, int n)
{
    return sst_clear_take_ref(rays, v, x, y, n);
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
