// Pixels left to votes are mixed with the colour that their rays agree on: agree_sum of kernels.h over all views.
// Constants: pipeline/gpu/verify.h. Definition: pipeline/method/render/verify.c.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0
#version 450
#extension GL_GOOGLE_include_directive : require

layout(local_size_x = 32, local_size_y = 4) in;

layout(std430, binding = 0) readonly buffer Share { float share[]; };
layout(std430, binding = 1) readonly buffer Rays { uint ray[]; };
layout(std430, binding = 2) readonly buffer NearIn { uint near[]; };
layout(std430, binding = 3) readonly buffer Totals { float totals[]; };
layout(std430, binding = 4) buffer Out { uint result[]; }; // in and out: of blend

#include "verify.glsl"
#include "verify_ramp.glsl"

const float AGREE_NEAR = 64.0, AGREE_LOW = 0.1, AGREE_HIGH = 0.2;

// Where the rays of the pixels around are held; `none` where the picture has none.
void places_around(out uint place[9], int x, int y, uint none)
{
    for (int i = 0; i < 9; i++) {
        const int px = x + i % 3 - 1, py = y + i / 3 - 1;
        const bool inside = px >= 0 && py >= 0 && px < width && py < height;

        place[i] = inside ? uint(py - rays_top()) * uint(width) + uint(px) : none;
    }
}

// Sums of a plane of `totals`, in the order of the CPU.
float sum_around(const uint place[9], uint plane, uint none)
{
    precise float sum = 0.0;

    for (int i = 0; i < 9; i++)
        sum += place[i] != none ? totals[plane * rays + place[i]] : 0.0;
    return sum;
}

void main()
{
    const int x = int(gl_GlobalInvocationID.x), y = from + int(gl_GlobalInvocationID.y);
    const uint at = uint(y - top) * uint(width) + uint(x), none = 0xFFFFFFFFu;
    precise vec3 sum = vec3(0.0);
    precise float weight = 0.0;
    uint place[9];

    if (x >= width || y >= to || !(share[at] > 0.0))
        return;
    places_around(place, x, y, none);
    for (uint k = 0; k < ray_views; k += 2) {
        uint pair[2] = { 0, 0 };

        for (int i = 0; i < 9; i++) {
            const uint two = place[i] != none ? near[k / 2 * rays + place[i]] : 0;

            pair[0] += two & 0xFFFF;
            pair[1] += two >> 16;
        }
        for (uint i = 0; i < 2 && k + i < ray_views; i++) {
            const uint r = ray[(k + i) * rays + place[4]];
            const float w = r >> 24 != 0 ? float(pair[i]) : 0.0;

            sum += w * vec3(r & 0xFF, (r >> 8) & 0xFF, (r >> 16) & 0xFF);
            weight += w;
        }
    }
    if (!(weight > 0.0))
        return;
    precise float possible = AGREE_NEAR * sum_around(place, 0, none);
    precise float by = share[at] * ramp(quotient(weight, possible), AGREE_LOW, AGREE_HIGH);

    if (explained != 0) {
        precise float views_around = 9.0 * all;

        by *= ramp(quotient(sum_around(place, 1, none), views_around), UNEXPLAINED_LOW, UNEXPLAINED_HIGH);
    }
    const uint word = result[at];
    precise vec3 plain = vec3(word & 0xFF, (word >> 8) & 0xFF, (word >> 16) & 0xFF);
    precise vec3 voted = vec3(quotient(sum.r, weight), quotient(sum.g, weight), quotient(sum.b, weight));
    precise vec3 mixed = by * voted + (1.0 - by) * plain + 0.5;
    const uvec3 rgb = uvec3(mixed);

    result[at] = rgb.r | rgb.g << 8 | rgb.b << 16 | (word & 0xFF000000u);
}
