#include "daemon/service/service_internal.h"

#include <string.h>

#include "base/stats.h"

void window_add(struct time_window *w, double value)
{
    w->value[w->count++ % SST_WINDOW] = (float)value;
    w->sum += value;
}

double window_quantile(const struct time_window *w, double q)
{
    const size_t n = w->count < SST_WINDOW ? (size_t)w->count : SST_WINDOW;
    float sorted[SST_WINDOW];

    memcpy(sorted, w->value, n * sizeof(sorted[0]));
    return (double)sst_stats_quantile_float(sorted, (int)n, q);
}
