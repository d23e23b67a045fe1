#if defined(__aarch64__)
#include "pipeline/kernels/arm/bilateral_tmpl.h"
#else
/* One neighbour at a time over a block of pixels; a neighbour that does not count gets weight 0. Not inlined: inside
 * the caller compilers lose the restrict information and use the scalar path. */
static SST_NOINLINE void KERNEL(bilateral_tap)(int32_t *restrict sum, int32_t *restrict total,
                                               const uint16_t *restrict d, const uint8_t *restrict l,
                                               const uint16_t *restrict centre, const uint8_t *restrict level,
                                               int32_t w, int32_t tau)
{
    for (int x = 0; x < 64; x++) {
        const int32_t step = (int32_t)d[x] - (int32_t)centre[x], contrast = (int32_t)l[x] - (int32_t)level[x];
        int32_t counted = w;

        counted = step > SST_BILATERAL_STEP_Q6 ? 0 : counted;
        counted = step < -SST_BILATERAL_STEP_Q6 ? 0 : counted;
        counted = contrast >= tau ? 0 : counted;
        counted = contrast <= -tau ? 0 : counted;
        sum[x] += counted * step;
        total[x] += counted;
    }
}

static void KERNEL(bilateral_row)(uint16_t *restrict out, const uint16_t *const disp[7], const uint8_t *const luma[7],
                                  const int16_t *weight, int tau, size_t n)
{
    enum { BLOCK = 64 };
    int32_t sum[BLOCK], total[BLOCK];
    const uint16_t *disp_rest[7];
    const uint8_t *luma_rest[7];
    size_t start = 0;

    for (; start < n && n >= BLOCK; start += BLOCK) {
        start = n - start < BLOCK ? n - BLOCK : start; /* the last block overlaps the one before */
        const uint16_t *centre = disp[3] + start;
        const uint8_t *level = luma[3] + start;

        memset(sum, 0, sizeof(sum));
        memset(total, 0, sizeof(total));
        for (int k = 0; k < 49; k++) {
            const uint16_t *d = disp[k / 7] + start + k % 7 - 3;
            const uint8_t *l = luma[k / 7] + start + k % 7 - 3;

            KERNEL(bilateral_tap)(sum, total, d, l, centre, level, weight[k], tau);
        }
        for (int x = 0; x < BLOCK; x++) {
            const int32_t mean = (int32_t)((float)sum[x] / (float)total[x] + 128.5f);

            out[start + (size_t)x] = (uint16_t)(centre[x] == 65535 ? 65535 : centre[x] - 128 + mean);
        }
    }
    for (int j = 0; j < 7; j++) {
        disp_rest[j] = disp[j] + start;
        luma_rest[j] = luma[j] + start;
    }
    sst_bilateral_row_ref(out + start, disp_rest, luma_rest, weight, tau, n - start);
}
#endif
