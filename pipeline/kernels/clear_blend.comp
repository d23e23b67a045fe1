// The nearest surface of each pixel that enough views confirm, and the colour of the rays that see it: clear_surface,
// clear_take and clear_blend of kernels.h. Constants: pipeline/gpu/clear.h.
// Definition: clear_{surface,take,blend}_ref.c.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0
#version 450
#extension GL_GOOGLE_include_directive : require

layout(local_size_x = 32, local_size_y = 4) in;

struct View {
    float x_q6, x_0, y_q6, y_0, bx, by;
    uint first, flags;
    int top, end;
};

layout(std430, binding = 0) readonly buffer Views { View view[]; }; // struct sst_gpu_clear_view[views]
layout(std430, binding = 1) readonly buffer Pixels { uint pixel[]; };
layout(std430, binding = 2) readonly buffer Landed { uint landed[]; }; // with `sampled`: the colours of rays
// out if merged, uint32_t[rows * width]: stored disparity of the surface in 16 bits, 0xFFFF: none; above it how many
// rays agree on the colour, times SST_GPU_CLEAR_SUPPORT
layout(std430, binding = 3) writeonly buffer Seen { uint seen[]; };
// with `sampled`: struct sst_gpu_clear_state[rows * width]; else not read
layout(std430, binding = 4) readonly buffer State { uint state[]; };
// out, uint32_t[rows * width]: R, G, B, weight 0..255: 255 is enough
layout(std430, binding = 5) writeonly buffer Out { uint result[]; };

layout(std430, push_constant) uniform Constants {
    int width, height, pitch, bins, cut, remove_label, coarse, wanted;
    uint views;
    float disp_min, disp_min_rest;
    int as_others;
    uint merged;
    int top, rows;
    uint sampled;
};

const uint MAX_VIEWS = 64;
const uint FULL = 2, PLAIN = 4;
const float RIM = 0.02;

// Rays of the pixel that are taken.
float weight[MAX_VIEWS], agree[MAX_VIEWS];
vec3 colour[MAX_VIEWS];
int rays = 0, own = -1;

#include "clear_surface.glsl"

ivec3 rgb(uint p)
{
    return ivec3(p & 0xFF, (p >> 8) & 0xFF, (p >> 16) & 0xFF);
}

vec3 bilinear(uint k, float x, float y)
{
    const int x0 = int(x), y0 = int(y);
    precise float part_x = (x - float(x0)) * 64.0 + 0.5;
    precise float part_y = (y - float(y0)) * 64.0 + 0.5;
    const int xp = int(part_x), yp = int(part_y);
    const uint at = view[k].first + uint(y0 - view[k].top) * uint(pitch) + uint(x0);
    const uint right = xp != 0 ? 1 : 0, below = yp != 0 ? uint(pitch) : 0;
    const ivec3 a = rgb(pixel[at]), b = rgb(pixel[at + right]);
    const ivec3 c = rgb(pixel[at + below]), d = rgb(pixel[at + below + right]);
    const ivec3 upper = 64 * a + xp * (b - a), lower = 64 * c + xp * (d - c);

    return vec3(64 * upper + yp * (lower - upper)) * (1.0 / 4096.0);
}

// Returns the mean level of the surface; 0: there is none.
float take_all(int x, int y, uint at)
{
    const uvec2 found = surface(at);

    if (found.y == 0)
        return 0.0;
    const float level_of_surface = quotient(found.x, found.y), px = disparity(level_of_surface);
    const uvec2 levels = levels_of(level_of_surface);
    int more = wanted;

    for (uint k = 0; k < views && more > 0; k++) {
        const uint ray = landed[k * uint(rows) * uint(pitch) + at], level = ray >> 1;
        precise float at_x = float(x) - px * view[k].bx;
        precise float at_y = float(y) - px * view[k].by;

        if (level < levels.x || level > levels.y || !(at_x >= 0.0) || !(at_y >= 0.0) || at_x > float(width - 1) ||
            at_y > float(height - 1))
            continue;
        weight[rays] = (ray & 1) != 0 ? 1.0 : RIM;
        colour[rays] = bilinear(k, at_x, at_y);
        agree[rays] = 1.0;
        more -= int(ray & 1);
        if (view[k].bx * view[k].bx + view[k].by * view[k].by < 1e-12)
            own = rays;
        rays++;
    }
    return level_of_surface;
}

// Rays that were sampled from raw frames; views without one as in take_all(), which this returns as.
float take_sampled(int x, int y, uint at, uint pixel_at)
{
    const float px = uintBitsToFloat(state[3 * pixel_at + 1]);

    for (uint k = 0; k < views; k++) {
        const uint ray = landed[k * uint(rows) * uint(pitch) + at], kind = ray >> 24;

        if (kind == 0)
            continue;
        precise float at_x = float(x) - px * view[k].bx;
        precise float at_y = float(y) - px * view[k].by;

        weight[rays] = (kind & FULL) != 0 ? 1.0 : RIM;
        colour[rays] = (kind & PLAIN) != 0 ? bilinear(k, at_x, at_y) : vec3(rgb(ray));
        agree[rays] = 1.0;
        if (view[k].bx * view[k].bx + view[k].by * view[k].by < 1e-12)
            own = rays;
        rays++;
    }
    return uintBitsToFloat(state[3 * pixel_at]);
}

vec3 mean()
{
    precise vec3 sum = vec3(0.0);
    precise float total = 0.0;

    for (int i = 0; i < rays; i++) {
        precise float w = weight[i] * agree[i];

        sum += w * colour[i];
        total += w;
    }
    return total > 0.0 ? sum / total : vec3(0.0);
}

float deviation(int i, vec3 from)
{
    const vec3 d = abs(colour[i] - from);

    return d.r + d.g + d.b;
}

// Colour of the rays that agree.
vec3 blend()
{
    vec3 to = mean();
    float largest = 0.0;

    for (int i = 0; i < rays; i++)
        largest = max(largest, deviation(i, to));
    if (largest <= 12.0)
        return to;
    for (int step = 0; step < 2; step++) {
        const float scale = 1.0 / (step == 0 ? 60.0 : 30.0);

        for (int i = 0; i < rays; i++) {
            const float t = deviation(i, to) * scale, t2 = t * t;

            agree[i] = 1.0 / (1.0 + t2 * t2);
        }
        to = mean();
    }
    return to;
}

void main()
{
    const int x = int(gl_GlobalInvocationID.x), row = int(gl_GlobalInvocationID.y);
    precise float total = 0.0, support = 0.0;

    if (x >= width || row >= rows)
        return;
    const uint at = uint(row) * uint(pitch) + uint(x), pixel_at = uint(row) * uint(width) + uint(x);
    const float level = sampled != 0 ? take_sampled(x, top + row, at, pixel_at) : take_all(x, top + row, at);
    vec3 to = blend();

    if (as_others == 0 && own >= 0 && weight[own] >= 1.0)
        to += clamp(2.0 - deviation(own, to) / 30.0, 0.0, 1.0) * (colour[own] - to);
    for (int i = 0; i < rays; i++) {
        total += weight[i];
        support += weight[i] * agree[i];
    }
    if (merged != 0) {
        precise float disp = (level - 1.0) * float(1 << coarse) + 0.5;

        seen[pixel_at] = (total > 0.0 ? uint(disp) : 0xFFFF) | uint(min(8.0 * support + 0.5, 255.0)) << 16;
    }
    total = min(total, 1.0);
    const uvec3 levels = min(uvec3(to + 0.5), uvec3(255));

    result[pixel_at] =
        levels.r | levels.g << 8 | levels.b << 16 | uint(255.0 * total * total + 0.5) << 24;
}
