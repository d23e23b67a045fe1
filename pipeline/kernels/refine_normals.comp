// Normals of pixels that an object and a ground compete for, and of the regions of such labels, whose normals are summed
// up as whole numbers. Buffers and constants: pipeline/gpu/refine.h. Definition: refine_normals_reference(),
// sst_surface_choose(), sst_surface_normal().
#version 450

layout(local_size_x = 32, local_size_y = 8) in;

layout(std430, binding = 0) readonly buffer View { uint view[]; };
layout(std430, binding = 1) readonly buffer Masks { uvec2 masks[]; };
layout(std430, binding = 2) readonly buffer Planes { vec4 planes[]; };
layout(std430, binding = 3) buffer Regions { uint regions[]; }; // [label][SUMS][2]
layout(std430, binding = 4) writeonly buffer Out { vec4 normals[]; };

layout(std430, push_constant) uniform Constants {
    int width, height, radius;
    uint mixed_low, mixed_high, ground_low, ground_high;
    float focal_px, cx, cy, zero_px, score_max;
    int top, rows, first;
};

const uint NONE = 0xFFFF, LABELS = 64, SUMS = 5;
const int PLACES = 9;
const float OUTSIDE = 9.0, OUTSIDE_FLOOR = 0.01, SHORT = 1e-12, ONE = 1048576.0;
const ivec2 places[PLACES] = { { 0, 0 },   { -1, 0 }, { 1, 0 },  { 0, -1 }, { 0, 1 },
                               { -1, -1 }, { 1, -1 }, { -1, 1 }, { 1, 1 } };

shared int found[LABELS * SUMS]; // of the group: below 256 2^20

// sst_surface_root()
float root(float v)
{
    precise float half_of = 0.5 * v;
    precise float r = uintBitsToFloat(0x5F3759DFu - (floatBitsToUint(v) >> 1));

    for (int i = 0; i < 4; i++) {
        precise float p = half_of * r;
        precise float q = p * r;
        precise float rest = 1.5 - q;

        r = r * rest;
    }
    return r;
}

// The plane of a pixel. @param centre  out @return false: none
bool choose(uint q, ivec2 at, out vec4 best, out ivec2 centre)
{
    const float d = float(int(q)) * 0.015625;
    float least = score_max;
    bool any = false;

    best = vec4(0.0);
    centre = ivec2(0);
    for (int i = 0; i < PLACES; i++) {
        const ivec2 to = at + places[i] * radius, away = at - to;
        vec4 p;

        if (to.x < 0 || to.y < 0 || to.x >= width || to.y >= height)
            continue;
        p = planes[(to.y - first) * width + to.x];
        if (p.w < least) {
            precise float off = ((p.z + p.x * float(away.x)) + p.y * float(away.y)) - d;
            precise float square = off * off;
            precise float limit = OUTSIDE * p.w + OUTSIDE_FLOOR;
            precise float score = p.w + (square > limit ? square : 0.0);

            if (score < least) {
                least = score;
                best = p;
                centre = to;
                any = true;
            }
        }
    }
    return any;
}

vec4 normal_of(vec4 p, ivec2 centre)
{
    precise float fa = focal_px * p.x;
    precise float fb = focal_px * p.y;
    precise float dx = float(centre.x) - cx;
    precise float dy = float(centre.y) - cy;
    precise float c = ((zero_px + p.z) - p.x * dx) - p.y * dy;
    precise float square = (fa * fa + fb * fb) + c * c;
    float r;

    if (!(square > SHORT))
        return vec4(0.0);
    r = root(square);
    {
        precise float x = fa * r;
        precise float y = fb * r;
        precise float z = c * r;

        return vec4(x, y, z, 1.0);
    }
}

int whole(float v)
{
    precise float scaled = v * ONE;
    precise float up = scaled + 0.5;

    return int(floor(up));
}

// Of 64 bits.
void add_to_region(uint at, int more)
{
    const uint low = uint(more), before = atomicAdd(regions[2 * at], low);
    const uint high = (more < 0 ? 0xFFFFFFFFu : 0u) + (before + low < before ? 1u : 0u);

    if (high != 0)
        atomicAdd(regions[2 * at + 1], high);
}

void look(ivec2 at)
{
    const int i = (at.y - top) * width + at.x;
    const uint pixel = view[at.y * width + at.x], label = pixel >> 16, q = pixel & 0xFFFF;
    const uvec2 mask = masks[i], ground = uvec2(ground_low, ground_high);
    const bool inside =
        label >= 1 && label <= LABELS && ((label > 32 ? mixed_high >> (label - 33) : mixed_low >> (label - 1)) & 1) != 0;
    vec4 best, n = vec4(0.0);
    ivec2 centre;

    if (!inside && ((mask & ground) == uvec2(0) || (mask & ~ground) == uvec2(0)))
        return;
    if (q != NONE && choose(q, at, best, centre))
        n = normal_of(best, centre);
    normals[i] = n;
    if (!inside)
        return;
    atomicAdd(found[(label - 1) * SUMS + 4], 1);
    if (n.w != 0.0) {
        atomicAdd(found[(label - 1) * SUMS + 0], whole(n.x));
        atomicAdd(found[(label - 1) * SUMS + 1], whole(n.y));
        atomicAdd(found[(label - 1) * SUMS + 2], whole(n.z));
        atomicAdd(found[(label - 1) * SUMS + 3], 1);
    }
}

void main()
{
    const ivec2 at = ivec2(gl_GlobalInvocationID.xy) + ivec2(0, top);

    for (uint i = gl_LocalInvocationIndex; i < LABELS * SUMS; i += 256)
        found[i] = 0;
    barrier();
    if (at.x < width && at.y < top + rows)
        look(at);
    barrier();
    for (uint i = gl_LocalInvocationIndex; i < LABELS * SUMS; i += 256) {
        if (found[i] != 0)
            add_to_region(i, found[i]);
    }
}
