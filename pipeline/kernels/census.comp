// Census of a view between pixels: census_row of kernels.h over the view sampled at (x, y) + phase, one phase per layer
// of groups. Constants: pipeline/gpu/match.h. Definition: census_ref.c.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0
#version 450

layout(local_size_x = 32, local_size_y = 8) in;

layout(std430, binding = 0) readonly buffer Pixels { uint pixels[]; };
layout(std430, binding = 1) writeonly buffer Census { uvec2 census[]; }; // out, uint64_t[layers][height][width]

layout(std430, push_constant) uniform Constants {
    int width, height;
    uint phase[2]; // four bits each
};

const int WIDE = 32 + 8, HIGH = 8 + 6;

shared uint samples[WIDE * HIGH];

uint luma(int x, int y)
{
    const uint p = pixels[y * width + x];

    return (77 * (p & 0xFF) + 150 * ((p >> 8) & 0xFF) + 29 * ((p >> 16) & 0xFF) + 128) >> 8;
}

// The view at (x, y) + phase, in quarter pixels; borders repeated.
uint sample_at(int x, int y, uint px, uint py)
{
    const int x0 = clamp(x, 0, width - 1), x1 = min(x0 + 1, width - 1);
    const int y0 = clamp(y, 0, height - 1), y1 = clamp(y + 1, 0, height - 1);
    const uint above = (4 - px) * luma(x0, y0) + px * luma(x1, y0);
    const uint below = py == 0 ? 0 : (4 - px) * luma(x0, y1) + px * luma(x1, y1);

    return ((4 - py) * above + py * below + 8) >> 4;
}

void main()
{
    const ivec2 local = ivec2(gl_LocalInvocationID.xy), corner = ivec2(gl_WorkGroupID.xy) * ivec2(32, 8);
    const uint layer = gl_WorkGroupID.z, which = (phase[layer >> 3] >> (4 * (layer & 7))) & 15;
    uint low = 0, high = 0, centre;
    int count = 0;

    for (int i = int(gl_LocalInvocationIndex); i < WIDE * HIGH; i += 256)
        samples[i] = sample_at(corner.x + i % WIDE - 4, corner.y + i / WIDE - 3, which & 3, which >> 2);
    barrier();
    if (corner.x + local.x >= width || corner.y + local.y >= height)
        return;
    centre = samples[(local.y + 3) * WIDE + local.x + 4];
    for (int j = 0; j < 7; j++) {
        for (int i = 0; i < 9; i++) {
            const uint darker = samples[(local.y + j) * WIDE + local.x + i] < centre ? 1 : 0;

            if (j == 3 && i == 4)
                continue;
            // 62 bits: the first 30 are those of the upper word.
            if (count++ < 30)
                high = (high << 1) | darker;
            else
                low = (low << 1) | darker;
        }
    }
    census[(layer * uint(height) + uint(corner.y + local.y)) * uint(width) + uint(corner.x + local.x)] =
        uvec2(low, high);
}
