// The rays of views summed into a picture: blend_rays, blend_plain, blend_support and blend_finish of kernels.h for all
// views and rows. An invocation has several pixels of a column, which share the rows of their rays. Constants:
// pipeline/gpu/blend.h. Definition: blend_*_ref.c.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0
#version 450
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require

layout(local_size_x = 32, local_size_y = 4) in;

#include "blend_view.glsl"

// struct sst_gpu_blend_params
layout(std430, binding = 0) readonly buffer Params { Label label[256]; uint rarity[1024]; View view[]; };
// R, G, B, label from the lowest byte up; rows `pitch` pixels apart
layout(std430, binding = 1) readonly buffer Pixels { uint pixel[]; };
layout(std430, binding = 2) readonly buffer Disp { uint disp[]; }; // uint16_t; not read by plans without weights
// a byte each, 0: not valid; not read without SST_GPU_VIEW_VALID
layout(std430, binding = 3) readonly buffer Valid { uint valid[]; };
// float [rows][SST_BLEND_COLUMNS]; not read without SST_GPU_BLEND_BY_LABEL
layout(std430, binding = 4) readonly buffer Table { float table[]; };
// in and out, [4][rows * width]: R, G, B, weight; whole numbers for SST_GPU_BLEND_SUMMED
layout(std430, binding = 5) buffer Sums { uint sums[]; };
// out, uint32_t[rows * width]: R, G, B, enum sst_gpu_blend_pixel
layout(std430, binding = 6) buffer Out { uint result[]; };

layout(std430, push_constant) uniform Constants {
    int width, pitch, top, rows;
    uint first_view, views, flags;
    uint first, last, times, focus, slope, bits;
    float base, scale;
};

const uint FIRST = 1, LAST = 2, WEIGHTED = 4, SUMMED = 8, BY_LABEL = 16, WEIGHTS = 32;
const uint PIXEL_SUPPORTED = 1, PIXEL_BELOW = 2;
const float TINY = 1e-37, FLOOR = 1e-28;

#include "blend_ray.glsl"
#include "quotient.glsl"

const int ROWS = 2; // of an invocation

// Of each of its pixels. `whole`: sums without weights.
vec3 sum[ROWS];
float weight[ROWS];
ivec3 whole[ROWS];
bool supported[ROWS];

// Kinds of plans; constants where they are used, so that each has a loop of its own.
const int SUMS = 0, APERTURES = 1, WEIGHTS_ALIKE = 2, WEIGHTS_BY_LABEL = 3;

// The same value without a conversion, of which devices do few at once. b: below 2^23
float exact(uint b)
{
    precise float value = uintBitsToFloat(0x4B000000u | b) - 8388608.0;

    return value;
}

vec3 colour_at(uint at)
{
    const uint p = pixel[at];

    return vec3(exact(p & 0xFF), exact((p >> 8) & 0xFF), exact((p >> 16) & 0xFF));
}

void read_sums(uint at, uint plane)
{
    [[unroll]] for (int i = 0; i < ROWS; i++, at += uint(width)) {
        uvec3 was = uvec3(0);

        weight[i] = 0.0;
        supported[i] = false;
        if ((flags & FIRST) == 0 && int(at / uint(width)) < rows) {
            was = uvec3(sums[at], sums[at + plane], sums[at + 2 * plane]);
            weight[i] = uintBitsToFloat(sums[at + 3 * plane]);
            supported[i] = (result[at] >> 24) != 0;
        }
        whole[i] = ivec3(was);
        sum[i] = uintBitsToFloat(was);
    }
}

// Add a ray of colour c in 1/LEVEL, whose numbers are whole. nearest: the pixel with its disparity and label
void add(int i, const int kind, float aperture, uint nearest, bool labels, vec3 c)
{
    float w = aperture;

    if (kind == SUMS) {
        whole[i] += ivec3(c);
        weight[i] += 1.0;
        supported[i] = true;
        return;
    }
    if (kind >= WEIGHTS_ALIKE) {
        const uint d = disparity(nearest), name = labels ? pixel[nearest] >> 24 : 0, ends = label[name].ends;

        w = weigh(w, d, name, kind == WEIGHTS_BY_LABEL && labels);
        supported[i] = supported[i] || (d >= (ends & 0xFFFF) && d <= (ends >> 16));
    } else {
        supported[i] = true;
    }
    precise vec3 product = w * c;
    precise vec3 colours = sum[i] + product;
    precise float weights = weight[i] + w;

    sum[i] = colours;
    weight[i] = weights;
}

// Add the rays of a view.
void add_view(uint v, const int kind, int x, int y)
{
    const uint view_flags = view[v].flags, at = view[v].first + uint(y + view[v].iy) * uint(pitch) + uint(x + view[v].ix);
    const uint right = (view_flags & VIEW_RIGHT) != 0 ? 1 : 0, below = (view_flags & VIEW_BELOW) != 0 ? uint(pitch) : 0;
    const uint nearest = view[v].first + uint(y + view[v].ny) * uint(pitch) + uint(x + view[v].nx);
    const bool labels = (view_flags & VIEW_LABELS) != 0;
    const int y0 = view[v].y0, y1 = view[v].y1;
    const float aperture = view[v].aperture;
    const vec4 tap = vec4(view[v].tap[0], view[v].tap[1], view[v].tap[2], view[v].tap[3]);

    if (x < view[v].x0 || x >= view[v].x1)
        return;
    // Whole numbers below 2^23: no sum is rounded.
    if (y >= y0 && y + ROWS <= y1 && below != 0 && (view_flags & VIEW_VALID) == 0) {
        vec3 upper = colour_at(at) * tap.x + colour_at(at + right) * tap.y;
        vec3 between[ROWS];

        [[unroll]] for (int i = 0; i < ROWS; i++) {
            const uint next = at + uint(i + 1) * uint(pitch);
            const vec3 here = colour_at(next), beside = colour_at(next + right);

            between[i] = upper + (here * tap.z + beside * tap.w);
            upper = here * tap.x + beside * tap.y;
        }
        [[unroll]] for (int i = 0; i < ROWS; i++)
            add(i, kind, aperture, nearest + uint(i) * uint(pitch), labels, between[i]);
        return;
    }
    [[unroll]] for (int i = 0; i < ROWS; i++) {
        const uint from = at + uint(i) * uint(pitch);

        if (y + i < y0 || y + i >= y1 || ((view_flags & VIEW_VALID) != 0 && !seen(from, right, below)))
            continue;
        add(i, kind, aperture, nearest + uint(i) * uint(pitch), labels,
            colour_at(from) * tap.x + colour_at(from + right) * tap.y + colour_at(from + below) * tap.z +
                colour_at(from + right + below) * tap.w);
    }
}

void add_views(const int kind, int x, int y)
{
    for (uint v = first_view; v < first_view + views; v++)
        add_view(v, kind, x, y);
}

// a / b + 1/2; the quotient is rounded to the nearest number where that decides about the whole part.
float rounded(float a, float b)
{
    precise float value = a / b + 0.5;

    if (abs(fract(value) - 0.5) > 0.499) {
        precise float exactly = quotient(a, b) + 0.5;

        value = exactly;
    }
    return value;
}

void write(int i, uint at, uint plane)
{
    if ((flags & LAST) == 0) {
        const uvec3 now = (flags & SUMMED) != 0 ? uvec3(whole[i]) : floatBitsToUint(sum[i]);

        for (int k = 0; k < 3; k++)
            sums[at + uint(k) * plane] = now[k];
        sums[at + 3 * plane] = floatBitsToUint(weight[i]);
        result[at] = supported[i] ? 1u << 24 : 0u;
        return;
    }
    if ((flags & SUMMED) != 0)
        sum[i] = vec3(whole[i]);
    precise vec3 scaled = sum[i] * (1.0 / LEVEL);
    precise float total = weight[i] + TINY;
    const vec3 mean = vec3(rounded(scaled.r, total), rounded(scaled.g, total), rounded(scaled.b, total));
    const uvec3 rgb = min(uvec3(mean), uvec3(255));

    result[at] = rgb.r | rgb.g << 8 | rgb.b << 16 | (supported[i] ? PIXEL_SUPPORTED << 24 : 0) |
                 (weight[i] < FLOOR ? PIXEL_BELOW << 24 : 0);
    if ((flags & WEIGHTS) != 0)
        sums[at + 3 * plane] = floatBitsToUint(weight[i]);
}

void main()
{
    const int x = int(gl_GlobalInvocationID.x), row = ROWS * int(gl_GlobalInvocationID.y);
    const uint at = uint(row) * uint(width) + uint(x), plane = uint(rows) * uint(width);

    if (x >= width || row >= rows)
        return;
    read_sums(at, plane);
    if ((flags & SUMMED) != 0)
        add_views(SUMS, x, top + row);
    else if ((flags & WEIGHTED) == 0)
        add_views(APERTURES, x, top + row);
    else if ((flags & BY_LABEL) == 0)
        add_views(WEIGHTS_ALIKE, x, top + row);
    else
        add_views(WEIGHTS_BY_LABEL, x, top + row);
    [[unroll]] for (int i = 0; i < ROWS; i++) {
        if (row + i < rows)
            write(i, at + uint(i) * uint(width), plane);
    }
}
