// sgm_path.comp for devices whose subgroups have a group's 32 invocations: a group follows four paths, eight invocations each,
// which take neighbouring disparities and minima from each other's registers, without a barrier. What two pixels need is
// read while the two before them are followed. Tiles have at most 256 disparities.
#version 450
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_arithmetic : require
#extension GL_KHR_shader_subgroup_shuffle : require
#extension GL_KHR_shader_subgroup_clustered : require
#extension GL_KHR_shader_subgroup_vote : require

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

const uint FAR = 0x7FFF, STEPS = 576, LANES = 8, PATHS = 4, QUADS = 8, CHUNK = 2;

shared uint by_step[PATHS][STEPS]; // L of the last pixels by step, where tiles change
shared uint table[256];

// What is read of a pixel. tile: -1 outside
struct Pixel {
    int tile;
    uint colour, quad; // of this invocation
    uint cost[QUADS];  // of every eighth quad from there on
};

uint sub = gl_SubgroupInvocationID % LANES, mine = gl_SubgroupInvocationID / LANES;

// Of the last pixel of the path: its L, far beyond the tile's disparities; its tile, whose disparities; the least L; its
// colour.
uvec4 path[QUADS];
int index = -1, steps_first = 0, nd = 0;
uint least = 0, last = 0;
uint most = 0;           // disparities of the tiles of all paths
ivec2 window = ivec2(0); // steps that by_step has

Tile ahead_tile;
int ahead_index = -1;

Pixel read(ivec2 at)
{
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
    p.quad = ahead_tile.quad + sub +
             uint((at.y - ahead_tile.top) * ahead_tile.pitch + at.x - ahead_tile.left) * (uint(ahead_tile.nd) >> 2);
    [[unroll]] for (uint i = 0; i < QUADS; i++) {
        if (4 * (i * LANES + sub) < uint(ahead_tile.nd))
            p.cost[i] = cost[p.quad + i * LANES];
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

// The last pixels' L as those of the tiles that begin; all paths at once. `begins`: this path does, and nothing is before it.
void change_tiles(int tile, bool begins)
{
    [[unroll]] for (uint i = 0; i < QUADS; i++) {
        const int d = 4 * int(i * LANES + sub);

        [[unroll]] for (int k = 0; k < 4; k++) {
            if (index >= 0 && d + k < nd)
                by_step[mine][steps_first + d + k] = path[i][k];
        }
    }
    if (index >= 0)
        window = ivec2(steps_first, steps_first + nd);
    if (tile >= 0) {
        steps_first = tiles[tile].first;
        nd = tiles[tile].nd;
        index = tile;
    }
    most = subgroupMax(uint(nd));
    barrier();
    [[unroll]] for (uint i = 0; i < QUADS; i++) {
        const int d = 4 * int(i * LANES + sub);

        [[unroll]] for (int k = 0; k < 4; k++) {
            const int step = steps_first + d + k;

            path[i][k] = d >= nd ? FAR : begins ? 0 : step >= window.x && step < window.y ? by_step[mine][step] : FAR;
        }
    }
    barrier();
}

// From the last pixel's L to that of this one, where there is one.
void follow(const Pixel p)
{
    const uint first_lane = mine * LANES, before = first_lane + (sub + LANES - 1) % LANES;
    const uint after = first_lane + (sub + 1) % LANES;
    const uint penalty = table[step_between(p.colour, last)], p1 = penalty & 0xFFFF, jump = least + (penalty >> 16);
    uint smallest = FAR, wrapped = FAR, ahead = subgroupShuffle(path[0].x, after);

    [[unroll]] for (uint i = 0; i < QUADS; i++) {
        if (4 * i * LANES < most) {
            const uvec4 l = path[i];
            const uint under = subgroupShuffle(l.w, before), over = ahead;

            // Of the next eight quads, for the last invocation.
            ahead = i + 1 < QUADS ? subgroupShuffle(path[min(i + 1, QUADS - 1)].x, after) : FAR;
            if (p.tile >= 0 && 4 * int(i * LANES + sub) < nd) {
                const uvec4 near = min(uvec4(sub == 0 ? wrapped : under, l.xyz),
                                       uvec4(l.yzw, sub == LANES - 1 ? ahead : over)) + p1;
                const uint c = p.cost[i], at = 2 * (p.quad + i * LANES);
                const uvec4 own = uvec4(c & 0xFF, (c >> 8) & 0xFF, (c >> 16) & 0xFF, c >> 24);
                const uvec4 to = own + min(min(l, near), uvec4(jump)) - least;
                const uvec2 two = uvec2(to.x | to.y << 16, to.z | to.w << 16);

                path[i] = to;
                smallest = min(smallest, min(min(to.x, to.y), min(to.z, to.w)));
                // Other directions may add at the same time; no sum reaches 2^16.
                if (first != 0) {
                    sum[at] = two.x;
                    sum[at + 1] = two.y;
                } else {
                    atomicAdd(sum[at], two.x);
                    atomicAdd(sum[at + 1], two.y);
                }
            }
            wrapped = under;
        }
    }
    smallest = subgroupClusteredMin(smallest, LANES);
    if (p.tile >= 0) {
        least = smallest;
        last = p.colour;
    }
}

void main()
{
    const int number = int(gl_WorkGroupID.x * PATHS + mine);

    set_way(way + int(gl_WorkGroupID.y));
    const ivec2 step = ivec2(dx, dy), start = begin(number), from = start - step;
    // Paths that go on from the rows before these ones.
    const bool there = exists(number), goes_on = there && load >= 0 && dy != 0 && number < width && from.x >= 0 && from.x < width;
    Pixel now[CHUNK], next[CHUNK];
    ivec2 at = there ? start : ivec2(-1);
    const ivec2 each = there ? step : ivec2(0);
    int done = 0;

    for (uint i = gl_SubgroupInvocationID; i < 256; i += 32)
        table[i] = penalties[i];
    if (goes_on) {
        const uint entry = uint(load + from.x) * (all + 3);

        least = state[entry + all + 2];
        window = ivec2(state[entry + all], state[entry + all + 1]);
        last = pixels[from.y * width + from.x];
        for (uint d = uint(window.x) + sub; d < uint(window.y); d += LANES)
            by_step[mine][d] = state[entry + d];
    }
    barrier();
    [[unroll]] for (uint k = 0; k < CHUNK; k++, at += each)
        next[k] = read(at);
    do {
        [[unroll]] for (uint k = 0; k < CHUNK; k++)
            now[k] = next[k];
        [[unroll]] for (uint k = 0; k < CHUNK; k++, at += each)
            next[k] = read(at);
        [[unroll]] for (uint k = 0; k < CHUNK; k++) {
            if (subgroupAny(now[k].tile >= 0 && now[k].tile != index))
                change_tiles(now[k].tile, index < 0 && !goes_on);
            follow(now[k]);
            done += now[k].tile >= 0 ? 1 : 0;
        }
    } while (subgroupAny(next[0].tile >= 0));
    at = start + step * (done - 1);
    if (there && store >= 0 && dy != 0 && at.y == (dy > 0 ? bottom - 1 : top)) {
        const uint to = uint(store + at.x) * (all + 3);

        [[unroll]] for (uint i = 0; i < QUADS; i++) {
            const int d = 4 * int(i * LANES + sub);

            [[unroll]] for (int k = 0; k < 4; k++) {
                if (d + k < nd)
                    state[to + uint(steps_first + d + k)] = path[i][k];
            }
        }
        if (sub < 3)
            state[to + all + sub] = sub == 0 ? uint(steps_first) : sub == 1 ? uint(steps_first + nd) : least;
    }
}
