/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "base/histogram.h"

#include <math.h>

/* Values up to 127 have a bucket each; from 128 on the six bits below the leading one choose it. */
static int bucket_of(uint64_t v)
{
    int shift;

    if (v < 128)
        return (int)v;
    shift = 63 - __builtin_clzll(v) - 6;
    return shift * 64 + (int)(v >> shift);
}

static int64_t last_of(int bucket)
{
    if (bucket < 128)
        return bucket;
    return (int64_t)(((uint64_t)(bucket % 64 + 64 + 1) << (bucket / 64 - 1)) - 1);
}

void sst_histogram_add(struct sst_histogram *h, int64_t value)
{
    if (value < 0)
        value = 0;
    if (!h->count || value < h->min)
        h->min = value;
    if (value > h->max)
        h->max = value;
    h->count++;
    h->bucket[bucket_of((uint64_t)value)]++;
}

int64_t sst_histogram_quantile(const struct sst_histogram *h, double q)
{
    const double wanted = ceil(q * (double)h->count);
    uint64_t sum = 0;

    for (int i = 0; i < SST_HISTOGRAM_BUCKETS && h->count; i++) {
        sum += h->bucket[i];
        if (sum > 0 && (double)sum >= wanted) {
            const int64_t v = last_of(i);

            return v > h->max ? h->max : v < h->min ? h->min : v;
        }
    }
    return h->max;
}
