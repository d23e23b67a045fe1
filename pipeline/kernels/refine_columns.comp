// Vertical distances to the nearest pixel with a label, of the rows of a band. A group has a few columns, an invocation one
// of SLICES slices of one: it looks for the first and the last pixel with the label there; those of the other slices come
// from shared memory. Rows are read BLOCK at a time, so that no load waits for another one. Buffers and constants:
// pipeline/gpu/refine.h. Definition: refine_columns_reference().
#version 450
#extension GL_EXT_control_flow_attributes : require

layout(local_size_x = 8, local_size_y = 32) in;

layout(std430, binding = 0) readonly buffer View { uint view[]; };
layout(std430, binding = 1) writeonly buffer Columns { uint columns[]; };

layout(std430, push_constant) uniform Constants {
    int width, height;
    uint label;
    int top, rows;
};

const int FAR = 1 << 20, COLUMNS = 8, SLICES = 32, BLOCK = 32;
const int ABOVE = -FAR, BELOW = 2 * FAR; // rows of pixels that are not there

shared int first_of[SLICES][COLUMNS], last_of[SLICES][COLUMNS];

// Rows y .. y + BLOCK - 1 in which the column has the label, a bit each.
uint rows_with_label(int x, int y)
{
    uint bits = 0;

    [[unroll]] for (int i = 0; i < BLOCK; i++)
        bits |= view[min(y + i, height - 1) * width + x] >> 16 == label ? 1u << i : 0;
    return y + BLOCK > height ? bits & ((1u << (height - y)) - 1) : bits;
}

// Distances of a block. @param bits  its pixels with the label @param above, below  rows of the nearest ones around it
void write_block(int x, int y, uint bits, int above, int below)
{
    for (int i = max(top - y, 0); i < min(top + rows - y, BLOCK); i++) {
        const uint before = bits & (0xFFFFFFFFu >> (31 - i)), after = bits >> i;
        const int up = before != 0 ? i - findMSB(before) : y + i - above;
        const int down = after != 0 ? findLSB(after) : below - (y + i);

        columns[(y + i - top) * width + x] = uint(min(min(up, down), FAR));
    }
}

void main()
{
    const int x = int(gl_GlobalInvocationID.x), column = int(gl_LocalInvocationID.x), slice = int(gl_LocalInvocationID.y);
    const int size = (height + SLICES * BLOCK - 1) / (SLICES * BLOCK) * BLOCK;
    const int begin = slice * size, end = x < width ? min(begin + size, height) : begin;
    int first = BELOW, last = ABOVE, above = ABOVE, below = BELOW, next;

    for (int y = begin; y < end; y += BLOCK) {
        const uint bits = rows_with_label(x, y);

        first = bits != 0 ? min(first, y + findLSB(bits)) : first;
        last = bits != 0 ? y + findMSB(bits) : last;
    }
    first_of[slice][column] = first;
    last_of[slice][column] = last;
    barrier();
    for (int i = 0; i < SLICES; i++) {
        above = i < slice ? max(above, last_of[i][column]) : above;
        below = i > slice ? min(below, first_of[i][column]) : below;
    }
    next = begin - 1; // the first pixel with the label below the block in work, once that is reached
    for (int y = begin; y < end; y += BLOCK) {
        const uint bits = rows_with_label(x, y);

        for (int ahead = y + BLOCK; next < y + BLOCK; ahead += BLOCK) {
            const uint later = ahead < end ? rows_with_label(x, ahead) : 0;

            next = later != 0 ? ahead + findLSB(later) : ahead < end ? next : below;
        }
        write_block(x, y, bits, above, next);
        above = bits != 0 ? y + findMSB(bits) : above;
    }
}
