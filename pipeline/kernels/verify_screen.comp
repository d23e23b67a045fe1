// Cells of which the maps explain most rays are closed. Constants: pipeline/gpu/verify.h. Definition:
// pipeline/method/render/verify.c.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0
#version 450
#extension GL_GOOGLE_include_directive : require

layout(local_size_x = 32) in;

#include "blend_view.glsl"
#include "verify.glsl"
#include "verify_explain.glsl"

layout(std430, binding = 6) buffer Cells { uint cell[]; }; // in and out

const int STEP = 4, SCREEN_SHARE = 8;
const int ACROSS = int(CELL_WIDTH) / STEP; // pixels of a row that are looked at
shared int left, found;

bool contradicted(int x, int y)
{
    precise float sum = 0.0, most_of = UNEXPLAINED_LOW * all;

    for (uint v = 0; v < ray_views; v++) {
        if (x >= view[v].at.x0 && x < view[v].at.x1 && y >= view[v].at.y0 && y < view[v].at.y1)
            sum += unexplained(v, x, y);
    }
    return sum > most_of;
}

void main()
{
    const int i = int(gl_LocalInvocationID.x), x0 = int(gl_WorkGroupID.x * CELL_WIDTH);
    const int y0 = from + int(gl_WorkGroupID.y * CELL_HEIGHT);
    const int x1 = min(x0 + int(CELL_WIDTH), width), y1 = min(y0 + int(CELL_HEIGHT), to);
    const int x = x0 + STEP / 2 + i % ACROSS * STEP, y = y0 + STEP / 2 + i / ACROSS * STEP;
    const uint cell_at = cell_of(x0, y0);

    if ((cell[cell_at] & CELL_OPEN) == 0)
        return;
    if (i == 0)
        left = found = 0;
    barrier();
    if (x < x1 && y < y1 && share[(y - top) * width + x] > 0.0) {
        atomicAdd(left, 1);
        if (contradicted(x, y))
            atomicAdd(found, 1);
    }
    barrier();
    if (SCREEN_SHARE * found > left)
        return;
    for (int row = y0; row < y1; row++) {
        for (int column = x0 + i; column < x1; column += 32)
            share[(row - top) * width + column] = 0.0;
    }
    if (i == 0)
        cell[cell_at] &= ~CELL_OPEN;
}
