// Pixels without a label get that of the most similar of the first labelled pixels in eight directions; where those are far,
// that of the labelled pixel to their left or right whose disparity is nearer. A group shares the directions of its pixels
// without a label. Buffers and constants: pipeline/gpu/label.h. Definition: label_fill_reference().
#version 450
#extension GL_EXT_control_flow_attributes : require

layout(local_size_x = 32, local_size_y = 8) in;

layout(std430, binding = 0) readonly buffer Own { uint own[]; };
layout(std430, binding = 1) readonly buffer From { uint from[]; };
layout(std430, binding = 2) writeonly buffer To { uint to[]; };

layout(std430, push_constant) uniform Constants {
    int width, height;
};

const int REACH = 64, AHEAD = 8; // pixels of a direction that are read at once
const uint GROUP = 256, WAYS = 8;
const ivec2 step_of[8] = ivec2[8](ivec2(-1, 0), ivec2(1, 0), ivec2(0, -1), ivec2(0, 1), ivec2(-1, -1), ivec2(1, -1),
                                  ivec2(-1, 1), ivec2(1, 1));

int disp_at(int at)
{
    return int(own[at] & 0xFFFF);
}

ivec3 colour_at(int at)
{
    const uint v = own[width * height + at];

    return ivec3(v & 0xFF, (v >> 8) & 0xFF, (v >> 16) & 0xFF);
}

shared uint waiting[GROUP], gaps;       // pixels of the group without a label, its lanes
shared uint off[GROUP], found[GROUP]; // of what the directions of 32 of them find, and its label; 0: nothing

// Steps to the border of the picture, or as many as count.
int steps_inside(int at, int step, int size)
{
    return min(step < 0 ? at : step > 0 ? size - 1 - at : REACH, REACH);
}

// The first pixel with a label among `most` from a pixel on; -1: none. @param step  from one to the next
int first_label(int at, int step, int most)
{
    int first = -1;

    for (int s = 1; s <= most && first < 0; s += AHEAD) {
        uint label[AHEAD];

        [[unroll]] for (int k = 0; k < AHEAD; k++)
            label[k] = from[at + step * min(s + k, most)];
        [[unroll]] for (int k = AHEAD - 1; k >= 0; k--)
            first = label[k] != 0 ? at + step * min(s + k, most) : first;
    }
    return first;
}

void look(ivec2 here, uint way)
{
    const ivec2 step = step_of[way];
    const int i = here.y * width + here.x;
    const int most = min(steps_inside(here.x, step.x, width), steps_inside(here.y, step.y, height));
    const int at = first_label(i, step.y * width + step.x, most);
    uint difference = 0xFFFFFFFFu, label = 0;

    if (at >= 0) {
        const ivec3 colour = abs(colour_at(i) - colour_at(at));

        difference = uint(colour.x + colour.y + colour.z) << 16 | uint(abs(disp_at(i) - disp_at(at)));
        label = from[at];
    }
    off[gl_LocalInvocationIndex] = difference;
    found[gl_LocalInvocationIndex] = label;
}

// Of the first of equal ones.
uint most_similar(uint first)
{
    uint least = 0xFFFFFFFFu, label = 0;

    for (uint k = first; k < first + WAYS; k++) {
        label = off[k] < least ? found[k] : label;
        least = min(off[k], least);
    }
    return label;
}

uint find_in_row(int x, int row)
{
    const int i = row + x, left = first_label(i, -1, x), right = first_label(i, 1, width - 1 - x);

    if (left >= 0 && (right < 0 || abs(disp_at(i) - disp_at(left)) <= abs(disp_at(i) - disp_at(right))))
        return from[left];
    return right >= 0 ? from[right] : 0;
}

void write_label(int i, uint label)
{
    to[i] = label & own[width * height + i] >> 24;
}

void fill_gaps(ivec2 corner)
{
    const uint lane = gl_LocalInvocationIndex, all = gaps;

    for (uint first = 0; first < all; first += GROUP / WAYS) {
        const uint which = first + lane / WAYS, pixel = which < all ? waiting[which] : 0;
        const ivec2 here = corner + ivec2(pixel % 32, pixel / 32);

        if (which < all)
            look(here, lane % WAYS);
        barrier();
        if (which < all && lane % WAYS == 0) {
            const uint label = most_similar(lane);

            write_label(here.y * width + here.x, label != 0 ? label : find_in_row(here.x, here.y * width));
        }
        barrier();
    }
}

void main()
{
    const int x = int(gl_GlobalInvocationID.x), y = int(gl_GlobalInvocationID.y), i = y * width + x;
    const bool inside = x < width && y < height;
    const uint label = inside ? from[i] : 0;

    if (gl_LocalInvocationIndex == 0)
        gaps = 0;
    barrier();
    if (inside && label == 0)
        waiting[atomicAdd(gaps, 1)] = gl_LocalInvocationIndex;
    else if (inside)
        write_label(i, label);
    barrier();
    fill_gaps(ivec2(gl_WorkGroupID.xy) * ivec2(32, 8));
}
