// One label among the candidates of pixels with a conflict: it is chosen, of objects or grounds, where its region is
// nearer, as a share of the farthest distance. Buffers and constants: pipeline/gpu/refine.h. Definition:
// refine_compete_reference().
#version 450
#extension GL_EXT_control_flow_attributes : require

layout(local_size_x = 32, local_size_y = 8) in;

struct Choice {
    uint nearest2[2], farthest2[2], label[2];
};

layout(std430, binding = 0) readonly buffer Masks { uvec2 masks[]; };
layout(std430, binding = 1) readonly buffer Columns { uint columns[]; };
layout(std430, binding = 2) readonly buffer Hull { ivec2 hull[]; };
layout(std430, binding = 3) buffer Choices { Choice choices[]; };

layout(std430, push_constant) uniform Constants {
    int width, height;
    uint label, kind, corners, weigh;
    int top, rows;
};

const uint FAR = 55000;            // beyond any distance; with r r its square is still below 2^32
const int AHEAD = 8, CORNERS = 4; // loads that do not wait for each other

uint squared(int row, int x)
{
    const uint d = min(columns[row + clamp(x, 0, width - 1)], FAR);

    return d * d;
}

// Columns that are farther than the nearest pixel so far have no nearer one. Beyond the picture its last column counts,
// which is nearer than that.
uint nearest_to(int x, int y)
{
    const int row = y * width, most = max(x, width - 1 - x);
    uint best = squared(row, x);

    for (int r = 1; r <= most && uint(r * r) < best; r += AHEAD) {
        uint next[AHEAD];

        [[unroll]] for (int i = 0; i < AHEAD; i++)
            next[i] = min(squared(row, x - r - i), squared(row, x + r + i)) + uint((r + i) * (r + i));
        [[unroll]] for (int i = 0; i < AHEAD; i++)
            best = min(best, next[i]);
    }
    return best;
}

// Of corners past the last one that one counts again.
uint farthest_to(ivec2 at)
{
    int best = 0;

    for (int i = 0; i < int(corners); i += CORNERS) {
        [[unroll]] for (int k = 0; k < CORNERS; k++) {
            const ivec2 d = hull[min(i + k, int(corners) - 1)] - at;

            best = max(best, d.x * d.x + d.y * d.y);
        }
    }
    return uint(best);
}

// a b < c d
bool less(uint a, uint b, uint c, uint d)
{
    uint high, low, other_high, other_low;

    umulExtended(a, b, high, low);
    umulExtended(c, d, other_high, other_low);
    return high < other_high || (high == other_high && low < other_low);
}

void main()
{
    const ivec2 at = ivec2(gl_GlobalInvocationID.xy);
    const int i = at.y * width + at.x;
    uint nearest2 = 1, farthest2 = 1;
    uvec2 mask;

    if (at.x >= width || at.y >= rows)
        return;
    mask = masks[i];
    if (((label > 32 ? mask.y >> (label - 33) : mask.x >> (label - 1)) & 1) == 0 ||
        bitCount(mask.x) + bitCount(mask.y) < 2)
        return;
    if (corners != 0) {
        nearest2 = nearest_to(at.x, at.y);
        farthest2 = farthest_to(at + ivec2(0, top));
    }
    if (weigh == 0 || farthest2 == 0) {
        nearest2 = 0;
        farthest2 = 1;
    }
    if (choices[i].label[kind] != 0 &&
        !less(nearest2, choices[i].farthest2[kind], choices[i].nearest2[kind], farthest2))
        return;
    choices[i].nearest2[kind] = nearest2;
    choices[i].farthest2[kind] = farthest2;
    choices[i].label[kind] = label;
}
