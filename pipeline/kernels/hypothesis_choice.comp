// The cheapest hypothesis of each pixel; where it is not the pixel's own disparity, the confidence is the distance to
// the next one. Constants: pipeline/method/disparity/device_second.c. Definition: `cpu` of the step.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0
#version 450

layout(local_size_x = 64) in;

layout(std430, binding = 0) readonly buffer Hypotheses { uint hypotheses[]; };
layout(std430, binding = 1) readonly buffer Counts { uint counts[]; };
layout(std430, binding = 2) readonly buffer Sum { uvec4 sums[]; };
// out, uint32_t[pixels]: disparity | confidence << 16 | 1 << 24 if it is not the first one, which has no confidence
// | the cheapest << 25 | mark << 28 | (how many - 1) << 29; the disparity is SST_DISP_NONE without any
layout(std430, binding = 3) writeonly buffer Out { uint result[]; };

layout(std430, push_constant) uniform Constants {
    uint pixels;
};

void main()
{
    const uint at = gl_GlobalInvocationID.x + gl_GlobalInvocationID.y * 65536;
    uint count, info, best = 0, least, next = 0xFFFF, d, gap;
    uvec4 low, high;

    if (at >= pixels)
        return;
    info = counts[at];
    count = (info >> 8) & 0xFF;
    low = sums[2 * at];
    high = sums[2 * at + 1];
    least = low[0];
    for (uint i = 1; i < count; i++) {
        const uint s = i < 4 ? low[i] : high[i - 4];

        best = s < least ? i : best;
        least = min(least, s);
    }
    for (uint i = 0; i < count; i++) {
        const uint s = i < 4 ? low[i] : high[i - 4];

        next = i != best ? min(next, s) : next;
    }
    d = (hypotheses[4 * at + (best >> 1)] >> (16 * (best & 1))) & 0xFFFF;
    gap = next - least;
    // Disparity, confidence, whether that is a new one; from the costs: the cheapest one, whether others may be skipped;
    // how many there are, less one.
    result[at] = (count > 0 ? d : 0xFFFF) | (best > 0 ? (255 * gap / (gap + 128)) << 16 | 1 << 24 : 0) |
                 ((info >> 16) & 7) << 25 | ((info >> 24) & 1) << 28 | ((info - 1) & 7) << 29;
}
