// Pixels without a label get that of the labelled pixel to their left or right whose disparity is nearer to theirs.
// Buffers and constants: pipeline/gpu/label.h. Definition: label_fill_reference().
#version 450

layout(local_size_x = 32, local_size_y = 8) in;

layout(std430, binding = 0) readonly buffer Own { uint own[]; };
layout(std430, binding = 1) readonly buffer From { uint from[]; };
layout(std430, binding = 2) writeonly buffer To { uint to[]; };

layout(std430, push_constant) uniform Constants {
    int width, height;
};

int disp_at(int at)
{
    return int(own[at] & 0xFFFF);
}

void main()
{
    const int x = int(gl_GlobalInvocationID.x), y = int(gl_GlobalInvocationID.y), row = y * width, i = row + x;
    uint label;

    if (x >= width || y >= height)
        return;
    label = from[i];
    if (label == 0) {
        int left = x - 1, right = x + 1;

        while (left >= 0 && from[row + left] == 0)
            left--;
        while (right < width && from[row + right] == 0)
            right++;
        if (left >= 0 && (right == width || abs(disp_at(i) - disp_at(row + left)) <= abs(disp_at(i) - disp_at(row + right))))
            label = from[row + left];
        else if (right < width)
            label = from[row + right];
    }
    to[i] = label & own[width * height + i] >> 24;
}
