// Copies rectangles of pixels, or labels to pixels. Buffers and constants: pipeline/gpu/tiles.h. Definition:
// tiles_reference().
#version 450

layout(local_size_x = 32, local_size_y = 8) in;

struct Tile {
    uint from, to, width, height;
};

layout(std430, binding = 0) readonly buffer List { Tile tile[]; };
layout(std430, binding = 1) readonly buffer From { uint source[]; };
layout(std430, binding = 2) buffer To { uint pixel[]; };

layout(std430, push_constant) uniform Constants {
    int from_pitch, to_pitch;
    uint first, flags;
};

const uint LABELS = 1;

void main()
{
    const Tile t = tile[first + gl_WorkGroupID.x];

    for (uint y = gl_LocalInvocationID.y; y < t.height; y += 8) {
        for (uint x = gl_LocalInvocationID.x; x < t.width; x += 32) {
            const uint from = t.from + y * uint(from_pitch) + x, to = t.to + y * uint(to_pitch) + x;

            if ((flags & LABELS) == 0)
                pixel[to] = source[from];
            else
                pixel[to] = (pixel[to] & 0xFFFFFF) | ((source[from >> 2] >> ((from & 3) * 8)) & 0xFF) << 24;
        }
    }
}
