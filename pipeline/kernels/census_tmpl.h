/* Census: 32-bit halves so that comparisons and shifts fill wide lanes; rows 0-2 and half of row 3 first. */
static void KERNEL(census_row)(uint64_t *restrict out, const uint8_t *const rows[7], size_t n)
{
    enum { BLOCK = 64 };
    uint32_t hi[BLOCK], lo[BLOCK];
    const uint8_t *rest[7];
    size_t start = 0;

    for (; n - start >= BLOCK; start += BLOCK) {
        const uint8_t *centre = rows[3] + start;

        memset(hi, 0, sizeof(hi));
        memset(lo, 0, sizeof(lo));
        for (int k = 0; k < 31; k++) {
            const uint8_t *p = rows[k / 9] + start + k % 9 - 4;

            for (int x = 0; x < BLOCK; x++)
                hi[x] = hi[x] << 1 | (uint32_t)(p[x] < centre[x]);
        }
        for (int k = 32; k < 63; k++) {
            const uint8_t *p = rows[k / 9] + start + k % 9 - 4;

            for (int x = 0; x < BLOCK; x++)
                lo[x] = lo[x] << 1 | (uint32_t)(p[x] < centre[x]);
        }
        for (int x = 0; x < BLOCK; x++)
            out[start + (size_t)x] = (uint64_t)hi[x] << 31 | lo[x];
    }
    for (int j = 0; j < 7; j++)
        rest[j] = rows[j] + start;
    sst_census_row_ref(out + start, rest, n - start);
}

static void KERNEL(hamming_row)(uint8_t *restrict cost, const uint64_t *restrict a, const uint64_t *restrict b, size_t n)
{
    for (size_t x = 0; x < n; x++)
        cost[x] = (uint8_t)(4 * __builtin_popcountll(a[x] ^ b[x]));
}
