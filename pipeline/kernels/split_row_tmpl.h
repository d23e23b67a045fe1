/* split_row. With AVX2 and above 32 pixels at once. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */

static void KERNEL(split_row)(uint8_t *const plane[3], const uint8_t *pixels, size_t n)
{
    size_t x = 0;

#if defined(__AVX2__)
    const __m256i bytes = _mm256_setr_epi8(0, 4, 8, 12, 1, 5, 9, 13, 2, 6, 10, 14, 3, 7, 11, 15, 0, 4, 8, 12, 1, 5, 9,
                                           13, 2, 6, 10, 14, 3, 7, 11, 15);
    const __m256i fours = _mm256_setr_epi32(0, 4, 1, 5, 2, 6, 3, 7);

    for (; n - x >= 32; x += 32) {
        __m256i eight[4], red_blue[2], green[2];

        for (int i = 0; i < 4; i++) {
            const __m256i v = _mm256_loadu_si256((const __m256i *)(const void *)(pixels + 4 * x) + i);

            eight[i] = _mm256_permutevar8x32_epi32(_mm256_shuffle_epi8(v, bytes), fours);
        }
        for (int i = 0; i < 2; i++) {
            red_blue[i] = _mm256_unpacklo_epi64(eight[2 * i], eight[2 * i + 1]);
            green[i] = _mm256_unpackhi_epi64(eight[2 * i], eight[2 * i + 1]);
        }
        _mm256_storeu_si256((__m256i *)(void *)(plane[0] + x), _mm256_permute2x128_si256(red_blue[0], red_blue[1], 0x20));
        _mm256_storeu_si256((__m256i *)(void *)(plane[1] + x), _mm256_permute2x128_si256(green[0], green[1], 0x20));
        _mm256_storeu_si256((__m256i *)(void *)(plane[2] + x), _mm256_permute2x128_si256(red_blue[0], red_blue[1], 0x31));
    }
#endif
    sst_split_row_ref((uint8_t *const[]){ plane[0] + x, plane[1] + x, plane[2] + x }, pixels + 4 * x, n - x);
}
