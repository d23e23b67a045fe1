// feature_cost.comp by dot products of four signed bytes.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0
#version 450
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
#extension GL_EXT_spirv_intrinsics : require

layout(local_size_x = 256) in;

#include "dot.glsl"

#define Four uint

uint four_of(uint word)
{
    return word ^ 0x80808080u;
}

int dot_of(uint a, uint b, int sum)
{
    return sum + dot4(a, b);
}

#include "feature_cost.glsl"
