/* pipeline/kernels/conv_tiles.h - contracts of the kernels of 3x3 convolutions on bytes by tiles (Winograd's). */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_KERNELS_CONV_TILES_H
#define SST_PIPELINE_KERNELS_CONV_TILES_H

#include <stddef.h>
#include <stdint.h>

/*
 * A tile of 4x4 results needs 6x6 inputs d: A'((G' g G'^T) * (B d B^T))A'^T = 576 times their sums of products with the
 * kernel g, 36 products in place of 144 (Winograd 1980, Lavin and Gray 2016, points 0, 1, -1, 2, -2). All matrices are
 * whole: rows of G are scaled to G', columns of A by their inverses times 24 to A'. Spread bytes lie within 25500,
 * spread weights of 127 within 6223: 16 bits. Sums may wrap: modulo 2^32 they are 64 * 9 times the result, 9 has an
 * inverse, and results below 2^25 remain exact.
 */
#define SST_CONV_TILE   6                               /* side of a tile's inputs */
#define SST_CONV_OUT    4                               /* side of its results */
#define SST_CONV_PARTS  (SST_CONV_TILE * SST_CONV_TILE) /* spread numbers of a tile */
#define SST_CONV_PIXELS (SST_CONV_OUT * SST_CONV_OUT)
#define SST_CONV_BLOCK  16          /* channels */
#define SST_CONV_MOST   (1 << 25)   /* magnitudes of results are below it */
#define SST_CONV_NINTH  0x38E38E39U /* times 9 it is 1, modulo 2^32 */

/** Spread inputs B d B^T of a tile. @param out  [SST_CONV_PARTS] rows of `channels`, `stride` numbers apart
 *  @param pixel  [channels] each, u8, or s8 with `is_signed`; channels a multiple of SST_CONV_BLOCK */
typedef void sst_conv_spread_fn(int16_t *out, size_t stride, const uint8_t *const pixel[SST_CONV_PARTS],
                                size_t channels, int is_signed);

/** out[i][o] = sum over c of tiles[i][c] weights[c / 2][o][c % 2], modulo 2^32, for SST_CONV_BLOCK outputs of n tiles.
 */
typedef void sst_conv_products_fn(int32_t *out, const int16_t *tiles, const int16_t *weights, size_t channels,
                                  size_t n);

/** Results of a tile, A' m A'^T / 576. @param out  [SST_CONV_PIXELS][SST_CONV_BLOCK]
 *  @param m  [SST_CONV_PARTS] rows of SST_CONV_BLOCK, `stride` numbers apart */
typedef void sst_conv_gather_fn(int32_t *out, const int32_t *m, size_t stride);

enum sst_conv_type { SST_CONV_NONE = 0, SST_CONV_F32 = 1, SST_CONV_U8 = 2, SST_CONV_S8 = 3 };

/** Results from sums of products: (sum + bias) * scale, or sum * scale + bias; + residual * residual_scale, rounded
 * once; at least 0 with relu; rounded to the nearest even byte that the type has. */
struct sst_conv_finish {
    const float *scale, *bias; /* [SST_CONV_BLOCK] */
    int bias_first, relu;
    enum sst_conv_type type, residual; /* bytes replace bytes, floats floats */
    float residual_scale;
};

/** Results of pixels. @param to  [SST_CONV_PIXELS] SST_CONV_BLOCK numbers each, the residual in; NULL: not wanted */
typedef void sst_conv_finish_fn(void *const *to, const int32_t *sums, const struct sst_conv_finish *f);

#endif
