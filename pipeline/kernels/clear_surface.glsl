// The surface of a pixel from the rays that landed there: clear_surface of kernels.h. Of the shader: `landed`, and the
// constants of pipeline/gpu/clear.h.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0

const uint TOLERANCE = 48;

uint level_of(uint at, uint k)
{
    return landed[k * uint(rows) * uint(pitch) + at] >> 1;
}

// Sum of the levels of the surface's rays, and their number; 0, 0: there is none.
uvec2 surface(uint at)
{
    uint top = 0, arrived = 0;

    for (uint k = 0; k < views; k++) {
        const uint level = level_of(at, k);

        top = max(top, level);
        arrived += level != 0 ? 1 : 0;
    }
    while (top != 0) {
        uint count = 0, sum = 0, next = 0;

        for (uint k = 0; k < views; k++) {
            const uint level = level_of(at, k);

            if (level != 0 && level <= top && level + TOLERANCE >= top) {
                count++;
                sum += level;
            }
            next = level < top ? max(next, level) : next;
        }
        if (count >= 2 && 4 * count >= arrived)
            return uvec2(sum, count);
        top = next;
    }
    return uvec2(0);
}

// sum / count to the nearest float, ties to even: a division may be off by some units in the last place.
float quotient(uint sum, uint count)
{
    const uint whole = sum / count;
    const int bits = 23 - findMSB(whole); // after the point; 8 to 23, and sum % count has 8 bits
    const uint scaled = (sum % count) << bits, part = scaled / count, rest = scaled % count;
    const uint up = 2 * rest > count || (2 * rest == count && (part & 1) != 0) ? 1 : 0;

    return float((whole << bits) + part + up) * uintBitsToFloat(uint(127 - bits) << 23);
}

// Disparity of a level, rounded once.
float disparity(float level)
{
    precise float t = (level - 1.0) * float(1 << coarse) * (1.0 / 64.0);
    precise float s = disp_min + t;
    precise float back = s - disp_min;
    precise float lost = (disp_min - (s - back)) + (t - back);
    precise float d = s + (lost + disp_min_rest);

    return d;
}

// The levels of rays that see a surface, from .. to.
uvec2 levels_of(float level)
{
    const int whole = int(level), up = float(whole) < level ? 1 : 0;

    return uvec2(uint(max(whole + up - int(TOLERANCE), 1)), uint(min(whole + int(TOLERANCE), 65535)));
}
