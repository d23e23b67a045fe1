// The colour of each pixel with most votes, and how near its rays are to it: agree_mode and agree_near of kernels.h.
// Constants: pipeline/gpu/verify.h. Definition: pipeline/method/render/verify.c.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0
#version 450
#extension GL_GOOGLE_include_directive : require

layout(local_size_x = 32, local_size_y = 4) in;

layout(std430, binding = 0) readonly buffer Share { float share[]; };
layout(std430, binding = 1) readonly buffer Rays { uint ray[]; };
// out, uint32_t [count / 2, rounded up][rays]: weights of two views' rays, the first in the lower half
layout(std430, binding = 2) writeonly buffer NearOut { uint near[]; };
// out, float [2][rays]: the first plane: all votes of the pixel
layout(std430, binding = 3) writeonly buffer Totals { float totals[]; };

#include "verify.glsl"
#include "verify_needed.glsl"

const uint AGREE_MODE = 48, AGREE_NEAR = 64;
const uint STEP = 2;       // one ray in this many proposes its colour
const uint CANDIDATES = 6; // that are counted in one pass over the rays

uint distance_of(uint a, uint b)
{
    const ivec3 apart = abs(ivec3(a & 0xFF, (a >> 8) & 0xFF, (a >> 16) & 0xFF) -
                            ivec3(b & 0xFF, (b >> 8) & 0xFF, (b >> 16) & 0xFF));

    return uint(apart.r + apart.g + apart.b);
}

// The colour with most votes, the first of several.
uint mode_of(uint at)
{
    uint best = 0, mode = 0;

    for (uint base = 0; base < ray_views; base += CANDIDATES * STEP) {
        uint candidate[CANDIDATES], votes[CANDIDATES];

        for (uint i = 0; i < CANDIDATES; i++) {
            const uint k = base + i * STEP;

            candidate[i] = k < ray_views ? ray[k * rays + at] : 0;
            votes[i] = 0;
        }
        for (uint k = 0; k < ray_views; k++) {
            const uint other = ray[k * rays + at];

            for (uint i = 0; i < CANDIDATES; i++)
                votes[i] += (AGREE_MODE - min(distance_of(candidate[i], other), AGREE_MODE)) / 2 * (other >> 24);
        }
        for (uint i = 0; i < CANDIDATES; i++) {
            if (candidate[i] >> 24 != 0 && votes[i] > best) {
                best = votes[i];
                mode = candidate[i];
            }
        }
    }
    return mode;
}

uint near_of(uint k, uint at, uint mode)
{
    const uint r = k < ray_views ? ray[k * rays + at] : 0;

    return (AGREE_NEAR - min(distance_of(r, mode), AGREE_NEAR)) * (r >> 24);
}

void main()
{
    const int x = int(gl_GlobalInvocationID.x), row = int(gl_GlobalInvocationID.y), y = rays_top() + row;
    const uint at = uint(row) * uint(width) + uint(x);
    uint total = 0;

    if (x >= width || at >= rays || !needed(x, y))
        return;
    const uint mode = mode_of(at);

    for (uint k = 0; k < ray_views; k += 2)
        near[k / 2 * rays + at] = near_of(k, at, mode) | near_of(k + 1, at, mode) << 16;
    for (uint k = 0; k < ray_views; k++)
        total += ray[k * rays + at] >> 24;
    totals[at] = float(total);
}
