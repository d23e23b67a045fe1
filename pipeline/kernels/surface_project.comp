// Surfaces that other views project onto each pixel of a view: the farthest and the nearest one. Constants:
// pipeline/method/disparity/device_second.c. Definition: project_around() of
// pipeline/method/disparity/around.c.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0
#version 450

layout(local_size_x = 32, local_size_y = 8) in;

struct Other {
    uint first;
    int across, across_part, across_step, down, down_part, down_step;
};

layout(std430, binding = 0) readonly buffer Others { Other others[]; }; // struct sst_gpu_check_other[]
layout(std430, binding = 1) readonly buffer Maps { uint maps[]; }; // of all views
// in and out, uint32_t[2][height][width]: farthest (SST_DISP_NONE: none), nearest (0: none)
layout(std430, binding = 2) buffer Projected { uint projected[]; };

layout(std430, push_constant) uniform Constants {
    int width, height;
};

const int NONE = 0xFFFF;

void main()
{
    const Other o = others[gl_GlobalInvocationID.z];
    const int x = int(gl_GlobalInvocationID.x), y = int(gl_GlobalInvocationID.y);
    int d, xt, yt;

    if (x >= width || y >= height)
        return;
    d = int(maps[o.first + uint(y * width + x)] & 0xFFFF);
    xt = x + o.across + ((o.across_part + d * o.across_step) >> 16);
    yt = y + o.down + ((o.down_part + d * o.down_step) >> 16);
    if (d == NONE || xt < 0 || yt < 0 || xt >= width || yt >= height)
        return;
    atomicMin(projected[yt * width + xt], uint(d));
    atomicMax(projected[width * height + yt * width + xt], uint(d));
}
