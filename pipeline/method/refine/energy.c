#include "pipeline/method/refine/parts.h"

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
    return sst_surface_consistency(m, region->mean, (float)tau);
}

float sst_energy_distance(uint32_t nearest2, uint32_t farthest2)
{
    return sst_surface_distance(nearest2, farthest2);
}

bool sst_energy_is_nearer(uint32_t nearest2, uint32_t farthest2, uint32_t other_nearest2, uint32_t other_farthest2)
{
    return (uint64_t)nearest2 * other_farthest2 < (uint64_t)other_nearest2 * farthest2;
}
