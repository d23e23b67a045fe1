// Multi-view check of a view's disparities: do others hold the same surface where they put a pixel? Buffers and
// constants: pipeline/gpu/check.h. Definition: check_reference().
#version 450

layout(local_size_x = 32, local_size_y = 8) in;

struct Other {
    uint first;
    int across, across_part, across_step, down, down_part, down_step;
};

layout(std430, binding = 0) readonly buffer Others { Other others[]; };
layout(std430, binding = 1) buffer Maps { uint maps[]; };

layout(std430, push_constant) uniform Constants {
    int width, height;
    uint own;
    int count, steps;
};

const uint CORRECT = 0, MISMATCH = 1, OCCLUSION = 2;
const int NONE = 0xFFFF, AGREE = 64, PIXEL = 64;

bool agrees(int x, int y, int d)
{
    for (int i = 0; i < count; i++) {
        const Other o = others[i];
        const int xn = x + o.across + ((o.across_part + d * o.across_step) >> 16);
        const int yn = y + o.down + ((o.down_part + d * o.down_step) >> 16);
        int there;

        if (xn < 0 || yn < 0 || xn >= width || yn >= height)
            continue;
        there = int(maps[o.first + uint(yn * width + xn)] & 0xFFFF);
        if (there != NONE && abs(there - d) <= AGREE)
            return true;
    }
    return false;
}

void main()
{
    const int x = int(gl_GlobalInvocationID.x), y = int(gl_GlobalInvocationID.y);
    uint status = OCCLUSION;
    int d;

    if (x >= width || y >= height)
        return;
    d = int(maps[own + uint(y * width + x)] & 0xFFFF);
    if (d != NONE && agrees(x, y, d))
        status = CORRECT;
    for (int i = 0; status == OCCLUSION && i < steps; i++)
        status = agrees(x, y, i * PIXEL) ? MISMATCH : OCCLUSION;
    maps[own + uint(y * width + x)] = uint(d) | status << 16;
}
