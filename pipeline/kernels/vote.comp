// Views vote about the label of the surface of each pixel. Buffers and constants: pipeline/gpu/vote.h. Definition:
// vote_reference().
#version 450

layout(local_size_x = 32, local_size_y = 8) in;

struct Shift {
    int across, across_part, across_step, down, down_part, down_step;
};

layout(std430, binding = 0) readonly buffer Own { uvec2 own[]; };
layout(std430, binding = 1) readonly buffer First { uvec2 first[]; };
layout(std430, binding = 2) readonly buffer Second { uvec2 second[]; };
layout(std430, binding = 3) readonly buffer Third { uvec2 third[]; };
layout(std430, binding = 4) readonly buffer Fourth { uvec2 fourth[]; };
layout(std430, binding = 5) writeonly buffer Out { uint labels[]; };

layout(std430, push_constant) uniform Constants {
    int width, height, count;
    Shift shift[4];
};

const int NONE = 0xFFFF, SAME = 64, SIMILAR = 24;

uvec2 pixel_of(int voter, int at)
{
    return voter == 0 ? first[at] : voter == 1 ? second[at] : voter == 2 ? third[at] : fourth[at];
}

ivec3 colour(uint v)
{
    return ivec3(v & 0xFF, (v >> 8) & 0xFF, (v >> 16) & 0xFF);
}

// What a voter sees on the surface; 0: not that, or no label.
uint vote_of(int voter, uvec2 pixel, int d, ivec2 at)
{
    const Shift s = shift[voter];
    const int x = at.x + s.across + ((s.across_part + d * s.across_step) >> 16);
    const int y = at.y + s.down + ((s.down_part + d * s.down_step) >> 16);
    uvec2 there;

    if (x < 0 || y < 0 || x >= width || y >= height)
        return 0;
    there = pixel_of(voter, y * width + x);
    if (abs(int(there.y & 0xFFFF) - d) > SAME ||
        any(greaterThan(abs(colour(pixel.x) - colour(there.x)), ivec3(SIMILAR))))
        return 0;
    return there.x >> 24;
}

uint count_of(uint label, uint vote[4])
{
    uint n = 0;

    for (int i = 0; i < count; i++)
        n += vote[i] == label ? 1 : 0;
    return n;
}

void main()
{
    const ivec2 at = ivec2(gl_GlobalInvocationID.xy);
    const int i = at.y * width + at.x;
    uint vote[4] = uint[4](0, 0, 0, 0), best, most;
    uvec2 pixel;
    int d;

    if (at.x >= width || at.y >= height)
        return;
    pixel = own[i];
    d = int(pixel.y & 0xFFFF);
    best = pixel.x >> 24;
    if (d != NONE && pixel.y >> 16 != 0) {
        for (int k = 0; k < count; k++)
            vote[k] = vote_of(k, pixel, d, at);
        most = best != 0 ? 1 + count_of(best, vote) : 0;
        for (int k = 0; k < count; k++) {
            const uint n = vote[k] != 0 ? count_of(vote[k], vote) : 0;

            if (vote[k] != pixel.x >> 24 && n > most) {
                most = n;
                best = vote[k];
            }
        }
    }
    labels[i] = best;
}
