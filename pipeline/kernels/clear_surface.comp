// The surface of each pixel of a clear picture with rays from raw frames, for clear_sample. Buffers and constants:
// pipeline/gpu/clear.h. Definition: clear_surface_ref.c.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0
#version 450
#extension GL_GOOGLE_include_directive : require

layout(local_size_x = 32, local_size_y = 4) in;

layout(std430, binding = 0) readonly buffer Landed { uint landed[]; }; // as of clear.h
layout(std430, binding = 1) writeonly buffer State { uint state[]; }; // out, struct sst_gpu_clear_state[rows * width]

layout(std430, push_constant) uniform Constants {
    int width, height, pitch, bins, cut, remove_label, coarse, wanted;
    uint views;
    float disp_min, disp_min_rest;
    int as_others;
    uint merged;
    int top, rows;
    uint sampled;
};

#include "clear_surface.glsl"

void main()
{
    const int x = int(gl_GlobalInvocationID.x), row = int(gl_GlobalInvocationID.y);

    if (x >= width || row >= rows)
        return;
    const uint at = 3 * (uint(row) * uint(width) + uint(x));
    const uvec2 found = surface(uint(row) * uint(pitch) + uint(x));

    if (found.y == 0) {
        state[at] = state[at + 1] = state[at + 2] = 0;
        return;
    }
    const float level = quotient(found.x, found.y);

    state[at] = floatBitsToUint(level);
    state[at + 1] = floatBitsToUint(disparity(level));
    state[at + 2] = uint(wanted);
}
