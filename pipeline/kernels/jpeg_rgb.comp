// The pixels of a frame from the samples of a JPEG: chroma enlarged, then colours. Constants:
// pipeline/method/render/device_frames.c. Definition: libjpeg-turbo.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0
#version 450

layout(local_size_x = 32, local_size_y = 8) in;

layout(std430, binding = 0) readonly buffer Planes { uint planes[]; }; // bytes, as of struct sst_jpeg_planes
// out, uint32_t [height][width]: R, G, B and 255 from the lowest byte up
layout(std430, binding = 1) buffer Frame { uint frame[]; };

layout(std430, push_constant) uniform Constants {
    int width, height, count, across, down, chroma_width, chroma_height;
    uint at[3], stride[3];
};

int sample_at(int plane, int x, int y)
{
    const uint i = at[plane] + uint(y) * stride[plane] + uint(x);

    return int((planes[i >> 2] >> ((i & 3) * 8)) & 0xFF);
}

// Chroma of a pixel: three parts of the nearest sample and one of the next, across and down.
int chroma(int plane, int x, int y)
{
    if (across == 1)
        return sample_at(plane, x, y);
    const int odd_x = x & 1, odd_y = y & 1;
    const int near_x = x >> 1, far_x = clamp(near_x + 2 * odd_x - 1, 0, chroma_width - 1);

    if (down == 1)
        return (3 * sample_at(plane, near_x, y) + sample_at(plane, far_x, y) + 1 + odd_x) >> 2;
    const int near_y = y >> 1, far_y = clamp(near_y + 2 * odd_y - 1, 0, chroma_height - 1);
    const int near = 3 * sample_at(plane, near_x, near_y) + sample_at(plane, near_x, far_y);
    const int far = 3 * sample_at(plane, far_x, near_y) + sample_at(plane, far_x, far_y);

    return (3 * near + far + 8 - odd_x) >> 4;
}

void main()
{
    const int x = int(gl_GlobalInvocationID.x), y = int(gl_GlobalInvocationID.y);

    if (x >= width || y >= height)
        return;
    const int luma = sample_at(0, x, y);
    ivec3 rgb = ivec3(luma);

    if (count == 3) {
        const int cb = chroma(1, x, y) - 128, cr = chroma(2, x, y) - 128;

        rgb.r += (91881 * cr + 32768) >> 16;
        rgb.g += (32768 - 22554 * cb - 46802 * cr) >> 16;
        rgb.b += (116130 * cb + 32768) >> 16;
        rgb = clamp(rgb, ivec3(0), ivec3(255));
    }
    frame[y * width + x] = uint(rgb.r | rgb.g << 8 | rgb.b << 16) | 0xFF000000u;
}
