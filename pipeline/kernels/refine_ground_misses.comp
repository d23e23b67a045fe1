// Histograms of the residuals of grounds' pixels, rounded to stored disparities. A group has 32 x 64 pixels. Buffers and
// constants: pipeline/gpu/refine.h. Definition: refine_ground_misses_reference().
#version 450
#extension GL_EXT_control_flow_attributes : require
#extension GL_GOOGLE_include_directive : require

#include "refine_ground.glsl"

layout(local_size_x = 32, local_size_y = 8) in;

layout(std430, binding = 0) readonly buffer View { uint view[]; };
layout(std430, binding = 1) readonly buffer Grounds { Ground grounds[]; };
layout(std430, binding = 2) buffer Misses { uint counts[]; }; // [ground][bins]

layout(std430, push_constant) uniform Constants {
    int width, height;
    uvec2 labels, least;
    uint spread, bins;
};

#include "tally.glsl"

const uint NONE = 0xFFFF, LABELS = 64;

// Grounds before that of label i + 1.
uint slot_of(uint i)
{
    return i < 32 ? bitCount(labels.x & ((1u << i) - 1))
                  : bitCount(labels.x) + bitCount(labels.y & ((1u << (i - 32)) - 1));
}

void count(uvec2 at, uint pixel)
{
    const uint i = (pixel >> 16) - 1, q = pixel & NONE;
    uvec2 rounded;

    if (i >= LABELS || q == NONE || !has_label(labels, i))
        return;
    rounded = add(miss_of(grounds[i], at, q), uvec2(1u << 23, 0));
    tally(slot_of(i) * bins + (rounded.y < 256 ? min(rounded.y << 8 | rounded.x >> 24, bins - 1) : bins - 1));
}

void main()
{
    const uint x = gl_GlobalInvocationID.x, y = gl_WorkGroupID.y * 64 + gl_LocalInvocationID.y;
    uint pixel[8];

    [[unroll]] for (uint i = 0; i < 8; i++)
        pixel[i] = x < uint(width) && y + 8 * i < uint(height) ? view[(y + 8 * i) * uint(width) + x] : 0;
    tally_begin(256);
    [[unroll]] for (uint i = 0; i < 8; i++)
        count(uvec2(x, y + 8 * i), pixel[i]);
    tally_end(256);
}
