// Matching costs of a view against one neighbour, of the census, of features or of both, gathered over neighbours:
// hamming_row, cheapest_row and cheapest_mean_row of kernels.h. An invocation has four disparities of a pixel. Buffers and
// constants: pipeline/gpu/match.h. Definitions: census_ref.c, cheapest_ref.c.
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
layout(std430, binding = 2) readonly buffer Pixels { uint pixels[]; };
layout(std430, binding = 3) readonly buffer Others { uint others[]; };
layout(std430, binding = 4) readonly buffer Census { uvec2 census[]; };
layout(std430, binding = 5) readonly buffer OtherCensus { uvec2 other_census[]; };
layout(std430, binding = 6) buffer Sum { uint cheapest[]; };
layout(std430, binding = 7) buffer Cost { uint cost[]; };

layout(std430, push_constant) uniform Constants {
    int width, height;
    uint flags;
};

const uint FIRST = 1, LAST = 2, TWO = 4, MASKS = 8, FEATURES = 16, ALONE = 32;
const uint ABSENT = 255, UNSEEN = 96, MOST = 255;

bool is_seen(uint pixel)
{
    return pixel >> 24 != 0;
}

// The cost at a step, or ABSENT. `feature`: what the features cost there, if they do
uint cost_of(uvec2 own, uint feature, int x, int y, const Step s)
{
    const int xn = x + s.x, yn = y + s.y, near_x = x + s.near_x, near_y = y + s.near_y;
    const int at = yn * width + xn;
    uvec2 bits;
    uint census_cost;

    if (xn < 0 || near_x < 0 || xn >= width || near_x >= width || yn < 0 || near_y < 0 || yn >= height ||
        near_y >= height || ((flags & MASKS) != 0 && !is_seen(others[at])))
        return ABSENT;
    if ((flags & ALONE) != 0)
        return feature;
    bits = own ^ other_census[s.layer * height * width + at];
    census_cost = 4 * uint(bitCount(bits.x) + bitCount(bits.y));
    return (flags & FEATURES) != 0 ? (census_cost + feature + 1) >> 1 : census_cost;
}

// Insert a cost into the two smallest ones, the first in the lower byte.
uint insert(uint two, uint c)
{
    const uint first = two & 0xFF, second = two >> 8;

    return c < first ? c | first << 8 : c < second ? first | c << 8 : two;
}

// One cost from the two smallest ones.
uint mean_of(uint two)
{
    const uint a = two & 0xFF, b = two >> 8;

    if (a == ABSENT)
        return UNSEEN;
    return b == ABSENT ? a : (flags & TWO) != 0 ? (3 * a + b + 2) >> 2 : (a + b + 1) >> 1;
}

void main()
{
    const Tile t = tiles[gl_WorkGroupID.z];
    const uint of_pixel = uint(t.nd) >> 2, in_row = gl_GlobalInvocationID.x, row = gl_WorkGroupID.y;
    const uint pixel = in_row / of_pixel, quad = t.quad + row * uint(t.pitch) * of_pixel + in_row;
    const int x = t.left + int(pixel), y = t.top + int(row), d = int(in_row % of_pixel) * 4;
    uint two[4], feature = 0, all = 0;
    uvec2 own;
    bool match;

    if (row >= uint(t.rows) || pixel >= uint(t.pitch))
        return;
    match = (flags & MASKS) == 0 || is_seen(pixels[y * width + x]);
    own = (flags & ALONE) != 0 ? uvec2(0) : census[y * width + x];
    if ((flags & FEATURES) != 0)
        feature = cost[quad];
    for (int i = 0; i < 4; i++) {
        two[i] = (flags & FIRST) != 0 ? ABSENT | ABSENT << 8 : (cheapest[2 * quad + (i >> 1)] >> (16 * (i & 1))) & 0xFFFF;
        if (match && d + i < t.steps)
            two[i] = insert(two[i], cost_of(own, (feature >> (8 * i)) & 0xFF, x, y, steps[t.first + d + i]));
    }
    if ((flags & LAST) == 0) {
        cheapest[2 * quad] = two[0] | two[1] << 16;
        cheapest[2 * quad + 1] = two[2] | two[3] << 16;
        return;
    }
    for (int i = 0; i < 4; i++)
        all |= (d + i < t.steps ? mean_of(two[i]) : MOST) << (8 * i);
    cost[quad] = all;
}
