// Colour and weight of a ray: for blend.comp and verify_rays.comp, which declare the buffers `label`, `view`, `pixel`,
// `disp`, `valid` and `table`, and the constants of struct sst_blend_near.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0

const uint COLUMN_SHIFT = 4, COLUMN_BITS = 12;
const float LEVEL = 16384.0;

const uint UNKNOWN = 65520, POWER_1 = 45574, POWER_2 = 14837, POWER_3 = 5125;

// The power of sst_blend_near().
float near_power(uint d)
{
    const uint from_focus = (clamp(d, first, last) * times - focus) & 0xFFFF;
    const uint off = (from_focus & 0x8000) != 0 ? 0x10000 - from_focus : from_focus, y = 2 * off * slope >> 16;
    const uint e = 0xFFFF - (y * y >> 16), g = (e << (16 - bits)) & 0xFFFF;
    const uint mantissa = (((g * POWER_3 >> 16) + POWER_2) * g >> 16) + POWER_1;

    return uintBitsToFloat((((e >> bits) + 127 - (1 << (16 - bits))) << 16 | (mantissa * g >> 16)) << 7);
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
    precise float w = aperture * scale;

    if (labels)
        w *= table[(label[name].row << COLUMN_BITS) + (d >> COLUMN_SHIFT)];
    if (bits != 0) {
        precise float w_d = (d < UNKNOWN ? near_power(d) : 0.0) + base;

        w *= w_d;
    }
    return w;
}
