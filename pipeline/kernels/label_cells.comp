// Most probable class and entropy of each pixel from the cells of a coarse grid around it: guide_cells and class_row of
// kernels.h. Four classes are summed up at once; what is past the last one is no class, but in the cell. 32 invocations one
// after the other have 8 x 4 pixels, which have most cells in common. Buffers and constants: pipeline/gpu/label.h.
// Definition: label_cells_reference().
#version 450
#extension GL_EXT_control_flow_attributes : require
#extension GL_GOOGLE_include_directive : require

#include "exp_neg.glsl"
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

    [[unroll]] for (int k = 0; k < 16; k++) {
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

// Four values of the cells, summed up.
vec4 mixed(int value)
{
    precise vec4 sum = vec4(0.0);

    [[unroll]] for (int k = 0; k < 16; k++) {
        const int at = first_of[k] + value;

        sum = sum + weight[k] * vec4(cells[at], cells[at + 1], cells[at + 2], cells[at + 3]);
    }
    return sum;
}

// The most probable class so far; sums over classes, without that one and with it.
struct Found {
    int best;
    float most, most_plogp, rest, h, rest_all, h_all;
};

void look(inout Found f, int c, float p)
{
    const float term = plogp(p);
    const bool is_best = c == 0 || p > f.most;
    precise float rest = f.rest + p, h = f.h - term;
    precise float rest_all = f.rest_all + p, h_all = f.h_all - term;

    f.rest = is_best ? f.rest_all : rest;
    f.h = is_best ? f.h_all : h;
    f.best = is_best ? c : f.best;
    f.most = is_best ? p : f.most;
    f.most_plogp = is_best ? term : f.most_plogp;
    f.rest_all = rest_all;
    f.h_all = h_all;
}

float entropy_of(Found f)
{
    precise float sum;

    if (f.rest < 0.5) {
        precise float sure = 1.0 - f.rest, divisor = 2.0 - f.rest;

        sum = f.h - sure * atanh2(quotient(-f.rest, divisor));
    } else {
        sum = f.h - f.most_plogp;
    }
    return sum <= 0.0 ? 0.0 : sum;
}

ivec2 place()
{
    const ivec2 corner = ivec2(gl_WorkGroupID.xy) * ivec2(32, 8);
    const int i = int(gl_LocalInvocationIndex);

    return corner + ivec2(i / 32 % 4 * 8 + i % 8, i / 128 * 4 + i / 8 % 4);
}

void main()
{
    const ivec2 here = place();
    const int n = width * height, at = here.y * width + here.x;
    Found f = Found(0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
    float scale, h;
    uint pixel, single;

    if (here.x >= width || here.y >= height)
        return;
    pixel = view[n + at];
    single = find_cells(places[here.x], places[width + here.y],
                        vec3(pixel & 0xFF, (pixel >> 8) & 0xFF, (pixel >> 16) & 0xFF));
    scale = quotient(1.0, mixed(classes).x);
    for (int c = 0; c < classes; c += 4) {
        precise vec4 p = mixed(c) * scale;

        [[unroll]] for (int i = 0; i < 4; i++) {
            if (c + i < classes)
                look(f, c + i, p[i]);
        }
    }
    h = entropy_of(f);
    result[at] = h < limit || entropies != 0 ? (single != 0 ? single : uint(f.best) + 1) : 0;
    if (entropies != 0)
        result[n + at] = floatBitsToUint(h);
}
