// Winner of each pixel's summed costs between the steps, and its confidence: winner_row of kernels.h and the parabola
// through three costs. Eight invocations look through a pixel's costs together. Constants: pipeline/gpu/match.h.
// Definition: winner_ref.c.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0
#version 450

layout(local_size_x = 8, local_size_y = 8) in;

struct Tile {
    int x0, y0, width, height, left, top, pitch, rows, first, steps, nd;
    uint quad;
};

layout(std430, binding = 0) readonly buffer Tiles { Tile tiles[]; };
layout(std430, binding = 1) readonly buffer Sum { uint sum[]; };
layout(std430, binding = 2) readonly buffer Cost { uint cost[]; };
// out, uint32_t[rows][width]: disparity in 1/64 px above the smallest | confidence << 16
layout(std430, binding = 3) writeonly buffer Out { uint result[]; };

layout(std430, push_constant) uniform Constants {
    int width, top, divisor;
    int from_cost; // not 0: of the costs instead of the sums
};

shared uint found[8][8];

// Sums at disparities 2 * i and 2 * i + 1.
uint pair(uint quad, int i)
{
    uint c;

    if (from_cost == 0)
        return sum[2 * quad + uint(i)];
    c = cost[quad + uint(i >> 1)] >> (16 * (i & 1));
    return (c & 0xFF) | (c & 0xFF00) << 8;
}

int value(uint quad, int d)
{
    return int((pair(quad, d >> 1) >> (16 * (d & 1))) & 0xFFFF);
}

// The parabola's minimum, in 1/64 steps from the middle one.
int between(int before, int at, int after)
{
    const int curvature = before - 2 * at + after, slope = 32 * (before - after);

    if (curvature <= 0)
        return 0;
    return slope >= 0 ? (slope + curvature / 2) / curvature : -((-slope + curvature / 2) / curvature);
}

// The least of what the invocations of a pixel have.
uint least_of(uint mine)
{
    const uint pixel = gl_LocalInvocationID.y, lane = gl_LocalInvocationID.x;
    uint least = mine;

    barrier();
    found[pixel][lane] = mine;
    barrier();
    for (int i = 0; i < 8; i++)
        least = min(least, found[pixel][i]);
    return least;
}

void main()
{
    const Tile t = tiles[gl_WorkGroupID.z];
    const int column = int(gl_GlobalInvocationID.y), row = int(gl_WorkGroupID.x), lane = int(gl_LocalInvocationID.x);
    const bool inside = column < t.width && row < t.height;
    const int x = t.x0 + column, y = t.y0 + row;
    const uint quad = t.quad + uint((y - t.top) * t.pitch + x - t.left) * (uint(t.nd) >> 2);
    uint key = 0xFFFFFFFF, other = 0xFFFF;
    int best, at, gap, d, offset = 0;

    for (int i = lane; inside && 2 * i < t.steps; i += 8) {
        const uint two = pair(quad, i);

        key = min(key, (two & 0xFFFF) << 16 | uint(2 * i));
        if (2 * i + 1 < t.steps)
            key = min(key, (two & 0xFFFF0000) | uint(2 * i + 1));
    }
    key = least_of(key);
    best = int(key & 0xFFFF);
    for (int i = lane; inside && 2 * i < t.steps; i += 8) {
        const uint two = pair(quad, i);

        if (2 * i + 1 < best || 2 * i > best + 1)
            other = min(other, two & 0xFFFF);
        if (2 * i + 1 < t.steps && (2 * i + 2 < best || 2 * i > best))
            other = min(other, two >> 16);
    }
    other = least_of(other);
    if (!inside || lane != 0)
        return;
    at = int(key >> 16);
    if (best > 0 && best + 1 < t.steps)
        offset = between(value(quad, best - 1), at, value(quad, best + 1));
    d = (best * 64 + offset + divisor / 2) / divisor + t.first * 64 / divisor;
    gap = int(other) - at;
    result[(y - top) * width + x] = uint(d) & 0xFFFF | uint(gap > 0 ? 255 * gap / (gap + 128) : 0) << 16;
}
