// The pixels of a view from its raw frame: place_row, resample_row and light_row of kernels.h. Constants:
// pipeline/gpu/rectify.h. Definition: sst_rectify_view() of the CPU.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0
#version 450
#extension GL_GOOGLE_include_directive : require

layout(local_size_x = 16, local_size_y = 8) in;

struct Places {
    int whole[2];
    float c[8];
    int most[2];
};

// int32_t [SST_RESAMPLE_PHASES][taps], as of struct sst_resample
layout(std430, binding = 0) readonly buffer Weights { int weight[]; };
// uint32_t [raw_height][raw_width]: R, G, B and an unused byte from the lowest up
layout(std430, binding = 1) readonly buffer Frame { uint frame[]; };
layout(std430, binding = 2) readonly buffer Cells { Places places[]; }; // struct sst_places [height][cells], a table
layout(std430, binding = 3) readonly buffer List { int list[]; }; // int32_t pairs, for SST_PLACES_LISTED
// float: SST_GPU_RECTIFY_LIGHT_FLOATS parts, the fall-off's factors [light_rows][light_cols], [light_rows][light_cols] of their 2.4th roots; not
// read without SST_GPU_RECTIFY_LIT
layout(std430, binding = 4) readonly buffer Light { float light[]; };
// out, a byte each: 255, or 0 without a position in the frame
layout(std430, binding = 5) buffer Valid { uint valid[]; };
layout(std430, binding = 6) buffer Pixels { uint pixel[]; };

layout(std430, push_constant) uniform Constants {
    int width, height, pitch, raw_width, raw_height, taps, cell_shift, cells;
    uint first, flags;
    int light_shift, light_cols, light_rows;
    float part_x, part_y, gain[3], gain_root[3];
    int top;
};

const uint KEEP = 2;
const int LISTED = -1, OUTSIDE = int(0x80000000);

float cubic(float k, float c0, float c1, float c2, float c3)
{
    precise float v = c0 + k * (c1 + k * (c2 + k * c3));
    return v;
}

// Position in the frame, 1/256 px; OUTSIDE: none.
ivec2 place(int x, int y)
{
    const int cell = min(x >> cell_shift, cells - 1), at = y * cells + cell, column = x - (cell << cell_shift);
    const Places p = places[at];
    precise float k = part_x + float(column);
    ivec2 to;

    if (p.most[0] < 0) {
        to = ivec2(OUTSIDE);
        if (p.most[0] == LISTED)
            to = ivec2(list[2 * (p.whole[0] + column)], list[2 * (p.whole[0] + column) + 1]);
        return to;
    }
    to.x = p.whole[0] + int(roundEven(cubic(k, p.c[0], p.c[1], p.c[2], p.c[3])));
    to.y = p.whole[1] + int(roundEven(cubic(k, p.c[4], p.c[5], p.c[6], p.c[7])));
    return to.x < 0 || to.x > p.most[0] || to.y < 0 || to.y > p.most[1] ? ivec2(OUTSIDE) : to;
}

#include "frame.glsl"

void main()
{
    const int x = 4 * int(gl_GlobalInvocationID.x), y = top + int(gl_GlobalInvocationID.y);
    const uint at = first + uint(y) * uint(pitch) + uint(x);
    uint seen = 0;

    if (x >= width || y >= height)
        return;
    for (int i = 0; i < 4 && x + i < width; i++) {
        const ivec2 to = place(x + i, y);
        const uint name = (flags & KEEP) != 0 ? pixel[at + uint(i)] & 0xFF000000u : 0;
        uint rgb = 0;

        if (to.x != OUTSIDE) {
            rgb = finish(sample_at(to), x + i, y, part_x, part_y);
            seen |= 0xFFu << (8 * i);
        }
        pixel[at + uint(i)] = rgb | name;
    }
    valid[at >> 2] = seen;
}
