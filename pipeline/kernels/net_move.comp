// Copies and converts a tensor: layouts, floats and bytes. Constants: pipeline/gpu/net.h. Definition:
// reorders of the plan for the CPU, pipeline/method/network/plan_dnnl.c.
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

void main()
{
    const uint fours = (uint(channels) + 3) / 4, x = gl_GlobalInvocationID.x / fours, four = gl_GlobalInvocationID.x % fours;
    const uint pixel = gl_GlobalInvocationID.y * uint(to.width) + x;
    vec4 value;

    if (x >= uint(to.width))
        return;
    value = load(pixel, four);
    if (to.type == U8 || to.type == S8) {
        const vec4 low = vec4(to.type == U8 ? 0.0 : -128.0), high = vec4(to.type == U8 ? 255.0 : 127.0);
        const uvec4 b = uvec4(ivec4(roundEven(clamp(value, low, high)))) & 0xFF;

        to_word[to.at + pixel * to.pitch + four] = b.x | b.y << 8 | b.z << 16 | b.w << 24;
        return;
    }
    for (uint i = 0; i < 4; i++) {
        if (to.type == F32)
            to_word[to.at + pixel * to.pitch + 4 * four + i] = floatBitsToUint(value[i]);
        else if (4 * four + i < uint(channels))
            to_word[to.at + (4 * four + i) * to.pitch + pixel] = floatBitsToUint(value[i]);
    }
}
