// Labels of a view from the nearest source that shows the surface of each pixel. Buffers and constants:
// pipeline/gpu/label.h. Definition: label_carry_reference().
#version 450
#extension GL_EXT_control_flow_attributes : require
#extension GL_GOOGLE_include_directive : require

#include "label_views.glsl"

layout(std430, push_constant) uniform Constants {
    int width, height, count;
    uint flags;
    Shift shift[4];
    int rows[4];
};

const uint ENTROPIES = 1, MORE = 2, INFINITE = 0x7F800000u;

void main()
{
    const ivec2 at = ivec2(gl_GlobalInvocationID.xy);
    const int n = width * height, i = at.y * width + at.x;
    uint label = 0, entropy = INFINITE, here;
    int d;

    if (at.x >= width || at.y >= height || ((flags & MORE) != 0 && result[i] != 0))
        return;
    here = own[n + i];
    d = int(own[i] & 0xFFFF);
    [[unroll]] for (int k = 0; k < 4; k++) {
        int there = -1;

        if (k < count && label == 0 && d != NONE && here >> 24 != 0)
            there = place_of(k, shift[k], ivec2(width, rows[k]), at, d, here);
        if (there < 0)
            continue;
        label = word_of(k, there) >> 16;
        if (label != 0 && (flags & ENTROPIES) != 0)
            entropy = word_of(k, 2 * width * rows[k] + there);
    }
    result[i] = label;
    if ((flags & ENTROPIES) != 0)
        result[n + i] = entropy;
}
