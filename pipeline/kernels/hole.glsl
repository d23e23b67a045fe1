// Buffers and constants of the shaders of the pyramid that fills holes. Constants:
// pipeline/method/render/device_holes.c.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0

// in and out, float[4] a pixel, levels one after the other: R, G, B times weight, the weight 0..1; once filled R, G,
// B
layout(std430, binding = 0) buffer Levels { vec4 level[]; };
// in, of hole_push also out: uint32_t[height * width]: R, G, B, weight 0..255
layout(std430, binding = 1) buffer Picture { uint picture[]; };

layout(std430, push_constant) uniform Constants {
    int width, height;
    uint finer, coarser, from_picture;
};

#include "quotient.glsl"

// Weight 0..1 of a pixel of the picture.
float weight_of(uint word)
{
    const uint weight = word >> 24;

    return weight == 0 ? 0.0 : weight == 255 ? 1.0 : quotient(float(weight), 255.0);
}

vec3 rgb(uint word)
{
    return vec3(word & 0xFF, (word >> 8) & 0xFF, (word >> 16) & 0xFF);
}
