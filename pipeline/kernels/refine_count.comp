// Pixels by label and disparity, added up over views. A group has 32 x 64 pixels. Buffers and constants:
// pipeline/gpu/refine.h. Definition: refine_count_reference().
#version 450
#extension GL_EXT_control_flow_attributes : require
#extension GL_GOOGLE_include_directive : require

layout(local_size_x = 32, local_size_y = 8) in;

layout(std430, binding = 0) readonly buffer View { uint view[]; };
layout(std430, binding = 1) buffer Counts { uint counts[]; };

layout(std430, push_constant) uniform Constants {
    int width, height;
    uint labels, bins;
};

#include "tally.glsl"

const uint NONE = 0xFFFF;

void count(uint pixel)
{
    const uint label = pixel >> 16;

    if (label != 0 && label <= labels && (pixel & NONE) < bins)
        tally((label - 1) * bins + (pixel & NONE));
}

void main()
{
    const uint x = gl_GlobalInvocationID.x, y = gl_WorkGroupID.y * 64 + gl_LocalInvocationID.y;
    uint pixel[8];

    [[unroll]] for (uint i = 0; i < 8; i++)
        pixel[i] = x < uint(width) && y + 8 * i < uint(height) ? view[(y + 8 * i) * uint(width) + x] : 0;
    tally_begin(256);
    [[unroll]] for (uint i = 0; i < 8; i++)
        count(pixel[i]);
    tally_end(256);
}
