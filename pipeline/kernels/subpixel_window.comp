// Sums of weights and disparities over the similar pixels of 5x5 windows, subpixel_window_row of kernels.h, and the
// disparities that follow from them. Constants: pipeline/gpu/subpixel.h. Definition: subpixel_ref.c, and
// step_all() and finish() of pipeline/method/disparity/subpixel.c.
#version 450
#extension GL_GOOGLE_include_directive : require

#include "quotient.glsl"

layout(local_size_x = 32, local_size_y = 8) in;

// uint32_t[height][width]: R, G, B from the lowest byte up
layout(std430, binding = 0) readonly buffer Colours { uint colours[]; };
layout(std430, binding = 1) readonly buffer Disparities { uint disp[]; };
// of subpixel_fit; with `wide` the last step's
layout(std430, binding = 2) readonly buffer Weights { vec2 weights[]; };
layout(std430, binding = 3) writeonly buffer Left { vec2 left[]; }; // out, without `wide`: of the windows
// out: disparities; with `wide` SST_DISP_NONE where it is not known
layout(std430, binding = 4) writeonly buffer Out { uint result[]; };

layout(std430, push_constant) uniform Constants {
    int width, height;
    int step_px, similar, apart, wide, reach, last;
    float few, enough;
};

const int NONE = 32768;
const uint UNKNOWN = 0xFFFF;

ivec3 channels(uint p)
{
    return ivec3(p & 0xFF, (p >> 8) & 0xFF, (p >> 16) & 0xFF);
}

uint near_first(float disp_px, int first)
{
    precise float rounded = floor(disp_px * 64.0 + 0.5);

    return uint(clamp(int(rounded), max(first - reach, 0), min(first + reach, last)));
}

void main()
{
    const int x = int(gl_GlobalInvocationID.x), y = int(gl_GlobalInvocationID.y), at = y * width + x;
    precise float weight = 0.0, product = 0.0;
    ivec3 colour;
    int d, first;

    if (x >= width || y >= height)
        return;
    d = int(disp[at] & 0xFFFF);
    first = int(disp[at] >> 16);
    colour = channels(colours[at]);
    for (int i = -2; i <= 2; i++) {
        for (int j = -2; j <= 2; j++) {
            const int xn = x + step_px * j, yn = y + step_px * i, there = yn * width + xn;
            ivec3 off;

            if (xn < 0 || yn < 0 || xn >= width || yn >= height)
                continue;
            off = abs(channels(colours[there]) - colour);
            if (max(max(off.x, off.y), off.z) > similar || abs(int(disp[there] & 0xFFFF) - d) > apart)
                continue;
            weight = weight + weights[there].x;
            product = product + weights[there].y;
        }
    }
    if (wide == 0) {
        precise float all_weight = weight + few;
        precise float all_product = product + few * (float(d) * (1.0 / 64.0));
        const float refined = quotient(all_product, all_weight);
        precise float kept = min(weight, enough) + few;
        precise float kept_product = kept * refined;

        left[at] = vec2(kept, kept_product);
        result[at] = (d < NONE ? near_first(refined, first) : uint(d)) | uint(first) << 16;
    } else {
        const vec2 own = weights[at];
        precise float share = own.x < enough ? 1.0 - quotient(own.x, enough) : 0.0;
        const float refined = quotient(own.y, own.x), mean = quotient(product, weight);
        precise float mixed = refined + share * (mean - refined);

        result[at] = (d < NONE ? near_first(mixed, first) : UNKNOWN) | uint(first) << 16;
    }
}
