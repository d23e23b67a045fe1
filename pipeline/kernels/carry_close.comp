// Maps carried to a view, the end: gaps of a pixel between pixels of one nearer surface, along rows, then along
// columns, and where the sources agree. Constants: pipeline/method/disparity/carry.c. Definition:
// sst_disparity_carry(), which goes from pixel to pixel. All pixels at once give the same: a gap that is closed gets
// the farther one of its two neighbours, so that it is no nearer than the next pixel, which then is no gap; before, it
// was farther than that pixel or unknown, and that one was no gap either.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0
#version 450
#extension GL_GOOGLE_include_directive : require

layout(local_size_x = 32, local_size_y = 8) in;

#include "planes.glsl"

layout(std430, binding = 0) readonly buffer Arrived { uint arrived[]; };
layout(std430, binding = 1) writeonly buffer Out { uint result[]; }; // out: the view's map, gaps closed

layout(std430, push_constant) uniform Constants {
    int width, height, agreed, checked;
};

const int STEP = 64, AGREE = 3;
const uint CONFIRMED = 0x80;

int disparity(uint value)
{
    return int(value >> 8) - 1;
}

// The map's word of a pixel that has arrived.
uint word_of(uint value)
{
    const uint word = (uint(disparity(value)) & 0xFFFF) | (value << 1 & 0xFF) << 16;

    return checked != 0 ? with_check(word, (value & CONFIRMED) != 0 ? CORRECT : OCCLUSION) : word;
}

uint between(uint at, uint a, uint b)
{
    const int d = disparity(at), da = disparity(a), db = disparity(b), least = min(da, db);

    return least >= 0 && abs(da - db) < STEP && (d < 0 || least > d + STEP) ? (da < db ? a : b) : at;
}

uint along_row(int x, int y)
{
    const int at = y * width + x;

    return x > 0 && x + 1 < width ? between(arrived[at], arrived[at - 1], arrived[at + 1]) : arrived[at];
}

void main()
{
    const int x = int(gl_GlobalInvocationID.x), y = int(gl_GlobalInvocationID.y), at = y * width + x, n = width * height;
    uint value, word;

    if (x >= width || y >= height)
        return;
    value = along_row(x, y);
    if (y > 0 && y + 1 < height)
        value = between(value, along_row(x, y - 1), arrived[at + width]);
    word = word_of(value);
    if (agreed != 0 && bitCount(arrived[2 * n + at]) >= AGREE && disparity(value) - int(arrived[n + at]) < STEP)
        word |= AGREED;
    result[at] = word;
}
