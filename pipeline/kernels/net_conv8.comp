// A convolution on bytes. Each invocation has 4 x 4 results of its group's tile; inputs and weights become floats in
// shared memory, in which 512 products have an exact sum. Constants: pipeline/gpu/net.h. Definition: the plan for the
// CPU, pipeline/method/network/plan_conv.c.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0
#version 450
#extension GL_GOOGLE_include_directive : require

layout(local_size_x = 128) in;

#include "net_conv8.glsl"

const uint TILE = 64, TILE_OUT = 32, SLAB = 8, PIXELS = TILE * SLAB / 128, WEIGHTS = TILE_OUT * SLAB / 128;
const uint EXACT = 512 / (4 * SLAB);

// Rows of inputs are turned by a column for each word, so that invocations that write side by side use other banks.
shared vec4 inputs[4 * SLAB][TILE / 4];
shared vec4 weights[4 * SLAB][TILE_OUT / 4];

void main()
{
    const uint lane = gl_LocalInvocationID.x, word = lane % SLAB, pixels = uint(to.width * to.height);
    const uint outs = (uint(channels) + TILE_OUT - 1) / TILE_OUT * TILE_OUT, first = gl_WorkGroupID.y * TILE_OUT;
    const ivec2 size = pair(kernel), step = pair(dilation);
    const uint words = uint(size.x * size.y) * from.pitch;
    const uint quad = lane % (TILE_OUT / 4), row = lane / (TILE_OUT / 4);
    ivec2 base[PIXELS]; // of the input pixels under the kernel's first tap
    ivec2 tap = ivec2(0);
    uint four = word; // of the tap's pixel
    ivec4 sum[4] = ivec4[4](ivec4(0), ivec4(0), ivec4(0), ivec4(0));
    vec4 part[4] = vec4[4](vec4(0), vec4(0), vec4(0), vec4(0));

    for (uint i = 0; i < PIXELS; i++) {
        const int p = int(min(gl_WorkGroupID.x * TILE + lane / SLAB + i * (128 / SLAB), pixels - 1));

        base[i] = ivec2(p / to.width, p % to.width) * pair(stride) - pair(pad);
    }
    for (uint slab = 0; slab * SLAB < words; slab++) {
        while (four >= from.pitch) {
            four -= from.pitch;
            tap = tap.y + 1 < size.y ? ivec2(tap.x, tap.y + 1) : ivec2(tap.x + 1, 0);
        }
        for (uint i = 0; i < PIXELS; i++) {
            const ivec2 at = base[i] + tap * step;
            const uint p = lane / SLAB + i * (128 / SLAB);
            vec4 v = vec4(0);

            if (tap.x < size.x && at.x >= 0 && at.y >= 0 && at.x < from.height && at.y < from.width)
                v = bytes_of(from_word[from.at + uint(at.x * from.width + at.y) * from.pitch + four], from.type);
            for (uint k = 0; k < 4; k++)
                inputs[4 * word + k][(p / 4 + word) % (TILE / 4)][p % 4] = v[k];
        }
        for (uint i = 0; i < WEIGHTS; i++) {
            const uint out_channel = lane % TILE_OUT, w = lane / TILE_OUT + i * (128 / TILE_OUT);
            const vec4 v = bytes_of(fixed_word[weights_at + (slab * SLAB + w) * outs + first + out_channel], S8);

            for (uint k = 0; k < 4; k++)
                weights[4 * w + k][out_channel / 4][out_channel % 4] = v[k];
        }
        barrier();
        for (uint k = 0; k < 4 * SLAB; k++) {
            const vec4 x = inputs[k][(row + k / 4) % (TILE / 4)], w = weights[k][quad];

            for (uint i = 0; i < 4; i++)
                part[i] += x[i] * w;
        }
        barrier();
        four += SLAB;
        if (slab % EXACT == EXACT - 1) {
            for (uint i = 0; i < 4; i++) {
                sum[i] += ivec4(part[i]);
                part[i] = vec4(0);
            }
        }
    }
    for (uint i = 0; i < 4; i++) {
        const uint pixel = gl_WorkGroupID.x * TILE + 4 * row + i;

        if (pixel < pixels && first + 4 * quad < uint(channels))
            store(pixel, first / 4 + quad, sum[i] + ivec4(part[i]));
    }
}
