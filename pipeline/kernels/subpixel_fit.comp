// A step of Gauss-Newton for the disparity of each pixel of a view: subpixel_fit_row of kernels.h. Constants:
// pipeline/method/disparity/device_subpixel.c. Definition: subpixel_ref.c.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0
#version 450

layout(local_size_x = 32, local_size_y = 8) in;

struct View {
    int x, y, dx, dy;
    float bx, by, gain, offset;
    uint first;
};

layout(std430, binding = 0) readonly buffer Views { View views[]; };
// uint32_t[height][width] by view, packed as for struct sst_subpixel_view
layout(std430, binding = 1) readonly buffer Pixels { uint pixels[]; };
layout(std430, binding = 2) readonly buffer Disparities { uint disp[]; };
// out, struct gpu_subpixel_weight[height][width]
layout(std430, binding = 3) writeonly buffer Out { vec2 result[]; };

layout(std430, push_constant) uniform Constants {
    int width, height, count;
    uint own;
    int tolerance;
    float inverse_limit;
    int across; // 1: gradients over three rows or columns
};

const int NONE = 32768;

float level(uint pixel)
{
    return float(pixel & 0xFF);
}

float own_level(int x, int y)
{
    return level(pixels[own + uint(clamp(y, 0, height - 1) * width + clamp(x, 0, width - 1))]);
}

// Gradient along (dx, dy), the mean of three across it: exact.
float slope_along(int x, int y, int dx, int dy)
{
    const int ax = dy * across, ay = dx * across;
    const float before = own_level(x + dx - ax, y + dy - ay) - own_level(x - dx - ax, y - dy - ay);
    const float here = own_level(x + dx, y + dy) - own_level(x - dx, y - dy);
    const float after = own_level(x + dx + ax, y + dy + ay) - own_level(x - dx + ax, y - dy + ay);

    return (before + 2.0 * here + after) * 0.125;
}

void main()
{
    const int x = int(gl_GlobalInvocationID.x), y = int(gl_GlobalInvocationID.y), at = y * width + x;
    precise float ss = 0.0, sr = 0.0, product;
    float here, gx, gy;
    int d;

    if (x >= width || y >= height)
        return;
    d = int(disp[at] & 0xFFFF);
    if (d >= NONE) {
        result[at] = vec2(0.0);
        return;
    }
    here = own_level(x, y);
    gx = slope_along(x, y, 1, 0);
    gy = slope_along(x, y, 0, 1);
    for (int k = 0; k < count; k++) {
        const View v = views[k];
        const int px = v.x + d * v.dx, py = v.y + d * v.dy, xv = x + (px >> 16), yv = y + (py >> 16);
        uint a, b;

        if (xv < 0 || yv < 0 || xv + 1 >= width || yv + 1 >= height)
            continue;
        a = pixels[v.first + uint(yv * width + xv)];
        b = pixels[v.first + uint((yv + 1) * width + xv)];
        if (int(a >> 16) > d + tolerance || int(b >> 16) > d + tolerance)
            continue;

        const float fx = float(px & 0xFFFF) * (1.0 / 65536.0), fy = float(py & 0xFFFF) * (1.0 / 65536.0); // exact
        precise float top = level(a) + fx * (level(a >> 8) - level(a));
        precise float bottom = level(b) + fx * (level(b >> 8) - level(b));
        precise float there = top + fy * (bottom - top);
        precise float r = there * v.gain + v.offset - here;
        precise float slope = gx * v.bx + gy * v.by;
        precise float left = 1.0 - abs(r) * inverse_limit;
        const float w = max(left, 0.0);

        ss = ss + w * slope * slope;
        sr = sr + w * slope * r;
    }
    product = ss * (float(d) * (1.0 / 64.0)) + sr;
    result[at] = vec2(ss, product);
}
