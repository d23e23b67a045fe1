/* The two cheapest as minima and maxima of bytes, which every CPU level has. */
static void KERNEL(cheapest_row)(uint8_t *restrict first, uint8_t *restrict second, const uint8_t *a, const uint8_t *b,
                                 size_t n)
{
    for (size_t x = 0; x < n; x++) {
        const uint8_t mean = (uint8_t)((a[x] + b[x] + 1) >> 1), t = mean < SST_COST_MAX ? mean : SST_COST_MAX - 1;
        const uint8_t one = first[x], two = second[x], over = one > t ? one : t;

        first[x] = one < t ? one : t;
        second[x] = two < over ? two : over;
    }
}
