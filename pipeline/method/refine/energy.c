/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/method/refine/parts.h"

#include <math.h>

void sst_region_add(struct sst_region *region, const float normal[3])
{
    for (int i = 0; i < 3; i++)
        region->sum_q20[i] += (int32_t)floorf(normal[i] * (float)SST_SURFACE_ONE + 0.5F);
    region->normals++;
}

void sst_region_finish(struct sst_region *region)
{
    const double all = (double)region->normals * SST_SURFACE_ONE;

    for (int i = 0; i < 3; i++)
        region->mean[i] = region->normals > 0 ? (float)((double)region->sum_q20[i] / all) : 0.0F;
}

bool sst_region_has_normal(const struct sst_region *region)
{
    return region->normals > 0 && 2 * region->normals >= region->pixels;
}

float sst_energy_normal(const float m[3], const struct sst_region *region, double tau)
{
    const float *mean = region->mean, s = (m[0] * mean[0] + m[1] * mean[1]) + m[2] * mean[2];

    return s > 1e-20F ? -(s * sst_reciprocal(s + (float)tau)) : 0.0F;
}

float sst_energy_distance(uint32_t nearest2, uint32_t farthest2)
{
    return farthest2 ? (float)(int32_t)(((uint64_t)nearest2 << 24) / farthest2) * 0x1p-24F : 0.0F;
}

bool sst_energy_is_nearer(uint32_t nearest2, uint32_t farthest2, uint32_t other_nearest2, uint32_t other_farthest2)
{
    return (uint64_t)nearest2 * other_farthest2 < (uint64_t)other_nearest2 * farthest2;
}
