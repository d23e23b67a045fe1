// Median of 5x5 disparities, borders repeated: median5_row of kernels.h. Constants: pipeline/gpu/match.h.
// Definition: median_ref.c.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0
#version 450

layout(local_size_x = 32, local_size_y = 8) in;

layout(std430, binding = 0) readonly buffer Map { uint map[]; };
layout(std430, binding = 1) readonly buffer Pixels { uint pixels[]; }; // not read without masks
layout(std430, binding = 2) writeonly buffer Out { uint result[]; }; // out; the upper halves are copied

layout(std430, push_constant) uniform Constants {
    int width, height, masks;
};

const int WIDE = 32 + 4, HIGH = 8 + 4;

shared uint disparity[WIDE * HIGH];

void main()
{
    const ivec2 local = ivec2(gl_LocalInvocationID.xy), corner = ivec2(gl_WorkGroupID.xy) * ivec2(32, 8);
    const ivec2 at = corner + local;
    uint low = 0;

    for (int i = int(gl_LocalInvocationIndex); i < WIDE * HIGH; i += 256) {
        const ivec2 from = clamp(corner + ivec2(i % WIDE, i / WIDE) - 2, ivec2(0), ivec2(width, height) - 1);

        disparity[i] = map[from.y * width + from.x] & 0xFFFF;
    }
    barrier();
    if (at.x >= width || at.y >= height)
        return;
    // The largest number that at most twelve are below: bit by bit, without an array to sort.
    for (uint bit = 0x8000; bit != 0; bit >>= 1) {
        int below = 0;

        for (int i = 0; i < 25; i++)
            below += disparity[(local.y + i / 5) * WIDE + local.x + i % 5] < (low | bit) ? 1 : 0;
        low |= below <= 12 ? bit : 0;
    }
    if (masks != 0 && pixels[at.y * width + at.x] >> 24 == 0)
        low = 0xFFFF;
    result[at.y * width + at.x] = (map[at.y * width + at.x] & 0xFFFF0000) | low;
}
