// Filling of what no view shows, after fill_along: rows are known as a whole or not at all. Unknown ones get the last known
// one above, or the first one below. Buffers and constants: pipeline/gpu/check.h. Definition: fill_down_reference().
#version 450

layout(local_size_x = 32, local_size_y = 8) in;

layout(std430, binding = 0) readonly buffer From { uint from[]; };
layout(std430, binding = 1) writeonly buffer To { uint to[]; };

layout(std430, push_constant) uniform Constants {
    int width, height;
};

const uint NONE = 0xFFFF;

void main()
{
    const int x = int(gl_GlobalInvocationID.x), y = int(gl_GlobalInvocationID.y);
    int row = y;

    if (x >= width || y >= height)
        return;
    while (row >= 0 && from[row * width] == NONE)
        row--;
    for (row = row < 0 ? y : row; row < height && from[row * width] == NONE;)
        row++;
    to[y * width + x] = row < height ? from[row * width + x] : NONE;
}
