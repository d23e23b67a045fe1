// Samples of a raw frame with their light corrected: resample_row and light_row of kernels.h. Of the shader: buffers
// weight, frame and light, and constants, as those of pipeline/gpu/rectify.h.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0

const uint LIT = 1;
const int LIGHT_WHITE = 255 << 7;
const float KNEE = 10.31475, OFFSET = 14.025, CLIPPED = 4.0;

ivec3 colour(uint p)
{
    return ivec3(p & 0xFF, (p >> 8) & 0xFF, (p >> 16) & 0xFF);
}

// Samples in 1/128 levels; pixels beyond the border are those at it.
ivec3 sample_at(ivec2 at)
{
    const int wx = (at.x & 255) * taps, wy = (at.y & 255) * taps;
    const int left = (at.x >> 8) + 1 - taps / 2, top = (at.y >> 8) + 1 - taps / 2;
    ivec3 sum = ivec3(0);

    for (int tx = 0; tx < taps; tx++) {
        const int x = clamp(left + tx, 0, raw_width - 1);
        ivec3 column = ivec3(0);

        for (int ty = 0; ty < taps; ty++)
            column += weight[wy + ty] * colour(frame[clamp(top + ty, 0, raw_height - 1) * raw_width + x]);
        sum += weight[wx + tx] * ((column + 128) >> 8);
    }
    return clamp((sum + 4096) >> 13, ivec3(0), ivec3(LIGHT_WHITE));
}

// The fall-off's factor at (x + right_of, y + below), or its root: bilinear between nodes.
float factor(int from, int x, int y, float right_of, float below)
{
    const float scale = uintBitsToFloat(uint(127 - light_shift) << 23); // 2^-light_shift
    const int row = min(y >> light_shift, light_rows - 2), col = min(x >> light_shift, light_cols - 2);
    const int at = from + row * light_cols + col;
    precise float down = (float(y - (row << light_shift)) + below) * scale;
    precise float left = light[at] + down * (light[at + light_cols] - light[at]);
    precise float right = light[at + 1] + down * (light[at + light_cols + 1] - light[at + 1]);
    precise float slope = (right - left) * scale;
    precise float v = left + slope * (right_of + float(x - (col << light_shift)));
    return v;
}

// light_row of one sample.
uint lit(int value, float f, float r)
{
    precise float v = float(value) * (1.0 / 128.0);
    precise float s = f * light[value];
    precise float p = r * light[LIGHT_WHITE + 1 + value] - OFFSET;
    precise float keep = 255.0 - CLIPPED * (255.0 - v);
    const float code = s < KNEE ? s : p, kept = code > keep ? code : keep;
    precise float most = (kept < 255.0 ? kept : 255.0) + 0.5;
    return uint(most);
}

// Colour of samples at (x + right_of, y + below) of the view: R, G, B.
uint finish(ivec3 value, int x, int y, float right_of, float below)
{
    if ((flags & LIT) == 0) {
        value = (value + 64) >> 7;
        return uint(value.r | value.g << 8 | value.b << 16);
    }
    const int grid = 2 * (LIGHT_WHITE + 1);
    const float f = factor(grid, x, y, right_of, below), r = factor(grid + light_cols * light_rows, x, y, right_of, below);
    uint rgb = 0;

    for (int c = 0; c < 3; c++) {
        precise float of = gain[c] * f;
        precise float root = gain_root[c] * r;

        rgb |= lit(value[c], of, root) << (8 * c);
    }
    return rgb;
}
