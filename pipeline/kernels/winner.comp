// Winner of each pixel's summed costs, and the smallest sum away from it: winner_row of kernels.h. Buffers and constants:
// pipeline/gpu/gpu_internal.h. Definition: winner_ref.c.
#version 450

layout(local_size_x = 64) in;

layout(std430, binding = 0) readonly buffer Sum { uint sum[]; };
layout(std430, binding = 1) writeonly buffer Out { uint result[]; };

layout(std430, push_constant) uniform Constants {
    int width, height, pitch, nd, count;
};

uint value(uint at)
{
    return (sum[at >> 1] >> ((at & 1) * 16)) & 0xFFFF;
}

void main()
{
    const uint x = gl_GlobalInvocationID.x, y = gl_GlobalInvocationID.y, cell = (y * uint(pitch) + x) * uint(nd);
    uint best = 0, least = 0xFFFF, second = 0xFFFF;

    if (x >= uint(width) || y >= uint(height))
        return;
    least = value(cell);
    for (uint d = 1; d < uint(count); d++) {
        const uint v = value(cell + d);

        best = v < least ? d : best;
        least = min(least, v);
    }
    for (uint d = 0; d < uint(count); d++) {
        if (d + 1 < best || d > best + 1)
            second = min(second, value(cell + d));
    }
    result[y * uint(width) + x] = best | second << 16;
}
