// Means over the support regions from the sums of their rows: the second half of an aggregation, support_mean_row of
// kernels.h with the sum over rows. An invocation has four disparities of a pixel. Constants:
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
layout(std430, binding = 2) readonly buffer Sum { uint sum[]; }; // in, of support_sum
layout(std430, binding = 3) writeonly buffer Cost { uint cost[]; }; // in and out

layout(std430, push_constant) uniform Constants {
    int width, height;
    int across, down; // pixels around the tile that get means as well
};

void main()
{
    const Tile t = tiles[gl_WorkGroupID.z];
    const uint of_pixel = uint(t.nd) >> 2, in_row = gl_GlobalInvocationID.x;
    const int column = int(in_row / of_pixel), row = int(gl_WorkGroupID.y), x = t.left + column, y = t.top + row;
    const uint quad = t.quad + uint(row * t.pitch) * of_pixel + in_row;
    uint arm, count = 0, reciprocal, low = 0, high = 0, all;
    uvec4 mean;

    if (row >= t.rows || column >= t.pitch || x < t.x0 - across || y < t.y0 - down || x >= t.x0 + t.width + across ||
        y >= t.y0 + t.height + down)
        return;
    arm = arms[y * width + x];
    // Eleven rows of eleven pixels of 255 at most: sums of two disparities stay apart in 16 bits each.
    for (int j = -int((arm >> 16) & 0xFF); j <= int(arm >> 24); j++) {
        const uint there = arms[(y + j) * width + x], at = uint(int(quad) + j * t.pitch * int(of_pixel));

        count += 1 + (there & 0xFF) + ((there >> 8) & 0xFF);
        low += sum[2 * at];
        high += sum[2 * at + 1];
    }
    if (count < 2)
        return;
    reciprocal = (65536 + count - 1) / count;
    mean = uvec4(low & 0xFFFF, low >> 16, high & 0xFFFF, high >> 16) + count / 2;
    mean = (mean * reciprocal) >> 16;
    all = mean.x | mean.y << 8 | mean.z << 16 | mean.w << 24;
    cost[quad] = all;
}
