// Limits of residuals by their medians, a group per ground; the histogram is cleared. Buffers and constants:
// pipeline/gpu/refine.h. Definition: refine_ground_limit_reference().
#version 450
#extension GL_GOOGLE_include_directive : require

#include "refine_ground.glsl"

layout(local_size_x = 256) in;

layout(std430, binding = 0) buffer Misses { uint misses[]; }; // [ground][bins]
layout(std430, binding = 1) buffer Grounds { Ground grounds[]; };

layout(std430, push_constant) uniform Constants {
    int width, height;
    uvec2 labels, least;
    uint spread, bins;
};

const uint PARTS = 256;

shared uint part[PARTS]; // pixels in the bins of an invocation

// The label of a slot.
uint label_of(uint slot)
{
    uint i = 0;

    for (uint left = slot + 1; i < 63; i++) {
        left -= has_label(labels, i) ? 1 : 0;
        if (left == 0)
            break;
    }
    return i;
}

// The first bin up to which there is half of all.
uint median(uint first)
{
    uint all = 0, below = 0, k = 0, bin;

    for (uint i = 0; i < PARTS; i++)
        all += part[i];
    for (; k < PARTS - 1 && 2 * (below + part[k]) < all; k++)
        below += part[k];
    for (bin = k * (bins / PARTS); bin < bins - 1; bin++) {
        below += misses[first + bin];
        if (2 * below >= all)
            break;
    }
    return bin;
}

void main()
{
    const uint slot = gl_WorkGroupID.x, size = bins / PARTS, mine = slot * bins + gl_LocalInvocationIndex * size;
    uint sum = 0;

    for (uint k = 0; k < size; k++)
        sum += misses[mine + k];
    part[gl_LocalInvocationIndex] = sum;
    barrier();
    if (gl_LocalInvocationIndex == 0) {
        const uvec2 limit = times(uvec2(spread, 0), median(slot * bins));

        grounds[label_of(slot)].limit = is_at_most(limit, least) ? least : limit;
    }
    barrier();
    for (uint k = 0; k < size; k++)
        misses[mine + k] = 0;
}
