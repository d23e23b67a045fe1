// Points of sweeps, seen from a view: their weights by cell and level. An invocation per point. Constants:
// pipeline/method/disparity/device_second.c. Definition: gather() of pipeline/method/disparity/candidates.c.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0
#version 450

layout(local_size_x = 64) in;

layout(std430, binding = 0) readonly buffer Points { uvec2 points[]; }; // struct gpu_sweep_point[]
// int32_t[sweeps][levels][2]: x and y that a point's place is reduced by
layout(std430, binding = 1) readonly buffer Shifts { ivec2 shifts[]; };
layout(std430, binding = 2) buffer Weights { uint weights[]; }; // in and out, uint32_t[rows][cols][levels]

layout(std430, push_constant) uniform Constants {
    uint count;
    int levels, cell, cols, rows;
};

void main()
{
    const uint at = gl_GlobalInvocationID.x + gl_GlobalInvocationID.y * 65536;
    uint level, weight, sweep;
    uvec2 point;
    ivec2 place;

    if (at >= count)
        return;
    point = points[at];
    level = point.y & 0xFF;
    weight = (point.y >> 8) & 0xFF;
    sweep = point.y >> 16;
    place = ivec2(point.x & 0xFFFF, point.x >> 16) - shifts[sweep * uint(levels) + level];
    if (place.x < 0 || place.y < 0)
        return;
    place /= cell;
    if (place.x < cols && place.y < rows)
        atomicAdd(weights[uint(place.y * cols + place.x) * uint(levels) + level], weight);
}
