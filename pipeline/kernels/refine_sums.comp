// Sums of the known disparities in a window's rows, column by column, for the planes of label refinement. Buffers and
// constants: pipeline/gpu/refine.h. Definition: refine_sums_reference().
#version 450

layout(local_size_x = 32, local_size_y = 8) in;

struct Sums {
    int n, y, yy;
    uint d;
    int yd;
    uint dd_low, dd_high;
};

layout(std430, binding = 0) readonly buffer View { uint view[]; };
layout(std430, binding = 1) writeonly buffer Out { Sums sums[]; };

layout(std430, push_constant) uniform Constants {
    int width, height, radius, top, rows;
};

const uint NONE = 0xFFFF;

void main()
{
    const ivec2 at = ivec2(gl_GlobalInvocationID.xy) + ivec2(0, top);
    Sums s = Sums(0, 0, 0, 0, 0, 0, 0);

    if (at.x >= width || at.y >= top + rows)
        return;
    for (int v = max(-radius, -at.y); v <= min(radius, height - 1 - at.y); v++) {
        const uint q = view[(at.y + v) * width + at.x] & 0xFFFF;
        uint carry;

        if (q == NONE)
            continue;
        s.n++;
        s.y += v;
        s.yy += v * v;
        s.d += q;
        s.yd += v * int(q);
        s.dd_low = uaddCarry(s.dd_low, q * q, carry);
        s.dd_high += carry;
    }
    sums[(at.y - top) * width + at.x] = s;
}
