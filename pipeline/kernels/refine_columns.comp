// Vertical distances to the nearest pixel with a label, a thread per column: one sweep down, one up, of which
// the rows of a band are kept. Buffers and
// constants: pipeline/gpu/refine.h. Definition: refine_columns_reference().
#version 450

layout(local_size_x = 64) in;

layout(std430, binding = 0) readonly buffer View { uint view[]; };
layout(std430, binding = 1) buffer Columns { uint columns[]; };

layout(std430, push_constant) uniform Constants {
    int width, height;
    uint label;
    int top, rows;
};

const uint FAR = 1u << 20;

void main()
{
    const int x = int(gl_GlobalInvocationID.x);
    uint d = FAR;

    if (x >= width)
        return;
    for (int y = 0; y < top; y++)
        d = view[y * width + x] >> 16 == label ? 0 : min(d + 1, FAR);
    for (int row = 0; row < rows; row++) {
        d = view[(top + row) * width + x] >> 16 == label ? 0 : min(d + 1, FAR);
        columns[row * width + x] = d;
    }
    d = FAR;
    for (int y = height - 1; y >= top + rows; y--)
        d = view[y * width + x] >> 16 == label ? 0 : min(d + 1, FAR);
    for (int row = rows - 1; row >= 0; row--) {
        d = min(d + 1, columns[row * width + x]);
        columns[row * width + x] = d;
    }
}
