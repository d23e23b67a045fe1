// Paths of the optimisation over hypotheses: hypothesis_path_row of kernels.h. Eight invocations follow a
// path together, each with one hypothesis of every pixel; four paths a group. Constants:
// pipeline/method/disparity/device_second.c. Definition: hypothesis_path_ref.c.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0
#version 450

layout(local_size_x = 8, local_size_y = 4) in;

layout(std430, binding = 0) readonly buffer Pixels { uint pixels[]; };
// uint32_t[256]: p1 | p2 << 16 by colour step
layout(std430, binding = 1) readonly buffer Penalties { uint penalties[256]; };
layout(std430, binding = 2) readonly buffer Hypotheses { uint hypotheses[]; };
layout(std430, binding = 3) readonly buffer Counts { uint counts[]; }; // of hypothesis_cost
layout(std430, binding = 4) readonly buffer Cost { uint costs[]; };
layout(std430, binding = 5) buffer Sum { uint sum[]; }; // in and out, uint32_t[pixels][8]

layout(std430, push_constant) uniform Constants {
    int width, height;
    uint own;
    int near, way, ways, first;
};

const uint FAR = 12000;

// Path costs of this and of the last pixel, and their hypotheses.
shared uint path[2][4][8];
shared int hypothesis[2][4][8];

int step_between(uint a, uint b)
{
    const ivec3 p = ivec3(a & 0xFF, (a >> 8) & 0xFF, (a >> 16) & 0xFF);
    const ivec3 q = ivec3(b & 0xFF, (b >> 8) & 0xFF, (b >> 16) & 0xFF), step = abs(p - q);

    return max(max(step.x, step.y), step.z);
}

uint half_of(uint two, uint i)
{
    return (two >> (16 * (i & 1))) & 0xFFFF;
}

void main()
{
    const uint i = gl_LocalInvocationID.x, which = gl_LocalInvocationID.y;
    const int along = way + int(gl_WorkGroupID.x), dx = along == 0 ? 1 : along == 1 ? -1 : 0;
    const int dy = along == 2 ? 1 : along == 3 ? -1 : 0; // sst_gpu_way() of pipeline/gpu/match.h
    const int number = int(gl_GlobalInvocationID.y), paths = dy == 0 ? height : width;
    const int length = dy == 0 ? width : height;
    ivec2 at = dy == 0 ? ivec2(dx > 0 ? 0 : width - 1, number) : ivec2(number, dy > 0 ? 0 : height - 1);
    uint last = 0;

    for (uint k = 0; k < uint(length); k++, at += ivec2(dx, dy)) {
        const uint now = k & 1, before = 1 - now;
        const bool inside = number < paths;
        const uint pixel = inside ? uint(at.y * width + at.x) : 0, entry = 8 * pixel + i;
        const uint colour = pixels[own + pixel], cost = half_of(costs[entry >> 1], i);
        const bool several = ((counts[pixel] >> 8) & 0xFF) > 1;
        const int d = int(half_of(hypotheses[entry >> 1], i));
        uint l = cost;

        if (k > 0) {
            const uint p = penalties[step_between(colour, last)], p1 = p & 0xFFFF, p2 = p >> 16;
            uint least = path[before][which][0], best;

            for (int j = 1; j < 8; j++)
                least = min(least, path[before][which][j]);
            best = least + p2;
            for (int j = 0; j < 8; j++) {
                const int jump = abs(d - hypothesis[before][which][j]);

                best = min(best, path[before][which][j] + (jump <= near ? 0 : jump <= 2 * near ? p1 : p2));
            }
            l = several ? cost + best - least : i > 0 ? FAR : 0;
        }
        path[now][which][i] = l;
        hypothesis[now][which][i] = d;
        // Other directions may add at the same time.
        if (inside && first != 0)
            sum[entry] = k == 0 || several ? l : 0;
        else if (inside && (k == 0 || several))
            atomicAdd(sum[entry], l);
        last = colour;
        barrier();
    }
}
