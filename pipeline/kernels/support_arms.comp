// Arms of the support regions: how far a pixel's colour goes to the left, right, up and down. Constants:
// pipeline/gpu/match.h. Definition: pipeline/method/disparity/support.c.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0
#version 450

layout(local_size_x = 32, local_size_y = 8) in;

layout(std430, binding = 0) readonly buffer Pixels { uint pixels[]; };
// out, uint32_t[height][width]: left, right, up, down from the lowest byte up
layout(std430, binding = 1) writeonly buffer Arms { uint arms[]; };

layout(std430, push_constant) uniform Constants {
    int width, height, arm, tau;
};

// Largest difference of a colour channel.
int step_between(uint a, uint b)
{
    const ivec3 p = ivec3(a & 0xFF, (a >> 8) & 0xFF, (a >> 16) & 0xFF);
    const ivec3 q = ivec3(b & 0xFF, (b >> 8) & 0xFF, (b >> 16) & 0xFF), step = abs(p - q);

    return max(max(step.x, step.y), step.z);
}

uint length_of(ivec2 at, ivec2 way)
{
    const uint own = pixels[at.y * width + at.x];

    for (int i = 1; i <= arm; i++) {
        const ivec2 to = at + i * way;

        if (to.x < 0 || to.y < 0 || to.x >= width || to.y >= height ||
            step_between(own, pixels[to.y * width + to.x]) >= tau)
            return uint(i - 1);
    }
    return uint(arm);
}

void main()
{
    const ivec2 at = ivec2(gl_GlobalInvocationID.xy);

    if (at.x >= width || at.y >= height)
        return;
    arms[at.y * width + at.x] = length_of(at, ivec2(-1, 0)) | length_of(at, ivec2(1, 0)) << 8 |
                                length_of(at, ivec2(0, -1)) << 16 | length_of(at, ivec2(0, 1)) << 24;
}
