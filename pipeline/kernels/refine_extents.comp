// The first and the last pixel of each label in a row, a group per row. Buffers and constants: pipeline/gpu/refine.h.
// Definition: refine_extents_reference().
#version 450

layout(local_size_x = 64) in;

layout(std430, binding = 0) readonly buffer View { uint view[]; };
layout(std430, binding = 1) writeonly buffer Extents { uint extents[]; }; // [label][height]

layout(std430, push_constant) uniform Constants {
    int width, height;
    uint labels;
};

const uint NONE = 0xFFFF, LABELS = 64;

shared uint first[LABELS], last[LABELS];

void main()
{
    const uint y = gl_WorkGroupID.x, mine = gl_LocalInvocationIndex;

    first[mine] = NONE;
    last[mine] = 0;
    barrier();
    for (uint x = mine; x < uint(width); x += 64) {
        const uint i = (view[y * uint(width) + x] >> 16) - 1;

        if (i < LABELS) {
            atomicMin(first[i], x);
            atomicMax(last[i], x);
        }
    }
    barrier();
    if (mine < labels)
        extents[mine * uint(height) + y] = first[mine] | last[mine] << 16;
}
