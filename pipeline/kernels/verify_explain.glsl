// Whether the maps explain a ray: for verify_screen.comp and verify_unexplained.comp. Definition:
// explainer_contradicts().
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0

struct Near {
    float bx, by;
    uint view, zero;
};

struct Explained {
    View at;
    uint around, zero[3];
    Near near[8];
};

layout(std430, binding = 0) readonly buffer Views { Explained view[]; }; // struct sst_gpu_verify_view[count]
layout(std430, binding = 1) readonly buffer Pixels { uint pixel[]; };
layout(std430, binding = 2) readonly buffer Disp { uint disp[]; };
layout(std430, binding = 3) readonly buffer Valid { uint valid[]; };
// float [65535] disparities in pixels, by the stored number
layout(std430, binding = 4) readonly buffer DispPx { float disp_px[]; };
layout(std430, binding = 5) buffer Share { float share[]; }; // in and out: becomes 0 in cells that are closed

const uint NONE = 0xFFFF;
const int PART = 64;

uint disparity(uint at)
{
    return (disp[at >> 1] >> ((at & 1) * 16)) & 0xFFFF;
}

bool is_valid(uint at)
{
    return ((valid[at >> 2] >> ((at & 3) * 8)) & 0xFF) != 0;
}

ivec3 colour(uint p)
{
    return ivec3(p & 0xFF, (p >> 8) & 0xFF, (p >> 16) & 0xFF);
}

// Difference of a colour from that of view v at (x, y), bilinear; -1: not seen there.
int difference(uint v, ivec3 own, float x, float y)
{
    if (!(x >= 0.0 && y >= 0.0 && x < float(width) && y < float(height)))
        return -1;
    precise float across = x * float(PART) + 0.5, down = y * float(PART) + 0.5;
    const int xp = int(across), yp = int(down), x0 = xp / PART, y0 = yp / PART, fx = xp % PART, fy = yp % PART;

    if (x0 + 1 >= width || y0 + 1 >= height)
        return -1;
    const uint at = view[v].at.first + uint(y0) * uint(pitch) + uint(x0);

    if ((view[v].at.flags & VIEW_VALID) != 0 && !is_valid(at + uint(fy * 2 / PART) * uint(pitch) + uint(fx * 2 / PART)))
        return -1;
    const ivec3 a = colour(pixel[at]), c = colour(pixel[at + uint(pitch)]);
    const ivec3 upper = PART * a + fx * (colour(pixel[at + 1]) - a);
    const ivec3 lower = PART * c + fx * (colour(pixel[at + uint(pitch) + 1]) - c);
    const ivec3 apart = abs(PART * upper + fy * (lower - upper) - PART * PART * own);

    return (apart.r + apart.g + apart.b) / (PART * PART);
}

// True if fewer of the views around view v agree with its pixel (x, y), of disparity d, than do not, or none does.
bool contradicts(uint v, int x, int y, uint d)
{
    const ivec3 own = colour(pixel[view[v].at.first + uint(y) * uint(pitch) + uint(x)]);
    const float px = disp_px[d];
    int agree = 0, differ = 0;

    for (uint i = 0; i < view[v].around; i++) {
        precise float across = float(x) + px * view[v].near[i].bx;
        precise float down = float(y) + px * view[v].near[i].by;
        const int by = difference(view[v].near[i].view, own, across, down);

        agree += by >= 0 && by < levels ? 1 : 0;
        differ += by >= levels ? 1 : 0;
    }
    return agree == 0 || agree < differ;
}

// Aperture of view v's ray at pixel (x, y), inside the view, if it ends in front and is not explained; else 0.
float unexplained(uint v, int x, int y)
{
    const int vx = x + view[v].at.nx, vy = y + view[v].at.ny;
    const uint d = disparity(view[v].at.first + uint(vy) * uint(pitch) + uint(vx));

    return int(d) > nearest && (d == NONE || contradicts(v, vx, vy, d)) ? view[v].at.aperture : 0.0;
}
