// Costs of a view's features against those of one neighbour, at every step: feature_cost_rows of kernels.h. Buffers and
// constants: pipeline/gpu/match.h. Definition: feature_cost_ref.c.
#version 450
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require

layout(local_size_x = 256) in;

#include "match_block.glsl"

layout(std430, binding = 2) readonly buffer Features { uint features[]; };
layout(std430, binding = 3) readonly buffer Others { uint others[]; };
layout(std430, binding = 4) writeonly buffer Cost { uint cost[]; };

layout(std430, push_constant) uniform Constants {
    int width, height;
};

const int WORDS = 16; // of a pixel: four components each
const uint ABSENT = 255;
const int ONE = 127, SHIFT = 6, MOST = 128, ZERO = 128;

shared uint cost_of[PIXELS * PITCH];

// Sums of products of components + ZERO, and of the components + ZERO of `b`.
void add_products(inout uvec2 sums, uint a, uint b)
{
    const uvec4 shift = uvec4(0, 8, 16, 24), p = (uvec4(a) >> shift) & 0xFF, q = (uvec4(b) >> shift) & 0xFF;

    sums += uvec2(p.x * q.x + p.y * q.y + p.z * q.z + p.w * q.w, q.x + q.y + q.z + q.w);
}

uint sum_of_bytes(uint word)
{
    const uint pairs = (word & 0x00FF00FF) + ((word >> 8) & 0x00FF00FF);

    return (pairs & 0xFFFF) + (pairs >> 16);
}

void compute(const Tile t, ivec2 from, int d, uint place)
{
    uint own[WORDS], sum = 0, all = 0, here = ABSENT;
    int last = -1;

    [[unroll]] for (int i = 0; i < WORDS; i++) {
        own[i] = features[(from.y * WORDS + i) * width + from.x];
        sum += sum_of_bytes(own[i]);
    }
    for (int i = 0; i < 4; i++) {
        const Step s = steps[min(t.first + d + i, t.first + t.steps - 1)];
        const int xn = from.x + s.near_x, yn = from.y + s.near_y;
        const bool inside = d + i < t.steps && xn >= 0 && yn >= 0 && xn < width && yn < height;
        const int at = inside ? yn * WORDS * width + xn : -1;

        // Steps of less than a pixel share their nearest one.
        if (at != last && inside) {
            uvec2 sums = uvec2(0);
            int product;

            [[unroll]] for (int j = 0; j < WORDS; j++)
                add_products(sums, own[j], others[at + j * width]);
            product = int(sums.x) - ZERO * int(sum + sums.y) + 4 * WORDS * ZERO * ZERO;
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
