// Least squares planes of windows of disparities: exact sums of 64 bits, then floats in operations that are rounded
// alike everywhere. Columns around a group go through shared memory, as many at a time as it has. Buffers and constants:
// pipeline/gpu/refine.h. Definition: refine_planes_reference(), sst_surface_fit().
#version 450
#extension GL_EXT_control_flow_attributes : require

layout(local_size_x = 32, local_size_y = 8) in;

layout(std430, binding = 0) readonly buffer In { uint sums[]; }; // [rows][width][WORDS]
layout(std430, binding = 1) writeonly buffer Out { vec4 planes[]; }; // a, b, d0, variance

layout(std430, push_constant) uniform Constants {
    int width, height, radius, top, rows;
};

const int WIDTH = 32, ROWS = 8, COLUMNS = 64; // of a group; that it has at a time
const int WORDS = 7, N = 0, Y = 1, YY = 2, D = 3, YD = 4, DD = 5; // of a column: struct sst_gpu_refine_sums

shared uint column[ROWS][COLUMNS * WORDS];

const float COLLINEAR = 1e-3, NO_PLANE = 1e30;

// Whole numbers of 64 bits, the lower half first.
uvec2 add(uvec2 a, uvec2 b)
{
    uint carry;
    const uint low = uaddCarry(a.x, b.x, carry);

    return uvec2(low, a.y + b.y + carry);
}

uvec2 subtract(uvec2 a, uvec2 b)
{
    uint borrow;
    const uint low = usubBorrow(a.x, b.x, borrow);

    return uvec2(low, a.y - b.y - borrow);
}

uvec2 product(int a, int b)
{
    int high, low;

    imulExtended(a, b, high, low);
    return uvec2(uint(low), uint(high));
}

uvec2 wide(int v)
{
    return uvec2(uint(v), v < 0 ? 0xFFFFFFFFu : 0u);
}

uvec2 times(uvec2 a, uint n)
{
    uint high, low;

    umulExtended(a.x, n, high, low);
    return uvec2(low, high + a.y * n);
}

// The nearest float, to even in the middle: the upper 24 bits, and what is below them.
float to_float(uvec2 v)
{
    const bool negative = (v.y & 0x80000000u) != 0;
    const uvec2 m = negative ? subtract(uvec2(0), v) : v;
    const int shift = (m.y != 0 ? 32 + findMSB(m.y) : findMSB(m.x)) - 23;
    uint upper = m.x, middle, below;
    float f;

    if (shift > 0) {
        if (shift < 32) {
            upper = m.x >> shift | (m.y << (31 - shift)) << 1;
            middle = m.x >> (shift - 1) & 1;
            below = m.x & ((1u << (shift - 1)) - 1);
        } else {
            upper = m.y >> (shift - 32);
            middle = shift == 32 ? m.x >> 31 : m.y >> (shift - 33) & 1;
            below = shift == 32 ? m.x & 0x7FFFFFFFu : m.x | (m.y & ((1u << (shift - 33)) - 1));
        }
        upper += middle != 0 && (below != 0 || (upper & 1) != 0) ? 1 : 0;
    }
    f = float(int(upper)) * uintBitsToFloat(uint(127 + max(shift, 0)) << 23);
    return negative ? -f : f;
}

// sst_surface_reciprocal()
float reciprocal(float v)
{
    precise float r = uintBitsToFloat(0x7EF311C7u - floatBitsToUint(v));

    for (int i = 0; i < 4; i++) {
        precise float p = v * r;
        precise float rest = 2.0 - p;

        r = r * rest;
    }
    return r;
}

struct Window {
    int n, x, y, xx, xy, yy;
    uint d;
    uvec2 xd, yd, dd;
};

// n S_uv - S_u S_v
float centred(int n, uvec2 uv, int u, int v)
{
    return to_float(subtract(times(uv, uint(n)), product(u, v)));
}

vec4 fit(Window s)
{
    const float xx = centred(s.n, wide(s.xx), s.x, s.x), yy = centred(s.n, wide(s.yy), s.y, s.y);
    const float xy = centred(s.n, wide(s.xy), s.x, s.y);
    const float xd = centred(s.n, s.xd, s.x, int(s.d)), yd = centred(s.n, s.yd, s.y, int(s.d));
    const float dd = centred(s.n, s.dd, int(s.d), int(s.d));
    precise float area = xx * yy;
    precise float det = area - xy * xy;
    precise float least = COLLINEAR * area;
    float scale, each, across, down;

    if (s.n < 3 || !(det > least))
        return vec4(0.0, 0.0, 0.0, NO_PLANE);
    scale = reciprocal(det);
    each = reciprocal(float(s.n));
    across = to_float(wide(-s.x));
    down = to_float(wide(-s.y));
    {
        precise float a = (xd * yy - yd * xy) * scale;
        precise float b = (yd * xx - xd * xy) * scale;
        precise float to_x = across * each;
        precise float to_y = down * each;
        precise float d0 = (to_float(uvec2(s.d, 0)) * each + a * to_x) + b * to_y;
        precise float rest = (dd - a * xd) - b * yd;
        precise float share = each * each;
        precise float variance = (rest > 0.0 ? rest : 0.0) * share;

        return vec4(a * 0.015625, b * 0.015625, d0 * 0.015625, variance * 0.000244140625);
    }
}

// Columns from x on; beyond the band there are none.
void read_columns(int x)
{
    const ivec2 lane = ivec2(gl_LocalInvocationID.xy);
    const int y = int(gl_WorkGroupID.y) * ROWS + lane.y, first = (y * width + x) * WORDS;

    barrier();
    [[unroll]] for (int k = 0; k < COLUMNS / WIDTH * WORDS; k++) {
        const int i = k * WIDTH + lane.x, at = x + i / WORDS;

        column[lane.y][i] = y < rows && at >= 0 && at < width ? sums[first + i] : 0;
    }
    barrier();
}

// A column u to the right of the pixel.
void add_column(inout Window s, int u, int row, int at)
{
    const int n = int(column[row][at + N]), y = int(column[row][at + Y]), d = int(column[row][at + D]);

    s.n += n;
    s.x += u * n;
    s.y += y;
    s.xx += u * u * n;
    s.xy += u * y;
    s.yy += int(column[row][at + YY]);
    s.d += uint(d);
    s.xd = add(s.xd, wide(u * d)); // 63 * 127 * 65534 at most
    s.yd = add(s.yd, wide(int(column[row][at + YD])));
    s.dd = add(s.dd, uvec2(column[row][at + DD], column[row][at + DD + 1]));
}

void main()
{
    const ivec2 at = ivec2(gl_GlobalInvocationID.xy), lane = ivec2(gl_LocalInvocationID.xy);
    const int first = int(gl_WorkGroupID.x) * WIDTH - radius;
    Window s = Window(0, 0, 0, 0, 0, 0, 0, uvec2(0), uvec2(0), uvec2(0));

    for (int x = 0; x < WIDTH + 2 * radius; x += COLUMNS) {
        read_columns(first + x);
        for (int i = max(lane.x - x, 0); i < min(lane.x - x + 2 * radius + 1, COLUMNS); i++)
            add_column(s, x + i - lane.x - radius, lane.y, i * WORDS);
    }
    if (at.x < width && at.y < rows)
        planes[at.y * width + at.x] = fit(s);
}
