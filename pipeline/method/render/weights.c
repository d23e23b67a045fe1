/* The two weights of a ray (design.md, 5.4) in double: the reference for every faster version. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <math.h>

#include "pipeline/method/render/render.h"

double sst_weight_depth(double focus_px, double disp_px, double sigma_px, double c1)
{
    double z;

    if (isinf(sigma_px))
        return 1;
    if (isnan(disp_px))
        return c1;
    z = (focus_px - disp_px) / sigma_px;
    return (1 - c1) * exp(-0.5 * z * z) + c1;
}

double sst_weight_label(double focus_px, double range_min_px, double range_max_px, double quantum_px, double c2)
{
    const double middle = 0.5 * (range_min_px + range_max_px);
    const double half = 0.5 * fmax(range_max_px - range_min_px, quantum_px);
    const double u = (focus_px - middle) / half;

    /* -(f-min)(f-max) / half^2 with min, max = middle -+ half, without the product's cancellation near the ends. */
    return (1 - c2) * fmax(0, (1 - u) * (1 + u)) + c2;
}
