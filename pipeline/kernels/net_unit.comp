// Vectors over the channels of a pixel, brought to a length and rounded to bytes. Constants:
// pipeline/gpu/net.h. Definition: op_normalize_s8().
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0
#version 450

layout(local_size_x = 64) in;

layout(std430, binding = 0) readonly buffer Fixed { uint fixed_word[]; };
layout(std430, binding = 1) readonly buffer From { uint from_word[]; };
layout(std430, binding = 2) buffer To { uint to_word[]; };

struct Tensor {
    uint at, pitch, type;
    int width, height;
};

layout(std430, push_constant) uniform Constants {
    Tensor from, to;
    int channels;
    float scale;
    uint taps_at;
    float factor, in_add, in_min, add, least;
};

float high_part(float v)
{
    return uintBitsToFloat(floatBitsToUint(v) & 0xFFFFF000u);
}

// A number in two parts, high the rounded one.
struct Parts {
    float high, low;
};

Parts plus(Parts a, float b)
{
    precise float sum = a.high + b;
    precise float back = sum - a.high;
    precise float low = ((a.high - (sum - back)) + (b - back)) + a.low;

    return Parts(sum, low);
}

// a - b b
float less_square(Parts a, float b)
{
    const float h = high_part(b);
    precise float l = b - h;
    precise float rest = ((a.high - h * h) - 2.0 * h * l) - l * l;
    precise float value = rest + a.low;

    return value;
}

Parts root(Parts a)
{
    const float r = sqrt(a.high);
    precise float low = less_square(a, r) / (2.0 * r);

    return Parts(r, low);
}

// v / a, rounded once but for a part of 2^-20 of its last digit.
float over(float v, Parts a)
{
    precise float q = v / a.high;
    const float q_high = high_part(q), a_high = high_part(a.high);
    precise float q_low = q - q_high, a_low = a.high - a_high;
    precise float rest = (((v - q_high * a_high) - q_high * a_low) - q_low * a_high) - q_low * a_low;
    precise float value = q + (rest - q * a.low) / a.high;

    return value;
}

// factor / length; sums of squares that floats do not hold are refused by the caller's choice of networks.
float scale_of(Parts sum)
{
    Parts s = plus(sum, in_add);

    if (s.high < in_min)
        s = Parts(in_min, 0.0);
    if (s.high > 0.0)
        s = root(s);
    s = plus(s, add);
    if (s.high < least)
        s = Parts(least, 0.0);
    return s.high > 0.0 ? over(factor, s) : 0.0;
}

void main()
{
    const uint x = gl_GlobalInvocationID.x, pixel = gl_GlobalInvocationID.y * uint(to.width) + x;
    const uint at = from.at + pixel * from.pitch;
    precise float lane[8] = float[8](0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
    Parts sum = Parts(0.0, 0.0);
    float by;

    if (x >= uint(to.width))
        return;
    for (uint c = 0; c < uint(channels); c += 8) {
        for (uint i = 0; i < 8; i++) {
            const float v = uintBitsToFloat(from_word[at + c + i]);
            precise float square = v * v;

            lane[i] = lane[i] + square;
        }
    }
    for (uint i = 0; i < 8; i++)
        sum = plus(sum, lane[i]);
    by = scale_of(sum);
    for (uint c = 0; c < uint(channels); c += 4) {
        uint word = 0;

        for (uint i = 0; i < 4; i++) {
            precise float v = uintBitsToFloat(from_word[at + c + i]) * by;
            const float cut = clamp(v, -127.0, 127.0);
            precise float away = cut + (cut < 0.0 ? -0.5 : 0.5);

            word |= (uint(int(away)) & 0xFF) << (8 * i);
        }
        to_word[to.at + pixel * to.pitch + c / 4] = word;
    }
}
