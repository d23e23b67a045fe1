// Vertical distances to the nearest pixel with a label, a thread per column: one sweep down, one up. Buffers and
// constants: pipeline/gpu/refine.h. Definition: refine_columns_reference().
#version 450

layout(local_size_x = 64) in;

layout(std430, binding = 0) readonly buffer View { uint view[]; };
layout(std430, binding = 1) buffer Columns { uint columns[]; };

layout(std430, push_constant) uniform Constants {
    int width, height;
    uint label;
};

const uint FAR = 1u << 20;

void main()
{
    const int x = int(gl_GlobalInvocationID.x);
    uint d = FAR;

    if (x >= width)
        return;
    for (int y = 0; y < height; y++) {
        d = view[y * width + x] >> 16 == label ? 0 : min(d + 1, FAR);
        columns[y * width + x] = d;
    }
    for (int y = height - 2; y >= 0; y--) {
        d = min(d + 1, columns[y * width + x]);
        columns[y * width + x] = d;
    }
}
