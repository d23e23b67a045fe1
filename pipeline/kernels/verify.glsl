// Constants of the shaders verify_*, and which pixels they are about. Layouts: pipeline/gpu/verify.h.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0

layout(std430, push_constant) uniform Constants {
    int width, pitch, top, rows;
    uint first_view, views, flags;
    uint first, last, times, focus, slope, bits;
    float base, scale;
    int height, from, to, nearest, levels;
    uint ray_views, rays, explained;
    float all, vote_scale, most, doubt_step;
};

const uint FIRST = 1, LAST = 2, BY_LABEL = 16;
const float FRONT_LOW = 0.25, FRONT_HIGH = 0.5, UNEXPLAINED_LOW = 0.1, UNEXPLAINED_HIGH = 0.2;
const uint CELL_WIDTH = 64, CELL_HEIGHT = 8, CELL_WANTED = 1, CELL_OPEN = 2, CELL_BELOW = 4;

// First row whose rays are held.
int rays_top()
{
    return max(from - 1, 0);
}

uint cell_of(int x, int y)
{
    return uint(y) / CELL_HEIGHT * ((uint(width) + CELL_WIDTH - 1) / CELL_WIDTH) + uint(x) / CELL_WIDTH;
}
