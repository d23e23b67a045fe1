// A block of a tile's volume, 32 pixels of a row by 8 quads of disparities: for match_cost.comp and feature_cost.comp.
// An invocation has a quad of a pixel. Neighbouring ones compute neighbouring pixels, with reads of the views side by
// side; the volume lies pixel by pixel, so its reads and writes pass through shared memory.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0

struct Tile {
    int x0, y0, width, height, left, top, pitch, rows, first, steps, nd;
    uint quad;
};

struct Step {
    int x, y, layer, near_x, near_y;
};

layout(std430, binding = 0) readonly buffer Tiles { Tile tiles[]; }; // struct sst_gpu_tile[]
layout(std430, binding = 1) readonly buffer Steps { Step steps[]; }; // struct sst_gpu_step[]: all steps of the view

const uint PIXELS = 32, QUADS = 8, PITCH = QUADS + 1; // of shared memory: other banks for other pixels

struct Block {
    bool exists;
    uint pixel, quad; // the first ones, in the row
    uint of_pixel;    // quads
    uint row_at;      // of the row's first quad in the volume
};

Block block_of(const Tile t)
{
    const uint row = gl_WorkGroupID.y, of_pixel = uint(t.nd) >> 2, across = (of_pixel + QUADS - 1) / QUADS;
    Block b;

    b.pixel = gl_WorkGroupID.x / across * PIXELS;
    b.quad = gl_WorkGroupID.x % across * QUADS;
    b.of_pixel = of_pixel;
    b.row_at = t.quad + row * uint(t.pitch) * of_pixel;
    b.exists = row < uint(t.rows) && b.pixel < uint(t.pitch);
    return b;
}

// What this invocation reads and writes in the volume: a quad, and its place in shared memory.
bool moves(const Block b, const Tile t, out uint quad, out uint place)
{
    const uint pixel = gl_LocalInvocationIndex / QUADS, q = gl_LocalInvocationIndex % QUADS;

    quad = b.row_at + (b.pixel + pixel) * b.of_pixel + b.quad + q;
    place = pixel * PITCH + q;
    return b.pixel + pixel < uint(t.pitch) && b.quad + q < b.of_pixel;
}

// What it computes: a pixel of the view, the first of four disparities, and the place in shared memory.
bool computes(const Block b, const Tile t, out ivec2 at, out int d, out uint place)
{
    const uint pixel = gl_LocalInvocationIndex % PIXELS, q = gl_LocalInvocationIndex / PIXELS;

    at = ivec2(t.left + int(b.pixel + pixel), t.top + int(gl_WorkGroupID.y));
    d = int(b.quad + q) * 4;
    place = pixel * PITCH + q;
    return b.pixel + pixel < uint(t.pitch) && b.quad + q < b.of_pixel;
}
