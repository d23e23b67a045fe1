// Paths of the semi-global optimisation: sgm_along_rows and sgm_across_row of kernels.h. A group follows
// one path, pixel by pixel, from tile to tile; each invocation has four disparities of every 128. Constants:
// pipeline/gpu/match.h. Definition: sgm_ref.c.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0
#version 450
#extension GL_GOOGLE_include_directive : require

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

const uint FAR = 0x7FFF, STEPS = 576;

// L of this and of the last pixel, by step above the smallest of all tiles; their minima, and that of the next pixel.
shared uint path[2][STEPS];
shared uint least[3];

// Largest difference of a colour channel.
uint step_between(uint a, uint b)
{
    const ivec3 p = ivec3(a & 0xFF, (a >> 8) & 0xFF, (a >> 16) & 0xFF);
    const ivec3 q = ivec3(b & 0xFF, (b >> 8) & 0xFF, (b >> 16) & 0xFF), step = abs(p - q);

    return uint(max(max(step.x, step.y), step.z));
}

// L of the last pixel at a step that both its window and this pixel's have; else it is far.
uint before_at(uint before, int step, ivec2 window)
{
    return step >= window.x && step < window.y ? path[before][step] : FAR;
}

// Disparities d .. d + 3 of a pixel. `window`: steps that the last pixel and this one have; `begins`: the path does.
// Returns the least L.
uint follow(uint quad, int step, uint now, ivec2 window, uint before_least, uint p1, uint p2, bool begins)
{
    const uint c = cost[quad];
    uvec4 l;

    for (int i = 0; i < 4; i++) {
        uint best = 0;

        if (!begins) {
            const uint near = min(before_at(1 - now, step + i - 1, window), before_at(1 - now, step + i + 1, window));

            best = min(min(before_at(1 - now, step + i, window), near + p1), before_least + p2) - before_least;
        }
        l[i] = ((c >> (8 * i)) & 0xFF) + best;
        path[now][step + i] = l[i];
    }
    for (uint i = 0; i < 2; i++) {
        const uint two = l[2 * i] | l[2 * i + 1] << 16;

        // Other directions may add at the same time; no sum reaches 2^16.
        if (first != 0)
            sum[2 * quad + i] = two;
        else
            atomicAdd(sum[2 * quad + i], two);
    }
    return min(min(l.x, l.y), min(l.z, l.w));
}

void main()
{
    const uint lane = gl_LocalInvocationID.x;
    const int number = int(gl_WorkGroupID.x);

    set_way(way + int(gl_WorkGroupID.y));
    ivec2 at = begin(number), window = ivec2(0, 0);
    const ivec2 from = at - ivec2(dx, dy);
    // Paths that go on from the rows before these ones.
    const bool goes_on = load >= 0 && dy != 0 && number < width && from.x >= 0 && from.x < width;
    const uint entry = goes_on ? uint(load + from.x) * (all + 3) : 0;
    int index = -1;
    uint last = 0, i = 0;
    Tile t;

    if (!exists(number))
        return;
    if (lane < 3)
        least[lane] = lane == 2 && goes_on ? state[entry + all + 2] : FAR;
    if (goes_on) {
        window = ivec2(state[entry + all], state[entry + all + 1]);
        last = pixels[from.y * width + from.x];
        for (uint d = uint(window.x) + lane; d < uint(window.y); d += 32)
            path[1][d] = state[entry + d];
    }
    barrier();
    for (; at.x >= 0 && at.y >= top && at.x < width && at.y < bottom; i++) {
        const int tile = (at.y - top) / tile_height * columns + at.x / tile_width;
        const uint pixel = pixels[at.y * width + at.x], before_least = least[(i + 2) % 3];
        const bool begins = i == 0 && !goes_on;
        uint mine = FAR, p, quad;

        if (tile != index)
            t = tiles[tile];
        index = tile;
        p = penalties[begins ? 0 : step_between(pixel, last)];
        quad = t.quad + uint((at.y - t.top) * t.pitch + at.x - t.left) * (uint(t.nd) >> 2);
        window = ivec2(max(window.x, t.first), min(window.y, t.first + t.nd));
        for (int d = int(lane) * 4; d < t.nd; d += 128)
            mine = min(mine, follow(quad + uint(d >> 2), t.first + d, i & 1, window, before_least, p & 0xFFFF, p >> 16,
                                    begins));
        atomicMin(least[i % 3], mine);
        if (lane == 0)
            least[(i + 1) % 3] = FAR;
        barrier();
        window = ivec2(t.first, t.first + t.nd);
        last = pixel;
        at += ivec2(dx, dy);
    }
    at -= ivec2(dx, dy);
    if (store >= 0 && dy != 0 && at.y == (dy > 0 ? bottom - 1 : top)) {
        const uint to = uint(store + at.x) * (all + 3);

        for (uint d = uint(window.x) + lane; d < uint(window.y); d += 32)
            state[to + d] = path[(i + 1) & 1][d];
        if (lane < 3)
            state[to + all + lane] = lane < 2 ? uint(window[lane]) : least[(i + 2) % 3];
    }
}
