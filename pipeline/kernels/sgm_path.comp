// Paths of one direction of the semi-global optimisation: sgm_along_rows and sgm_across_row of kernels.h. A group follows
// one path, pixel by pixel, from tile to tile; each invocation has four disparities of every 128, in registers. What a pixel
// needs is read four pixels ahead, since memory takes longer than the work between. Buffers and constants:
// pipeline/gpu/match.h. Definition: sgm_ref.c.
#version 450
#extension GL_EXT_control_flow_attributes : require

layout(local_size_x = 32) in;

struct Tile {
    int x0, y0, width, height, left, top, pitch, rows, first, steps, nd;
    uint quad;
};

layout(std430, binding = 0) readonly buffer Tiles { Tile tiles[]; };
layout(std430, binding = 1) readonly buffer Pixels { uint pixels[]; };
layout(std430, binding = 2) readonly buffer Penalties { uint penalties[256]; };
layout(std430, binding = 3) readonly buffer Cost { uint cost[]; };
layout(std430, binding = 4) buffer Sum { uvec2 sum[]; };
layout(std430, binding = 5) buffer State { uint state[]; };

layout(std430, push_constant) uniform Constants {
    int width, top, bottom; // rows of the view that have costs: top .. bottom - 1
    int tile_width, tile_height, columns;
    int dx, dy, first;
    int load, store; // entries of the first column, -1: none
    uint all;        // steps: an entry has L by step, the window of steps, the minimum
};

const uint FAR = 0x7FFF, STEPS = 576, LANES = 32, ROUNDS = 5, QUADS = ROUNDS * LANES;
const uint AHEAD = 4; // even: a pixel's place among these tells its half of the arrays below

// L at the first and at the last disparity of each quad, of this and of the last pixel: highest[i + 1] is that of quad i.
// Around them and beyond the tile's disparities it is far.
shared uint lowest[2][QUADS + 1], highest[2][QUADS + 1];
shared uvec4 least[2][LANES / 4]; // by invocation
shared uint by_step[STEPS];       // L of the last pixel by step, where tiles change
shared uint table[256];

// What is read of a pixel.
struct Pixel {
    bool inside;
    int tile, first, nd;
    uint colour, quad; // of this invocation
    uint cost[ROUNDS];
    uvec2 sum[ROUNDS];
};

// Of the last pixel: its L, the steps of its tile.
uvec4 path[ROUNDS];
ivec2 window = ivec2(0);

Tile ahead_tile;
int ahead_index = -1;

// Where the path begins: on the sides that it comes from.
ivec2 begin(int p)
{
    const int left = dx > 0 ? 0 : width - 1, row = dy > 0 ? top : bottom - 1;

    if (dy == 0)
        return ivec2(left, top + p);
    return p < width ? ivec2(p, row) : ivec2(left, row + dy * (p - width + 1));
}

Pixel read(ivec2 at)
{
    const uint lane = gl_LocalInvocationID.x;
    Pixel p;

    p.inside = at.x >= 0 && at.y >= top && at.x < width && at.y < bottom;
    if (!p.inside)
        return p;
    if (ahead_index < 0 || at.x < ahead_tile.x0 || at.x >= ahead_tile.x0 + ahead_tile.width || at.y < ahead_tile.y0 ||
        at.y >= ahead_tile.y0 + ahead_tile.height) {
        ahead_index = (at.y - top) / tile_height * columns + at.x / tile_width;
        ahead_tile = tiles[ahead_index];
    }
    p.tile = ahead_index;
    p.first = ahead_tile.first;
    p.nd = ahead_tile.nd;
    p.colour = pixels[at.y * width + at.x];
    p.quad = ahead_tile.quad + lane +
             uint((at.y - ahead_tile.top) * ahead_tile.pitch + at.x - ahead_tile.left) * (uint(p.nd) >> 2);
    [[unroll]] for (uint r = 0; r < ROUNDS; r++) {
        if (4 * (r * LANES + lane) < uint(p.nd)) {
            p.cost[r] = cost[p.quad + r * LANES];
            p.sum[r] = first != 0 ? uvec2(0) : sum[p.quad + r * LANES];
        }
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

uint least_of(uint before)
{
    uvec4 m = least[before][0];

    [[unroll]] for (uint i = 1; i < LANES / 4; i++)
        m = min(m, least[before][i]);
    return min(min(m.x, m.y), min(m.z, m.w));
}

// The last pixel's L as one of the tile that begins here. `has`: its L is in `path`; else in by_step. `none`: the path
// begins, and nothing is before it.
void change_tile(const Pixel p, uint before, bool has, bool none)
{
    const uint lane = gl_LocalInvocationID.x;

    [[unroll]] for (uint r = 0; r < ROUNDS; r++) {
        const int d = 4 * int(r * LANES + lane);

        [[unroll]] for (int i = 0; i < 4; i++) {
            if (has && window.x + d + i < window.y)
                by_step[window.x + d + i] = path[r][i];
        }
    }
    barrier();
    [[unroll]] for (uint r = 0; r < ROUNDS; r++) {
        const uint quad = r * LANES + lane;
        const int d = 4 * int(quad);

        [[unroll]] for (int i = 0; i < 4; i++) {
            const int step = p.first + d + i;

            path[r][i] = d >= p.nd ? FAR : none ? 0 : step >= window.x && step < window.y ? by_step[step] : FAR;
        }
        lowest[before][quad] = path[r].x;
        highest[before][quad + 1] = path[r].w;
        lowest[1 - before][quad] = highest[1 - before][quad + 1] = FAR;
    }
    barrier();
}

// From the last pixel's L to that of this one.
void follow(const Pixel p, uint now, uint last)
{
    const uint lane = gl_LocalInvocationID.x, before = 1 - now;
    const uint penalty = table[step_between(p.colour, last)], p1 = penalty & 0xFFFF, p2 = penalty >> 16;
    const uint before_least = least_of(before), jump = before_least + p2;
    uint mine = FAR;

    [[unroll]] for (uint r = 0; r < ROUNDS; r++) {
        const uint quad = r * LANES + lane;
        const uvec4 l = path[r];

        if (4 * r * LANES >= uint(p.nd))
            break;
        if (4 * quad < uint(p.nd)) {
            const uvec4 near = min(uvec4(highest[before][quad], l.xyz), uvec4(l.yzw, lowest[before][quad + 1])) + p1;
            const uint c = p.cost[r];
            const uvec4 own = uvec4(c & 0xFF, (c >> 8) & 0xFF, (c >> 16) & 0xFF, c >> 24);
            const uvec4 to = own + min(min(l, near), uvec4(jump)) - before_least;
            const uvec2 was = p.sum[r];

            path[r] = to;
            mine = min(mine, min(min(to.x, to.y), min(to.z, to.w)));
            lowest[now][quad] = to.x;
            highest[now][quad + 1] = to.w;
            sum[p.quad + r * LANES] = uvec2(((was.x + to.x) & 0xFFFF) | (((was.x >> 16) + to.y) & 0xFFFF) << 16,
                                            ((was.y + to.z) & 0xFFFF) | (((was.y >> 16) + to.w) & 0xFFFF) << 16);
        }
    }
    least[now][lane >> 2][lane & 3] = mine;
    barrier();
}

void main()
{
    const uint lane = gl_LocalInvocationID.x;
    const int number = int(gl_WorkGroupID.x);
    const ivec2 step = ivec2(dx, dy), start = begin(number), from = start - step;
    // Paths that go on from the rows before these ones.
    const bool goes_on = load >= 0 && dy != 0 && number < width && from.x >= 0 && from.x < width;
    const uint entry = goes_on ? uint(load + from.x) * (all + 3) : 0;
    Pixel ahead[AHEAD];
    ivec2 at = start;
    int index = -1;
    uint last = 0, done = 0;
    bool more = true;

    for (uint i = lane; i < 256; i += LANES)
        table[i] = penalties[i];
    if (lane < 2)
        highest[lane][0] = lowest[lane][QUADS] = FAR;
    least[1][lane >> 2][lane & 3] = goes_on ? state[entry + all + 2] : 0;
    if (goes_on) {
        window = ivec2(state[entry + all], state[entry + all + 1]);
        last = pixels[from.y * width + from.x];
        for (uint d = uint(window.x) + lane; d < uint(window.y); d += LANES)
            by_step[d] = state[entry + d];
    }
    [[unroll]] for (uint k = 0; k < AHEAD; k++, at += step)
        ahead[k] = read(at);
    while (more) {
        [[unroll]] for (uint k = 0; k < AHEAD; k++) {
            const Pixel p = ahead[k];

            more = more && p.inside;
            if (more) {
                ahead[k] = read(at);
                at += step;
                if (p.tile != index)
                    change_tile(p, 1 - (k & 1), index >= 0, index < 0 && !goes_on);
                index = p.tile;
                window = ivec2(p.first, p.first + p.nd);
                follow(p, k & 1, last);
                last = p.colour;
                done++;
            }
        }
    }
    at = start + step * (int(done) - 1);
    if (store >= 0 && dy != 0 && at.y == (dy > 0 ? bottom - 1 : top)) {
        const uint to = uint(store + at.x) * (all + 3);

        [[unroll]] for (uint r = 0; r < ROUNDS; r++) {
            const int d = 4 * int(r * LANES + lane);

            [[unroll]] for (int i = 0; i < 4; i++) {
                if (window.x + d + i < window.y)
                    state[to + uint(window.x + d + i)] = path[r][i];
            }
        }
        if (lane < 3)
            state[to + all + lane] = lane < 2 ? uint(window[lane]) : least_of((done - 1) & 1);
    }
}
