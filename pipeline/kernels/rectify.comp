// The pixels of a view from its raw frame: place_row, resample_row and light_row of kernels.h. Buffers and constants:
// pipeline/gpu/rectify.h. Definition: rectify_reference().
#version 450

layout(local_size_x = 16, local_size_y = 8) in;

struct Places {
    int whole[2];
    float c[8];
    int most[2];
};

layout(std430, binding = 0) readonly buffer Weights { int weight[]; };
layout(std430, binding = 1) readonly buffer Frame { uint frame[]; };
layout(std430, binding = 2) readonly buffer Cells { Places places[]; };
layout(std430, binding = 3) readonly buffer List { int list[]; };
layout(std430, binding = 4) readonly buffer Light { float light[]; };
layout(std430, binding = 5) readonly buffer Labels { uint labels[]; };
layout(std430, binding = 6) buffer Valid { uint valid[]; };
layout(std430, binding = 7) buffer Pixels { uint pixel[]; };

layout(std430, push_constant) uniform Constants {
    int width, height, pitch, raw_width, raw_height, taps, cell_shift, cells;
    uint first, flags;
    int light_shift, light_cols, light_rows;
    float part_x, part_y, gain[3], gain_root[3];
    int top;
};

const uint LIT = 1, LABELLED = 2, KEEP = 4;
const int LISTED = -1, OUTSIDE = int(0x80000000);
const int LIGHT_WHITE = 255 << 7;
const float KNEE = 10.31475, OFFSET = 14.025, CLIPPED = 4.0;

float cubic(float k, float c0, float c1, float c2, float c3)
{
    precise float v = c0 + k * (c1 + k * (c2 + k * c3));
    return v;
}

// Position in the frame, 1/256 px; OUTSIDE: none.
ivec2 place(int x, int y)
{
    const int cell = min(x >> cell_shift, cells - 1), at = y * cells + cell, column = x - (cell << cell_shift);
    const Places p = places[at];
    precise float k = part_x + float(column);
    ivec2 to;

    if (p.most[0] < 0) {
        to = ivec2(OUTSIDE);
        if (p.most[0] == LISTED)
            to = ivec2(list[2 * (p.whole[0] + column)], list[2 * (p.whole[0] + column) + 1]);
        return to;
    }
    to.x = p.whole[0] + int(roundEven(cubic(k, p.c[0], p.c[1], p.c[2], p.c[3])));
    to.y = p.whole[1] + int(roundEven(cubic(k, p.c[4], p.c[5], p.c[6], p.c[7])));
    return to.x < 0 || to.x > p.most[0] || to.y < 0 || to.y > p.most[1] ? ivec2(OUTSIDE) : to;
}

ivec3 colour(uint p)
{
    return ivec3(p & 0xFF, (p >> 8) & 0xFF, (p >> 16) & 0xFF);
}

// Samples in 1/128 levels; pixels beyond the border are those at it.
ivec3 sample_at(ivec2 at)
{
    const int wx = (at.x & 255) * taps, wy = (at.y & 255) * taps;
    const int left = (at.x >> 8) + 1 - taps / 2, top = (at.y >> 8) + 1 - taps / 2;
    ivec3 sum = ivec3(0);

    for (int tx = 0; tx < taps; tx++) {
        const int x = clamp(left + tx, 0, raw_width - 1);
        ivec3 column = ivec3(0);

        for (int ty = 0; ty < taps; ty++)
            column += weight[wy + ty] * colour(frame[clamp(top + ty, 0, raw_height - 1) * raw_width + x]);
        sum += weight[wx + tx] * ((column + 128) >> 8);
    }
    return clamp((sum + 4096) >> 13, ivec3(0), ivec3(LIGHT_WHITE));
}

// The fall-off's factor at a pixel, or its root: bilinear between nodes.
float factor(int from, int x, int y)
{
    const float scale = uintBitsToFloat(uint(127 - light_shift) << 23); // 2^-light_shift
    const int row = min(y >> light_shift, light_rows - 2), col = min(x >> light_shift, light_cols - 2);
    const int at = from + row * light_cols + col;
    precise float down = (float(y - (row << light_shift)) + part_y) * scale;
    precise float left = light[at] + down * (light[at + light_cols] - light[at]);
    precise float right = light[at + 1] + down * (light[at + light_cols + 1] - light[at + 1]);
    precise float slope = (right - left) * scale;
    precise float v = left + slope * (part_x + float(x - (col << light_shift)));
    return v;
}

// light_row of one sample.
uint lit(int value, float f, float r)
{
    precise float v = float(value) * (1.0 / 128.0);
    precise float s = f * light[value];
    precise float p = r * light[LIGHT_WHITE + 1 + value] - OFFSET;
    precise float keep = 255.0 - CLIPPED * (255.0 - v);
    const float code = s < KNEE ? s : p, kept = code > keep ? code : keep;
    precise float most = (kept < 255.0 ? kept : 255.0) + 0.5;
    return uint(most);
}

uint finish(ivec3 value, int x, int y)
{
    if ((flags & LIT) == 0) {
        value = (value + 64) >> 7;
        return uint(value.r | value.g << 8 | value.b << 16);
    }
    const int grid = 2 * (LIGHT_WHITE + 1);
    const float f = factor(grid, x, y), r = factor(grid + light_cols * light_rows, x, y);
    uint rgb = 0;

    for (int c = 0; c < 3; c++) {
        precise float of = gain[c] * f;
        precise float root = gain_root[c] * r;

        rgb |= lit(value[c], of, root) << (8 * c);
    }
    return rgb;
}

void main()
{
    const int x = 4 * int(gl_GlobalInvocationID.x), y = top + int(gl_GlobalInvocationID.y);
    const uint row = uint(y) * uint(pitch), at = first + row + uint(x);
    uint seen = 0, label = 0;

    if (x >= width || y >= height)
        return;
    if ((flags & LABELLED) != 0)
        label = labels[(row + uint(x)) >> 2];
    for (int i = 0; i < 4 && x + i < width; i++) {
        const ivec2 to = place(x + i, y);
        uint rgb = 0, name = ((label >> (8 * i)) & 0xFF) << 24;

        if ((flags & KEEP) != 0)
            name = pixel[at + uint(i)] & 0xFF000000u;
        if (to.x != OUTSIDE) {
            rgb = finish(sample_at(to), x + i, y);
            seen |= 0xFFu << (8 * i);
        }
        pixel[at + uint(i)] = rgb | name;
    }
    valid[at >> 2] = seen;
}
