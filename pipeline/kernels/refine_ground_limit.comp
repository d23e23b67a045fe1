// Limits of residuals by their medians, a group per ground; the histogram is cleared. Its bins are summed up in 16 regions,
// then the region with the median in 256 parts, then bin by bin. Buffers and constants: pipeline/gpu/refine.h. Definition:
// refine_ground_limit_reference().
#version 450
#extension GL_EXT_control_flow_attributes : require
#extension GL_GOOGLE_include_directive : require

#include "refine_ground.glsl"

layout(local_size_x = 256) in;

layout(std430, binding = 0) buffer Misses { uvec4 misses[]; }; // [ground][bins / 4]
layout(std430, binding = 1) buffer Grounds { Ground grounds[]; };

layout(std430, push_constant) uniform Constants {
    int width, height;
    uvec2 labels, least;
    uint spread, bins;
};

const uint PARTS = 256, TEAMS = 16, AHEAD = 8; // AHEAD loads do not wait for each other

shared uint part[PARTS], team[TEAMS]; // pixels that an invocation found, and 16 of them together

uint all = 0, below = 0; // pixels, and those below what was looked at

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

uint sum_of(uvec4 v)
{
    return v.x + v.y + v.z + v.w;
}

void share(uint mine)
{
    const uint i = gl_LocalInvocationIndex;

    barrier();
    part[i] = mine;
    barrier();
    if (i < TEAMS) {
        uint sum = 0;

        for (uint k = 0; k < 16; k++)
            sum += part[16 * i + k];
        team[i] = sum;
    }
    barrier();
}

// The first team with which there is half of all.
uint middle_team()
{
    uint k = 0;

    for (; k < TEAMS - 1 && 2 * (below + team[k]) < all; k++)
        below += team[k];
    return k;
}

uint middle_part(uint first)
{
    uint k = first;

    for (; k < first + 15 && 2 * (below + part[k]) < all; k++)
        below += part[k];
    return k;
}

// Pixels in every 16th word of a region from the invocation's on.
uint count_region(uint first, uint size)
{
    uint sum = 0;

    for (uint k = gl_LocalInvocationIndex % 16; k < size; k += 16 * AHEAD) {
        [[unroll]] for (uint j = 0; j < AHEAD; j++)
            sum += k + 16 * j < size ? sum_of(misses[first + k + 16 * j]) : 0;
    }
    return sum;
}

// The first bin up to which there is half of all, of the words of an invocation.
uint middle_bin(uint first, uint size)
{
    uint bin = 0;

    for (uint k = 0; k < size; k++) {
        const uvec4 v = misses[first + k];

        [[unroll]] for (uint c = 0; c < 4; c++) {
            below += v[c];
            bin += 2 * below < all ? 1 : 0;
        }
    }
    return bin;
}

// The first bin of the histogram up to which there is half of all.
uint median(uint first)
{
    const uint i = gl_LocalInvocationIndex, size = bins / 4 / TEAMS, each = (size + PARTS - 1) / PARTS;
    uint region, sum = 0, k;

    share(count_region(first + i / 16 * size, size));
    for (uint t = 0; t < TEAMS; t++)
        all += team[t];
    region = middle_team() * size;
    for (k = i * each; k < min((i + 1) * each, size); k++)
        sum += sum_of(misses[first + region + k]);
    share(sum);
    k = region + middle_part(16 * middle_team()) * each;
    return 4 * k + middle_bin(first + k, min(each, region + size - k));
}

void main()
{
    const uint slot = gl_WorkGroupID.x, first = slot * (bins / 4);
    const uvec2 limit = times(uvec2(spread, 0), median(first));

    if (gl_LocalInvocationIndex == 0)
        grounds[label_of(slot)].limit = is_at_most(limit, least) ? least : limit;
    barrier();
    for (uint k = gl_LocalInvocationIndex; k < bins / 4; k += PARTS)
        misses[first + k] = uvec4(0);
}
