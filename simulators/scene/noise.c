#include "simulators/scene/noise.h"

#include <math.h>

uint64_t sst_random_u64(uint64_t *state)
{
    uint64_t z = *state += 0x9E3779B97F4A7C15u;

    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9u;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBu;
    return z ^ (z >> 31);
}

double sst_random(uint64_t *state)
{
    return (double)(sst_random_u64(state) >> 11) * 0x1p-53;
}

double sst_random_in(uint64_t *state, double lo, double hi)
{
    return lo + (hi - lo) * sst_random(state);
}

struct sst_vec3 sst_random_vec(uint64_t *state, double half)
{
    /* Separate statements: C does not define the order of calls within an expression. */
    const double x = sst_random_in(state, -half, half), y = sst_random_in(state, -half, half);
    const double z = sst_random_in(state, -half, half);

    return (struct sst_vec3){ x, y, z };
}

static inline uint32_t mix(uint32_t h)
{
    h ^= h >> 15;
    h *= 0x2C1B3C6Du;
    h ^= h >> 12;
    h *= 0x297A2D39u;
    return h ^ (h >> 15);
}

uint32_t sst_noise_hash(int32_t x, int32_t y, int32_t z, uint32_t seed)
{
    return mix((uint32_t)x * 0x9E3779B1u + (uint32_t)y * 0x85EBCA77u + (uint32_t)z * 0xC2B2AE3Du + seed * 0x27D4EB2Fu);
}

/* 24 bits fit a float exactly. */
static inline float corner(int32_t x, int32_t y, int32_t z, uint32_t seed)
{
    return (float)(sst_noise_hash(x, y, z, seed) >> 8) * 0x1p-24f;
}

static inline float smooth(float t)
{
    return t * t * (3 - 2 * t);
}

static float plane(const int32_t at[3], float u, float v, uint32_t seed)
{
    const int32_t x = at[0], y = at[1], z = at[2];
    const float a = corner(x, y, z, seed), b = corner(x + 1, y, z, seed);
    const float c = corner(x, y + 1, z, seed), d = corner(x + 1, y + 1, z, seed);
    const float top = a + (b - a) * u, bottom = c + (d - c) * u;

    return top + (bottom - top) * v;
}

float sst_noise(struct sst_vec3 p, uint32_t seed)
{
    const double fx = floor(p.x), fy = floor(p.y), fz = floor(p.z);
    const int32_t x = (int32_t)fx, y = (int32_t)fy, z = (int32_t)fz;
    const float u = smooth((float)(p.x - fx)), v = smooth((float)(p.y - fy));
    const float front = plane((const int32_t[3]){ x, y, z }, u, v, seed);

    if (p.z == 0)
        return front;
    return front + (plane((const int32_t[3]){ x, y, z + 1 }, u, v, seed) - front) * smooth((float)(p.z - fz));
}

float sst_noise_fbm(struct sst_vec3 p, int octaves, uint32_t seed)
{
    float sum = 0, weight = 1, total = 0;

    for (int i = 0; i < octaves; i++) {
        sum += weight * (sst_noise(p, seed + (uint32_t)i) - 0.5f);
        total += weight;
        weight *= 0.55f;
        p = (struct sst_vec3){ p.x * 2.03, p.y * 2.03, p.z * 2.03 };
    }
    sum = 0.5f + 1.7f * sum / total;
    return sum < 0 ? 0 : sum > 1 ? 1 : sum;
}
