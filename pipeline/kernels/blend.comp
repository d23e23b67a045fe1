// The rays of views summed into a picture: blend_rays, blend_plain, blend_support and blend_finish of kernels.h for all
// views and rows. Buffers and constants: pipeline/gpu/blend.h. Definition: blend_*_ref.c.
#version 450
#extension GL_GOOGLE_include_directive : require

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

void main()
{
    const int x = int(gl_GlobalInvocationID.x), row = int(gl_GlobalInvocationID.y), y = top + row;
    const uint at = uint(row) * uint(width) + uint(x), plane = uint(rows) * uint(width);
    precise vec3 sum = vec3(0.0);
    precise float weight = 0.0;
    ivec3 whole = ivec3(0);
    bool supported = false;

    if (x >= width || row >= rows)
        return;
    if ((flags & FIRST) == 0) {
        const uvec3 was = uvec3(sums[at], sums[at + plane], sums[at + 2 * plane]);

        whole = ivec3(was);
        sum = uintBitsToFloat(was);
        weight = uintBitsToFloat(sums[at + 3 * plane]);
        supported = (result[at] >> 24) != 0;
    }
    for (uint v = first_view; v < first_view + views; v++) {
        if (x < view[v].x0 || x >= view[v].x1 || y < view[v].y0 || y >= view[v].y1)
            continue;
        const uint from = view[v].first + uint(y + view[v].iy) * uint(pitch) + uint(x + view[v].ix);
        const uint right = (view[v].flags & VIEW_RIGHT) != 0 ? 1 : 0;
        const uint below = (view[v].flags & VIEW_BELOW) != 0 ? uint(pitch) : 0;

        if ((view[v].flags & VIEW_VALID) != 0 && !seen(from, right, below))
            continue;
        const ivec3 c = level(v, from, right, below);

        if ((flags & SUMMED) != 0) {
            whole += c;
            weight += 1.0;
            supported = true;
            continue;
        }
        float w = view[v].aperture;

        if ((flags & WEIGHTED) != 0) {
            const uint nearest = view[v].first + uint(y + view[v].ny) * uint(pitch) + uint(x + view[v].nx);
            const bool labels = (view[v].flags & VIEW_LABELS) != 0;
            const uint d = disparity(nearest), name = labels ? pixel[nearest] >> 24 : 0, ends = label[name].ends;

            w = weigh(w, d, name, labels && (flags & BY_LABEL) != 0);
            supported = supported || (d >= (ends & 0xFFFF) && d <= (ends >> 16));
        } else {
            supported = true;
        }
        sum += w * vec3(c);
        weight += w;
    }
    if ((flags & LAST) == 0) {
        const uvec3 now = (flags & SUMMED) != 0 ? uvec3(whole) : floatBitsToUint(sum);

        for (int i = 0; i < 3; i++)
            sums[at + uint(i) * plane] = now[i];
        sums[at + 3 * plane] = floatBitsToUint(weight);
        result[at] = supported ? 1u << 24 : 0u;
        return;
    }
    if ((flags & SUMMED) != 0)
        sum = vec3(whole);
    precise vec3 mean = sum * (1.0 / LEVEL) / (weight + TINY) + 0.5;
    const uvec3 rgb = min(uvec3(mean), uvec3(255));

    result[at] = rgb.r | rgb.g << 8 | rgb.b << 16 | (supported ? PIXEL_SUPPORTED << 24 : 0) |
                 (weight < FLOOR ? PIXEL_BELOW << 24 : 0);
    if ((flags & WEIGHTS) != 0)
        sums[at + 3 * plane] = floatBitsToUint(weight);
}
