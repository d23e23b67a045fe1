// Pixels of a level, or of the picture, filled from the coarser level as far as they lack weight. Constants:
// pipeline/method/render/device_holes.c. Definition: pyramid_ref.h.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0
#version 450
#extension GL_GOOGLE_include_directive : require

layout(local_size_x = 32, local_size_y = 4) in;

#include "hole.glsl"

// The coarser level at pixel (x, y) of the finer one, bilinear: its pixels lie at 2 x + 1/2.
vec3 between(int x, int y)
{
    const ivec2 size = ivec2((width + 1) / 2, (height + 1) / 2), near = ivec2(x, y) / 2;
    const ivec2 far = clamp(near + ivec2((x & 1) != 0 ? 1 : -1, (y & 1) != 0 ? 1 : -1), ivec2(0), size - 1);
    const uint row = coarser + uint(near.y * size.x), beside = coarser + uint(far.y * size.x);
    precise vec3 upper = 0.75 * level[row + uint(near.x)].rgb + 0.25 * level[row + uint(far.x)].rgb;
    precise vec3 lower = 0.75 * level[beside + uint(near.x)].rgb + 0.25 * level[beside + uint(far.x)].rgb;
    precise vec3 to = 0.75 * upper + 0.25 * lower;

    return to;
}

void push_level(int x, int y)
{
    const uint at = finer + uint(y * width + x);
    const vec4 own = level[at];
    precise float lack = 1.0 - own.a;

    if (!(lack > 0.0))
        return;
    precise vec3 to = own.rgb + lack * between(x, y);

    level[at] = vec4(to, own.a);
}

void main()
{
    const int x = int(gl_GlobalInvocationID.x), y = int(gl_GlobalInvocationID.y);

    if (x >= width || y >= height)
        return;
    if (from_picture == 0) {
        push_level(x, y);
        return;
    }
    const uint at = uint(y * width + x), word = picture[at];

    if (word >> 24 == 255)
        return;
    const float w = weight_of(word);
    precise vec3 mixed = w * rgb(word) + (1.0 - w) * between(x, y) + 0.5;
    const uvec3 to = min(uvec3(mixed), uvec3(255));

    picture[at] = to.r | to.g << 8 | to.b << 16 | (word & 0xFF000000u);
}
