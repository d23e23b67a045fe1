/* 8x8 blocks in eight 64-bit words: three rounds swap 4x4, 2x2 and 1x1 blocks. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_TRANSPOSE_SWAP
#define SST_TRANSPOSE_SWAP(i, j, shift, mask)                                                                          \
    do {                                                                                                               \
        const uint64_t t = ((w[i] >> (shift)) ^ w[j]) & (mask);                                                        \
        w[j] ^= t;                                                                                                     \
        w[i] ^= t << (shift);                                                                                          \
    } while (0)
#endif

static void KERNEL(transpose_u8)(uint8_t *restrict out, size_t out_stride, const uint8_t *restrict in, size_t in_stride,
                                 size_t nx, size_t nd)
{
    for (size_t x = 0; x < nx; x += 8) {
        for (size_t d = 0; d < nd; d += 8) {
            uint64_t w[8];

            for (size_t i = 0; i < 8; i++)
                memcpy(&w[i], in + (d + i) * in_stride + x, 8);
            for (size_t i = 0; i < 4; i++)
                SST_TRANSPOSE_SWAP(i, i + 4, 32, 0x00000000FFFFFFFFull);
            for (size_t i = 0; i < 8; i += 4) {
                SST_TRANSPOSE_SWAP(i, i + 2, 16, 0x0000FFFF0000FFFFull);
                SST_TRANSPOSE_SWAP(i + 1, i + 3, 16, 0x0000FFFF0000FFFFull);
            }
            for (size_t i = 0; i < 8; i += 2)
                SST_TRANSPOSE_SWAP(i, i + 1, 8, 0x00FF00FF00FF00FFull);
            for (size_t i = 0; i < 8; i++)
                memcpy(out + (x + i) * out_stride + d, &w[i], 8);
        }
    }
}
