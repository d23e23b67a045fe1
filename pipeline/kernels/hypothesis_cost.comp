// Costs of the hypotheses of a view: hypothesis_cost_row of kernels.h, and what follows from them for the optimisation.
// An invocation per pixel. Constants: pipeline/method/disparity/device_second.c. Definition: hypothesis_cost_ref.c.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0
#version 450
#extension GL_GOOGLE_include_directive : require

layout(local_size_x = 32, local_size_y = 8) in;

struct View {
    int x, y, dx, dy;
    uint first;
};

layout(std430, binding = 0) readonly buffer Views { View views[]; };
layout(std430, binding = 1) readonly buffer Pixels { uint pixels[]; };
layout(std430, binding = 2) readonly buffer Hypotheses { uvec4 hypotheses[]; }; // uint16_t[pixels][8]
// in: how many; out: how many | how many that are left << 8 | the cheapest << 16 | mark << 24
layout(std430, binding = 3) buffer Counts { uint counts[]; };
layout(std430, binding = 4) writeonly buffer Cost { uvec4 costs[]; }; // out, uint16_t[pixels][8]

layout(std430, push_constant) uniform Constants {
    int width, height, count;
    uint own;
    int tolerance, similar;
    uint most, settled, change, cheap;
};

#include "hypothesis_views.glsl"

void main()
{
    const int x = int(gl_GlobalInvocationID.x), y = int(gl_GlobalInvocationID.y), at = y * width + x;
    uint cost[8], number, cheapest = 0, least;
    uvec4 list;
    bool between;

    if (x >= width || y >= height)
        return;
    read_window(x, y);
    number = counts[at] & 0xFF;
    list = hypotheses[at];
    for (uint i = 0; i < 8; i++) {
        const uint d = (list[i >> 1] >> (16 * (i & 1))) & 0xFFFF;

        if (i >= number || (i > 0 && cost[0] < settled))
            cost[i] = FAR;
        else
            cost[i] = number == 1 ? 0 : cost_of(x, y, int(d));
    }
    // Another disparity than the pixel's own must be better by more than noise.
    least = cost[0];
    for (uint i = 1; i < number; i++) {
        cost[i] += change;
        cheapest = cost[i] < least ? i : cheapest;
        least = min(least, cost[i]);
    }
    between = number > 1 && cost[0] > change && cost[0] < cheap;
    counts[at] = number | (number > 1 && cost[0] < settled ? 1 : number) << 8 | cheapest << 16 | (between ? 1 << 24 : 0);
    costs[at] = uvec4(cost[0] | cost[1] << 16, cost[2] | cost[3] << 16, cost[4] | cost[5] << 16, cost[6] | cost[7] << 16);
}
