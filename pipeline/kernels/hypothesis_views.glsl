// Cost of a disparity of a pixel by the other views, shared by hypothesis_cost and sweep_points, which declare the
// views, the pixels and the constants that it reads. Definition: hypothesis_cost_ref.c.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0

const uint LIMIT = 480, FAR = 12000, OUTSIDE = 255;

uint window[9]; // of the own view: pixels that are similar to the middle one, and those that are not
bool counts_in[9];
uint reciprocal;

ivec3 channels(uint p)
{
    return ivec3(p & 0xFF, (p >> 8) & 0xFF, (p >> 16) & 0xFF);
}

int index_of(int x, int y)
{
    return clamp(y, 0, height - 1) * width + clamp(x, 0, width - 1);
}

void read_window(int x, int y)
{
    const ivec3 middle = channels(pixels[own + uint(index_of(x, y))]);
    uint found = 0;

    for (int i = 0; i < 9; i++) {
        ivec3 off;

        window[i] = pixels[own + uint(index_of(x + i % 3 - 1, y + i / 3 - 1))];
        off = abs(channels(window[i]) - middle);
        counts_in[i] = max(max(off.x, off.y), off.z) <= similar;
        found += counts_in[i] ? 1 : 0;
    }
    reciprocal = 65536 * 8 / found;
}

uint difference(uint first, int x, int y)
{
    uint sum = 0;

    for (int i = 0; i < 9; i++) {
        const ivec3 off = abs(channels(window[i]) - channels(pixels[first + uint(index_of(x + i % 3 - 1, y + i / 3 - 1))]));

        sum += counts_in[i] ? uint(off.x + off.y + off.z) : 0;
    }
    return min((sum * reciprocal) >> 16, LIMIT);
}

// Depth code of a disparity.
uint code_of(uint d)
{
    return 1 + min(d, most) * 253 / most;
}

uint cost_of(int x, int y, int d)
{
    const uint hides = code_of(uint(min(d + tolerance, 65534)));
    uvec4 best = uvec4(0xFFFFFFFF); // ascending
    uint seen = 0, visible = 0, sum = 0;

    for (int k = 0; k < count; k++) {
        const View v = views[k];
        const int xv = x + ((v.x + d * v.dx) >> 16), yv = y + ((v.y + d * v.dy) >> 16);
        uint code, cost;

        if (xv < 0 || yv < 0 || xv >= width || yv >= height)
            continue;
        code = pixels[v.first + uint(yv * width + xv)] >> 24;
        if (code == OUTSIDE)
            continue;
        cost = difference(v.first, xv, yv);
        seen++;
        visible += code <= hides ? 1 : 0;
        sum += code <= hides ? cost : 0;
        // Insert: each of the four stays, or is the one before it.
        best = uvec4(min(best.x, cost), clamp(cost, best.x, best.y), clamp(cost, best.y, best.z),
                     clamp(cost, best.z, best.w));
    }
    if (seen < 4)
        return seen > 0 ? best.x : LIMIT;
    return (sum + best.x + best.y + best.z + best.w) / (visible + 4);
}
