// Pixels by label and disparity, added up over views. Buffers and constants: pipeline/gpu/refine.h. Definition:
// refine_count_reference().
#version 450

layout(local_size_x = 32, local_size_y = 8) in;

layout(std430, binding = 0) readonly buffer View { uint view[]; };
layout(std430, binding = 1) buffer Counts { uint counts[]; };

layout(std430, push_constant) uniform Constants {
    int width, height;
    uint labels, bins;
};

const uint NONE = 0xFFFF;

void main()
{
    const uvec2 at = gl_GlobalInvocationID.xy;
    uint pixel, label;

    if (at.x >= uint(width) || at.y >= uint(height))
        return;
    pixel = view[at.y * uint(width) + at.x];
    label = pixel >> 16;
    if (label != 0 && label <= labels && (pixel & NONE) < bins)
        atomicAdd(counts[(label - 1) * bins + (pixel & NONE)], 1);
}
