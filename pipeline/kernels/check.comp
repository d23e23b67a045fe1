// Multi-view check of a view's disparities: do others hold the same surface where they put a pixel? The disparities
// that pixels without such a surface are tested at are shared by the group. Constants: pipeline/gpu/check.h.
// Definition: sst_disparity_check_views().
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0
#version 450
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require

layout(local_size_x = 32, local_size_y = 8) in;

#include "planes.glsl"

struct Other {
    uint first;
    int across, across_part, across_step, down, down_part, down_step;
};

layout(std430, binding = 0) readonly buffer Others { Other others[]; };
layout(std430, binding = 1) buffer Maps { uint maps[]; }; // out: the result in the words of the view

layout(std430, push_constant) uniform Constants {
    int width, height;
    uint own;
    int count, steps;
};

const int AGREE = 64, PIXEL = 64, GROUP = 256;
const int AHEAD = 4; // others whose maps are read at once

shared int failed[GROUP]; // pixels of the group that others do not hold, its lanes
shared uint failures, seen[GROUP]; // and, for each, whether they do at another disparity

// Disparity that another view has where it shows a point; NONE: nowhere.
int disparity_in(Other o, int x, int y, int d)
{
    const int xn = x + o.across + ((o.across_part + d * o.across_step) >> 16);
    const int yn = y + o.down + ((o.down_part + d * o.down_step) >> 16);

    return xn < 0 || yn < 0 || xn >= width || yn >= height ? NONE
                                                           : disparity_of(maps[o.first + uint(yn * width + xn)]);
}

// Past the last one, that one counts again.
bool agrees(int x, int y, int d)
{
    for (int i = 0; i < count; i += AHEAD) {
        bool found = false;

        [[unroll]] for (int k = 0; k < AHEAD; k++) {
            const int there = disparity_in(others[min(i + k, count - 1)], x, y, d);

            found = found || (there != NONE && abs(there - d) <= AGREE);
        }
        if (found)
            return true;
    }
    return false;
}

// The nearest disparities of all pixels first, which leave nothing to do for farther ones where others agree.
void test_others(ivec2 corner)
{
    const int all = int(failures);

    for (int i = int(gl_LocalInvocationIndex); i < all * steps; i += GROUP) {
        const int which = i % all, lane = failed[which];

        if (atomicOr(seen[which], 0) == 0 && agrees(corner.x + lane % 32, corner.y + lane / 32, i / all * PIXEL))
            atomicOr(seen[which], 1);
    }
}

void main()
{
    const int x = int(gl_GlobalInvocationID.x), y = int(gl_GlobalInvocationID.y), lane = int(gl_LocalInvocationIndex);
    const bool inside = x < width && y < height;
    const uint at = own + uint(y * width + x);
    const uint word = inside ? maps[at] : NONE;
    const int d = disparity_of(word);
    uint status = CORRECT, mine;

    if (lane == 0)
        failures = 0;
    barrier();
    if (inside && (d == NONE || !agrees(x, y, d))) {
        status = OCCLUSION;
        mine = atomicAdd(failures, 1);
        failed[mine] = lane;
        seen[mine] = 0;
    }
    barrier();
    test_others(ivec2(gl_WorkGroupID.xy) * ivec2(32, 8));
    barrier();
    if (status == OCCLUSION && seen[mine] != 0)
        status = MISMATCH;
    if (inside)
        maps[at] = with_check(word, status);
}
