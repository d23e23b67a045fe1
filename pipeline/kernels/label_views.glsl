// Views that exchange labels: buffers of vote.comp and label_carry.comp, and where a view shows the surface of a pixel.
// Planes of a view: enum sst_gpu_label_plane in pipeline/gpu/label.h.

layout(local_size_x = 32, local_size_y = 8) in;

struct Shift {
    int across, across_part, across_step, down, down_part, down_step;
};

layout(std430, binding = 0) readonly buffer Own { uint own[]; };
layout(std430, binding = 1) readonly buffer First { uint first[]; };
layout(std430, binding = 2) readonly buffer Second { uint second[]; };
layout(std430, binding = 3) readonly buffer Third { uint third[]; };
layout(std430, binding = 4) readonly buffer Fourth { uint fourth[]; };
layout(std430, binding = 5) buffer Out { uint result[]; };

const int NONE = 0xFFFF, SAME = 64, SIMILAR = 24;

uint word_of(int voter, int at)
{
    return voter == 0 ? first[at] : voter == 1 ? second[at] : voter == 2 ? third[at] : fourth[at];
}

ivec3 colour(uint v)
{
    return ivec3(v & 0xFF, (v >> 8) & 0xFF, (v >> 16) & 0xFF);
}

// Index of the pixel of another view, of this size, that shows the surface of pixel (x, y), with disparity d; -1: it does not.
int place_of(int voter, Shift s, ivec2 size, ivec2 at, int d, uint own_colour)
{
    const int x = at.x + s.across + ((s.across_part + d * s.across_step) >> 16);
    const int y = at.y + s.down + ((s.down_part + d * s.down_step) >> 16);
    const int there = y * size.x + x;
    uint place, shown; // read at once

    if (x < 0 || y < 0 || x >= size.x || y >= size.y)
        return -1;
    place = word_of(voter, there);
    shown = word_of(voter, size.x * size.y + there);
    return abs(int(place & 0xFFFF) - d) > SAME ||
                   any(greaterThan(abs(colour(own_colour) - colour(shown)), ivec3(SIMILAR)))
               ? -1
               : there;
}
