// Bilateral filter of 7x7 disparities: bilateral_row of kernels.h, whose float quotient is rounded as the whole numbers
// here are: they are at most 25736, so a quotient that is no half is farther from it than floats are off. Constants:
// pipeline/gpu/match.h. Definition: bilateral_ref.c.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0
#version 450

layout(local_size_x = 32, local_size_y = 8) in;

layout(std430, binding = 0) readonly buffer Map { uint map[]; };
layout(std430, binding = 1) readonly buffer Pixels { uint pixels[]; };
layout(std430, binding = 2) writeonly buffer Out { uint result[]; }; // out; the upper halves are copied

layout(std430, push_constant) uniform Constants {
    int width, height, tau, masks;
    int weight[16]; // by distance: 4 * |y| + |x|
};

const int WIDE = 32 + 6, HIGH = 8 + 6, NONE = 0xFFFF, STEP = 96;

shared uint near[WIDE * HIGH]; // disparity, luma << 16

void main()
{
    const ivec2 local = ivec2(gl_LocalInvocationID.xy), corner = ivec2(gl_WorkGroupID.xy) * ivec2(32, 8);
    const ivec2 at = corner + local;
    int sum = 0, total = 0, centre, level, mean;

    for (int i = int(gl_LocalInvocationIndex); i < WIDE * HIGH; i += 256) {
        const ivec2 from = corner + ivec2(i % WIDE, i / WIDE) - 3;
        uint value = NONE;

        if (from.x >= 0 && from.y >= 0 && from.x < width && from.y < height) {
            const uint p = pixels[from.y * width + from.x];

            value = (map[from.y * width + from.x] & 0xFFFF) |
                    ((77 * (p & 0xFF) + 150 * ((p >> 8) & 0xFF) + 29 * ((p >> 16) & 0xFF) + 128) >> 8) << 16;
        }
        near[i] = value;
    }
    barrier();
    if (at.x >= width || at.y >= height)
        return;
    centre = int(near[(local.y + 3) * WIDE + local.x + 3] & 0xFFFF);
    level = int(near[(local.y + 3) * WIDE + local.x + 3] >> 16);
    for (int y = -3; y <= 3; y++) {
        for (int x = -3; x <= 3; x++) {
            const uint there = near[(local.y + 3 + y) * WIDE + local.x + 3 + x];
            const int step = int(there & 0xFFFF) - centre;
            const int w = abs(step) <= STEP && abs(int(there >> 16) - level) < tau ? weight[4 * abs(y) + abs(x)] : 0;

            sum += w * step;
            total += w;
        }
    }
    mean = centre == NONE || (masks != 0 && pixels[at.y * width + at.x] >> 24 == 0)
               ? NONE
               : centre - 128 + (2 * sum + 257 * total) / (2 * total);
    result[at.y * width + at.x] = (map[at.y * width + at.x] & 0xFFFF0000) | uint(mean & 0xFFFF);
}
