/* pipeline/gpu/net.h - the shaders of convolutional networks: layers between tensors in the memory of a device.
 *
 * A tensor of c channels has pixels row by row, the channels of a pixel side by side in a multiple of four: floats of a
 * word each, or bytes, four to a word. A byte q stands for scale * q. Offsets and pitches are in words of 32 bits. A layer may read
 * and write one buffer, if no word is both read and written.
 *
 * They give the same bytes on every device: sums of bytes are exact, sums of floats have one order and one rounding for
 * a product and its sum, as IEEE 754 has it; pools and lengths are summed in two parts. They are defined by the plan
 * for the CPU (pipeline/method/network/plan_conv.c): convolutions on 8 bits equal it byte for byte, convolutions on
 * floats as far as oneDNN sums in this order, which it does where a pixel has few inputs.
 */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_GPU_NET_H
#define SST_PIPELINE_GPU_NET_H

#include "pipeline/gpu/gpu.h"

enum sst_gpu_net_type {
    SST_GPU_NET_F32 = 0,
    SST_GPU_NET_U8 = 1,
    SST_GPU_NET_S8 = 2,
    SST_GPU_NET_PLANES = 3, /* floats, [channel][row][column] */
};

/* Structures have the layout of the shaders (std430). */

/** A tensor, and how much of it a layer reads or writes. */
struct sst_gpu_net_tensor {
    uint32_t at;    /* its first word */
    uint32_t pitch; /* words of a pixel; SST_GPU_NET_PLANES: of a plane */
    uint32_t type;  /* enum sst_gpu_net_type */
    int32_t width, height;
};

#define SST_GPU_NET_TILE     64  /* pixels of a group of a convolution */
#define SST_GPU_NET_TILE_OUT 32  /* channels of it; weights are padded with zeros to a multiple */
#define SST_GPU_NET_MATRIX     128 /* pixels of a group of net_conv8_matrix */
#define SST_GPU_NET_MATRIX_OUT 64  /* channels of it */
#define SST_GPU_NET_SLAB     8   /* words of a pixel that are multiplied at once; weights are padded to a multiple */
#define SST_GPU_NET_UNFUSED  0   /* of residual_mode: the residual times its scale is rounded, then added */
#define SST_GPU_NET_FUSED    1   /* ... is rounded once, with the sum */
#define SST_GPU_NET_NONE     2   /* there is none */
#define SST_GPU_NET_GROUP    64  /* invocations of the other shaders */

/**
 * net_conv8 (bytes) and net_conv (floats): a convolution of one group. With K = ceil(kernel words / SLAB) * SLAB, where
 * a kernel has kernel[0] * kernel[1] * from.pitch words,
 *   weights_at  words of K * channels, padded: [word of a pixel, tap after tap][channel]; of bytes, four inputs a word
 *   scales_at   floats of channels, padded: factors of the sums (net_conv8 only)
 *   bias_at     floats of channels, padded; added before the factor or after it, by bias_first
 * Then the residual is added, relu applied, and the result stored: as float, or as byte of result * out_scale (net_conv
 * only; net_conv8 has it in its factors), to nearest, halves to even. Groups: tiles of pixels, tiles of channels.
 *
 * net_conv8_dot and net_conv8_matrix are net_conv8 by dot products of four bytes and by products of matrices.
 */
struct sst_gpu_net_conv {
    struct sst_gpu_net_tensor from, to;
    int32_t channels; /* of `to` that are written, from to.at on; those up to a multiple of 4 are written as well */
    int32_t kernel;   /* height << 16 | width; and so on */
    int32_t stride, pad, dilation;
    uint32_t weights_at, scales_at, bias_at;
    uint32_t residual_at, residual_pitch, residual_type; /* in FROM */
    float residual_scale;
    uint32_t residual_mode; /* SST_GPU_NET_UNFUSED, ... */
    float out_scale;
    uint32_t relu;
    uint32_t by_parts; /* net_conv: not 0 unless fma() rounds once */
    uint32_t bias_first; /* sums begin with the bias; else it is added, in net_conv8 after the factor */
};

/** net_pool, net_resize, net_move, net_unit. What is read is `scale` times what is stored, unless it is 1. */
struct sst_gpu_net_layer {
    struct sst_gpu_net_tensor from, to;
    int32_t channels; /* those up to a multiple of 4 are written as well */
    float scale;
    uint32_t taps_at; /* net_resize: struct sst_gpu_net_tap[to.height], then [to.width] */
    float factor;     /* net_unit */
    float in_add, in_min, add, min;
};

/** Position of one output sample along an axis: in[lo] + part (in[hi] - in[lo]). */
struct sst_gpu_net_tap {
    int32_t lo, hi;
    float part;
};

/*
 * net_move    copies, and converts: to bytes by rounding to nearest, halves to even
 * net_resize  bilinear, to floats
 * net_pool    means over bins floor(i n / m) .. ceil((i + 1) n / m), to floats
 * net_unit    x factor / max(sqrt(max(S + in_add, in_min)) + add, min), S = sum x^2, of floats, to signed bytes; halves
 *             away from 0
 * Groups: (to.width * ceil(channels / 4)) / GROUP, to.height; net_pool: bins across times ceil(channels / 4), bins
 * down; net_unit: to.width / GROUP, to.height.
 */

static inline uint32_t sst_gpu_net_words(int channels, uint32_t type)
{
    const uint32_t fours = ((uint32_t)channels + 3) / 4;

    return type == SST_GPU_NET_U8 || type == SST_GPU_NET_S8 ? fours : 4 * fours;
}

#endif
