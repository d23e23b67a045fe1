// All rays of all views go to the viewpoint; the nearest one at each pixel stays: clear_removed, clear_state,
// clear_land of kernels.h. Constants: pipeline/gpu/clear.h. Definition: clear_{removed,state,land}_ref.c.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0
#version 450

layout(local_size_x = 32, local_size_y = 4) in;

struct View {
    float x_q6, x_0, y_q6, y_0, bx, by;
    uint first, flags;
    int top, end;
};

layout(std430, binding = 0) readonly buffer Views { View view[]; }; // struct sst_gpu_clear_view[views]
layout(std430, binding = 1) readonly buffer Pixels { uint pixel[]; }; // as of blend.h
layout(std430, binding = 2) readonly buffer Disp { uint disp[]; };
layout(std430, binding = 3) readonly buffer Valid { uint valid[]; };
layout(std430, binding = 4) readonly buffer Masks { uint masks[]; }; // a byte each, as valid pixels are
layout(std430, binding = 5) buffer Landed { uint landed[]; }; // in and out, uint32_t[views][rows][pitch]

layout(std430, push_constant) uniform Constants {
    int width, height, pitch, bins, cut, remove_label, coarse, wanted;
    uint views;
    float disp_min, disp_min_rest;
    int as_others;
    uint merged;
    int top, rows;
};

const uint VALID = 1, LABELS = 2, MASK = 4, UNKNOWN = 0xFFFF;

uint disparity(uint at)
{
    return (disp[at >> 1] >> ((at & 1) * 16)) & 0xFFFF;
}

uint byte_of(uint word, uint at)
{
    return (word >> ((at & 3) * 8)) & 0xFF;
}

uint place(uint k, int x, int y)
{
    return view[k].first + uint(y - view[k].top) * uint(pitch) + uint(x);
}

// Pixel (x, y) of view k stands in front or is outside the rectified view; pixels outside the picture do not.
bool is_removed(uint k, int x, int y)
{
    if (x < 0 || y < 0 || x >= width || y >= height)
        return false;
    const uint at = place(k, x, y), flags = view[k].flags, d = disparity(at);

    return (int(d) > cut && d != UNKNOWN) ||
           (remove_label != 0 && (flags & LABELS) != 0 && int(pixel[at] >> 24) == remove_label) ||
           ((flags & MASK) != 0 && byte_of(masks[at >> 2], at) != 0) ||
           ((flags & VALID) != 0 && byte_of(valid[at >> 2], at) == 0);
}

void main()
{
    const int x = int(gl_GlobalInvocationID.x), row = int(gl_GlobalInvocationID.y);
    const uint k = gl_GlobalInvocationID.z;
    bool beside = false;

    if (x >= width || k >= views)
        return;
    const int y = view[k].top + row;

    if (y >= view[k].end)
        return;
    const uint d = disparity(place(k, x, y));

    if (int(d) >= bins)
        return;
    precise float move_x = float(d) * view[k].x_q6 + view[k].x_0;
    precise float move_y = float(d) * view[k].y_q6 + view[k].y_0;
    const int to_x = x + int(floor(move_x)), to_row = y + int(floor(move_y)) - top;

    if (to_x < 0 || to_x >= width || to_row < 0 || to_row >= rows || is_removed(k, x, y))
        return;
    for (int i = 0; i < 9; i++)
        beside = beside || is_removed(k, x + i % 3 - 1, y + i / 3 - 1);
    atomicMax(landed[(k * uint(rows) + uint(to_row)) * uint(pitch) + uint(to_x)],
              2 * (d >> coarse) + 2 + (beside ? 0 : 1));
}
