// Fraction of each pixel that the maps leave to votes: sst_verify_share() of verify_ref.h over all rays. Constants:
// pipeline/gpu/verify.h. Definition: pipeline/method/render/verify.c.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0
#version 450
#extension GL_GOOGLE_include_directive : require

layout(local_size_x = 32, local_size_y = 4) in;

#include "blend_view.glsl"

// struct sst_gpu_blend_params, with the place of each view among all of the picture
layout(std430, binding = 0) readonly buffer Params { Label label[256]; uint rarity[1024]; View view[]; };
layout(std430, binding = 1) readonly buffer Disp { uint disp[]; }; // as of blend.h
layout(std430, binding = 2) readonly buffer Sums { float sums[]; }; // in: sums of weights in the fourth plane
layout(std430, binding = 3) readonly buffer Out { uint result[]; }; // in: of blend
// in and out, float [3][rows * width]: the fraction, 0..1; between dispatches apertures of all rays, of rays that
// end in front
layout(std430, binding = 4) buffer Share { float share[]; };
layout(std430, binding = 5) buffer Cells { uint cell[]; };

#include "verify.glsl"
#include "verify_ramp.glsl"

const float ENOUGH = 0.2;
const uint PIXEL_BELOW = 2;

uint disparity(uint at)
{
    return (disp[at >> 1] >> ((at & 1) * 16)) & 0xFFFF;
}

float share_of(float there, float front, float assigned)
{
    precise float enough = ENOUGH * there;
    precise float left = 1.0 - quotient(assigned, enough);
    precise float result = max(left, 0.0) * ramp(quotient(front, there), FRONT_LOW, FRONT_HIGH);

    return result;
}

void main()
{
    const int x = int(gl_GlobalInvocationID.x), row = int(gl_GlobalInvocationID.y), y = top + row;
    const uint plane = uint(rows) * uint(width), at = uint(row) * uint(width) + uint(x);
    precise float there = 0.0, front = 0.0, enough = ENOUGH * all;

    if (x >= width || row >= rows)
        return;
    const float assigned = sums[at + 3 * plane];
    const uint cell_at = cell_of(x, y);

    if ((cell[cell_at] & CELL_WANTED) == 0 || !(assigned < enough)) {
        share[at] = 0.0;
        return;
    }
    if ((flags & FIRST) == 0) {
        there = share[at + plane];
        front = share[at + 2 * plane];
    }
    for (uint v = first_view; v < first_view + views; v++) {
        if (x < view[v].x0 || x >= view[v].x1 || y < view[v].y0 || y >= view[v].y1)
            continue;
        const uint d = disparity(view[v].first + uint(y + view[v].ny) * uint(pitch) + uint(x + view[v].nx));

        there += view[v].aperture;
        front += int(d) > nearest ? view[v].aperture : 0.0;
    }
    if ((flags & LAST) == 0) {
        share[at + plane] = there;
        share[at + 2 * plane] = front;
        return;
    }
    const float left = there > 0.0 ? share_of(there, front, assigned) : 0.0;

    share[at] = left;
    const uint found = left > 0.0 ? CELL_OPEN | ((result[at] >> 24 & PIXEL_BELOW) != 0 ? CELL_BELOW : 0) : 0;

    if ((cell[cell_at] & found) != found)
        atomicOr(cell[cell_at], found);
}
