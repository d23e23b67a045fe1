// Paths of one direction of the optimisation over hypotheses: hypothesis_path_row of kernels.h. Eight invocations follow a
// path together, each with one hypothesis of every pixel; four paths a group. What a pixel needs is read four pixels ahead,
// since memory takes longer than the work between. Buffers and constants: pipeline/gpu/hypotheses.h. Definition:
// hypothesis_path_ref.c.
#version 450
#extension GL_EXT_control_flow_attributes : require

layout(local_size_x = 8, local_size_y = 4) in;

layout(std430, binding = 0) readonly buffer Pixels { uint pixels[]; };
layout(std430, binding = 1) readonly buffer Penalties { uint penalties[256]; };
layout(std430, binding = 2) readonly buffer Hypotheses { uint hypotheses[]; };
layout(std430, binding = 3) readonly buffer Counts { uint counts[]; };
layout(std430, binding = 4) readonly buffer Cost { uint costs[]; };
layout(std430, binding = 5) buffer Sum { uint sum[]; };

layout(std430, push_constant) uniform Constants {
    int width, height;
    uint own;
    int near, dx, dy, first;
};

const uint FAR = 12000, AHEAD = 4; // even: a pixel's place among these tells its half of `path`

// Path costs of this and of the last pixel, their hypotheses in the upper halves; eight of a path.
shared uvec4 path[2][4][2];

// What is read of a pixel.
struct Pixel {
    uint entry, colour, cost, was;
    bool several;
    int d;
};

int step_between(uint a, uint b)
{
    const ivec3 p = ivec3(a & 0xFF, (a >> 8) & 0xFF, (a >> 16) & 0xFF);
    const ivec3 q = ivec3(b & 0xFF, (b >> 8) & 0xFF, (b >> 16) & 0xFF), step = abs(p - q);

    return max(max(step.x, step.y), step.z);
}

uint half_of(uint two, uint i)
{
    return (two >> (16 * (i & 1))) & 0xFFFF;
}

Pixel read(ivec2 at, bool inside)
{
    const uint i = gl_LocalInvocationID.x;
    Pixel p;

    if (!inside)
        return p;
    const uint pixel = uint(at.y * width + at.x);

    p.entry = 8 * pixel + i;
    p.colour = pixels[own + pixel];
    p.cost = half_of(costs[p.entry >> 1], i);
    p.several = ((counts[pixel] >> 8) & 0xFF) > 1;
    p.d = int(half_of(hypotheses[p.entry >> 1], i));
    p.was = first != 0 ? 0 : sum[p.entry];
    return p;
}

// The cheapest way from one of the last pixel's hypotheses to disparity d, above the least of them.
uint way_to(int d, uint before, uint penalty)
{
    const uint which = gl_LocalInvocationID.y, p1 = penalty & 0xFFFF, p2 = penalty >> 16;
    uint least = 0xFFFF, best = 0xFFFF;

    [[unroll]] for (uint j = 0; j < 2; j++) {
        const uvec4 l = path[before][which][j] & 0xFFFF;
        const uvec4 jump = uvec4(abs(ivec4(d) - ivec4(path[before][which][j] >> 16)));
        const uvec4 way = l + mix(mix(uvec4(p2), uvec4(p1), lessThanEqual(jump, uvec4(2 * near))), uvec4(0),
                                  lessThanEqual(jump, uvec4(near)));

        least = min(least, min(min(l.x, l.y), min(l.z, l.w)));
        best = min(best, min(min(way.x, way.y), min(way.z, way.w)));
    }
    return min(best, least + p2) - least;
}

void main()
{
    const uint i = gl_LocalInvocationID.x, which = gl_LocalInvocationID.y;
    const int number = int(gl_GlobalInvocationID.y), paths = dy == 0 ? height : width;
    const int length = dy == 0 ? width : height;
    const bool inside = number < paths;
    ivec2 at = dy == 0 ? ivec2(dx > 0 ? 0 : width - 1, number) : ivec2(number, dy > 0 ? 0 : height - 1);
    Pixel ahead[AHEAD];
    uint last = 0;

    [[unroll]] for (int k = 0; k < AHEAD; k++, at += ivec2(dx, dy))
        ahead[k] = read(at, inside && k < length);
    for (int done = 0; done < length; done += int(AHEAD)) {
        [[unroll]] for (int k = 0; k < AHEAD; k++) {
            const Pixel p = ahead[k];

            if (done + k < length) {
                uint l = p.cost;

                ahead[k] = read(at, inside && done + k + int(AHEAD) < length);
                at += ivec2(dx, dy);
                if (done + k > 0)
                    l = p.several ? p.cost + way_to(p.d, 1 - (k & 1), penalties[step_between(p.colour, last)])
                                  : i > 0 ? FAR : 0;
                path[k & 1][which][i >> 2][i & 3] = l | uint(p.d) << 16;
                if (inside)
                    sum[p.entry] = done + k == 0 || p.several ? p.was + l : p.was;
                last = p.colour;
                barrier();
            }
        }
    }
}
