// Limits of a device: copies words, or multiplies and adds. Constants: pipeline/gpu/gpu_internal.h.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0
#version 450

layout(local_size_x = 256) in;

layout(std430, binding = 0) readonly buffer From { vec4 from[]; }; // float [count][4]
layout(std430, binding = 1) writeonly buffer To { vec4 to[]; }; // out, float [count][4]

layout(std430, push_constant) uniform Constants {
    uint count, rounds;
};

void main()
{
    const uint at = gl_GlobalInvocationID.x, stride = gl_NumWorkGroups.x * 256;

    for (uint i = at; i < count; i += stride) {
        const vec4 factor = from[i];
        vec4 sum[4] = vec4[](factor, factor, factor, factor);

        for (uint k = 0; k < rounds; k++) {
            for (uint j = 0; j < 4; j++)
                sum[j] = sum[j] * factor + vec4(j + 1);
        }
        to[i] = rounds == 0 ? factor : sum[0] + sum[1] + sum[2] + sum[3];
    }
}
