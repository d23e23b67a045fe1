/* simulators/scene/noise.h - seeded random numbers and value noise; the same values on every machine. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_SIMULATORS_SCENE_NOISE_H
#define SST_SIMULATORS_SCENE_NOISE_H

#include "base/base.h"

struct sst_vec3 {
    double x, y, z;
};

/** Next number of the splitmix64 sequence (Steele, Lea, Flood 2014), 64 bits and 0 <= r < 1. */
uint64_t sst_random_u64(uint64_t *state);
double sst_random(uint64_t *state);

/** A number in lo .. hi. */
double sst_random_in(uint64_t *state, double lo, double hi);

/** A vector with coordinates in -half .. half. */
struct sst_vec3 sst_random_vec(uint64_t *state, double half);

/** Hash of a cell of the integer lattice. */
uint32_t sst_noise_hash(int32_t x, int32_t y, int32_t z, uint32_t seed);

/**
 * Value noise in 0..1: random values on the integer lattice, interpolated by smoothstep. If z is exactly 0, only the
 * plane is evaluated (four corners instead of eight).
 *
 * @param p  each coordinate below 2^30 in size
 */
float sst_noise(struct sst_vec3 p, uint32_t seed);

/** Sum of octaves of noise, each of twice the frequency and half the size; 0..1, mean 0.5, stretched to use the range.
 */
float sst_noise_fbm(struct sst_vec3 p, int octaves, uint32_t seed);

#endif
