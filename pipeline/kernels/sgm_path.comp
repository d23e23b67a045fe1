// Paths of one direction of the semi-global optimisation: sgm_along_rows and sgm_across_row of kernels.h. A group follows
// one path, pixel by pixel; each invocation has four disparities of every 256. Buffers and constants: pipeline/gpu/gpu_internal.h.
// Definition: sgm_ref.c.
#version 450

layout(local_size_x = 64) in;

layout(std430, binding = 0) readonly buffer Cost { uint cost[]; };
layout(std430, binding = 1) readonly buffer Penalty { uint penalty[]; };
layout(std430, binding = 2) readonly buffer Penalties { uint penalties[256]; };
layout(std430, binding = 3) buffer Sum { uint sum[]; };

layout(std430, push_constant) uniform Constants {
    int width, height, pitch, nd, dx, dy, first;
};

const uint FAR = 0x7FFF, STEPS = 1024;

// L of this and of the last pixel from index 1 on; their minima, and that of the next pixel.
shared uint path[2][STEPS + 2];
shared uint least[3];

// Where the path begins: on the sides that it comes from.
ivec2 begin(int p)
{
    const int left = dx > 0 ? 0 : width - 1, top = dy > 0 ? 0 : height - 1;

    if (dy == 0)
        return ivec2(left, p);
    return p < width ? ivec2(p, top) : ivec2(left, top + dy * (p - width + 1));
}

// Disparities d .. d + 3 of a pixel. Returns the least L.
uint step(uint cell, int d, uint now, uint before, uint before_least, uint p1, uint p2)
{
    const uint c = cost[(cell + uint(d)) >> 2];
    uvec4 l;

    for (int i = 0; i < 4; i++) {
        const uint at = uint(d + i) + 1;
        const uint near = min(path[before][at - 1], path[before][at + 1]) + p1;
        const uint best = min(min(path[before][at], near), before_least + p2);

        l[i] = ((c >> (8 * i)) & 0xFF) + best - before_least;
        path[now][at] = l[i];
    }
    for (uint i = 0; i < 2; i++) {
        const uint at = ((cell + uint(d)) >> 1) + i, was = first != 0 ? 0 : sum[at];

        sum[at] = ((was + l[2 * i]) & 0xFFFF) | ((((was >> 16) + l[2 * i + 1]) & 0xFFFF) << 16);
    }
    return min(min(l.x, l.y), min(l.z, l.w));
}

void main()
{
    const uint lane = gl_LocalInvocationID.x;
    ivec2 at = begin(int(gl_WorkGroupID.x));

    // Outside the picture L is 0; outside the disparities it is far.
    for (uint d = lane; d < STEPS + 2; d += 64)
        path[0][d] = path[1][d] = d >= 1 && d <= uint(nd) ? 0 : FAR;
    if (lane < 3)
        least[lane] = lane == 2 ? 0 : FAR;
    barrier();
    for (uint i = 0; at.x >= 0 && at.y >= 0 && at.x < width && at.y < height; i++) {
        const uint pixel = uint(at.y) * uint(width) + uint(at.x);
        const uint p = penalties[(penalty[pixel >> 2] >> ((pixel & 3) * 8)) & 0xFF];
        const uint cell = (uint(at.y) * uint(pitch) + uint(at.x)) * uint(nd);
        const uint before_least = least[(i + 2) % 3];
        uint mine = FAR;

        for (int d = int(lane) * 4; d < nd; d += 256)
            mine = min(mine, step(cell, d, i & 1, 1 - (i & 1), before_least, p & 0xFFFF, p >> 16));
        atomicMin(least[i % 3], mine);
        if (lane == 0)
            least[(i + 1) % 3] = FAR;
        barrier();
        at += ivec2(dx, dy);
    }
}
