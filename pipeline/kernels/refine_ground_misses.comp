// Histograms of the residuals of grounds' pixels, rounded to stored disparities. Buffers and constants:
// pipeline/gpu/refine.h. Definition: refine_ground_misses_reference().
#version 450
#extension GL_GOOGLE_include_directive : require

#include "refine_ground.glsl"

layout(local_size_x = 32, local_size_y = 8) in;

layout(std430, binding = 0) readonly buffer View { uint view[]; };
layout(std430, binding = 1) readonly buffer Grounds { Ground grounds[]; };
layout(std430, binding = 2) buffer Misses { uint misses[]; }; // [ground][bins]

layout(std430, push_constant) uniform Constants {
    int width, height;
    uvec2 labels, least;
    uint spread, bins;
};

const uint NONE = 0xFFFF, LABELS = 64;

// Grounds before that of label i + 1.
uint slot_of(uint i)
{
    return i < 32 ? bitCount(labels.x & ((1u << i) - 1))
                  : bitCount(labels.x) + bitCount(labels.y & ((1u << (i - 32)) - 1));
}

void main()
{
    const uvec2 at = gl_GlobalInvocationID.xy;
    uint pixel, i, q;
    uvec2 rounded;

    if (at.x >= uint(width) || at.y >= uint(height))
        return;
    pixel = view[at.y * uint(width) + at.x];
    i = (pixel >> 16) - 1;
    q = pixel & NONE;
    if (i >= LABELS || q == NONE || !has_label(labels, i))
        return;
    rounded = add(miss_of(grounds[i], at, q), uvec2(1u << 23, 0));
    atomicAdd(misses[slot_of(i) * bins + (rounded.y < 256 ? min(rounded.y << 8 | rounded.x >> 24, bins - 1) : bins - 1)], 1);
}
