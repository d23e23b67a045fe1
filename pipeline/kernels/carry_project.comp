// Maps carried to a view: the pixels of others arrive where their disparities put them. The largest value stays: the
// nearest surface, correct ones first. Constants: pipeline/method/disparity/carry.c. Definition:
// sst_disparity_carry().
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0
#version 450
#extension GL_GOOGLE_include_directive : require

layout(local_size_x = 32, local_size_y = 8) in;

#include "planes.glsl"

struct Source {
    uint first;
    int across, across_part, across_step, down, down_part, down_step;
};

layout(std430, binding = 0) readonly buffer Sources { Source sources[]; }; // struct sst_gpu_check_other[]
layout(std430, binding = 1) readonly buffer Maps { uint maps[]; };
// in and out, uint32_t[1 or 3][height][width]: the largest of disparity + 1 << 8 | correct << 7 | half of the
// confidence (0: nothing); the farthest disparity (SST_DISP_NONE); bits of the sources (0)
layout(std430, binding = 2) buffer Arrived { uint arrived[]; };

layout(std430, push_constant) uniform Constants {
    int width, height, agreed, checked;
};

// Order of pixels of one disparity: the correct one, then the surer one.
uint rank_of(uint word)
{
    return (word >> 17 & 0x7F) | (checked != 0 && checked_of(word) == CORRECT ? 0x80 : 0);
}

void main()
{
    const Source s = sources[gl_GlobalInvocationID.z];
    const int x = int(gl_GlobalInvocationID.x), y = int(gl_GlobalInvocationID.y), n = width * height;
    uint there;
    int d, xt, yt;

    if (x >= width || y >= height)
        return;
    there = maps[s.first + uint(y * width + x)];
    d = disparity_of(there);
    xt = x + s.across + ((s.across_part + d * s.across_step) >> 16);
    yt = y + s.down + ((s.down_part + d * s.down_step) >> 16);
    if (d == NONE || xt < 0 || yt < 0 || xt >= width || yt >= height)
        return;
    atomicMax(arrived[yt * width + xt], uint(d + 1) << 8 | rank_of(there));
    if (agreed != 0) {
        atomicMin(arrived[n + yt * width + xt], uint(d));
        atomicOr(arrived[2 * n + yt * width + xt], 1u << gl_GlobalInvocationID.z);
    }
}
