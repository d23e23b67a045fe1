// Matching costs of a view against one neighbour, of the census, of features or of both, gathered over neighbours:
// hamming_row, cheapest_row and cheapest_mean_row of kernels.h. Constants: pipeline/gpu/match.h. Definitions:
// census_ref.c, cheapest_ref.c.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0
#version 450
#extension GL_GOOGLE_include_directive : require

layout(local_size_x = 256) in;

#include "match_block.glsl"

// of the view; not read without SST_GPU_MATCH_MASKS
layout(std430, binding = 2) readonly buffer Pixels { uint pixels[]; };
layout(std430, binding = 3) readonly buffer Others { uint others[]; }; // of the neighbour; not read without SST_GPU_MATCH_MASKS
layout(std430, binding = 4) readonly buffer Census { uvec2 census[]; }; // uint64_t[height][width]
layout(std430, binding = 5) readonly buffer OtherCensus { uvec2 other_census[]; }; // uint64_t[layers][height][width]
layout(std430, binding = 6) buffer Sum { uvec2 cheapest[]; }; // in and out: the cheapest cost | the second one << 8
// in, with SST_GPU_MATCH_FEATURES; out, with SST_GPU_MATCH_LAST
layout(std430, binding = 7) buffer Cost { uint cost[]; };

layout(std430, push_constant) uniform Constants {
    int width, height;
    uint flags;
};

const uint FIRST = 1, LAST = 2, TWO = 4, MASKS = 8, FEATURES = 16, ALONE = 32;
const uint ABSENT = 255, UNSEEN = 96, MOST = 255;

shared uvec2 two_of[PIXELS * PITCH]; // the cheapest costs
shared uint features_of[PIXELS * PITCH];

bool is_seen(uint pixel)
{
    return pixel >> 24 != 0;
}

// The cost at a step, or ABSENT. `feature`: what the features cost there, if they do
uint cost_of(uvec2 own, uint feature, ivec2 from, const Step s)
{
    const int xn = from.x + s.x, yn = from.y + s.y, near_x = from.x + s.near_x, near_y = from.y + s.near_y;
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

void compute(const Tile t, ivec2 at, int d, uint place)
{
    const int pixel = at.y * width + at.x;
    const bool match = (flags & MASKS) == 0 || is_seen(pixels[pixel]);
    const uvec2 own = (flags & ALONE) != 0 ? uvec2(0) : census[pixel], were = two_of[place];
    const uint feature = (flags & FEATURES) != 0 ? features_of[place] : 0;
    uvec4 two = uvec4(were.x & 0xFFFF, were.x >> 16, were.y & 0xFFFF, were.y >> 16);

    for (int i = 0; i < 4; i++) {
        if (match && d + i < t.steps)
            two[i] = insert(two[i], cost_of(own, (feature >> (8 * i)) & 0xFF, at, steps[t.first + d + i]));
    }
    if ((flags & LAST) == 0) {
        two_of[place] = uvec2(two.x | two.y << 16, two.z | two.w << 16);
    } else {
        uint all = 0;

        for (int i = 0; i < 4; i++)
            all |= (d + i < t.steps ? mean_of(two[i]) : MOST) << (8 * i);
        features_of[place] = all;
    }
}

void main()
{
    const Tile t = tiles[gl_WorkGroupID.z];
    const Block b = block_of(t);
    uint quad, place, there;
    ivec2 at;
    int d;
    bool in_volume;

    if (!b.exists)
        return;
    in_volume = moves(b, t, quad, place);
    if (in_volume) {
        two_of[place] = (flags & FIRST) != 0 ? uvec2(ABSENT * 0x01010101u) : cheapest[quad];
        if ((flags & FEATURES) != 0)
            features_of[place] = cost[quad];
    }
    barrier();
    if (computes(b, t, at, d, there))
        compute(t, at, d, there);
    barrier();
    if (in_volume && (flags & LAST) == 0)
        cheapest[quad] = two_of[place];
    else if (in_volume)
        cost[quad] = features_of[place];
}
