// Costs summed over the horizontal arms of the support regions: the first half of an aggregation, support_sum_row of
// kernels.h without the sum over rows. An invocation has four disparities of a pixel. Constants:
// pipeline/gpu/match.h. Definition: support_ref.c.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0
#version 450

layout(local_size_x = 64) in;

struct Tile {
    int x0, y0, width, height, left, top, pitch, rows, first, steps, nd;
    uint quad;
};

layout(std430, binding = 0) readonly buffer Tiles { Tile tiles[]; };
layout(std430, binding = 1) readonly buffer Arms { uint arms[]; };
layout(std430, binding = 2) readonly buffer Cost { uint cost[]; };
layout(std430, binding = 3) writeonly buffer Sum { uint sum[]; }; // out: sums of costs over left and right arms

layout(std430, push_constant) uniform Constants {
    int width, height;
    int across, down; // pixels around the tile that are summed as well
};

void main()
{
    const Tile t = tiles[gl_WorkGroupID.z];
    const uint of_pixel = uint(t.nd) >> 2, in_row = gl_GlobalInvocationID.x;
    const int column = int(in_row / of_pixel), row = int(gl_WorkGroupID.y), x = t.left + column, y = t.top + row;
    const uint quad = t.quad + uint(row * t.pitch) * of_pixel + in_row;
    uint arm, even = 0, odd = 0;

    if (row >= t.rows || column >= t.pitch || x < t.x0 - across || y < t.y0 - down || x >= t.x0 + t.width + across ||
        y >= t.y0 + t.height + down)
        return;
    arm = arms[y * width + x];
    for (int i = -min(int(arm & 0xFF), column); i <= min(int((arm >> 8) & 0xFF), t.pitch - 1 - column); i++) {
        const uint c = cost[uint(int(quad) + i * int(of_pixel))];

        even += c & 0x00FF00FF; // disparities 0 and 2
        odd += (c >> 8) & 0x00FF00FF;
    }
    sum[2 * quad] = (even & 0xFFFF) | odd << 16;
    sum[2 * quad + 1] = even >> 16 | (odd & 0xFFFF0000);
}
