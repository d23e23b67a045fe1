// Planes through large windows, subpixel_plane_row of kernels.h, and the disparities of the windows that follow them.
// Constants: pipeline/method/disparity/device_subpixel.c. Definition: subpixel_ref.c, and follow_row() of
// pipeline/method/disparity/subpixel.c.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0
#version 450
#extension GL_GOOGLE_include_directive : require

#include "quotient.glsl"
#include "similar.glsl"

layout(local_size_x = 32, local_size_y = 8) in;

layout(std430, binding = 0) readonly buffer Colours { uint colours[]; };
layout(std430, binding = 1) buffer Disparities { uint disp[]; };             // in and out
layout(std430, binding = 2) readonly buffer Shared { vec2 windows[]; }; // disparity, weight
layout(std430, binding = 3) buffer Slopes { vec2 slopes[]; };                // in and out: px per pixel to the right, down

layout(std430, push_constant) uniform Constants {
    int width, height, most, start;
    int reach, last;
    float apart, enough;
};

const int NONE = 32768;
const uint UNKNOWN = 0xFFFF;
const int STEP = 4;      // SST_SUBPIXEL_STEP
const float RIDGE = 0.2; // SST_SUBPIXEL_RIDGE

uint near_first(float disp_px, int first)
{
    precise float rounded = floor(disp_px * 64.0 + 0.5);

    return uint(clamp(int(rounded), max(first - reach, 0), min(first + reach, last)));
}

void main()
{
    const int x = int(gl_GlobalInvocationID.x), y = int(gl_GlobalInvocationID.y), at = y * width + x;
    precise float n = 0.0, sx = 0.0, sy = 0.0, sz = 0.0, sxx = 0.0, sxy = 0.0, syy = 0.0, sxz = 0.0, syz = 0.0;
    vec2 slope, here;
    int d, first;

    if (x >= width || y >= height)
        return;
    if (start != 0) {
        slopes[at] = vec2(0.0);
        return;
    }
    d = int(disp[at] & 0xFFFF);
    first = int(disp[at] >> 16);
    if (d >= NONE) {
        disp[at] = UNKNOWN | uint(first) << 16;
        return;
    }
    slope = slopes[at];
    here = windows[at];
    for (int i = -3; i <= 3; i++) {
        precise float middle = here.x + slope.y * float(i * STEP);
        precise float rn = 0.0, rx = 0.0, rxx = 0.0, rz = 0.0, rxz = 0.0;

        for (int j = -3; j <= 3; j++) {
            const int xn = x + STEP * j, yn = y + STEP * i, there = yn * width + xn;

            if (xn < 0 || yn < 0 || xn >= width || yn >= height)
                continue;
            precise float on_plane = middle + slope.x * float(j * STEP);
            precise float above = windows[there].x - on_plane;
            if (!similar(colours[there], colours[at], most) || abs(above) > apart)
                continue;
            const float w = windows[there].y;
            precise float wz = w * above;
            rn = rn + w;
            rx = rx + w * float(j);
            rxx = rxx + w * float(j * j);
            rz = rz + wz;
            rxz = rxz + wz * float(j);
        }
        n = n + rn;
        sx = sx + rx;
        sy = sy + rn * float(i);
        sxx = sxx + rxx;
        sxy = sxy + rx * float(i);
        syy = syy + rn * float(i * i);
        sz = sz + rz;
        sxz = sxz + rxz;
        syz = syz + rz * float(i);
    }
    const float each = quotient(1.0, n);
    precise float mx = sx * each, my = sy * each, mz = sz * each;
    precise float xx = sxx - sx * mx + n * RIDGE;
    precise float xy = sxy - sx * my;
    precise float yy = syy - sy * my + n * RIDGE;
    precise float xz = sxz - sx * mz;
    precise float yz = syz - sy * mz;
    precise float det = xx * yy - xy * xy;
    const float inverse = quotient(1.0, det);
    precise float u = (xz * yy - yz * xy) * inverse;
    precise float v = (yz * xx - xz * xy) * inverse;
    precise float wide = here.x + (mz - u * mx - v * my);
    precise vec2 slopes_now = slope + vec2(u, v) * (1.0 / float(STEP));
    precise float share = here.y < enough ? 1.0 - quotient(here.y, enough) : 0.0;
    precise float mixed = here.x + share * (wide - here.x);

    slopes[at] = slopes_now;
    disp[at] = near_first(mixed, first) | uint(first) << 16;
}
