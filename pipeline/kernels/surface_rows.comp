// Surfaces around each pixel of a view, the part along rows: farthest and nearest disparity in windows of three sizes,
// and whether the windows hold a step. Constants: device_second.c. Definition: find_extremes() and find_steps() of
// around.c, both of pipeline/method/disparity/.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0
#version 450

layout(local_size_x = 32, local_size_y = 8) in;

layout(std430, binding = 0) readonly buffer Map { uint map[]; }; // of the view
// out, uint32_t[4][height][width]: farthest | nearest << 16 of each window (SST_DISP_NONE and 0 where nothing is
// known), then a bit per window: it holds no step
layout(std430, binding = 1) writeonly buffer Rows { uint rows[]; };

layout(std430, push_constant) uniform Constants {
    int width, height, most;
};

const uint NONE = 0xFFFF;
const int radii[3] = { 2, 6, 16 };

int disparity(int x, int y)
{
    return int(map[y * width + x] & 0xFFFF);
}

bool is_flat(int x, int y)
{
    const int d = disparity(x, y), right = disparity(min(x + 1, width - 1), y);
    const int below = disparity(x, min(y + 1, height - 1));

    return abs(d - right) <= most && abs(d - below) <= most;
}

void main()
{
    const int x = int(gl_GlobalInvocationID.x), y = int(gl_GlobalInvocationID.y);
    const uint at = uint(y * width + x), n = uint(width * height);
    uint farthest = NONE, nearest = 0, bits = 0;
    bool flat_so_far = true;
    int r = 0;

    if (x >= width || y >= height)
        return;
    // Each window holds the one before it.
    for (int w = 0; w < 3; w++) {
        for (; r <= radii[w]; r++) {
            for (int side = -1; side <= 1; side += 2) {
                const int i = x + side * r;
                uint d;

                if (i < 0 || i >= width)
                    continue;
                d = uint(disparity(i, y));
                farthest = min(farthest, d);
                nearest = d != NONE ? max(nearest, d) : nearest;
                flat_so_far = flat_so_far && is_flat(i, y);
            }
        }
        rows[uint(w) * n + at] = farthest | nearest << 16;
        bits |= flat_so_far ? 1 << w : 0;
    }
    rows[3 * n + at] = bits;
}
