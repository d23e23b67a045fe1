// Points in space that a view finds: sparse pixels that their own disparity does not explain, at the disparity that
// alone does. A group per pixel; its invocations test the disparities. Constants: device_second.c. Definition:
// sst_sweep_view() of sweep.c, both of pipeline/method/disparity/.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0
#version 450
#extension GL_GOOGLE_include_directive : require

layout(local_size_x = 64) in;

struct View {
    int x, y, dx, dy;
    uint first;
};

layout(std430, binding = 0) readonly buffer Views { View views[]; }; // struct gpu_hypothesis_view[]
layout(std430, binding = 1) readonly buffer Pixels { uint pixels[]; }; // as of `hypothesis_cost`
layout(std430, binding = 2) readonly buffer Map { uint map[]; }; // of the view
// out, uint32_t[rows][columns]: level | weight << 16; weight 0: no point
layout(std430, binding = 3) writeonly buffer Out { uint result[]; };

layout(std430, push_constant) uniform Constants {
    int width, height, count;
    uint own;
    int tolerance, similar;
    uint most, settled, change, cheap;
    int stride, level, levels, apart, distinct, weight_most;
};

#include "hypothesis_views.glsl"

const uint NONE = 0xFFFF, LANES = 64;

shared uint costs[256];
shared uint found;

// The least of what the invocations have.
uint least_of(uint mine)
{
    barrier();
    found = 0xFFFFFFFF;
    barrier();
    atomicMin(found, mine);
    barrier();
    return found;
}

void main()
{
    const uint lane = gl_LocalInvocationID.x, columns = gl_NumWorkGroups.x;
    const int x = stride / 2 + int(gl_WorkGroupID.x) * stride, y = stride / 2 + int(gl_WorkGroupID.y) * stride;
    const int at = y * width + x;
    const uint d = map[at] & 0xFFFF;
    uint key = 0xFFFFFFFF, next = FAR, best, weight;
    bool tested = pixels[own + uint(at)] >> 24 != OUTSIDE;

    read_window(x, y);
    if (tested && d != NONE)
        tested = cost_of(x, y, int(d)) >= settled;
    for (uint l = lane; tested && l < uint(levels); l += LANES) {
        costs[l] = cost_of(x, y, int(l) * level);
        key = min(key, costs[l] << 16 | l);
    }
    key = least_of(key);
    best = key & 0xFFFF;
    for (uint l = lane; tested && l < uint(levels); l += LANES)
        next = abs(int(l) - int(best)) > apart ? min(next, costs[l]) : next;
    next = least_of(next);
    if (lane != 0)
        return;
    weight = tested ? next - (key >> 16) : 0;
    weight = weight < uint(distinct) ? 0 : min(weight, uint(weight_most));
    result[gl_WorkGroupID.y * columns + gl_WorkGroupID.x] = weight == 0 ? 0 : best | weight << 16;
}
