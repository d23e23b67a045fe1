// Filling of pixels that no view shows, along rows: the farther of the nearest known disparities to both sides, which
// the background has. Constants: pipeline/gpu/check.h. Definition: sst_fill_background().
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0
#version 450
#extension GL_GOOGLE_include_directive : require

layout(local_size_x = 32, local_size_y = 8) in;

#include "planes.glsl"

layout(std430, binding = 0) readonly buffer From { uint from[]; }; // a map
layout(std430, binding = 1) writeonly buffer To { uint to[]; }; // out: its words with these disparities; another buffer

layout(std430, push_constant) uniform Constants {
    int width, height, none;
};

int at(int i)
{
    return disparity_of(from[i]);
}

void main()
{
    const int x = int(gl_GlobalInvocationID.x), y = int(gl_GlobalInvocationID.y), row = y * width;
    uint there;

    if (x >= width || y >= height)
        return;
    there = from[row + x];
    if (disparity_of(there) == NONE) {
        int left = x - 1, right = x + 1;

        while (left >= 0 && at(row + left) == NONE)
            left--;
        while (right < width && at(row + right) == NONE)
            right++;
        there = with_disparity(
            there, uint(min(left >= 0 ? at(row + left) : NONE, right < width ? at(row + right) : NONE)));
    }
    to[row + x] = there;
}
