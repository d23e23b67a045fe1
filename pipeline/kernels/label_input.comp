// The input of a network of colour images from a view: means or bilinear samples, and normalised. An invocation has a pixel of
// the input. Buffers and constants: pipeline/gpu/label.h. Definition: label_input_reference().
#version 450
#extension GL_GOOGLE_include_directive : require

layout(local_size_x = 32, local_size_y = 8) in;

layout(std430, binding = 0) readonly buffer View { uint view[]; };
layout(std430, binding = 1) readonly buffer Tables { uint table[]; };
layout(std430, binding = 2) buffer To { float result[]; };

layout(std430, push_constant) uniform Constants {
    int width, height, in_width, in_height;
    uint to, across, across_words, down, down_words;
    uint channel[3];
    float scale[3], shift[3];
};

#include "label_mean.glsl"

void main()
{
    const ivec2 here = ivec2(gl_GlobalInvocationID.xy);
    const uint plane = uint(in_width * in_height), i = to + uint(here.y * in_width + here.x);
    vec3 mean;

    if (here.x >= in_width || here.y >= in_height)
        return;
    mean = mean_colour(here.x, here.y);
    for (int c = 0; c < 3; c++) {
        const float of = mean[channel[c]];
        precise float value = of * scale[c] - shift[c];

        result[i + uint(c) * plane] = value;
    }
}
