// Most probable class and entropy of each pixel from the cells of a coarse grid around it: guide_cells and class_row of
// kernels.h. Buffers and constants: pipeline/gpu/label.h. Definition: label_cells_reference().
#version 450
#extension GL_GOOGLE_include_directive : require

#include "quotient.glsl"

layout(local_size_x = 32, local_size_y = 8) in;

struct Place {
    uint first;
    float weight[4];
};

layout(std430, binding = 0) readonly buffer View { uint view[]; };
layout(std430, binding = 1) readonly buffer Cells { float cells[]; };
layout(std430, binding = 2) readonly buffer Places { Place places[]; };
layout(std430, binding = 3) writeonly buffer Out { uint result[]; };

layout(std430, push_constant) uniform Constants {
    int width, height, grid_width, grid_height, classes;
    float limit;
    uint entropies;
};

const float SMALLEST = 1.17549435e-38, EXP_MOST = 86.0, FLOOR = 1e-3, SCALE = 0.5 / 400.0;

int first_of[16]; // of the floats of a cell
float weight[16];

// exp_neg.h
float exp_neg(float t)
{
    const int k = int(t * 1.44269504 + 0.5);
    const float n = float(k);
    precise float r = (n * 0.693359375 - t) + n * -2.12194440e-4;
    precise float p =
        1.0 +
        r * (1.0 + r * (0.5 + r * (1.0 / 6.0 + r * (1.0 / 24.0 + r * (1.0 / 120.0 + r * (1.0 / 720.0 + r * (1.0 / 5040.0)))))));
    precise float scaled = p * intBitsToFloat((127 - k) << 23);

    return scaled;
}

// log_pos.h
float atanh2(float z)
{
    precise float s = z * z;
    precise float series =
        1.0 +
        s * (1.0 / 3.0 + s * (1.0 / 5.0 + s * (1.0 / 7.0 + s * (1.0 / 9.0 + s * (1.0 / 11.0 + s * (1.0 / 13.0))))));
    precise float twice = 2.0 * z;
    precise float product = twice * series;

    return product;
}

float log_pos(float x)
{
    const int bits = floatBitsToInt(x), k = (bits - 0x3F3504F3) >> 23;
    const float m = intBitsToFloat(bits - k * (1 << 23)), n = float(k);
    precise float below = m - 1.0, above = m + 1.0;
    const float series = atanh2(quotient(below, above));
    precise float sum = n * 0.693359375 + (n * -2.12194440e-4 + series);

    return sum;
}

float plogp(float p)
{
    precise float product = p * log_pos(max(p, SMALLEST));

    return product;
}

// Places and weights of the cells around a pixel. @return their winner, if it is the same one, else 0
uint find_cells(Place across, Place down, vec3 colour)
{
    const int stride = classes + 5;
    uint single = 0;

    for (int k = 0; k < 16; k++) {
        const int x = clamp(int(across.first) - 1 + k % 4, 0, grid_width - 1);
        const int y = clamp(int(down.first) - 1 + k / 4, 0, grid_height - 1);
        const int first = (y * grid_width + x) * stride, mean = first + classes + 1;
        const uint winner = floatBitsToUint(cells[mean + 3]);
        precise float dr = colour.r - cells[mean], dg = colour.g - cells[mean + 1], db = colour.b - cells[mean + 2];
        precise float t = ((dr * dr + dg * dg) + db * db) * SCALE;
        precise float near = across.weight[k % 4] * down.weight[k / 4];
        precise float alike = exp_neg(min(t, EXP_MOST)) + FLOOR;
        precise float both = near * alike;

        first_of[k] = first;
        weight[k] = both;
        single = k == 0 || single == winner ? winner : 0;
    }
    return single;
}

// A value of the cells, summed up.
float mixed(int value)
{
    precise float sum = 0.0;

    for (int k = 0; k < 16; k++)
        sum = sum + weight[k] * cells[first_of[k] + value];
    return sum;
}

float probability(int value, float scale)
{
    precise float p = mixed(value) * scale;

    return p;
}

float entropy_of(int best, float most, float scale)
{
    precise float rest = 0.0, h = 0.0, sum;

    for (int c = 0; c < classes; c++) {
        if (c != best) {
            const float p = probability(c, scale);

            rest = rest + p;
            h = h - plogp(p);
        }
    }
    if (rest < 0.5) {
        precise float sure = 1.0 - rest, divisor = 2.0 - rest;

        sum = h - sure * atanh2(quotient(-rest, divisor));
    } else {
        sum = h - plogp(most);
    }
    return sum <= 0.0 ? 0.0 : sum;
}

void main()
{
    const int x = int(gl_GlobalInvocationID.x), y = int(gl_GlobalInvocationID.y), n = width * height;
    const int at = y * width + x;
    int best = 0;
    float scale, most, h;
    uint pixel, single;

    if (x >= width || y >= height)
        return;
    pixel = view[n + at];
    single = find_cells(places[x], places[width + y], vec3(pixel & 0xFF, (pixel >> 8) & 0xFF, (pixel >> 16) & 0xFF));
    scale = quotient(1.0, mixed(classes));
    most = probability(0, scale);
    for (int c = 1; c < classes; c++) {
        const float p = probability(c, scale);

        best = p > most ? c : best;
        most = p > most ? p : most;
    }
    h = entropy_of(best, most, scale);
    result[at] = h < limit || entropies != 0 ? (single != 0 ? single : uint(best) + 1) : 0;
    if (entropies != 0)
        result[n + at] = floatBitsToUint(h);
}
