/* blend_rays, blend_plain, blend_support: one pass per quantity over at most SST_BLEND_MAX pixels, all in the L1 cache.
 */
#include "pipeline/kernels/exp_neg.h"

/* The two rows blended once per column, not once per tap. */
static inline void KERNEL(blend_rows)(float *restrict out, const uint8_t *restrict top, const uint8_t *restrict bottom,
                                      float fy, size_t n)
{
    for (size_t x = 0; x < n; x++)
        out[x] = (float)top[x] + fy * (float)(bottom[x] - top[x]);
}

static inline void KERNEL(blend_label_weights)(float *restrict out, const struct sst_blend *b, size_t n)
{
    const float *restrict table = b->label_weight;
    const uint8_t *restrict label = b->label;
    const uint16_t *restrict disp = b->disp;

    for (size_t x = 0; x < n; x++)
        out[x] = table[label[x] * SST_BLEND_COLUMNS + (disp[x] >> SST_BLEND_COLUMN_SHIFT)];
}

/* w holds W_s and becomes A W_s W_d. Three loops: in a single one, compilers branch around the exponential and do not
 * vectorise. */
static inline void KERNEL(blend_weights)(float *restrict w, const struct sst_blend *b, size_t n)
{
    const uint16_t *restrict disp = b->disp;
    const float whole = b->focus_whole_q6, part = b->focus_part_q6, scale = b->half_inverse_variance;
    const float c1 = b->c1, rest = b->one_minus_c1, unknown = b->unknown, aperture = b->aperture;
    float depth[SST_BLEND_MAX];

    for (size_t x = 0; x < n; x++) {
        const float d = ((float)disp[x] - whole) - part;
        const float t = d * d * scale;

        depth[x] = t < SST_EXP_NEG_MAX ? t : SST_EXP_NEG_MAX;
    }
    for (size_t x = 0; x < n; x++)
        depth[x] = rest * sst_exp_neg(depth[x]) + c1;
    for (size_t x = 0; x < n; x++)
        w[x] = aperture * w[x] * (disp[x] == 0xFFFF ? unknown : depth[x]);
}

/* A W_s W_d. */
static inline void KERNEL(blend_ray_weights)(float *restrict w, const struct sst_blend *b, size_t n)
{
    if (b->label) {
        KERNEL(blend_label_weights)(w, b, n);
    } else {
        for (size_t x = 0; x < n; x++)
            w[x] = 1.0f;
    }
    KERNEL(blend_weights)(w, b, n);
}

static void KERNEL(blend_take)(uint8_t *const colour[3], float *weight, const struct sst_blend *b, size_t n)
{
    float rows[SST_BLEND_MAX + 1];

    KERNEL(blend_ray_weights)(weight, b, n);
    for (int c = 0; c < 3; c++) {
        uint8_t *restrict out = colour[c];
        const float fx = b->fx;

        KERNEL(blend_rows)(rows, b->top[c], b->bottom[c], b->fy, n + 1);
        for (size_t x = 0; x < n; x++)
            out[x] = (uint8_t)(int)(rows[x] + fx * (rows[x + 1] - rows[x]) + 0.5f);
    }
}

static void KERNEL(blend_rays)(float *const acc[4], const struct sst_blend *b, size_t n)
{
    float rows[SST_BLEND_MAX + 1], w[SST_BLEND_MAX];

    KERNEL(blend_ray_weights)(w, b, n);
    for (int c = 0; c < 3; c++) {
        float *restrict sum = acc[c];
        const float fx = b->fx;

        KERNEL(blend_rows)(rows, b->top[c], b->bottom[c], b->fy, n + 1);
        for (size_t x = 0; x < n; x++)
            sum[x] += w[x] * (rows[x] + fx * (rows[x + 1] - rows[x]));
    }
    for (size_t x = 0; x < n; x++)
        acc[3][x] += w[x];
}

static void KERNEL(blend_plain)(float *const acc[4], const struct sst_blend *b, size_t n)
{
    const float fx = b->fx, aperture = b->aperture;
    float rows[SST_BLEND_MAX + 1];

    for (int c = 0; c < 3; c++) {
        float *restrict sum = acc[c];

        KERNEL(blend_rows)(rows, b->top[c], b->bottom[c], b->fy, n + 1);
        for (size_t x = 0; x < n; x++)
            sum[x] += aperture * (rows[x] + fx * (rows[x + 1] - rows[x]));
    }
    for (size_t x = 0; x < n; x++)
        acc[3][x] += aperture;
}

static void KERNEL(blend_support)(uint8_t *restrict support, const uint16_t *restrict disp,
                                  const uint8_t *restrict label, const uint32_t *restrict ends, size_t n)
{
    for (size_t x = 0; x < n; x++) {
        const uint32_t range = ends[label ? label[x] : 0], d = disp[x];

        support[x] = (uint8_t)(support[x] | -((d >= (range & 0xFFFF)) & (d <= range >> 16)));
    }
}
