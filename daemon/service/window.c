#include "daemon/service/service_internal.h"

#include <stdlib.h>
#include <string.h>

void window_add(struct time_window *w, double value)
{
    w->value[w->count++ % SST_WINDOW] = (float)value;
    w->sum += value;
}

static int compare(const void *a, const void *b)
{
    const float x = *(const float *)a, y = *(const float *)b;

    return (x > y) - (x < y);
}

double window_quantile(const struct time_window *w, double q)
{
    const size_t n = w->count < SST_WINDOW ? (size_t)w->count : SST_WINDOW;
    float sorted[SST_WINDOW];

    if (!n)
        return 0;
    memcpy(sorted, w->value, n * sizeof(sorted[0]));
    qsort(sorted, n, sizeof(sorted[0]), compare);
    return (double)sorted[sst_min_int((int)(q * (double)n), (int)n - 1)];
}
