// Colour and weight of a ray: for blend.comp and verify_rays.comp, which declare the buffers `label`, `view`, `pixel`,
// `disp`, `valid` and `table`, and the constants `focus_whole`, `focus_part`, `scale`, `power`, `c1`, `first` and
// `count`.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0

const uint COLUMN_SHIFT = 4, COLUMN_BITS = 12;
const float LEVEL = 16384.0;

// sst_exp2_neg(). `precise`: no multiplication is fused with a sum, as on the CPU.
float exp2_neg(float u)
{
    const float magic = 12582912.0;
    precise float m = u + magic;
    precise float r = (m - magic) - u;
    precise float p = power[0] + r * (power[1] + r * (power[2] + r * (power[3] + r * power[4])));

    return uintBitsToFloat(floatBitsToUint(p) - (floatBitsToUint(m) << 23));
}

uint disparity(uint at)
{
    return (disp[at >> 1] >> ((at & 1) * 16)) & 0xFFFF;
}

bool is_valid(uint at)
{
    return ((valid[at >> 2] >> ((at & 3) * 8)) & 0xFF) != 0;
}

bool seen(uint at, uint right, uint below)
{
    return is_valid(at) && is_valid(at + right) && is_valid(at + below) && is_valid(at + right + below);
}

ivec3 colour(uint p)
{
    return ivec3(p & 0xFF, (p >> 8) & 0xFF, (p >> 16) & 0xFF);
}

// Colour in 1/LEVEL.
ivec3 level(uint v, uint at, uint right, uint below)
{
    return colour(pixel[at]) * view[v].tap[0] + colour(pixel[at + right]) * view[v].tap[1] +
           colour(pixel[at + below]) * view[v].tap[2] + colour(pixel[at + right + below]) * view[v].tap[3];
}

// A W_s W_d of a ray.
float weigh(float aperture, uint d, uint name, bool labels)
{
    precise float apart = (float(d) - focus_whole) - focus_part;
    precise float near = ((d - first) & 0xFFFF) < count ? exp2_neg(apart * apart * scale) : 0.0;
    precise float w_d = near + c1;
    float w_s = 1.0;

    if (labels)
        w_s = table[(label[name].row << COLUMN_BITS) + (d >> COLUMN_SHIFT)];
    precise float w = aperture * w_s * w_d;
    return w;
}
