// Costs of a view's features and one neighbour's: for feature_cost.comp and feature_cost_dot.comp, which define
// dot_of(a, b, sum), sum + the products of four components of type `Four`, and four_of(word) to make these.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0

#include "match_block.glsl"

layout(std430, binding = 2) readonly buffer Features { uint features[]; };
layout(std430, binding = 3) readonly buffer Others { uint others[]; }; // of the neighbour
// out: the cost at a step's nearest pixel; SST_COST_ABSENT outside, and in the padding
layout(std430, binding = 4) writeonly buffer Cost { uint cost[]; };

layout(std430, push_constant) uniform Constants {
    int width, height;
};

const int WORDS = 16; // of a pixel: four components each
const uint ABSENT = 255;
const int ONE = 127, SHIFT = 6, MOST = 128;

shared uint cost_of[PIXELS * PITCH];

void compute(const Tile t, ivec2 from, int d, uint place)
{
    Four own[WORDS];
    uint all = 0, here = ABSENT;
    int last = -1;

    [[unroll]] for (int i = 0; i < WORDS; i++)
        own[i] = four_of(features[(from.y * WORDS + i) * width + from.x]);
    for (int i = 0; i < 4; i++) {
        const Step s = steps[min(t.first + d + i, t.first + t.steps - 1)];
        const int xn = from.x + s.near_x, yn = from.y + s.near_y;
        const bool inside = d + i < t.steps && xn >= 0 && yn >= 0 && xn < width && yn < height;
        const int at = inside ? yn * WORDS * width + xn : -1;

        // Steps of less than a pixel share their nearest one.
        if (at != last && inside) {
            int product = 0;

            [[unroll]] for (int j = 0; j < WORDS; j++)
                product = dot_of(own[j], four_of(others[at + j * width]), product);
            here = uint(clamp((ONE * ONE - product) >> SHIFT, 0, MOST));
        }
        last = at;
        all |= (inside ? here : ABSENT) << (8 * i);
    }
    cost_of[place] = all;
}

void main()
{
    const Tile t = tiles[gl_WorkGroupID.z];
    const Block b = block_of(t);
    uint quad, place, there;
    ivec2 at;
    int d;

    if (!b.exists)
        return;
    if (computes(b, t, at, d, there))
        compute(t, at, d, there);
    barrier();
    if (moves(b, t, quad, place))
        cost[quad] = cost_of[place];
}
