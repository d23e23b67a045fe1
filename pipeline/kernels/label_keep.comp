// Labels that a step leaves, in the view that the next steps read. Buffers, constants and ways: pipeline/gpu/label.h.
// Definition: label_keep_reference().
#version 450

layout(local_size_x = 32, local_size_y = 8) in;

layout(std430, binding = 0) buffer View { uint view[]; };
layout(std430, binding = 1) readonly buffer From { uint source[]; };

layout(std430, push_constant) uniform Constants {
    int width, height;
    uint way, entropies, pitch;
    float limit;
};

const uint WORDS = 0, BYTES = 1, SURE = 2, ELECTED = 3, TAKEN = 4;

void main()
{
    const ivec2 at = ivec2(gl_GlobalInvocationID.xy);
    const uint n = uint(width * height), i = uint(at.y * width + at.x);
    uint byte, word;

    if (at.x >= width || at.y >= height)
        return;
    word = view[i];
    switch (way) {
    case WORDS:
        word = word & 0xFFFF | (source[i] & view[n + i] >> 24) << 16;
        if (entropies != 0)
            view[2 * n + i] = source[n + i];
        break;
    case BYTES:
        byte = uint(at.y) * pitch + uint(at.x);
        word = word & 0xFFFF | (source[byte >> 2] >> (byte & 3) * 8 & 0xFF) << 16;
        break;
    case SURE: word = uintBitsToFloat(view[2 * n + i]) < limit ? word : word & 0xFFFF; break;
    case ELECTED: word = word & 0xFFFFFF | source[i] << 24; break;
    case TAKEN: word = word & 0xFFFF | word >> 24 << 16; break;
    }
    view[i] = word;
}
