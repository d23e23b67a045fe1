// Views vote about the label of the surface of each pixel. Buffers and constants: pipeline/gpu/label.h. Definition:
// vote_reference().
#version 450
#extension GL_EXT_control_flow_attributes : require
#extension GL_GOOGLE_include_directive : require

#include "label_views.glsl"

layout(std430, push_constant) uniform Constants {
    int width, height, count;
    Shift shift[4];
    int rows[4];
};

// Of a label that is not 0, as are votes that are missing.
uint count_of(uint label, uint vote[4])
{
    uint n = 0;

    [[unroll]] for (int i = 0; i < 4; i++)
        n += vote[i] == label ? 1 : 0;
    return n;
}

void main()
{
    const ivec2 at = ivec2(gl_GlobalInvocationID.xy);
    const int i = at.y * width + at.x;
    uint vote[4] = uint[4](0, 0, 0, 0), here, best, most;
    int d;

    if (at.x >= width || at.y >= height)
        return;
    here = own[width * height + i];
    d = int(own[i] & 0xFFFF);
    best = own[i] >> 16 & 0xFF;
    if (d != NONE && here >> 24 != 0) {
        [[unroll]] for (int k = 0; k < 4; k++) {
            const int there = k >= count ? -1 : place_of(k, shift[k], ivec2(width, rows[k]), at, d, here);

            vote[k] = there < 0 ? 0 : word_of(k, there) >> 16 & 0xFF;
        }
        most = best != 0 ? 1 + count_of(best, vote) : 0;
        [[unroll]] for (int k = 0; k < 4; k++) {
            const uint n = vote[k] != 0 ? count_of(vote[k], vote) : 0;

            if (vote[k] != (own[i] >> 16 & 0xFF) && n > most) {
                most = n;
                best = vote[k];
            }
        }
    }
    result[i] = best;
}
