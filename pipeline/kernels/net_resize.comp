// Bilinear resize to floats. Constants: pipeline/gpu/net.h. Definition: op_resize().
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0
#version 450

layout(local_size_x = 64) in;

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

vec4 between(vec4 a, vec4 b, float part)
{
    precise vec4 step = part * (b - a);
    precise vec4 value = a + step;

    return value;
}

void main()
{
    const uint fours = (uint(channels) + 3) / 4, x = gl_GlobalInvocationID.x / fours, four = gl_GlobalInvocationID.x % fours;
    const uint y = gl_GlobalInvocationID.y, across = taps_at + 3 * (uint(to.height) + x), down = taps_at + 3 * y;

    if (x >= uint(to.width))
        return;

    const uint width = uint(from.width), top = fixed_word[down] * width, bottom = fixed_word[down + 1] * width;
    const uint left = fixed_word[across], right = fixed_word[across + 1];
    const float part = uintBitsToFloat(fixed_word[across + 2]);
    const vec4 t = between(load(top + left, four), load(top + right, four), part);
    const vec4 u = between(load(bottom + left, four), load(bottom + right, four), part);
    const vec4 value = between(t, u, uintBitsToFloat(fixed_word[down + 2]));
    const uint at = to.at + (y * uint(to.width) + x) * to.pitch + 4 * four;

    for (uint i = 0; i < 4; i++)
        to_word[at + i] = floatBitsToUint(value[i]);
}
