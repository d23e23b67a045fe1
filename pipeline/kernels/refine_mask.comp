// Candidates of a view's pixels without a label: by disparity, and for grounds that are planes by these. Buffers and
// constants: pipeline/gpu/refine.h. Definition: refine_mask_reference().
#version 450
#extension GL_GOOGLE_include_directive : require

#include "refine_ground.glsl"

layout(local_size_x = 32, local_size_y = 8) in;

struct Choice {
    uint nearest2[2], farthest2[2], label[2];
};

layout(std430, binding = 0) readonly buffer View { uint view[]; };
layout(std430, binding = 1) readonly buffer Table { uvec2 table[]; };
layout(std430, binding = 2) readonly buffer Grounds { Ground grounds[]; };
layout(std430, binding = 3) buffer Seen { uint seen[]; };
layout(std430, binding = 4) writeonly buffer Choices { Choice choices[]; };
layout(std430, binding = 5) writeonly buffer Masks { uvec2 masks[]; };

layout(std430, push_constant) uniform Constants {
    int width, height;
    uvec2 planar, ground;
    int top, rows;
};

const uint NONE = 0xFFFF;

shared uint found[4]; // as seen, of the group

// Bits of one half that stay: of labels from `first` + 1 on.
uint on_planes(uint bits, uint of_planes, uint first, uvec2 at, uint q)
{
    for (uint left = bits & of_planes; left != 0; left &= left - 1) {
        const uint i = uint(findLSB(left));

        if (!is_at_most(miss_of(grounds[first + i], at, q), grounds[first + i].limit))
            bits &= ~(1u << i);
    }
    return bits;
}

void main()
{
    const uvec2 at = gl_GlobalInvocationID.xy + uvec2(0, top);
    const uint i = gl_GlobalInvocationID.y * uint(width) + at.x;

    if (gl_LocalInvocationIndex < 4)
        found[gl_LocalInvocationIndex] = 0;
    barrier();
    if (at.x < uint(width) && gl_GlobalInvocationID.y < uint(rows)) {
        const uint pixel = view[at.y * uint(width) + at.x];
        uvec2 mask = pixel < NONE ? table[pixel] : uvec2(0);

        mask.x = on_planes(mask.x, planar.x, 0, at, pixel);
        mask.y = on_planes(mask.y, planar.y, 32, at, pixel);
        masks[i] = mask;
        if (bitCount(mask.x) + bitCount(mask.y) > 1) {
            choices[i] = Choice(uint[2](0, 0), uint[2](0, 0), uint[2](0, 0));
            atomicOr(found[0], mask.x);
            atomicOr(found[1], mask.y);
            if ((mask & ground) != uvec2(0) && (mask & ~ground) != uvec2(0)) {
                atomicOr(found[2], mask.x);
                atomicOr(found[3], mask.y);
            }
        }
    }
    barrier();
    if (gl_LocalInvocationIndex < 4 && found[gl_LocalInvocationIndex] != 0)
        atomicOr(seen[gl_LocalInvocationIndex], found[gl_LocalInvocationIndex]);
}
