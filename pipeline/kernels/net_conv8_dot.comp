// net_conv8.comp by dot products of four bytes: same tiles, but inputs and weights stay bytes in shared memory, and
// sums are whole numbers. Instructions of signed bytes are the ones that most devices have: of bytes u from 0 to 255, u
// - 128 is multiplied, and 128 times the sum of a channel's weights is added at the end.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0
#version 450
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_spirv_intrinsics : require

layout(local_size_x = 128) in;

#include "net_conv8.glsl"
#include "dot.glsl"

const uint TILE = 64, TILE_OUT = 32, SLAB = 8, PIXELS = TILE * SLAB / 128, WEIGHTS = TILE_OUT * SLAB / 128;

// Turned as in net_conv8.comp.
shared uvec4 inputs[SLAB][TILE / 4];
shared uvec4 weights[SLAB][TILE_OUT / 4];
shared int weight_sum[128]; // of a lane; lanes of a channel are TILE_OUT apart

void main()
{
    const uint lane = gl_LocalInvocationID.x, word = lane % SLAB, pixels = uint(to.width * to.height);
    const uint outs = (uint(channels) + TILE_OUT - 1) / TILE_OUT * TILE_OUT, first = gl_WorkGroupID.y * TILE_OUT;
    const ivec2 size = pair(kernel), step = pair(dilation);
    const uint words = uint(size.x * size.y) * from.pitch;
    const uint quad = lane % (TILE_OUT / 4), row = lane / (TILE_OUT / 4);
    const uint turn = from.type == U8 ? 0x80808080u : 0u;
    ivec2 base[PIXELS]; // of the input pixels under the kernel's first tap
    ivec2 tap = ivec2(0);
    uint four = word; // of the tap's pixel
    ivec4 sum[4] = ivec4[4](ivec4(0), ivec4(0), ivec4(0), ivec4(0));
    ivec4 missing = ivec4(0);
    int own_sum = 0;

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
            uint v = 0;

            if (tap.x < size.x && at.x >= 0 && at.y >= 0 && at.x < from.height && at.y < from.width)
                v = from_word[from.at + uint(at.x * from.width + at.y) * from.pitch + four];
            inputs[word][(p / 4 + word) % (TILE / 4)][p % 4] = v ^ turn;
        }
        for (uint i = 0; i < WEIGHTS; i++) {
            const uint out_channel = lane % TILE_OUT, w = lane / TILE_OUT + i * (128 / TILE_OUT);
            const uint v = fixed_word[weights_at + (slab * SLAB + w) * outs + first + out_channel];

            weights[w][out_channel / 4][out_channel % 4] = v;
            own_sum += dot4(v, 0x01010101u);
        }
        barrier();
        for (uint k = 0; k < SLAB; k++) {
            const uvec4 x = inputs[k][(row + k) % (TILE / 4)], w = weights[k][quad];

            for (uint i = 0; i < 4; i++)
                sum[i] += ivec4(dot4(x[i], w.x), dot4(x[i], w.y), dot4(x[i], w.z), dot4(x[i], w.w));
        }
        barrier();
        four += SLAB;
    }
    weight_sum[lane] = own_sum;
    barrier();
    for (uint i = 0; i < 128 && from.type == U8; i += TILE_OUT) {
        const uint c = 4 * quad + i;

        missing += 128 * ivec4(weight_sum[c], weight_sum[c + 1], weight_sum[c + 2], weight_sum[c + 3]);
    }
    for (uint i = 0; i < 4; i++) {
        const uint pixel = gl_WorkGroupID.x * TILE + 4 * row + i;

        if (pixel < pixels && first + 4 * quad < uint(channels))
            store(pixel, first / 4 + quad, sum[i] + missing);
    }
}
