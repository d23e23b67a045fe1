// hypothesis_path.comp for devices with subgroups of a group's 32 invocations: the last pixel's path costs and
// hypotheses come from the other invocations' registers, without a barrier. Words of four pixels are read while the
// four before them are followed.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0
#version 450
#extension GL_EXT_control_flow_attributes : require
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_shuffle : require

layout(local_size_x = 32) in;

layout(std430, binding = 0) readonly buffer Pixels { uint pixels[]; };
layout(std430, binding = 1) readonly buffer Penalties { uint penalties[256]; };
layout(std430, binding = 2) readonly buffer Hypotheses { uint hypotheses[]; };
layout(std430, binding = 3) readonly buffer Counts { uint counts[]; };
layout(std430, binding = 4) readonly buffer Cost { uint costs[]; };
layout(std430, binding = 5) buffer Sum { uint sum[]; };

layout(std430, push_constant) uniform Constants {
    int width, height;
    uint own;
    int near, way, ways, first;
};

const uint FAR = 12000;
const int CHUNK = 4;

shared uint table[256];

// What is read of a pixel.
struct Pixel {
    uint entry, colour, cost;
    bool several;
    int d;
};

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

Pixel read(ivec2 at)
{
    const uint i = gl_SubgroupInvocationID & 7;
    const ivec2 inside = clamp(at, ivec2(0), ivec2(width - 1, height - 1)); // what is read beyond the end does not count
    const uint pixel = uint(inside.y * width + inside.x);
    Pixel p;

    p.entry = 8 * pixel + i;
    p.colour = pixels[own + pixel];
    p.cost = half_of(costs[p.entry >> 1], i);
    p.several = ((counts[pixel] >> 8) & 0xFF) > 1;
    p.d = int(half_of(hypotheses[p.entry >> 1], i));
    return p;
}

// The cheapest way from one of the last pixel's hypotheses to disparity d, above the least of them. `before`: path cost and
// hypothesis << 16 of this invocation's
uint way_to(int d, uint before, uint penalty)
{
    const uint first = gl_SubgroupInvocationID & ~7u, p1 = penalty & 0xFFFF, p2 = penalty >> 16;
    uint least = 0xFFFF, best = 0xFFFF;

    [[unroll]] for (uint j = 0; j < 8; j++) {
        const uint from = subgroupShuffle(before, first + j), l = from & 0xFFFF;
        const int jump = abs(d - int(from >> 16));

        least = min(least, l);
        best = min(best, l + (jump <= near ? 0 : jump <= 2 * near ? p1 : p2));
    }
    return min(best, least + p2) - least;
}

void main()
{
    const uint i = gl_SubgroupInvocationID & 7;
    const int along = way + int(gl_WorkGroupID.x), dx = along == 0 ? 1 : along == 1 ? -1 : 0;
    const int dy = along == 2 ? 1 : along == 3 ? -1 : 0; // sst_gpu_way() of pipeline/gpu/match.h
    const int number = int(4 * gl_WorkGroupID.y + (gl_SubgroupInvocationID >> 3)), paths = dy == 0 ? height : width;
    const int length = dy == 0 ? width : height;
    const bool inside = number < paths;
    const ivec2 step = ivec2(dx, dy);
    ivec2 at = dy == 0 ? ivec2(dx > 0 ? 0 : width - 1, number) : ivec2(number, dy > 0 ? 0 : height - 1);
    Pixel now[CHUNK], next[CHUNK];
    uint last = 0, before = 0;

    for (uint k = gl_LocalInvocationID.x; k < 256; k += 32)
        table[k] = penalties[k];
    barrier();
    [[unroll]] for (int k = 0; k < CHUNK; k++, at += step)
        next[k] = read(at);
    for (int done = 0; done < length; done += CHUNK) {
        [[unroll]] for (int k = 0; k < CHUNK; k++)
            now[k] = next[k];
        [[unroll]] for (int k = 0; k < CHUNK; k++, at += step)
            next[k] = read(at);
        [[unroll]] for (int k = 0; k < CHUNK; k++) {
            const Pixel p = now[k];
            const uint way_here = way_to(p.d, before, table[step_between(p.colour, last)]);
            const bool begins = done + k == 0, counts_here = inside && done + k < length;
            const uint l = begins ? p.cost : p.several ? p.cost + way_here : i > 0 ? FAR : 0;

            // Other directions may add at the same time.
            if (counts_here && first != 0)
                sum[p.entry] = begins || p.several ? l : 0;
            else if (counts_here && (begins || p.several))
                atomicAdd(sum[p.entry], l);
            before = l | uint(p.d) << 16;
            last = p.colour;
        }
    }
}
