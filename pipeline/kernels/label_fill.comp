// Pixels without a label get that of the most similar of the first labelled pixels in eight directions; where those are far,
// that of the labelled pixel to their left or right whose disparity is nearer. Buffers and constants: pipeline/gpu/label.h.
// Definition: label_fill_reference().
#version 450

layout(local_size_x = 32, local_size_y = 8) in;

layout(std430, binding = 0) readonly buffer Own { uint own[]; };
layout(std430, binding = 1) readonly buffer From { uint from[]; };
layout(std430, binding = 2) writeonly buffer To { uint to[]; };

layout(std430, push_constant) uniform Constants {
    int width, height;
};

const int REACH = 64;
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

uint find_similar(ivec2 here)
{
    const int i = here.y * width + here.x;
    uint least = 0xFFFFFFFFu, label = 0;

    for (int k = 0; k < 8; k++) {
        ivec2 there = here;

        for (int s = 1; s <= REACH; s++) {
            int at;
            ivec3 step;
            uint off;

            there += step_of[k];
            if (there.x < 0 || there.y < 0 || there.x >= width || there.y >= height)
                break;
            at = there.y * width + there.x;
            if (from[at] == 0)
                continue;
            step = abs(colour_at(i) - colour_at(at));
            off = uint(step.x + step.y + step.z) << 16 | uint(abs(disp_at(i) - disp_at(at)));
            if (off < least) {
                least = off;
                label = from[at];
            }
            break;
        }
    }
    return label;
}

uint find_in_row(int x, int row)
{
    const int i = row + x;
    int left = x - 1, right = x + 1;

    while (left >= 0 && from[row + left] == 0)
        left--;
    while (right < width && from[row + right] == 0)
        right++;
    if (left >= 0 && (right == width || abs(disp_at(i) - disp_at(row + left)) <= abs(disp_at(i) - disp_at(row + right))))
        return from[row + left];
    return right < width ? from[row + right] : 0;
}

void main()
{
    const int x = int(gl_GlobalInvocationID.x), y = int(gl_GlobalInvocationID.y), i = y * width + x;
    uint label;

    if (x >= width || y >= height)
        return;
    label = from[i];
    if (label == 0)
        label = find_similar(ivec2(x, y));
    if (label == 0)
        label = find_in_row(x, y * width);
    to[i] = label & own[width * height + i] >> 24;
}
