// The rays of views summed into a picture: blend_rays, blend_plain, blend_support and blend_finish of kernels.h for all
// views and rows. Buffers and constants: pipeline/gpu/blend.h. Definition: blend_*_ref.c.
#version 450

layout(local_size_x = 32, local_size_y = 4) in;

struct Label {
    uint row, ends;
};

struct View {
    int ix, iy, nx, ny;
    int x0, x1, y0, y1;
    int tap[4];
    float aperture;
    uint first, flags, zero;
};

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
const uint VIEW_RIGHT = 1, VIEW_BELOW = 2, VIEW_VALID = 4, VIEW_LABELS = 8;
const uint PIXEL_SUPPORTED = 1, PIXEL_BELOW = 2;
const uint COLUMN_SHIFT = 4, COLUMN_BITS = 12;
const float LEVEL = 16384.0, TINY = 1e-37, FLOOR = 1e-28;

// sst_exp2_neg(). `precise`: no multiplication is fused with a sum, as on the CPU.
float exp2_neg(float u)
{
    const float magic = 12582912.0;
    precise float m = u + magic;
    precise float r = (m - magic) - u;
    precise float p = power[0] + r * (power[1] + r * (power[2] + r * (power[3] + r * power[4])));

    return uintBitsToFloat(floatBitsToUint(p) - (floatBitsToUint(m) << 23));
}

uint disparity(uint at)
{
    return (disp[at >> 1] >> ((at & 1) * 16)) & 0xFFFF;
}

bool is_valid(uint at)
{
    return ((valid[at >> 2] >> ((at & 3) * 8)) & 0xFF) != 0;
}

bool seen(uint at, uint right, uint below)
{
    return is_valid(at) && is_valid(at + right) && is_valid(at + below) && is_valid(at + right + below);
}

ivec3 colour(uint p)
{
    return ivec3(p & 0xFF, (p >> 8) & 0xFF, (p >> 16) & 0xFF);
}

// Colour in 1/LEVEL.
ivec3 level(uint v, uint at, uint right, uint below)
{
    return colour(pixel[at]) * view[v].tap[0] + colour(pixel[at + right]) * view[v].tap[1] +
           colour(pixel[at + below]) * view[v].tap[2] + colour(pixel[at + right + below]) * view[v].tap[3];
}

// A W_s W_d of a ray.
float weigh(float aperture, uint d, uint name, bool labels)
{
    precise float apart = (float(d) - focus_whole) - focus_part;
    precise float near = ((d - first) & 0xFFFF) < count ? exp2_neg(apart * apart * scale) : 0.0;
    precise float w_d = near + c1;
    float w_s = 1.0;

    if (labels)
        w_s = table[(label[name].row << COLUMN_BITS) + (d >> COLUMN_SHIFT)];
    precise float w = aperture * w_s * w_d;
    return w;
}

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
