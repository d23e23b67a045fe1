// sgm_path.comp for devices with subgroups of a group's 32 invocations: neighbouring disparities and the minimum come
// from the other invocations' registers, without a barrier. In a tile four pixels are followed at a time, while the
// next four are read. Tiles have at most 256 disparities.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0
#version 450
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_arithmetic : require
#extension GL_KHR_shader_subgroup_shuffle : require
#extension GL_KHR_shader_subgroup_shuffle_relative : require

layout(local_size_x = 32) in;

struct Tile {
    int x0, y0, width, height, left, top, pitch, rows, first, steps, nd;
    uint quad;
};

layout(std430, binding = 0) readonly buffer Tiles { Tile tiles[]; };
layout(std430, binding = 1) readonly buffer Pixels { uint pixels[]; };
layout(std430, binding = 2) readonly buffer Penalties { uint penalties[256]; };
layout(std430, binding = 3) readonly buffer Cost { uint cost[]; };
layout(std430, binding = 4) buffer Sum { uint sum[]; };
layout(std430, binding = 5) buffer State { uint state[]; };

layout(std430, push_constant) uniform Constants {
    int width, top, bottom; // rows of the view that have costs: top .. bottom - 1
    int tile_width, tile_height, columns;
    int way, ways, first;
    int load, store; // entries of the first column, -1: none
    uint all;        // steps: an entry has L by step, the window of steps, the minimum
};

#include "sgm_ways.glsl"

const uint FAR = 0x7FFF, STEPS = 576, LANES = 32, ROUNDS = 2, CHUNK = 4;

shared uint by_step[STEPS]; // L of the last pixel by step, where tiles change
shared uint table[256];

// What is read of a pixel.
struct Pixel {
    uint colour, cost[ROUNDS];
};

// Of the last pixel: its L, far beyond the tile's disparities; the least L; its colour.
uvec4 path[ROUNDS];
uint least = 0, last = 0;
// Of the tile: steps; its disparities; those of this invocation that it has.
int steps_first = 0, nd = 0;
ivec2 window = ivec2(0); // steps that by_step has
bool has[ROUNDS];
// Of the first pixel of a run through the tile: its quad and itself, and from pixel to pixel.
uint quad, pixel, next_quad, next_pixel;

Pixel read(uint i)
{
    Pixel p;

    p.colour = pixels[pixel + i * next_pixel];
    [[unroll]] for (uint r = 0; r < ROUNDS; r++)
        p.cost[r] = cost[quad + i * next_quad + min(gl_SubgroupInvocationID + r * LANES, (uint(nd) >> 2) - 1)];
    return p;
}

// Largest difference of a colour channel.
uint step_between(uint a, uint b)
{
    const ivec3 p = ivec3(a & 0xFF, (a >> 8) & 0xFF, (a >> 16) & 0xFF);
    const ivec3 q = ivec3(b & 0xFF, (b >> 8) & 0xFF, (b >> 16) & 0xFF), step = abs(p - q);

    return uint(max(max(step.x, step.y), step.z));
}

// Put the last pixel's L where the next tile finds it.
void leave_tile()
{
    [[unroll]] for (uint r = 0; r < ROUNDS; r++) {
        const int d = 4 * int(r * LANES + gl_SubgroupInvocationID);

        [[unroll]] for (int i = 0; i < 4; i++) {
            if (d + i < nd)
                by_step[steps_first + d + i] = path[r][i];
        }
    }
    window = ivec2(steps_first, steps_first + nd);
    barrier();
}

// The last pixel's L as one of the tile that begins. `begins`: the path does, and nothing is before it.
void enter_tile(const Tile t, bool begins)
{
    steps_first = t.first;
    nd = t.nd;
    [[unroll]] for (uint r = 0; r < ROUNDS; r++) {
        const int d = 4 * int(r * LANES + gl_SubgroupInvocationID);

        has[r] = d < nd;
        [[unroll]] for (int i = 0; i < 4; i++) {
            const int step = steps_first + d + i;

            path[r][i] = d >= nd ? FAR : begins ? 0 : step >= window.x && step < window.y ? by_step[step] : FAR;
        }
    }
    barrier();
}

// From the last pixel's L to that of this one. at: its quad
void follow(const Pixel p, uint at)
{
    const uint lane = gl_SubgroupInvocationID, penalty = table[step_between(p.colour, last)];
    const uint p1 = penalty & 0xFFFF, jump = least + (penalty >> 16);
    uint mine = FAR, highest = FAR; // the latter of the last round

    [[unroll]] for (uint r = 0; r < ROUNDS; r++) {
        if (r == 0 || nd > 4 * int(r * LANES)) {
            const uvec4 l = path[r];
            const uint under = subgroupShuffleUp(l.w, 1), over = subgroupShuffleDown(l.x, 1);
            const uint lowest = r + 1 < ROUNDS ? subgroupShuffle(path[min(r + 1, ROUNDS - 1)].x, 0) : FAR;
            const uvec4 near =
                min(uvec4(lane == 0 ? highest : under, l.xyz), uvec4(l.yzw, lane == LANES - 1 ? lowest : over)) + p1;
            const uint c = p.cost[r];
            const uvec4 own = uvec4(c & 0xFF, (c >> 8) & 0xFF, (c >> 16) & 0xFF, c >> 24);
            const uvec4 to = has[r] ? own + min(min(l, near), uvec4(jump)) - least : uvec4(FAR);
            const uvec2 two = uvec2(to.x | to.y << 16, to.z | to.w << 16);
            const uint word = 2 * (at + lane + r * LANES);

            highest = subgroupShuffle(l.w, LANES - 1);
            path[r] = to;
            mine = min(mine, min(min(to.x, to.y), min(to.z, to.w)));
            // Other directions may add at the same time; no sum reaches 2^16.
            if (has[r] && first != 0) {
                sum[word] = two.x;
                sum[word + 1] = two.y;
            } else if (has[r]) {
                atomicAdd(sum[word], two.x);
                atomicAdd(sum[word + 1], two.y);
            }
        }
    }
    least = subgroupMin(mine);
    last = p.colour;
}

// Follow n pixels of a tile.
void follow_run(uint n)
{
    Pixel next[CHUNK];
    uint i = 0;

    [[unroll]] for (uint k = 0; k < CHUNK; k++)
        next[k] = read(min(k, n - 1));
    for (; i + CHUNK <= n; i += CHUNK) {
        const Pixel now[CHUNK] = next;

        [[unroll]] for (uint k = 0; k < CHUNK; k++)
            next[k] = read(min(i + CHUNK + k, n - 1));
        [[unroll]] for (uint k = 0; k < CHUNK; k++)
            follow(now[k], quad + (i + k) * next_quad);
    }
    [[unroll]] for (uint k = 0; k + 1 < CHUNK; k++) {
        if (i + k < n)
            follow(next[k], quad + (i + k) * next_quad);
    }
}

// Pixels from one of the tile on that the path has in it.
uint run_of(const Tile t, ivec2 at)
{
    const int across = dx > 0 ? t.x0 + t.width - at.x : dx < 0 ? at.x - t.x0 + 1 : width;
    const int down = dy > 0 ? t.y0 + t.height - at.y : dy < 0 ? at.y - t.y0 + 1 : bottom - top;

    return uint(min(across, down));
}

void main()
{
    const uint lane = gl_SubgroupInvocationID;
    const int number = int(gl_WorkGroupID.x);

    set_way(way + int(gl_WorkGroupID.y));
    const ivec2 step = ivec2(dx, dy), from = begin(number) - step;
    // Paths that go on from the rows before these ones.
    const bool goes_on = load >= 0 && dy != 0 && number < width && from.x >= 0 && from.x < width;
    ivec2 at = from + step;
    bool begins = !goes_on;

    if (!exists(number))
        return;
    for (uint i = lane; i < 256; i += LANES)
        table[i] = penalties[i];
    if (goes_on) {
        const uint entry = uint(load + from.x) * (all + 3);

        least = state[entry + all + 2];
        window = ivec2(state[entry + all], state[entry + all + 1]);
        last = pixels[from.y * width + from.x];
        for (uint d = uint(window.x) + lane; d < uint(window.y); d += LANES)
            by_step[d] = state[entry + d];
    }
    barrier();
    while (at.x >= 0 && at.y >= top && at.x < width && at.y < bottom) {
        const Tile t = tiles[(at.y - top) / tile_height * columns + at.x / tile_width];
        const uint n = run_of(t, at), of_pixel = uint(t.nd) >> 2;

        quad = t.quad + uint((at.y - t.top) * t.pitch + at.x - t.left) * of_pixel;
        pixel = uint(at.y * width + at.x);
        next_quad = uint(dy * t.pitch + dx) * of_pixel;
        next_pixel = uint(dy * width + dx);
        enter_tile(t, begins);
        begins = false;
        follow_run(n);
        leave_tile();
        at += int(n) * step;
    }
    at -= step;
    if (store >= 0 && dy != 0 && at.y == (dy > 0 ? bottom - 1 : top)) {
        const uint to = uint(store + at.x) * (all + 3);

        for (uint d = uint(window.x) + lane; d < uint(window.y); d += LANES)
            state[to + d] = by_step[d];
        if (lane < 3)
            state[to + all + lane] = lane < 2 ? uint(window[lane]) : least;
    }
}
