// Words that a step reads made of resident planes, and resident planes of its results. Constants and conversions:
// pipeline/gpu/convert.h. Definition: the steps.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0
#version 450

layout(local_size_x = 32, local_size_y = 8) in;

layout(std430, binding = 0) readonly buffer Colours { uint pixel[]; };
layout(std430, binding = 1) readonly buffer Map { uint map[]; };
layout(std430, binding = 2) readonly buffer From { uint source[]; };
layout(std430, binding = 3) buffer To { uint result[]; }; // in and out; nothing else is written

layout(std430, push_constant) uniform Constants {
    int width, height, full_width;
    uint conversion, value, colours, from, to;
};

const uint TO_HYPOTHESES = 0, TO_LUMA = 1, TO_STEPS = 2, FROM_CHOICE = 3, FROM_PLAIN = 4, TO_FEATURES = 5;
const uint NONE = 0xFFFF, OUTSIDE = 255, CODES = 253;
const int FEATURE_WORDS = 16;
const uint STEPS_NONE = 32768, CHANGED = 1 << 24;

bool counts(int i)
{
    return pixel[colours + i] >> 24 != 0;
}

uint luma(int i)
{
    const uint p = pixel[colours + i];

    return (77 * (p & 0xFF) + 150 * (p >> 8 & 0xFF) + 29 * (p >> 16 & 0xFF) + 128) >> 8;
}

uint hypotheses(int i)
{
    const uint d = map[i] & NONE;
    const uint code = !counts(i) ? OUTSIDE : d == NONE ? 0 : 1 + min(d, value) * CODES / value;

    return pixel[colours + i] & 0xFFFFFF | code << 24;
}

uint lumas(int x, int i)
{
    const int next = x + 1 < width ? i + 1 : i;

    return luma(i) | luma(next) << 8 | max(map[i] & NONE, map[next] & NONE) << 16;
}

void main()
{
    const ivec2 at = ivec2(gl_GlobalInvocationID.xy);
    const int i = at.y * width + at.x;
    uint word = 0, old;

    if (at.x >= width || at.y >= height)
        return;
    old = result[to + i];
    switch (conversion) {
    case TO_HYPOTHESES: word = hypotheses(i); break;
    case TO_LUMA: word = lumas(at.x, i); break;
    case TO_STEPS: word = min(map[i] & NONE, STEPS_NONE) * 65537; break;
    case FROM_CHOICE:
        word = source[from + i] & NONE | old & 0xFF000000;
        word |= ((source[from + i] & CHANGED) != 0 ? source[from + i] : old) & 0xFF0000;
        break;
    case FROM_PLAIN: word = old & 0xFFFF0000 | source[from + i] & NONE; break;
    case TO_FEATURES:
        word = source[from + at.y * width + at.x % full_width * FEATURE_WORDS + at.x / full_width] ^ 0x80808080;
        break;
    }
    result[to + i] = word;
}
