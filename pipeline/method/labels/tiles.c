/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/method/labels/labels_internal.h"

struct tiles tiles_plan(int total, int length, int unit)
{
    struct tiles t = { .total = total, .length = sst_min_int(length, total), .unit = unit, .count = 1 };
    int step;

    if (t.length == total)
        return t;
    t.overlap = length / 4;
    step = length - t.overlap - unit; /* starts are rounded to units; neighbours still overlap enough */
    t.count = 1 + (total - length + step - 1) / step;
    return t;
}

int tiles_start(const struct tiles *t, int k)
{
    const int64_t room = (t->total - t->length) / t->unit, steps = t->count - 1;

    return steps ? (int)((2 * room * k + steps) / (2 * steps)) * t->unit : 0;
}

/* Total weight of the windows from k on at `at`: 0 before the transition from k - 1 to k, 1 after it. */
static float total_weight(const struct tiles *t, int k, double at)
{
    double u;

    if (k <= 0)
        return 1;
    if (k >= t->count)
        return 0;
    u = at - (tiles_start(t, k) + tiles_start(t, k - 1) + t->length - t->overlap) / 2.0;
    u = sst_clamp_double(u / t->overlap, 0, 1);
    return (float)(u * u * (3 - 2 * u));
}

float tiles_weight(const struct tiles *t, int k, int i)
{
    const double at = tiles_start(t, k) + i + 0.5;

    return total_weight(t, k, at) - total_weight(t, k + 1, at);
}
