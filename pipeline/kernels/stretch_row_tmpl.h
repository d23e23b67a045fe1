/* stretch_row: the two neighbours are gathered. */
static void KERNEL(stretch_row)(float *restrict out, const float *restrict row, const int32_t *restrict left,
                                const float *restrict part, size_t n)
{
    for (size_t x = 0; x < n; x++) {
        const float a = row[left[x]], b = row[left[x] + 1];

        out[x] = a + part[x] * (b - a);
    }
}
