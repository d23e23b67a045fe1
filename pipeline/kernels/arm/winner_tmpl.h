/* winner_row with NEON: the least sum of each lane with its first place, then the least sum elsewhere. */
struct KERNEL(winner_lanes) {
    uint16x8_t index, least, place, from, other;
};

static inline void KERNEL(winner_least)(struct KERNEL(winner_lanes) * l, const uint16_t *sum)
{
    const uint16x8_t v = vld1q_u16(sum);

    l->place = vbslq_u16(vcltq_u16(v, l->least), l->index, l->place);
    l->least = vminq_u16(l->least, v);
    l->index = vaddq_u16(l->index, vdupq_n_u16(8));
}

/* Without three places. */
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
    const uint16x8_t none = vdupq_n_u16(65535);

    if (nd < 8) {
        sst_winner_row_ref(best, second, sum, stride, n, nd);
        return;
    }
    for (size_t x = 0; x < n; x++, sum += stride) {
        struct KERNEL(winner_lanes) l = { .index = start, .least = none, .place = start, .other = none };
        size_t d = 0;

        for (; d + 16 <= nd; d += 16) {
            KERNEL(winner_least)(&l, sum + d);
            KERNEL(winner_least)(&l, sum + d + 8);
        }
        if (d < nd) { /* the last sums overlap those before */
            if (d + 8 < nd)
                KERNEL(winner_least)(&l, sum + d);
            l.index = end;
            KERNEL(winner_least)(&l, sum + nd - 8);
        }
        l.place = vornq_u16(l.place, vceqq_u16(l.least, vdupq_n_u16(vminvq_u16(l.least))));
        best[x] = vminvq_u16(l.place);
        if (!second)
            continue;
        l.from = vdupq_n_u16((uint16_t)(best[x] - 1));
        l.index = start;
        for (d = 0; d + 16 <= nd; d += 16) {
            KERNEL(winner_other)(&l, sum + d);
            KERNEL(winner_other)(&l, sum + d + 8);
        }
        if (d < nd) {
            if (d + 8 < nd)
                KERNEL(winner_other)(&l, sum + d);
            l.index = end;
            KERNEL(winner_other)(&l, sum + nd - 8);
        }
        second[x] = vminvq_u16(l.other);
    }
}
