// Maps carried to a view, the beginning: nothing has arrived. Buffers and constants: pipeline/gpu/carry.h. Definition:
// carry_start_reference().
#version 450

layout(local_size_x = 32, local_size_y = 8) in;

layout(std430, binding = 0) writeonly buffer Arrived { uint arrived[]; };

layout(std430, push_constant) uniform Constants {
    int width, height, agreed;
};

const uint NONE = 0xFFFF;

void main()
{
    const int x = int(gl_GlobalInvocationID.x), y = int(gl_GlobalInvocationID.y);
    const uint at = uint(y * width + x), n = uint(width * height);

    if (x >= width || y >= height)
        return;
    arrived[at] = 0;
    if (agreed != 0) {
        arrived[n + at] = NONE;
        arrived[2 * n + at] = 0;
    }
}
