// The hypotheses of each pixel: its own disparity, the surfaces around it, surfaces that other views project onto
// it and surfaces that the sweep finds. Windows of surface_rows are completed along columns. Constants:
// pipeline/method/disparity/device_second.c. Definition: sst_around_list() of pipeline/method/disparity/around.c.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0
#version 450
#extension GL_EXT_control_flow_attributes : require

layout(local_size_x = 32, local_size_y = 8) in;

layout(std430, binding = 0) readonly buffer Map { uint map[]; }; // of the view
layout(std430, binding = 1) readonly buffer Pixels { uint pixels[]; }; // of the view, with depth codes: device_second.c
layout(std430, binding = 2) readonly buffer Rows { uint rows[]; };
layout(std430, binding = 3) readonly buffer Projected { uint projected[]; };
layout(std430, binding = 4) readonly buffer Peaks { uint peaks[]; }; // of `sweep_peaks`
// out, uint16_t[pixels][SST_HYPOTHESES]: unused ones repeat the last, or are 0
layout(std430, binding = 5) writeonly buffer Hypotheses { uvec4 hypotheses[]; };
layout(std430, binding = 6) writeonly buffer Counts { uint counts[]; }; // out, uint32_t[pixels]: how many

layout(std430, push_constant) uniform Constants {
    int width, height;
    int apart, cell, cols;
};

const uint NONE = 0xFFFF, OUTSIDE = 255, AGREED = 1 << 24, ABSENT = 1 << 16;
const uint PEAKS = 6;
const int radii[3] = { 2, 6, 16 };

// No index of these is a variable once loops are unrolled: they stay in registers.
uint farthest[3], nearest[3], flat_bits;
uint list[8], number;

// Beyond the picture its last row counts, which is nearer than that.
void find_windows(int x, int y)
{
    const uint n = uint(width * height);

    flat_bits = 7;
    for (int w = 0; w < 3; w++) {
        farthest[w] = NONE;
        nearest[w] = 0;
    }
    [[unroll]] for (int j = -radii[2]; j <= radii[2]; j++) {
        const uint at = uint(clamp(y + j, 0, height - 1) * width + x);
        uint within = 0;

        [[unroll]] for (int w = 0; w < 3; w++) {
            if (abs(j) <= radii[w]) {
                const uint row = rows[uint(w) * n + at];

                farthest[w] = min(farthest[w], row & 0xFFFF);
                nearest[w] = max(nearest[w], row >> 16);
                within |= 1u << w;
            }
        }
        flat_bits &= rows[3 * n + at] | ~within;
    }
}

// Numbers of 16 bits wrap around.
bool is_in_list(uint d)
{
    bool found = false;

    [[unroll]] for (uint i = 0; i < 8; i++)
        found = found || (i < number && (((list[i] - d) & 0xFFFF) < uint(apart) || ((d - list[i]) & 0xFFFF) < uint(apart)));
    return found;
}

void add(uint d)
{
    if (d == NONE || number == 8 || is_in_list(d))
        return;
    [[unroll]] for (uint i = 0; i < 8; i++)
        list[i] = i >= number ? d : list[i];
    number++;
}

void add_extremes(int w)
{
    if ((flat_bits >> w & 1) != 0)
        return;
    add(farthest[w]);
    add(farthest[w] == NONE ? NONE : nearest[w]);
}

// Inside a surface without steps, only what the map does not have.
void add_peaks(uint first)
{
    for (uint i = 0; i < PEAKS; i++) {
        const uint peak = peaks[first + i];

        if ((peak & 0xFFFF) == NONE)
            return;
        if ((flat_bits & 4) == 0 || (peak & ABSENT) != 0)
            add(peak & 0xFFFF);
    }
}

bool is_near(uint a, uint b)
{
    return abs(int(a) - int(b)) < apart;
}

// Has a pixel inside a surface no other hypothesis than its own disparity?
bool is_alone(uint d, uint far, uint near, uint first)
{
    bool alone = d != NONE && (flat_bits & 4) != 0 && (far == NONE || is_near(far, d)) && (near == 0 || is_near(near, d));

    for (uint i = 0; i < PEAKS; i++) {
        const uint peak = peaks[first + i];

        alone = alone && ((peak & 0xFFFF) == NONE || (peak & ABSENT) == 0);
    }
    return alone;
}

void main()
{
    const int x = int(gl_GlobalInvocationID.x), y = int(gl_GlobalInvocationID.y);
    const uint at = uint(y * width + x), first = uint(y / cell * cols + x / cell) * PEAKS;
    uint there, d, far, near;

    if (x >= width || y >= height)
        return;
    there = map[at];
    d = there & 0xFFFF;
    far = projected[at];
    near = projected[uint(width * height) + at];
    find_windows(x, y);
    number = 0;
    [[unroll]] for (uint i = 0; i < 8; i++)
        list[i] = 0;
    if (pixels[at] >> 24 != OUTSIDE) {
        const bool alone = is_alone(d, far, near, first);

        add(d);
        if (!alone && !(number > 0 && (there & AGREED) != 0)) {
            add_extremes(0);
            add(far);
            add(near == 0 ? NONE : near);
            add_peaks(first);
            add_extremes(1);
            add_extremes(2);
        }
    }
    counts[at] = number;
    hypotheses[at] = uvec4(list[0] | list[1] << 16, list[2] | list[3] << 16, list[4] | list[5] << 16, list[6] | list[7] << 16);
}
