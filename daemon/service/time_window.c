/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "daemon/service/service_internal.h"

#include <math.h>

#include "base/stats.h"

void window_add(struct time_window *w, double value, int64_t now_ns)
{
    w->value[w->count % SST_WINDOW] = (float)value;
    w->t_ns[w->count++ % SST_WINDOW] = now_ns;
    w->sum += value;
}

double window_quantile(const struct time_window *w, double q, int64_t now_ns)
{
    const uint64_t kept = w->count < SST_WINDOW ? w->count : SST_WINDOW;
    float sorted[SST_WINDOW];
    int n = 0;

    for (uint64_t i = 0; i < kept; i++)
        if (now_ns - w->t_ns[i] < SST_WINDOW_NS)
            sorted[n++] = w->value[i];
    return n ? (double)sst_stats_quantile_float(sorted, n, q) : (double)NAN;
}
