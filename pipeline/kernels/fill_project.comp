// Filling: the correct pixels of another view arrive where their disparities put them; the nearest surface stays.
// Constants: pipeline/gpu/check.h. Definition: sst_fill_views().
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0
#version 450
#extension GL_GOOGLE_include_directive : require

layout(local_size_x = 32, local_size_y = 8) in;

#include "planes.glsl"

layout(std430, binding = 0) readonly buffer Maps { uint maps[]; };
layout(std430, binding = 1) buffer Arrived { uint arrived[]; }; // in and out: disparity + 1

layout(std430, push_constant) uniform Constants {
    int width, height;
    uint first;
    int across, across_part, across_step, down, down_part, down_step;
};

void main()
{
    const int x = int(gl_GlobalInvocationID.x), y = int(gl_GlobalInvocationID.y);
    int d, xt, yt;
    uint there;

    if (x >= width || y >= height)
        return;
    there = maps[first + uint(y * width + x)];
    if (checked_of(there) != CORRECT)
        return;
    d = disparity_of(there);
    xt = x + across + ((across_part + d * across_step) >> 16);
    yt = y + down + ((down_part + d * down_step) >> 16);
    if (xt >= 0 && yt >= 0 && xt < width && yt < height)
        atomicMax(arrived[yt * width + xt], uint(d) + 1);
}
