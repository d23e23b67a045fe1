/* winner_row with NEON: the least sum, the first place of it, then the least sum elsewhere. */
struct KERNEL(winner_lanes) {
    uint16x8_t index, least, place, from, other;
};

/* Where sums equal the least, the least index. */
static inline void KERNEL(winner_place)(struct KERNEL(winner_lanes) * l, const uint16_t *sum)
{
    l->place = vminq_u16(l->place, vornq_u16(l->index, vceqq_u16(vld1q_u16(sum), l->least)));
    l->index = vaddq_u16(l->index, vdupq_n_u16(8));
}

/* The least sum but for three places. */
static inline void KERNEL(winner_other)(struct KERNEL(winner_lanes) * l, const uint16_t *sum)
{
    const uint16x8_t beside = vcleq_u16(vsubq_u16(l->index, l->from), vdupq_n_u16(2));

    l->other = vminq_u16(l->other, vorrq_u16(vld1q_u16(sum), beside));
    l->index = vaddq_u16(l->index, vdupq_n_u16(8));
}

static void KERNEL(winner_row)(uint16_t *restrict best, uint16_t *restrict second, const uint16_t *restrict sum,
                               size_t stride, size_t n, size_t nd)
{
    static const uint16_t lanes[8] = { 0, 1, 2, 3, 4, 5, 6, 7 };
    const uint16x8_t start = vld1q_u16(lanes), end = vaddq_u16(start, vdupq_n_u16((uint16_t)(nd - 8)));

    if (nd < 8) {
        sst_winner_row_ref(best, second, sum, stride, n, nd);
        return;
    }
    for (size_t x = 0; x < n; x++, sum += stride) {
        const uint16x8_t none = vdupq_n_u16(65535);
        struct KERNEL(winner_lanes) l = { .index = start, .place = none, .other = none };

        /* The last eight sums overlap those before. */
        l.least = vld1q_u16(sum + nd - 8);
#pragma GCC unroll 4
        for (size_t d = 0; d < nd - 7; d += 8)
            l.least = vminq_u16(l.least, vld1q_u16(sum + d));
        l.least = vdupq_n_u16(vminvq_u16(l.least));
#pragma GCC unroll 4
        for (size_t d = 0; d < nd - 7; d += 8)
            KERNEL(winner_place)(&l, sum + d);
        l.index = end;
        KERNEL(winner_place)(&l, sum + nd - 8);
        best[x] = vminvq_u16(l.place);
        l.from = vdupq_n_u16((uint16_t)(best[x] - 1));
        l.index = start;
#pragma GCC unroll 4
        for (size_t d = 0; d < nd - 7; d += 8)
            KERNEL(winner_other)(&l, sum + d);
        l.index = end;
        KERNEL(winner_other)(&l, sum + nd - 8);
        second[x] = vminvq_u16(l.other);
    }
}
