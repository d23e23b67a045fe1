#include "pipeline/method/refine/parts.h"

bool sst_region_has_normal(const struct sst_region *region)
{
    return region->normals > 0 && 2 * region->normals >= region->pixels;
}

double sst_energy_normal(const double m[3], const struct sst_region *region, double tau)
{
    const double *sum = region->normal_sum;
    const double s = m[0] * sum[0] + m[1] * sum[1] + m[2] * sum[2];

    return s > 0 ? -s / (s + tau * (double)region->normals) : 0;
}

double sst_energy_distance(uint32_t nearest2, uint32_t farthest2)
{
    return farthest2 ? (double)nearest2 / (double)farthest2 : 0;
}
