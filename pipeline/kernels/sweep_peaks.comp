// The heaviest levels of a cell of a view, by the points of the cells around it, and whether the view's map has them
// there. A group per cell. Constants: pipeline/method/disparity/device_second.c. Definition: sst_sweep_candidates() of
// pipeline/method/disparity/candidates.c.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0
#version 450

layout(local_size_x = 64) in;

layout(std430, binding = 0) readonly buffer Map { uint map[]; }; // of the view
layout(std430, binding = 1) readonly buffer Weights { uint weights[]; };
// out, uint32_t[rows][cols][GPU_CELL_PEAKS]: disparity, SST_DISP_NONE: no more; ABSENT
layout(std430, binding = 2) writeonly buffer Out { uint result[]; };

layout(std430, push_constant) uniform Constants {
    int width, height;
    int stride, cell, cols, rows, levels, level, apart;
    uint gathered, mapped;
};

const int LANES = 64, AROUND = 2;
const uint NONE = 0xFFFF, ABSENT = 1 << 16, PEAKS = 6;

shared uint weight[256], pixels[256]; // around the cell, by level
shared uint found[64];

// Sparse pixels of the map in the cells first .. last.
void count_map(ivec2 first, ivec2 last)
{
    const int each = cell / stride;
    const ivec2 from = first * each, size = (last - first + 1) * each;

    for (int i = int(gl_LocalInvocationID.x); i < size.x * size.y; i += LANES) {
        const int x = (from.x + i % size.x) * stride + stride / 2, y = (from.y + i / size.x) * stride + stride / 2;
        int l;

        if (x >= width || y >= height)
            continue;
        l = (int(map[y * width + x] & 0xFFFF) + level / 2) / level;
        if (l < levels)
            atomicAdd(pixels[l], 1u);
    }
}

// Neighbouring levels count half.
uvec2 sum_at(int l)
{
    uvec2 sum = 2 * uvec2(weight[l], pixels[l]);

    if (l > 0)
        sum += uvec2(weight[l - 1], pixels[l - 1]);
    if (l + 1 < levels)
        sum += uvec2(weight[l + 1], pixels[l + 1]);
    return sum;
}

uint greatest_of(uint mine)
{
    uint greatest = mine;

    barrier();
    found[gl_LocalInvocationID.x] = mine;
    barrier();
    for (int i = 0; i < LANES; i++)
        greatest = max(greatest, found[i]);
    return greatest;
}

void main()
{
    const int lane = int(gl_LocalInvocationID.x), col = int(gl_WorkGroupID.x), row = int(gl_WorkGroupID.y);
    const ivec2 first = max(ivec2(col, row) - AROUND, ivec2(0)), last = min(ivec2(col, row) + AROUND, ivec2(cols, rows) - 1);
    const uint out_at = uint(row * cols + col) * PEAKS;
    uvec2 sum[4];
    uint i = 0;

    for (int l = lane; l < levels; l += LANES) {
        uint here = 0;

        for (int y = first.y; y <= last.y; y++) {
            for (int x = first.x; x <= last.x; x++)
                here += weights[uint(y * cols + x) * uint(levels) + uint(l)];
        }
        weight[l] = here;
        pixels[l] = 0;
    }
    barrier();
    count_map(first, last);
    barrier();
    for (int k = 0; k < 4; k++)
        sum[k] = lane + k * LANES < levels ? sum_at(lane + k * LANES) : uvec2(0);
    barrier();
    for (int k = 0; k < 4; k++) {
        if (lane + k * LANES < levels) {
            weight[lane + k * LANES] = sum[k].x;
            pixels[lane + k * LANES] = sum[k].y;
        }
    }
    for (; i < PEAKS; i++) {
        uint mine = 0, greatest, best = 0xFFFFFFFF;

        for (int l = lane; l < levels; l += LANES)
            mine = max(mine, weight[l]);
        greatest = greatest_of(mine);
        if (greatest < gathered)
            break;
        for (int l = lane; l < levels; l += LANES)
            best = weight[l] == greatest ? min(best, uint(l)) : best;
        best = ~greatest_of(~best); // the least one
        if (lane == 0)
            result[out_at + i] = best * uint(level) | (pixels[best] <= mapped ? ABSENT : 0);
        for (int l = lane; l < levels; l += LANES)
            weight[l] = abs(l - int(best)) <= apart ? 0 : weight[l];
    }
    if (lane == 0) {
        for (; i < PEAKS; i++)
            result[out_at + i] = NONE;
    }
}
