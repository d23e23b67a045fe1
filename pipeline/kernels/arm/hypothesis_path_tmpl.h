/* hypothesis_path with NEON: one lane for each hypothesis of the pixel, one of the predecessor after the other. */
static inline void KERNEL(hypothesis_path)(uint16_t *path, uint16_t *sum, const uint16_t *cost,
                                           const uint16_t *hypothesis, const uint16_t *from,
                                           const uint16_t *from_hypothesis, uint16_t p1, uint16_t p2, uint16_t near)
{
    const uint16x8_t here = vld1q_u16(hypothesis), there = vld1q_u16(from_hypothesis), costs = vld1q_u16(from);
    const uint16x8_t step = vdupq_n_u16(near), twice = vdupq_n_u16((uint16_t)(2 * near)), small = vdupq_n_u16(p1);
    const uint16_t least = vminvq_u16(costs);
    uint16x8_t best = vdupq_n_u16((uint16_t)(least + p2)), jump, l;

    _Static_assert(SST_HYPOTHESES == 8, "one lane each");
#define HYPOTHESIS_FROM(j)                                                                                             \
    jump = vabdq_u16(here, vdupq_laneq_u16(there, j));                                                                 \
    l = vaddq_u16(vandq_u16(vcgtq_u16(jump, step), small), vdupq_laneq_u16(costs, j));                                 \
    best = vminq_u16(best, vorrq_u16(l, vcgtq_u16(jump, twice)))
    HYPOTHESIS_FROM(0);
    HYPOTHESIS_FROM(1);
    HYPOTHESIS_FROM(2);
    HYPOTHESIS_FROM(3);
    HYPOTHESIS_FROM(4);
    HYPOTHESIS_FROM(5);
    HYPOTHESIS_FROM(6);
    HYPOTHESIS_FROM(7);
#undef HYPOTHESIS_FROM
    l = vsubq_u16(vaddq_u16(vld1q_u16(cost), best), vdupq_n_u16(least));
    vst1q_u16(path, l);
    vst1q_u16(sum, vaddq_u16(vld1q_u16(sum), l));
}
