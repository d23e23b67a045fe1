// Filling of what no view shows, along rows: the farther of the nearest known disparities to both sides, which is that of
// the background. Buffers and constants: pipeline/gpu/check.h. Definition: fill_along_reference().
#version 450

layout(local_size_x = 32, local_size_y = 8) in;

layout(std430, binding = 0) readonly buffer From { uint from[]; };
layout(std430, binding = 1) writeonly buffer To { uint to[]; };

layout(std430, push_constant) uniform Constants {
    int width, height;
};

const uint NONE = 0xFFFF; // larger than all that are known

void main()
{
    const int x = int(gl_GlobalInvocationID.x), y = int(gl_GlobalInvocationID.y), row = y * width;
    uint there;

    if (x >= width || y >= height)
        return;
    there = from[row + x];
    if (there == NONE) {
        int left = x - 1, right = x + 1;

        while (left >= 0 && from[row + left] == NONE)
            left--;
        while (right < width && from[row + right] == NONE)
            right++;
        there = min(left >= 0 ? from[row + left] : NONE, right < width ? from[row + right] : NONE);
    }
    to[row + x] = there;
}
