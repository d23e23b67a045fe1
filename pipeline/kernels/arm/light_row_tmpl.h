/* light_row with NEON: sst_light_code() with one square root for both of its halves. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
static inline float32x4_t KERNEL(light_4)(uint16x4_t value, float32x4_t f, float32x4_t r)
{
    const float32x4_t v = vmulq_n_f32(vcvtq_f32_u32(vmovl_u16(value)), 1.0f / (1 << SST_LIGHT_SHIFT));
    const float32x4_t knee = vdupq_n_f32(SST_LIGHT_KNEE), offset = vdupq_n_f32(SST_LIGHT_OFFSET);
    const float32x4_t white = vdupq_n_f32(255.0f);
    const uint32x4_t below = vcltq_f32(v, knee);
    const float32x4_t w = vbslq_f32(below, v, vaddq_f32(v, offset)), q = vsqrtq_f32(w);
    float32x4_t curve = vsubq_f32(vmulq_n_f32(q, 0.05408126f), vdupq_n_f32(0.6254325f));
    float32x4_t straight = vaddq_f32(vmulq_n_f32(q, -4.3761992e-05f), vdupq_n_f32(0.0032436457f));
    float32x4_t s, p, code, keep;

    curve = vaddq_f32(vmulq_f32(curve, q), vdupq_n_f32(8.6891006f));
    curve = vaddq_f32(vmulq_f32(curve, q), vdupq_n_f32(1.0951992f));
    straight = vaddq_f32(vmulq_f32(straight, q), vdupq_n_f32(0.0024750656f));
    straight = vmulq_f32(vmulq_f32(straight, w), w);
    s = vmulq_f32(f, vbslq_f32(below, v, straight));
    p = vsubq_f32(vmulq_f32(r, vbslq_f32(below, curve, w)), offset);
    code = vbslq_f32(vcltq_f32(s, knee), s, p);
    keep = vsubq_f32(white, vmulq_n_f32(vsubq_f32(white, v), SST_LIGHT_KEEP));
    return vaddq_f32(vminq_f32(vmaxq_f32(code, keep), white), vdupq_n_f32(0.5f));
}

static void KERNEL(light_row)(uint8_t *restrict out, const struct sst_light *light, size_t n)
{
    if (n < 8) {
        sst_light_row_ref(out, light, n);
        return;
    }
    for (size_t x = 0; x < n; x += 8) {
        uint32x4_t code[2];

        x = x < n - 8 ? x : n - 8; /* the last eight overlap those before */
        for (size_t i = 0; i < 2; i++) {
            const float32x4_t f = vmulq_n_f32(vld1q_f32(light->falloff + x + 4 * i), light->gain);
            const float32x4_t r = vmulq_n_f32(vld1q_f32(light->falloff_root + x + 4 * i), light->gain_root);

            code[i] = vcvtq_u32_f32(KERNEL(light_4)(vld1_u16(light->value + x + 4 * i), f, r));
        }
        vst1_u8(out + x, vmovn_u16(vcombine_u16(vmovn_u32(code[0]), vmovn_u32(code[1]))));
    }
}
