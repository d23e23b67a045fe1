/* subpixel_window_row with NEON: four pixels, whose sums stay in registers; the last four overlap those before. */
static void KERNEL(subpixel_window_row)(float *weight, float *product, const struct sst_subpixel_window *w, size_t n)
{
    const uint8x16_t similar = vorrq_u8(vdupq_n_u8((uint8_t)sst_clamp_int(w->similar, 0, 255)),
                                        vreinterpretq_u8_u32(vdupq_n_u32(0xFF000000)));
    const uint32x4_t apart = vdupq_n_u32((uint32_t)w->apart), all = vdupq_n_u32(0xFFFFFFFF);

    if (n < 4 || w->similar < 0 || w->apart < 0) {
        sst_subpixel_window_row_ref(weight, product, w, n);
        return;
    }
    for (size_t x = 0; x < n; x += 4) {
        float32x4_t sum = vdupq_n_f32(0), products = sum;
        uint8x16_t colour;
        int32x4_t disp;

        x = x < n - 4 ? x : n - 4;
        colour = vld1q_u8((const uint8_t *)(w->colour + x));
        disp = vld1q_s32(w->disp + x);
        for (int i = -2; i <= 2; i++) {
            ptrdiff_t at = (ptrdiff_t)x + w->step * (i * w->stride - 2);

            for (int j = -2; j <= 2; j++, at += w->step) {
                const uint8x16_t alike = vcleq_u8(vabdq_u8(vld1q_u8((const uint8_t *)(w->colour + at)), colour), similar);
                const uint32x4_t near = vcleq_u32(vreinterpretq_u32_s32(vabdq_s32(vld1q_s32(w->disp + at), disp)), apart);
                const uint32x4_t counts = vandq_u32(vceqq_u32(vreinterpretq_u32_u8(alike), all), near);
                const uint32x4_t more = vandq_u32(vreinterpretq_u32_f32(vld1q_f32(w->weight + at)), counts);
                const uint32x4_t more_product = vandq_u32(vreinterpretq_u32_f32(vld1q_f32(w->product + at)), counts);

                sum = vaddq_f32(sum, vreinterpretq_f32_u32(more));
                products = vaddq_f32(products, vreinterpretq_f32_u32(more_product));
            }
        }
        vst1q_f32(weight + x, sum);
        vst1q_f32(product + x, products);
    }
}
