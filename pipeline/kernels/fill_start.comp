// Filling of a view's disparities, the beginning: mismatches get the median of the nearest correct pixels in 16
// directions, occlusions nothing yet. Buffers and constants: pipeline/gpu/check.h. Definition: fill_start_reference().
#version 450

layout(local_size_x = 32, local_size_y = 8) in;

layout(std430, binding = 0) readonly buffer Maps { uint maps[]; };
layout(std430, binding = 1) writeonly buffer Out { uint result[]; };
layout(std430, binding = 2) writeonly buffer Arrived { uint arrived[]; };

layout(std430, push_constant) uniform Constants {
    int width, height;
    uint own;
};

const uint CORRECT = 0, MISMATCH = 1, NONE = 0xFFFF;

// About 22.5 degrees apart, in half pixels.
const ivec2 ways[16] = { { 2, 0 },  { 2, 1 },   { 2, 2 },   { 1, 2 },   { 0, 2 },  { -1, 2 },
                         { -2, 2 }, { -2, 1 },  { -2, 0 },  { -2, -1 }, { -2, -2 }, { -1, -2 },
                         { 0, -2 }, { 1, -2 },  { 2, -2 },  { 2, -1 } };

// Half of a product, rounded towards 0.
int half_of(int n)
{
    return n < 0 ? -(-n / 2) : n / 2;
}

uint nearest(int x, int y, ivec2 way)
{
    for (int r = 1;; r++) {
        const int i = x + half_of(way.x * r), j = y + half_of(way.y * r);
        uint there;

        if (i < 0 || j < 0 || i >= width || j >= height)
            return NONE;
        there = maps[own + uint(j * width + i)];
        if (there >> 16 == CORRECT)
            return there & 0xFFFF;
    }
}

// Median of those that are known; the lower one of an even number.
uint median_around(int x, int y)
{
    uint v[16], found = 0, low = 0;

    for (int k = 0; k < 16; k++) {
        v[k] = nearest(x, y, ways[k]);
        found += v[k] != NONE ? 1 : 0;
    }
    if (found == 0)
        return NONE;
    for (uint bit = 0x8000; bit != 0; bit >>= 1) {
        uint below = 0;

        for (int k = 0; k < 16; k++)
            below += v[k] < (low | bit) ? 1 : 0;
        low |= below <= (found - 1) / 2 ? bit : 0;
    }
    return low;
}

void main()
{
    const int x = int(gl_GlobalInvocationID.x), y = int(gl_GlobalInvocationID.y);
    uint there, status;

    if (x >= width || y >= height)
        return;
    there = maps[own + uint(y * width + x)];
    status = there >> 16;
    result[y * width + x] = status == CORRECT ? there & 0xFFFF : status == MISMATCH ? median_around(x, y) : NONE;
    arrived[y * width + x] = 0;
}
