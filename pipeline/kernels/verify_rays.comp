// Colours and votes of the rays around pixels left to votes: blend_take and agree_votes of kernels.h. Constants:
// pipeline/gpu/verify.h. Definition: pipeline/method/render/verify.c.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0
#version 450
#extension GL_GOOGLE_include_directive : require

layout(local_size_x = 32, local_size_y = 4) in;

#include "blend_view.glsl"

// as of verify_share
layout(std430, binding = 0) readonly buffer Params { Label label[256]; uint rarity[1024]; View view[]; };
layout(std430, binding = 1) readonly buffer Pixels { uint pixel[]; };
layout(std430, binding = 2) readonly buffer Disp { uint disp[]; };
layout(std430, binding = 3) readonly buffer Valid { uint valid[]; };
layout(std430, binding = 4) readonly buffer Table { float table[]; };
// a byte each; not read without SST_GPU_VIEW_CONFIDENCE
layout(std430, binding = 5) readonly buffer Confidence { uint confidence[]; };
layout(std430, binding = 6) readonly buffer Share { float share[]; };
layout(std430, binding = 7) writeonly buffer Rays { uint ray[]; };

#include "verify.glsl"
#include "blend_ray.glsl"
#include "verify_needed.glsl"

const float DOUBT = 0.5, DOUBT_LEAST = 0.3;

// Weight of a ray with the doubt about it.
float doubted(float weight, uint v, uint nearest_at)
{
    const float aperture = view[v].aperture;

    if ((view[v].flags & VIEW_CONFIDENCE) == 0) {
        precise float sum = weight + DOUBT * aperture;

        return sum;
    }
    const uint sure = (confidence[nearest_at >> 2] >> ((nearest_at & 3) * 8)) & 0xFF;
    precise float least = weight + DOUBT_LEAST * aperture;
    precise float sum = least + doubt_step * aperture * float(255 - sure);

    return sum;
}

uint votes(uvec3 c, float weight)
{
    const uint bin = (c.r >> 4) << 8 | (c.g >> 4) << 4 | c.b >> 4;
    precise float n = 1.0 + vote_scale * weight * float((rarity[bin >> 2] >> ((bin & 3) * 8)) & 0xFF);

    return uint(n < most ? n : most);
}

// The ray of view v at pixel (x, y), inside the view; 0: none.
uint take(uint v, int x, int y)
{
    const uint at = view[v].first + uint(y + view[v].iy) * uint(pitch) + uint(x + view[v].ix);
    const uint right = (view[v].flags & VIEW_RIGHT) != 0 ? 1 : 0;
    const uint below = (view[v].flags & VIEW_BELOW) != 0 ? uint(pitch) : 0;

    if ((view[v].flags & VIEW_VALID) != 0 && !seen(at, right, below))
        return 0;
    const uvec3 c = uvec3(level(v, at, right, below) + int(LEVEL) / 2) / uint(LEVEL);
    const uint near_at = view[v].first + uint(y + view[v].ny) * uint(pitch) + uint(x + view[v].nx);
    const bool labels = (view[v].flags & VIEW_LABELS) != 0 && (flags & BY_LABEL) != 0;
    const float w = weigh(view[v].aperture, disparity(near_at), labels ? pixel[near_at] >> 24 : 0, labels);

    return c.r | c.g << 8 | c.b << 16 | votes(c, doubted(w, v, near_at)) << 24;
}

void main()
{
    const int x = int(gl_GlobalInvocationID.x), row = int(gl_GlobalInvocationID.y), y = rays_top() + row;
    const uint at = uint(row) * uint(width) + uint(x);

    if (x >= width || at >= rays || !needed(x, y))
        return;
    for (uint v = first_view; v < first_view + views; v++) {
        const bool inside = x >= view[v].x0 && x < view[v].x1 && y >= view[v].y0 && y < view[v].y1;

        ray[view[v].index * rays + at] = inside ? take(v, x, y) : 0;
    }
}
