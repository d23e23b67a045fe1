// The rays of views summed into a picture: blend_rays, blend_plain, blend_support and blend_finish of kernels.h for all
// views and rows. An invocation has four pixels of a column, whose rays share the rows between them. Buffers and constants:
// pipeline/gpu/blend.h. Definition: blend_*_ref.c.
#version 450
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require

layout(local_size_x = 32, local_size_y = 4) in;

#include "blend_view.glsl"

layout(std430, binding = 0) readonly buffer Params { Label label[256]; View view[]; };
layout(std430, binding = 1) readonly buffer Pixels { uint pixel[]; };
layout(std430, binding = 2) readonly buffer Disp { uint disp[]; };
layout(std430, binding = 3) readonly buffer Valid { uint valid[]; };
layout(std430, binding = 4) readonly buffer Table { float table[]; };
layout(std430, binding = 5) buffer Sums { uint sums[]; };
layout(std430, binding = 6) buffer Out { uint result[]; };

layout(std430, push_constant) uniform Constants {
    int width, pitch, top, rows;
    uint first_view, views, flags;
    float focus_whole, focus_part, scale, power[5], c1;
    uint first, count;
};

const uint FIRST = 1, LAST = 2, WEIGHTED = 4, SUMMED = 8, BY_LABEL = 16, WEIGHTS = 32;
const uint PIXEL_SUPPORTED = 1, PIXEL_BELOW = 2;
const float TINY = 1e-37, FLOOR = 1e-28;

#include "blend_ray.glsl"
#include "quotient.glsl"

const int ROWS = 4; // of an invocation

// Of each of its pixels. `whole`: sums without weights.
vec3 sum[ROWS];
float weight[ROWS];
ivec3 whole[ROWS];
bool supported[ROWS];

// The same value without a conversion, of which devices do few at once. b: below 2^23
float exact(uint b)
{
    precise float value = uintBitsToFloat(0x4B000000u | b) - 8388608.0;

    return value;
}

vec3 colour_at(uint at)
{
    const uint p = pixel[at];

    return vec3(exact(p & 0xFF), exact((p >> 8) & 0xFF), exact((p >> 16) & 0xFF));
}

void read_sums(uint at, uint plane)
{
    [[unroll]] for (int i = 0; i < ROWS; i++, at += uint(width)) {
        uvec3 was = uvec3(0);

        weight[i] = 0.0;
        supported[i] = false;
        if ((flags & FIRST) == 0 && int(at / uint(width)) < rows) {
            was = uvec3(sums[at], sums[at + plane], sums[at + 2 * plane]);
            weight[i] = uintBitsToFloat(sums[at + 3 * plane]);
            supported[i] = (result[at] >> 24) != 0;
        }
        whole[i] = ivec3(was);
        sum[i] = uintBitsToFloat(was);
    }
}

// Add a ray: colour c in 1/LEVEL, whose numbers are whole.
void add(int i, const View from, int x, int y, vec3 c)
{
    precise float w = from.aperture;

    if ((flags & SUMMED) != 0) {
        whole[i] += ivec3(c);
        weight[i] += 1.0;
        supported[i] = true;
        return;
    }
    if ((flags & WEIGHTED) != 0) {
        const uint nearest = from.first + uint(y + from.ny) * uint(pitch) + uint(x + from.nx);
        const bool labels = (from.flags & VIEW_LABELS) != 0;
        const uint d = disparity(nearest), name = labels ? pixel[nearest] >> 24 : 0, ends = label[name].ends;

        w = weigh(w, d, name, labels && (flags & BY_LABEL) != 0);
        supported[i] = supported[i] || (d >= (ends & 0xFFFF) && d <= (ends >> 16));
    } else {
        supported[i] = true;
    }
    precise vec3 product = w * c;
    precise vec3 colours = sum[i] + product;
    precise float weights = weight[i] + w;

    sum[i] = colours;
    weight[i] = weights;
}

// Add the rays of a view.
void add_view(const View from, int x, int y)
{
    const bool has_right = (from.flags & VIEW_RIGHT) != 0, has_below = (from.flags & VIEW_BELOW) != 0;
    const uint right = has_right ? 1 : 0, below = has_below ? uint(pitch) : 0;
    const uint at = from.first + uint(y + from.iy) * uint(pitch) + uint(x + from.ix);
    const int last = from.y1 + int(has_below); // rows of the view that count

    if (x < from.x0 || x >= from.x1)
        return;
    const vec4 tap = vec4(from.tap[0], from.tap[1], from.tap[2], from.tap[3]);
    vec3 here = vec3(0), beside = vec3(0);

    if (y >= from.y0 && y < last) {
        here = colour_at(at);
        beside = has_right ? colour_at(at + right) : here;
    }
    [[unroll]] for (int i = 0; i < ROWS; i++) {
        const uint next = at + uint(i + 1) * uint(pitch);
        const bool inside = y + i >= from.y0 && y + i < from.y1;
        vec3 under = vec3(0), beside_under = vec3(0);

        if (y + i + 1 >= from.y0 && y + i + 1 < last) {
            under = colour_at(next);
            beside_under = has_right ? colour_at(next + right) : under;
        }
        if (inside && ((from.flags & VIEW_VALID) == 0 || seen(next - uint(pitch), right, below)))
            // Whole numbers below 2^23: no sum is rounded.
            add(i, from, x, y + i, here * tap.x + beside * tap.y + under * tap.z + beside_under * tap.w);
        here = under;
        beside = beside_under;
    }
}

void write(int i, uint at, uint plane)
{
    if ((flags & LAST) == 0) {
        const uvec3 now = (flags & SUMMED) != 0 ? uvec3(whole[i]) : floatBitsToUint(sum[i]);

        for (int k = 0; k < 3; k++)
            sums[at + uint(k) * plane] = now[k];
        sums[at + 3 * plane] = floatBitsToUint(weight[i]);
        result[at] = supported[i] ? 1u << 24 : 0u;
        return;
    }
    if ((flags & SUMMED) != 0)
        sum[i] = vec3(whole[i]);
    precise vec3 scaled = sum[i] * (1.0 / LEVEL);
    precise float total = weight[i] + TINY;
    precise vec3 mean = vec3(quotient(scaled.r, total), quotient(scaled.g, total), quotient(scaled.b, total)) + 0.5;
    const uvec3 rgb = min(uvec3(mean), uvec3(255));

    result[at] = rgb.r | rgb.g << 8 | rgb.b << 16 | (supported[i] ? PIXEL_SUPPORTED << 24 : 0) |
                 (weight[i] < FLOOR ? PIXEL_BELOW << 24 : 0);
    if ((flags & WEIGHTS) != 0)
        sums[at + 3 * plane] = floatBitsToUint(weight[i]);
}

void main()
{
    const int x = int(gl_GlobalInvocationID.x), row = ROWS * int(gl_GlobalInvocationID.y);
    const uint at = uint(row) * uint(width) + uint(x), plane = uint(rows) * uint(width);

    if (x >= width || row >= rows)
        return;
    read_sums(at, plane);
    for (uint v = first_view; v < first_view + views; v++)
        add_view(view[v], x, top + row);
    [[unroll]] for (int i = 0; i < ROWS; i++) {
        if (row + i < rows)
            write(i, at + uint(i) * uint(width), plane);
    }
}
