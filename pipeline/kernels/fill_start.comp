// Filling of a view's disparities, the beginning: mismatches get the median of the nearest correct pixels in 16
// directions, occlusions nothing yet. A group shares the directions of its mismatches. Constants:
// pipeline/gpu/check.h. Definition: sst_fill_views().
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0
#version 450
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require

layout(local_size_x = 32, local_size_y = 8) in;

#include "planes.glsl"

layout(std430, binding = 0) readonly buffer Maps { uint maps[]; };
layout(std430, binding = 1) writeonly buffer Out { uint result[]; }; // out: the view's map with these disparities
layout(std430, binding = 2) writeonly buffer Arrived { uint arrived[]; }; // out, uint32_t[height][width]: 0

layout(std430, push_constant) uniform Constants {
    int width, height;
    uint own;
};

const uint FARTHER = 0x10000;
const uint GROUP = 256, WAYS = 16;
const int AHEAD = 4; // pixels of a direction that are read at once

shared uint waiting[GROUP], mismatches; // pixels of the group, its lanes
shared uint found[GROUP];               // in the directions of 16 of them

// About 22.5 degrees apart, in half pixels.
const ivec2 ways[16] = { { 2, 0 },  { 2, 1 },   { 2, 2 },   { 1, 2 },   { 0, 2 },  { -1, 2 },
                         { -2, 2 }, { -2, 1 },  { -2, 0 },  { -2, -1 }, { -2, -2 }, { -1, -2 },
                         { 0, -2 }, { 1, -2 },  { 2, -2 },  { 2, -1 } };

// Half of a product, rounded towards 0.
int half_of(int n)
{
    return n < 0 ? -(-n / 2) : n / 2;
}

// Disparity of the nearest correct pixel; NONE: the picture ends before.
uint nearest(int x, int y, ivec2 way)
{
    uint first = FARTHER;

    for (int r = 1; first == FARTHER; r += AHEAD) {
        uint there[AHEAD];

        [[unroll]] for (int k = 0; k < AHEAD; k++) {
            const int i = x + half_of(way.x * (r + k)), j = y + half_of(way.y * (r + k));
            const bool inside = i >= 0 && j >= 0 && i < width && j < height;

            there[k] = inside ? maps[own + uint(j * width + i)] : NONE; // as one that is correct
        }
        [[unroll]] for (int k = AHEAD - 1; k >= 0; k--)
            first = checked_of(there[k]) == CORRECT ? there[k] & 0xFFFF : first;
    }
    return first;
}

// The invocation that has the median of 16 directions, the lower one of an even number of those that are known, or the
// first of none, is the one that writes it.
bool has_median(uint way, uint mine)
{
    const uint first = gl_LocalInvocationIndex - way;
    uint known = 0, before = 0;

    for (uint k = 0; k < WAYS; k++) {
        const uint v = found[first + k];

        known += v != NONE ? 1 : 0;
        before += v < mine || (v == mine && k < way) ? 1 : 0;
    }
    return before == (max(known, 1) - 1) / 2;
}

void fill_mismatches(ivec2 corner)
{
    const uint i = gl_LocalInvocationIndex, all = mismatches, way = i % WAYS;
    const ivec2 step = ways[way];

    for (uint first = 0; first < all; first += GROUP / WAYS) {
        const uint which = first + i / WAYS;
        const int lane = which < all ? int(waiting[which]) : 0, x = corner.x + lane % 32, y = corner.y + lane / 32;
        const uint mine = which < all ? nearest(x, y, step) : NONE;

        found[i] = mine;
        barrier();
        if (which < all && has_median(way, mine))
            result[y * width + x] = with_disparity(maps[own + uint(y * width + x)], mine);
        barrier();
    }
}

void main()
{
    const int x = int(gl_GlobalInvocationID.x), y = int(gl_GlobalInvocationID.y);
    const bool inside = x < width && y < height;
    const uint there = inside ? maps[own + uint(y * width + x)] : 0, status = checked_of(there);

    if (gl_LocalInvocationIndex == 0)
        mismatches = 0;
    barrier();
    if (inside && status == MISMATCH)
        waiting[atomicAdd(mismatches, 1)] = gl_LocalInvocationIndex;
    else if (inside)
        result[y * width + x] = status == CORRECT ? there : with_disparity(there, NONE);
    if (inside)
        arrived[y * width + x] = 0;
    barrier();
    fill_mismatches(ivec2(gl_WorkGroupID.xy) * ivec2(32, 8));
}
