/* The divisor is replaced, not the quotient: a vector divides all lanes, and 0 / 0 must not happen in any. */
static void KERNEL(blend_finish)(uint8_t *restrict out, const float *restrict sum, const float *restrict weight, size_t n)
{
    for (size_t x = 0; x < n; x++) {
        const float divisor = weight[x] < SST_BLEND_FLOOR ? 1.0f : weight[x];
        const float value = weight[x] < SST_BLEND_FLOOR ? 0.0f : sum[x];

        out[x] = (uint8_t)(int)(value / divisor + 0.5f);
    }
}
