// The rays of one view, sampled from its raw frame where they see the surface of their pixel: clear_take of kernels.h
// with the colours of sst_sampler_row(). Constants: pipeline/gpu/clear.h.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0
#version 450
#extension GL_GOOGLE_include_directive : require

layout(local_size_x = 32, local_size_y = 4) in;

struct Patch {
    int whole[2];
    int kind, unused;
    float c[32];
};

layout(std430, binding = 0) readonly buffer Weights { int weight[]; };
layout(std430, binding = 1) readonly buffer Frame { uint frame[]; };
layout(std430, binding = 2) readonly buffer Patches { Patch patches[]; }; // struct sst_place_patch[cell_rows][cells]
layout(std430, binding = 3) readonly buffer List { int list[]; };
layout(std430, binding = 4) readonly buffer Light { float light[]; };
layout(std430, binding = 5) buffer State { uint state[]; }; // in and out
// in and out, of all views: R, G, B, enum sst_gpu_clear_ray of the view's rays
layout(std430, binding = 6) buffer Landed { uint landed[]; };

layout(std430, push_constant) uniform Constants {
    int width, height, pitch, raw_width, raw_height, taps, cell_shift, cells;
    uint first, flags;
    int light_shift, light_cols, light_rows;
    float part_x, part_y, gain[3], gain_root[3];
    int frame_top; // not used
    float bx, by;
    int top, rows, cell_rows;
    uint view;
};

#include "frame.glsl"

const int LISTED = -1, NONE = int(0x80000000);
const uint PLAIN = 8, RIM = 1, FULL = 2, RAY_PLAIN = 4, TOLERANCE = 48;

float cubic(float k, float c0, float c1, float c2, float c3)
{
    precise float v = c0 + k * (c1 + k * (c2 + k * c3));
    return v;
}

// Bilinear between listed places; NONE: one of them is.
ivec2 listed(int at, float k, float t)
{
    const int side = 1 << cell_shift, i = min(int(k), side - 1), j = min(int(t), side - 1);
    const int upper = 2 * (at + j * (side + 1) + i), lower = upper + 2 * (side + 1);
    const float right = k - float(i), below = t - float(j);
    ivec2 to;

    if (list[upper] == NONE || list[upper + 2] == NONE || list[lower] == NONE || list[lower + 2] == NONE)
        return ivec2(NONE);
    for (int axis = 0; axis < 2; axis++) {
        const int a = list[upper + axis], b = list[upper + 2 + axis] - a, c = list[lower + axis] - a;
        const int d = list[lower + 2 + axis] - a - b - c;
        precise float v = right * float(b) + below * (float(c) + right * float(d));

        to[axis] = (a + int(roundEven(v)) + 8) >> 4;
    }
    return to;
}

float along(uint at, int from, float k, float t)
{
    float across[4];

    for (int i = 0; i < 4; i++) {
        const int c = from + 4 * i;

        across[i] =
            cubic(t, patches[at].c[c], patches[at].c[c + 1], patches[at].c[c + 2], patches[at].c[c + 3]);
    }
    return roundEven(cubic(k, across[0], across[1], across[2], across[3]));
}

// Position in the frame, 1/256 px; NONE: none.
ivec2 place(float x, float y)
{
    const int i = min(int(x) >> cell_shift, cells - 1), j = min(int(y) >> cell_shift, cell_rows - 1);
    const float k = x - float(i << cell_shift), t = y - float(j << cell_shift);
    const uint at = uint(j * cells + i);
    ivec2 to;

    if (patches[at].kind == LISTED)
        to = listed(patches[at].whole[0], k, t);
    else if (patches[at].kind != 0)
        return ivec2(NONE);
    else
        to = ivec2(patches[at].whole[0] + int(along(at, 0, k, t)), patches[at].whole[1] + int(along(at, 16, k, t)));
    return any(lessThan(to, ivec2(0))) || to.x > 256 * (raw_width - 1) || to.y > 256 * (raw_height - 1) ? ivec2(NONE)
                                                                                                    : to;
}

// The ray's colour, if it has a place in the frame; a mark where the view has no frame.
bool sample_ray(out uint rgb, float x, float y)
{
    rgb = 0;
    if ((flags & PLAIN) != 0) {
        rgb = RAY_PLAIN << 24;
        return true;
    }
    const ivec2 to = place(x, y);

    if (to.x == NONE)
        return false;
    rgb = finish(sample_at(to), int(x), int(y), x - float(int(x)), y - float(int(y)));
    return true;
}

void main()
{
    const int x = int(gl_GlobalInvocationID.x), row = int(gl_GlobalInvocationID.y);

    if (x >= width || row >= rows)
        return;
    const uint at = (view * uint(rows) + uint(row)) * uint(pitch) + uint(x), s = 3 * (uint(row) * uint(width) + uint(x));
    const uint ray = landed[at];
    const int level = int(ray >> 1), wanted = int(state[s + 2]);
    const float surface = uintBitsToFloat(state[s]), px = uintBitsToFloat(state[s + 1]);
    const int whole = int(surface), up = float(whole) < surface ? 1 : 0;
    precise float at_x = float(x) - px * bx;
    precise float at_y = float(top + row) - px * by;
    uint word = 0;

    if (wanted > 0 && level >= max(whole + up - int(TOLERANCE), 1) && level <= whole + int(TOLERANCE) && at_x >= 0.0 &&
        at_y >= 0.0 && at_x <= float(width - 1) && at_y <= float(height - 1) && sample_ray(word, at_x, at_y)) {
        word |= ((ray & 1) != 0 ? FULL : RIM) << 24;
        state[s + 2] = uint(wanted - int(ray & 1));
    }
    landed[at] = word;
}
