// A convolution on bytes. A group has a tile of pixels times channels, and each invocation 4 x 4 of them; inputs and weights
// become floats in shared memory, in which 512 products have an exact sum. Buffers and constants: pipeline/gpu/net.h.
// Definition: net_conv8_reference() in pipeline/gpu/net.c.
#version 450

layout(local_size_x = 128) in;

layout(std430, binding = 0) readonly buffer Fixed { uint fixed_word[]; };
layout(std430, binding = 1) readonly buffer From { uint from_word[]; };
layout(std430, binding = 2) buffer To { uint to_word[]; };

struct Tensor {
    uint at, pitch, type;
    int width, height;
};

layout(std430, push_constant) uniform Constants {
    Tensor from, to;
    int channels, kernel, stride, pad, dilation;
    uint weights_at, scales_at, bias_at;
    uint residual_at, residual_pitch, residual_type;
    float residual_scale;
    uint residual_mode;
    float out_scale;
    uint relu, by_parts;
};

const uint F32 = 0, U8 = 1, S8 = 2, FUSED = 1, NONE = 2;
const uint TILE = 64, TILE_OUT = 32, SLAB = 8, PIXELS = TILE * SLAB / 128, WEIGHTS = TILE_OUT * SLAB / 128;
const uint EXACT = 512 / (4 * SLAB);

// Rows of inputs are turned by a column for each word, so that invocations that write side by side use other banks.
shared vec4 inputs[4 * SLAB][TILE / 4];
shared vec4 weights[4 * SLAB][TILE_OUT / 4];

vec4 bytes_of(uint word, uint type)
{
    const ivec4 v = ivec4(word << 24, word << 16, word << 8, word);

    return type == U8 ? vec4(uvec4(v) >> 24) : vec4(v >> 24);
}

ivec2 pair(int v)
{
    return ivec2(v >> 16, v & 0xFFFF);
}

// value + q * residual_scale, rounded once: the product in two exact parts, and the sum in two parts.
float fused(float value, float q)
{
    const float high = uintBitsToFloat(floatBitsToUint(residual_scale) & 0xFFFFF000u);
    precise float low = residual_scale - high;
    precise float product = q * high;
    precise float sum = value + product;
    precise float back = sum - value;
    precise float rest = (value - (sum - back)) + (product - back);
    precise float result = sum + (rest + q * low);

    return result;
}

vec4 residual_of(uint pixel, uint four)
{
    const uint at = residual_at + pixel * residual_pitch;

    if (residual_type != F32)
        return bytes_of(from_word[at + four], residual_type);
    return uintBitsToFloat(
        uvec4(from_word[at + 4 * four], from_word[at + 4 * four + 1], from_word[at + 4 * four + 2], from_word[at + 4 * four + 3]));
}

void store(uint pixel, uint four, ivec4 sum)
{
    const vec4 scale = uintBitsToFloat(uvec4(fixed_word[scales_at + 4 * four], fixed_word[scales_at + 4 * four + 1],
                                             fixed_word[scales_at + 4 * four + 2], fixed_word[scales_at + 4 * four + 3]));
    const vec4 bias = uintBitsToFloat(uvec4(fixed_word[bias_at + 4 * four], fixed_word[bias_at + 4 * four + 1],
                                            fixed_word[bias_at + 4 * four + 2], fixed_word[bias_at + 4 * four + 3]));
    precise vec4 value = (vec4(sum) + bias) * scale;

    if (residual_mode != NONE) {
        const vec4 q = residual_of(pixel, four);

        if (residual_mode == FUSED) {
            value = vec4(fused(value.x, q.x), fused(value.y, q.y), fused(value.z, q.z), fused(value.w, q.w));
        } else {
            precise vec4 r = q * residual_scale;

            value = value + r;
        }
    }
    if (relu != 0)
        value = mix(vec4(0), value, greaterThan(value, vec4(0)));
    if (to.type == F32) {
        const uint at = to.at + pixel * to.pitch + 4 * four;

        for (uint i = 0; i < 4; i++)
            to_word[at + i] = floatBitsToUint(value[i]);
    } else {
        const vec4 low = vec4(to.type == U8 ? 0.0 : -128.0), high = vec4(to.type == U8 ? 255.0 : 127.0);
        const uvec4 b = uvec4(ivec4(roundEven(clamp(value, low, high)))) & 0xFF;

        to_word[to.at + pixel * to.pitch + four] = b.x | b.y << 8 | b.z << 16 | b.w << 24;
    }
}

void main()
{
    const uint lane = gl_LocalInvocationID.x, word = lane % SLAB, pixels = uint(to.width * to.height);
    const uint outs = (uint(channels) + TILE_OUT - 1) / TILE_OUT * TILE_OUT, first = gl_WorkGroupID.y * TILE_OUT;
    const ivec2 size = pair(kernel), step = pair(dilation);
    const uint words = uint(size.x * size.y) * from.pitch;
    const uint quad = lane % (TILE_OUT / 4), row = lane / (TILE_OUT / 4);
    ivec2 base[PIXELS]; // of the input pixels under the kernel's first tap
    ivec2 tap = ivec2(0);
    uint four = word; // of the tap's pixel
    ivec4 sum[4] = ivec4[4](ivec4(0), ivec4(0), ivec4(0), ivec4(0));
    vec4 part[4] = vec4[4](vec4(0), vec4(0), vec4(0), vec4(0));

    for (uint i = 0; i < PIXELS; i++) {
        const int p = int(min(gl_WorkGroupID.x * TILE + lane / SLAB + i * (128 / SLAB), pixels - 1));

        base[i] = ivec2(p / to.width, p % to.width) * pair(stride) - pair(pad);
    }
    for (uint slab = 0; slab * SLAB < words; slab++) {
        while (four >= from.pitch) {
            four -= from.pitch;
            tap = tap.y + 1 < size.y ? ivec2(tap.x, tap.y + 1) : ivec2(tap.x + 1, 0);
        }
        for (uint i = 0; i < PIXELS; i++) {
            const ivec2 at = base[i] + tap * step;
            const uint p = lane / SLAB + i * (128 / SLAB);
            vec4 v = vec4(0);

            if (tap.x < size.x && at.x >= 0 && at.y >= 0 && at.x < from.height && at.y < from.width)
                v = bytes_of(from_word[from.at + uint(at.x * from.width + at.y) * from.pitch + four], from.type);
            for (uint k = 0; k < 4; k++)
                inputs[4 * word + k][(p / 4 + word) % (TILE / 4)][p % 4] = v[k];
        }
        for (uint i = 0; i < WEIGHTS; i++) {
            const uint out_channel = lane % TILE_OUT, w = lane / TILE_OUT + i * (128 / TILE_OUT);
            const vec4 v = bytes_of(fixed_word[weights_at + (slab * SLAB + w) * outs + first + out_channel], S8);

            for (uint k = 0; k < 4; k++)
                weights[4 * w + k][out_channel / 4][out_channel % 4] = v[k];
        }
        barrier();
        for (uint k = 0; k < 4 * SLAB; k++) {
            const vec4 x = inputs[k][(row + k / 4) % (TILE / 4)], w = weights[k][quad];

            for (uint i = 0; i < 4; i++)
                part[i] += x[i] * w;
        }
        barrier();
        four += SLAB;
        if (slab % EXACT == EXACT - 1) {
            for (uint i = 0; i < 4; i++) {
                sum[i] += ivec4(part[i]);
                part[i] = vec4(0);
            }
        }
    }
    for (uint i = 0; i < 4; i++) {
        const uint pixel = gl_WorkGroupID.x * TILE + 4 * row + i;

        if (pixel < pixels && first + 4 * quad < uint(channels))
            store(pixel, first / 4 + quad, sum[i] + ivec4(part[i]));
    }
}
