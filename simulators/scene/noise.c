/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "simulators/scene/noise.h"

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

/* Factors of coordinates and seed in a hash. */
#define OF_X    0x9E3779B1u
#define OF_Y    0x85EBCA77u
#define OF_Z    0xC2B2AE3Du
#define OF_SEED 0x27D4EB2Fu

typedef uint32_t u32x4 __attribute__((vector_size(16)));
typedef int32_t s32x4 __attribute__((vector_size(16)));
typedef float f32x4 __attribute__((vector_size(16)));

/* Sanitizers are not ready when the loader chooses. */
#if defined(__x86_64__) && !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#define WIDE __attribute__((target_clones("avx2", "default")))
#else
#define WIDE
#endif

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
    return mix((uint32_t)x * OF_X + (uint32_t)y * OF_Y + (uint32_t)z * OF_Z + seed * OF_SEED);
}

static inline float smooth(float t)
{
    return t * t * (3 - 2 * t);
}

/* Between the hashes of four corners, the first of which is `at` before it is mixed; their 24 bits fit a float exactly. */
static inline float plane(uint32_t at, float u, float v)
{
    u32x4 h = { at, at + OF_X, at + OF_Y, at + OF_X + OF_Y };

    h ^= h >> 15;
    h *= 0x2C1B3C6Du;
    h ^= h >> 12;
    h *= 0x297A2D39u;
    h ^= h >> 15;

    const f32x4 c = __builtin_convertvector((s32x4)(h >> 8), f32x4) * 0x1p-24f;
    const float top = c[0] + (c[1] - c[0]) * u, bottom = c[2] + (c[3] - c[2]) * u;

    return top + (bottom - top) * v;
}

/* floor() within the range of the result. */
static inline int32_t whole(double v)
{
    const int32_t i = (int32_t)v;

    return i - (v < i);
}

static inline float noise(struct sst_vec3 p, uint32_t seed)
{
    const int32_t x = whole(p.x), y = whole(p.y), z = whole(p.z);
    const float u = smooth((float)(p.x - x)), v = smooth((float)(p.y - y));
    const uint32_t at = (uint32_t)x * OF_X + (uint32_t)y * OF_Y + (uint32_t)z * OF_Z + seed * OF_SEED;
    const float front = plane(at, u, v);

    if (p.z == 0)
        return front;
    return front + (plane(at + OF_Z, u, v) - front) * smooth((float)(p.z - z));
}

WIDE float sst_noise(struct sst_vec3 p, uint32_t seed)
{
    return noise(p, seed);
}

WIDE float sst_noise_fbm(struct sst_vec3 p, int octaves, uint32_t seed)
{
    float sum = 0, weight = 1, total = 0;

    for (int i = 0; i < octaves; i++) {
        sum += weight * (noise(p, seed + (uint32_t)i) - 0.5f);
        total += weight;
        weight *= 0.55f;
        p = (struct sst_vec3){ p.x * 2.03, p.y * 2.03, p.z * 2.03 };
    }
    sum = 0.5f + 1.7f * sum / total;
    return sum < 0 ? 0 : sum > 1 ? 1 : sum;
}
