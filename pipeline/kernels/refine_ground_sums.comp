// Sums that the planes of grounds are fitted to: over pixels within the limit of the plane so far. Buffers and constants:
// pipeline/gpu/refine.h. Definition: refine_ground_sums_reference().
#version 450
#extension GL_GOOGLE_include_directive : require

#include "refine_ground.glsl"

layout(local_size_x = 32, local_size_y = 8) in;

layout(std430, binding = 0) readonly buffer View { uint view[]; };
layout(std430, binding = 1) readonly buffer Grounds { Ground grounds[]; };
layout(std430, binding = 2) buffer Sums { uint sums[]; }; // [label][SUMS][2]

layout(std430, push_constant) uniform Constants {
    int width, height;
    uvec2 labels, least;
    uint spread, bins;
};

const uint NONE = 0xFFFF, LABELS = 64, SUMS = 9;
const uint N = 0, X = 1, Y = 2, D = 3, XX = 4, XY = 5, YY = 6, XD = 7, YD = 8;

shared uint found[LABELS * SUMS]; // of the group, x and y from its corner: below 2^30

void add_to(uint i, uint sum, uvec2 more)
{
    const uint at = 2 * (i * SUMS + sum), before = atomicAdd(sums[at], more.x);
    const uint high = more.y + (before + more.x < before ? 1u : 0u);

    if (high != 0)
        atomicAdd(sums[at + 1], high);
}

void look(uvec2 at, uvec2 within)
{
    const uint pixel = view[at.y * uint(width) + at.x], i = (pixel >> 16) - 1, q = pixel & NONE;
    const uint first = i * SUMS;

    if (i >= LABELS || q == NONE || !has_label(labels, i) || !is_at_most(miss_of(grounds[i], at, q), grounds[i].limit))
        return;
    atomicAdd(found[first + N], 1);
    atomicAdd(found[first + X], within.x);
    atomicAdd(found[first + Y], within.y);
    atomicAdd(found[first + D], q);
    atomicAdd(found[first + XX], within.x * within.x);
    atomicAdd(found[first + XY], within.x * within.y);
    atomicAdd(found[first + YY], within.y * within.y);
    atomicAdd(found[first + XD], within.x * q);
    atomicAdd(found[first + YD], within.y * q);
}

// From the group's corner to the picture's: of (x0 + u) (y0 + v) is x0 (y0 + v) + y0 u + u v.
void leave(uint i, uvec2 corner)
{
    const uint first = i * SUMS, n = found[first + N], u = found[first + X], v = found[first + Y];
    const uint x = n * corner.x + u, y = n * corner.y + v;

    if (n == 0)
        return;
    add_to(i, N, uvec2(n, 0));
    add_to(i, X, uvec2(x, 0));
    add_to(i, Y, uvec2(y, 0));
    add_to(i, D, uvec2(found[first + D], 0));
    add_to(i, XX, add(times(uvec2(x + u, 0), corner.x), uvec2(found[first + XX], 0)));
    add_to(i, XY, add(times(uvec2(y, 0), corner.x), uvec2(corner.y * u + found[first + XY], 0)));
    add_to(i, YY, add(times(uvec2(y + v, 0), corner.y), uvec2(found[first + YY], 0)));
    add_to(i, XD, add(times(uvec2(found[first + D], 0), corner.x), uvec2(found[first + XD], 0)));
    add_to(i, YD, add(times(uvec2(found[first + D], 0), corner.y), uvec2(found[first + YD], 0)));
}

void main()
{
    const uvec2 at = gl_GlobalInvocationID.xy;

    for (uint i = gl_LocalInvocationIndex; i < LABELS * SUMS; i += 256)
        found[i] = 0;
    barrier();
    if (at.x < uint(width) && at.y < uint(height))
        look(at, gl_LocalInvocationID.xy);
    barrier();
    if (gl_LocalInvocationIndex < LABELS)
        leave(gl_LocalInvocationIndex, gl_WorkGroupID.xy * uvec2(32, 8));
}
