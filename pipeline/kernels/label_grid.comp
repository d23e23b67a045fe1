// Cells of `label_cells` from a network's result: probabilities of classes, and mean colours of the view under the cells. An
// invocation has a cell. Buffers and constants: pipeline/gpu/label.h. Definition: label_grid_reference().
#version 450
#extension GL_GOOGLE_include_directive : require

#include "exp_neg.glsl"
#include "quotient.glsl"

layout(local_size_x = 32, local_size_y = 8) in;

layout(std430, binding = 0) readonly buffer View { uint view[]; };
layout(std430, binding = 1) buffer Tables { uint table[]; };
layout(std430, binding = 2) readonly buffer From { float source[]; };
layout(std430, binding = 3) buffer Cells { float cells[]; };

layout(std430, push_constant) uniform Constants {
    int width, height, grid_width, grid_height, channels, classes;
    uint from, across, across_words, down, down_words, class_of, invalid;
    uint is_probability;
    float per_temperature;
};

const float FLT_MIN = 1.17549435e-38, FLT_MAX = 3.40282347e38, LOGIT_MOST = 64.0, LEAST = 1e-30;

// class_prob.h
float part_of(float value, float most)
{
    precise float below = (most - value) * per_temperature;

    if (is_probability != 0)
        return value < FLT_MIN ? 0.0 : value;
    return below < LOGIT_MOST ? exp_neg(below) : 0.0;
}

bool is_invalid(float value)
{
    const uint bits = floatBitsToUint(value);

    return (bits & 0x7F800000) == 0x7F800000 || (is_probability != 0 && bits > 0x80000000);
}

// @return the sum of all parts; 0: the values are invalid
float look(uint at, uint plane, out float most)
{
    precise float sum = 0.0;

    most = source[at];
    for (uint c = 0; c < uint(channels); c++) {
        const float value = source[at + c * plane];

        if (is_invalid(value))
            return 0.0;
        most = value > most ? value : most;
    }
    for (uint c = 0; c < uint(channels); c++)
        sum = sum + part_of(source[at + c * plane], most);
    return sum >= FLT_MIN && sum <= FLT_MAX ? sum : 0.0;
}

#include "label_mean.glsl"

void main()
{
    const ivec2 here = ivec2(gl_GlobalInvocationID.xy);
    const uint plane = uint(grid_width * grid_height), i = uint(here.y * grid_width + here.x);
    const uint at = from + i, to = i * uint(classes + 5);
    float most, sum;
    uint winner = 0;
    vec3 colour;

    if (here.x >= grid_width || here.y >= grid_height)
        return;
    sum = look(at, plane, most);
    if (!(sum > 0.0))
        atomicOr(table[invalid], 1);
    for (uint c = 0; c < uint(classes); c++)
        cells[to + c] = 0.0;
    for (uint c = 0; c < uint(channels) && sum > 0.0; c++) {
        const float share = quotient(part_of(source[at + c * plane], most), sum);
        const uint of = to + table[class_of + c];
        precise float both = cells[of] + (share < LEAST ? 0.0 : share);

        cells[of] = both;
    }
    for (uint c = 1; c < uint(classes); c++)
        winner = cells[to + c] > cells[to + winner] ? c : winner;
    colour = mean_colour(here.x, here.y);
    cells[to + classes] = 1.0;
    cells[to + classes + 1] = colour.r;
    cells[to + classes + 2] = colour.g;
    cells[to + classes + 3] = colour.b;
    cells[to + classes + 4] = uintBitsToFloat(winner + 1);
}
