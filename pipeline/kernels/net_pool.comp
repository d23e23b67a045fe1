// Means over bins, to floats. A group sums four channels of a bin, in two parts. Constants:
// pipeline/gpu/net.h. Definition: op_adaptive_pool().
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0
#version 450
#extension GL_GOOGLE_include_directive : require

layout(local_size_x = 64) in;

#include "quotient.glsl"

layout(std430, binding = 0) readonly buffer Fixed { uint fixed_word[]; };
layout(std430, binding = 1) readonly buffer From { uint from_word[]; };
layout(std430, binding = 2) buffer To { uint to_word[]; };

struct Tensor {
    uint at, pitch, type;
    int width, height;
};

layout(std430, push_constant) uniform Constants {
    Tensor from, to;
    int channels;
    float scale;
    uint taps_at;
    float factor, in_add, in_min, add, least;
};

const uint F32 = 0, U8 = 1, S8 = 2, PLANES = 3;

// Four channels of a pixel of `from`; those of planes that there are not are 0.
vec4 load(uint pixel, uint four)
{
    uvec4 v = uvec4(0);

    if (from.type == U8 || from.type == S8) {
        const uint word = from_word[from.at + pixel * from.pitch + four];
        const ivec4 b = ivec4(word << 24, word << 16, word << 8, word);
        precise vec4 value = (from.type == U8 ? vec4(uvec4(b) >> 24) : vec4(b >> 24)) * scale;

        return value;
    }
    for (uint i = 0; i < 4; i++) {
        if (from.type == F32)
            v[i] = from_word[from.at + pixel * from.pitch + 4 * four + i];
        else if (4 * four + i < uint(channels))
            v[i] = from_word[from.at + (4 * four + i) * from.pitch + pixel];
    }
    precise vec4 value = uintBitsToFloat(v) * scale;

    return value;
}

shared vec4 highs[64], lows[64];

// high + low + value + rest: high is the rounded sum.
void add_to(inout vec4 high, inout vec4 low, vec4 value, vec4 rest)
{
    precise vec4 sum = high + value;
    precise vec4 back = sum - high;
    precise vec4 error = (high - (sum - back)) + (value - back);
    precise vec4 lower = low + (error + rest);

    high = sum;
    low = lower;
}

vec4 high_part(vec4 v)
{
    return uintBitsToFloat(floatBitsToUint(v) & 0xFFFFF000u);
}

// (high + low) / n, rounded once but for a part of 2^-20 of its last digit; halves exactly. n is below 2^24.
vec4 divide(vec4 high, vec4 low, float n)
{
    const float n_high = uintBitsToFloat(floatBitsToUint(n) & 0xFFFFF000u);
    precise float n_low = n - n_high;
    precise vec4 q = high / n;
    const vec4 q_high = high_part(q);
    precise vec4 q_low = q - q_high;
    precise vec4 rest = (((high - q_high * n_high) - q_high * n_low) - q_low * n_high) - q_low * n_low;
    precise vec4 more = rest + low;
    precise vec4 value = q + vec4(quotient(more.x, n), quotient(more.y, n), quotient(more.z, n), quotient(more.w, n));

    return value;
}

void main()
{
    const uint fours = (uint(channels) + 3) / 4, x = gl_WorkGroupID.x / fours, four = gl_WorkGroupID.x % fours;
    const uint y = gl_WorkGroupID.y, lane = gl_LocalInvocationID.x, width = uint(to.width), height = uint(to.height);
    const uint y0 = y * uint(from.height) / height, y1 = ((y + 1) * uint(from.height) + height - 1) / height;
    const uint x0 = x * uint(from.width) / width, x1 = ((x + 1) * uint(from.width) + width - 1) / width;
    const uint n = (y1 - y0) * (x1 - x0);
    vec4 high = vec4(0), low = vec4(0);

    for (uint i = lane; i < n; i += 64)
        add_to(high, low, load((y0 + i / (x1 - x0)) * uint(from.width) + x0 + i % (x1 - x0), four), vec4(0));
    highs[lane] = high;
    lows[lane] = low;
    for (uint half_of = 32; half_of > 0; half_of /= 2) {
        barrier();
        if (lane < half_of) {
            add_to(high, low, highs[lane + half_of], lows[lane + half_of]);
            highs[lane] = high;
            lows[lane] = low;
        }
    }
    if (lane == 0) {
        const vec4 value = divide(high, low, float(n));
        const uint at = to.at + (y * width + x) * to.pitch + 4 * four;

        for (uint i = 0; i < 4; i++)
            to_word[at + i] = floatBitsToUint(value[i]);
    }
}
