// Unexplained rays of the pixels around pixels left to votes. Constants: pipeline/gpu/verify.h. Definition:
// pipeline/method/render/verify.c.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0
#version 450
#extension GL_GOOGLE_include_directive : require

layout(local_size_x = 32, local_size_y = 4) in;

#include "blend_view.glsl"
#include "verify.glsl"
#include "verify_explain.glsl"
#include "verify_needed.glsl"

layout(std430, binding = 6) buffer Totals { float totals[]; }; // out, the second plane: apertures of unexplained rays

bool seen(uint v, int x, int y)
{
    const uint at = view[v].at.first + uint(y + view[v].at.iy) * uint(pitch) + uint(x + view[v].at.ix);
    const uint right = (view[v].at.flags & VIEW_RIGHT) != 0 ? 1 : 0;
    const uint below = (view[v].at.flags & VIEW_BELOW) != 0 ? uint(pitch) : 0;

    return (view[v].at.flags & VIEW_VALID) == 0 ||
           (is_valid(at) && is_valid(at + right) && is_valid(at + below) && is_valid(at + right + below));
}

void main()
{
    const int x = int(gl_GlobalInvocationID.x), row = int(gl_GlobalInvocationID.y), y = rays_top() + row;
    const uint at = uint(row) * uint(width) + uint(x);
    precise float sum = 0.0;

    if (x >= width || at >= rays || !needed(x, y))
        return;
    for (uint v = 0; v < ray_views; v++) {
        if (x >= view[v].at.x0 && x < view[v].at.x1 && y >= view[v].at.y0 && y < view[v].at.y1 && seen(v, x, y))
            sum += unexplained(v, x, y);
    }
    totals[rays + at] = sum;
}
