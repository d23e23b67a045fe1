// Filling: occlusions that are not known yet get the disparity that arrived there. Constants: pipeline/gpu/check.h.
// Definition: sst_fill_views().
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0
#version 450
#extension GL_GOOGLE_include_directive : require

layout(local_size_x = 32, local_size_y = 8) in;

#include "planes.glsl"

layout(std430, binding = 0) readonly buffer Maps { uint maps[]; };
layout(std430, binding = 1) buffer Arrived { uint arrived[]; }; // in; out: 0
layout(std430, binding = 2) buffer Out { uint result[]; }; // in and out

layout(std430, push_constant) uniform Constants {
    int width, height;
    uint own;
};

void main()
{
    const int x = int(gl_GlobalInvocationID.x), y = int(gl_GlobalInvocationID.y), at = y * width + x;
    uint there;

    if (x >= width || y >= height)
        return;
    there = arrived[at];
    if (checked_of(maps[own + uint(at)]) == OCCLUSION && disparity_of(result[at]) == NONE && there != 0)
        result[at] = with_disparity(result[at], there - 1);
    arrived[at] = 0;
}
