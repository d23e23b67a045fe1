// Disparities that the similar pixels of 5x5 windows share: subpixel_window_row of kernels.h. Constants:
// pipeline/method/disparity/device_subpixel.c. Definition: subpixel_ref.c, and share_row() of pipeline/method/disparity/subpixel.c.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0
#version 450
#extension GL_GOOGLE_include_directive : require

#include "quotient.glsl"
#include "similar.glsl"

layout(local_size_x = 32, local_size_y = 8) in;

// uint32_t[height][width]: R, G, B from the lowest byte up
layout(std430, binding = 0) readonly buffer Colours { uint colours[]; };
layout(std430, binding = 1) readonly buffer Disparities { uint disp[]; };
layout(std430, binding = 2) readonly buffer Weights { vec2 weights[]; }; // of subpixel_fit
layout(std430, binding = 3) readonly buffer Slopes { vec2 slopes[]; };
// out: disparity of the window, px, and its weight
layout(std430, binding = 4) writeonly buffer Out { vec2 result[]; };

layout(std430, push_constant) uniform Constants {
    int width, height, most;
    float apart, few, enough;
};

const int NONE = 32768;

void main()
{
    const int x = int(gl_GlobalInvocationID.x), y = int(gl_GlobalInvocationID.y), at = y * width + x;
    precise float weight = 0.0, product = 0.0;
    vec2 slope;
    int d;

    if (x >= width || y >= height)
        return;
    d = int(disp[at] & 0xFFFF);
    slope = slopes[at];
    for (int i = -2; i <= 2; i++) {
        for (int j = -2; j <= 2; j++) {
            const int xn = x + j, yn = y + i, there = yn * width + xn;

            if (xn < 0 || yn < 0 || xn >= width || yn >= height)
                continue;
            precise float off = slope.y * float(i) + slope.x * float(j);
            precise float above = float(int(disp[there] & 0xFFFF) - d) * (1.0 / 64.0) - off;
            if (!similar(colours[there], colours[at], most) || abs(above) > apart)
                continue;
            precise float moved = weights[there].x * off;
            weight = weight + weights[there].x;
            product = product + (weights[there].y - moved);
        }
    }
    precise float all_weight = weight + few;
    precise float all_product = product + few * (float(d) * (1.0 / 64.0));
    precise float kept = min(weight, enough) + few;

    result[at] = vec2(quotient(all_product, all_weight), d < NONE ? kept : 0.0);
}
