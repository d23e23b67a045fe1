// A coarser level of the pyramid that fills holes: weighted means of four pixels. Constants:
// pipeline/method/render/device_holes.c. Definition: pyramid_ref.h.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0
#version 450
#extension GL_GOOGLE_include_directive : require

layout(local_size_x = 32, local_size_y = 4) in;

#include "hole.glsl"

const float FULL = 2.0;

// A pixel of the finer level: colours times weight, and the weight.
vec4 finer_at(int x, int y)
{
    if (from_picture == 0)
        return level[finer + uint(y * width + x)];
    const uint word = picture[uint(y * width + x)];
    const float w = weight_of(word);
    precise vec3 colour = w * rgb(word);

    return vec4(colour, w);
}

float share(float sum, float weights)
{
    return weights > FULL ? quotient(sum, weights) : 0.5 * sum;
}

void main()
{
    const ivec2 size = ivec2((width + 1) / 2, (height + 1) / 2);
    const int x = int(gl_GlobalInvocationID.x), y = int(gl_GlobalInvocationID.y);
    precise vec4 sum = vec4(0.0);

    if (x >= size.x || y >= size.y)
        return;
    for (int sy = 2 * y; sy < min(2 * y + 2, height); sy++) {
        for (int sx = 2 * x; sx < min(2 * x + 2, width); sx++)
            sum += finer_at(sx, sy);
    }
    vec4 to = vec4(share(sum.r, sum.a), share(sum.g, sum.a), share(sum.b, sum.a), share(sum.a, sum.a));

    // The coarsest level is the mean of the picture.
    if (size == ivec2(1) && to.a > 0.0)
        to.rgb = vec3(quotient(to.r, to.a), quotient(to.g, to.a), quotient(to.b, to.a));
    level[coarser + uint(y * size.x + x)] = to;
}
