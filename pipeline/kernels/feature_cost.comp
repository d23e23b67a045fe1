// Costs of a view's features against those of one neighbour, at every step: feature_cost_rows of kernels.h. An invocation
// has four disparities of a pixel. Buffers and constants: pipeline/gpu/match.h. Definition: feature_cost_ref.c.
#version 450

layout(local_size_x = 64) in;

struct Tile {
    int x0, y0, width, height, left, top, pitch, rows, first, steps, nd;
    uint quad;
};

struct Step {
    int x, y, layer, near_x, near_y;
};

layout(std430, binding = 0) readonly buffer Tiles { Tile tiles[]; };
layout(std430, binding = 1) readonly buffer Steps { Step steps[]; };
layout(std430, binding = 2) readonly buffer Features { uint features[]; };
layout(std430, binding = 3) readonly buffer Others { uint others[]; };
layout(std430, binding = 4) writeonly buffer Cost { uint cost[]; };

layout(std430, push_constant) uniform Constants {
    int width, height;
};

const int WORDS = 16; // of a pixel: four components each
const uint ABSENT = 255;
const int ONE = 127, SHIFT = 6, MOST = 128;

vec4 components(uint word)
{
    return vec4(uvec4(word, word >> 8, word >> 16, word >> 24) & 0xFF) - 128.0;
}

void main()
{
    const Tile t = tiles[gl_WorkGroupID.z];
    const uint of_pixel = uint(t.nd) >> 2, in_row = gl_GlobalInvocationID.x, row = gl_WorkGroupID.y;
    const uint pixel = in_row / of_pixel, quad = t.quad + row * uint(t.pitch) * of_pixel + in_row;
    const int x = t.left + int(pixel), y = t.top + int(row), d = int(in_row % of_pixel) * 4;
    uint own[WORDS], all = 0, here = ABSENT;
    int last = -1;

    if (row >= uint(t.rows) || pixel >= uint(t.pitch))
        return;
    for (int i = 0; i < WORDS; i++)
        own[i] = features[(y * WORDS + i) * width + x];
    for (int i = 0; i < 4; i++) {
        const Step s = steps[min(t.first + d + i, t.first + t.steps - 1)];
        const int xn = x + s.near_x, yn = y + s.near_y;
        const bool inside = d + i < t.steps && xn >= 0 && yn >= 0 && xn < width && yn < height;
        const int at = inside ? yn * WORDS * width + xn : -1;

        // Steps of less than a pixel share their nearest one.
        if (at != last && inside) {
            float product = 0.0; // whole numbers below 2^20: every sum is exact

            for (int j = 0; j < WORDS; j++)
                product += dot(components(own[j]), components(others[at + j * width]));
            here = uint(clamp((ONE * ONE - int(product)) >> SHIFT, 0, MOST));
        }
        last = at;
        all |= (inside ? here : ABSENT) << (8 * i);
    }
    cost[quad] = all;
}
