// Directions of paths, for sgm_path.comp and its variant: sst_gpu_way() of pipeline/gpu/match.h. They declare the
// constants that this reads.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0

int dx, dy;

void set_way(int w)
{
    dx = w == 2 || w == 3 ? 0 : (w & 1) == 0 ? 1 : -1;
    dy = w < 2 ? 0 : w == 2 || w == 4 || w == 5 ? 1 : -1;
}

// Path p of the direction exists.
bool exists(int p)
{
    const int rows = bottom - top;

    return p < (dy == 0 ? rows : dx == 0 ? width : width + rows - 1);
}

// Where the path begins: on the sides that it comes from.
ivec2 begin(int p)
{
    const int left = dx > 0 ? 0 : width - 1, row = dy > 0 ? top : bottom - 1;

    if (dy == 0)
        return ivec2(left, top + p);
    return p < width ? ivec2(p, row) : ivec2(left, row + dy * (p - width + 1));
}
