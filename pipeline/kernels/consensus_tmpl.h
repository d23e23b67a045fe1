/* The plane sweep in scene space: bytes of as many pixels as a vector has. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/kernels/consensus.h"
#include "pipeline/kernels/simd.h"

static void KERNEL(colour_step_row)(uint8_t *restrict step, const uint8_t *const a[3], const uint8_t *const b[3],
                                    size_t n)
{
    size_t i = 0;

    for (; i + SIMD_BYTES <= n; i += SIMD_BYTES) {
        simd_u8 most = { 0 };

        for (int c = 0; c < 3; c++)
            most = simd_max_u8(simd_apart_u8(simd_load_u8(a[c] + i), simd_load_u8(b[c] + i)), most);
        simd_store_u8(step + i, most);
    }
    sst_colour_step_row_ref(step + i, (const uint8_t *const[]){ a[0] + i, a[1] + i, a[2] + i },
                            (const uint8_t *const[]){ b[0] + i, b[1] + i, b[2] + i }, n - i);
}

/* Bytes of the reciprocals, lower ones first. */
static inline void KERNEL(consensus_reciprocals)(uint8_t table[2][64])
{
    for (unsigned n = 0; n < 64; n++) {
        table[0][n] = (uint8_t)sst_consensus_reciprocal(n);
        table[1][n] = (uint8_t)(sst_consensus_reciprocal(n) >> 8);
    }
}

struct KERNEL(consensus_sum) {
    simd_u16 half[2];
};

static inline void KERNEL(consensus_add)(struct KERNEL(consensus_sum) * s, simd_u8 v)
{
    s->half[0] += simd_widen(v, 0);
    s->half[1] += simd_widen(v, 1);
}

/* Reciprocals of counts below 64. */
static inline void KERNEL(consensus_invert)(simd_u16 q[2], simd_u8 n, uint8_t table[2][64])
{
    const simd_u8 low = simd_look_u8(table[0], n), high = simd_look_u8(table[1], n);

    for (int i = 0; i < 2; i++)
        q[i] = simd_widen(low, i) | simd_widen(high, i) << 8;
}

/* Sums divided by counts; below 256. */
static inline void KERNEL(consensus_divide)(simd_u8 *out, const struct KERNEL(consensus_sum) * s, int sums, simd_u8 n,
                                            uint8_t table[2][64])
{
    simd_u16 q[2];

    KERNEL(consensus_invert)(q, n, table);
    for (int c = 0; c < sums; c++)
        out[c] = simd_narrow(simd_high_u16(s[c].half[0], q[0]), simd_high_u16(s[c].half[1], q[1]));
}

static inline simd_u8 KERNEL(consensus_apart)(const struct sst_consensus_view *v, size_t x, const simd_u8 colour[3])
{
    const simd_u8 sum = simd_more_u8(simd_apart_u8(simd_load_u8(v->colour[0] + x), colour[0]),
                                     simd_apart_u8(simd_load_u8(v->colour[1] + x), colour[1]));

    return simd_more_u8(sum, simd_apart_u8(simd_load_u8(v->colour[2] + x), colour[2]));
}

/* Sums of the colours of a mask's pixels, and how many. */
static inline void KERNEL(consensus_gather)(struct KERNEL(consensus_sum) sum[3], simd_u8 *n,
                                            const struct sst_consensus_view *v, size_t x, simd_u8 mask)
{
    *n -= mask;
    for (int c = 0; c < 3; c++)
        KERNEL(consensus_add)(&sum[c], simd_load_u8(v->colour[c] + x) & mask);
}

static inline void KERNEL(consensus_replace)(simd_u8 colour[3], const struct KERNEL(consensus_sum) sum[3], simd_u8 n,
                                             uint8_t table[2][64])
{
    const simd_u8 none = (simd_u8)(n == 0);
    simd_u8 mean[3];

    KERNEL(consensus_divide)(mean, sum, 3, n, table);
    for (int c = 0; c < 3; c++)
        colour[c] = (colour[c] & none) | (mean[c] & ~none);
}

/* Nearness of a view to two colours, at most `there` (SST_CONSENSUS_REACH); 0 where the view does not see. */
static inline void KERNEL(consensus_near)(simd_u8 near[2], const struct sst_consensus_view *v, size_t x,
                                          const simd_u8 colour[2][3], const simd_u8 there[2])
{
    const simd_u8 seen = simd_load_u8(v->seen + x);

    near[0] = seen & there[0];
    near[1] = seen & there[1];
#pragma GCC unroll 3
    for (int c = 0; c < 3; c++) {
        const simd_u8 own = simd_load_u8(v->colour[c] + x);

        near[0] = simd_less_u8(near[0], simd_apart_u8(own, colour[0][c]));
        near[1] = simd_less_u8(near[1], simd_apart_u8(own, colour[1][c]));
    }
}

/* Densities of views around two colours: means of four views each, added. */
static inline void KERNEL(consensus_density)(simd_u8 sum[2], const struct sst_consensus_view *view, int views, size_t x,
                                             const simd_u8 colour[2][3])
{
    static const uint8_t unseen[SST_CONSENSUS_BLOCK];
    const struct sst_consensus_view none = { { unseen, unseen, unseen }, unseen, NULL };
    const simd_u8 there[2] = { simd_set_u8(SST_CONSENSUS_REACH), simd_set_u8(SST_CONSENSUS_REACH) };

    sum[0] = sum[1] = (simd_u8){ 0 };
    for (int k = 0; k < views; k += 4) {
        simd_u8 near[4][2];

#pragma GCC unroll 4
        for (int i = 0; i < 4; i++)
            KERNEL(consensus_near)(near[i], k + i < views ? &view[k + i] : &none, x, colour, there);
#pragma GCC unroll 2
        for (int s = 0; s < 2; s++)
            sum[s] += simd_mean_u8(simd_mean_u8(near[0][s], near[1][s]), simd_mean_u8(near[2][s], near[3][s]));
    }
}

/* Sums of nearness of each seed to all seeds: each pair is compared once. */
static inline void KERNEL(consensus_compare)(simd_u8 *score, const struct sst_consensus_view *view, int seeds, size_t x)
{
    for (int s = 0; s < seeds; s++)
        score[s] = simd_load_u8(view[s].seen + x) & SST_CONSENSUS_REACH;
    for (int s = 0; s + 1 < seeds; s += 2) {
        simd_u8 colour[2][3], there[2], near[2];

        for (int i = 0; i < 2; i++) {
            there[i] = simd_load_u8(view[s + i].seen + x) & SST_CONSENSUS_REACH;
            for (int c = 0; c < 3; c++)
                colour[i][c] = simd_load_u8(view[s + i].colour[c] + x);
        }
        KERNEL(consensus_near)(near, &view[s + 1], x, colour, there);
        score[s] = simd_more_u8(score[s], near[0]);
        score[s + 1] = simd_more_u8(score[s + 1], near[0]);
        for (int k = s + 2; k < seeds; k++) {
            KERNEL(consensus_near)(near, &view[k], x, colour, there);
            score[s] = simd_more_u8(score[s], near[0]);
            score[s + 1] = simd_more_u8(score[s + 1], near[1]);
            score[k] = simd_more_u8(simd_more_u8(score[k], near[0]), near[1]);
        }
    }
}

static inline void KERNEL(consensus_start)(simd_u8 colour[3], const struct sst_consensus_view *view, int views,
                                           size_t x)
{
    const int seeds = views < SST_CONSENSUS_SEEDS ? views : SST_CONSENSUS_SEEDS;
    simd_u8 score[SST_CONSENSUS_SEEDS], best = { 0 };

    KERNEL(consensus_compare)(score, view, seeds, x);
    colour[0] = colour[1] = colour[2] = best;
    for (int s = 0; s < seeds; s += 2) {
        const int of[2] = { s, s + (s + 1 < seeds) };
        simd_u8 seed[2][3], sum[2];

        for (int i = 0; i < 2; i++) {
            for (int c = 0; c < 3; c++)
                seed[i][c] = simd_load_u8(view[of[i]].colour[c] + x);
        }
        KERNEL(consensus_density)(sum, view + seeds, views - seeds, x, seed);
        for (int i = 0; i < 2; i++) {
            const simd_u8 all = sum[i] + (score[of[i]] >> 2), own = all & simd_load_u8(view[of[i]].seen + x);
            const simd_u8 more = (simd_u8)(own > best);

            best = simd_max_u8(own, best);
            for (int c = 0; c < 3; c++)
                colour[c] = (colour[c] & ~more) | (seed[i][c] & more);
        }
    }
}

/* Density of the views around a colour. */
static inline simd_u8 KERNEL(consensus_dense)(const struct sst_consensus_view *view, int views, size_t x,
                                              const simd_u8 colour[3])
{
    simd_u8 sum = { 0 };

    for (int k = 0; k < views; k += 4) {
        simd_u8 near[4] = { { 0 } };

#pragma GCC unroll 4
        for (int i = 0; i < 4; i++) {
            if (k + i < views) {
                near[i] = simd_load_u8(view[k + i].seen + x) & SST_CONSENSUS_REACH;
                for (int c = 0; c < 3; c++)
                    near[i] = simd_less_u8(near[i], simd_apart_u8(simd_load_u8(view[k + i].colour[c] + x), colour[c]));
            }
        }
        sum += simd_mean_u8(simd_mean_u8(near[0], near[1]), simd_mean_u8(near[2], near[3]));
    }
    return sum;
}

static void KERNEL(consensus_first)(uint8_t *const out[4], const struct sst_consensus_view *view, int views)
{
    uint8_t table[2][64];

    KERNEL(consensus_reciprocals)(table);
    for (size_t x = 0; x < SST_CONSENSUS_BLOCK; x += SIMD_BYTES) {
        struct KERNEL(consensus_sum) sum[3] = { 0 }, dense = { 0 };
        simd_u8 colour[3], n = { 0 }, seen = { 0 };
        simd_u16 q[2];

        KERNEL(consensus_start)(colour, view, views, x);
        for (int k = 0; k < views; k++) {
            const simd_u8 there = simd_load_u8(view[k].seen + x);

            seen -= there;
            KERNEL(consensus_gather)
            (sum, &n, &view[k], x,
             (simd_u8)(KERNEL(consensus_apart)(&view[k], x, colour) <= SST_CONSENSUS_NEAR) & there);
        }
        KERNEL(consensus_replace)(colour, sum, n, table);
        KERNEL(consensus_add)(&dense, KERNEL(consensus_dense)(view, views, x, colour));
        KERNEL(consensus_invert)(q, seen + SST_CONSENSUS_LEAST, table);
        for (int i = 0; i < 2; i++)
            dense.half[i] = simd_less_u16((simd_u16){ 0 } + SST_CONSENSUS_SPARE,
                                          simd_high_u16(dense.half[i] * 36, q[i]) * SST_CONSENSUS_SPARE >> 8);
        for (int c = 0; c < 3; c++)
            simd_store_u8(out[c] + x, colour[c]);
        simd_store_u8(out[3] + x, simd_narrow(dense.half[0], dense.half[1]) | (simd_u8)(seen < 2));
    }
}

/* Parts of the block in which enough views claim the plane at some pixel. */
static inline uint8_t KERNEL(consensus_claimed)(const struct sst_consensus_view *view, int views,
                                                const struct sst_consensus_test *t)
{
    uint8_t enough[SST_CONSENSUS_BLOCK];
    unsigned claimed = 0;

    for (size_t x = 0; x < SST_CONSENSUS_BLOCK; x += SIMD_BYTES) {
        simd_u8 claims = { 0 };

        for (int k = 0; k < views; k++) {
            const simd_u8 plane = simd_load_u8(view[k].plane + x);

            claims -= simd_load_u8(view[k].seen + x) & (simd_u8)(plane <= t->last) & (simd_u8)(plane >= t->first);
        }
        simd_store_u8(enough + x, (simd_u8)(claims >= t->claims));
    }
    for (int part = 0; part < SST_CONSENSUS_BLOCK / SST_CONSENSUS_PART; part++) {
        uint64_t bytes[SST_CONSENSUS_PART / 8];

        memcpy(bytes, enough + part * SST_CONSENSUS_PART, sizeof(bytes));
        claimed |= (unsigned)((bytes[0] | bytes[1]) != 0) << part;
    }
    return (uint8_t)claimed;
}

/* Is a part of the half of pixel x claimed? */
static inline bool KERNEL(consensus_half)(unsigned claimed, size_t x)
{
    const unsigned parts = SST_CONSENSUS_HALF / SST_CONSENSUS_PART;

    return claimed >> x / SST_CONSENSUS_HALF * parts & ((1U << parts) - 1);
}

static uint8_t KERNEL(consensus_again)(uint8_t *const out[4], const struct sst_consensus_view *view, int views,
                                       const struct sst_consensus_test *t)
{
    const uint8_t claimed = KERNEL(consensus_claimed)(view, views, t);
    uint8_t table[2][64];

    KERNEL(consensus_reciprocals)(table);
    for (size_t x = 0; x < SST_CONSENSUS_BLOCK; x += SIMD_BYTES) {
        struct KERNEL(consensus_sum) sum[3] = { 0 }, trimmed[3] = { 0 }, apart = { 0 };
        simd_u8 colour[3] = { 0 }, claims = { 0 }, agree = { 0 }, seen = { 0 }, alike = { 0 },
                visible[SST_CONSENSUS_VIEWS];
        simd_u8 cost;

        if (SIMD_BYTES <= SST_CONSENSUS_HALF ? !KERNEL(consensus_half)(claimed, x) : !claimed)
            continue;
        for (int k = 0; k < views; k++) {
            const simd_u8 plane = simd_load_u8(view[k].plane + x);

            visible[k] = simd_load_u8(view[k].seen + x) & (simd_u8)(plane <= t->last);
            seen -= visible[k];
            KERNEL(consensus_gather)(sum, &claims, &view[k], x, visible[k] & (simd_u8)(plane >= t->first));
        }
        KERNEL(consensus_replace)(colour, sum, claims, table);
        for (int k = 0; k < views; k++)
            KERNEL(consensus_gather)
        (trimmed, &agree, &view[k], x, visible[k] & (simd_u8)(KERNEL(consensus_apart)(&view[k], x, colour) <= t->near));
        KERNEL(consensus_replace)(colour, trimmed, agree, table);
        for (int k = 0; k < views; k++) {
            const simd_u8 e = simd_min_u8(KERNEL(consensus_apart)(&view[k], x, colour), simd_set_u8(t->most));

            alike -= (simd_u8)(e <= t->near) & simd_load_u8(view[k].seen + x);
            KERNEL(consensus_add)(&apart, e & visible[k]);
        }
        alike = simd_less_u8(simd_set_u8(SST_CONSENSUS_LEAST + 1), alike);
        for (int i = 0; i < 2; i++)
            apart.half[i] += simd_widen(alike, i) * SST_CONSENSUS_ALONE;
        KERNEL(consensus_divide)(&cost, &apart, 1, seen + SST_CONSENSUS_LEAST, table);
        for (int c = 0; c < 3; c++)
            simd_store_u8(out[c] + x, colour[c]);
        simd_store_u8(out[3] + x, cost | (simd_u8)(claims == 0));
    }
    for (size_t x = 0; x < SST_CONSENSUS_BLOCK; x += SST_CONSENSUS_HALF) {
        if (!KERNEL(consensus_half)(claimed, x))
            memset(out[3] + x, 255, SST_CONSENSUS_HALF);
    }
    return claimed;
}

static void KERNEL(consensus_cost_row)(uint8_t *cost, const uint8_t *const own[3], const uint8_t *const consensus[4],
                                       uint8_t most, size_t n)
{
    const struct sst_consensus_view view = { .colour = { own[0], own[1], own[2] } };

    for (size_t x = 0; x < n; x += SIMD_BYTES) {
        const simd_u8 colour[3] = { simd_load_u8(consensus[0] + x), simd_load_u8(consensus[1] + x),
                                    simd_load_u8(consensus[2] + x) };
        const simd_u8 sum = simd_more_u8(KERNEL(consensus_apart)(&view, x, colour), simd_load_u8(consensus[3] + x));

        simd_store_u8(cost + x, simd_min_u8(sum, simd_set_u8(most)));
    }
}

/* Planes of the block of pixel x, and its place in a packed row at the first plane. */
static inline const uint8_t *KERNEL(consensus_planes)(const struct sst_consensus_listed *l, int planes, size_t x,
                                                      int *count, size_t *packed)
{
    const size_t block = x / SST_CONSENSUS_BLOCK;

    *count = l->count[block];
    *packed = block * (size_t)planes * SST_CONSENSUS_BLOCK + x % SST_CONSENSUS_BLOCK;
    return l->plane + block * (size_t)planes;
}

/* Pixels around a vector that are like its own. */
struct KERNEL(consensus_alike) {
    const uint8_t *from[8], *own;
    simd_u8 mask[8], flat;
    simd_u16 q[2]; /* reciprocals of their counts */
};

static inline void KERNEL(consensus_find_alike)(struct KERNEL(consensus_alike) * a, const struct sst_consensus_rows *r,
                                                size_t x, uint8_t table[2][64])
{
    const uint8_t *row[3] = { r->above + x, r->own + x, r->below + x };
    simd_u8 count = simd_set_u8(1);

    a->own = row[1];
    a->flat = simd_set_u8(255);
    for (int i = 0; i < 8; i++) {
        const int at = i + (i > 3);
        const simd_u8 step = simd_load_u8(r->step[i] + x);

        a->from[i] = row[at / 3] + at % 3 - 1;
        a->mask[i] = (simd_u8)(step <= r->alike);
        a->flat &= (simd_u8)(step <= r->flat);
        count -= a->mask[i];
    }
    KERNEL(consensus_invert)(a->q, count, table);
}

static inline simd_u8 KERNEL(consensus_mean)(const struct KERNEL(consensus_alike) * a, size_t at)
{
    simd_u8 v[8];
    simd_u16 sum[2];

#pragma GCC unroll 8
    for (int i = 0; i < 8; i++)
        v[i] = simd_load_u8(a->from[i] + at) & a->mask[i];
    v[0] += v[1] + v[2];
    v[3] += simd_load_u8(a->own + at) + v[4];
    v[5] += v[6] + v[7];
    for (int i = 0; i < 2; i++)
        sum[i] = simd_widen(v[0], i) + simd_widen(v[3], i) + simd_widen(v[5], i);
    return simd_narrow(simd_high_u16(sum[0], a->q[0]), simd_high_u16(sum[1], a->q[1]));
}

static void KERNEL(consensus_mean_row)(uint8_t *mean, const struct sst_consensus_rows *r, size_t n)
{
    uint8_t table[2][64];

    KERNEL(consensus_reciprocals)(table);
    for (size_t x = 0; x < n; x += SIMD_BYTES) {
        struct KERNEL(consensus_alike) alike;
        size_t packed;
        int planes;
        const uint8_t *plane = KERNEL(consensus_planes)(&r->listed, r->planes, x, &planes, &packed);

        KERNEL(consensus_find_alike)(&alike, r, x, table);
        for (int p = 0; p < planes; p++, packed += SST_CONSENSUS_BLOCK)
            simd_store_u8(mean + packed, KERNEL(consensus_mean)(&alike, (size_t)plane[p] * r->stride));
    }
}

static void KERNEL(consensus_least_row)(uint8_t *const out[2], const struct sst_consensus_rows *r, size_t n)
{
    uint8_t table[2][64];

    KERNEL(consensus_reciprocals)(table);
    for (size_t x = 0; x < n; x += SIMD_BYTES) {
        struct KERNEL(consensus_alike) alike;
        size_t packed;
        int planes;
        const uint8_t *plane = KERNEL(consensus_planes)(&r->listed, r->planes, x, &planes, &packed);
        simd_u8 least = simd_set_u8(255), chosen = simd_set_u8(plane[0]), cost = least;

        KERNEL(consensus_find_alike)(&alike, r, x, table);
        for (int p = 0; p < planes; p++) {
            const simd_u8 price = (alike.flat & sst_consensus_price(r, plane[p], true)) |
                                  (~alike.flat & sst_consensus_price(r, plane[p], false));
            const simd_u8 mean = KERNEL(consensus_mean)(&alike, (size_t)plane[p] * r->stride);
            const simd_u8 priced = simd_more_u8(mean, price);
            const simd_u8 less = (simd_u8)(priced < least) | simd_set_u8(p ? 0 : 255);

            chosen = (chosen & ~less) | (plane[p] & less);
            cost = (cost & ~less) | (mean & less);
            least = simd_min_u8(priced, least);
        }
        simd_store_u8(out[0] + x, chosen);
        simd_store_u8(out[1] + x, cost);
    }
}

static void KERNEL(consensus_path_row)(const struct sst_consensus_paths *p, size_t n)
{
    for (size_t x = 0; x < n; x += SIMD_BYTES) {
        const simd_u8 most = simd_set_u8(255), p1 = simd_set_u8(p->p1);
        simd_u8 was[2], jump[2], least[2] = { most, most };
        size_t packed;
        int planes;
        const uint8_t *plane = KERNEL(consensus_planes)(&p->listed, p->planes, x, &planes, &packed);

        for (int t = 0; t < 2; t++) {
            was[t] = simd_load_u8(p->from_least[t] + x + (t ? 1 : -1));
            jump[t] = (simd_u8)(simd_load_u8(p->step[t] + x) > p->edge);
            jump[t] = simd_more_u8(was[t], (jump[t] & p->p2_edge) | (~jump[t] & p->p2));
        }
        for (int j = 0; j < planes; j++, packed += SST_CONSENSUS_BLOCK) {
            const int i = plane[j];
            const size_t at = (size_t)i * p->stride + x;
            const simd_u8 cost = simd_load_u8(p->cost + packed);
            simd_u8 l[2];

            for (int t = 0; t < 2; t++) {
                const uint8_t *from = p->from[t] + at + (t ? 1 : -1);
                const simd_u8 below = i ? simd_load_u8(from - p->stride) : most;
                const simd_u8 above = i + 1 < p->planes ? simd_load_u8(from + p->stride) : most;
                const simd_u8 near = simd_more_u8(simd_min_u8(below, above), p1);
                const simd_u8 best = simd_min_u8(simd_min_u8(simd_load_u8(from), near), jump[t]);

                l[t] = simd_more_u8(cost, simd_less_u8(best, was[t]));
                least[t] = simd_min_u8(l[t], least[t]);
                simd_store_u8(p->to[t] + at, l[t]);
            }
            simd_store_u8(p->mean + packed, simd_mean_u8(l[0], l[1]));
        }
        simd_store_u8(p->least[0] + x, least[0]);
        simd_store_u8(p->least[1] + x, least[1]);
    }
}

static void KERNEL(consensus_choose_row)(const struct sst_consensus_choice *c, size_t n)
{
    for (size_t x = 0; x < n; x += SIMD_BYTES) {
        const simd_u8 most = simd_set_u8(255);
        simd_u8 last = most, best = most, chosen = { 0 }, before = most, after = most, cost = { 0 };
        simd_u8 was = { 0 }; /* pixels whose best plane is the last one */
        size_t packed;
        int planes;
        const uint8_t *plane = KERNEL(consensus_planes)(&c->listed, c->planes, x, &planes, &packed);

        for (int j = 0; j < planes; j++, packed += SST_CONSENSUS_BLOCK) {
            const simd_u8 sum = simd_more_u8(simd_load_u8(c->sum[0] + packed), simd_load_u8(c->sum[1] + packed));
            const simd_u8 less = j ? (simd_u8)(sum < best) : most;
            const bool next = j && plane[j] == plane[j - 1] + 1;

            after = (after & ~was) | ((next ? sum : most) & was);
            before = (before & ~less) | ((next ? last : most) & less);
            chosen = (chosen & ~less) | (plane[j] & less);
            cost = (cost & ~less) | (simd_load_u8(c->cost + packed) & less);
            best = (best & ~less) | (sum & less);
            last = sum;
            was = less;
        }
        after |= was;
        simd_store_u8(c->plane + x, chosen);
        simd_store_u8(c->costs + x, cost);
        simd_store_u8(c->before + x, before);
        simd_store_u8(c->sums + x, best);
        simd_store_u8(c->after + x, after);
    }
}
