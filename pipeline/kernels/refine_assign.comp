// Labels of all pixels: the own one, the only candidate, or the one of least energy; four pixels a thread. Buffers and
// constants: pipeline/gpu/refine.h. Definition: refine_assign_reference().
#version 450

layout(local_size_x = 32, local_size_y = 8) in;

struct Choice {
    uint nearest2[2], farthest2[2], label[2];
};

struct Mean {
    float x, y, z;
    uint known;
};

layout(std430, binding = 0) readonly buffer View { uint view[]; };
layout(std430, binding = 1) readonly buffer Masks { uvec2 masks[]; };
layout(std430, binding = 2) readonly buffer Choices { Choice choices[]; };
layout(std430, binding = 3) readonly buffer Normals { vec4 normals[]; };
layout(std430, binding = 4) readonly buffer Means { Mean means[]; };
layout(std430, binding = 5) writeonly buffer Out { uint labels[]; };

layout(std430, push_constant) uniform Constants {
    int width, height;
    uint use_normals;
    float p_distance, p_normal, tau;
    int top, rows;
};

// sst_surface_reciprocal()
float reciprocal(float v)
{
    precise float r = uintBitsToFloat(0x7EF311C7u - floatBitsToUint(v));

    for (int i = 0; i < 4; i++) {
        precise float p = v * r;
        precise float rest = 2.0 - p;

        r = r * rest;
    }
    return r;
}

// sst_surface_distance(), digit by digit.
float distance_of(Choice c, int kind)
{
    const uint farthest = c.farthest2[kind];
    uint rest = c.nearest2[kind], share = 0;

    for (int i = 0; i <= 24; i++) {
        share <<= 1;
        if (rest >= farthest) {
            rest -= farthest;
            share |= 1;
        }
        rest <<= 1;
    }
    return float(int(share)) * 5.9604644775390625e-08;
}

float consistency(vec4 n, Mean m)
{
    precise float s = (n.x * m.x + n.y * m.y) + n.z * m.z;
    precise float below = s + tau;
    precise float share = s * reciprocal(below);

    return s > 1e-20 ? -share : 0.0;
}

uint decide(uint i)
{
    const Choice c = choices[i];
    const uint object = c.label[0], ground = c.label[1];
    precise float e_object = 0.0;
    precise float e_ground = 0.0;

    if (object == 0 || ground == 0)
        return object != 0 ? object : ground;
    e_object = p_distance * distance_of(c, 0);
    e_ground = p_distance * distance_of(c, 1);
    if (use_normals != 0 && means[object - 1].known != 0 && means[ground - 1].known != 0 && normals[i].w != 0.0) {
        precise float of_object = p_normal * consistency(normals[i], means[object - 1]);
        precise float of_ground = p_normal * consistency(normals[i], means[ground - 1]);

        e_object = e_object + of_object;
        e_ground = e_ground + of_ground;
    }
    if (e_object == e_ground)
        return min(object, ground);
    return e_object < e_ground ? object : ground;
}

uint label_of(uint i)
{
    const uint own = view[uint(top * width) + i] >> 16;
    const uvec2 mask = masks[i];
    const int count = bitCount(mask.x) + bitCount(mask.y);

    if (own != 0 || count == 0)
        return own;
    if (count > 1)
        return decide(i);
    return uint(mask.x != 0 ? findLSB(mask.x) : 32 + findLSB(mask.y)) + 1;
}

void main()
{
    const int words = (width + 3) / 4, x = 4 * int(gl_GlobalInvocationID.x), y = int(gl_GlobalInvocationID.y);
    uint four = 0;

    if (x >= width || y >= rows)
        return;
    for (int k = 0; k < 4 && x + k < width; k++)
        four |= label_of(uint(y * width + x + k)) << 8 * k;
    labels[y * words + x / 4] = four;
}
