// Filling of pixels that no view shows, after fill_along: rows are known as a whole or not at all. Unknown ones get the
// last known one above, or the first one below; without any, all are `none`. Constants: pipeline/gpu/check.h.
// Definition: sst_fill_background().
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

bool is_known(int row)
{
    return disparity_of(from[row * width]) != NONE;
}

void main()
{
    const int x = int(gl_GlobalInvocationID.x), y = int(gl_GlobalInvocationID.y);
    int row = y;

    if (x >= width || y >= height)
        return;
    while (row >= 0 && !is_known(row))
        row--;
    for (row = row < 0 ? y : row; row < height && !is_known(row);)
        row++;
    to[y * width + x] =
        with_disparity(from[y * width + x], uint(row < height ? disparity_of(from[row * width + x]) : none));
}
