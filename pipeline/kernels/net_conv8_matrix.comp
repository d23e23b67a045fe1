// net_conv8.comp by products of matrices of bytes, ROWS x DEPTH times DEPTH x COLUMNS, which a subgroup computes
// together. A group has 128 pixels by 64 channels; each subgroup has 2 x 4 matrices of sums, and the group has as many
// invocations as that takes. Words of the next slab are read while this one is multiplied. Of bytes u from 0 to 255, u
// - 128 is multiplied, as in net_conv8_dot.comp.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0
#version 450
#pragma use_vulkan_memory_model
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
#extension GL_EXT_spirv_intrinsics : require
#extension GL_EXT_shader_explicit_arithmetic_types_int8 : require
#extension GL_KHR_memory_scope_semantics : require
#extension GL_KHR_shader_subgroup_basic : require

// Set when the device is known (pipeline/gpu/vulkan_matrix.c).
layout(local_size_x_id = 0) in;
layout(constant_id = 1) const uint ROWS = 16;
layout(constant_id = 2) const uint COLUMNS = 16;
layout(constant_id = 3) const uint DEPTH = 32;

#include "net_conv8.glsl"

layout(std430, binding = 1) readonly buffer FromFours { uvec4 from_four_words[]; };

const uint TILE = 128, CHANNELS = 64, SLAB = 4; // pixels, channels, and words of a pixel in fours
const uint TILE_OUT = 32, PADDED = 8;           // to which weights are padded
const uint PITCH = SLAB + 1;                    // of a row in shared memory, in fours: other banks for other rows
const uint RESULTS = TILE * CHANNELS / 8;       // one matrix of each subgroup
const uint INPUTS = 8, WEIGHTS = 4;             // fours of a slab that an invocation reads at most: with 64 of them

// SPV_KHR_cooperative_matrix. In types a constant with a name becomes its id. A component is given by its bits, rows and
// columns by their constant_id: gpu_matrix_complete() turns these into ids. What they name must be in use before the first
// matrix is, and a matrix in the declaration of a function would stand in front of all.
const uint SUBGROUP = 3, WORKGROUP = 2;
const uint USE_A = 0, USE_B = 1, USE_SUM = 2;
const int ROW_MAJOR = 0, COLUMN_MAJOR = 1;
const int SHARED_READ = 0x30, SHARED_WRITE = 0x28; // others' values: MakePointerVisible, MakePointerAvailable, NonPrivatePointer
const int SIGNED = 0xF;                            // all four matrices

#define COOPERATIVE extensions = ["SPV_KHR_cooperative_matrix"], capabilities = [6022]
#define MatrixA spirv_type(COOPERATIVE, id = 4456, 8, SUBGROUP, 1, 3, USE_A)
#define MatrixB spirv_type(COOPERATIVE, id = 4456, 8, SUBGROUP, 3, 2, USE_B)
#define MatrixSum spirv_type(COOPERATIVE, id = 4456, 32, SUBGROUP, 1, 2, USE_SUM)

spirv_instruction(COOPERATIVE, id = 4457)
MatrixA load_a(spirv_by_reference uvec4 from, int layout_of, uint pitch, spirv_literal int access, uint scope);
spirv_instruction(COOPERATIVE, id = 4457)
MatrixB load_b(spirv_by_reference uvec4 from, int layout_of, uint pitch, spirv_literal int access, uint scope);
spirv_instruction(COOPERATIVE, id = 4458)
void store_sum(spirv_by_reference int to, MatrixSum sum, int layout_of, uint pitch, spirv_literal int access, uint scope);
spirv_instruction(COOPERATIVE, id = 4459)
MatrixSum multiply(MatrixA a, MatrixB b, MatrixSum sum, spirv_literal int operands);
spirv_instruction(id = 80) MatrixSum filled(int value); // OpCompositeConstruct

shared uvec4 inputs[TILE * PITCH];     // [pixel][four words]
shared uvec4 weights[CHANNELS * PITCH]; // [channel][four words]
shared int results[RESULTS];
shared int weight_sum[CHANNELS];

// What this invocation reads of a slab: pixels lane / SLAB + i * lanes / SLAB, the four words lane % SLAB of each; fours of
// weights lane / CHANNELS + i * lanes / CHANNELS of channel lane % CHANNELS.
uvec4 next_input[INPUTS], next_weight[WEIGHTS];
ivec2 base[INPUTS]; // of its pixels, under the kernel's first tap
ivec2 tap = ivec2(0);
uint word = 0;      // its first one of the tap's pixel
int own = 0;        // sum of the weights that it has read

bool is_inside(ivec2 at, ivec2 t)
{
    return t.x < pair(kernel).x && at.x >= 0 && at.y >= 0 && at.x < from.height && at.y < from.width;
}

// Word by word, where four may lie in two taps.
uvec4 read_apart(ivec2 first)
{
    uvec4 v = uvec4(0);

    for (uint k = 0; k < 4; k++) {
        ivec2 t = tap;
        uint w = word + k;

        while (w >= from.pitch) {
            w -= from.pitch;
            t = t.y + 1 < pair(kernel).y ? ivec2(t.x, t.y + 1) : ivec2(t.x + 1, 0);
        }
        const ivec2 at = first + t * pair(dilation);

        if (is_inside(at, t))
            v[k] = from_word[from.at + uint(at.x * from.width + at.y) * from.pitch + w];
    }
    return v;
}

void read_inputs(uint lanes)
{
    const bool fours = ((from.at | from.pitch) & 3) == 0;

    while (word >= from.pitch) {
        word -= from.pitch;
        tap = tap.y + 1 < pair(kernel).y ? ivec2(tap.x, tap.y + 1) : ivec2(tap.x + 1, 0);
    }
    [[unroll]] for (uint i = 0; i < INPUTS; i++) {
        const ivec2 at = base[i] + tap * pair(dilation);

        if (i * lanes >= TILE * SLAB)
            break;
        next_input[i] = uvec4(0);
        if (!fours)
            next_input[i] = read_apart(base[i]);
        else if (is_inside(at, tap))
            next_input[i] = from_four_words[(from.at + uint(at.x * from.width + at.y) * from.pitch + word) >> 2];
    }
    word += 4 * SLAB;
}

void read_weights(uint lane, uint lanes, uint slab)
{
    const uint outs = (uint(channels) + TILE_OUT - 1) / TILE_OUT * TILE_OUT;
    const uint channel = gl_WorkGroupID.y * CHANNELS + lane % CHANNELS;
    const uint words = uint(pair(kernel).x * pair(kernel).y) * from.pitch;
    const uint padded = (words + PADDED - 1) / PADDED * PADDED;

    [[unroll]] for (uint i = 0; i < WEIGHTS; i++) {
        const uint first = 4 * (slab * SLAB + lane / CHANNELS + i * lanes / CHANNELS);

        if (i * lanes >= CHANNELS * SLAB)
            break;
        next_weight[i] = uvec4(0);
        if (first < padded && channel < outs) {
            const uint at = weights_at + first * outs + channel;

            next_weight[i] =
                uvec4(fixed_word[at], fixed_word[at + outs], fixed_word[at + 2 * outs], fixed_word[at + 3 * outs]);
        }
    }
}

// Put what was read into shared memory.
void share_slab(uint lane, uint lanes)
{
    const uvec4 turn = uvec4(from.type == U8 ? 0x80808080u : 0u);

    [[unroll]] for (uint i = 0; i < INPUTS; i++) {
        if (i * lanes >= TILE * SLAB)
            break;
        inputs[(lane / SLAB + i * lanes / SLAB) * PITCH + lane % SLAB] = next_input[i] ^ turn;
    }
    [[unroll]] for (uint i = 0; i < WEIGHTS; i++) {
        if (i * lanes >= CHANNELS * SLAB)
            break;
        weights[lane % CHANNELS * PITCH + lane / CHANNELS + i * lanes / CHANNELS] = next_weight[i];
        [[unroll]] for (uint k = 0; k < 16; k++)
            own += int(int8_t(next_weight[i][k / 4] >> (8 * (k % 4))));
    }
}

// Each channel's sum of weights, from those of its lanes.
void add_weight_sums(uint lane, uint lanes)
{
    results[lane] = own;
    barrier();
    if (lane < CHANNELS) {
        int sum = 0;

        for (uint i = lane; i < lanes; i += CHANNELS)
            sum += results[i];
        weight_sum[lane] = sum;
    }
    barrier();
}

// What results of four channels need.
struct Four {
    uint four;
    vec4 scale, bias;
    ivec4 missing;
};

// Of those that this invocation stores of a matrix with first channel `column` of the group.
Four four_of(uint column)
{
    const uint c = column + gl_SubgroupInvocationID % (COLUMNS / 4) * 4;
    Four f;

    f.four = (gl_WorkGroupID.y * CHANNELS + c) / 4;
    f.missing = ivec4(weight_sum[c], weight_sum[c + 1], weight_sum[c + 2], weight_sum[c + 3]) * 128;
    f.missing = from.type == U8 ? f.missing : ivec4(0);
    if (4 * f.four < uint(channels)) {
        f.scale = scale_of(f.four);
        f.bias = bias_of(f.four);
    }
    return f;
}

// Store a matrix of each subgroup, which lies in `results`. row: its first pixel in the group
void write(uint row, const Four f)
{
    const uint at = gl_SubgroupID * ROWS * COLUMNS;

    barrier();
    for (uint i = gl_SubgroupInvocationID; i < ROWS * COLUMNS / 4; i += gl_SubgroupSize) {
        const uint pixel = gl_WorkGroupID.x * TILE + row + i / (COLUMNS / 4);
        const ivec4 v = ivec4(results[at + 4 * i], results[at + 4 * i + 1], results[at + 4 * i + 2], results[at + 4 * i + 3]);

        if (pixel < uint(to.width * to.height) && 4 * f.four < uint(channels))
            store_scaled(pixel, f.four, v + f.missing, f.scale, f.bias);
    }
    barrier();
}

void main()
{
    const uint lane = gl_LocalInvocationID.x, lanes = gl_WorkGroupSize.x;
    const uint words = uint(pair(kernel).x * pair(kernel).y) * from.pitch, slabs = (words + 4 * SLAB - 1) / (4 * SLAB);
    const uint across = CHANNELS / (4 * COLUMNS), at = gl_SubgroupID * ROWS * COLUMNS;
    const uint row = gl_SubgroupID / across * 2 * ROWS, column = gl_SubgroupID % across * 4 * COLUMNS;
    uint step = DEPTH / 16; // no constant, so that it stands here
    MatrixSum sum00 = filled(0), sum01 = filled(0), sum02 = filled(0), sum03 = filled(0);
    MatrixSum sum10 = filled(0), sum11 = filled(0), sum12 = filled(0), sum13 = filled(0);

    [[unroll]] for (uint i = 0; i < INPUTS; i++) {
        const int pixel =
            int(min(gl_WorkGroupID.x * TILE + lane / SLAB + i * lanes / SLAB, uint(to.width * to.height) - 1));

        base[i] = ivec2(pixel / to.width, pixel % to.width) * pair(stride) - pair(pad);
    }
    word = lane % SLAB * 4;
    read_inputs(lanes);
    read_weights(lane, lanes, 0);
    for (uint slab = 0; slab < slabs; slab++) {
        share_slab(lane, lanes);
        barrier();
        if (slab + 1 < slabs) {
            read_inputs(lanes);
            read_weights(lane, lanes, slab + 1);
        }
        for (uint k = 0; k < SLAB; k += step) {
            const MatrixA a0 = load_a(inputs[row * PITCH + k], ROW_MAJOR, PITCH, SHARED_READ, WORKGROUP);
            const MatrixA a1 = load_a(inputs[(row + ROWS) * PITCH + k], ROW_MAJOR, PITCH, SHARED_READ, WORKGROUP);
            const MatrixB b0 = load_b(weights[column * PITCH + k], COLUMN_MAJOR, PITCH, SHARED_READ, WORKGROUP);
            const MatrixB b1 = load_b(weights[(column + COLUMNS) * PITCH + k], COLUMN_MAJOR, PITCH, SHARED_READ, WORKGROUP);
            const MatrixB b2 =
                load_b(weights[(column + 2 * COLUMNS) * PITCH + k], COLUMN_MAJOR, PITCH, SHARED_READ, WORKGROUP);
            const MatrixB b3 =
                load_b(weights[(column + 3 * COLUMNS) * PITCH + k], COLUMN_MAJOR, PITCH, SHARED_READ, WORKGROUP);

            sum00 = multiply(a0, b0, sum00, SIGNED);
            sum01 = multiply(a0, b1, sum01, SIGNED);
            sum02 = multiply(a0, b2, sum02, SIGNED);
            sum03 = multiply(a0, b3, sum03, SIGNED);
            sum10 = multiply(a1, b0, sum10, SIGNED);
            sum11 = multiply(a1, b1, sum11, SIGNED);
            sum12 = multiply(a1, b2, sum12, SIGNED);
            sum13 = multiply(a1, b3, sum13, SIGNED);
        }
        barrier();
    }
    add_weight_sums(lane, lanes);

#define WRITE(j, upper, lower)                                                    \
    {                                                                             \
        const Four f = four_of(column + j * COLUMNS);                             \
                                                                                  \
        store_sum(results[at], upper, ROW_MAJOR, COLUMNS, SHARED_WRITE, WORKGROUP); \
        write(row, f);                                                            \
        store_sum(results[at], lower, ROW_MAJOR, COLUMNS, SHARED_WRITE, WORKGROUP); \
        write(row + ROWS, f);                                                     \
    }
    WRITE(0, sum00, sum10)
    WRITE(1, sum01, sum11)
    WRITE(2, sum02, sum12)
    WRITE(3, sum03, sum13)
}
