// Buffers, constants and results of net_conv8.comp and its variants. A group has a tile of pixels times channels, and
// works through the words of the kernel in slabs. Definition: the plan for the CPU,
// pipeline/method/network/plan_conv.c.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0

layout(std430, binding = 0) readonly buffer Fixed { uint fixed_word[]; };
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

const uint F32 = 0, U8 = 1, S8 = 2, FUSED = 1, NONE = 2;

vec4 bytes_of(uint word, uint type)
{
    const ivec4 v = ivec4(word << 24, word << 16, word << 8, word);

    return type == U8 ? vec4(uvec4(v) >> 24) : vec4(v >> 24);
}

ivec2 pair(int v)
{
    return ivec2(v >> 16, v & 0xFFFF);
}

// value + q * residual_scale, rounded once: the product in two exact parts, and the sum in two parts.
float fused(float value, float q)
{
    const float high = uintBitsToFloat(floatBitsToUint(residual_scale) & 0xFFFFF000u);
    precise float low = residual_scale - high;
    precise float product = q * high;
    precise float sum = value + product;
    precise float back = sum - value;
    precise float rest = (value - (sum - back)) + (product - back);
    precise float result = sum + (rest + q * low);

    return result;
}

vec4 residual_of(uint pixel, uint four)
{
    const uint at = residual_at + pixel * residual_pitch;

    if (residual_type != F32)
        return bytes_of(from_word[at + four], residual_type);
    return uintBitsToFloat(
        uvec4(from_word[at + 4 * four], from_word[at + 4 * four + 1], from_word[at + 4 * four + 2], from_word[at + 4 * four + 3]));
}

vec4 scale_of(uint four)
{
    const uint at = scales_at + 4 * four;

    return uintBitsToFloat(uvec4(fixed_word[at], fixed_word[at + 1], fixed_word[at + 2], fixed_word[at + 3]));
}

vec4 bias_of(uint four)
{
    const uint at = bias_at + 4 * four;

    return uintBitsToFloat(uvec4(fixed_word[at], fixed_word[at + 1], fixed_word[at + 2], fixed_word[at + 3]));
}

void store_scaled(uint pixel, uint four, ivec4 sum, vec4 scale, vec4 bias)
{
    precise vec4 value = vec4(sum);

    if (bias_first != 0) {
        value = (value + bias) * scale;
    } else {
        value = value * scale;
        value = value + bias;
    }
    if (residual_mode != NONE) {
        const vec4 q = residual_of(pixel, four);

        if (residual_mode == FUSED) {
            value = vec4(fused(value.x, q.x), fused(value.y, q.y), fused(value.z, q.z), fused(value.w, q.w));
        } else {
            precise vec4 r = q * residual_scale;

            value = value + r;
        }
    }
    if (relu != 0)
        value = mix(vec4(0), value, greaterThan(value, vec4(0)));
    if (to.type == F32) {
        const uint at = to.at + pixel * to.pitch + 4 * four;

        for (uint i = 0; i < 4; i++)
            to_word[at + i] = floatBitsToUint(value[i]);
    } else {
        const vec4 low = vec4(to.type == U8 ? 0.0 : -128.0), high = vec4(to.type == U8 ? 255.0 : 127.0);
        const uvec4 b = uvec4(ivec4(roundEven(clamp(value, low, high)))) & 0xFF;

        to_word[to.at + pixel * to.pitch + four] = b.x | b.y << 8 | b.z << 16 | b.w << 24;
    }
}

void store(uint pixel, uint four, ivec4 sum)
{
    store_scaled(pixel, four, sum, scale_of(four), bias_of(four));
}
