// A convolution on floats, tiled as net_conv8.comp is. Sums go over the taps, and over the channels of each, in order;
// each product is rounded with its sum. Constants: pipeline/gpu/net.h. Definition: the plan for the CPU,
// pipeline/method/network/plan_conv.c.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0
#version 450

layout(local_size_x = 128) in;

layout(std430, binding = 0) readonly buffer Fixed { uint fixed_word[]; }; // weights, biases, positions of samples
layout(std430, binding = 1) readonly buffer From { uint from_word[]; };
layout(std430, binding = 2) buffer To { uint to_word[]; };

struct Tensor {
    uint at, pitch, type;
    int width, height;
};

layout(std430, push_constant) uniform Constants {
    Tensor from, to;
    int channels, kernel, stride, pad, dilation;
    uint weights_at, scales_at, bias_at;
    uint residual_at, residual_pitch, residual_type;
    float residual_scale;
    uint residual_mode;
    float out_scale;
    uint relu, by_parts, bias_first;
};

const uint F32 = 0, U8 = 1, NONE = 2;
const uint TILE = 64, TILE_OUT = 32, SLAB = 8, PIXELS = TILE * SLAB / 128, WEIGHTS = TILE_OUT * SLAB / 128;

// Turned as in net_conv8.comp.
shared vec4 inputs[SLAB][TILE / 4];
shared vec4 weights[SLAB][TILE_OUT / 4];

vec4 high_part(vec4 v)
{
    return uintBitsToFloat(floatBitsToUint(v) & 0xFFFFF000u);
}

// x w + sum, rounded once, for devices whose fma() rounds twice: the exact product in two parts, its sum in three; the two
// lower ones are added with their last digit odd where that is inexact, so that the last addition rounds as for the whole.
vec4 fused(float x, vec4 w, vec4 sum)
{
    const float x_high = uintBitsToFloat(floatBitsToUint(x) & 0xFFFFF000u);
    const vec4 w_high = high_part(w);
    precise float x_low = x - x_high;
    precise vec4 w_low = w - w_high;
    precise vec4 product = x * w;
    precise vec4 product_low = ((x_high * w_high - product) + x_high * w_low + x_low * w_high) + x_low * w_low;
    precise vec4 high = sum + product;
    precise vec4 high_back = high - sum;
    precise vec4 middle = (sum - (high - high_back)) + (product - high_back);
    precise vec4 low = middle + product_low;
    precise vec4 low_back = low - middle;
    precise vec4 rest = (middle - (low - low_back)) + (product_low - low_back);
    const uvec4 bits = floatBitsToUint(low);
    const bvec4 away = equal(lessThan(rest, vec4(0)), lessThan(low, vec4(0)));
    const uvec4 odd = uvec4(mix(ivec4(bits) - 1, ivec4(bits) + 1, away));
    const bvec4 as_it_is = equal(uvec4(equal(rest, vec4(0))) | (bits & 1u), uvec4(1));
    precise vec4 result = high + uintBitsToFloat(mix(odd, bits, as_it_is));

    return result;
}

ivec2 pair(int v)
{
    return ivec2(v >> 16, v & 0xFFFF);
}

vec4 bytes_of(uint word, uint type)
{
    const ivec4 v = ivec4(word << 24, word << 16, word << 8, word);

    return type == U8 ? vec4(uvec4(v) >> 24) : vec4(v >> 24);
}

vec4 residual_of(uint pixel, uint four)
{
    const uint at = residual_at + pixel * residual_pitch;

    if (residual_type != F32)
        return bytes_of(from_word[at + four], residual_type);
    return uintBitsToFloat(
        uvec4(from_word[at + 4 * four], from_word[at + 4 * four + 1], from_word[at + 4 * four + 2], from_word[at + 4 * four + 3]));
}

vec4 bias_of(uint four)
{
    const uint at = bias_at + 4 * four;

    return uintBitsToFloat(uvec4(fixed_word[at], fixed_word[at + 1], fixed_word[at + 2], fixed_word[at + 3]));
}

void store(uint pixel, uint four, vec4 sum)
{
    precise vec4 value = sum;

    if (bias_first == 0)
        value = sum + bias_of(four);

    if (residual_mode != NONE) {
        precise vec4 r = residual_of(pixel, four) * residual_scale;

        value = value + r;
    }
    if (relu != 0)
        value = mix(vec4(0), value, greaterThan(value, vec4(0)));
    if (to.type == F32) {
        const uint at = to.at + pixel * to.pitch + 4 * four;

        for (uint i = 0; i < 4; i++)
            to_word[at + i] = floatBitsToUint(value[i]);
    } else {
        const vec4 low = vec4(to.type == U8 ? 0.0 : -128.0), high = vec4(to.type == U8 ? 255.0 : 127.0);
        precise vec4 scaled = value * out_scale;
        const uvec4 b = uvec4(ivec4(roundEven(clamp(scaled, low, high)))) & 0xFF;

        to_word[to.at + pixel * to.pitch + four] = b.x | b.y << 8 | b.z << 16 | b.w << 24;
    }
}

void main()
{
    const uint lane = gl_LocalInvocationID.x, word = lane % SLAB, pixels = uint(to.width * to.height);
    const uint outs = (uint(channels) + TILE_OUT - 1) / TILE_OUT * TILE_OUT, first = gl_WorkGroupID.y * TILE_OUT;
    const ivec2 size = pair(kernel), step = pair(dilation);
    const uint words = uint(size.x * size.y) * from.pitch;
    const uint quad = lane % (TILE_OUT / 4), row = lane / (TILE_OUT / 4);
    ivec2 base[PIXELS]; // of the input pixels under the kernel's first tap
    ivec2 tap = ivec2(0);
    uint channel = word; // of the tap's pixel
    const vec4 start = bias_first != 0 ? bias_of(first / 4 + quad) : vec4(0);
    precise vec4 sum[4] = vec4[4](start, start, start, start);

    for (uint i = 0; i < PIXELS; i++) {
        const int p = int(min(gl_WorkGroupID.x * TILE + lane / SLAB + i * (128 / SLAB), pixels - 1));

        base[i] = ivec2(p / to.width, p % to.width) * pair(stride) - pair(pad);
    }
    for (uint slab = 0; slab * SLAB < words; slab++) {
        while (channel >= from.pitch) {
            channel -= from.pitch;
            tap = tap.y + 1 < size.y ? ivec2(tap.x, tap.y + 1) : ivec2(tap.x + 1, 0);
        }
        for (uint i = 0; i < PIXELS; i++) {
            const ivec2 at = base[i] + tap * step;
            const uint p = lane / SLAB + i * (128 / SLAB);
            uint v = 0;

            if (tap.x < size.x && at.x >= 0 && at.y >= 0 && at.x < from.height && at.y < from.width)
                v = from_word[from.at + uint(at.x * from.width + at.y) * from.pitch + channel];
            inputs[word][(p / 4 + word) % (TILE / 4)][p % 4] = uintBitsToFloat(v);
        }
        for (uint i = 0; i < WEIGHTS; i++) {
            const uint out_channel = lane % TILE_OUT, w = lane / TILE_OUT + i * (128 / TILE_OUT);

            weights[w][out_channel / 4][out_channel % 4] =
                uintBitsToFloat(fixed_word[weights_at + (slab * SLAB + w) * outs + first + out_channel]);
        }
        barrier();
        for (uint k = 0; k < SLAB; k++) {
            const vec4 x = inputs[k][(row + k) % (TILE / 4)], w = weights[k][quad];

            for (uint i = 0; i < 4; i++)
                sum[i] = by_parts != 0 ? fused(x[i], w, sum[i]) : fma(vec4(x[i]), w, sum[i]);
        }
        barrier();
        channel += SLAB;
    }
    for (uint i = 0; i < 4; i++) {
        const uint pixel = gl_WorkGroupID.x * TILE + 4 * row + i;

        if (pixel < pixels && first + 4 * quad < uint(channels))
            store(pixel, first / 4 + quad, sum[i]);
    }
}
