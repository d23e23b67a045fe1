// The arithmetic of pipeline/kernels/verify_ref.h, to the last bit.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0

#include "quotient.glsl"

float ramp(float v, float low, float high)
{
    precise float over = v - low;
    precise float span = high - low;

    return min(max(quotient(over, span), 0.0), 1.0);
}
