// sgm_path.comp for devices whose subgroups have a group's 32 invocations: neighbouring disparities and the minimum come from
// the other invocations' registers, without a barrier. What four pixels need is read while the four before them are
// followed. Tiles have at most 256 disparities.
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

// What is read of a pixel. tile: -1 outside
struct Pixel {
    int tile;
    uint colour, quad; // of this invocation
    uint cost[ROUNDS];
};

// Of the last pixel: its L, far beyond the tile's disparities; its tile's disparities; the least L; its colour.
uvec4 path[ROUNDS];
int index = -1, steps_first = 0, nd = 0;
uint least = 0, last = 0;
ivec2 window = ivec2(0); // steps that by_step has where the path goes on from the rows before

Tile ahead_tile;
int ahead_index = -1;

Pixel read(ivec2 at)
{
    const uint lane = gl_SubgroupInvocationID;
    Pixel p;

    p.tile = -1;
    if (at.x < 0 || at.y < top || at.x >= width || at.y >= bottom)
        return p;
    if (ahead_index < 0 || at.x < ahead_tile.x0 || at.x >= ahead_tile.x0 + ahead_tile.width || at.y < ahead_tile.y0 ||
        at.y >= ahead_tile.y0 + ahead_tile.height) {
        ahead_index = (at.y - top) / tile_height * columns + at.x / tile_width;
        ahead_tile = tiles[ahead_index];
    }
    p.tile = ahead_index;
    p.colour = pixels[at.y * width + at.x];
    p.quad = ahead_tile.quad + lane +
             uint((at.y - ahead_tile.top) * ahead_tile.pitch + at.x - ahead_tile.left) * (uint(ahead_tile.nd) >> 2);
    [[unroll]] for (uint r = 0; r < ROUNDS; r++) {
        if (4 * (r * LANES + lane) < uint(ahead_tile.nd))
            p.cost[r] = cost[p.quad + r * LANES];
    }
    return p;
}

// Largest difference of a colour channel.
uint step_between(uint a, uint b)
{
    const ivec3 p = ivec3(a & 0xFF, (a >> 8) & 0xFF, (a >> 16) & 0xFF);
    const ivec3 q = ivec3(b & 0xFF, (b >> 8) & 0xFF, (b >> 16) & 0xFF), step = abs(p - q);

    return uint(max(max(step.x, step.y), step.z));
}

// The last pixel's L as one of the tile that begins. `begins`: the path does, and nothing is before it.
void change_tile(int tile, bool begins)
{
    const uint lane = gl_SubgroupInvocationID;
    const bool has = index >= 0;

    [[unroll]] for (uint r = 0; r < ROUNDS; r++) {
        const int d = 4 * int(r * LANES + lane);

        [[unroll]] for (int i = 0; i < 4; i++) {
            if (has && d + i < nd)
                by_step[steps_first + d + i] = path[r][i];
        }
    }
    if (has)
        window = ivec2(steps_first, steps_first + nd);
    steps_first = tiles[tile].first;
    nd = tiles[tile].nd;
    index = tile;
    barrier();
    [[unroll]] for (uint r = 0; r < ROUNDS; r++) {
        const int d = 4 * int(r * LANES + lane);

        [[unroll]] for (int i = 0; i < 4; i++) {
            const int step = steps_first + d + i;

            path[r][i] = d >= nd ? FAR : begins ? 0 : step >= window.x && step < window.y ? by_step[step] : FAR;
        }
    }
    barrier();
}

// From the last pixel's L to that of this one.
void follow(const Pixel p)
{
    const uint lane = gl_SubgroupInvocationID;
    const uint penalty = table[step_between(p.colour, last)], p1 = penalty & 0xFFFF, jump = least + (penalty >> 16);
    uint mine = FAR, highest = FAR; // the latter of the last round

    [[unroll]] for (uint r = 0; r < ROUNDS; r++) {
        const uvec4 l = path[r];
        const uint under = subgroupShuffleUp(l.w, 1), over = subgroupShuffleDown(l.x, 1);
        const uint lowest = r + 1 < ROUNDS ? subgroupShuffle(path[min(r + 1, ROUNDS - 1)].x, 0) : FAR;
        const uvec4 near =
            min(uvec4(lane == 0 ? highest : under, l.xyz), uvec4(l.yzw, lane == LANES - 1 ? lowest : over)) + p1;

        highest = subgroupShuffle(l.w, LANES - 1);
        if (4 * int(r * LANES + lane) < nd) {
            const uint c = p.cost[r], at = 2 * (p.quad + r * LANES);
            const uvec4 own = uvec4(c & 0xFF, (c >> 8) & 0xFF, (c >> 16) & 0xFF, c >> 24);
            const uvec4 to = own + min(min(l, near), uvec4(jump)) - least;
            const uvec2 two = uvec2(to.x | to.y << 16, to.z | to.w << 16);

            path[r] = to;
            mine = min(mine, min(min(to.x, to.y), min(to.z, to.w)));
            // Other directions may add at the same time; no sum reaches 2^16.
            if (first != 0) {
                sum[at] = two.x;
                sum[at + 1] = two.y;
            } else {
                atomicAdd(sum[at], two.x);
                atomicAdd(sum[at + 1], two.y);
            }
        }
    }
    least = subgroupMin(mine);
    last = p.colour;
}

void main()
{
    const uint lane = gl_SubgroupInvocationID;
    const int number = int(gl_WorkGroupID.x);

    set_way(way + int(gl_WorkGroupID.y));
    const ivec2 step = ivec2(dx, dy), start = begin(number), from = start - step;
    // Paths that go on from the rows before these ones.
    const bool goes_on = load >= 0 && dy != 0 && number < width && from.x >= 0 && from.x < width;
    Pixel now[CHUNK], next[CHUNK];
    ivec2 at = start;
    int done = 0;

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
    [[unroll]] for (uint k = 0; k < CHUNK; k++, at += step)
        next[k] = read(at);
    do {
        [[unroll]] for (uint k = 0; k < CHUNK; k++)
            now[k] = next[k];
        [[unroll]] for (uint k = 0; k < CHUNK; k++, at += step)
            next[k] = read(at);
        [[unroll]] for (uint k = 0; k < CHUNK; k++) {
            if (now[k].tile >= 0) {
                if (now[k].tile != index)
                    change_tile(now[k].tile, index < 0 && !goes_on);
                follow(now[k]);
                done++;
            }
        }
    } while (next[0].tile >= 0);
    at = start + step * (done - 1);
    if (store >= 0 && dy != 0 && at.y == (dy > 0 ? bottom - 1 : top)) {
        const uint to = uint(store + at.x) * (all + 3);

        [[unroll]] for (uint r = 0; r < ROUNDS; r++) {
            const int d = 4 * int(r * LANES + lane);

            [[unroll]] for (int i = 0; i < 4; i++) {
                if (d + i < nd)
                    state[to + uint(steps_first + d + i)] = path[r][i];
            }
        }
        if (lane < 3)
            state[to + all + lane] = lane == 0 ? uint(steps_first) : lane == 1 ? uint(steps_first + nd) : least;
    }
}
