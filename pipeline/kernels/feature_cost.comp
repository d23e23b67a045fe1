// Costs of a view's features and one neighbour's, at every step: feature_cost_rows of kernels.h. Constants:
// pipeline/gpu/match.h. Definition: feature_cost_ref.c.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0
#version 450
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require

layout(local_size_x = 256) in;

#define Four ivec4

ivec4 four_of(uint word)
{
    return ivec4((uvec4(word) >> uvec4(0, 8, 16, 24)) & 0xFF) - 128;
}

int dot_of(ivec4 a, ivec4 b, int sum)
{
    return sum + a.x * b.x + a.y * b.y + a.z * b.z + a.w * b.w;
}

#include "feature_cost.glsl"
