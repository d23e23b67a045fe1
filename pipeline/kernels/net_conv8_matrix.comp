// net_conv8.comp by products of matrices of bytes, ROWS x DEPTH times DEPTH x COLUMNS, which a subgroup computes together. A
// group has 64 pixels by 64 channels; each subgroup has 2 x 2 matrices of sums, and the group has as many invocations as
// that takes. Of bytes u from 0 to 255, u - 128 is multiplied, as in net_conv8_dot.comp.
#version 450
#pragma use_vulkan_memory_model
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_spirv_intrinsics : require
#extension GL_EXT_shader_explicit_arithmetic_types_int8 : require
#extension GL_KHR_memory_scope_semantics : require
#extension GL_KHR_shader_subgroup_basic : require

// Set when the device is known (pipeline/gpu/vulkan_device.c).
layout(local_size_x_id = 0) in;
layout(constant_id = 1) const uint ROWS = 16;
layout(constant_id = 2) const uint COLUMNS = 16;
layout(constant_id = 3) const uint DEPTH = 32;

#include "net_conv8.glsl"

const uint TILE = 64, TILE_OUT = 32, SLAB = 16, PADDED = 8; // TILE_OUT, PADDED: to which weights are padded
const uint PITCH = SLAB + 4;                                // words of a row in shared memory: other banks for other rows
const uint RESULTS = TILE * TILE / 4;                       // one matrix of each subgroup

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
MatrixA load_a(spirv_by_reference uint from, int layout_of, uint pitch, spirv_literal int access, uint scope);
spirv_instruction(COOPERATIVE, id = 4457)
MatrixB load_b(spirv_by_reference uint from, int layout_of, uint pitch, spirv_literal int access, uint scope);
spirv_instruction(COOPERATIVE, id = 4458)
void store_sum(spirv_by_reference int to, MatrixSum sum, int layout_of, uint pitch, spirv_literal int access, uint scope);
spirv_instruction(COOPERATIVE, id = 4459)
MatrixSum multiply(MatrixA a, MatrixB b, MatrixSum sum, spirv_literal int operands);
spirv_instruction(id = 80) MatrixSum filled(int value); // OpCompositeConstruct

shared uint inputs[TILE * PITCH];  // [pixel][word]
shared uint weights[TILE * PITCH]; // [channel][word]
shared int results[RESULTS];
shared ivec2 base[TILE]; // of the input pixels under the kernel's first tap
shared int weight_sum[TILE];

// Words of the slab that lie in shared memory are those of this lane: word, and every pixel p with p % step == its first.
void read_inputs(uint lane, uint lanes, ivec2 tap, uint four)
{
    const ivec2 size = pair(kernel);
    const uint turn = from.type == U8 ? 0x80808080u : 0u, word = lane % SLAB;

    for (uint p = lane / SLAB; p < TILE; p += lanes / SLAB) {
        const ivec2 at = base[p] + tap * pair(dilation);
        uint v = 0;

        if (tap.x < size.x && at.x >= 0 && at.y >= 0 && at.x < from.height && at.y < from.width)
            v = from_word[from.at + uint(at.x * from.width + at.y) * from.pitch + four];
        inputs[p * PITCH + word] = v ^ turn;
    }
}

// @return the sum of the bytes that this lane has read, all of channel lane % TILE
int read_weights(uint lane, uint lanes, uint slab, uint first)
{
    const uint outs = (uint(channels) + TILE_OUT - 1) / TILE_OUT * TILE_OUT, channel = lane % TILE;
    const uint words = uint(pair(kernel).x * pair(kernel).y) * from.pitch;
    const uint padded = (words + PADDED - 1) / PADDED * PADDED;
    int sum = 0;

    for (uint w = lane / TILE; w < SLAB; w += lanes / TILE) {
        uint v = 0;

        if (slab * SLAB + w < padded && first + channel < outs)
            v = fixed_word[weights_at + (slab * SLAB + w) * outs + first + channel];
        weights[channel * PITCH + w] = v;
        for (int k = 0; k < 32; k += 8)
            sum += int(int8_t(v >> k));
    }
    return sum;
}

// Results of one matrix of each subgroup, in `results`. row, column: its first pixel and channel in the group
void write(uint row, uint column)
{
    const uint at = gl_SubgroupID * ROWS * COLUMNS, first = gl_WorkGroupID.y * TILE;

    barrier();
    for (uint i = gl_SubgroupInvocationID; i < ROWS * COLUMNS / 4; i += gl_SubgroupSize) {
        const uint c = column + i % (COLUMNS / 4) * 4, pixel = gl_WorkGroupID.x * TILE + row + i / (COLUMNS / 4);
        const ivec4 missing = ivec4(weight_sum[c], weight_sum[c + 1], weight_sum[c + 2], weight_sum[c + 3]) * 128;
        const ivec4 v = ivec4(results[at + 4 * i], results[at + 4 * i + 1], results[at + 4 * i + 2], results[at + 4 * i + 3]);

        if (pixel < uint(to.width * to.height) && first + c < uint(channels))
            store(pixel, (first + c) / 4, from.type == U8 ? v + missing : v);
    }
    barrier();
}

// Each channel's sum of weights, from those of its lanes.
void add_weight_sums(uint lane, uint lanes, int own)
{
    results[lane] = own;
    barrier();
    if (lane < TILE) {
        int sum = 0;

        for (uint i = lane; i < lanes; i += TILE)
            sum += results[i];
        weight_sum[lane] = sum;
    }
    barrier();
}

void main()
{
    const uint lane = gl_LocalInvocationID.x, lanes = gl_WorkGroupSize.x, first = gl_WorkGroupID.y * TILE;
    const uint words = uint(pair(kernel).x * pair(kernel).y) * from.pitch;
    const uint across = TILE / (2 * COLUMNS), at = gl_SubgroupID * ROWS * COLUMNS;
    const uint row = gl_SubgroupID / across * 2 * ROWS, column = gl_SubgroupID % across * 2 * COLUMNS;
    uint words_a_step = DEPTH / 4; // no constant, so that it stands here
    MatrixSum sum00 = filled(0), sum01 = filled(0), sum10 = filled(0), sum11 = filled(0);
    ivec2 tap = ivec2(0);
    uint four = lane % SLAB; // of the tap's pixel
    int own = 0;

    for (uint p = lane; p < TILE; p += lanes) {
        const int pixel = int(min(gl_WorkGroupID.x * TILE + p, uint(to.width * to.height) - 1));

        base[p] = ivec2(pixel / to.width, pixel % to.width) * pair(stride) - pair(pad);
    }
    barrier();
    for (uint slab = 0; slab * SLAB < words; slab++) {
        while (four >= from.pitch) {
            four -= from.pitch;
            tap = tap.y + 1 < pair(kernel).y ? ivec2(tap.x, tap.y + 1) : ivec2(tap.x + 1, 0);
        }
        read_inputs(lane, lanes, tap, four);
        own += read_weights(lane, lanes, slab, first);
        barrier();
        for (uint k = 0; k < SLAB; k += words_a_step) {
            const MatrixA a0 = load_a(inputs[row * PITCH + k], ROW_MAJOR, PITCH, SHARED_READ, WORKGROUP);
            const MatrixA a1 = load_a(inputs[(row + ROWS) * PITCH + k], ROW_MAJOR, PITCH, SHARED_READ, WORKGROUP);
            const MatrixB b0 = load_b(weights[column * PITCH + k], COLUMN_MAJOR, PITCH, SHARED_READ, WORKGROUP);
            const MatrixB b1 = load_b(weights[(column + COLUMNS) * PITCH + k], COLUMN_MAJOR, PITCH, SHARED_READ, WORKGROUP);

            sum00 = multiply(a0, b0, sum00, SIGNED);
            sum01 = multiply(a0, b1, sum01, SIGNED);
            sum10 = multiply(a1, b0, sum10, SIGNED);
            sum11 = multiply(a1, b1, sum11, SIGNED);
        }
        barrier();
        four += SLAB;
    }
    add_weight_sums(lane, lanes, own);
    store_sum(results[at], sum00, ROW_MAJOR, COLUMNS, SHARED_WRITE, WORKGROUP);
    write(row, column);
    store_sum(results[at], sum01, ROW_MAJOR, COLUMNS, SHARED_WRITE, WORKGROUP);
    write(row, column + COLUMNS);
    store_sum(results[at], sum10, ROW_MAJOR, COLUMNS, SHARED_WRITE, WORKGROUP);
    write(row + ROWS, column);
    store_sum(results[at], sum11, ROW_MAJOR, COLUMNS, SHARED_WRITE, WORKGROUP);
    write(row + ROWS, column + COLUMNS);
}
